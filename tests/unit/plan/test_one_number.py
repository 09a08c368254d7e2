"""Verdict, page and plan of one set: the class is the same in all, and the plan alone states a separation."""

import json
from pathlib import Path

import pytest

from rotorid.recordings import read_set
from rotorid.report.deliver import analysis_of, write_files
from rotorid_proof.concealed.build import build
from rotorid_proof.concealed.planned import look_alikes
from tests.command_line import answer

CASE = "look_alike/thrust_tilt-com_offset/05"
"""Two calm flights with a tilted thrust: it may as well be a steady wind."""


@pytest.fixture(scope="module")
def verdict(tmp_path_factory) -> Path:
    """The verdict's folder, the set beside it."""
    folder = tmp_path_factory.mktemp("alike")
    (case,) = [c for c in look_alikes() if c.name == CASE]
    build(case, folder, folder / "answers")
    out = folder / "verdict"
    write_files(analysis_of(read_set(folder / case.set_name)), out)
    return out


def test_a_verdict_states_no_separation_that_the_plan_would_not(verdict: Path) -> None:
    said = json.loads((verdict / "verdict.json").read_text(encoding="utf-8"))["next_experiment"]
    assert set(said["separates"]) == {"steady_wind", "thrust_tilt"}
    # Position is recorded: it need not be asked for.
    assert "yaw" in said["manoeuvre"] and "record" not in said["manoeuvre"]
    page = (verdict / "report.html").read_text(encoding="utf-8")
    section = page.split("<h2>What to fly next</h2>")[1].split("</section>")[0]
    assert "<code>rotorid plan</code> says which flight" in section and "standard errors" not in section
    printed = answer("plan", verdict, "-q")
    plan = json.loads((verdict / "plan" / "plan.json").read_text(encoding="utf-8"))
    assert [set(q["ids"]) for q in plan["questions"]] == [set(said["separates"])]
    assert said["predicted_separation_sigma"] in (None, plan["predicted_separation_sigma"])
    sigmas = [o["sigma"] for q in plan["questions"] for o in q["outcomes"]]
    assert plan["predicted_separation_sigma"] == min(sigmas) > 3.0
    # The standard flight stands next to it, as long and expected to do no better.
    (standard,) = [f for f in (plan, *plan["others"]) if f["flight"] == "standard"]
    assert [f["flight"] for f in plan["others"]] != [] and standard["duration_s"] <= plan["limits"]["duration_s"]
    assert standard["predicted_separation_sigma"] <= plan["predicted_separation_sigma"]
    assert "The standard flight, " in printed
    # What the page then says is the plan's own number.
    with_plan = (verdict / "report.html").read_text(encoding="utf-8").split("<!-- plan -->")[1]
    for sigma in sigmas:
        assert f"{sigma:.1f} standard errors (" in with_plan
