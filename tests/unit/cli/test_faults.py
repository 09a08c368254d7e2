"""What may go wrong around a verdict: threads, locale and clock change no byte; a full or sealed disk loses nothing.

Mounts and networks of its own are made by `unshare`, where the system lets this user.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rotorid.recordings import RecordingSet, Run, Vehicle, write_set
from rotorid.recordings import columns as c

SOURCE = Path(__file__).parents[3] / "src"
FILES = ("verdict.json", "report.html", "improved_vehicle.yaml", "ledger.json")
PLAIN = {"PATH": os.environ["PATH"], "HOME": str(Path.home()), "LC_ALL": "C.UTF-8"}


def verdict(
    folder: Path,
    out: Path,
    environment: dict[str, str] | None = None,
    cwd: Path | None = None,
    before: str = "",
    program: str = "",
):
    """`rotorid verdict` in a process of its own; with `before`, after these commands in a room of its own.

    `program` runs in the same Python first.
    """
    program += "from rotorid.cli import app; app()"
    command = [sys.executable, "-c", program, "verdict", str(folder), "-o", str(out), "-q"]
    if before:
        command = ["unshare", "-m", "-n", "sh", "-ec", before + '\nexec "$@"', "sh", *command]
    environment = PLAIN | {"PYTHONPATH": str(SOURCE)} | (environment or {})
    return subprocess.run(command, env=environment, cwd=cwd, capture_output=True, text=True, timeout=600)


def alone() -> bool:
    """Whether this user may mount things in a room of its own."""
    if shutil.which("unshare") is None:
        return False
    return subprocess.run(["unshare", "-m", "-n", "true"], capture_output=True).returncode == 0


needs_room = pytest.mark.skipif(not alone(), reason="this user may make no mounts of its own")


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bench whose gain is wrong by a tenth: three short runs."""
    rng = np.random.default_rng(3)
    runs = []
    for number in range(3):
        load = np.repeat(rng.uniform(-20, 20, (12, 3)), 25, axis=0)
        reading = load * [1.1, 1.0, 1.0] + 0.05 * rng.standard_normal(load.shape)
        columns = {c.TIME: np.arange(len(load)) / 25}
        columns |= dict(zip(c.FORCE, reading.T, strict=True)) | dict(zip(c.REFERENCE_FORCE, load.T, strict=True))
        runs.append(Run(f"run{number}", pd.DataFrame(columns)))
    vehicle = Vehicle(name="bench", kind="bench", tared=True)
    return write_set(RecordingSet("bench", vehicle, tuple(runs)), tmp_path_factory.mktemp("sets"), ".csv")


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bundled example."""
    folder = tmp_path_factory.mktemp("sets") / "example"
    bundled = SOURCE / "rotorid" / "cli" / "examples"
    shutil.copytree(bundled, folder, ignore=shutil.ignore_patterns("*.py", "__pycache__"))
    return folder


@pytest.fixture(scope="module")
def usual(bench: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The bench's files, made under usual conditions."""
    out = tmp_path_factory.mktemp("usual")
    done = verdict(bench, out)
    assert done.returncode == 0, done.stderr
    return {name: (out / name).read_bytes() for name in FILES}


def conditions(threads: int, seed: int, locale: str, zone: str) -> dict[str, str]:
    counts = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"))
    return dict.fromkeys(counts, str(threads)) | {"PYTHONHASHSEED": str(seed), "LC_ALL": locale, "TZ": zone}


@pytest.fixture(scope="module")
def decimal_comma(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Variables of a German locale, made where the system can; else those of no system, which Python takes for C."""
    place = tmp_path_factory.mktemp("locales")
    if shutil.which("localedef"):
        command = ["localedef", "-i", "de_DE", "-f", "UTF-8", str(place / "de_DE.UTF-8")]
        if subprocess.run(command, capture_output=True).returncode == 0:
            return {"LOCPATH": str(place), "LC_ALL": "de_DE.UTF-8"}
    return {"LC_ALL": "de_DE.UTF-8"}


IN_FORCE = "import locale; locale.setlocale(locale.LC_ALL, ''); assert locale.str(0.5) == '0,5'; "
"""What a program around rotorid may do: C's own functions then read and write decimal commas."""


@pytest.mark.slow
@pytest.mark.parametrize("which", ["bench", "flight"])
def test_threads_hash_seed_locale_and_zone_change_no_byte(which: str, request, decimal_comma, tmp_path: Path) -> None:
    """Before: the improved vehicle differed in the twelfth digit with two threads."""
    folder, made = request.getfixturevalue(which), []
    places = [conditions(1, 0, "C", "UTC"), conditions(2, 4711, "", "Pacific/Chatham") | decimal_comma]
    for k, place in enumerate(places):
        done = verdict(folder, tmp_path / str(k), place, program=IN_FORCE if "LOCPATH" in place else "")
        assert done.returncode == 0, done.stderr
        made.append({name: (tmp_path / str(k) / name).read_bytes() for name in FILES})
    assert [name for name in FILES if made[0][name] != made[1][name]] == []


@pytest.mark.slow
@needs_room
def test_no_home_no_network_a_sealed_installation_and_another_folder(bench: Path, usual, tmp_path: Path) -> None:
    """Before: without a folder for its compiled code the command ended in a traceback."""
    sealed = f"mount --bind {SOURCE} {SOURCE}\nmount -o remount,ro,bind {SOURCE}"
    done = verdict(bench, tmp_path / "out", {"HOME": "/proc/none"}, Path("/"), sealed)
    assert done.returncode == 0, done.stderr
    assert {name: (tmp_path / "out" / name).read_bytes() for name in FILES} == usual


@pytest.mark.slow
@needs_room
@pytest.mark.parametrize(
    ("mount", "said"),
    [("size=200k", "no space left on device"), ("ro", "read-only file system")],
    ids=["full disk", "read-only results"],
)
def test_a_full_or_read_only_disk_is_one_sentence(bench: Path, tmp_path: Path, mount: str, said: str) -> None:
    """Before: a traceback. What was there is seen from inside the room, since its mounts end with it."""
    place, seen = tmp_path / "disk", tmp_path / "seen"
    place.mkdir()
    fill = f"mount -t tmpfs -o size=200k none {place}\nprintf old > {place}/verdict.json\n"
    fill += f"mount -o remount,{mount} {place}\n"
    # The command's own end is kept, then the folder is listed.
    listed = f'{fill}"$@" || code=$?\nls -A {place} > {seen}; cat {place}/verdict.json >> {seen}; exit ${{code:-0}}\n'
    done = verdict(bench, place, before=listed)
    assert done.returncode == 1
    assert len(done.stderr.strip().splitlines()) == 1 and said in done.stderr, done.stderr
    assert seen.read_text() == "verdict.json\nold"
