"""The cells' places and directions give back every sign and arm of the thesis's equations."""

import numpy as np
import pytest

from rotorid_lab.bench import forces, input_components, moments
from rotorid_lab.fem import placement


def acting(cell: int, sense: np.ndarray) -> np.ndarray:
    """The force, shape (3,), that table 2.2 makes of a reading of 1 N, with the direction of the cell."""
    parts = input_components(np.eye(6)[cell - 1])
    return np.array([np.sign(sense[k]) * parts.get(f"f_{cell}{axis}", 0.0) for k, axis in enumerate("xyz")])


@pytest.mark.parametrize("cell", range(1, 7))
def test_moments_about_the_frame_are_those_of_the_thesis(cell, geometry) -> None:
    place = placement.cells(geometry)[cell]
    moment = np.cross(place.force_m, acting(cell, place.sense))
    np.testing.assert_allclose(moment, moments(np.eye(6)[cell - 1], geometry), atol=1e-8)


@pytest.mark.parametrize("cell", [2, 4, 6])
def test_a_lower_cell_gives_the_vertical_force_of_eq_2_8(cell, geometry) -> None:
    place = placement.cells(geometry)[cell]
    assert acting(cell, place.sense)[2] == pytest.approx(forces(np.eye(6)[cell - 1], geometry)[2])


@pytest.mark.parametrize("cell", range(1, 7))
def test_directions_have_the_factors_of_table_2_2(cell, geometry) -> None:
    sense = placement.cells(geometry)[cell].sense
    parts = input_components(np.eye(6)[cell - 1])
    for axis, component in zip("xyz", np.abs(sense), strict=True):
        factor = 1 / parts[f"f_{cell}{axis}"] if f"f_{cell}{axis}" in parts else 0.0
        assert component == pytest.approx(factor, abs=1e-12)


def test_a_bar_lies_level_and_across_its_direction(geometry) -> None:
    for place in placement.cells(geometry).values():
        assert abs(place.axis @ place.sense) < 1e-12 and abs(place.axis[2]) < 1e-12
        assert place.inwards[:2] @ place.force_m[:2] < 0
