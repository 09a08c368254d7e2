"""A recording may lack any group of its columns: the stage gives a verdict, or one sentence, never a traceback."""

import functools

import pytest

from rotorid.errors import InputError
from rotorid.mismatch.mistakes import find_mistakes
from rotorid.recordings import RecordingSet, read_set
from rotorid.recordings import columns as c
from rotorid.report.deliver import judge
from rotorid_lab.public_list import of_one_motor
from rotorid_lab.public_sets import PUBLIC_SETS
from rotorid_proof.concealed import build as concealed
from rotorid_proof.concealed import cases
from tests.public_logs import built
from tests.unit.mismatch.flights import recorded, with_table
from tests.unit.recordings.importers.test_public_sets import MANIFEST, VEHICLES

GROUPS = {
    "rotor_speeds": ("rotor_speed_",), "commands": ("rotor_command_", "throttle_"), "position": c.POSITION,
    "velocity": c.VELOCITY, "attitude": c.QUATERNION, "gyroscope": c.ANGULAR_VELOCITY,
    "accelerometer": c.SPECIFIC_FORCE, "pose": (*c.POSITION, *c.VELOCITY, *c.QUATERNION),
    "inertial": (*c.ANGULAR_VELOCITY, *c.SPECIFIC_FORCE), "battery": (c.BATTERY_VOLTAGE, c.BATTERY_CURRENT),
    "height": (c.HEIGHT,), "forces": c.FORCE, "moments": c.MOMENT, "mount": c.MOUNT, "reference": c.REFERENCE_FORCE,
}  # fmt: skip
CONCEALED = ("clean/000", "rate/0025/000", "multibody/clean/development/000", "continuous/clean/development/000")
INSTRUMENTS = (
    "bench/clean/000",
    "stand/clean/000",
    "bench/rig/clean/development/000",
    "stand/rig/clean/development/000",
)


def without(recordings: RecordingSet, group: str) -> RecordingSet | None:
    """The set without a group of columns; None where it has none of them."""
    starts = tuple(GROUPS[group])
    if not any(name.startswith(starts) for run in recordings.runs for name in run.table.columns):
        return None
    return with_table(recordings, lambda table: table[[n for n in table.columns if not n.startswith(starts)]])


def ends_well(recordings: RecordingSet) -> None:
    """The set has a verdict, or the stage stops with one sentence; anything else goes on to the test."""
    try:
        assert judge(recordings).sentence
    except InputError as stopped:
        assert "\n" not in str(stopped) and len(str(stopped)) > 20


@pytest.fixture(scope="module")
def flown() -> RecordingSet:
    """Two short flights made by hand with every sensor."""
    return recorded(1, 2, rate_hz=50.0, flight={"duration_s": 12.0})


@pytest.mark.parametrize("group", [g for g in GROUPS if g in ("rotor_speeds", "accelerometer", "pose", "inertial")])
def test_a_short_flight_without_a_group_of_columns(flown, group):
    ends_well(without(flown, group))


@pytest.mark.parametrize("group", list(GROUPS)[:9])
def test_the_search_for_mistakes_without_a_group_of_columns(flown, group):
    less = without(flown, group)
    if less is not None:
        assert find_mistakes(less)[1] == ()


@pytest.fixture(scope="module")
def real(tmp_path_factory: pytest.TempPathFactory):
    """Read public sets, each made once."""
    parent = tmp_path_factory.mktemp("real")

    @functools.cache
    def made(name: str) -> RecordingSet:
        return read_set(built(name, MANIFEST, VEHICLES, parent))

    return made


@pytest.fixture(scope="module")
def hidden(tmp_path_factory: pytest.TempPathFactory):
    """Read concealed sets, each flown once."""
    parent = tmp_path_factory.mktemp("concealed")

    @functools.cache
    def made(name: str) -> RecordingSet:
        case = next(c for c in cases.all_cases() if c.name == name)
        concealed.build(case, parent / "sets", parent / "answers")
        return read_set(parent / "sets" / case.set_name)

    return made


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in PUBLIC_SETS if not of_one_motor(name)])
def test_a_public_set_without_each_group_of_columns(real, name):
    for less in filter(None, (without(real(name), group) for group in GROUPS)):
        ends_well(less)


@pytest.mark.slow
@pytest.mark.parametrize("name", (*CONCEALED, *INSTRUMENTS))
def test_a_concealed_set_without_each_group_of_columns(hidden, name):
    for less in filter(None, (without(hidden(name), group) for group in GROUPS)):
        ends_well(less)
