"""The path from command to thrust without recorded rotor speeds: read where commands are the cause, silent else."""

from dataclasses import replace

import numpy as np
import pytest

from rotorid.effects.contract import LAG
from rotorid.effects.motor_lag import lagged
from rotorid.mismatch.evidence import lift
from rotorid.mismatch.evidence.lift import causal_bands, chain_of_lift, read_path
from rotorid.mismatch.evidence.motion import Segment
from tests.unit.mismatch.evidence.test_rows import still
from tests.unit.mismatch.flights import quad

RATE_HZ, FULL, DT = 100.0, 2000.0, 0.01
VEHICLE = quad(rotor_speed_limits_rad_s=(0.0, FULL))
WEIGHT_N = VEHICLE.mass_kg * VEHICLE.gravity_m_s2
HOVER = 0.6


def coloured(rng, count: int, highest_hz: float) -> np.ndarray:
    """Noise (count,) below a frequency, one-sigma 1."""
    spectrum = np.fft.rfft(rng.standard_normal(count))
    spectrum[np.fft.rfftfreq(count, DT) > highest_hz] = 0.0
    values = np.fft.irfft(spectrum, count)
    return values / values.std()


def flown(u: np.ndarray, elasticity: float, tau_s: float, rng, sag: float = 0.0, gust: float = 0.005) -> Segment:
    """A stretch at throttles u (n,), the same on every rotor; the weight is carried at HOVER and half of the sag."""
    count = len(u)
    voltage = np.linspace(12.0, 10.5, count)
    thrust = WEIGHT_N * (u / HOVER) ** elasticity * (voltage / 11.25) ** sag
    made = lagged(np.sqrt(thrust)[:, None], tau_s, tau_s, DT, holds=False)[:, 0] ** 2
    force = np.zeros((count, 3))
    force[:, 2] = -(made / VEHICLE.mass_kg + gust * VEHICLE.gravity_m_s2 * coloured(rng, count, 5.0))
    motion = still(count, time_s=DT * np.arange(count), specific_force=force, voltage=voltage if sag else None)
    command = np.repeat(u[:, None] * FULL, 4, axis=1)
    return Segment("run", RATE_HZ, motion, "accelerometer", command=command, full_speed=FULL, measured_speed=False)


def asked(seed: int, seconds: float = 30.0) -> np.ndarray:
    """Throttles that somebody asked for, below 3 Hz."""
    return HOVER * (1.0 + 0.08 * coloured(np.random.default_rng(seed), int(seconds * RATE_HZ), 3.0))


@pytest.mark.parametrize("elasticity", [1.2, 2.0, 2.8])
@pytest.mark.parametrize("tau_s", [0.03, 0.07])
def test_curve_and_lag_of_throttles_that_were_asked_for(elasticity, tau_s):
    rng = np.random.default_rng(1)
    found = read_path([flown(asked(k), elasticity, tau_s, rng) for k in (1, 2)], VEHICLE, RATE_HZ)
    value, sd = found.elasticity
    assert value == pytest.approx(elasticity, rel=0.05) and abs(value - elasticity) < 1.96 * sd
    assert found.lag_s[0] == pytest.approx(tau_s, rel=0.15) and abs(found.lag_s[0] - tau_s) < 1.96 * found.lag_s[1]
    assert found.curved == (elasticity != 2.0)


def test_a_sagging_battery_is_read_next_to_the_curve():
    rng = np.random.default_rng(2)
    found = read_path([flown(asked(k), 1.5, 0.05, rng, sag=1.8) for k in (3, 4)], VEHICLE, RATE_HZ)
    assert found.elasticity[0] == pytest.approx(1.5, rel=0.05)
    assert found.voltage[0] == pytest.approx(1.8, abs=0.15) and found.sags
    chain = chain_of_lift([flown(asked(3), 1.5, 0.05, rng, sag=1.8)], VEHICLE, FULL, 12.0, RATE_HZ)
    assert {key for key, _ in chain.result.fit.chain} == {"throttle_curve", "battery_sag", "motor_lag"}


def test_the_scale_is_what_carries_the_weight():
    """Believed to lift 4 C_F (0.6 · 2000)² = 7.99 N of 6.40: rotors turn by the root of that slower than believed."""
    segment = flown(asked(5), 2.0, 0.03, np.random.default_rng(3))
    chain = chain_of_lift([segment], VEHICLE, FULL, None, RATE_HZ)
    lift = VEHICLE.thrust_coefficients_n_s2()[0] * (chain.speeds(segment) ** 2).sum(axis=1)
    assert lift.mean() == pytest.approx(-VEHICLE.mass_kg * segment.motion.specific_force[:, 2].mean(), rel=0.005)


def answering(seed: int, gain: float, noise: float = 0.0) -> Segment:
    """A hover whose throttle does nothing but answer gusts of 1 % of the weight, by the climb that they made."""
    rng = np.random.default_rng(seed)
    count, climb, place, made = 4000, 0.0, 0.0, 9.81
    gust = 0.1 * coloured(rng, count, 4.0)
    u, felt = np.empty(count), np.empty(count)
    for k in range(count):
        want = 9.81 - gain * (climb + noise * rng.standard_normal()) - 0.6 * gain * place
        u[k] = HOVER * np.sqrt(want / 9.81)
        made += (want - made) * DT / 0.03
        felt[k] = made + gust[k]
        climb += (felt[k] - 9.81) * DT
        place += climb * DT
    segment = flown(u, 2.0, 0.03, rng)
    force = np.stack([0 * felt, 0 * felt, -felt], axis=1)
    return replace(segment, motion=replace(segment.motion, specific_force=force))


@pytest.mark.parametrize("gain", [1.5, 3.0, 6.0])
@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_where_the_controller_answers_gusts_nothing_is_stated(gain, noise):
    chain = chain_of_lift([answering(k, gain, noise) for k in (7, 8)], VEHICLE, FULL, None, RATE_HZ)
    assert chain.result.fit.chain == ()
    assert {"throttle_curve", "motor_lag"} <= chain.result.silent.keys()


def test_commands_that_come_too_slowly_say_no_lag():
    found = read_path([flown(asked(k), 1.4, 0.05, np.random.default_rng(4)) for k in (9, 10)], VEHICLE, 5.0)
    assert found.lag_s is None and "5 times a second" in found.reasons[LAG]


def response(gain, tau_s: float, delay_s: float, noise: float = 0.05):
    """Spectra of 40 pieces of 3 s up to 13 Hz, and what a lag and a delay make of them, with a share of noise."""
    rng = np.random.default_rng(5)
    f_hz = np.arange(40) / 3.0
    made, more = rng.standard_normal((2, 40, 40)) + 1j * rng.standard_normal((2, 40, 40))
    law = gain(f_hz) * np.exp(-2j * np.pi * f_hz * delay_s) / (1 + 2j * np.pi * f_hz * tau_s)
    return f_hz, made, law * (made + noise * more)


def test_bands_of_a_cause_and_of_an_answer():
    own = causal_bands(*response(lambda f: 0.9 + 0 * f, 0.05, 0.0), (0.3, 2.0), (0.0, 13.0))
    assert own.tau_s == pytest.approx(0.05, rel=0.1) and own.gain == pytest.approx(0.9, rel=0.05)
    assert own.alone[1] > own.alone[0] + 9.0  # no delay
    late = causal_bands(*response(lambda f: 0.9 + 0 * f, 0.0, 0.03), (0.3, 2.0), (0.0, 13.0))
    assert late.alone[0] > late.alone[1] + 9.0
    # A loop that answers a part of what happens adds what looks late, and grows with the frequency.
    for share in (0.03, 0.06):
        answered = response(lambda f, share=share: 0.7 * (1 - 2j * np.pi * f * share), 0.0, 0.0)
        assert causal_bands(*answered, (0.3, 2.0), (1.8, 6.0)) is None
    # An answer alone is a quarter of a turn late.
    assert causal_bands(*response(lambda f: -1j * f / 1.5, 0.0, 0.0), (0.3, 2.0), (0.0, 13.0)) is None


@pytest.mark.parametrize(
    ("late_s", "sd_s", "named"),
    [(0.02, 0.004, True), (0.02, 0.008, False), (0.004, 0.001, False), (0.0053, 0.0014, False), (0.019, 0.005, False)],
)
def test_a_lateness_within_three_standard_errors_of_half_a_sample_is_no_lag(monkeypatch, late_s, sd_s, named):
    """Commands at 100 Hz that hold until the next are late by 5 ms."""
    found = lift.LiftPath(reference=1200.0, voltage_reference_v=None, lag_s=(late_s, sd_s))
    monkeypatch.setattr(lift, "read_path", lambda *_: found)
    chain = chain_of_lift([], VEHICLE, FULL, None, RATE_HZ).result.fit.chain
    assert [key for key, _ in chain] == (["motor_lag"] if named else [])


def test_what_one_controller_feigns_in_roll_and_pitch_is_no_surer_for_being_there_twice():
    mean, sd = lift._of_one_loop([(0.040, 0.010), (0.042, 0.012)])
    assert 0.040 < mean < 0.042 and sd == 0.010
    assert lift._of_one_loop([(0.02, 0.002), (0.06, 0.002)])[1] > 0.01
