"""`rotorid compare`: what may stand on its command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rotorid.cli import app
from rotorid.cli.comparing import read
from rotorid.cli.simulating import fly
from rotorid.errors import InputError
from rotorid.recordings import read_set, templates


def run(*words: object):
    return CliRunner().invoke(app, [str(w) for w in words])


@pytest.fixture(scope="module")
def logs(tmp_path_factory) -> list[Path]:
    """Two flights of a thesis quadrotor, each a table of its own."""
    folder = tmp_path_factory.mktemp("logs")
    flights = fly(templates.read("thesis"), folder / "flights", 12.0, 2, 1)
    out = []
    for name, one in zip(("monday", "friday"), read_set(flights).runs, strict=True):
        out.append(folder / f"{name}.csv")
        one.table.to_csv(out[-1], index=False)
    return out


def test_logs_become_sets_of_one_vehicle(logs: list[Path]) -> None:
    first, second = read(logs, mass_kg=0.652, like="thesis")
    assert (first.name, second.name) == ("monday", "friday")
    assert first.vehicle.model_copy(update={"name": ""}) == second.vehicle.model_copy(update={"name": ""})
    assert [len(s.runs) for s in (first, second)] == [1, 1] and first.vehicle.mass_kg == 0.652


def test_two_logs_are_compared(logs: list[Path], tmp_path: Path) -> None:
    done = run("compare", *logs, "--like", "thesis", "--mass-kg", "0.652", "-q", "-o", tmp_path / "changes.json")
    assert done.exit_code == 0, done.output
    assert "from monday to friday" in done.output
    found = json.loads((tmp_path / "changes.json").read_text())
    assert not [c for c in found["changes"] if c["status"] in ("established", "ambiguous")]


def test_one_set_or_no_set_is_one_sentence(logs: list[Path]) -> None:
    assert "nothing to compare it with" in run("compare", logs[0]).output
    with pytest.raises(InputError, match="nowhere"):
        read([Path("nowhere"), logs[0]])
