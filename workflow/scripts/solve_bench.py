"""Solve the load-cell bench by finite elements.

- One leg with its third of the plate, pieces of aluminium and of PLA, on finer and finer meshes.
- On the finest: deformation and stress against the loads of the calibration, by part, and the surface for the figures.
"""

import json
from pathlib import Path

import pandas as pd

from rotorid_lab import log
from rotorid_lab.bench import read_geometry
from rotorid_lab.fem import studies
from rotorid_lab.fem.bench import ratios
from rotorid_lab.fem.placement import read_assumed, read_moduli


def main(
    sizes: str, moduli: str, geometry: str, readings: str, mesh: str, bench: str, loads: str, meshes: str, surface: str
) -> None:
    """Write what the finest mesh says (JSON), its loads (CSV), a mesh a row (CSV) and the surface (Parquet)."""
    assumed, modulus = read_assumed(sizes), read_moduli(moduli)
    table, built, solved, found = studies.mesh_study(
        assumed, modulus, read_geometry(geometry), studies.LEVELS[mesh]["study"]
    )
    weights_gf = pd.read_csv(readings)["weight_gf"].to_numpy(float)
    series = studies.loads(found, weights_gf, assumed.pressed_area_m2)
    result = {
        "mesh": mesh,
        "elements": int(table["elements"].iloc[-1]),
        "nodes": int(table["nodes"].iloc[-1]),
        "loads": len(weights_gf),
        "smallest_load_gf": float(weights_gf.min()),
        "largest_load_gf": float(weights_gf.max()),
        "smallest_pressure_kpa": float(series["pressure_pa"].min() / 1e3),
        "largest_pressure_kpa": float(series["pressure_pa"].max() / 1e3),
        "pressed_area_mm2": assumed.pressed_area_m2 * 1e6,
        "modulus_gpa": {studies.SHORT[name]: value / 1e9 for name, value in modulus.items()},
        "at_largest": series.iloc[-1].to_dict(),
        "ratio": ratios(found),
        "per_newton": {studies.SHORT[name]: answers for name, answers in found.items()},
        "parts": studies.parts(built, solved),
        "change_of_last_mesh": studies.change_of_last_mesh(table),
    }
    Path(bench).write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    series.to_csv(loads, index=False, float_format="%.6g")
    table.to_csv(meshes, index=False, float_format="%.6g")
    studies.surface(built, solved).to_parquet(surface, index=False)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            sizes=snakemake.input.sizes,
            moduli=snakemake.input.moduli,
            geometry=snakemake.input.geometry,
            readings=snakemake.input.readings,
            mesh=snakemake.params.mesh,
            bench=snakemake.output.bench,
            loads=snakemake.output.loads,
            meshes=snakemake.output.meshes,
            surface=snakemake.output.surface,
        )
