"""Means that differ between runs: seen where something was changed, not where a sensor's noise is coloured."""

import re
from dataclasses import replace

import numpy as np
import pytest

from rotorid.mismatch.analyse import run_scale_notes
from rotorid.mismatch.evidence.comparison import apart, compared
from rotorid.mismatch.flight.fitted import refined_model, turning
from rotorid.mismatch.flight.prepare import prepare
from tests.unit.mismatch.flights import COLUMNS, recorded
from tests.unit.mismatch.synthetic import coloured

RATE_HZ = 40.0
RUNS = ("a", "b", "c")


def left(rng, means, pole=0.0, size=1200):
    """Half a minute of noise 1 a run, with a mean each."""
    return [mean + coloured(size, 1.0, rng, pole=pole) for mean in means]


@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_runs_with_one_mean_are_alike(pole):
    """200 sets; the p-values are no smaller than chance makes them."""
    rng = np.random.default_rng(0)
    p = np.array([compared(RUNS, left(rng, (0.5, 0.5, 0.5), pole), RATE_HZ)[1] for _ in range(200)])
    assert np.mean(p < 0.05) <= 0.1 and p.min() > 1e-4
    assert 0.2 < np.mean(p < 0.5) < 0.7


def test_a_run_whose_mean_is_off_is_seen():
    found = apart(RUNS, left(np.random.default_rng(1), (0.0, 2.0, 0.0)), RATE_HZ, 1.0)
    assert found is not None and found.p_value < 1e-12
    assert found.means["b"] == pytest.approx(2.0, abs=0.1)
    # (0 + 4 + 0) / 3, and with the second run half as long (0 + 2 + 0) / 2.5.
    assert found.mean_square(RUNS, (2, 2, 2)) == pytest.approx(4 / 3, rel=0.1)
    assert found.mean_square(RUNS, (2, 1, 2)) == pytest.approx(4 / 5, rel=0.1)


def test_a_difference_of_less_than_the_noise_does_not_matter():
    parts = left(np.random.default_rng(2), (0.0, 0.8, 0.0), size=40_000)
    assert compared(RUNS, parts, RATE_HZ)[1] < 1e-12 and apart(RUNS, parts, RATE_HZ, 1.0) is None


def test_a_bias_that_walks_is_no_change_between_flights():
    """20 sets whose sensor's bias walks by its noise in half a minute."""
    rng = np.random.default_rng(3)
    alarms = 0
    for _ in range(20):
        parts = [x + np.cumsum(rng.standard_normal(x.size)) / np.sqrt(x.size) * 0.5 for x in left(rng, (0, 0, 0))]
        alarms += apart(RUNS, parts, RATE_HZ, 1.0) is not None
    assert alarms == 0


def test_one_run_has_nothing_to_be_compared_with():
    assert compared(["a", "a"], left(np.random.default_rng(4), (0.0, 5.0)), RATE_HZ)[1] == 1.0


def test_a_change_in_the_middle_of_a_run_is_seen_in_the_runs_after():
    """By 2 from the middle of the second run on: its blocks alone would make of it a noise that walks."""
    parts = left(np.random.default_rng(5), (0.0, 0.0, 2.0, 2.0))
    parts[1][600:] += 2.0
    found = apart(("a", "b", "c", "d"), parts, RATE_HZ, 1.0)
    assert found is not None and found.means["b"] == pytest.approx(1.0, abs=0.15)


@pytest.mark.slow
def test_a_thrust_that_differs_between_runs_is_told_by_what_the_flights_show():
    """Rotors read 2 % fast in one of three runs: thrust per mass 1/1.02² as large there."""
    flown = recorded(1, 2, 3)
    table = flown.runs[1].table.copy()
    table[list(COLUMNS["rotors"])] *= 1.02
    runs = (flown.runs[0], replace(flown.runs[1], table=table), flown.runs[2])
    prepared = prepare(replace(flown, runs=runs, held_out=("run02",)))
    (note,) = run_scale_notes(refined_model(prepared, *turning(prepared)))
    told = {word[:5]: float(share) for word, share in re.findall(r"(run\d\d) ([+-]\d\.\d) %", note)}
    assert told == pytest.approx({"run00": 0.0, "run01": -3.9, "run02": 0.0}, abs=0.15)
