"""The library as a script or notebook uses it: tables and logs in, objects out, one sentence for what does not fit."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import rotorid
from rotorid.recordings import RecordingSet, read_set, templates, write_set
from tests.refusals import refused


@pytest.fixture(scope="module")
def flown() -> RecordingSet:
    """Two short flights of a thesis quadrotor with a rotor drag that its belief leaves out."""
    drag = {"id": "rotor_drag", "form": "at the hubs", "parameters": {"k_d": 2.0e-4}}
    return rotorid.simulate(rotorid.template("thesis", effects=[drag]), seconds=8.0)


@pytest.fixture(scope="module")
def answer(flown: RecordingSet) -> rotorid.Result:
    tables = {run.name: run.table for run in flown.runs}
    return rotorid.verdict(tables, rotorid.template("thesis"), name="mine", held_out=["flight_2"])


def test_a_verdict_on_tables_finds_what_was_left_out(answer: rotorid.Result) -> None:
    assert answer.verdict.set == "mine" and answer.verdict.runs.held_out == ("flight_2",)
    drag = answer.effects.query("effect == 'rotor_drag' and status == 'established'").iloc[0]
    assert drag["low_95"] < 2.0e-4 < drag["high_95"]
    error = answer.errors.loc["force_x"]
    assert error["after"] < 0.7 * error["before"]
    assert "rotor_drag" in [entry["id"] for entry in answer.improved.effects]
    assert answer.ledger and answer.word in ("explained", "partly_explained")


def test_its_residuals_are_a_table_of_every_run_and_channel(answer: rotorid.Result) -> None:
    table = answer.residuals
    assert set(table["run"]) == {"flight_1", "flight_2"}
    held = table[table["run"] == "flight_2"]
    rms = np.sqrt(np.nanmean(held["force_x_before"] ** 2))
    assert rms == pytest.approx(answer.errors.loc["force_x", "before"], rel=1e-4)
    assert held["force_x_before"].notna().mean() > 0.9


def test_a_notebook_shows_it_and_markup_in_a_name_is_harmless(answer: rotorid.Result) -> None:
    shown = answer._repr_html_()
    assert "rotor_drag" in shown and "Error before and after" in shown
    assert shown.count("<table") == shown.count("</table>") >= 3
    assert repr(answer).startswith("<rotorid verdict on mine")


def test_what_it_saves_are_the_files_of_the_command(answer: rotorid.Result, flown: RecordingSet, tmp_path) -> None:
    page = answer.save(tmp_path / "answer")
    assert page.read_text() == answer.page
    names = {"verdict.json", "report.html", "improved_vehicle.yaml", "ledger.json"}
    assert {p.name for p in page.parent.iterdir()} == names
    assert (page.parent / "verdict.json").read_text() == answer.verdict.text()


def test_a_set_is_what_is_recorded_of_it_whatever_way_it_comes(flown: RecordingSet, tmp_path: Path) -> None:
    from rotorid.api import recording_set

    folder = write_set(flown, tmp_path)
    tables = [run.table for run in flown.runs]
    for data, vehicle in (
        (folder, None),
        (str(folder), "thesis"),
        (flown, folder / "vehicle.yaml"),
        (tables, templates.read("thesis").model_dump(exclude_defaults=True)),
    ):
        found = recording_set(data, vehicle)
        assert found.vehicle.mass_kg == 0.652
        for run, sound in zip(found.runs, flown.runs, strict=True):
            pd.testing.assert_frame_equal(run.table, sound.table)


def test_check_says_what_is_lacking(flown: RecordingSet) -> None:
    tables = [run.table.drop(columns="position_z_m") for run in flown.runs]
    found = rotorid.check(tables, "thesis")
    assert "No height: ground effect cannot be tested." in found.lacks
    assert "No height" in str(found) and "Columns: time_s" in str(found)
    refused("a single run must last at least", rotorid.check, tables[0], "thesis")


@pytest.mark.parametrize(
    ("spoil", "vehicle", "said"),
    [
        (lambda t: t.drop(columns="time_s"), "thesis", "run run: column time_s is missing"),
        (lambda t: t.rename(columns={"time_s": "t"}), "thesis", "is t meant?"),
        (lambda t: t.assign(note="fast"), "thesis", "line 2, column note: expected a number, found 'fast'"),
        (lambda t: t.assign(rotor_speed_9_rad_s=1.0), "thesis", "lists 4 rotors only"),
        (lambda t: t.iloc[::-1], "thesis", "must increase strictly"),
        (lambda t: t, None, "a table needs a vehicle"),
        (lambda t: t, "thesys", "did you mean thesis?"),
        (lambda t: t, {"name": "x", "kind": "flight", "mass": 1.0}, "did you mean mass_kg?"),
        (lambda t: t, "nowhere.yaml", "nowhere.yaml"),
        (lambda t: {}, "thesis", "holds no table"),
        (lambda t: 3, "thesis", "data is int"),
        (lambda t: ["nothing.ulg"], None, "nothing.ulg: file is missing"),
    ],
)
def test_what_does_not_fit_is_told_in_one_sentence(flown: RecordingSet, spoil, vehicle, said: str) -> None:
    with pytest.raises(rotorid.InputError) as told:
        rotorid.verdict(spoil(flown.runs[0].table), vehicle)
    assert said in str(told.value) and "\n" not in str(told.value)


def test_a_run_to_hold_out_must_be_there_and_one_left_to_fit(flown: RecordingSet) -> None:
    for names, said in ((["flight_3"], "did you mean flight_2?"), (["flight_1", "flight_2"], "none is left to fit")):
        refused(said.replace("?", r"\?"), rotorid.verdict, flown, held_out=names)


def test_a_wrong_key_of_a_template_is_named() -> None:
    refused("did you mean mass_kg", rotorid.template, "thesis", mass=1.0)
    assert rotorid.template("thesis", mass_kg=1.0).mass_kg == 1.0


def test_an_improved_vehicle_flies_and_is_exported(answer: rotorid.Result) -> None:
    again = rotorid.simulate(answer.improved, seconds=2.0, flights=1)
    assert len(again.runs) == 1 and not again.vehicle.effects
    assert rotorid.export(answer.improved, "rotorpy").parameters["k_d"] == pytest.approx(2.0e-4, rel=0.3)


def test_the_names_offered_are_there_and_importing_is_cheap() -> None:
    import subprocess
    import sys

    for name in rotorid.__all__:
        assert getattr(rotorid, name) is not None
    with pytest.raises(AttributeError):
        rotorid.nothing  # noqa: B018
    heavy = "import sys, rotorid; sys.exit(any(m in sys.modules for m in ('numpy', 'pandas', 'rotorid.api')))"
    assert subprocess.run([sys.executable, "-c", heavy], check=False).returncode == 0
    assert read_set is rotorid.read_set
