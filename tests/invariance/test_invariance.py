"""What must not change a verdict does not: on every change a flight and an instrument, and on asking a folder of sets.

`ROTORID_INVARIANCE_SETS` may name a folder of recording sets: all in it are judged then, changed in each way.
"""

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rotorid.recordings import RecordingSet, read_set
from rotorid.recordings import columns as c
from rotorid.report.deliver import judge, verdict_of
from rotorid_proof.concealed import build, cases
from tests.invariance.__main__ import MOST_MOVED, MOST_MOVED_BY_LESS, read, summary
from tests.invariance.changes import CHANGES, LESS_IS_KNOWN, Changed
from tests.invariance.compare import difference
from tests.unit.mismatch.synthetic import analysis, drag_finding

OFTEN = ("single/rotor_drag/moderate/0", "single/unequal_rotors/moderate/0", "bench/single/crosstalk/moderate/0")
OWN = os.environ.get("ROTORID_INVARIANCE_SETS")
OWN_SETS = sorted(str(path.parent) for path in Path(OWN).glob("*/vehicle.yaml")) if OWN else []


@pytest.fixture(scope="module")
def judged(tmp_path_factory: pytest.TempPathFactory):
    """A set by its case or folder, and the verdict on it; each is judged once."""
    place, known = tmp_path_factory.mktemp("sets"), {}

    def of(name: str):
        if name not in known:
            if Path(name).is_dir():
                folder = Path(name)
            else:
                case = next(one for one in cases.all_cases() if one.name == name)
                build.build(case, place, place / "answers")
                folder = place / case.set_name
            recordings = read_set(folder)
            known[name] = recordings, judge(recordings)
        return known[name]

    return of


@pytest.mark.slow
@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("name", [*OFTEN, *OWN_SETS])
def test_the_verdict_is_the_same(name: str, change: str, judged) -> None:
    recordings, own = judged(name)
    changed = CHANGES[change](recordings, own.runs.held_out)
    if changed is None:
        pytest.skip("the set has not what this change needs")
    found = difference(own, judge(changed.recordings), changed)
    assert found.words == ()
    most = MOST_MOVED_BY_LESS if change in LESS_IS_KNOWN else MOST_MOVED
    assert not found.moved > most, found.which


def test_the_kept_table_is_what_the_page_says() -> None:
    """The page's summary is of the rows beside it."""
    kept = Path(__file__).parents[2] / "docs" / "proof"
    assert summary(read(kept / "invariance.tsv")) in (kept / "method.md").read_text()


def flight() -> RecordingSet:
    """The bundled example: two flights."""
    return read_set(Path(__file__).parents[2] / "src" / "rotorid" / "cli" / "examples")


def test_a_turned_world_moves_the_vehicle_alike() -> None:
    """Velocity in body axes stays what it was."""
    own, turned = flight(), CHANGES["turned"](flight(), ()).recordings
    for before, after in zip(own.runs, turned.runs, strict=True):
        assert np.allclose(in_body(before), in_body(after), atol=1e-9)
        assert not np.allclose(before.array(c.VELOCITY), after.array(c.VELOCITY))
        assert np.allclose(np.hypot(*after.array(c.VELOCITY)[:, :2].T), np.hypot(*before.array(c.VELOCITY)[:, :2].T))


def in_body(run) -> np.ndarray:
    """Velocity in body axes, (n, 3), m/s."""
    known = np.isfinite(run.array((*c.QUATERNION, *c.VELOCITY))).all(axis=1)
    turn = Rotation.from_quat(run.array(c.QUATERNION)[known][:, [1, 2, 3, 0]])
    return turn.inv().apply(run.array(c.VELOCITY)[known])


def test_renumbered_rotors_keep_their_places_and_speeds() -> None:
    own, changed = flight(), CHANGES["renumbered"](flight(), ())
    new = changed.recordings
    for number, old in changed.rotors.items():
        assert new.vehicle.rotors[number - 1] == own.vehicle.rotors[old - 1]
        for kind in ("rotor_speed", "rotor_command"):
            name, was = c.rotor_columns(kind, 4)[number - 1], c.rotor_columns(kind, 4)[old - 1]
            if own.runs[0].has(was):
                assert np.array_equal(new.runs[0].column(name), own.runs[0].column(was), equal_nan=True)
    assert changed.rotors != {k: k for k in changed.rotors}


def test_a_cut_run_holds_every_sample() -> None:
    own = flight()
    cut = CHANGES["cut_in_two"](own, (own.runs[1].name,)).recordings
    assert len(cut.runs) == 3 and cut.held_out == (own.runs[1].name,)
    assert sum(len(run.table) for run in cut.runs) == sum(len(run.table) for run in own.runs)


def test_a_difference_is_seen() -> None:
    """The comparison is not blind: another value, another word, another class."""
    own = verdict_of(analysis(findings=[drag_finding()]))
    assert difference(own, own, Changed(flight())).words == ()
    effect = next(e for e in own.effects if e.status == "established" and e.parameters)
    first = effect.parameters[0]
    wide = first.interval_95[1] - first.interval_95[0]
    moved = effect.model_copy(
        update={"parameters": (first.model_copy(update={"value": first.value + wide}), *effect.parameters[1:])}
    )
    others = tuple(e for e in own.effects if e is not effect)
    found = difference(own, own.model_copy(update={"effects": (moved, *others)}), Changed(flight()))
    assert found.words == () and found.moved == pytest.approx(1.0) and found.which.startswith(effect.id)
    gone = difference(own, own.model_copy(update={"effects": others, "verdict": "unexplained"}), Changed(flight()))
    assert len(gone.words) == 2
