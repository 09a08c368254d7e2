"""`rotorid plan` on flights that leave nothing open: it says so, and plans for an interval that is asked for."""

import json
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

from rotorid.cli import app
from rotorid.cli.modelling import fly
from rotorid.recordings import templates


@pytest.fixture(scope="module")
def verdict(tmp_path_factory) -> Path:
    """A verdict's folder with its set beside it."""
    folder = tmp_path_factory.mktemp("sets")
    vehicle = templates.read("thesis").model_copy(update={"ground_z_m": 0.0})
    fly(vehicle, folder / "flights", 8.0, 2, 1)
    (folder / "answer").mkdir()
    content = {"set": "flights", "kind": "flight", "effects": []}
    (folder / "answer" / "verdict.json").write_text(json.dumps(content), encoding="utf-8")
    page = "<section><h2>What to fly next</h2>\n<p>Nothing.</p></section>"
    (folder / "answer" / "report.html").write_text(page, encoding="utf-8")
    return folder / "answer"


def run(*words):
    return CliRunner().invoke(app, ["plan", *map(str, words), "-q"])


def test_nothing_open_needs_no_flight(verdict: Path) -> None:
    done = run(verdict)
    assert done.exit_code == 0, done.output
    assert "Nothing is open" in done.output
    assert [p.name for p in (verdict / "plan").iterdir()] == ["plan.json"]


@pytest.mark.slow
def test_an_interval_asked_for_is_planned_for(verdict: Path) -> None:
    done = run(verdict, "--want", "torque_coefficient_n_m_s2=0.9%", "-o", verdict / "wish")
    assert done.exit_code == 0, done.output
    content = json.loads((verdict / "wish" / "plan.json").read_text(encoding="utf-8"))
    (wish,) = [w for w in content["intervals"] if w["name"] == "torque_coefficient_n_m_s2"]
    assert wish["half_width_after"] < 0.85 * wish["half_width_before"]
    names = [m["name"] for m in content["manoeuvres"]]
    assert any(w in n for n in names for w in ("yaw", "spin", "all", "turn")), names
    assert content["duration_s"] <= content["limits"]["duration_s"]
    table = pd.read_csv(verdict / "wish" / "trajectory.csv")
    assert table["time_s"].iloc[-1] == pytest.approx(content["duration_s"], abs=0.05)
    assert (verdict / "report.html").read_text(encoding="utf-8").count("<img") == 1


@pytest.mark.slow
def test_a_value_that_cannot_be_told_is_refused(verdict: Path) -> None:
    done = run(verdict, "--want", "rotor_radius_m=1%")
    assert done.exit_code == 1 and "expected one of" in done.output


@pytest.mark.slow
def test_a_limit_of_absence_is_planned_for_where_the_effect_would_show(verdict: Path) -> None:
    room = verdict / "room.yaml"
    room.write_text("height_m: [0.15, 3]\n", encoding="utf-8")
    done = run(verdict, "--want", "ground_effect=2%", "--limits", room, "-o", verdict / "low")
    assert done.exit_code == 0, done.output
    content = json.loads((verdict / "low" / "plan.json").read_text(encoding="utf-8"))
    (wish,) = [w for w in content["intervals"] if w["name"] == "ground_effect"]
    assert wish["unit"] == "of the weight"
    # The flights at hand were high above the ground.
    assert wish["half_width_before"] is None or wish["half_width_after"] < 0.5 * wish["half_width_before"]
    assert content["manoeuvres"] and "% of the weight with this flight" in done.output
