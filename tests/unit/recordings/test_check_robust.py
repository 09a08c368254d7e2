"""`check` looks at what a verdict takes, needs little for it, and ends in one sentence whatever happens."""

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rotorid.cli import console
from rotorid.recordings import RecordingSet, Run, read_set, read_vehicle
from rotorid.recordings import columns as c
from rotorid.recordings.check import check_folder, doubts_of
from tests.command_line import answer, invoke
from tests.unit.recordings.wrong_inputs import RUN, SPEEDS, sound, table


def turning(seconds: float = 30.0, seed: int = 0):
    """A hover in which the vehicle rolls and pitches, so that its rotors can be compared with it."""
    frame = table(seconds, seed)
    rng = np.random.default_rng(seed + 100)
    for name in c.ANGULAR_VELOCITY:
        frame[name] = rng.standard_normal(len(frame))
    return frame


def found_in(folder: Path, what: str, words: str) -> str:
    """The sentence of the one doubt of `what` with these words, which stops no verdict."""
    (doubt,) = (d for d in check_folder(folder).doubts if d.what == what and words in d.sentence)
    assert not doubt.stops
    return doubt.sentence


def test_rotor_speeds_that_keep_one_value_are_named(tmp_path: Path) -> None:
    """Before: LinAlgError."""
    folder = sound(tmp_path / "set")
    turning().assign(**dict.fromkeys(SPEEDS, 1073.0)).to_csv(folder / "run.csv", index=False)
    sentence = found_in(folder, SPEEDS[0], "one value")
    assert f"run: {SPEEDS[0]}, {SPEEDS[1]}, {SPEEDS[2]} and {SPEEDS[3]} keep one value (1073) throughout" in sentence


def test_a_rotor_that_keeps_its_speed_is_named(tmp_path: Path) -> None:
    folder = sound(tmp_path / "set")
    turning().assign(**{SPEEDS[2]: 1073.0}).to_csv(folder / "run.csv", index=False)
    assert f"run: {SPEEDS[2]} keeps one value (1073)" in found_in(folder, SPEEDS[2], "one value")


def test_doubts_of_several_runs_are_sentences(tmp_path: Path) -> None:
    """Before: "a sensor that stands still The same in 1 more."."""
    folder = sound(tmp_path / "set")
    for name in ("run", "run2"):
        turning(seed=len(name)).assign(**{SPEEDS[2]: 1073.0}).to_csv(folder / f"{name}.csv", index=False)
    assert found_in(folder, SPEEDS[2], "one value").endswith("a sensor that stands still. The same in 1 more.")


@pytest.mark.parametrize(("dead", "stops"), [("xyz", True), ("y", False)])
def test_readings_of_a_bench_that_stand_still_are_named(tmp_path: Path, dead: str, stops: bool) -> None:
    """Before: nothing was said, and of a bench that read nothing at all a tare offset was established."""
    rng, count = np.random.default_rng(0), 200
    for k in range(3):
        frame = pd.DataFrame({c.TIME: np.arange(count) / 20})
        for axis, force, reference in zip("xyz", c.FORCE, c.REFERENCE_FORCE, strict=True):
            frame[reference] = np.round(rng.standard_normal(count), 4)
            frame[force] = 1.0 if axis in dead else frame[reference] + 0.01 * rng.standard_normal(count)
        frame.to_csv(tmp_path / f"run{k}.csv", index=False)
    (tmp_path / "vehicle.yaml").write_text("name: b\nkind: bench\n")
    (doubt,) = check_folder(tmp_path).doubts
    assert doubt.what == c.FORCE["xyz".index(dead[0])] and doubt.stops == stops
    verb = "keep" if len(dead) > 1 else "keeps"
    assert (
        f"{verb} one value (1) in every run while " in doubt.sentence and "a sensor that stands still" in doubt.sentence
    )


def test_a_copied_run_is_named(tmp_path: Path) -> None:
    folder = sound(tmp_path / "set")
    (folder / "run2.csv").write_text(RUN)
    assert "Run run2 repeats run run" in found_in(folder, "run2", "repeats")


@pytest.mark.parametrize(
    "name", ["run2.csv.zip", "run2.CSV.zip", "flight.ulg", "run2.parquet.bak", "run2.csv~", "all.tar.gz", "LOG.BIN"]
)
def test_a_file_that_looks_like_a_run_and_is_not_read_is_named(tmp_path: Path, name: str) -> None:
    folder = sound(tmp_path / "set")
    (folder / name).write_bytes(b"PK")
    assert f"{name} looks like a recording and is not read" in found_in(folder, name, "not read")


def test_what_belongs_beside_runs_is_not_named(tmp_path: Path) -> None:
    folder = sound(tmp_path / "set")
    for name in ("README.md", "import_report.json", "notes.txt", ".run.csv.swp", "photo.png"):
        (folder / name).write_text("{}")
    assert [d.what for d in check_folder(folder).doubts if "not read" in d.sentence] == []


def test_a_run_that_is_left_out_is_not_analysed(tmp_path: Path) -> None:
    """Before: seven minutes and 9 GB. The run that is left out would also raise a doubt of its own."""
    folder = sound(tmp_path / "set")
    for seed in (1, 2):
        turning(seed=seed).to_csv(folder / f"run_{seed}.csv", index=False)
    (folder / "run.csv").unlink()
    jump = turning(seed=3)
    jump["time_s"] += 1e6 * (jump["time_s"] > 5)
    jump.assign(specific_force_z_m_s2=-1.0).to_csv(folder / "run_3.csv", index=False)
    check = check_folder(folder)
    assert any("run_3.csv" in sentence and "jumps by 1e+06 s" in sentence for sentence in check.lacks)
    assert [run.name for run in check.runs] == ["run_1", "run_2"]
    assert not any("multiples of g" in doubt.sentence for doubt in check.doubts)


def test_a_day_between_two_samples_costs_no_more_than_two_hours(tmp_path: Path) -> None:
    folder = sound(tmp_path / "set")
    (run,) = read_set(folder).runs
    late = run.table.copy()
    late.loc[len(late) // 2 :, "time_s"] += 86400.0 * 365
    assert doubts_of(RecordingSet("s", read_vehicle(folder / "vehicle.yaml"), (Run("run", late),)))


def test_what_nobody_foresaw_is_one_sentence_and_the_other_sets_are_checked(tmp_path: Path, monkeypatch) -> None:
    """Before: a traceback, and nothing of the other sets."""
    for name in ("a", "b"):
        sound(tmp_path / name)

    def fails_for_a(recordings: RecordingSet):
        if recordings.name == "a":
            raise np.linalg.LinAlgError("Singular matrix")
        return ()

    monkeypatch.setattr("rotorid.recordings.check.doubts_of", fails_for_a)
    done = invoke("check", "--json", tmp_path)
    assert done.exit_code == 1
    (line,) = done.stderr.strip().splitlines()
    assert line.startswith("rotorid: unexpected LinAlgError (Singular matrix) in recordings/check.py, line ")
    assert "a fault of rotorid" in line
    assert [found["name"] for found in json.loads(done.stdout)] == ["b"]


def test_the_way_to_an_unexpected_error_can_be_shown(monkeypatch) -> None:
    monkeypatch.setenv(console.TRACEBACK, "1")
    with pytest.raises(ZeroDivisionError), console.one_sentence():
        _ = 1 / 0


def test_the_command_s_text_has_the_doubts(tmp_path: Path) -> None:
    folder = sound(tmp_path / "set")
    shutil.copy(folder / "run.csv", folder / "run2.csv")
    said = answer("check", folder)
    assert "Looks wrong:" in said and "- Run run2 repeats run run" in said
