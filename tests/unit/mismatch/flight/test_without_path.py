"""Values refitted where commands alone are recorded, by hand."""

import numpy as np
import pytest

from rotorid.mismatch.flight.values import values_without_path


def refitted(gains, fitted=1):
    """Values and what they leave of two stretches of a vehicle whose force and moments are `gains` of the believed."""
    random = np.random.default_rng(0)
    made = [random.standard_normal((50, 12)) for _ in range(2)]
    made[1][:, 2] += 3.0
    measured = [m.copy() for m in made]
    for m in measured:
        m[:, 2:6] *= gains
    believed, faster = ([y - square * m for y, m in zip(measured, made, strict=True)] for square in (1, 2))
    return values_without_path(believed, faster, fitted)


def test_thrust_and_gains_of_moments_are_found_by_the_fitted_stretch_and_hold_on_the_other():
    values, left = refitted([1.2, 0.8, 1.5, 0.9])
    found = {k: change for k, (change, _) in values.items()}
    assert found == pytest.approx(
        {
            "thrust": 0.2,
            "torque": 0.2,
            "inertia_xx": 1.2 / 0.8 - 1,
            "inertia_yy": 1.2 / 1.5 - 1,
            "inertia_zz": 1.2 / 0.9 - 1,
        }
    )
    assert np.abs(left[1][:, 2:6]).max() < 1e-9


def test_a_vehicle_that_seems_not_to_answer_keeps_the_believed_inertia():
    values, left = refitted([1.0, 0.1, 1.0, 3.0])
    assert values["inertia_xx"][0] == values["inertia_zz"][0] == 0.0
    assert np.abs(left[1][:, 3]).max() > 0.5
