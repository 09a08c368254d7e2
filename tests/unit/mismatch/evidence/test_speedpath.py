"""Between command and rotor speed: what the search finds on made commands, and what it leaves alone."""

from dataclasses import replace

import numpy as np
import pytest

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import SpeedPath
from rotorid.mismatch.evidence.motion import Segment
from rotorid.mismatch.evidence.speedpath import (
    MeasuredSpeed,
    SpeedSearch,
    at_its_bounds,
    candidate_forms,
    commanded_path,
    smoothed_acceleration,
    starts_of,
)
from tests.unit.mismatch.evidence.test_rows import still
from tests.unit.mismatch.flights import smooth

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


def test_a_limit_that_is_never_reached_has_a_large_and_finite_variance():
    problem = MeasuredSpeed([recorded(0)], FULL, None)
    chain = (("command_saturation", form("command_saturation", "lower limit")),)
    fit = problem.with_covariance(problem.fit(chain, np.array([0.1])))
    assert np.isfinite(fit.covariance).all() and fit.covariance[0, 0] > 1e20


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
    assert result.noise == pytest.approx(np.full(4, 10.0), rel=0.1)


def test_a_lag_of_less_than_half_a_sample_is_none():
    """4 ms at 100 Hz: what commands do between two samples nobody recorded."""
    assert searched(recorded(1, noise=0.01, motor_lag=("one constant", (0.004,)))).fit.chain == ()
    ((effect_id, _),) = searched(recorded(1, noise=0.01, motor_lag=("one constant", (0.008,)))).fit.chain
    assert effect_id == "motor_lag"


SAG = np.linspace(12.4, 10.2, 2000)


@pytest.mark.parametrize(
    ("seed", "voltage", "at_work"),
    [
        (3, None, {"motor_lag": ("up and down", (0.03, 0.06), 0.003)}),
        (4, SAG, {"battery_sag": ("power of voltage", (0.9,), 0.05), "motor_lag": ("one constant", (0.04,), 0.002)}),
        (5, None, {"delay": ("of the command", (0.045,), 0.001)}),
    ],
    ids=["up and down each by its own constant", "a sagging battery and a lag", "a delay is no lag"],
)
def test_the_forms_at_work_are_found_with_their_values_and_no_others(seed, voltage, at_work):
    made = {key: (name, values) for key, (name, values, _) in at_work.items()}
    fit = searched(recorded(seed, voltage=voltage, **made)).fit
    assert {key: found.name for key, found in fit.chain} == {key: name for key, (name, *_) in at_work.items()}
    for key, (_, values, allowed) in at_work.items():
        # The nuisance shift of half a sample shares a delay.
        found = fit.of(key)[1] + (fit.nuisances["late"] if key == "delay" else 0.0)
        np.testing.assert_allclose(found, values, atol=allowed)


def test_a_limit_that_is_reached_in_one_second_of_twenty_is_found():
    """A burst of 0.2 s in 20 s goes 200 rad/s beyond the limit: twenty times the noise, in one second alone."""
    segment = recorded(7)
    command = np.minimum(segment.command, 1450.0)
    command[700:720] = 1650.0
    speed = np.minimum(command, 1450.0) + 10.0 * np.random.default_rng(8).standard_normal(command.shape)
    motion = replace(segment.motion, rotor_speed=speed)
    flown = [replace(segment, motion=motion, command=command)]
    # A believed full speed far above all that is ever asked for leaves the limit where it is.
    for full in (1650.0, 2600.0):
        result = SpeedSearch(MeasuredSpeed(flown, full, None), candidate_forms(flown)).run()
        assert [k for k, _ in result.fit.chain] == ["command_saturation"]
        assert result.fit.values[0] == pytest.approx(1450.0 / full, rel=0.01)


def test_a_limit_far_below_the_outermost_command_is_no_curve():
    """Rotors that saturate a third of the time a little above their hover, and one command that once goes far beyond.

    From starts near the outermost command alone the search stayed there, and a curve took the limit's place.
    """
    segment = recorded(11, seconds=40.0)
    time_s, rng = segment.motion.time_s, np.random.default_rng(3)
    command = 1100.0 + np.stack([smooth(rng, 10 * len(time_s), 60.0, 1.0)[::10] for _ in range(4)], axis=1)
    command[:, 0] += 700.0 * np.exp(-(((time_s - 20.0) / 0.3) ** 2))
    speed = np.minimum(command, 1130.0) + 2.0 * rng.standard_normal(command.shape)
    flown = [replace(segment, motion=replace(segment.motion, rotor_speed=speed), command=command)]
    result = SpeedSearch(MeasuredSpeed(flown, FULL, None), candidate_forms(flown)).run()
    assert [k for k, _ in result.fit.chain] == ["command_saturation"]
    assert result.fit.values[0] * FULL == pytest.approx(1130.0, rel=0.002)


def test_a_limit_that_holds_a_rotor_most_of_the_time_is_none():
    """Rotors that hardly move, three a little faster than the fourth: a limit would make them alike."""
    segment = recorded(9)
    rng = np.random.default_rng(9)
    command = np.array([1650.0, 1650.0, 1640.0, 1650.0]) + 0.5 * rng.standard_normal(segment.command.shape)
    speed = np.minimum(command, 1645.0) + 0.1 * rng.standard_normal(command.shape)
    flown = [replace(segment, motion=replace(segment.motion, rotor_speed=speed), command=command)]
    result = SpeedSearch(MeasuredSpeed(flown, 1650.0, None), candidate_forms(flown)).run()
    assert "command_saturation" not in [k for k, _ in result.fit.chain]


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


def test_a_curve_at_the_edge_of_what_is_physical_is_no_estimate():
    curve, lag = form("throttle_curve", "power of the throttle"), form("motor_lag", "one constant")
    assert at_its_bounds(curve, np.array([0.2])) and not at_its_bounds(curve, np.array([0.5]))
    assert at_its_bounds(form("command_saturation", "upper limit"), np.array([0.3000001]))
    # A lag of nothing is the absence of one, and is judged by its size.
    assert not at_its_bounds(lag, np.array([lag.parameters[0].low]))


@pytest.mark.parametrize("holds", [True, False])
def test_commands_hold_or_are_smooth_as_the_recording_says(holds):
    """At 25 Hz, what a lag of 60 ms makes of 2.3 and 4.1 Hz on a clock 40 times faster."""
    fine, finer, tau = 1000.0, 40, 0.06
    time_s = np.arange(int(30 * fine)) / fine
    smooth = 1100 + 150 * np.sin(2 * np.pi * 2.3 * time_s) + 100 * np.sin(2 * np.pi * 4.1 * time_s + 1.0)
    given = np.repeat(smooth[::finer], finer) if holds else smooth
    speed = np.empty_like(given)
    speed[0] = given[0]
    for k in range(1, len(given)):
        speed[k] = speed[k - 1] + (given[k - 1] - speed[k - 1]) * (1 - np.exp(-1 / (fine * tau)))
    rng = np.random.default_rng(5)
    read = np.stack([speed[::finer]] * 4, axis=1) + rng.standard_normal((len(time_s) // finer, 4))
    segment = Segment(
        "run",
        fine / finer,
        still(len(read), time_s=time_s[::finer], rotor_speed=read),
        "accelerometer",
        command=np.stack([smooth[::finer]] * 4, axis=1),
    )
    result = searched(segment)
    assert result.fit.holds is holds
    assert result.fit.of("motor_lag")[1][0] == pytest.approx(tau, rel=0.15)


def pruned(monkeypatch, p_values: dict[str, float], follows=lambda keys: True):
    """What pruning leaves of a lag and a curve that fail beside each other with these p-values and hold alone."""
    search = SpeedSearch(MeasuredSpeed([recorded(0)], FULL, None), [])
    chain = (("motor_lag", form("motor_lag", "one constant")), ("throttle_curve", form("throttle_curve", "affine")))
    fit = search.problem.fit(chain, np.array([0.02, 0.0, 0.0]))
    monkeypatch.setattr(search, "judge", lambda base, fit, key: (p_values[key] if base.chain else 0.0, 1.0, 1.0))
    monkeypatch.setattr(search, "negligible", lambda fit, key: False)
    monkeypatch.setattr(search, "responds", lambda fit: follows([k for k, _ in fit.chain]))
    dropped = {}
    left, bases = search._pruned(fit, dropped)
    assert [k for k, _ in left.chain] == list(bases)
    return list(bases), dropped


def test_of_two_that_fail_beside_each_other_the_less_significant_goes(monkeypatch):
    assert pruned(monkeypatch, {"motor_lag": 1e-3, "throttle_curve": 0.9})[0] == ["motor_lag"]
    assert pruned(monkeypatch, {"motor_lag": 0.9, "throttle_curve": 1e-3})[0] == ["throttle_curve"]


def test_no_curve_stays_behind_with_which_rotors_would_not_follow(monkeypatch):
    """A flat curve does without a lag: next to it the lag fails, and without the lag rotors do not move."""
    p_values = {"motor_lag": 0.6, "throttle_curve": 0.0}
    kept, dropped = pruned(monkeypatch, p_values, follows=lambda keys: keys != ["throttle_curve"])
    assert kept == ["motor_lag"]
    assert "hardly follow" in dropped["throttle_curve"]
