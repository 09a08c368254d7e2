"""Follow one load cell's signal from force to counts.

- Strain of its gauges by finite elements, voltage of the bridge, counts of the converter.
- Against the sensitivity that the thesis's calibration gives each cell, and how far the assumed sizes move it.
- The ligament with which the cell would have the measured sensitivity.
"""

import json
from pathlib import Path

import numpy as np

from rotorid_acquire.io import wire
from rotorid_lab import log
from rotorid_lab.fem import studies
from rotorid_lab.fem.placement import read_assumed, read_moduli
from rotorid_lab.fem.studies import printed_slope


def main(sizes: str, moduli: str, calibration: str, mesh: str, chain: str, variants: str) -> None:
    """Write the chain and the calibration (JSON), and a size's end a row (CSV)."""
    assumed, modulus = read_assumed(sizes), read_moduli(moduli)
    level = studies.LEVELS[mesh]
    table = studies.chain_study(assumed, modulus, level["chain"], level["sizes"])
    table.to_csv(variants, index=False, float_format="%.6g")
    cells = json.loads(Path(calibration).read_text(encoding="utf-8"))["cells"]
    measured = np.array([printed_slope(cell["a1_gf_per_10uv"]) for cell in cells])
    slopes = [cell["a1_gf_per_10uv"] for cell in cells]
    volts, mean = table["volts_per_n"], float(measured.mean())
    needed = studies.ligament_for(assumed.sizes, modulus, mean, level["sizes"])
    result = {
        "computed": table.drop(columns=["size", "end", "value"]).iloc[0].to_dict(),
        "steps": studies.steps(table.iloc[0], mean, assumed.sizes),
        "excitation_v": assumed.sizes.excitation_v,
        "gauge_factor": assumed.sizes.gauge_factor,
        "ligament_mm": assumed.sizes.cell_ligament_m * 1e3,
        "gain": wire.GAIN,
        "reference_v": wire.REFERENCE_V,
        "count_v": wire.VOLTS_PER_COUNT,
        "full_load_share_of_range": float(volts[0] * studies.RATED_N / (2 * wire.REFERENCE_V / wire.GAIN)),
        "measured_slope_gf_per_10uv": [min(slopes), max(slopes)],
        "measured_volts_per_n": [float(measured.min()), float(measured.max())],
        "measured_rated_mv_per_v": 1e3 * mean * studies.RATED_N / assumed.sizes.excitation_v,
        "factor": float(volts[0] / mean),
        "factor_range": [float(volts.min() / mean), float(volts.max() / mean)],
        "spread_of_cells": float(measured.max() / measured.min() - 1),
        "ligament_needed_mm": needed * 1e3,
    }
    Path(chain).write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            sizes=snakemake.input.sizes,
            moduli=snakemake.input.moduli,
            calibration=snakemake.input.calibration,
            mesh=snakemake.params.mesh,
            chain=snakemake.output.chain,
            variants=snakemake.output.variants,
        )
