"""What is analysed of flights whose sensor stood still for so long that a side of the split lacks it."""

from dataclasses import replace

import pandas as pd
import pytest

from rotorid.errors import InputError
from rotorid.mismatch.evidence.split import parts_of, split_runs
from rotorid.mismatch.mistakes import dropout
from rotorid.recordings import RecordingSet
from rotorid.recordings import columns as c
from tests.unit.recordings.test_still import COUNT, FIRST, SECOND, SENSORS, SPEEDS, THROTTLES, flown, frozen, set_of


def left(*tables: pd.DataFrame, held_out=None) -> tuple[RecordingSet, tuple[str, ...]]:
    before = set_of(*tables, held_out=held_out)
    after, lost = dropout.find(before)
    assert lost is not None and lost.status == "established"
    return dropout.what_is_left(after, before, lost)


@pytest.mark.parametrize(
    "names", [n for n in SENSORS if n != c.POSITION], ids=lambda names: names[0] + f"_{len(names)}"
)
@pytest.mark.parametrize("part", [FIRST, SECOND], ids=["first half", "second half"])
def test_a_single_run_is_cut_to_where_every_sensor_reads(names, part: slice) -> None:
    kept, (note,) = left(frozen(flown(), names, part))
    (run,) = kept.runs
    assert run.time_s[-1] - run.time_s[0] == pytest.approx(10, abs=0.1)
    assert (run.time_s[0] < 1) == (part == SECOND)
    for side in parts_of(kept, split_runs(kept)):
        assert all(side.runs[0].table[n].notna().all() for n in names)
    assert "are analysed, where every sensor has readings" in note


def test_a_short_loss_cuts_nothing() -> None:
    kept, notes = left(frozen(flown(), c.ANGULAR_VELOCITY, slice(700, 800)))
    assert len(kept.runs[0].table) == COUNT and notes == ()


def test_a_single_run_of_a_comparison_holds_nothing_out() -> None:
    """Both sides of a comparison are used whole: a side of the split without any run lacks no sensor."""
    kept, notes = left(frozen(flown(), c.ANGULAR_VELOCITY, slice(700, 800)), held_out=())
    assert len(kept.runs[0].table) == COUNT and notes == ()
    kept, (note,) = left(frozen(flown(), c.ANGULAR_VELOCITY, FIRST), held_out=())
    assert kept.runs[0].time_s[0] >= 9.0 and "every sensor has readings" in note


def test_a_single_run_without_a_long_stretch_loses_the_sensor() -> None:
    kept, (note,) = left(frozen(flown(), c.ANGULAR_VELOCITY, slice(500, None)))
    assert not set(c.ANGULAR_VELOCITY) & set(kept.runs[0].table) and len(kept.runs[0].table) == COUNT
    assert "lost for too long" in note and c.ANGULAR_VELOCITY[0] in note
    with pytest.raises(InputError, match=r"rotor_speed_1_rad_s.*dropped out.*nothing is left that can be compared"):
        left(frozen(flown(), SPEEDS, slice(500, None)).drop(columns=list(THROTTLES)))


@pytest.mark.parametrize("names", [c.ANGULAR_VELOCITY, c.SPECIFIC_FORCE, c.QUATERNION, c.VELOCITY, THROTTLES])
def test_of_several_runs_the_few_without_a_sensor_are_left_out_else_the_sensor_is(names: tuple[str, ...]) -> None:
    whole = slice(150, None)
    kept, (note,) = left(frozen(flown(), names, whole), flown(seed=2), flown(seed=3), held_out=("run1", "run2"))
    assert [run.name for run in kept.runs] == ["run2", "run3"] and kept.held_out == ("run2",)
    assert "run1" in note
    kept, (note,) = left(frozen(flown(), names, whole), flown(seed=2))
    assert len(kept.runs) == 2 and not any(set(names) & set(run.table) for run in kept.runs)


def test_a_run_that_is_held_out_alone_and_lost_is_chosen_anew() -> None:
    kept, _ = left(
        frozen(flown(), c.SPECIFIC_FORCE, slice(150, None)), flown(seed=2), flown(seed=3), held_out=("run1",)
    )
    assert kept.held_out is None and replace(kept, held_out=None) == kept


def test_a_run_without_rotor_speeds_is_compared_by_its_commands() -> None:
    kept, notes = left(frozen(flown(), SPEEDS, slice(150, None)), flown(seed=2))
    assert len(kept.runs) == 2 and notes == () and kept.runs[1].has(*SPEEDS)
