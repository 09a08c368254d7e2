"""The mismatch stage on one set of real recordings.

- Reads the set with the runs held out that the study asks for.
- Writes the verdict, a line for the table and published numbers next to ours.
- Writes what is left over time of one run held out.
"""

import json
import logging
import traceback
from pathlib import Path

import pandas as pd

from rotorid.recordings import read_set
from rotorid.recordings.importers.faults import read_report
from rotorid.report.deliver import analysis_of, residuals_of, verdict_of
from rotorid_lab import log
from rotorid_proof import real
from rotorid_proof.studies import study

LOGGER = logging.getLogger("rotorid.study")


def main(folder: str, name: str, out: str, residuals: str) -> None:
    """Run study `name` on the set in `folder`; `residuals` is the table (CSV) of one run held out."""
    left = pd.DataFrame()
    report = read_report(Path(folder))
    result = {"available": report["available"], "reason": report["reason"], "study": name}
    if report["available"]:
        wanted = study(name)
        recordings = real.with_split(read_set(Path(folder)), wanted)
        try:
            analysis = analysis_of(recordings)
            verdict = json.loads(verdict_of(analysis).text())
            left = real.left_of(residuals_of(analysis), verdict)
        except Exception as error:  # a stage that stops on real data is a result: the table says so
            LOGGER.error("%s", traceback.format_exc())
            result |= {"available": False, "reason": f"{real.STOPPED}: {type(error).__name__}: {error}"}
        else:
            result |= {
                "row": real.row_of(verdict, wanted),
                "compared": real.compared(verdict, wanted, real.mean_total_speed(recordings)),
                "verdict": verdict,
            }
    Path(out).write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    left.to_csv(residuals, index=False, float_format="%.5g")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            folder=snakemake.input.recordings,
            name=snakemake.wildcards.study,
            out=snakemake.output.result,
            residuals=snakemake.output.residuals,
        )
