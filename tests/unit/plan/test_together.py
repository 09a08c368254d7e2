"""Two sets as one: what must be the same, what is held out, and what the second settled."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rotorid.cli.planning import sets_of
from rotorid.errors import InputError
from rotorid.mismatch.decide.findings import Finding
from rotorid.plan.questions import answers, joined_sets
from rotorid.recordings import RecordingSet, Run, templates
from tests.command_line import refusal
from tests.refusals import refused

VEHICLE = templates.read("thesis")


def a_set(name: str, runs: int, columns: tuple[str, ...] = ("angular_velocity_x_rad_s",), **vehicle) -> RecordingSet:
    t = np.arange(0, 5, 0.01)
    made = [Run(f"run{i}", pd.DataFrame({"time_s": t, **{c: np.sin(t + i) for c in columns}})) for i in range(runs)]
    return RecordingSet(name, VEHICLE.model_copy(update=vehicle), tuple(made), None)


def test_runs_carry_their_set_and_the_first_keeps_what_it_holds_out() -> None:
    whole, notes = joined_sets(replace(a_set("first", 3), held_out=("run1",)), a_set("second", 1))
    assert [r.name for r in whole.runs] == ["1-run0", "1-run1", "1-run2", "2-run0"]
    assert whole.held_out == ("1-run1",) and whole.name == "first+second"
    assert len(notes) == 1


def test_a_later_flight_in_one_run_is_cut_so_that_a_third_is_held_out() -> None:
    t = np.arange(0, 30, 0.01)
    table = pd.DataFrame({"time_s": t, "angular_velocity_x_rad_s": np.sin(t)})
    whole, _ = joined_sets(a_set("first", 2), RecordingSet("second", VEHICLE, (Run("planned", table),), None))
    assert [r.name for r in whole.runs[2:]] == ["2-planned-1", "2-planned-2", "2-planned-3"]
    assert [n for n in whole.held_out if n.startswith("2-")] == ["2-planned-2"]
    assert np.concatenate([r.table["time_s"] for r in whole.runs[2:]]) == pytest.approx(t)


def test_columns_that_one_set_lacks_are_named_and_left_out() -> None:
    rates = ("angular_velocity_x_rad_s",)
    whole, notes = joined_sets(a_set("first", 2, rates), a_set("second", 1, (*rates, "height_m")))
    assert all("height_m" not in r.table.columns for r in whole.runs)
    assert any("Not all sets have height_m of set 2" in n for n in notes)


def test_a_third_set_is_judged_with_the_others() -> None:
    whole, _ = joined_sets(a_set("first", 1), a_set("second", 1), a_set("third", 1))
    assert whole.name == "first+second+third"
    assert [r.name for r in whole.runs] == ["1-run0", "2-run0", "3-run0"]
    with pytest.raises(InputError, match="first and third differ in mass_kg"):
        joined_sets(a_set("first", 1), a_set("second", 1), a_set("third", 1, mass_kg=9.0))


def test_a_verdict_of_several_sets_finds_each_of_them(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)  # sets are looked for below the folder one is in, too
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "vehicle.yaml").write_text("", encoding="utf-8")
    folder = tmp_path / "answer"
    folder.mkdir()
    assert [p.name for p in sets_of(folder, {"set": "first+second"})] == ["first", "second"]
    refused("the recording set third of this verdict", sets_of, folder, {"set": "first+third"})


def test_another_vehicle_is_refused_by_the_key_that_differs() -> None:
    refused("differ in mass_kg", joined_sets, a_set("first", 2), a_set("second", 1, mass_kg=9.0))


def test_nothing_in_common_is_refused() -> None:
    refused("no column in common", joined_sets, a_set("first", 1), a_set("second", 1, ("height_m",)))


def test_answers_say_what_was_settled_narrowed_or_left() -> None:
    ids = ("frame_drag", "rotor_drag", "steady_wind")
    sure = Finding("rotor_drag", "established")
    fewer = Finding("rotor_drag", "ambiguous", alternatives=("frame_drag", "rotor_drag"))
    assert answers([ids], [sure])[0]["answer"] == "rotor_drag"
    assert "narrowed" in answers([ids], [fewer])[0]["sentence"] and not answers([ids], [fewer])[0]["answer"]
    assert answers([ids], [sure, fewer])[0]["answer"] == ""
    assert "neither" in answers([ids], [])[0]["sentence"]
    assert "suggested" in answers([ids], [Finding("rotor_drag", "suggested")])[0]["sentence"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("plan", "nowhere"), "no such file"),
        (("plan", "nowhere", "--want", "mass_kg"), "expected a value of vehicle.yaml, or an effect, and a share"),
        (("plan", "nowhere", "--limits", "room.yaml"), "no such file"),
        (("together", "nowhere", "elsewhere"), "nowhere"),
    ],
)
def test_bad_input_ends_in_one_sentence(tmp_path: Path, monkeypatch, words, said: str) -> None:
    monkeypatch.chdir(tmp_path)
    assert said in refusal(*words)


def test_a_verdict_without_its_set_asks_for_it(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "verdict.json").write_text('{"set": "lost", "kind": "flight", "effects": []}', encoding="utf-8")
    assert "--set" in refusal("plan", tmp_path)
