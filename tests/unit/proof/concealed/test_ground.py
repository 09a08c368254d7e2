"""The emulated instruments: their dynamics against closed solutions, what they hide against what they say they hide."""

import numpy as np
import pytest

from rotorid_proof.concealed.ground import THRUST, Cause, GroundPlan, lagged, oscillator, parameters, sense, stand_run


def test_lag_of_a_ramp_has_the_time_constant_of_the_equation():
    t = np.arange(400) * 1e-3
    for tau in (0.02, 0.045):
        expected = t - tau + tau * np.exp(-t / tau)  # of x = t from rest
        assert lagged(t[:, None], tau, tau, 1e-3)[:, 0] == pytest.approx(expected, abs=1e-12)
        assert lagged(t[:, None], tau, 2 * tau, 1e-3)[:, 0] == pytest.approx(expected, abs=1e-12)


def test_oscillator_on_a_ramp_rings_about_its_own_delay():
    t, w, zeta = np.arange(500) * 1e-3, 2 * np.pi * 9.0, 0.04
    wd = w * np.sqrt(1 - zeta**2)
    # x = t from rest: y = t − 2ζ/ω + e^(−ζωt) (2ζ/ω cos ω_d t + (2ζ² − 1)/ω_d sin ω_d t)
    ring = 2 * zeta / w * np.cos(wd * t) + (2 * zeta**2 - 1) / wd * np.sin(wd * t)
    expected = t - 2 * zeta / w + np.exp(-zeta * w * t) * ring
    assert oscillator(t[:, None], 9.0, zeta, 1e-3)[:, 0] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("form", ["", "chain"])
def test_answer_of_creep_is_what_creeps(form):
    plan = GroundPlan(kind="bench", runs=("hold",), seconds=50.0)
    cause = Cause("creep", form=form)
    amount = parameters(cause, 1.0, plan)
    t = np.arange(50_000) * 1e-3
    load = np.zeros((len(t), 6))
    load[1:, 2] = -10.0
    added = (sense(plan, load, t, [(cause, amount)]) - load)[-1, 2]
    pairs = [("c", "t_c")] if not form else [("c_1", "t_1"), ("c_2", "t_2")]
    expected = -10.0 * sum(amount[c] * (1 - np.exp(-t[-1] / amount[tau])) for c, tau in pairs)
    assert added == pytest.approx(expected, rel=1e-3)


def test_wall_takes_no_thrust_from_a_rotor_at_rest():
    plan = GroundPlan(kind="stand", runs=("single",), seconds=20.0, rate_hz=50.0, rotors=1, tared=True)
    cause = Cause("wall_interference")
    amount = {"c": 0.05, "tau": 6.0}
    _, _, _, speed, _, _, reading = stand_run(plan, "single", (0.0, 0.0), [(cause, amount)], np.random.default_rng(1))
    assert np.abs(reading[speed[:, 0] == 0.0, 2]).max() == 0.0
    # T = C ω (ω − c w) is least at ω = c w/2: what an almost stopped rotor is pushed back with.
    assert reading[:, 2].max() <= THRUST * (amount["c"] * speed.max()) ** 2 / 4
