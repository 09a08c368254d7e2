"""The guard ends a test that reads what a workflow left in the tree, in whatever way, also where nothing is there."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from threadpoolctl import threadpool_info

from tests.tree import GUARD, ROOT, tracked_in

LOOKS = {
    "exists": lambda path: path.exists(), "is_dir": lambda path: path.is_dir(),
    "os.path": lambda path: os.path.isfile(path), "open": lambda path: path.read_text(),
    "os.open": lambda path: os.open(path, os.O_RDONLY), "glob": lambda path: list(path.glob("*.json")),
    "walk": lambda path: list(os.walk(path)), "pandas": lambda path: pd.read_csv(path),
    "numpy": lambda path: np.load(path), "a program": lambda path: subprocess.run(["cat", path]),
    "swallowed": lambda path: swallowed(path),
}  # fmt: skip
NOT_TRACKED = ["results/recordings/neurobem", "cache/public", ".snakemake/log", "raw/recordings/mine", "raw/local"]


def swallowed(path: Path) -> None:
    try:
        path.read_text()
    except Exception:
        return


@pytest.mark.parametrize("how", LOOKS)
def test_each_way_to_look_at_a_result_ends_the_test(how: str) -> None:
    with pytest.raises(pytest.fail.Exception, match="results/public/x.json is looked at"):
        LOOKS[how](ROOT / "results" / "public" / "x.json")


@pytest.mark.parametrize("place", NOT_TRACKED)
def test_what_git_does_not_track_is_an_output(place: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    if place.startswith("raw") and tracked_in("raw") is None:
        pytest.skip("not a clone: what is an own set under raw is not known")
    for path in (str(ROOT / place), os.fsencode(ROOT / place), ROOT / "tests" / ".." / place):
        with pytest.raises(pytest.fail.Exception):
            os.path.exists(path)
    monkeypatch.chdir(ROOT)
    with pytest.raises(pytest.fail.Exception):
        Path(place).exists()
    monkeypatch.chdir(tmp_path)
    assert not Path(place).exists()


def test_what_git_tracks_may_be_read(tmp_path: Path) -> None:
    assert (ROOT / "raw" / "sessions.tsv").read_text() and list((ROOT / "raw" / "thesis").glob("*.csv"))
    (tmp_path / "results").mkdir()
    assert not list((tmp_path / "results").iterdir())
    assert GUARD.output(f"{ROOT}-elsewhere/results") is None and GUARD.output(3) is None


def test_linear_algebra_has_one_thread() -> None:
    assert {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"} == {1}


def test_a_test_that_reads_the_tree_fails_already_when_it_is_collected(tmp_path: Path) -> None:
    """As the list of plantings did: a mark that asks whether sets are imported."""
    test = tmp_path / "test_x.py"
    test.write_text(
        "import pytest\nfrom tests.tree import ROOT\n"
        "@pytest.mark.skipif(not (ROOT / 'results/recordings/neurobem').is_dir(), reason='not imported')\n"
        "def test_x(): pass\n"
    )
    command = [sys.executable, "-m", "pytest", "-q", "-p", "tests.conftest", "--rootdir", str(tmp_path), str(test)]
    command += ["-c", os.devnull, "-p", "no:cacheprovider"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 2 and "results/recordings/neurobem is looked at" in done.stdout
