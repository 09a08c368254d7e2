"""What a solved bench says: deformation, equivalent stress, stress in the narrow sections, and what its cells read.

The thesis's four sentences on its simulations (2.5.2) are held to a table of such answers, for benches of different
sizes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np
import pandas as pd

from rotorid.identify.bench.reconstruct import Geometry, forces
from rotorid.identify.fem.bench import CELLS, PIECES, Bench, Solved
from rotorid.identify.fem.cell import bridge_strain, strain_per_newton
from rotorid.identify.fem.placement import LEGS
from rotorid.identify.fem.sizes import MATERIALS, Assumed, Sizes, materials

_PARTS = (*CELLS, *PIECES)
EVEN = 0.9
"""A plate moves evenly where its least displacement is at least this share of its largest."""
MIDDLE = 0.99
"""Its largest displacement is in its middle where the middle has at least this share of it."""
NEARLY = 0.1
"""Two stresses are nearly the same where they differ by at most this share."""


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
        for name in _PARTS
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


@dataclass(frozen=True)
class _Judged:
    """A sentence and on how many benches it holds."""

    statement: str
    on_assumed: bool
    """Whether it holds with all sizes as assumed."""
    holds: int
    benches: int

    @property
    def word(self) -> str:
        """What follows from that."""
        if self.holds == self.benches:
            return "follows"
        return "does not follow" if self.holds == 0 else "depends on the assumed sizes"


def judge_statements(table: pd.DataFrame) -> list[_Judged]:
    """Each sentence on each bench.

    Parameters
    ----------
    table
        A bench a row, the first with all sizes as assumed; columns `ratio_deformation`, `ratio_narrow_upper`,
        `ratio_narrow_lower`; `plate_evenness`, `plate_middle` and `stressed_most` with `_aluminium` and with `_pla`.
    """
    even = table["plate_evenness_aluminium"] >= EVEN
    middle = (table["plate_middle_pla"] >= MIDDLE) & (table["plate_evenness_pla"] < table["plate_evenness_aluminium"])
    held = {
        "PLA deforms more than aluminium": table["ratio_deformation"] > 1,
        "aluminium's piece D deforms evenly": even,
        "PLA's piece D deforms most in its middle, and less evenly": middle,
        "the largest stresses lie in different pieces": table["stressed_most_aluminium"] != table["stressed_most_pla"],
        "the stress in an upper cell's narrow section is nearly the same": _nearly(table["ratio_narrow_upper"]),
        "the stress in a lower cell's narrow section is nearly the same": _nearly(table["ratio_narrow_lower"]),
    }
    return [_Judged(name, bool(holds.iloc[0]), int(holds.sum()), len(holds)) for name, holds in held.items()]


def _nearly(ratio: pd.Series) -> pd.Series:
    return (ratio - 1).abs() <= NEARLY
