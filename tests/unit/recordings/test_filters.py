"""Filters against numbers done by hand."""

import numpy as np
import pytest

from rotorid.recordings.signal import (
    first_order,
    mean_and_error,
    smoothing,
    spikes,
    steady,
    tare,
    without_spikes,
    zero_phase,
)
from tests.refusals import refused


def test_first_order_by_hand() -> None:
    # α = 1 − exp(−2π f_c/f_s) = 1/2 for f_c/f_s = ln 2 / 2π; a step of 1 then gives 0, 1/2, 3/4, 7/8.
    cutoff = np.log(2) / (2 * np.pi)
    assert smoothing(cutoff, 1.0) == pytest.approx(0.5)
    assert first_order(np.array([0.0, 1, 1, 1]), cutoff, 1.0) == pytest.approx([0, 0.5, 0.75, 0.875])
    both = first_order(np.array([[2.0, 0.0], [2.0, 1.0]]), cutoff, 1.0)
    assert both == pytest.approx(np.array([[2.0, 0.0], [2.0, 0.5]]))


def test_zero_phase_has_no_lag_and_halves_the_power_at_its_cutoff() -> None:
    wave = np.sin(2 * np.pi * 1.5 * np.arange(0, 60, 0.02))
    out = zero_phase(wave, 1.5, 50.0)[500:-500]
    assert np.max(out) == pytest.approx(np.sqrt(0.5), abs=2e-3)
    assert out == pytest.approx(np.sqrt(0.5) * wave[500:-500], abs=3e-3)
    late = first_order(wave, 1.5, 50.0)[500:-500]
    assert np.argmax(np.correlate(late, wave[500:-500], "full")) > len(late) - 1


def test_zero_phase_refuses_a_cutoff_above_half_the_rate() -> None:
    refused("must lie below half the rate of 50 Hz", zero_phase, np.zeros(10), 25.0, 50.0)


def test_a_spike_is_one_and_a_step_is_none() -> None:
    rng = np.random.default_rng(1)
    values = np.where(np.arange(200) < 100, 0.0, 50.0) + rng.normal(0, 0.1, 200)
    assert not spikes(values, 5, 12.0).any()
    values[40] += 5.0
    found = spikes(values, 5, 12.0)
    assert np.flatnonzero(found).tolist() == [40]
    mended = without_spikes(values, found)
    assert mended[40] == pytest.approx((values[39] + values[41]) / 2)


def test_a_constant_record_has_no_spikes() -> None:
    assert not spikes(np.ones(20), 5, 12.0).any()


def test_steady_is_said_at_the_end_of_the_stretch() -> None:
    values = np.array([0, 0, 0, 5, 5, 5, 5.0])
    assert steady(values, 3, 0.1).tolist() == [False, False, True, False, False, True, True]
    two = np.column_stack([values, np.zeros(7)])
    assert steady(two, 3, 0.1).tolist() == steady(values, 3, 0.1).tolist()


def test_tare_by_hand() -> None:
    values = np.array([[1.0, 10.0], [3.0, 20.0], [99.0, 99.0]])
    assert tare(values, 0, 1) == pytest.approx([2.0, 15.0])
    refused("no samples between 5 and 6", tare, values, 5, 6)


def test_mean_and_error_by_hand() -> None:
    # Two blocks with means 1 and 3: mean 2, standard deviation √2, error √2/√2 = 1.
    assert mean_and_error(np.array([0.0, 2.0, 2.0, 4.0]), 2) == pytest.approx((2.0, 1.0))
    # A sine over whole periods: each period has the same mean, so the error is nil.
    mean, error = mean_and_error(np.sin(2 * np.pi * np.arange(400) / 100), 4)
    assert (mean, error) == pytest.approx((0.0, 0.0), abs=1e-12)


def test_the_error_of_the_mean_covers_slow_noise() -> None:
    rng = np.random.default_rng(5)
    means, errors = [], []
    for _ in range(400):
        mean, error = mean_and_error(first_order(rng.normal(0, 1, 2000), 2.0, 100.0))
        means.append(mean)
        errors.append(error)
    assert np.mean(errors) == pytest.approx(np.std(means), rel=0.15)
