"""An import is all or nothing: neither a kill nor a full disk leaves half a set that is taken for a whole one."""

import errno
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from rotorid.errors import InputError
from rotorid.io.text import writing
from rotorid.recordings import files as writer
from rotorid.recordings import list_sets, read_set, write_set
from rotorid.recordings.files import FILE_NAME
from rotorid.recordings.importers.faults import read_report
from rotorid.recordings.importers.logfile import SetOfLogs
from tests.command_line import answer, refusal
from tests.refusals import refused
from tests.unit.recordings.wrong_inputs import RUN, VEHICLE, sound, table

MOST_STEPS = 80


def found(*names: str, vehicle: str = VEHICLE, kept: bool = False) -> SetOfLogs:
    """What an import of one log a run has found."""
    runs = {name: table(seed=int(name[-1])) for name in names}
    return SetOfLogs("set", runs, vehicle, files={f"{n}.log": n for n in names}, kept_vehicle=kept)


def names_of(folder: Path) -> list[str]:
    return [run.name for run in read_set(folder).runs]


def killed_before(step: int, work: Callable[[], object]) -> bool:
    """Run `work` in a process that is killed before its step of that number; whether it was."""

    def one_less(function):
        def counted(*arguments, **named):
            nonlocal step
            if step == 0:
                os.kill(os.getpid(), signal.SIGKILL)
            step -= 1
            return function(*arguments, **named)

        return counted

    child = os.fork()
    if child == 0:
        try:
            writer.write_table = one_less(writer.write_table)
            os.rename, os.replace, writing._to_disk = map(one_less, (os.rename, os.replace, writing._to_disk))
            Path.write_text, Path.mkdir = map(one_less, (Path.write_text, Path.mkdir))
            work()
            os._exit(0)
        finally:
            os._exit(1)
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        assert os.WTERMSIG(status) == signal.SIGKILL
        return True
    assert os.WEXITSTATUS(status) == 0
    return False


def test_a_new_set_is_there_as_a_whole_or_not_at_all(tmp_path: Path) -> None:
    """Before: two of three runs, and `check` and `verdict` found nothing about it."""
    outcomes = set()
    for step in range(MOST_STEPS):
        folder = tmp_path / str(step) / "set"
        killed = killed_before(step, lambda folder=folder: found("run1", "run2", "run3").write(folder, as_csv=True))
        outcomes.add(tuple(names_of(folder)) if folder.exists() else ())
        assert list_sets(folder.parent) == (["set"] if folder.exists() else [])
        if not killed:
            break
        if not folder.exists():
            found("run1", "run2", "run3").write(folder, as_csv=True)
        assert names_of(folder) == ["run1", "run2", "run3"]
        assert [path.name for path in folder.parent.iterdir()] == ["set"], "nothing half written stays"
    assert not killed and step > 8
    assert outcomes == {(), ("run1", "run2", "run3")}


@pytest.mark.parametrize("listed", [True, False], ids=["with its list", "made by hand"])
def test_runs_that_are_added_are_all_there_or_the_set_says_so(listed: bool, tmp_path: Path) -> None:
    outcomes = set()
    for step in range(MOST_STEPS):
        folder = tmp_path / str(step) / "set"
        if listed:
            found("run0").write(folder, as_csv=True)
        else:
            sound(folder)
        old = names_of(folder)
        before = {path.name: path.read_bytes() for path in folder.iterdir() if path.suffix == ".csv"}

        def add(folder: Path = folder) -> None:
            found("run1", "run2", kept=True).write(folder, as_csv=True)

        killed = killed_before(step, add)
        assert before == {name: (folder / name).read_bytes() for name in before}, "nothing is lost"
        try:
            outcomes.add(tuple(names_of(folder)))
        except InputError as error:
            assert str(error).startswith(f"{folder}: by {FILE_NAME}, run run") and "--renew" in str(error)
            outcomes.add("said")
        if not killed:
            break
        add()
        assert names_of(folder) == [*old, "run1", "run2"], "the same import completes it"
        assert not [path for path in folder.iterdir() if path.name.startswith(".")]
    assert not killed and step > 8
    assert outcomes == {tuple(old), "said", (*old, "run1", "run2")}


def full(path: Path) -> OSError:
    return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))


@pytest.mark.parametrize("there", [False, True], ids=["new", "added"])
@pytest.mark.parametrize("when", ["at the second run", "in the middle of a run", "when the disk is waited for"])
def test_a_full_disk_is_one_sentence_and_loses_nothing(when: str, there: bool, tmp_path: Path, monkeypatch) -> None:
    folder, logs = tmp_path / "set", [tmp_path / f"run{k}.csv" for k in (1, 2)]
    for log in logs:
        log.write_text(RUN)
    if there:
        sound(folder)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    write, written = writer.write_table, []

    def write_table(run: pd.DataFrame, path: Path) -> None:
        if when == "in the middle of a run":
            path.write_text("time_s,x\n0,")
        if written and when != "when the disk is waited for":
            raise full(path)
        written.append(path)
        write(run, path)

    def to_disk(path: Path) -> None:
        raise full(path)

    monkeypatch.setattr(writer, "write_table", write_table)
    if when == "when the disk is waited for":
        monkeypatch.setattr(writing, "_to_disk", to_disk)
    like = [] if there else ["--like", "thesis"]
    assert "no space left on device" in refusal("import", *logs, "-o", folder, *like)
    assert before == {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}


KILLED = """
import os, signal, sys
from rotorid.cli import app
from rotorid.recordings import files

write = files.write_table
def second_kills(table, path):
    if path.name.startswith("run2"):
        os.kill(os.getpid(), signal.SIGKILL)
    write(table, path)
files.write_table = second_kills
app(sys.argv[1:])
"""


def test_the_command_killed_between_two_runs_leaves_no_set(tmp_path: Path) -> None:
    logs = [tmp_path / f"run{k}.csv" for k in (1, 2, 3)]
    for log in logs:
        log.write_text(RUN)
    words = ["import", *map(str, logs), "--like", "thesis", "-o", str(tmp_path / "set")]
    done = subprocess.run([sys.executable, "-c", KILLED, *words], capture_output=True, text=True, timeout=120)
    assert done.returncode == -signal.SIGKILL
    assert not (tmp_path / "set").exists()
    answer(*words)
    assert names_of(tmp_path / "set") == ["run1", "run2", "run3"]
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "set"
    found("run1", "run2").write(made, as_csv=True)
    return made


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda f: (f / "run2.csv").unlink(), "run run2.csv is missing"),
        (lambda f: (f / "run3.csv").write_text(RUN), "run run3.csv is not listed"),
        (lambda f: (f / "run2.csv").write_text(RUN), "run run2.csv was changed"),
        (lambda f: (f / "run2.csv").rename(f / "run4.csv"), "run run2.csv is missing (and 1 more)"),
    ],
    ids=["missing", "more", "changed", "renamed"],
)
def test_a_change_by_hand_is_said_by_check_and_verdict_and_can_be_taken_over(
    folder: Path, change: Callable[[Path], object], said: str
) -> None:
    change(folder)
    for command in (["check", folder], ["verdict", folder, "-q", "-o", folder.parent / "out"]):
        told = refusal(*command)
        assert f"{folder}: by manifest.json, {said}" in told and f"rotorid check {folder} --renew" in told
    answer("check", folder, "--renew")
    answer("check", folder)


def test_the_vehicle_and_the_split_may_be_edited(folder: Path) -> None:
    (folder / "vehicle.yaml").write_text(VEHICLE.replace("0.652", "0.7"))
    (folder / "split.yaml").write_text("held_out: [run2]\n")
    assert read_set(folder).vehicle.mass_kg == 0.7


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"runs": [1]}', '{"runs": {"a": 1}}', "[" * 100_000, "\0"])
def test_a_list_that_is_none_is_one_sentence(folder: Path, text: str) -> None:
    (folder / FILE_NAME).write_text(text)
    told = refused(None, read_set, folder)
    assert told.startswith(str(folder / FILE_NAME)) and told.isprintable()


def test_an_import_onto_a_set_changes_nothing_that_is_there(folder: Path) -> None:
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    (folder.parent / "other.yaml").write_text(VEHICLE.replace("0.652", "0.7"))
    other = SetOfLogs("set", {"run2": table(seed=9)}, VEHICLE, kept_vehicle=True)
    for changed, name in (
        (other, "run2.csv"),
        (found("run3", vehicle=VEHICLE.replace("0.652", "0.7")), "vehicle.yaml"),
    ):
        refused(f"{name} is there already and would change", changed.write, folder, as_csv=True)
    with pytest.raises(InputError, match="run1.csv is there already, and run1.parquet would be the same run again"):
        found("run1", kept=True).write(folder)
    assert before == {path.name: path.read_bytes() for path in folder.iterdir()}


def test_the_same_import_again_changes_no_byte_and_another_adds_to_the_report(folder: Path) -> None:
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    found("run1", "run2").write(folder, as_csv=True)
    assert before == {path.name: path.read_bytes() for path in folder.iterdir()}
    found("run3", kept=True).write(folder, as_csv=True)
    assert read_report(folder)["files"] == {"run1.log": "run1", "run2.log": "run2", "run3.log": "run3"}
    assert names_of(folder) == ["run1", "run2", "run3"]


def test_a_set_that_is_not_whole_is_not_added_to(folder: Path) -> None:
    (folder / "run2.csv").unlink()
    refused("run run2.csv is missing", found("run3", kept=True).write, folder, as_csv=True)


def test_a_set_that_is_simulated_is_whole_too(tmp_path: Path, monkeypatch) -> None:
    from rotorid.recordings import files

    recordings = read_set(sound(tmp_path / "one"))
    written = []

    def write_table(run: pd.DataFrame, path: Path) -> None:
        written.append(path)
        raise full(path)

    monkeypatch.setattr(files, "write_table", write_table)
    with pytest.raises(OSError, match="No space left"):
        write_set(recordings, tmp_path / "sets")
    assert written and list((tmp_path / "sets").iterdir()) == []
