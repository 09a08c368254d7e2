"""Readings that are missing for a while: a sensor goes on remembering the load, and nothing is compared there."""

from dataclasses import replace

import numpy as np
import pytest

from rotorid.effects.amplifier_filter import EFFECT as AMPLIFIER
from rotorid.effects.loading import forms_of
from rotorid.mismatch.instrument.setup import pieces_of, set_up
from rotorid.mismatch.plant.readings import form_reading
from rotorid.recordings import Run
from tests.unit.mismatch.instrument.test_instrument import RATE_HZ, bench_set


def with_a_gap(start_s: float, stop_s: float):
    recordings = bench_set()
    first = recordings.runs[0]
    table = first.table.copy()
    table.loc[(table.time_s > start_s) & (table.time_s < stop_s), "force_z_n"] = np.nan
    return replace(recordings, runs=(Run(first.name, table), *recordings.runs[1:]))


def test_a_short_gap_stays_in_its_stretch_and_is_not_compared():
    """Half a second from 10 s on at 50 Hz: 24 samples lack between 10.00 and 10.50 s."""
    (x,) = [x for x in set_up(with_a_gap(10.0, 10.5)).loadings if x.run == "run1"]
    assert x.size == 30 * RATE_HZ and np.isfinite(x.reading[:, :3]).all()
    missing = x.time_s[~x.keep]
    assert len(missing) == 24 and missing[0] == pytest.approx(10.02) and missing[-1] == pytest.approx(10.48)
    assert [len(p) for p in pieces_of(x, 1)] == [501, 975]


def test_after_a_long_gap_a_new_stretch_begins():
    spans = [(x.time_s[0], x.time_s[-1]) for x in set_up(with_a_gap(10.0, 14.0)).loadings if x.run == "run1"]
    assert np.allclose(spans, [(0.0, 10.0), (14.0, 29.98)])


def test_one_missing_sample_is_filled():
    (x,) = [x for x in set_up(with_a_gap(10.0, 10.03)).loadings if x.run == "run1"]
    assert x.keep is None
    assert x.reading[501, 2] == pytest.approx((x.reading[500, 2] + x.reading[502, 2]) / 2)


def test_a_filter_has_settled_on_the_load_that_a_stretch_begins_with():
    setup = set_up(bench_set())
    x = setup.loadings[0]
    still = replace(x, load=np.broadcast_to(np.array([1.0, -2.0, 5.0, 0, 0, 0]), x.load.shape).copy())
    for form in forms_of(AMPLIFIER, setup.instrument):
        assert np.abs(form_reading(form, [2.0], still, setup.vehicle)).max() < 1e-12
