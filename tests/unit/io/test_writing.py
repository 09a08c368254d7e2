"""Files are written together or not at all; numbers to the digits that are not chance."""

import errno
import signal
import stat
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from rotorid.errors import InputError
from rotorid.io.text import writing
from rotorid.io.text.writing import all_or_none, only_writer, rounded, write_texts


def test_files_take_their_names_together(tmp_path: Path) -> None:
    one, two = tmp_path / "new" / "one", tmp_path / "new" / "two"
    with all_or_none(one, two) as (first, second):
        first.write_text("1")
        second.write_text("2")
        assert not one.exists()
    assert (one.read_text(), two.read_text()) == ("1", "2")
    assert sorted(p.name for p in one.parent.iterdir()) == ["one", "two"]


def test_a_fault_leaves_what_was_there_before(tmp_path: Path) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    one.write_text("old")
    with pytest.raises(OSError, match="full"), all_or_none(one, two) as (first, _):
        first.write_text("half")
        raise OSError("disk full")
    assert one.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["one"]


def test_a_file_that_was_never_written_keeps_the_others_back(tmp_path: Path) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    with pytest.raises(FileNotFoundError), all_or_none(one, two) as (first, _):
        first.write_text("1")
    assert not list(tmp_path.iterdir())


KILLED = """
import os, signal, sys
from pathlib import Path
from rotorid.io.text import writing

left, folder = int(sys.argv[1]), Path(sys.argv[2])

def one_less(function):
    def counted(*arguments, **named):
        global left
        if left == 0:
            os.kill(os.getpid(), signal.SIGKILL)
        left -= 1
        return function(*arguments, **named)
    return counted

Path.unlink, os.replace, writing._to_disk = map(one_less, (Path.unlink, os.replace, writing._to_disk))
with writing.all_or_none(*(folder / name for name in ("verdict", "page", "vehicle"))) as parts:
    for part in parts:
        part.write_text("new")
"""


@pytest.mark.parametrize("old", [True, False], ids=["over older files", "for the first time"])
def test_a_killed_writer_leaves_no_mixture_that_the_first_file_vouches_for(tmp_path: Path, old: bool) -> None:
    """The process is killed before each of its steps in turn; the next writer leaves a clean folder."""
    names, outcomes = ("verdict", "page", "vehicle"), set()
    for steps in range(40):
        folder = tmp_path / str(steps)
        folder.mkdir()
        for name in names if old else ():
            (folder / name).write_text("old")
        done = subprocess.run([sys.executable, "-c", KILLED, str(steps), str(folder)], check=False)
        found = {name: (folder / name).read_text() for name in names if (folder / name).exists()}
        if "verdict" in found:
            assert len(found) == 3 and len(set(found.values())) == 1
            outcomes.add(found["verdict"])
        else:
            outcomes.add("none")
        with all_or_none(*(folder / name for name in names)) as parts:
            for part in parts:
                part.write_text("last")
        assert sorted(p.name for p in folder.iterdir()) == sorted(names)
        assert {(folder / name).read_text() for name in names} == {"last"}
        if done.returncode == 0:
            break
        assert done.returncode == -signal.SIGKILL
    assert done.returncode == 0
    assert outcomes == ({"old", "none", "new"} if old else {"none", "new"})


def test_the_part_of_a_living_writer_stays(tmp_path: Path) -> None:
    with all_or_none(tmp_path / "one") as (part,):
        part.write_text("mine")
        with all_or_none(tmp_path / "one") as (other,):
            other.write_text("other")
        assert part.read_text() == "mine"
    assert (tmp_path / "one").read_text() == "mine"


def test_nobody_can_lay_a_link_where_a_part_will_be(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a folder that others may write: neither the name nor, once it is known, the place is theirs."""
    made: list[Path] = []
    real = tempfile.mkdtemp
    monkeypatch.setattr(writing.tempfile, "mkdtemp", lambda *a: made.append(Path(real(*a))) or str(made[-1]))
    with all_or_none(tmp_path / "one"), all_or_none(tmp_path / "one") as (part,):
        part.write_text("mine")
        assert made[0].name != made[1].name and {stat.S_IMODE(p.stat().st_mode) for p in made} == {0o700}
        made[0].joinpath("one").write_text("first")
    assert stat.S_IMODE((tmp_path / "one").stat().st_mode) & 0o600 == 0o600


def test_a_second_writer_waits_and_is_told_where_it_takes_too_long(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = ("verdict", "page")
    with ThreadPoolExecutor() as pool, only_writer(tmp_path):
        with all_or_none(tmp_path / "mine") as (part,):  # whoever holds the folder writes on
            part.write_text("mine")
        with monkeypatch.context() as impatient:
            impatient.setattr(writing, "_PATIENCE_S", 0.1)
            refused = pool.submit(write_texts, {tmp_path / name: "third" for name in names})
            with pytest.raises(InputError, match="another command is writing"):
                refused.result()
        waits = pool.submit(write_texts, {tmp_path / name: "second" for name in names})
        time.sleep(0.1)
        assert not waits.done() and not (tmp_path / "page").exists()
    waits.result()
    assert {(tmp_path / name).read_text() for name in names} == {"second"}
    assert sorted(p.name for p in tmp_path.iterdir()) == ["mine", "page", "verdict"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_full_disk_leaves_what_was_there(tmp_path: Path) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    one.write_text("old")
    two.write_text("old")
    with pytest.raises(OSError, match="No space left on device: .*two"), all_or_none(one, two) as (first, second):
        first.write_text("new")
        second.symlink_to("/dev/full")
        second.write_text("new")
    assert (one.read_text(), two.read_text()) == ("old", "old")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["one", "two"]


def test_a_full_disk_names_the_folder_that_was_to_be(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="No space left on device: .*set'"), writing.staging(tmp_path / "set") as part:
        raise OSError(errno.ENOSPC, "No space left on device", str(part / "run.parquet"))
    with pytest.raises(OSError, match="No space left on device: .*set'"), writing.staging(tmp_path / "set"):
        raise OSError(errno.ENOSPC, "No space left on device")


def test_the_twelfth_digit_is_no_difference() -> None:
    one = {"mass_kg": 0.652000000001, "effects": ({"id": "x", "parameters": {"k": 1.23456789e-7}},), "n": 3, "t": True}
    two = {"mass_kg": 0.652000000002, "effects": ({"id": "x", "parameters": {"k": 1.23456788e-7}},), "n": 3, "t": True}
    assert rounded(one) == rounded(two) and rounded(one)["effects"][0]["parameters"]["k"] == 1.23457e-7
    assert rounded(one)["t"] is True
