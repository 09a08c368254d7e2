"""Clocks with a known offset and rate: of one device by when its samples arrive, of two by what they measured."""

import numpy as np
import pandas as pd
import pytest

from rotorid_lab import clocks
from rotorid_lab.clocks import Lag, follow, lower_edge, pooled
from tests.refusals import refused

OFFSET_S, LAG_S = -0.083, 0.055


def test_the_lower_edge_by_hand() -> None:
    # Host = 2 + device, each read 0 to 0.3 s late; the samples read at once lie at 0, 2 and 4 s.
    line = lower_edge(np.array([0.0, 1, 2, 3, 4]), np.array([2.0, 3.3, 4.0, 5.1, 6.0]), 0.01)
    assert line == pytest.approx((2.0, 1.0))


def test_a_slow_clock_is_measured_through_delays() -> None:
    rng = np.random.default_rng(0)
    device = np.arange(0, 100, 0.01)
    offset_s, rate = lower_edge(device, 5 + 1.0001 * device + rng.exponential(0.02, len(device)), 0.001)
    assert rate == pytest.approx(1.0001, abs=3e-6)
    assert offset_s == pytest.approx(5, abs=3e-4)


def test_no_line_leaves_the_rates_that_a_clock_can_have() -> None:
    _, rate = lower_edge(np.array([0.0, 1, 2]), np.array([0.0, 1.5, 3.0]), 0.001)
    assert rate == pytest.approx(1.001)
    refused("at least two samples", lower_edge, np.array([1.0]), np.array([1.0]), 0.01)


def trapezoid(time_s: np.ndarray) -> np.ndarray:
    return np.interp(time_s, [2, 5, 13, 16], [0.0, 1, 1, 0])


def test_follow_finds_delay_and_gain_beside_another_cause() -> None:
    rng = np.random.default_rng(1)
    time_s = np.arange(0, 18, 0.01)
    signal = 3 + 4 * trapezoid(time_s - 0.123) + 0.1 * time_s + rng.normal(0, 0.05, len(time_s))
    lag = follow(time_s, signal, trapezoid(time_s), 0.5, time_s[:, None])
    assert lag.delay_s == pytest.approx(0.123, abs=4 * lag.delay_error_s) and lag.delay_error_s < 0.003
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
    refused("constant cause", follow, np.arange(10.0), np.arange(10.0), np.ones(10), 1.0)


def test_pooling_by_hand() -> None:
    # Weights 1 and 4: mean (1 × 1 + 4 × 2)/5 = 1.8; χ² = 0.64 + 0.16 = 0.8 < 1, so the error is 5^−½.
    assert pooled([Lag(1.0, 1.0, 0, 0, 1), Lag(2.0, 0.5, 0, 0, 1)]) == pytest.approx((1.8, 5**-0.5))
    # Errors ten times smaller: χ² = 80 widens 5^−½/10 by √80.
    sure = [Lag(1.0, 0.1, 0, 0, 1), Lag(2.0, 0.05, 0, 0, 1)]
    assert pooled(sure) == pytest.approx((1.8, 5**-0.5 / 10 * 80**0.5))


def thrust_of(throttle: np.ndarray) -> np.ndarray:
    return 30 * throttle**1.4


def pair(seed: int, sine: bool, offset_s: float = OFFSET_S) -> clocks.Pair:
    """Sine or trapezoid of four motors with a first-order lag, sag and lift; the wrench's host times are
    `offset_s` late."""
    rng = np.random.default_rng(seed)
    fine = np.arange(0, 16, 0.001)
    if sine:
        share = np.where((fine > 1) & (fine < 15), 0.5 - 0.5 * np.cos(2 * np.pi * 0.5 * (fine - 1)), 0.0)
    else:
        share = np.interp(fine, [1, 4, 12, 15], [0, 1, 1, 0])
    asked = 4 * thrust_of(0.2 * share)
    # A lag of the speed; thrust is its square, the current its cube.
    speed = np.zeros_like(fine)
    for i in range(1, len(fine)):
        speed[i] = speed[i - 1] + (np.sqrt(asked[i]) - speed[i - 1]) * 0.001 / LAG_S
    sent = np.arange(0.0, 15.8, 0.02)
    voltage = 16.5 - 0.02 * np.interp(sent, fine, speed**3) + rng.normal(0, 0.01, len(sent))
    quadrotor = pd.DataFrame({"time_s": sent, "host_s": sent, "battery_voltage_v": voltage})
    for name in clocks.THROTTLES:
        quadrotor[name] = np.interp(sent, fine, 0.2 * share)
    felt = np.arange(0.0, 15.9, 0.01)
    lift = np.interp(felt, fine, speed**2) + rng.normal(0, 0.1, len(felt))
    wrench = pd.DataFrame({"time_s": felt, "host_s": felt + offset_s, "force_z_n": 6.4 - lift})
    return clocks.Pair(f"mine, try {seed}", seed, sine, quadrotor, wrench, (1.0, 1.0))


def test_offsets_come_back_within_their_errors() -> None:
    pairs = [pair(i, sine=i >= 6, offset_s=OFFSET_S + 0.05 * (i % 2)) for i in range(9)]
    aligned = clocks.align(pairs, thrust_of)
    assert aligned[0].motor_delay_s == pytest.approx(LAG_S, abs=0.006)
    for i, entry in enumerate(aligned):
        assert entry.offset_s == pytest.approx(OFFSET_S + 0.05 * (i % 2), abs=0.008)
        assert entry.offset_error_s < 0.006


def test_clocks_without_skew_show_none() -> None:
    skew, error = clocks.skew([pair(i, sine=True) for i in range(4)], thrust_of)
    assert abs(skew) < 3 * error
    assert error < 5e-4


def test_a_torque_test_aligns_on_the_speed() -> None:
    rng = np.random.default_rng(0)
    time_s = np.arange(0, 10, 0.02)
    rpm = np.interp(time_s, [2, 2.2, 8, 8.3], [0.0, 9000, 9000, 0])
    rotor = pd.DataFrame({"host_s": time_s, "speed_rpm": rpm})
    felt = np.arange(0, 10, 0.01)
    lift = np.interp(felt, time_s, rpm) ** 2 * 1.5e-8 + rng.normal(0, 0.1, len(felt))
    found = clocks.torque_offset(rotor, pd.DataFrame({"host_s": felt + 0.06, "force_z_n": -lift}))
    assert found.delay_s == pytest.approx(0.06, abs=0.005) and found.delay_error_s < 0.005


def test_recordings_of_an_emulator_faster_than_life_are_aligned_in_device_time() -> None:
    """Five device seconds a host second, read in batches: no quartz is that far off."""
    known = pair(6, sine=True)
    quadrotor, wrench = known.quadrotor.drop(columns="host_s"), known.wrench.drop(columns="host_s")
    wrench["time_s"] += 2.5  # switched on earlier
    for table, began_s, batch_s in ((quadrotor, 2.5, 0.04), (wrench, 0.0, 0.02)):
        table["host_time_s"] = np.ceil((table["time_s"] + began_s) / 5 / batch_s) * batch_s
    made = clocks.pair_of("fast", 6, True, quadrotor, wrench, 2e-4)
    (entry,) = clocks.align([made], thrust_of)
    felt = made.wrench["host_s"] - entry.offset_s  # on the quadrotor's clock
    np.testing.assert_allclose(felt, known.wrench["time_s"], atol=0.02)
    slow = clocks.pair_of("slow", 6, True, *(t.assign(host_time_s=t["time_s"]) for t in (quadrotor, wrench)), 2e-4)
    assert (slow.wrench["host_s"] == wrench["time_s"]).all()


def test_recordings_that_have_no_time_in_common_are_refused() -> None:
    made = pair(6, sine=True)
    first = made.quadrotor.assign(host_time_s=made.quadrotor["time_s"] / 5)
    second = made.wrench.assign(host_time_s=100 + made.wrench["time_s"] / 5)
    refused("no time in common", clocks.pair_of, "apart", 6, True, first, second, 2e-4)
