"""`rotorid compare`: what may stand on its command line."""

import json
from pathlib import Path

import pytest

from rotorid.cli.modelling import fly
from rotorid.cli.verdicts import read
from rotorid.errors import InputError
from rotorid.recordings import read_set, templates
from tests.command_line import answer, invoke
from tests.refusals import refused


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
    said = answer("compare", *logs, "--like", "thesis", "--mass-kg", "0.652", "-q", "-o", tmp_path / "changes.json")
    assert "from monday to friday" in said
    found = json.loads((tmp_path / "changes.json").read_text())
    assert not [c for c in found["changes"] if c["status"] in ("established", "ambiguous")]
    assert found["level_1"]["nothing_changed"] and found["level_1"]["sentences"][0] in said


def test_what_differs_is_printed_before_its_explanation_is_sought(logs: list[Path], monkeypatch) -> None:
    def stopped(*args, **options):
        raise InputError("the explanation was sought")

    monkeypatch.setattr("rotorid.mismatch.changes.compare.changes_between", stopped)
    done = invoke("compare", *logs, "--like", "thesis", "--mass-kg", "0.652", "-q")
    first, second = done.output.index("no trim, share of a rotor"), done.output.index("the explanation was sought")
    assert done.exit_code == 1 and first < second


def test_a_difference_without_a_name_fails_a_regression_test(logs: list[Path], tmp_path: Path) -> None:
    """Rotor 2 turns a tenth faster than in the good flight: level 1 alone may say so."""
    import pandas as pd

    table = pd.read_csv(logs[1])
    speeds = [name for name in table if name.startswith("rotor_") and "_2_" in name]
    weak = tmp_path / "weak.csv"
    table.assign(**{name: 1.15 * table[name] for name in speeds}).to_csv(weak, index=False)
    done = invoke("compare", logs[0], weak, "--like", "thesis", "--mass-kg", "0.652", "-q", "--ci")
    assert done.exit_code == 1 and "Rotor 2 is asked for" in done.output


def test_one_set_or_no_set_is_one_sentence(logs: list[Path]) -> None:
    assert "nothing to compare it with" in invoke("compare", logs[0]).output
    refused("nowhere", read, [Path("nowhere"), logs[0]])
