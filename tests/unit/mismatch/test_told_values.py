"""What is said about a believed value where something beside it would make up for it."""

from __future__ import annotations

import pytest

from rotorid.mismatch.findings import Estimate, Finding
from rotorid.mismatch.values import without_scale_of_curve


def curve(slope: float, half: float, status: str = "established") -> list[Finding]:
    """A throttle curve of which the slope is 1 + `slope`, known to ± `half`."""
    found = Estimate("a_1", slope, "1", slope - half, slope + half)
    return [Finding(id="throttle_curve", status=status, sentence="", parameters=(found,))]


@pytest.mark.parametrize(
    ("findings", "told"),
    [
        (curve(0.3, 0.13), False),  # 0.13/1.3 = 10 % of slope make up for 20 % of thrust
        (curve(-0.34, 0.005), True),  # 0.005/0.66 = 0.76 %, for 1.5 %
        (curve(0.3, 0.13, "not_established"), True),
        ([Finding(id="throttle_curve", status="established", sentence="")], True),
        ([], True),
    ],
)
def test_a_thrust_within_the_slope_of_a_throttle_curve_is_not_called_wrong(findings, told):
    """Nor is a mass: where speeds are known from commands alone a flight knows the ratio of the two."""
    values = {"thrust": (-0.02, 0.002), "mass": (0.05, 0.001)}
    assert ("thrust" in without_scale_of_curve(findings, values)) is told
    assert ("mass" in without_scale_of_curve(findings, values)) is told  # only thrust over mass is known
