"""What a solved bench says: deformation, equivalent stress, stress in the narrow sections, and what its cells read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np

from rotorid.identify.bench.reconstruct import Geometry, forces
from rotorid.identify.fem.bench import CELLS, PIECES
from rotorid.identify.fem.gauges import bridge_strain, strain_per_newton
from rotorid.identify.fem.model import Bench, Solved
from rotorid.identify.fem.placement import LEGS
from rotorid.identify.fem.sizes import MATERIALS, Assumed, Sizes, materials

PARTS = (*CELLS, *PIECES)


@dataclass(frozen=True)
class Answers:
    """Per newton of load, downwards in the middle of plate D."""

    deformation_m: float
    """Largest displacement [m/N]."""
    deformed_most: str
    """The part where it is."""
    stress_pa: float
    """Largest equivalent stress [Pa/N]."""
    stressed_most: str
    """The part where it is."""
    narrow_upper_pa: float
    """Largest equivalent stress in the narrow sections of an upper cell [Pa/N], and of a lower one."""
    narrow_lower_pa: float
    plate_evenness: float
    """Least displacement of plate D over its largest [1]."""
    plate_middle: float
    """Displacement in the plate's middle over the plate's largest [1]."""
    force_upper_n: float
    """What an upper cell reads by its calibration [N/N], and a lower one; positive as in eqs 2.3 to 2.8."""
    force_lower_n: float
    equation_n: float
    """Vertical force by eq. 2.8 from all six readings [N/N]; the load itself is +1."""


def ask(bench: Bench, solved: Solved, cell_strain: float, geometry: Geometry) -> Answers:
    """The answers of a solved bench.

    Parameters
    ----------
    cell_strain
        Strain of a single cell's bridge per newton [1/N], its calibration.
    geometry
        Table 2.3.
    """
    body = bench.body
    moved = np.linalg.norm(solved.displacement_m, axis=1)
    part = np.array(body.names)[body.part_of_node]
    plate = body.nodes_of("D")
    middle = plate[np.hypot(*body.nodes_m[plate, :2].T) < 1e-9]
    narrow = [float(solved.von_mises_pa[bench.narrow(name)].max()) for name in CELLS]
    read = [bridge_strain(bench.gauge_strains(solved, name)) / cell_strain for name in CELLS]
    six = np.empty(6)
    for numbers in LEGS:
        six[np.array(numbers) - 1] = read
    return Answers(
        deformation_m=float(moved.max()),
        deformed_most=str(part[moved.argmax()]),
        stress_pa=float(solved.von_mises_pa.max()),
        stressed_most=str(part[solved.von_mises_pa.argmax()]),
        narrow_upper_pa=narrow[0],
        narrow_lower_pa=narrow[1],
        plate_evenness=float(moved[plate].min() / moved[plate].max()),
        plate_middle=float(moved[middle].max() / moved[plate].max()),
        force_upper_n=read[0],
        force_lower_n=read[1],
        equation_n=float(forces(six, geometry)[2]),
    )


def by_part(bench: Bench, solved: Solved) -> dict[str, dict[str, float]]:
    """Largest displacement [m/N] and equivalent stress [Pa/N] of each part."""
    moved = np.linalg.norm(solved.displacement_m, axis=1)
    return {
        name: {"deformation_m": float(moved[own].max()), "stress_pa": float(solved.von_mises_pa[own].max())}
        for name in PARTS
        for own in [bench.body.nodes_of(name)]
    }


def compare(
    assumed: Assumed, sizes: Sizes, moduli_pa: Mapping[str, float], geometry: Geometry, fineness: float
) -> dict[str, Answers]:
    """Answers of a bench with pieces of each material, on a mesh of this fineness."""
    bench = Bench.of(assumed, sizes, geometry.distance_m, fineness)
    of = {name: materials(sizes, moduli_pa, name) for name in MATERIALS}
    cell_strain = strain_per_newton(sizes, of["PLA"]["cells"], fineness)
    return {name: ask(bench, bench.solve(of[name]), cell_strain, geometry) for name in MATERIALS}


def ratios(found: Mapping[str, Answers]) -> dict[str, float]:
    """PLA over aluminium: of the largest deformation, the largest stress, and the stress in the narrow sections [1]."""
    metal, plastic = (asdict(found[name]) for name in MATERIALS)
    return {
        name.removesuffix("_m").removesuffix("_pa"): plastic[name] / metal[name]
        for name in ("deformation_m", "stress_pa", "narrow_upper_pa", "narrow_lower_pa")
    }
