"""Tables, figure and page of a fleet from the verdicts on its sets.

- Collects the verdicts of all batches.
- Writes one row a set, one an effect, one a number, the figure and the page.
"""

import os
from pathlib import Path

import pandas as pd

from rotorid.report.fleet import by_effect, by_vehicle, collect, make_page
from rotorid.report.plots.mismatch import draw_fleet
from rotorid_lab import log


def main(
    batches: list[str], recordings: str, tables: dict[str, str], figure: str, page: str, history: list[str]
) -> None:
    """Summarise the folders of sets below `batches`; `tables` are paths by name: sets, effects, parameters.

    `history` are the files of events and their figure, empty where they were not asked for.
    """
    folders = [folder for batch in batches for folder in Path(batch).iterdir() if folder.is_dir()]
    sets, effects, parameters = collect(folders, Path(recordings))
    counts = by_effect(effects, sets)
    for name, table in (("sets", sets), ("effects", counts), ("parameters", parameters)):
        table.to_csv(tables[name], index=False, float_format="%.6g")
    draw_fleet(counts, parameters, sets, Path(figure))
    beside = Path(page).parent
    links = {f.name: os.path.relpath(f / "report.html", beside) for f in folders if (f / "report.html").is_file()}
    name, fleet = Path(recordings).resolve().name, by_vehicle(effects, sets)
    since = (pd.read_csv(history[0]), Path(history[1])) if history else None
    text = make_page(name, sets, counts, fleet, links, Path(figure), since)
    Path(page).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            batches=snakemake.input.batches,
            recordings=snakemake.params.recordings,
            tables={name: snakemake.output[name] for name in ("sets", "effects", "parameters")},
            figure=snakemake.output.figure,
            page=snakemake.output.page,
            history=[str(f) for f in (snakemake.input.events, snakemake.input.history) if f],
        )
