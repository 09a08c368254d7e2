"""What is said of the last seconds of a flight: signs with their times, causes ranked, and nothing of a landing."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rotorid.recordings import columns as c
from rotorid.recordings.importers.endings import ending
from rotorid.recordings.importers.faults import airborne, flights
from rotorid.recordings.importers.logfile import read_log
from tests.command_line import answer
from tests.public_logs import public

STOP_S, RATE = 30.0, 100.0
TIME = np.arange(0, STOP_S + 3, 1 / RATE)
THROTTLES, SPEEDS = c.rotor_columns("throttle", 4), c.rotor_columns("rotor_speed", 4)


def hover(**after: tuple[float, dict[str, float]]) -> pd.DataFrame:
    """A hover of 30 s; of each entry from its time on the columns have other values."""
    rng = np.random.default_rng(0)
    table = pd.DataFrame({c.TIME: TIME} | dict.fromkeys((*THROTTLES, *SPEEDS, *c.QUATERNION, *c.SPECIFIC_FORCE), 0.0))
    table[list(THROTTLES)] = 0.5 + 0.02 * rng.standard_normal((len(TIME), 4))
    table[list(SPEEDS)] = 800 + 10 * rng.standard_normal((len(TIME), 4))
    table[list(c.SPECIFIC_FORCE)] = [0, 0, -9.81] + 0.3 * rng.standard_normal((len(TIME), 3))
    table[c.QUATERNION[0]] = 1.0
    for start_s, values in after.values():
        for name, value in values.items():
            table.loc[TIME >= start_s, name] = value
    return table


def tilted(degrees: float) -> dict[str, float]:
    half = np.radians(degrees) / 2
    return {c.QUATERNION[0]: np.cos(half), c.QUATERNION[1]: np.sin(half)}


OFF = dict.fromkeys(THROTTLES, 0.0)
GROUND = OFF | dict.fromkeys(SPEEDS, 0.0)
FALLS = dict.fromkeys(c.SPECIFIC_FORCE, 0.1)
ENDS = {
    "a motor gives out": (
        dict(a=(28.0, {SPEEDS[1]: 0.0}), b=(28.1, {THROTTLES[1]: 1.0}), c=(28.4, tilted(120)), d=(30.0, OFF)),
        ["at 28.00 s rotor 2 stands although it is driven", "rotor 2 is at its limit", "the attitude is lost",
         "all outputs go to zero while the vehicle is tilted by 120°"],
        "motor, propeller or speed controller of rotor 2",
    ),
    "an output goes to zero": (
        dict(a=(28.5, {THROTTLES[2]: 0.0}), b=(29.0, tilted(90))),
        ["at 28.50 s the output of rotor 3 goes to zero", "the attitude is lost"], "the signal of rotor 3",
    ),
    "switched off in the air": (
        dict(a=(29.5, OFF | FALLS), b=(31.0, {c.SPECIFIC_FORCE[2]: -90.0})),
        ["at 29.50 s all outputs go to zero and the vehicle falls", "a blow of 9 g"], "the motors were switched off",
    ),
    "the thrust is not enough": (
        dict(a=(27.0, dict.fromkeys(THROTTLES, 1.0))), ["all rotors are at their limit"], "the thrust was not enough",
    ),
    "control is lost": (
        dict(a=(29.0, tilted(100))), ["at 29.00 s the attitude is lost"], "control was lost",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", ENDS)
def test_what_happened_is_said_in_its_order_and_the_likeliest_cause_first(name: str) -> None:
    after, signs, cause = ENDS[name]
    happened, fits = ending(hover(**after), 1.0, STOP_S)
    places = [happened.index(sign) for sign in signs]
    assert places == sorted(places) and happened.count(";") == len(signs) - 1, happened
    assert fits.startswith(f"what fits, the likeliest first: {cause}")


LANDINGS = {
    "switched off on the ground": dict(a=(STOP_S, GROUND)),
    "a hard landing": dict(a=(STOP_S, GROUND | {c.SPECIFIC_FORCE[2]: -60.0})),
    "the log ends in the air": {},
    "a flip that is flown out": dict(a=(28.0, tilted(120)), b=(28.6, tilted(0))),
    "a race": dict(a=(9.0, tilted(150)), b=(9.5, tilted(0)), c=(29.0, tilted(150))),
    "a rotor that is often off": dict(
        a=(9.0, {THROTTLES[0]: 0.0}), b=(9.5, {THROTTLES[0]: 0.5}), c=(29.0, {THROTTLES[0]: 0.0})
    ),
}


@pytest.mark.parametrize("name", LANDINGS)
def test_nothing_is_said_of_a_landing_or_of_what_is_usual_in_a_flight(name: str) -> None:
    assert ending(hover(**LANDINGS[name]), 1.0, STOP_S) is None


def test_a_table_without_attitude_rotors_or_sensors_says_nothing() -> None:
    assert ending(hover()[[c.TIME]], 1.0, STOP_S) is None
    assert ending(hover(a=(1.5, tilted(90))), 1.0, 3.0) is None


def test_import_and_check_say_it(tmp_path: Path) -> None:
    table = hover(**ENDS["a motor gives out"][0], e=(STOP_S + 0.2, {c.SPECIFIC_FORCE[2]: -9.81}))
    _, found = flights(table, airborne(table)[0], "log", "log.bin")
    said = "log: the last seconds in the air: at 28.00 s rotor 2 stands"
    assert said in " ".join(f.sentence for f in found)
    table.to_csv(tmp_path / "log.csv", index=False)
    made = answer("import", tmp_path / "log.csv", "--like", "x500", "--mass-kg", "2", "-o", tmp_path / "own")
    assert said in made and f"How it ended:\n- {said}" in answer("check", tmp_path / "own")


@pytest.mark.parametrize(
    "name",
    ["logs/betaflight/shortLog.BFL", "logs/ardupilot/copter-3.4_22.BIN", "px4-flight-review/gps_interference.ulg"],
)
def test_nothing_is_said_of_public_flights_that_landed(name: str) -> None:
    assert not [f.sentence for f in read_log(Path(public(name))).faults if f.kind == "ending"]
