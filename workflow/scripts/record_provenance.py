"""Record what the report was made from and with."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rotorid.report import provenance
from rotorid_lab import log


def main(raw: Sequence[str], lock: str, config: Mapping[str, Any], out: str) -> None:
    """Write the provenance of a run to the JSON file `out`."""
    record = provenance.gather(raw=raw, lock=lock, config=config)
    Path(out).write_text(json.dumps(record, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            raw=snakemake.input.raw,
            lock=snakemake.input.lock,
            config=snakemake.params.config,
            out=snakemake.output.provenance,
        )
