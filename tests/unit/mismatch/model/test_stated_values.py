"""What is said about a believed value where something beside it would make up for it."""

import pytest

from rotorid.mismatch.decision.findings import Finding
from rotorid.mismatch.model.values import without_scale_of_curve
from rotorid.mismatch.posterior.status import Estimate


def curve(symbol: str, status: str = "established") -> list[Finding]:
    """A throttle curve with one parameter."""
    found = Estimate(symbol, 0.3, "1", 0.2, 0.4)
    return [Finding(id="throttle_curve", status=status, sentence="", parameters=(found,))]


@pytest.mark.parametrize(
    ("findings", "named"),
    [(curve("a_1"), False), (curve("u_0"), True), (curve("a_1", "not_established"), True), ([], True)],
)
def test_a_thrust_beside_a_throttle_curve_with_a_scale_of_its_own_is_not_called_wrong(findings, named):
    """Nor is a mass: where speeds are known from commands alone a flight knows the ratio of the two."""
    values = {"thrust": (-0.02, 0.002), "mass": (0.05, 0.001)}
    assert ("thrust" in without_scale_of_curve(findings, values)) is named
    assert ("mass" in without_scale_of_curve(findings, values)) is named  # only thrust over mass is known
