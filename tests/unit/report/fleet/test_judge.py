"""A fleet's sets are judged each by itself: faults stay with their set, and nothing is judged twice."""

import json
import os
import signal
from pathlib import Path

import pytest

from rotorid.cli.modelling import fly
from rotorid.errors import InputError
from rotorid.recordings import read_set
from rotorid.recordings.templates import read
from rotorid.report import fleet
from rotorid.report.deliver import deliver


@pytest.fixture
def sets(tmp_path: Path) -> Path:
    """Folders that stand for sets, named by what becomes of them."""
    for name in ("a-sound", "b-wrong", "c-crashes", "d-killed", "e-sound"):
        (tmp_path / "sets" / name).mkdir(parents=True)
        (tmp_path / "sets" / name / "vehicle.yaml").write_text(f"name: {name}\n")
    return tmp_path / "sets"


@pytest.fixture
def told(monkeypatch, tmp_path: Path) -> Path:
    """An analysis that does what a set's name says; the file returned holds a line for each call."""
    calls = tmp_path / "calls"
    calls.touch()

    def analysed(folder: Path, target: Path) -> None:
        with open(calls, "a", encoding="utf-8") as file:
            file.write(folder.name + "\n")
        (target / "verdict.json").write_text(json.dumps({"set": folder.name}))
        if folder.name == "b-wrong":
            raise InputError("run.csv: line 3 is not a number")
        if folder.name == "c-crashes":
            raise ZeroDivisionError("division by zero")
        if folder.name == "d-killed":
            os.kill(os.getpid(), signal.SIGKILL)
        if folder.name == "f-full":
            raise OSError(28, "No space left on device")
        (target / "report.html").write_text("page")
        (target / "improved_vehicle.yaml").write_text("name: x\n")

    def read(folder: Path) -> Path:
        if folder.name == "g-torn":
            raise OSError(5, "Input/output error", str(folder / "run.csv"))
        return folder

    monkeypatch.setattr(fleet, "deliver", analysed)
    monkeypatch.setattr(fleet, "read_set", read)
    monkeypatch.setattr(fleet, "_load", lambda: None)
    return calls


def judged(sets: Path, out: Path, code: str = "c0de") -> dict[str, dict]:
    """What stands in each set's folder after judging."""
    folders = sorted(sets.iterdir())
    fleet.judge_sets(folders, code, out, sets.parent / "memory")
    return {f.name: {p.name: p.read_text() for p in f.iterdir()} for f in sorted(out.iterdir())}


def test_a_set_that_fails_costs_only_itself(sets: Path, told: Path, tmp_path: Path) -> None:
    found = judged(sets, tmp_path / "out")
    sound = {"verdict.json", "report.html", "improved_vehicle.yaml"}
    assert set(found["a-sound"]) == set(found["e-sound"]) == sound
    for name, reason, fault in (
        ("b-wrong", "run.csv: line 3 is not a number", False),
        ("c-crashes", "ZeroDivisionError: division by zero", True),
        ("d-killed", "its process ended by signal or exit code -9", True),
    ):
        assert set(found[name]) == {"failed.json"}  # no half verdict beside it
        assert json.loads(found[name]["failed.json"]) == {"reason": reason, "fault": fault}


def test_a_set_that_cannot_be_read_fails_alone_and_is_read_again(sets: Path, told: Path, tmp_path: Path) -> None:
    (sets / "g-torn").mkdir()
    (sets / "g-torn" / "vehicle.yaml").write_text("name: g\n")
    for _ in range(2):
        found = judged(sets, tmp_path / "out")["g-torn"]
        assert set(found) == {"failed.json"} and "run.csv" in found["failed.json"]
    assert not (tmp_path / "memory" / "c0de" / fleet.content_of(sets / "g-torn")).exists()


def test_nothing_is_judged_twice_but_what_changed(sets: Path, told: Path, tmp_path: Path) -> None:
    first = judged(sets, tmp_path / "out")
    told.write_text("")
    assert judged(sets, tmp_path / "again") == first
    assert told.read_text() == "d-killed\n"  # what killed it may be gone
    told.write_text("")
    (sets / "e-sound" / "run.csv").write_text("time_s\n0\n")
    left = tmp_path / "memory" / "c0de" / f".{fleet.content_of(sets / 'e-sound')}.-99999999.x.part"
    left.mkdir()  # by a process that was killed
    judged(sets, tmp_path / "third")
    assert not left.exists()
    assert told.read_text() == "d-killed\ne-sound\n"
    told.write_text("")
    judged(sets, tmp_path / "fourth", code="0ther")
    assert len(told.read_text().splitlines()) == 5


def test_a_full_disk_is_no_verdict_and_loses_nothing(sets: Path, told: Path, tmp_path: Path) -> None:
    (sets / "f-full").mkdir()
    (sets / "f-full" / "vehicle.yaml").write_text("name: f\n")
    with pytest.raises(OSError, match="No space left"):
        judged(sets, tmp_path / "out")
    assert not (tmp_path / "out" / "f-full").exists()
    told.write_text("")
    with pytest.raises(OSError, match="No space left"):
        judged(sets, tmp_path / "out")
    assert told.read_text() == "d-killed\nf-full\n"  # the others before it were remembered
    assert not [p for p in (tmp_path / "memory").rglob("*.part")]


@pytest.mark.slow
def test_a_fleet_says_byte_for_byte_what_each_set_says_by_itself(tmp_path: Path) -> None:
    folders = [fly(read("thesis"), tmp_path / "sets" / f"s{k}", 6.0, 2, k) for k in (1, 2)]
    fleet.judge_sets(folders, "c0de", tmp_path / "out", tmp_path / "memory")
    for folder in folders:
        alone = tmp_path / "alone" / folder.name
        deliver(read_set(folder), alone)
        for name in fleet.FILES:
            assert (tmp_path / "out" / folder.name / name).read_bytes() == (alone / name).read_bytes(), name
