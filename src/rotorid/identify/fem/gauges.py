"""The gauges of a cell in a solved body, and what their bridge makes of them."""

from __future__ import annotations

import numpy as np

from rotorid.identify.fem import cell
from rotorid.identify.fem.elasticity import Body, Hole
from rotorid.identify.fem.placement import Frame
from rotorid.identify.fem.sizes import Sizes


def holes(name: str, sizes: Sizes, frame: Frame) -> list[Hole]:
    """The two holes of the cell `name` with this own frame."""
    reach = sizes.cell_between_holes_m / 2
    return [
        Hole(name, frame.origin_m + side * frame.axes[0], frame.axes[2], sizes.hole_radius_m)
        for side in (-reach, reach)
    ]


def gauge_strains(body: Body, name: str, sizes: Sizes, frame: Frame, moved_m: np.ndarray) -> np.ndarray:
    """Strain of the four gauges of the cell `name`, shape (4,): change of length of each grid over its length.

    Parameters
    ----------
    frame
        The cell's own.
    moved_m
        Displacements of all nodes [m], shape (n, 3).
    """
    first, last = (
        body.weights(frame.origin_m + ends @ frame.axes, name) @ moved_m @ frame.axes[0]
        for ends in cell.gauge_ends_m(sizes)
    )
    return (last - first) / sizes.gauge_length_m


def bridge_strain(strains: np.ndarray) -> float:
    """What a full bridge makes of its four gauges: the mean of their strains, each with its sign."""
    return float(cell.GAUGE_SIGNS @ strains / len(cell.GAUGE_SIGNS))
