"""What changed in each vehicle of a fleet since its first sets.

- Holds every later set of a vehicle against its first ones.
- Writes each believed value's change with its interval, what changed and from which set on, and a figure.
"""

from pathlib import Path

from rotorid.report import log
from rotorid.report.fleet.history import by_vehicle, history
from rotorid.report.plots.fleet import draw_history


def main(folders: list[str], good: int, numbers: str, events: str, figure: str) -> None:
    """Write the history of the vehicles whose sets are in `folders`; the first `good` ones are the reference."""
    sets = by_vehicle([Path(f) for f in folders], log.progress)
    rows, found = history(sets, good, log.progress)
    rows.to_csv(numbers, index=False, float_format="%.6g")
    found.to_csv(events, index=False)
    draw_history(rows, found, Path(figure))


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            folders=snakemake.params.folders,
            good=snakemake.params.good,
            numbers=snakemake.output.numbers,
            events=snakemake.output.events,
            figure=snakemake.output.figure,
        )
