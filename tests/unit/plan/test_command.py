"""`rotorid plan` on flights that leave nothing open: it says so, and plans for an interval that is asked for."""

import json
from pathlib import Path

import pandas as pd
import pytest

from rotorid.cli.modelling import fly
from rotorid.recordings import templates
from tests.command_line import answer, refusal


@pytest.fixture(scope="module")
def verdict(tmp_path_factory) -> Path:
    """A verdict's folder with its set beside it."""
    folder = tmp_path_factory.mktemp("sets")
    fly(templates.read("thesis").model_copy(update={"ground_z_m": 0.0}), folder / "flights", 8.0, 2, 1)
    (folder / "answer").mkdir()
    content = {"set": "flights", "kind": "flight", "effects": []}
    (folder / "answer" / "verdict.json").write_text(json.dumps(content), encoding="utf-8")
    page = "<section><h2>What to fly next</h2>\n<p>Nothing.</p></section>"
    (folder / "answer" / "report.html").write_text(page, encoding="utf-8")
    return folder / "answer"


def test_nothing_open_needs_no_flight(verdict: Path) -> None:
    assert "Nothing is open" in answer("plan", verdict, "-q")
    assert [p.name for p in (verdict / "plan").iterdir()] == ["plan.json"]


@pytest.mark.slow
def test_an_interval_asked_for_is_planned_for(verdict: Path) -> None:
    answer("plan", verdict, "--want", "torque_coefficient_n_m_s2=0.9%", "-o", verdict / "wish", "-q")
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
    assert "expected one of" in refusal("plan", verdict, "--want", "rotor_radius_m=1%", "-q")


@pytest.mark.slow
def test_a_limit_of_absence_is_planned_for_where_the_effect_would_show(verdict: Path) -> None:
    room = verdict / "room.yaml"
    room.write_text("height_m: [0.15, 3]\n", encoding="utf-8")
    words = ["--want", "ground_effect=2%", "--limits", room, "-o", verdict / "low"]
    said = answer("plan", verdict, *words, "-q")
    content = json.loads((verdict / "low" / "plan.json").read_text(encoding="utf-8"))
    (wish,) = [w for w in content["intervals"] if w["name"] == "ground_effect"]
    assert wish["unit"] == "of the weight"
    # The flights at hand were high above the ground.
    assert wish["half_width_before"] is None or wish["half_width_after"] < 0.5 * wish["half_width_before"]
    assert content["manoeuvres"] and "% of the weight with this flight" in said
