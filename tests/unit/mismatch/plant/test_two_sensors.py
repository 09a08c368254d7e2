"""Which errors of sensors the comparison with another sensor estimates alone."""

from dataclasses import replace

import numpy as np
import pandas as pd

from rotorid.mismatch.decision.decide import coefficients
from rotorid.mismatch.model.prepare import prepare
from rotorid.mismatch.model.wrench import wrench_model
from rotorid.mismatch.plant.rows import compared_alone
from rotorid.recordings import columns as c
from tests.unit.mismatch.flights import recorded, with_table


def test_errors_of_the_sensors_that_are_compared_and_nothing_else():
    prepared = prepare(recorded(1))
    channels, keys = compared_alone(prepared.terms, wrench_model(prepared, prepared.terms).rows)
    assert channels == [6, 7, 8, 9, 10, 11]
    assert {"gyro_error/scale", "accelerometer_error/bias", "imu_lever_arm/lever arm"} <= set(keys)
    assert not any(k.startswith(("rotor_drag", "com_offset", "offset:")) for k in keys)


def test_without_an_attitude_no_error_of_the_gyroscope_is_compared():
    def inertial(table: pd.DataFrame) -> pd.DataFrame:
        return table.drop(columns=[*c.QUATERNION, *c.VELOCITY, *c.POSITION])

    prepared = prepare(with_table(recorded(1), inertial))
    channels, keys = compared_alone(prepared.terms, wrench_model(prepared, prepared.terms).rows)
    assert (channels, keys) == ([], [])


def test_a_scale_of_the_gyroscope_is_told_rightly_beside_inertias_that_are_far_off():
    """The moments ask for another number: the believed inertias are a third too small."""

    def scaled(table: pd.DataFrame) -> pd.DataFrame:
        return table.assign(**{name: 1.08 * table[name] for name in c.ANGULAR_VELOCITY})

    recordings = with_table(recorded(2), scaled)
    vehicle = recordings.vehicle
    light = {k: v / 1.5 for k, v in vehicle.inertia_kg_m2.model_dump().items()}
    vehicle = vehicle.model_copy(update={"inertia_kg_m2": vehicle.inertia_kg_m2.model_copy(update=light)})
    prepared = prepare(replace(recordings, vehicle=vehicle))
    model = wrench_model(prepared, prepared.terms)
    regression = model.search.regression
    fit = regression.fit([*regression.keys_of("nuisance"), "gyro_error/scale"])
    beta, covariance = coefficients(regression, fit, "gyro_error/scale")
    # Ω_m = 1.08 Ω; columns hold the measured rates, so the coefficient is 0.08 / 1.08.
    assert np.all(np.abs(beta - 0.08 / 1.08) < 3 * np.sqrt(np.diag(covariance)))
    assert np.all(np.abs(beta - 0.08 / 1.08) < 0.02)
