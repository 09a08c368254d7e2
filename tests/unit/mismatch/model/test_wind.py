"""A steady wind, through the drag by which it is felt."""

import numpy as np
import pytest

from rotorid.mismatch.analyse import analyse
from tests.unit.mismatch.flights import recorded

WIND_M_S, SQUARE_DRAG = (-1.0, 3.0), 0.06


@pytest.fixture(scope="module")
def blown():
    return analyse(recorded(1, 2, 3, flight={"square_drag": SQUARE_DRAG, "excitation": 1.5, "wind": WIND_M_S}))


@pytest.mark.slow
def test_a_wind_beside_a_drag_of_the_square(blown):
    """0.06 1/m times 0.652 kg is 0.0391 N s2/m2: through it a wind is no force that is constant in world axes."""
    found = {f.id: f for f in blown.findings if f.status == "established"}
    assert set(found) == {"steady_wind", "frame_drag"}
    for estimate, wind in zip(found["steady_wind"].parameters, WIND_M_S, strict=True):
        assert estimate.low < wind < estimate.high
        assert abs(estimate.value - wind) < 0.3
    sideways = [p.value for p in found["frame_drag"].parameters][:2]  # it hardly climbs
    assert np.allclose(sideways, 0.652 * SQUARE_DRAG, rtol=0.1)
