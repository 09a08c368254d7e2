"""Rigid-body residuals of the NeuroBEM flights, next to what NeuroBEM itself leaves over.

- Measured wrench minus the believed rotors' wrench, and minus NeuroBEM's own prediction; equal filters.
- RMS of each flight and channel; RMS against airspeed with block-bootstrap intervals.
- Where the recordings are not there, the result says so.
"""

import json
from pathlib import Path

from rotorid.recordings import read_set
from rotorid.recordings.importers.faults import read_report
from rotorid_lab import log
from rotorid_lab.rigid_body_residuals import compare_with_neurobem, no_neurobem


def main(folder: str, settings: dict, summary: str, flights: str, bins: str, points: str) -> None:
    """Compare the flights in `folder`; `settings` holds cutoff_hz, airspeed_bin_m_s, block_s and seed."""
    report = read_report(Path(folder))
    found, *tables = compare_with_neurobem(read_set(folder), **settings) if report["available"] else no_neurobem()
    result = {"available": report["available"], "reason": report["reason"], **settings, **found}
    Path(summary).write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    for own, path, form in zip(tables, (flights, bins, points), (None, None, "%.6g"), strict=True):
        own.to_csv(path, index=False, float_format=form)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        names = ("cutoff_hz", "airspeed_bin_m_s", "block_s", "seed")
        main(
            folder=snakemake.input.recordings,
            settings={name: snakemake.params[name] for name in names},
            summary=snakemake.output.summary,
            flights=snakemake.output.flights,
            bins=snakemake.output.bins,
            points=snakemake.output.points,
        )
