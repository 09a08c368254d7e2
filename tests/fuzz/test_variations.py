"""What a log may do to columns ends with a verdict or one sentence."""

import warnings

import pytest

from rotorid import api
from rotorid.errors import InputError
from rotorid.report.deliver import judge
from tests.fuzz.variations import varied

FEW, SEEDS, A_TEST = range(6), 600, 20


def ends_well(seed: int) -> str:
    """What is wrong with how the set of a seed is checked and judged; empty where nothing is."""
    recordings, said = varied(seed)
    try:
        tables = {run.name: run.table for run in recordings.runs}
        recordings = api.recording_set(tables, recordings.vehicle.model_dump(exclude_defaults=True))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            str(api.check(recordings))
            judge(recordings)
    except InputError as error:
        return "" if str(error).strip() and "\n" not in str(error) else f"{said}: {error!r}"
    except Exception as error:  # whatever it is, it is a fault of rotorid
        return f"{said}: {error!r}"
    return ""


@pytest.mark.parametrize("seed", [s for s in FEW if s % 3 == 0])
def test_a_few_variations_end_well(seed: int) -> None:
    assert not ends_well(seed)


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, SEEDS, A_TEST))
def test_variations_end_well(first: int) -> None:
    assert not [said for seed in range(first, first + A_TEST) if (said := ends_well(seed))]
