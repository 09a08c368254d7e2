"""The recording of the cost benchmark holds what it says, or what is found in it would be no measure of anything."""

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.mismatch import DRAG_N_S_M, VEHICLE, WIND_M_S, minute


def test_force_and_moment_are_those_of_the_rotors_and_the_drag():
    true = minute(100)
    rotation = Rotation.from_quat(true["quaternion"], scalar_first=True).as_matrix()
    air = np.einsum("nji,nj->ni", rotation, true["velocity"] - WIND_M_S)
    force = VEHICLE.mass_kg * true["specific_force"]
    thrusts = VEHICLE.thrust_coefficient_n_s2 * true["rotor_speed"] ** 2
    np.testing.assert_allclose(force[:, :2], -DRAG_N_S_M * air[:, :2], atol=2e-3)
    np.testing.assert_allclose(force[:, 2], -thrusts.sum(axis=1), rtol=1e-9)
