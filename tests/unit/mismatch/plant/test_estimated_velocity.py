"""A velocity that an autopilot made from its accelerometer is distinguished from one that another sensor measured."""

from dataclasses import replace

import numpy as np
import pytest

from rotorid.mismatch.plant.motion import Segment, made_from_accelerometer
from tests.unit.mismatch.plant.test_rows import still

RATE_HZ, COUNT = 100.0, 6000


@pytest.mark.parametrize("integrated", [True, False])
def test_a_velocity_that_integrates_the_accelerometers_noise_is_no_second_witness(integrated):
    rng = np.random.default_rng(3)
    noise = 0.1 * rng.standard_normal((COUNT, 3))
    velocity = np.cumsum(noise, axis=0) / RATE_HZ if integrated else 0.01 * rng.standard_normal((COUNT, 3))
    motion = replace(
        still(COUNT, time_s=np.arange(COUNT) / RATE_HZ),
        accelerometer=noise,
        velocity=velocity,
        rotation=np.broadcast_to(np.eye(3), (COUNT, 3, 3)),
    )
    assert made_from_accelerometer([Segment("a", RATE_HZ, motion, "accelerometer")], 20.0) == integrated
