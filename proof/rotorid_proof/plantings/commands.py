"""Commands that the rotors follow late, by a curve, or less as the battery empties.

A flight without commands is given some: its measured speeds, low-passed, which the planted chain then stands before.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rotorid.recordings import RecordingSet, Run
from rotorid.recordings import columns as c
from rotorid.recordings.signal import kernels
from rotorid_proof.plantings.columns import command_of, dense, has, names_of, of_sensor, smooth
from rotorid_proof.plantings.kinds import Kind, Size, both, named

CHAIN = frozenset({"motor_lag", "delay", "throttle_curve", "battery_sag", "command_saturation"})
TOUCHES = frozenset({"commands", "throttle"})


def commanded(recordings: RecordingSet) -> tuple[RecordingSet, str]:
    """The set with something that commands its rotors, and which columns those are."""
    known = command_of(recordings)
    if known:
        return recordings, known
    speeds, commands = names_of(recordings, "rotors"), names_of(recordings, "commands")
    runs = []
    for run in recordings.runs:
        values = smooth(run, run.array(speeds))
        runs.append(Run(run.name, run.table.assign(**{n: values[:, k] for k, n in enumerate(commands)})))
    return replace(recordings, runs=tuple(runs)), "commands"


def _full(recordings: RecordingSet, driver: str) -> float:
    """The largest command, in the unit of its columns."""
    if driver == "throttle":
        return 1.0
    limits = recordings.vehicle.rotor_speed_limits_rad_s
    if limits:
        return float(limits[1])
    return max(float(np.nanmax(run.array(names_of(recordings, driver)))) for run in recordings.runs)


def lag(recordings: RecordingSet, tau_s: float, rng: np.random.Generator):
    """Commands passed through the inverse of a lag, c + τ dc/dt: a lag of τ brings them back."""
    out, driver = commanded(recordings)
    out = of_sensor(out, driver, lambda run, v: smooth(run, v) + tau_s * smooth(run, v, slope=True))
    sizes = ((Size("motor_lag", "tau", tau_s),),)
    throttles = [run.array(names_of(out, driver)) for run in out.runs] if driver == "throttle" else []
    beyond = any(np.nanmin(u) < 0.0 or np.nanmax(u) > 1.0 for u in throttles)
    unseen = "the planted throttle leaves the range from 0 to 1" if beyond else ""
    return out, named("motor_lag", sizes=sizes, first_only=CHAIN, unseen=unseen)


def dead_time(recordings: RecordingSet, late_s: float, rng: np.random.Generator):
    """Commands written earlier: the rotors answer them after a dead time."""
    out, driver = commanded(recordings)
    period = float(np.median([np.median(np.diff(run.time_s)) for run in recordings.runs]))
    steps = max(3, round(late_s / period))

    def earlier(run, values):
        moved = np.full_like(values, np.nan)
        moved[:-steps] = values[steps:]
        return moved

    sizes = tuple((Size("delay", s, steps * period),) for s in ("T", "T_d"))
    return of_sensor(out, driver, earlier), named("delay", sizes=sizes, first_only=CHAIN)


def curve(recordings: RecordingSet, b: float, rng: np.random.Generator):
    """Throttle u' for which u² = b u' + (1 − b) u'²: thrust is less square in the throttle than believed."""
    out, driver = commanded(recordings)
    full = _full(out, driver)

    def change(run, values):
        u = np.maximum(values / full, 0.0)
        return full * (-b + np.sqrt(b**2 + 4 * (1 - b) * u**2)) / (2 * (1 - b))

    sizes = ((Size("throttle_curve", "b", b),),)
    truth = named("throttle_curve", fair=("thrust_curve",), sizes=sizes, first_only=CHAIN)
    return of_sensor(out, driver, change), truth


def sag(recordings: RecordingSet, exponent: float, rng: np.random.Generator):
    """Commands times (V/V_0)^−p: rotors turn slower than commanded as the recorded voltage falls."""
    out, driver = commanded(recordings)
    full = max(float(np.nanmax(_voltage(run))) for run in recordings.runs)

    def change(run, values):
        return values * ((_voltage(run) / full) ** -exponent)[:, None]

    sizes = ((Size("battery_sag", "p", exponent),),)
    return of_sensor(out, driver, change), named("battery_sag", sizes=sizes)


def _voltage(run: Run) -> np.ndarray:
    """Battery voltage, (n,), V, holes bridged, smoothed over two seconds: its ripple is no sag."""
    v, t = run.column(c.BATTERY_VOLTAGE), run.time_s
    good = np.isfinite(v)
    filled = np.interp(t, t[good], v[good])
    return kernels.gaussian(filled, 1.0 / float(np.median(np.diff(t))))


def _drives(recordings: RecordingSet) -> bool:
    driver = command_of(recordings) or "rotors"
    return dense(recordings, driver)


def _sags(recordings: RecordingSet) -> bool:
    if not (_drives(recordings) and all(run.has(c.BATTERY_VOLTAGE) for run in recordings.runs)):
        return False
    volts = np.concatenate([_voltage(run) for run in recordings.runs])
    return volts.max() / volts.min() > 1.02 and has(recordings, "accelerometer")


KINDS = (
    Kind("commands", "motor_lag", TOUCHES, both(0.040, 0.015), _drives, lag),
    Kind("commands", "dead_time", TOUCHES, both(0.020, 0.008), _drives, dead_time),
    Kind("commands", "throttle_curve", TOUCHES, both(0.35, 0.15), _drives, curve),
    Kind("commands", "battery_sag", TOUCHES, both(1.0, 0.4), _sags, sag),
)
