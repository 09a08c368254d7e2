"""What a log may do to columns ends with a verdict or one sentence, and with the verdict of the set as it was before,
unless `check` doubts what was done or the recording was left with little."""

import warnings

import pytest

from rotorid import api
from rotorid.errors import InputError
from rotorid.mismatch.tell.verdict import Verdict
from rotorid.recordings import RecordingSet
from rotorid.report.deliver import judge
from tests.fuzz.variations import varied

FEW, SEEDS, A_TEST = (0, 3, 4), 600, 20
OTHERWISE, UNDOUBTED = 2, "no doubt is said"
"""Of the sets of a test at most so many are answered otherwise in silence: three of a hundred stands are (speeds held
in few rows, a hole next to a noise floor that is low by chance). None ends in a fault."""
WORSE = ("no_mismatch", "not_judged", "explained", "partly_explained", "unexplained")
MEANT = {"sensor_dropout", "quantisation"}
"""Names of what a hole, a sensor that stands still, or rounding is."""


def answer(verdict: Verdict) -> tuple[str, set[str]]:
    """The word of a verdict and the names in it; `no_mismatch` where it names nothing but what was done to the set."""
    stated = {e.id for e in verdict.effects if e.status in ("established", "ambiguous")} | set(verdict.parameters)
    word = "no_mismatch" if stated and stated <= MEANT and verdict.verdict == "explained" else verdict.verdict
    return word, stated - MEANT


def ends_well(seed: int) -> str:
    """What is wrong with how the set of a seed is checked and judged; empty where nothing is."""
    before, recordings, said = varied(seed)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return _answered_otherwise(before, recordings, said)
    except InputError as error:
        return "" if str(error).strip() and "\n" not in str(error) else f"{said}: {error!r}"
    except Exception as error:  # whatever it is, it is a fault of rotorid
        return f"{said}: {error!r}"


def _answered_otherwise(before: RecordingSet, recordings: RecordingSet, said: str) -> str:
    """How a set is answered otherwise than before it was varied, where no doubt that is new says why; else empty."""
    tables = {run.name: run.table for run in recordings.runs}
    recordings = api.recording_set(tables, recordings.vehicle.model_dump(exclude_defaults=True))
    checked = api.check(recordings)
    str(checked)
    word, names = answer(judge(recordings))
    if word in ("no_mismatch", "not_judged") and not names:
        return ""
    doubts = {doubt.sentence for doubt in checked.doubts} - {doubt.sentence for doubt in api.check(before).doubts}
    was, there = answer(judge(before))
    if doubts or (WORSE.index(word) <= WORSE.index(was) and names <= there):
        return ""
    return f"{said}: {word} {sorted(names)} was {was} {sorted(there)}, and {UNDOUBTED}"


@pytest.mark.parametrize("seed", FEW)
def test_a_few_variations_end_well(seed: int) -> None:
    assert not ends_well(seed)


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, SEEDS, A_TEST))
def test_variations_end_well(first: int) -> None:
    wrong = [said for seed in range(first, first + A_TEST) if (said := ends_well(seed))]
    assert not [said for said in wrong if not said.endswith(UNDOUBTED)] and len(wrong) <= OTHERWISE, wrong
