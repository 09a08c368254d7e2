"""Which public recordings there are, read without the importers: Snakemake does it at every start."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rotorid.io.text.files import read_yaml


def read_manifest(path: str | Path) -> dict[str, dict[str, Any]]:
    """Sources of the public recordings by name, from `public_data.yaml`: origin, licence, sets, files."""
    return read_yaml(Path(path), compiled=True)["sources"]


def of_one_motor(name: str) -> bool:
    """Whether a set is of the bench and holds the runs of one motor only."""
    return name.startswith("strawson-") and name.count("-") == 2
