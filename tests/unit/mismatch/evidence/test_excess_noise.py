"""Noise of the rotors and the gyroscope in the band analysed, found by forward and inverse regression."""

from dataclasses import replace

import numpy as np
import pytest

from rotorid.mismatch.evidence.motion import Segment
from rotorid.mismatch.evidence.regression import noise_factors
from rotorid.mismatch.evidence.rows import Thinner, baseline_wrench
from tests.unit.mismatch.evidence.test_rows import still
from tests.unit.mismatch.synthetic import coloured
from tests.unit.vehicle.thesis import thesis_vehicle

VEHICLE = thesis_vehicle()
RATE_HZ, SIZE = 200.0, 12_000


def flown(seed: int, rotor_noise: float, pole: float, work: float = 0.0, thrust: float = 1.0) -> Segment:
    """A vehicle that rolls slowly (0.5 Hz) by rotor 1; speeds read with noise, accelerations with 1 rad/s2 of it.

    `work` is what the rotors do up to the highest frequencies, rad/s; the true moment is `thrust` times the believed.
    """
    rng = np.random.default_rng(seed)
    speed = 1000.0 + np.stack([coloured(SIZE, work, rng, pole=0.5) for _ in range(4)], axis=1)
    speed[:, 0] += 30.0 * np.sin(np.pi * np.arange(SIZE) / RATE_HZ)
    motion = still(SIZE, rotor_speed=speed, time_s=np.arange(SIZE) / RATE_HZ)
    _, arm, torque = baseline_wrench(motion, VEHICLE)
    turning = thrust * (arm + torque) @ np.linalg.inv(VEHICLE.inertia_kg_m2.matrix())
    read = speed + np.stack([coloured(SIZE, rotor_noise, rng, pole=pole) for _ in range(4)], axis=1)
    turning = turning + rng.standard_normal((SIZE, 3))
    return Segment("run", RATE_HZ, replace(motion, rotor_speed=read, angular_acceleration=turning), "accelerometer")


def found(segment: Segment, assumed: float) -> dict[str, float]:
    """What is said where white noise of `assumed` rad/s is taken for the rotors' own, and of 1 rad/s2 for the other."""
    rng, motion = np.random.default_rng(9), segment.motion
    again = replace(
        motion,
        rotor_speed=motion.rotor_speed + assumed * rng.standard_normal((SIZE, 4)),
        angular_acceleration=motion.angular_acceleration + rng.standard_normal((SIZE, 3)),
    )
    return noise_factors([segment], [replace(segment, motion=again)], VEHICLE, Thinner(RATE_HZ, 20.0))


def test_a_tachometer_that_averages_is_louder_in_the_band_than_at_its_highest_frequencies():
    """An autoregression of pole 0.8 has (1 + 0.8)² / |1 − 0.8 e^{-iω}|² more power at 14 Hz than at 100 Hz: 3.7 of its
    amplitude over 10 to 17 Hz."""
    sigma = 5.0
    floor = sigma * np.sqrt(1 - 0.8**2) / 1.8
    band = 2 * np.pi * np.linspace(10, 17, 200) / RATE_HZ
    expected = np.sqrt(np.mean(1.8**2 / np.abs(1 - 0.8 * np.exp(-1j * band)) ** 2))
    said = found(flown(0, sigma, 0.8), floor)
    assert list(said) == ["rotors"] and said["rotors"] == pytest.approx(expected, rel=0.15)


def test_white_noise_is_as_loud_as_it_seems():
    assert found(flown(1, 5.0, 0.0), 5.0) == {}


def test_where_the_rotors_work_in_the_band_nothing_is_said():
    """A thrust of 10 % less than believed leaves the moment with the noise's sign, but only a tenth of it."""
    assert found(flown(2, 1.0, 0.0, work=60.0, thrust=0.9), 1.0) == {}


def test_a_sensor_filtered_before_it_was_recorded_says_nothing():
    """Hardly any noise at the highest frequencies, and a hundred times as much in the band: that may be the model's."""
    assert found(flown(4, 5.0, 0.8), 0.01) == {}
