"""The tables of the report's chapter: loads, meshes, sizes, the signal chain (thesis 2.1, 2.2, 2.7.2), known answers.

Four active gauges in a full bridge give V = V_e k ε: excitation V_e, gauge factor k, and ε the mean of their strains,
each with its sign. The ADS1256 resolves V in steps of 2 V_ref / gain / (2²³ - 1). Solved by the same code as the bench
are two problems with a known answer: a cantilever, and a plate with a round hole.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.optimize import brentq

from rotorid.errors import InputError
from rotorid_acquire.io.wire import VOLTS_PER_COUNT
from rotorid_lab.bench import GF_N, Geometry
from rotorid_lab.fem import elasticity
from rotorid_lab.fem.bench import Answers, Bench, Solved, by_part, ratios, solve, strain_per_newton
from rotorid_lab.fem.elasticity import Hole, LooseParts, block, count, raised, stacked
from rotorid_lab.fem.placement import MATERIALS, Assumed, Material, Sizes, in_file, materials

_BEAM = Material(68.9e9, 0.0)
"""Without contraction across, for which beam theory's clamped end is exact."""
_PLATE = Material(68.9e9, 0.33)
FINENESSES = (1.0, 2.0, 4.0)
_PRINTED_STEP_V = 1e-5
"""Unit of table 2.7's readings and of table 2.8's slopes."""
SHORT = dict(zip(MATERIALS, ("aluminium", "pla"), strict=True))
"""Ending of a column that holds one material's value."""
_ELECTRIC = ("gauge_factor", "excitation_v")
"""Assumed values that no stress depends on."""
_OF_THE_CELL = ("cell_", "gauge_length", "poisson_aluminium")
"""Beginnings of the names that a single cell's sensitivity depends on."""
RATED_N = 1000 * GF_N
"""Load that the cells are rated for."""
_TRIES = 5
"""Times as many benches are drawn at most as are wanted."""
_LARGEST_LIGAMENT = 0.8
"""Share of half the bar's side up to which a ligament is looked for that gives the printed sensitivity."""


LEVELS = {
    "coarse": {"study": (1.0, 1.5, 2.0), "sizes": 1.0, "chain": 2.0},
    "full": {"study": (1.0, 1.5, 2.0, 3.0), "sizes": 1.5, "chain": 3.0},
}
"""How fine the meshes are, as multiples of the coarsest, by the setting `fem`: of the bench as assumed (the last one's
answers are the results), of benches of other `sizes`, and of a single cell (`chain`)."""


def mesh_study(
    assumed: Assumed, moduli_pa: Mapping[str, float], geometry: Geometry, finenesses: Sequence[float]
) -> tuple[pd.DataFrame, Bench, dict[str, Solved], Answers]:
    """A mesh a row with what it says per newton, and the last one's bench, how it is solved and what it says."""
    rows = []
    for fineness in finenesses:
        bench, cell_strain, solved, found = solve(assumed, assumed.sizes, moduli_pa, geometry, fineness)
        row = {"fineness": fineness, "elements": bench.body.mesh.nelements, "nodes": bench.body.basis.N}
        rows.append(row | {"cell_strain_per_n": cell_strain} | _row(found))
    return pd.DataFrame(rows), bench, solved, found


def _row(found: Answers) -> dict[str, float | str]:
    row = {f"ratio_{name}": value for name, value in ratios(found).items()}
    for name, end in SHORT.items():
        row |= {f"{key}_{end}": value for key, value in found[name].items()}
    return row


def loads(found: Answers, loads_gf: Sequence[float], area_m2: float) -> pd.DataFrame:
    """Deformation and stresses against the load: linear, a load a row."""
    force = np.asarray(loads_gf, float) * GF_N
    table = {"load_gf": np.asarray(loads_gf, float), "load_n": force, "pressure_pa": force / area_m2}
    for name, end in SHORT.items():
        for key in ("deformation_m", "stress_pa", "narrow_upper_pa", "narrow_lower_pa"):
            table[f"{key}_{end}"] = force * found[name][key]
    return pd.DataFrame(table)


def parts(bench: Bench, solved: Mapping[str, Solved]) -> dict[str, dict[str, dict[str, float]]]:
    """Largest displacement [m/N] and equivalent stress [Pa/N] by material and part."""
    return {SHORT[name]: by_part(bench, solved[name]) for name in MATERIALS}


def surface(bench: Bench, solved: Mapping[str, Solved]) -> pd.DataFrame:
    """Triangles of the leg's surface: places of their corners [m], and per newton their mean displacement and stress.

    Columns: `part`, `x_1_m` to `z_3_m`, and `deformation_m` and `stress_pa` with the ending of each material.
    """
    body = bench.body
    facets = body.mesh.boundary_facets()
    corners = body.mesh.facets[:, facets]
    table: dict[str, np.ndarray] = {"part": np.array(body.names)[body.part[body.mesh.f2t[0, facets]]]}
    for number in range(3):
        for axis, name in enumerate("xyz"):
            table[f"{name}_{number + 1}_m"] = body.mesh.p[axis, corners[number]]
    nodes = body.basis.nodal_dofs[0][corners]
    for name, end in SHORT.items():
        moved = solved[name].displacement_m[nodes]
        table[f"deformation_m_{end}"] = np.linalg.norm(moved, axis=-1).mean(axis=0)
        table[f"stress_pa_{end}"] = solved[name].von_mises_pa[nodes].mean(axis=0)
    return pd.DataFrame(table)


def verification() -> pd.DataFrame:
    """Closed forms and what the solver says, a quantity and mesh a row."""
    rows = [row for case in (cantilever, plate_with_hole) for fineness in FINENESSES for row in case(fineness)]
    return pd.DataFrame(rows)


def size_study(
    assumed: Assumed,
    moduli_pa: Mapping[str, float],
    geometry: Geometry,
    fineness: float,
    draws: int,
    rng: np.random.Generator,
) -> pd.DataFrame:
    """Benches of other sizes, a row each.

    First all as assumed (`end` empty), then each size in turn at its least and its largest (`low`, `high`), then as
    many as `draws` with all sizes drawn at once (`drawn`). Drawn sizes that do not go together are drawn anew.

    Raises InputError: one size at one of its ends makes no bench.
    """
    rows = []
    for name, end, sizes in [("", "", assumed.sizes), *assumed.variants()]:
        if name in _ELECTRIC:
            continue
        try:
            *_, found = solve(assumed, sizes, moduli_pa, geometry, fineness)
        except InputError as error:
            raise InputError(f"{in_file(name)[0]} at its {end} end: {error}") from None
        rows.append(_named(name, end, sizes) | _row(found))
    wanted = len(rows) + draws
    for _ in range(_TRIES * draws):
        if len(rows) == wanted:
            break
        try:
            *_, found = solve(assumed, assumed.draw(rng), moduli_pa, geometry, fineness)
        except InputError:
            continue
        rows.append({"size": "all", "end": "drawn", "value": np.nan} | _row(found))
    if len(rows) < wanted:
        raise InputError("of the benches with all sizes drawn at once too few go together; narrow their ranges")
    return pd.DataFrame(rows)


def _named(name: str, end: str, sizes: Sizes) -> dict[str, str | float]:
    written, factor = in_file(name)
    return {"size": written, "end": end, "value": getattr(sizes, name) / factor if name else np.nan}


def chain_study(
    assumed: Assumed, moduli_pa: Mapping[str, float], fineness: float, fineness_of_sizes: float
) -> pd.DataFrame:
    """Sensitivity of a single cell, as assumed (first row) and with each size in turn at its ends.

    What a size changes is computed on the coarser mesh, `fineness_of_sizes`, and applied to the finer one's answer.
    """
    of_cell = materials(assumed.sizes, moduli_pa, "PLA")["cells"]
    fine, coarse = (strain_per_newton(assumed.sizes, of_cell, level) for level in (fineness, fineness_of_sizes))
    rows = [_named("", "", assumed.sizes) | _chain(assumed.sizes, fine)]
    for name, end, sizes in assumed.variants():
        if name in _ELECTRIC:
            rows.append(_named(name, end, sizes) | _chain(sizes, fine))
        elif name.startswith(_OF_THE_CELL):
            of_cell = materials(sizes, moduli_pa, "PLA")["cells"]
            strain = strain_per_newton(sizes, of_cell, fineness_of_sizes)
            rows.append(_named(name, end, sizes) | _chain(sizes, fine * strain / coarse))
    return pd.DataFrame(rows)


def sensitivity(sizes: Sizes, moduli_pa: Mapping[str, float], fineness: float) -> dict[str, float]:
    """From newtons to strain, volts and counts, and the slope as table 2.8 prints it."""
    return _chain(sizes, strain_per_newton(sizes, materials(sizes, moduli_pa, "PLA")["cells"], fineness))


def _chain(sizes: Sizes, strain_per_n: float) -> dict[str, float]:
    volts = volts_per_newton(sizes, strain_per_n)
    return {
        "strain_per_n": strain_per_n,
        "volts_per_n": volts,
        "counts_per_n": counts_per_newton(volts),
        "slope_gf_per_10uv": printed_slope(volts),
        "rated_mv_per_v": 1e3 * volts * RATED_N / sizes.excitation_v,
    }


def steps(computed: Mapping[str, float], volts_per_n: float, sizes: Sizes) -> list[dict[str, str | float]]:
    """The chain step by step: as computed, and backwards from a calibrated sensitivity [V/N]."""
    measured = _chain(sizes, volts_per_n / (sizes.excitation_v * sizes.gauge_factor))
    names = {
        "strain_per_n": "strain (1/N)",
        "volts_per_n": "bridge (V/N)",
        "counts_per_n": "converter (counts/N)",
        "slope_gf_per_10uv": "slope as in table 2.8 (gf per 10 µV)",
        "rated_mv_per_v": "at the rated load (mV/V)",
    }
    return [{"step": name, "computed": float(computed[key]), "measured": measured[key]} for key, name in names.items()]


def ligament_for(sizes: Sizes, moduli_pa: Mapping[str, float], volts_per_n: float, fineness: float) -> float:
    """Thickness of the ligament [m] with which a cell has this sensitivity.

    Raises InputError: none between the assumed one and most of the bar's half side has.
    """
    thickest = _LARGEST_LIGAMENT * sizes.cell_side_m / 2

    def excess(log_ligament: float) -> float:
        cell = replace(sizes, cell_ligament_m=float(np.exp(log_ligament)))
        return float(np.log(sensitivity(cell, moduli_pa, fineness)["volts_per_n"] / volts_per_n))

    ends = np.log([sizes.cell_ligament_m, thickest])
    try:
        return float(np.exp(brentq(excess, *ends, xtol=1e-2)))
    except ValueError:
        raise InputError(
            f"no ligament between {1e3 * sizes.cell_ligament_m:g} and {1e3 * thickest:.1f} mm gives "
            f"{1e6 * volts_per_n:.1f} µV/N"
        ) from None


def change_of_last_mesh(table: pd.DataFrame) -> dict[str, float]:
    """Change from the last mesh but one to the last, as a share, of every number of the mesh study."""
    numbers = table.select_dtypes("number").drop(columns=["fineness", "elements", "nodes"])
    return {name: float(numbers[name].iloc[-1] / numbers[name].iloc[-2] - 1) for name in numbers}


def ranges(table: pd.DataFrame) -> dict[str, list[float]]:
    """Least and largest of every number over all benches of the size study."""
    numbers = table.select_dtypes("number").drop(columns="value")
    return {name: [float(numbers[name].min()), float(numbers[name].max())] for name in numbers}


def strongest(table: pd.DataFrame, most: int = 3) -> dict[str, list[str]]:
    """The sizes that move each ratio, and the place of the plate's largest displacement, most."""
    alone = table[table["end"].isin(["low", "high"])]
    found = {}
    for name in [*(column for column in table if column.startswith("ratio_")), "plate_middle_pla"]:
        ends = alone.groupby("size")[name].agg(["min", "max"])
        moved = ends["max"].clip(lower=table[name].iloc[0]) - ends["min"].clip(upper=table[name].iloc[0])
        found[name] = [str(size) for size in moved.nlargest(most).index]
    return found


def volts_per_newton(sizes: Sizes, strain_per_newton: float) -> float:
    """Voltage of the bridge per newton across the cell's end [V/N]."""
    return sizes.excitation_v * sizes.gauge_factor * strain_per_newton


def counts_per_newton(volts_per_n: float) -> float:
    """Counts of the converter per newton [1/N]."""
    return volts_per_n / VOLTS_PER_COUNT


def printed_slope(volts_per_n: float) -> float:
    """A sensitivity [V/N] as table 2.8 prints it [gf per 1e-5 V]; of such a slope the sensitivity."""
    return _PRINTED_STEP_V / (volts_per_n * GF_N)


def _checked(case: str, quantity: str, fineness: float, nodes: int, computed: float, closed_form: float) -> dict:
    """A number (`quantity` with its unit) as computed and by the closed form; `error` is a share of the latter."""
    return dict(vars()) | {"error": computed / closed_form - 1}


def cantilever(fineness: float, length_m: float = 0.08, side_m: float = 0.01, force_n: float = 1.0) -> list[dict]:
    """A clamped square bar with a force across its free end: deflection there and stress halfway.

    Deflection of a beam with shear, F l³ / (3 E I) + 6 F l / (5 G A); stress F (l/2) (h/2) / I.
    """
    across = np.linspace(0, side_m, count(1, fineness) + 1)
    profile = block(np.stack(np.meshgrid(across, across, indexing="ij"), axis=-1))
    along = np.linspace(0, length_m, 2 * count(4, fineness) + 1)
    layers = np.stack([np.c_[np.full(len(profile.points_m), x), profile.points_m] for x in along])
    body = LooseParts.of({"beam": stacked(layers, profile.cells)})
    materials = {"beam": _BEAM}
    nodes = body.nodes_m
    end = body.mesh.facets_satisfying(lambda x: x[0] > length_m - 1e-9, boundaries_only=True)
    load = body.traction(end, np.array([0.0, 0.0, force_n]))
    binding = elasticity.constraints(len(nodes), [], np.tile(nodes[:, 0] < 1e-9, (3, 1)))
    moved = elasticity.solve(body.stiffness(materials), binding, load[:, None])[:, 0]
    stress = body.stress(moved, materials)[0, 0]
    inertia = side_m**4 / 12
    middle = np.argmin(np.abs(nodes - [length_m / 2, side_m / 2, 0.0]).sum(axis=1))
    tip = np.argmin(np.abs(nodes - [length_m, side_m / 2, side_m / 2]).sum(axis=1))
    shear = 1.2 * force_n * length_m / (_BEAM.lame_pa[1] * side_m**2)
    deflection = force_n * length_m**3 / (3 * _BEAM.modulus_pa * inertia) + shear
    bending = force_n * (length_m - nodes[middle, 0]) * side_m / 2 / inertia
    return [
        _checked("cantilever", "deflection (m)", fineness, len(nodes), float(moved.reshape(3, -1)[2, tip]), deflection),
        _checked("cantilever", "stress (Pa)", fineness, len(nodes), float(stress[middle]), bending),
    ]


def plate_with_hole(fineness: float, radius_m: float = 0.005, pull_pa: float = 1e6) -> list[dict]:
    """A quarter of a plate under tension along x, with Kirsch's displacements on a circle of four radii.

    Plane strain, so that the contraction counts; stress at the hole across the tension is 3 times the tension, along it
    -1 times (Kirsch 1898).
    """
    angles = np.linspace(0, np.pi / 2, count(4, fineness) + 1)
    radii = np.geomspace(radius_m, 4 * radius_m, count(3, fineness) + 1)
    profile = block(np.stack([np.outer(radii, np.cos(angles)), np.outer(radii, np.sin(angles))], axis=-1))
    up = np.array([0.0, 0.0, 1.0])
    holes = [Hole("plate", np.zeros(3), up, scale * radius_m) for scale in (1, 4)]
    body = LooseParts.of({"plate": raised(profile, np.array([0, radius_m / 2]))}, holes)
    materials = {"plate": _PLATE}
    nodes = body.nodes_m
    known = np.hypot(nodes[:, 0], nodes[:, 1]) > 4 * radius_m - 1e-9
    given = np.zeros((3, len(nodes)))
    given[:2, known] = kirsch_displacement_m(nodes[known, :2], radius_m, pull_pa, _PLATE).T
    fixed = np.stack([known | (nodes[:, 0] < 1e-9), known | (nodes[:, 1] < 1e-9), np.ones(len(nodes), bool)])
    stiffness = body.stiffness(materials)
    binding = elasticity.constraints(len(nodes), [], fixed)
    moved = given.ravel() + elasticity.solve(stiffness, binding, -(stiffness @ given.reshape(-1, 1)))[:, 0]
    stress = body.stress(moved, materials)
    above = np.flatnonzero(np.hypot(nodes[:, 0], nodes[:, 1] - radius_m) < 1e-9)
    edge = np.flatnonzero(np.hypot(nodes[:, 0] - radius_m, nodes[:, 1]) < 1e-9)
    return [
        _checked("plate with a hole", name, fineness, len(nodes), float(component[at].mean()), factor * pull_pa)
        for name, component, at, factor in (
            ("stress across (Pa)", stress[0, 0], above, 3.0),
            ("stress along (Pa)", stress[1, 1], edge, -1.0),
        )
    ]


def kirsch_displacement_m(places_m: np.ndarray, radius_m: float, pull_pa: float, material: Material) -> np.ndarray:
    """Displacement [m], shape (k, 2), in an endless plate with a hole under tension along x, plane strain."""
    mu, kappa = material.lame_pa[1], 3 - 4 * material.poisson
    r, angle = np.hypot(*places_m.T) / radius_m, np.arctan2(places_m[:, 1], places_m[:, 0])
    scale = pull_pa * radius_m / (8 * mu)
    two = np.cos(2 * angle)
    outwards = scale * (r * (kappa - 1 + 2 * two) + 2 / r * (1 + (kappa + 1) * two) - 2 / r**3 * two)
    round_ = scale * (-2 * r + 2 / r * (1 - kappa) - 2 / r**3) * np.sin(2 * angle)
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([outwards * c - round_ * s, outwards * s + round_ * c], axis=-1)
