"""What changed in each vehicle of a fleet since its first sets.

- Splits the history of each vehicle where trims, shares of the rotors, thrust, sensors or noise differ.
- Writes every quantity with its interval, what differs and from which set on, a figure, and a page a vehicle.
"""

import re
from pathlib import Path

from rotorid.report.fleet import history, sets_of_vehicles, vehicle_page
from rotorid.report.plots.mismatch import draw_history
from rotorid_lab import log


def main(folders: list[str], good: int, numbers: str, events: str, figure: str, pages: str) -> None:
    """Write the history of the vehicles whose sets are in `folders`; the first `good` ones are the reference."""
    sets = sets_of_vehicles([Path(f) for f in folders], log.progress)
    rows, found = history(sets, good, log.progress)
    rows.to_csv(numbers, index=False, float_format="%.6g")
    found.to_csv(events, index=False)
    draw_history(rows, found, Path(figure))
    Path(pages).mkdir(parents=True, exist_ok=True)
    for number, (vehicle, own) in enumerate(rows.groupby("vehicle", sort=False)):
        page = vehicle_page(vehicle, own, found[found["vehicle"] == vehicle])
        (Path(pages) / f"{number:04d}-{file_of(vehicle)}.html").write_text(page, encoding="utf-8")


def file_of(vehicle: str) -> str:
    """A vehicle's name as part of a file's."""
    return re.sub(r"[^A-Za-z0-9-]+", "-", vehicle).strip("-")[:60]


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            folders=snakemake.params.folders,
            good=snakemake.params.good,
            numbers=snakemake.output.numbers,
            events=snakemake.output.events,
            figure=snakemake.output.figure,
            pages=snakemake.output.pages,
        )
