"""The gauges of a cell in a solved body, and what their bridge makes of them.

One load cell as it is calibrated (thesis fig. 2.32): one end clamped, the weight on the other.
"""

from __future__ import annotations

import numpy as np

from rotorid.identify.fem import cell, elasticity
from rotorid.identify.fem.elasticity import Hole, LooseParts
from rotorid.identify.fem.placement import PartFrame
from rotorid.identify.fem.sizes import Material, Sizes
from rotorid.identify.fem.tets import Pad, on

NAME = "cell"


def holes(name: str, sizes: Sizes, frame: PartFrame) -> list[Hole]:
    """The two holes of the cell `name` with this own frame."""
    reach = sizes.cell_between_holes_m / 2
    return [
        Hole(name, frame.origin_m + side * frame.axes[0], frame.axes[2], sizes.hole_radius_m)
        for side in (-reach, reach)
    ]


def gauge_strains(body: LooseParts, name: str, sizes: Sizes, frame: PartFrame, moved_m: np.ndarray) -> np.ndarray:
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


def strain_per_newton(sizes: Sizes, material: Material, fineness: float) -> float:
    """Strain of the bridge per newton across the free end [1/N]."""
    frame = PartFrame(np.zeros(3), np.eye(3))
    body = LooseParts.of({NAME: cell.mesh(sizes, fineness)}, holes(NAME, sizes, frame))
    half, reach = sizes.cell_side_m / 2, sizes.cell_between_pads_m / 2
    pad = Pad(np.array([reach, -half, 0.0]), frame.axes[1], frame.axes[0], (sizes.cell_pad_m, sizes.cell_side_m))
    end = np.array([-reach, half, 0.0])
    nodes = body.nodes_m
    binding = elasticity.constraints(len(nodes), [], np.tile(on(pad, nodes), (3, 1)))
    across = np.zeros(len(nodes))
    # The weight's resultant acts in the middle of the pad; how it spreads there does not reach the gauges.
    weights = body.weights(end[None], NAME)
    across[weights.indices] = weights.data
    forces = np.concatenate([np.zeros(len(nodes)), across, np.zeros(len(nodes))])
    moved = elasticity.solve(body.stiffness({NAME: material}), binding, forces[:, None])[:, 0]
    return bridge_strain(gauge_strains(body, NAME, sizes, frame, moved.reshape(3, -1).T))
