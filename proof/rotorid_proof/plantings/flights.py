"""The real flights in which something is planted, cut short so that many can be judged. Light: read at every start."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rotorid.recordings import RecordingSet


@dataclass(frozen=True)
class Flight:
    """A public set and how much of it is taken."""

    name: str
    set: str
    seconds: float
    """Longest stretch taken from each run, about its middle."""
    runs: tuple[str, ...] = ()
    """Runs taken; all where empty."""
    held_out: tuple[str, ...] | None = None
    has: str = ""
    """What is recorded, in words."""
    without: tuple[str, ...] = ()
    """Sensors whose columns are left out, as a vehicle without them records."""
    rate_hz: float | None = None
    """Rate to which the tables are thinned, every so many rows, as a slow logger writes them; None for all rows."""

    @property
    def reduced(self) -> bool:
        """Whether it is another flight with less recorded."""
        return bool(self.without) or self.rate_hz is not None


FLIGHTS = (
    Flight("neurobem", "neurobem", 12.0, has="motion capture, body rates, accelerometer, rotor speeds, voltage"),
    Flight(
        "imrc",
        "imrc-brushless",
        8.0,
        runs=("eckart00", "eckart01", "eckart12", "eckart13"),
        has="estimated state, gyroscope, accelerometer, commands, rotor speeds, voltage",
    ),
    Flight("arpl-10", "crazyflie-arpl-log10", 30.0, has="gyroscope, accelerometer, throttle"),
    Flight("arpl-15", "crazyflie-arpl-log15", 20.0, has="gyroscope, accelerometer, throttle"),
    Flight(
        "crazypad", "crazypad-normal", 8.0, has="estimated state without pitch, two accelerometers, throttle, voltage"
    ),
    Flight(
        "imrc-commands",
        "imrc-brushless",
        8.0,
        runs=("eckart00", "eckart01", "eckart12", "eckart13"),
        has="estimated state, gyroscope, accelerometer, commands, voltage",
        without=("rotors",),
    ),
    Flight(
        "neurobem-kinematic",
        "neurobem",
        12.0,
        has="motion capture, body rates, rotor speeds, voltage",
        without=("accelerometer",),
    ),
    Flight(
        "neurobem-50-hz",
        "neurobem",
        12.0,
        has="motion capture, body rates, accelerometer, rotor speeds, voltage, at 50 Hz",
        rate_hz=50.0,
    ),
    Flight("appius", "appius-ground-effect", 60.0, has="motion capture at 9 Hz, rotor speeds at 3 Hz, voltage"),
)


def flight(name: str) -> Flight:
    """The flight of that name."""
    return next(f for f in FLIGHTS if f.name == name)


def taken(recordings: RecordingSet, wanted: Flight) -> RecordingSet:
    """The runs and the stretches of a set that a flight takes, each from the middle of its run."""
    from rotorid_proof.plantings.columns import names_of

    gone = {name for sensor in wanted.without for name in names_of(recordings, sensor)}
    runs = []
    for run in recordings.runs:
        if wanted.runs and run.name not in wanted.runs:
            continue
        t = run.time_s
        inside = abs(t - 0.5 * (t[0] + t[-1])) <= 0.5 * wanted.seconds
        step_s = float(t[-1] - t[0]) / (len(t) - 1)
        every = 1 if wanted.rate_hz is None else max(1, round(1.0 / (wanted.rate_hz * step_s)))
        table = run.table[inside].iloc[::every].drop(columns=gone, errors="ignore")
        runs.append(replace(run, table=table.reset_index(drop=True)))
    return replace(recordings, name=wanted.name, runs=tuple(runs), held_out=wanted.held_out)
