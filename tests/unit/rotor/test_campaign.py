import numpy as np
import pytest

from rotorid.rotor.campaign import COLUMNS, generated_points
from rotorid.rotor.coefficients import Points, fit_coefficient


def test_generated_points_have_the_stated_coefficient():
    fits = []
    for seed in range(20):
        points = generated_points(1.3877e-6, 1829.2, 50, 0.01, np.random.default_rng(seed))
        run = [Points("a", points["speed_rad_s"].to_numpy(), points["value"].to_numpy())]
        fits.append(fit_coefficient(run, offset=False).value)
    # One fit has a standard error of 0.06 %, the mean of twenty 0.014 %.
    assert np.mean(fits) == pytest.approx(1.3877e-6, rel=4e-4)
    assert list(points.columns) == list(COLUMNS)
    assert points["throttle"].tolist()[:2] == [0.01, 0.02] and points["throttle"].iloc[-1] == 0.5
    torque = generated_points(1.8558e-8, 1575.2, 20, 1e-5, np.random.default_rng(0))
    assert torque["throttle"].iloc[0] == 0.02 and torque["throttle"].iloc[-1] == 0.4
