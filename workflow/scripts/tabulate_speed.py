"""Tables of the chapter on speed, from what the benchmarks wrote.

- One table (CSV) of each benchmark, its columns by short names.
- The commit that each table was stored with (JSON).
"""

import json
from collections.abc import Mapping
from pathlib import Path

from rotorid.io.text.markdown_table import first_table
from rotorid.report import log

COLUMNS = {
    "simulator": ["what", "seconds", "times"],
    "selection": ["hidden", "flights", "columns", "making", "pysindy", "search", "analysis", "found_by", "found"],
    "importing": ["log", "size_mb", "plain", "ours", "beyond", "outcome"],
    "mismatch": ["recording", "samples", "analysis_s", "per_second", "memory_mb", "found"],
    "rebuild": ["what", "processor_before", "processor", "wall_before", "wall"],
    "fleet": ["what", "amount"],
    "fem": ["what", "coarse", "full"],
}


def main(files: Mapping[str, str], stored: Mapping[str, str], out: Mapping[str, str]) -> None:
    """Write the table of each benchmark in `files` to the file of the same name in `out`; `stored` too."""
    tables = {
        name: first_table(Path(files[name]).read_text(), columns, files[name]) for name, columns in COLUMNS.items()
    }
    for column in ("found_by", "found"):
        tables["selection"][column] = tables["selection"][column].str.replace("_", " ")
    for name, table in tables.items():
        table.to_csv(out[name], index=False)
    Path(out["stored"]).write_text(json.dumps(dict(stored), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            files=dict(snakemake.input.items()),
            stored=dict(snakemake.params.stored),
            out=dict(snakemake.output.items()),
        )
