"""Solve the bench with other assumed sizes.

- Each size in turn at its least and its largest, then all drawn at once.
- The thesis's statements on its simulations, each on all of these benches.
"""

import json
from pathlib import Path

import numpy as np

from rotorid_lab import log
from rotorid_lab.bench import read_geometry
from rotorid_lab.fem import studies
from rotorid_lab.fem.bench import EVEN, MIDDLE, NEARLY, judge_statements
from rotorid_lab.fem.placement import read_assumed, read_moduli


def main(sizes: str, moduli: str, geometry: str, mesh: str, draws: int, seed: int, benches: str, judged: str) -> None:
    """Write a bench a row (CSV), and the statements with the ranges of what they are judged by (JSON)."""
    table = studies.size_study(
        read_assumed(sizes),
        read_moduli(moduli),
        read_geometry(geometry),
        studies.LEVELS[mesh]["sizes"],
        draws,
        np.random.default_rng(seed),
    )
    table.to_csv(benches, index=False, float_format="%.6g")
    result = {
        "fineness": studies.LEVELS[mesh]["sizes"],
        "benches": len(table),
        "drawn": int((table["end"] == "drawn").sum()),
        "even": EVEN,
        "middle": MIDDLE,
        "nearly": NEARLY,
        "statements": judge_statements(table),
        "ranges": studies.ranges(table),
        "strongest": studies.strongest(table),
    }
    Path(judged).write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            sizes=snakemake.input.sizes,
            moduli=snakemake.input.moduli,
            geometry=snakemake.input.geometry,
            mesh=snakemake.params.mesh,
            draws=snakemake.params.draws,
            seed=snakemake.params.seed,
            benches=snakemake.output.benches,
            judged=snakemake.output.statements,
        )
