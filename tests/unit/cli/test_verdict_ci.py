"""`rotorid verdict --ci`: a regression test of an airframe, and what the screen says before the verdict."""

import json
from pathlib import Path
from types import SimpleNamespace

import pytest

from rotorid.cli.modelling import fly
from rotorid.cli.verdicts import faults_of, share_of
from rotorid.recordings import read_set, templates, write_vehicle
from tests.command_line import invoke
from tests.refusals import refused


def verdict(word="explained", share=0.0, doubts=(), warnings=()):
    doubted = tuple(SimpleNamespace(sentence=s, stops=False) for s in doubts)
    return SimpleNamespace(verdict=word, unexplained=SimpleNamespace(share=share), doubts=doubted, warnings=warnings)


@pytest.mark.parametrize(("text", "share"), [("20%", 0.2), ("0.2", 0.2), (" 5 %", 0.05), ("0", 0.0)])
def test_a_share_is_a_percentage_or_a_number(text, share):
    assert share_of(text) == pytest.approx(share)


@pytest.mark.parametrize("text", ["120%", "-1", "a fifth", "nan", ""])
def test_what_is_no_share_is_refused(text):
    refused("--max-unexplained", share_of, text)


def test_what_fails_a_regression_test_of_an_airframe():
    assert faults_of(verdict(), 0.2, no_doubts=True) == []
    assert faults_of(verdict("not_judged"), 1.0, no_doubts=False) == ["the set is not judged"]
    (fault,) = faults_of(verdict("partly_explained", share=0.4), 0.2, no_doubts=False)
    assert "40 % stays unexplained, more than 20 %" in fault
    said = faults_of(verdict(doubts=("The mass is proposed.",), warnings=("Yaw is worse.",)), 1.0, no_doubts=True)
    assert said == ["The mass is proposed.", "Yaw is worse."]
    assert faults_of(verdict(doubts=("The mass is proposed.",)), 1.0, no_doubts=False) == []


@pytest.fixture(scope="module")
def grams(tmp_path_factory) -> Path:
    """Two short flights whose vehicle file has the mass in grams."""
    folder = fly(templates.read("thesis"), tmp_path_factory.mktemp("sets") / "grams", 6.0, 2, 1)
    vehicle = read_set(folder).vehicle
    write_vehicle(vehicle.model_copy(update={"mass_kg": 1000 * vehicle.mass_kg}), folder / "vehicle.yaml")
    return folder


def test_a_mass_in_grams_is_not_judged_and_said_first(grams: Path, tmp_path: Path):
    done = invoke("verdict", grams, "-o", tmp_path / "out", "-q", "--ci")
    assert done.exit_code == 1, done.output
    basis, first, *rest = done.output.splitlines()
    assert basis.startswith("The verdict rests on 12 s in the air; none of it is on the ground; not recorded:")
    assert first.startswith("! ") and "mass_kg" in first
    assert any(line.startswith("Not judged.") for line in rest) and any("ci: the set is not judged" in x for x in rest)
    page = (tmp_path / "out" / "report.html").read_text()
    assert json.loads((tmp_path / "out" / "verdict.json").read_text())["basis"]["sentence"] == basis and basis in page
    assert "not judged" in page and "Before you believe this" in page
