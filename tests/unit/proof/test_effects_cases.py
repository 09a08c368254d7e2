"""Each effect names a concealed case in which it is claimed and one in which it is not: verdicts on both say so."""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.decide.findings import with_status
from rotorid.mismatch.decide.status import CLAIMED
from rotorid.recordings import read_set
from rotorid.report.deliver import analysis_of
from rotorid_proof.concealed.build import build
from rotorid_proof.concealed.cases import with_names

QUICK = ("compliance", "crosstalk", "mount_tilt")
"""Of a bench, a second or two each."""
SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in catalogue() if name not in QUICK]


@cache
def claimed(case: str) -> frozenset[str]:
    """Ids that a verdict on a concealed case claims, with all members of its classes."""
    with TemporaryDirectory() as folder:
        (hidden,) = with_names([case])
        build(hidden, Path(folder), Path(folder) / "answers")
        analysis = analysis_of(read_set(Path(folder) / hidden.set_name))
    return frozenset(i for f in with_status(analysis, *CLAIMED) for i in (f.id, *f.alternatives))


def test_each_effect_names_two_cases_that_there_are():
    named = {name: effect.cases for name, effect in catalogue().items()}
    assert all(len(cases) == 2 and cases[0] != cases[1] for cases in named.values())
    assert with_names(sorted({case for cases in named.values() for case in cases}))


@pytest.mark.parametrize("name", [*QUICK, *SLOW])
def test_an_effect_is_claimed_where_it_is_hidden_and_only_there(name):
    found_in, silent_in = catalogue()[name].cases
    assert name in claimed(found_in), f"{found_in}: claimed is {set(claimed(found_in))}"
    assert name not in claimed(silent_in)
