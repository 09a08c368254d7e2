"""Between command and rotor speed: what the search finds on made commands, and what it leaves alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import SpeedPath
from rotorid.mismatch.motion import Segment
from rotorid.mismatch.speedpath import (
    MeasuredSpeed,
    SpeedSearch,
    candidate_forms,
    commanded_path,
    smoothed_acceleration,
    starts_of,
)

from .test_rows import still

RATE_HZ, FULL = 100.0, 2500.0


def form(effect_id: str, name: str):
    return {f.name: f for f in catalogue()[effect_id].speed_forms}[name]


def recorded(seed: int, noise: float = 10.0, seconds: float = 20.0, voltage=None, **at_work) -> Segment:
    """Commands with steps and sines, and the speeds that some effects (id to form and values) make of them."""
    rng = np.random.default_rng(seed)
    count = int(seconds * RATE_HZ)
    time_s = np.arange(count) / RATE_HZ
    steps = np.repeat(rng.uniform(-250, 250, (count // 40 + 1, 4)), 40, axis=0)[:count]
    waves = 100 * np.sin(2 * np.pi * rng.uniform(0.5, 8, 4) * time_s[:, None] + rng.uniform(0, 6, 4))
    command = 1100.0 + steps + waves
    path = SpeedPath(command, time_s, FULL, voltage, None if voltage is None else float(voltage.max()))
    chosen = [(form(k, name), np.array(values)) for k, (name, values) in at_work.items()]
    for made, values in sorted(chosen, key=lambda pair: pair[0].stage):
        path = replace(path, speed=made.apply(path, values))
    motion = still(count, time_s=time_s, rotor_speed=path.speed + noise * rng.standard_normal((count, 4)))
    return Segment("run", RATE_HZ, replace(motion, voltage=voltage), "accelerometer", command=command)


def searched(*segments: Segment):
    voltages = [s.motion.voltage for s in segments]
    full_voltage = None if voltages[0] is None else max(float(v.max()) for v in voltages)
    problem = MeasuredSpeed(list(segments), FULL, full_voltage)
    return SpeedSearch(problem, candidate_forms(list(segments))).run()


def test_a_chain_is_applied_in_the_order_of_its_stages():
    """Map 0.9 ω + 0, limit at 1000, then lag: a step from 0 to 1500 ends at the limit, whatever the order given."""
    segment = replace(recorded(0), command=np.vstack([np.zeros((1, 4)), np.full((1999, 4), 1500.0)]))
    chain = (
        ("motor_lag", form("motor_lag", "one constant")),
        ("command_saturation", form("command_saturation", "upper limit")),
        ("throttle_curve", form("throttle_curve", "affine")),
    )
    path = commanded_path(segment, chain, np.array([0.05, 0.4, 0.0, -0.1]), 0.0, FULL, None)
    # One sample after the step 0 → 1000: 1000 (1 − exp(−0.01/0.05)).
    assert path[2, 0] == pytest.approx(1000 * (1 - np.exp(-0.2)), rel=1e-9)
    assert path[-1, 0] == pytest.approx(1000.0)


def test_speeds_that_follow_at_once_leave_nothing_to_find():
    assert searched(recorded(0)).fit.chain == ()


@pytest.mark.parametrize("tau", [0.03, 0.072])
def test_a_lag_is_found_with_its_time_constant(tau):
    result = searched(recorded(1, motor_lag=("one constant", (tau,))), recorded(2, motor_lag=("one constant", (tau,))))
    ((effect_id, found),) = result.fit.chain
    assert (effect_id, found.name) == ("motor_lag", "one constant")
    sd = np.sqrt(result.fit.covariance[0, 0])
    assert abs(result.fit.values[0] - tau) < 4 * sd and sd < 0.002
    assert result.p_values["motor_lag"] < 1e-5 and result.alternatives["motor_lag"] == ()
    assert result.noise_rad_s == pytest.approx(10.0, rel=0.1)


def test_up_and_down_have_their_own_time_constants():
    result = searched(recorded(3, motor_lag=("up and down", (0.03, 0.06))))
    ((_, found),) = result.fit.chain
    assert found.name == "up and down"
    np.testing.assert_allclose(result.fit.values, [0.03, 0.06], atol=0.003)


def test_a_sagging_battery_and_a_lag_are_told_apart():
    voltage = np.linspace(12.4, 10.2, 2000)
    at_work = {"battery_sag": ("power of voltage", (0.9,)), "motor_lag": ("one constant", (0.04,))}
    result = searched(recorded(4, voltage=voltage, **at_work))
    assert sorted(k for k, _ in result.fit.chain) == ["battery_sag", "motor_lag"]
    assert result.fit.of("battery_sag")[1][0] == pytest.approx(0.9, abs=0.05)
    assert result.fit.of("motor_lag")[1][0] == pytest.approx(0.04, abs=0.002)


def test_a_delay_is_no_lag():
    result = searched(recorded(5, delay=("of the command", (0.045,))))
    assert [k for k, _ in result.fit.chain] == ["delay"]
    # The nuisance shift of half a sample shares it.
    assert result.fit.values[0] + result.fit.shift_s == pytest.approx(0.045, abs=0.001)


def test_a_lag_beside_a_delay_is_also_stated_as_the_lag_alone_that_others_fit():
    """A lag of 40 ms behind a delay of 20 ms: alone, the lag must make up for most of both."""
    both = searched(recorded(7, delay=("of the command", (0.02,)), motor_lag=("one constant", (0.04,))))
    assert sorted(k for k, _ in both.fit.chain) == ["delay", "motor_lag"]
    assert both.fit.of("motor_lag")[1].mean() == pytest.approx(0.04, abs=0.004)
    assert [k for k, _ in both.lag_alone.chain] == ["motor_lag"]
    assert 0.05 < both.lag_alone.values[0] < 0.08
    assert searched(recorded(8, motor_lag=("one constant", (0.04,)))).lag_alone is None


def test_without_a_voltmeter_no_power_of_the_voltage_is_tried():
    names = {f.name for _, f in candidate_forms([recorded(6)])}
    assert "power of voltage" not in names and "drift in time" in names
    assert "power of voltage" in {f.name for _, f in candidate_forms([recorded(6, voltage=np.full(2000, 12.0))])}


def test_starts_of_several_time_constants_are_equal_ones():
    assert [tuple(s) for s in starts_of(form("motor_lag", "up and down"))] == [(0.015,) * 2, (0.05,) * 2, (0.15,) * 2]
    assert [tuple(s) for s in starts_of(form("throttle_curve", "affine"))] == [(0.0, 0.0)]


def test_accelerations_of_a_ramp_at_full_length():
    ramp = 500.0 + 300.0 * np.arange(400)[:, None] / RATE_HZ * np.ones(4)
    out = smoothed_acceleration(ramp, RATE_HZ, 20.0)
    assert out.shape == ramp.shape
    np.testing.assert_allclose(out, 300.0, rtol=1e-9)
