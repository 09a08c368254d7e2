"""The table of real recordings.

- One line a study that could be made or on which the stage stopped; published coefficients next to ours.
- Next to the NeuroBEM flights held out, NeuroBEM's own prediction of the same flight.
"""

from pathlib import Path

import pandas as pd

from rotorid_lab import log
from rotorid_proof import real
from rotorid_proof.studies import study


def main(studies: list[str], flights: str, judging: str, table: str, coefficients: str) -> None:
    """Gather the results of `studies`, judged by the code `judging`; `flights` holds NeuroBEM's own errors."""
    results = real.read_results([Path(p) for p in studies])
    lines = [r["row"] if r["available"] else real.stopped_row(study(r["study"])) for r in results]
    rows = pd.DataFrame(lines, columns=real.ROW_COLUMNS)
    own = real.neurobem_errors(pd.read_csv(flights).to_dict("records"))
    for group in ("force", "moment"):
        rows[f"{group}_neurobem"] = [own.get((held, group)) for held in rows["held_out"]]
    rows["judged_by"] = judging
    rows.to_csv(table, index=False, float_format="%.6g")
    found = [c for r in results if r["available"] for c in r["compared"]]
    pd.DataFrame(found, columns=real.COMPARED_COLUMNS).to_csv(coefficients, index=False, float_format="%.6g")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            studies=snakemake.input.studies,
            flights=snakemake.input.flights,
            judging=snakemake.params.judging,
            table=snakemake.output.table,
            coefficients=snakemake.output.coefficients,
        )
