"""Clocks with a known offset and rate."""

import numpy as np
import pytest

from rotorid.errors import InputError
from rotorid.identify.stand.clocks import Lag, follow, lower_edge, pooled


def test_the_lower_edge_by_hand() -> None:
    # Host = 2 + device, each read 0 to 0.3 s late; the samples read at once lie at 0, 2 and 4 s.
    line = lower_edge(np.array([0.0, 1, 2, 3, 4]), np.array([2.0, 3.3, 4.0, 5.1, 6.0]), 0.01)
    assert line.offset_s == pytest.approx(2.0)
    assert line.rate == pytest.approx(1.0)
    assert line.host(np.array([1.5])) == pytest.approx([3.5])


def test_a_slow_clock_is_measured_through_delays() -> None:
    rng = np.random.default_rng(0)
    device = np.arange(0, 100, 0.01)
    line = lower_edge(device, 5 + 1.0001 * device + rng.exponential(0.02, len(device)), 0.001)
    assert line.rate == pytest.approx(1.0001, abs=3e-6)
    assert line.offset_s == pytest.approx(5, abs=3e-4)


def test_no_line_leaves_the_rates_that_a_clock_can_have() -> None:
    line = lower_edge(np.array([0.0, 1, 2]), np.array([0.0, 1.5, 3.0]), 0.001)
    assert line.rate == pytest.approx(1.001)
    with pytest.raises(InputError, match="at least two samples"):
        lower_edge(np.array([1.0]), np.array([1.0]), 0.01)


def trapezoid(time_s: np.ndarray) -> np.ndarray:
    return np.interp(time_s, [2, 5, 13, 16], [0.0, 1, 1, 0])


def test_follow_finds_delay_and_gain_beside_another_cause() -> None:
    rng = np.random.default_rng(1)
    time_s = np.arange(0, 18, 0.01)
    signal = 3 + 4 * trapezoid(time_s - 0.123) + 0.1 * time_s + rng.normal(0, 0.05, len(time_s))
    lag = follow(time_s, signal, trapezoid(time_s), 0.5, time_s[:, None])
    assert lag.delay_s == pytest.approx(0.123, abs=4 * lag.delay_error_s)
    assert lag.delay_error_s < 0.003
    assert lag.gain == pytest.approx(4, abs=0.02)


def test_follow_finds_skew_and_its_error() -> None:
    time_s = np.arange(0, 16, 0.01)
    wave = np.sin(2 * np.pi * 0.4 * time_s)
    found = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        when = time_s + 0.05 - 2e-3 * (time_s - time_s.mean())
        signal = np.sin(2 * np.pi * 0.4 * when) + rng.normal(0, 0.1, len(time_s))
        found.append(follow(time_s, signal, wave, 0.5, with_skew=True))
    skews = np.array([lag.skew for lag in found])
    assert skews.mean() == pytest.approx(2e-3, abs=1e-4)
    assert np.mean([lag.delay_s for lag in found]) == pytest.approx(-0.05, abs=1e-3)
    assert np.mean([lag.skew_error for lag in found]) == pytest.approx(skews.std(ddof=1), rel=0.35)


def test_a_constant_cause_is_refused() -> None:
    with pytest.raises(InputError, match="constant cause"):
        follow(np.arange(10.0), np.arange(10.0), np.ones(10), 1.0)


def test_pooling_by_hand() -> None:
    # Weights 1 and 4: mean (1 × 1 + 4 × 2)/5 = 1.8; χ² = 0.64 + 0.16 = 0.8 < 1, so the error is 5^−½.
    lags = [Lag(1.0, 1.0, 0, 0, 1), Lag(2.0, 0.5, 0, 0, 1)]
    assert pooled(lags) == pytest.approx((1.8, 5**-0.5))
    # Errors ten times smaller: χ² = 80 widens 5^−½/10 by √80.
    sure = [Lag(1.0, 0.1, 0, 0, 1), Lag(2.0, 0.05, 0, 0, 1)]
    assert pooled(sure) == pytest.approx((1.8, 5**-0.5 / 10 * 80**0.5))
