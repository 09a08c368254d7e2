"""Two loggers of one made-up experiment, their offset known."""

import numpy as np
import pandas as pd
import pytest

from rotorid.errors import InputError
from rotorid.identify.stand import align

OFFSET_S, LAG_S = -0.083, 0.055


def thrust_of(throttle: np.ndarray) -> np.ndarray:
    return 30 * throttle**1.4


def pair(seed: int, sine: bool, offset_s: float = OFFSET_S) -> align.Pair:
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
    for name in align.THROTTLES:
        quadrotor[name] = np.interp(sent, fine, 0.2 * share)
    felt = np.arange(0.0, 15.9, 0.01)
    lift = np.interp(felt, fine, speed**2) + rng.normal(0, 0.1, len(felt))
    wrench = pd.DataFrame({"time_s": felt, "host_s": felt + offset_s, "force_z_n": 6.4 - lift})
    return align.Pair(f"mine, try {seed}", seed, sine, quadrotor, wrench, (1.0, 1.0))


def test_offsets_come_back_within_their_errors() -> None:
    pairs = [pair(i, sine=i >= 6, offset_s=OFFSET_S + 0.05 * (i % 2)) for i in range(9)]
    aligned = align.align(pairs, thrust_of)
    assert aligned[0].motor_delay_s == pytest.approx(LAG_S, abs=0.006)
    for i, entry in enumerate(aligned):
        assert entry.offset_s == pytest.approx(OFFSET_S + 0.05 * (i % 2), abs=0.008)
        assert entry.offset_error_s < 0.006


def test_clocks_without_skew_show_none() -> None:
    skew, error = align.skew([pair(i, sine=True) for i in range(4)], thrust_of)
    assert abs(skew) < 3 * error
    assert error < 5e-4


def test_a_torque_test_aligns_on_the_speed() -> None:
    rng = np.random.default_rng(0)
    time_s = np.arange(0, 10, 0.02)
    rpm = np.interp(time_s, [2, 2.2, 8, 8.3], [0.0, 9000, 9000, 0])
    rotor = pd.DataFrame({"host_s": time_s, "speed_rpm": rpm})
    felt = np.arange(0, 10, 0.01)
    lift = np.interp(felt, time_s, rpm) ** 2 * 1.5e-8 + rng.normal(0, 0.1, len(felt))
    wrench = pd.DataFrame({"host_s": felt + 0.06, "force_z_n": -lift})
    found = align.torque_offset(rotor, wrench)
    assert found.delay_s == pytest.approx(0.06, abs=0.005)
    assert found.delay_error_s < 0.005


def test_recordings_of_an_emulator_faster_than_life_are_aligned_in_device_time() -> None:
    """Five device seconds a host second, read in batches: no quartz is that far off."""
    known = pair(6, sine=True)
    quadrotor, wrench = known.quadrotor.drop(columns="host_s"), known.wrench.drop(columns="host_s")
    wrench["time_s"] += 2.5  # switched on earlier
    for table, began_s, batch_s in ((quadrotor, 2.5, 0.04), (wrench, 0.0, 0.02)):
        table["host_time_s"] = np.ceil((table["time_s"] + began_s) / 5 / batch_s) * batch_s
    made = align.pair_of("fast", 6, True, quadrotor, wrench, 2e-4)
    (entry,) = align.align([made], thrust_of)
    felt = made.wrench["host_s"] - entry.offset_s  # on the quadrotor's clock
    np.testing.assert_allclose(felt, known.wrench["time_s"], atol=0.02)
    slow = align.pair_of("slow", 6, True, *(t.assign(host_time_s=t["time_s"]) for t in (quadrotor, wrench)), 2e-4)
    assert (slow.wrench["host_s"] == wrench["time_s"]).all()


def test_recordings_that_have_no_time_in_common_are_refused() -> None:
    made = pair(6, sine=True)
    first = made.quadrotor.assign(host_time_s=made.quadrotor["time_s"] / 5)
    second = made.wrench.assign(host_time_s=100 + made.wrench["time_s"] / 5)
    with pytest.raises(InputError, match="no time in common"):
        align.pair_of("apart", 6, True, first, second, 2e-4)
