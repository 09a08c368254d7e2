"""What changed between two sets of flights of one vehicle."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache

import pytest
from typer.testing import CliRunner

from rotorid.cli import app
from rotorid.mismatch.changes import Changes, changes_between
from rotorid.mismatch.changes.compare import Change
from rotorid.mismatch.changes.words import as_json, sentences
from rotorid.recordings import RecordingSet, Vehicle, write_set
from tests.unit.mismatch.flights import Flight


def flights(name: str, numbers: tuple[int, ...], drag: float = 0.6) -> RecordingSet:
    """Flights of a vehicle whose drag its vehicle.yaml does not hold: what both sets lack is no change."""
    own = {f"run0{k}": Flight(k, 12.0, drag=drag) for k in numbers}
    runs = tuple(flight.record(100.0, name=run) for run, flight in own.items())
    return RecordingSet(name, own[f"run0{numbers[0]}"].vehicle, runs)


def lighter(vehicle: Vehicle, factor: float) -> Vehicle:
    """The same vehicle believed to be lighter by a factor."""
    return vehicle.model_copy(update={"mass_kg": vehicle.mass_kg / factor})


@cache
def monday() -> RecordingSet:
    """The flights that were good."""
    return flights("monday", (1, 2))


@cache
def compared(case: str) -> Changes:
    """Monday's flights against Friday's."""
    new = flights("friday", (3, 4), drag=1.2 if case == "dragging" else 0.6)
    if case == "believed lighter":
        new = replace(new, vehicle=lighter(new.vehicle, 1.1))
    return changes_between(monday(), new)


def sure(found: Changes) -> list[Change]:
    """What surely changed."""
    return [c for c in found.changes if c.status in ("established", "ambiguous")]


def test_between_two_days_of_one_vehicle_nothing_changed_though_both_lack_a_drag():
    found = compared("same")
    assert sure(found) == []
    limits = {x.id: x.at_most for x in found.limits}
    assert {"mass_kg", "thrust_coefficient_n_s2", "inertia_xx_kg_m2"} <= limits.keys()
    assert 0.0 < limits["mass_kg"] < 0.05
    assert sentences(found)[0].startswith("Nothing changed from monday to friday")


def test_a_vehicle_that_is_heavier_than_its_file_says_is_told_by_how_much():
    """True mass 10 % more than the second vehicle.yaml has it; mass and thrust coefficient are one ratio."""
    (change,) = sure(compared("believed lighter"))
    assert {change.id, *change.alternatives} & {"mass_kg", "thrust_coefficient_n_s2"}
    (size,) = change.parameters
    true = {"mass_kg": 0.1, "thrust_coefficient_n_s2": 1 / 1.1 - 1}[change.id]
    assert size.value == pytest.approx(true, abs=0.02) and size.low < true < size.high


def test_a_larger_drag_is_the_one_change():
    (change,) = sure(compared("dragging"))
    assert "rotor_drag" in {change.id, *change.alternatives}


def test_the_result_as_json_is_what_the_sentences_say():
    made = json.loads(json.dumps(as_json(compared("dragging"))))
    assert made["base"] == "monday" and made["changes"][0]["probability"] > 0.99
    assert "drag" in made["sentences"][0].lower() and "probability" in made["sentences"][0]
    assert {x["id"] for x in made["unchanged"]} >= {"mass_kg"}


def test_the_command_says_it_and_its_exit_code_is_that_of_a_regression_test(tmp_path):
    folders = [str(write_set(replace(monday(), name=name), tmp_path)) for name in ("monday", "friday")]
    run = CliRunner().invoke(app, ["compare", *folders, "--ci", "-q", "-o", str(tmp_path / "changes.json")])
    assert run.exit_code == 0, run.output
    assert "Nothing changed" in run.output and json.loads((tmp_path / "changes.json").read_text())["changes"] == []
    (tmp_path / "friday" / "vehicle.yaml").unlink()
    run = CliRunner().invoke(app, ["compare", *folders, "-q"])
    assert run.exit_code == 1 and "vehicle.yaml" in run.output
