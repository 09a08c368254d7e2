"""A fleet through the workflow: one command, broken sets beside a sound one, everything killed in the middle."""

import importlib.util
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest
import slurm
from copied_project import Project

from rotorid.cli.modelling import fly
from rotorid.recordings.templates import read

SETTINGS = ("--config", "recordings=sets")


@pytest.fixture
def fleet(project: Project) -> Project:
    """A project with two sets that cannot be judged and, after them in the alphabet, one that can."""
    for name in ("a-broken", "b-broken"):
        broken = project.root / "sets" / name
        broken.mkdir(parents=True)
        (broken / "vehicle.yaml").write_text("name: a\nkind: flight\nmass_kg: heavy\n")
        (broken / "run.csv").write_text("time_s\n0\n")
    fly(read("thesis"), project.root / "sets" / "c-2026-11-02", 6.0, 2, 1)
    return project


@pytest.mark.slow
def test_killed_in_the_middle_it_repeats_only_what_was_lost(fleet: Project) -> None:
    """SIGKILL to Snakemake and all its jobs while the last set of a batch is judged, then the same command again."""
    command = [sys.executable, "-m", "snakemake", "--cores", "1", "fleet", *SETTINGS]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(fleet.root / "src"), str(fleet.root / "proof")])}
    running = subprocess.Popen(command, cwd=fleet.root, env=environment, start_new_session=True)
    memory = fleet.root / "cache" / "fleet"
    try:
        wait_for(lambda: len(verdicts(memory)) == 2 and list(memory.glob("*/.*.part")), running)
    finally:
        if running.poll() is None:
            os.killpg(running.pid, signal.SIGKILL)
        running.wait()
    before = {path: path.stat().st_mtime_ns for path in verdicts(memory)}
    assert not (fleet.root / "results/fleet/sets.csv").exists()
    # A killed Snakemake leaves its lock; the next one asks for this.
    subprocess.run([*command, "--unlock"], cwd=fleet.root, env=environment, capture_output=True, check=True)
    done = subprocess.run(command, cwd=fleet.root, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    after = {path: path.stat().st_mtime_ns for path in verdicts(memory)}
    assert len(after) == 3 and before.items() <= after.items()
    sets = pd.read_csv(fleet.root / "results/fleet/sets.csv").set_index("set")
    for name in ("a-broken", "b-broken"):
        assert sets.loc[name, "verdict"] == "failed" and "mass_kg" in sets.loc[name, "sentence"]
    assert sets.loc["c-2026-11-02", "verdict"] in ("no_mismatch", "explained", "partly_explained", "unexplained")
    assert (fleet.root / "results/fleet/fleet.html").stat().st_size > 5000
    again = subprocess.run(command, cwd=fleet.root, env=environment, capture_output=True, text=True)
    assert "Nothing to be done" in again.stdout + again.stderr


def no_slurm() -> str:
    """Why the test with a SLURM of its own is left out; empty where it is wanted and can be had."""
    if not os.environ.get("ROTORID_SLURM"):
        return "starts a SLURM of its own: set ROTORID_SLURM=1"
    if importlib.util.find_spec("snakemake_executor_plugin_slurm") is None:
        return "needs pip install snakemake-executor-plugin-slurm"
    return slurm.missing()


@pytest.mark.slow
@pytest.mark.skipif(bool(no_slurm()), reason=no_slurm())
def test_a_fleet_through_slurm_says_what_it_says_here(fleet: Project, tmp_path: Path) -> None:
    """The profile of the project, on a real SLURM of one node; every batch a job of the queue."""
    settings = fleet.root / "config.yaml"
    settings.write_text(settings.read_text().replace("  batch: 25 #", "  batch: 1 #"))
    with slurm.running(tmp_path / "slurm") as environment:
        environment |= {"PYTHONPATH": os.pathsep.join([str(fleet.root / "src"), str(fleet.root / "proof")])}
        command = [sys.executable, "-m", "snakemake", "fleet", *SETTINGS]
        profile = ["--workflow-profile", "workflow/profiles/slurm", "--latency-wait", "5"]
        # This SLURM keeps no accounts: without the second option Snakemake asks sacct for ever.
        profile += ["--slurm-no-account", "--slurm-status-command", "squeue"]
        quick = ["--slurm-init-seconds-before-status-checks", "5"]
        done = subprocess.run(
            [*command, *profile, *quick], cwd=fleet.root, env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stdout + done.stderr
        jobs = subprocess.run(["scontrol", "show", "jobs", "-o"], env=environment, capture_output=True, text=True)
        assert jobs.stdout.count("JobState=COMPLETED") == 3, jobs.stdout
    through = {f.parent.name: f.read_bytes() for f in fleet.root.glob("results/fleet/verdicts/*/*/verdict.json")}
    assert set(through) == {"c-2026-11-02"}
    for folder in ("results", "cache"):
        shutil.rmtree(fleet.root / folder)
    subprocess.run([*command, "--cores", "1"], cwd=fleet.root, env=environment, check=True, capture_output=True)
    here = {f.parent.name: f.read_bytes() for f in fleet.root.glob("results/fleet/verdicts/*/*/verdict.json")}
    assert here == through


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
