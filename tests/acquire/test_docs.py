"""The documentation names every column, command and ending there is."""

import re
from pathlib import Path

import pytest

from rotorid_acquire.cli import app
from rotorid_acquire.io.session import Ended
from rotorid_acquire.io.wire import INSTRUMENTS

DOCS = Path(__file__).parents[2] / "docs"
WIRE = (DOCS / "wire-formats.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("instrument", INSTRUMENTS.values(), ids=lambda i: i.name)
def test_wire_formats_name_all_columns_and_commands(instrument):
    assert f"### {instrument.name}\n" in WIRE
    for column in instrument.columns:  # `cell_1_v` … `cell_6_v` stands for all six
        assert f"`{column}`" in WIRE or f"`{re.sub('[2-9]', '1', column)}` …" in WIRE, column
    for letter in instrument.commands:
        assert f"`{letter}`" in WIRE, letter


def test_all_endings_are_explained():
    assert [ended for ended in Ended if f"`{ended}`" not in WIRE] == []


def test_acquisition_page_names_all_commands():
    page = (DOCS / "acquisition.md").read_text(encoding="utf-8")
    names = [c.name or c.callback.__name__ for c in app.registered_commands]
    assert [name for name in names if name not in page] == []
