"""Which public recordings there are, read without the importers: Snakemake does it at every start."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml


def read_manifest(path: str | Path) -> dict[str, dict[str, Any]]:
    """Sources of the public recordings by name, from `public_data.yaml`: origin, licence, sets, files."""
    with open(path, encoding="utf-8") as file:
        return yaml.load(file, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))["sources"]


def of_one_motor(name: str) -> bool:
    """Whether a set is of the bench and holds the runs of one motor only."""
    return name.startswith("strawson-") and name.count("-") == 2
