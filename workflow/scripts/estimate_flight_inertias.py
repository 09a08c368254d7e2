"""Inertias from the flights of other laboratories, next to what they publish.

- Rotor moments against angular acceleration in a band, bounds and estimate, for several delays of the rotor speeds.
"""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.recordings import read_set
from rotorid.recordings.importers.faults import read_report
from rotorid_lab import log
from rotorid_lab.inertias import band_signals, fit_flights

DELAYS_S = np.arange(0.0, 0.0201, 0.0025)
COLUMNS = "set axis published lower estimate upper low_95 high_95 ratio r2 delay_ms".split()


def one_set(folder: Path, band_hz, rate_hz: float, block_s: float, seed: int) -> list[dict]:
    """A row an axis for one set; the delay that explains most is taken."""
    recordings = read_set(folder)
    vehicle = recordings.vehicle
    published = np.diag(vehicle.inertia_kg_m2.matrix())
    best, found = -np.inf, None
    for delay in DELAYS_S:
        parts = [band_signals(run, vehicle, band_hz, delay, rate_hz) for run in recordings.runs]
        fits = fit_flights([p for p in parts if p is not None], rate_hz, block_s, np.random.default_rng(seed))
        score = fits[0]["r2"] + fits[1]["r2"]
        if score > best:
            best, found, chosen = score, fits, delay
    return [
        {
            "set": recordings.name,
            "axis": axis,
            "published": believed,
            "lower": fit["lower"],
            "estimate": fit["estimate"],
            "upper": fit["upper"],
            "low_95": fit["interval_95"][0],
            "high_95": fit["interval_95"][1],
            "ratio": fit["estimate"] / believed,
            "r2": fit["r2"],
            "delay_ms": 1000 * chosen,
        }
        for axis, believed, fit in zip(("xx", "yy", "zz"), published, found, strict=True)
    ]


def main(
    sets: Sequence[str], band_hz, rates_hz: Sequence[float], block_s: float, seed: int, table: str, summary: str
) -> None:
    """Write a row for each set and axis (CSV) and whether the sets were there (JSON)."""
    rows, missing = [], []
    for folder, rate_hz in zip(sets, rates_hz, strict=True):
        report = read_report(Path(folder))
        if report["available"]:
            rows += one_set(Path(folder), tuple(band_hz), rate_hz, block_s, seed)
        else:
            missing.append(f"{Path(folder).name}: {report['reason']}")
    pd.DataFrame(rows, columns=COLUMNS).to_csv(table, index=False, float_format="%.6g")
    found = {
        "available": bool(rows),
        "missing": missing,
        "band_hz": list(band_hz),
        "sets": {
            name: {row["axis"]: row for row in rows if row["set"] == name} for name in {r["set"]: 0 for r in rows}
        },
    }
    Path(summary).write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            sets=snakemake.input.sets,
            band_hz=snakemake.params.band_hz,
            rates_hz=snakemake.params.rates_hz,
            block_s=snakemake.params.block_s,
            seed=snakemake.params.seed,
            table=snakemake.output.table,
            summary=snakemake.output.summary,
        )
