"""Time of the thesis's black-box training (6-20-20-6, 50,000 epochs, batch) on one core.

Run: OMP_NUM_THREADS=1 python benchmarks/networks.py [--out benchmarks/networks.md]
Samples: as many as the 48 experiments give (results/black_box/experiments.csv), or made by the white box.
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import pandas as pd

from rotorid_lab.black_box import fit_thesis_network
from tests.unit.identify.blackbox.samples import generated_experiments
from tests.unit.vehicle.thesis import thesis_vehicle

SAMPLES = Path("results/black_box/experiments.csv")
EPOCHS = 50_000


def main(out: Path | None) -> None:
    if SAMPLES.exists():
        table = pd.read_csv(SAMPLES)
    else:
        curve = lambda throttle: 4.7 * (np.asarray(throttle) / 0.5) ** 1.34  # noqa: E731
        table = generated_experiments(thesis_vehicle(), curve, 0.03, 3e-4, np.random.default_rng(0))
    began, used = time.perf_counter(), time.process_time()
    fit_thesis_network(table, EPOCHS)
    wall, core = time.perf_counter() - began, time.process_time() - used
    text = (
        "# Black-box training\n\n"
        f"`python benchmarks/networks.py`: Python {platform.python_version()}, numpy {np.__version__}, one core.\n\n"
        "| network | samples | epochs | core time (s) | wall time (s) |\n| --- | ---: | ---: | ---: | ---: |\n"
        f"| 6-20-20-6, batch | {len(table)} | {EPOCHS} | {core:.1f} | {wall:.1f} |\n"
    )
    print(text)
    if out:
        out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path)
    main(parser.parse_args().out)
