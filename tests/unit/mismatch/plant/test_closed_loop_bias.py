"""Commands that answer the gyroscope's noise look late although the rotors are not."""

from dataclasses import replace

import numpy as np
import pytest

from rotorid.mismatch.model.prepare import prepare
from rotorid.mismatch.model.wrench import closed_loop_bias_s
from tests.unit.mismatch.flights import quad, recorded

GAIN_N_M_S = 0.1
NOISE_RAD_S = 0.02
HOVER_RAD_S = 1000.0


def loop(moving_rad_s: float) -> tuple[list, list]:
    """Segments, and copies with more noise, of a hover whose roll command is −GAIN (motion + noise)."""
    vehicle, rng = quad(), np.random.default_rng(3)
    prepared = prepare(recorded(1, flight={"duration_s": 15.0}))
    per_n_m = -np.sign(vehicle.rotor_positions_m()[:, 1]) / (4 * 0.0884 * 1.3877e-6)
    plain, again = [], []
    for s in prepared.segments:
        smooth = np.convolve(rng.standard_normal(len(s.motion.time_s) + 20), np.ones(20) / np.sqrt(20), "valid")
        noise, more = NOISE_RAD_S * rng.standard_normal((2, len(s.motion.time_s)))
        motion = moving_rad_s * smooth[: len(noise)]
        moment = -GAIN_N_M_S * (motion + noise)
        command = np.sqrt(HOVER_RAD_S**2 + moment[:, None] * per_n_m)
        for out, rate in ((plain, motion + noise), (again, motion + noise + more)):
            body = np.stack([rate, 0 * rate, 0 * rate], axis=1)
            out.append(replace(s, command=command, motion=replace(s.motion, angular_velocity=body)))
    return plain, again


def test_a_loop_that_does_nothing_but_answer_noise_looks_late_by_inertia_over_gain():
    late = closed_loop_bias_s(*loop(0.0), quad(), 20.0)
    assert late == pytest.approx(2.489e-3 / GAIN_N_M_S, rel=0.15)


def test_a_loop_that_mostly_turns_the_vehicle_does_not():
    assert closed_loop_bias_s(*loop(20 * NOISE_RAD_S), quad(), 20.0) < 0.15 * 2.489e-3 / GAIN_N_M_S


def test_without_commands_there_is_no_echo():
    plain, again = ([replace(s, command=None) for s in part] for part in loop(0.0))
    assert closed_loop_bias_s(plain, again, quad(), 20.0) == 0.0
