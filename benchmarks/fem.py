"""The load-cell bench by finite elements on the coarse and on the full mesh: what changes, and what it costs.

Run: OMP_NUM_THREADS=1 python benchmarks/fem.py [--out benchmarks/fem.md]
Each mesh in a process of its own, one core; `fem: {mesh: full}` in config.yaml is the second one.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import resource
import subprocess
import sys
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import skfem

from rotorid_lab.bench import read_geometry
from rotorid_lab.fem import studies
from rotorid_lab.fem.bench import judge_statements, ratios
from rotorid_lab.fem.placement import read_assumed, read_moduli

ROOT = Path(__file__).resolve().parents[1]
DRAWS, SEED = 12, 1
"""As in config.yaml."""
RATIOS = {
    "ratio_deformation": ("deformation", "PLA over aluminium, largest deformation"),
    "ratio_narrow_upper": ("narrow_upper", "PLA over aluminium, stress in an upper cell's narrow section"),
    "ratio_narrow_lower": ("narrow_lower", "PLA over aluminium, stress in a lower cell's narrow section"),
}


def measure(mesh: str) -> dict[str, str]:
    """A cell of the table by its row, for one mesh."""
    assumed, moduli = read_assumed(ROOT / "workflow/bench_sizes.yaml"), read_moduli(ROOT / "raw/thesis/table_2_4.csv")
    geometry = read_geometry(ROOT / "raw/thesis/table_2_3.csv")
    level = studies.LEVELS[mesh]
    began = time.process_time()
    table, _, _, answers = studies.mesh_study(assumed, moduli, geometry, level["study"])
    bench_s = time.process_time() - began
    began = time.process_time()
    benches = studies.size_study(assumed, moduli, geometry, level["sizes"], DRAWS, np.random.default_rng(SEED))
    sizes_s = time.process_time() - began
    own, ranges = ratios(answers), studies.ranges(benches)
    rows = {
        "elements of the finest mesh": f"{int(table['elements'].iloc[-1])}",
        "processor time of the mesh study, s": f"{bench_s:.0f}",
        "processor time of the other sizes, s": f"{sizes_s:.0f}",
        "largest memory, MB": f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f}",
    }
    for name, (short, what) in RATIOS.items():
        rows[what] = f"{own[short]:.3f}"
        rows[f"{what}: range over the sizes"] = " to ".join(f"{end:.2f}" for end in ranges[name])
    for name, found in answers.items():
        rows[f"eq. 2.8 for one newton, {studies.SHORT[name]}, N"] = f"{found['equation_n']:.3f}"
    for row in judge_statements(benches):
        rows[f"{row['statement']}: holds on"] = f"{row['holds']} of {row['benches']}"
    return rows


def main(out: Path | None) -> None:
    measured = {}
    for mesh in studies.LEVELS:
        command = [sys.executable, __file__, "--mesh", mesh]
        measured[mesh] = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    text = (
        "# Finite elements of the bench\n\n"
        f"`python benchmarks/fem.py`: Python {platform.python_version()}, numpy {np.__version__}, "
        f"scikit-fem {skfem.__version__}, one core.\n\n"
        "| what | coarse | full |\n| --- | ---: | ---: |\n"
    )
    for what, coarse in measured["coarse"].items():
        text += f"| {what} | {coarse} | {measured['full'][what]} |\n"
    print(text)
    if out:
        out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--mesh", choices=tuple(studies.LEVELS), help="measure one mesh and print JSON")
    options = parser.parse_args()
    if options.mesh:
        print(json.dumps(measure(options.mesh)))
    else:
        main(options.out)
