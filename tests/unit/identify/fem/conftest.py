"""What the thesis prints of the bench, and the assumed sizes."""

from pathlib import Path

import pytest

from rotorid_lab.bench import read_geometry
from rotorid_lab.fem.placement import read_assumed, read_moduli

ROOT = Path(__file__).parents[4]


@pytest.fixture(scope="session")
def geometry():
    return read_geometry(ROOT / "raw/thesis/table_2_3.csv")


@pytest.fixture(scope="session")
def assumed():
    return read_assumed(ROOT / "workflow/bench_sizes.yaml")


@pytest.fixture(scope="session")
def moduli():
    return read_moduli(ROOT / "raw/thesis/table_2_4.csv")
