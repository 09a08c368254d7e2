"""A fleet through the workflow: one command, a broken set beside sound ones, everything killed in the middle."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest
from copied_project import Project

from rotorid.cli.simulating import fly
from rotorid.templates import read

SETTINGS = ("--config", "recordings=sets", "fleet={batch: 1}")


@pytest.fixture
def fleet(project: Project) -> Project:
    """A project with one set that cannot be judged and two that can."""
    for number, name in enumerate(("b-2026-11-01", "c-2026-11-02"), 1):
        fly(read("thesis"), project.root / "sets" / name, 6.0, 2, number)
    broken = project.root / "sets" / "a-broken"
    broken.mkdir()
    (broken / "vehicle.yaml").write_text("name: a\nkind: flight\nmass_kg: heavy\n")
    (broken / "run.csv").write_text("time_s\n0\n")
    return project


@pytest.mark.slow
def test_killed_in_the_middle_it_repeats_only_what_was_lost(fleet: Project) -> None:
    """SIGKILL to Snakemake and all its jobs while the last set is judged, then the same command again."""
    command = [sys.executable, "-m", "snakemake", "--cores", "1", "fleet", *SETTINGS]
    environment = {**os.environ, "PYTHONPATH": str(fleet.root / "src")}
    running = subprocess.Popen(command, cwd=fleet.root, env=environment, start_new_session=True)
    memory = fleet.root / "cache" / "fleet"
    try:
        wait_for(lambda: len(verdicts(memory)) == 2 and list(memory.glob("*/.*.part")), running)
    finally:
        os.killpg(running.pid, signal.SIGKILL)
        running.wait()
    before = {path: path.stat().st_mtime_ns for path in verdicts(memory)}
    assert not (fleet.root / "results/fleet/sets.csv").exists()
    done = subprocess.run([*command, "--nolock"], cwd=fleet.root, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    after = {path: path.stat().st_mtime_ns for path in verdicts(memory)}
    assert len(after) == 3 and before.items() <= after.items()
    sets = pd.read_csv(fleet.root / "results/fleet/sets.csv").set_index("set")
    assert sets.loc["a-broken", "verdict"] == "failed" and "mass_kg" in sets.loc["a-broken", "sentence"]
    assert set(sets["verdict"].drop("a-broken")) <= {"no_mismatch", "explained", "partly_explained", "unexplained"}
    assert (fleet.root / "results/fleet/fleet.html").stat().st_size > 5000
    again = subprocess.run(command, cwd=fleet.root, env=environment, capture_output=True, text=True)
    assert "Nothing to be done" in again.stdout + again.stderr


def verdicts(memory: Path) -> list[Path]:
    """Folders of sets that are judged, a failure counted as well."""
    return sorted(p for p in memory.glob("*/*") if not p.name.startswith(".")) if memory.is_dir() else []


def wait_for(condition, running: subprocess.Popen, seconds: float = 900.0) -> None:
    """Wait until a condition holds while a process runs."""
    end = time.monotonic() + seconds
    while not condition():
        assert running.poll() is None, "it ended before it was killed"
        assert time.monotonic() < end, "it never came so far"
        time.sleep(0.1)
