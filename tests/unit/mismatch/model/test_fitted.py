"""What is fitted where rotor speeds are known from their commands alone."""

import numpy as np
import pytest

from rotorid.mismatch.model.fitted import only_scales, without_same_curves
from rotorid.mismatch.model.prepare import prepare
from rotorid.mismatch.plant.speedpath import CommandChain, SpeedFit, SpeedResult
from tests.unit.mismatch.flights import recorded
from tests.unit.mismatch.plant.test_speedpath import form


def chain_of(effect_id: str, name: str, values, sd: float = 1e-4) -> CommandChain:
    """A chain of one form, its values known to `sd`."""
    made = form(effect_id, name)
    known = sd**2 * np.eye(len(made.parameters))
    fit = SpeedFit(((effect_id, made),), np.array(values, float), 0.0, 0.0, covariance=known)
    return CommandChain(SpeedResult(fit, {}, {}, {}), 2500.0, None)


@pytest.mark.parametrize(
    ("values", "sd", "scale"), [((0.0026, 0.04), 1e-4, True), ((0.02, 0.04), 1e-4, False), ((0.02, 0.04), 0.02, True)]
)
def test_a_curve_whose_start_is_negligible_or_not_known_is_another_scale(values, sd, scale):
    """Half a percent of the full speed is negligible."""
    assert only_scales(chain_of("throttle_curve", "affine", values, sd).result) == scale


def test_next_to_a_curve_of_the_throttle_no_curve_of_the_thrust_is_looked_for():
    prepared = prepare(recorded(1, flight={"duration_s": 10.0}))
    assert "thrust_curve" in {t.effect for t in prepared.terms}
    fewer = without_same_curves(prepared, chain_of("throttle_curve", "affine", (0.1, 0.1)))
    assert {t.effect for t in prepared.terms} - {t.effect for t in fewer.terms} == {"thrust_curve"}
    assert "throttle" in fewer.not_testable["thrust_curve"]
    assert without_same_curves(prepared, chain_of("motor_lag", "one constant", (0.05,))) is prepared
