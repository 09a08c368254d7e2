"""Names and bad input through Snakemake, two workflows at once, and a job that is killed."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from copied_project import Project

from rotorid.recordings import RecordingSet, Run, Vehicle, write_set
from rotorid.recordings import columns as c

SET = "-rf 'it' \"is\" $x$ #a & 100% *"
RUNS = ("-o", "$\\frac 1$", "&lt;img&gt;; rm")


def bench_set(folder: Path, name: str, runs: tuple[str, ...]) -> Path:
    """A bench whose gain is wrong by a tenth."""
    rng = np.random.default_rng(3)
    made = []
    for run in sorted(runs):
        load = np.repeat(rng.uniform(-20, 20, (12, 3)), 25, axis=0)
        reading = load * [1.1, 1.0, 1.0] + 0.05 * rng.standard_normal(load.shape)
        columns = {c.TIME: np.arange(len(load)) / 25}
        columns |= dict(zip(c.FORCE, reading.T, strict=True)) | dict(zip(c.REFERENCE_FORCE, load.T, strict=True))
        made.append(Run(run, pd.DataFrame(columns)))
    return write_set(RecordingSet(name, Vehicle(name=name, kind="bench", tared=True), tuple(made)), folder, ".csv")


@pytest.mark.slow
def test_odd_names_of_set_and_runs_go_through_snakemake(project: Project, tmp_path: Path) -> None:
    bench_set(tmp_path / "sets", SET, RUNS)
    target = f"results/mismatch/{SET}/verdict.json"
    project.snakemake(target, "--config", f"recordings={tmp_path / 'sets'}")
    found = json.loads((project.root / target).read_text())
    assert found["set"] == SET and {*found["runs"]["training"], *found["runs"]["held_out"]} == set(RUNS)
    assert list(found["parameters"]) and not (project.root / "x").exists()


@pytest.mark.slow
@pytest.mark.parametrize("run", ["a{x}", "<img src=x>"])
def test_names_that_snakemake_takes_for_its_own_are_refused(run: str, project: Project, tmp_path: Path) -> None:
    """Before: angle brackets were an undefined path variable."""
    folder = bench_set(tmp_path / "sets", "one", (run,))
    said = project.snakemake(
        "results/mismatch/one/verdict.json", "--config", f"recordings={tmp_path / 'sets'}", succeeds=False
    )
    wanted = "Snakemake takes braces and angle brackets in a name for its own; rename it without them"
    assert said.splitlines()[-1] == f"rotorid: {folder / run}.csv: {wanted}" and "Traceback" not in said
    assert not (project.root / "results" / "mismatch").exists()
    assert not any((project.root / ".snakemake" / "locks").glob("*"))


@pytest.mark.slow
def test_a_set_that_a_job_refuses_is_one_sentence_at_the_end(project: Project, tmp_path: Path) -> None:
    """Before: Snakemake's own words came last, and the job's log held a traceback."""
    folder = bench_set(tmp_path / "sets", "one", ("a", "b"))
    (folder / "a.csv").write_text((folder / "a.csv").read_text().replace("time_s", "zeit", 1))
    said = project.snakemake(
        "results/mismatch/one/verdict.json", "--config", f"recordings={tmp_path / 'sets'}", succeeds=False
    )
    assert said.splitlines()[-1] == f"rotorid: {folder / 'a.csv'}: column time_s is missing"
    assert "Traceback" not in said and "Traceback" not in (project.root / "results/logs/mismatch/one.log").read_text()
    assert not any((project.root / "results" / "mismatch").rglob("*.*"))


@pytest.mark.slow
def test_a_wrong_row_of_the_index_is_one_sentence(project: Project) -> None:
    """Before: a row that lacks cells ended in a traceback of the rule file."""
    index = project.root / "raw" / "sessions.tsv"
    lines = index.read_text().splitlines()
    index.write_text("\n".join([*lines[:3], "short\tline", *lines[3:]]) + "\n")
    said = project.snakemake("--dry-run", succeeds=False)
    last = said.splitlines()[-1]
    assert last.startswith("rotorid: ") and "sessions.tsv, line 4: has 2 cells, expected 22" in last
    assert "Traceback" not in said


@pytest.mark.slow
@pytest.mark.parametrize(
    ("setting", "expected"),
    [
        ("bench={noise_n: -1}", "bench.noise_n: found -1, expected a number of 0 or more"),
        ("raw=nowhere", "raw is 'nowhere', expected a folder of raw logs that is there"),
        ("proof={tables: nowhere}", "proof.tables is 'nowhere', expected a folder"),
        ("proof={tables: docs}", "proof.tables is 'docs', a folder that lacks summary.csv, "),
        (
            'proof={cases: ["power/*"], seeds: {power: 0}}',
            "proof.seeds and proof.cases leave no case; expected a family",
        ),
        ('proof={release: "2026-11-30", cases: ["single/*"]}', "proof.released and proof.cases leave no case of it"),
        ("proof={released: {multibdy: 1}}", "proof.released.multibdy is no family of concealed cases; did you mean"),
        ('decisions={plantings: ["nix*"]}', "decisions.plantings has 'nix*', expected a pattern that fits a name"),
        ("plantings={kept: docs}", "plantings.kept is 'docs', a folder, expected a table"),
    ],
)
def test_a_wrong_setting_is_one_sentence(project: Project, setting: str, expected: str) -> None:
    """Before: a folder that is not there was a list of missing files, or a report without its measurements."""
    said = project.snakemake("--dry-run", "--config", setting, succeeds=False)
    last = said.splitlines()[-1]
    assert last.startswith("rotorid: config.yaml: ") and expected in last, said
    assert "Traceback" not in said


@pytest.mark.slow
def test_the_second_of_two_workflows_waits_for_nobody_and_spoils_nothing(project: Project, tmp_path: Path) -> None:
    bench_set(tmp_path / "sets", "one", ("a", "b", "c"))
    target = "results/mismatch/one/verdict.json"
    command = [sys.executable, "-m", "snakemake", "--cores", "1", target, "--configfile", "tests/configs/small.yaml"]
    command += ["--config", f"recordings={tmp_path / 'sets'}"]
    first = subprocess.Popen(command, cwd=project.root, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    locks = project.root / ".snakemake" / "locks"
    while first.poll() is None and not (locks.is_dir() and any(locks.iterdir())):
        time.sleep(0.1)
    second = subprocess.run(command, cwd=project.root, capture_output=True, text=True)
    said, _ = first.communicate()
    assert first.returncode == 0, said
    assert second.returncode != 0 and "locked" in second.stdout + second.stderr
    whole = (project.root / target).read_bytes()
    shutil.rmtree(project.root / "results" / "mismatch")
    project.snakemake(target, "--config", f"recordings={tmp_path / 'sets'}")
    assert (project.root / target).read_bytes() == whole


@pytest.mark.slow
def test_what_a_killed_job_left_is_not_taken_for_whole(project: Project, tmp_path: Path) -> None:
    """Killed with no chance to tidy up, as by a loss of power; half of each file is there when the next run starts."""
    bench_set(tmp_path / "sets", "one", ("a", "b", "c"))
    target, recordings = "results/mismatch/one/verdict.json", f"recordings={tmp_path / 'sets'}"
    command = [sys.executable, "-m", "snakemake", "--cores", "1", target, "--configfile", "tests/configs/small.yaml"]
    run = subprocess.Popen(
        [*command, "--config", recordings],
        cwd=project.root,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    log = project.root / "results/logs/mismatch/one.log"
    while run.poll() is None and not log.exists():
        time.sleep(0.05)
    assert run.poll() is None, "the job ended before it could be killed"
    os.killpg(run.pid, signal.SIGKILL)
    run.wait()
    folder = project.root / "results" / "mismatch" / "one"
    names = ("verdict.json", "report.html", "improved_vehicle.yaml", "ledger.json")
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        (folder / name).write_text('{"set": "on')
    said = project.snakemake(target, "--config", recordings, succeeds=False)
    assert "--unlock" in said and "Traceback" not in said
    project.snakemake(target, "--config", recordings, "--unlock")
    project.snakemake(target, "--config", recordings)
    after = {name: (folder / name).read_bytes() for name in names}
    shutil.rmtree(folder)
    project.snakemake(target, "--config", recordings)
    for name in names:
        one, other = after[name], (folder / name).read_bytes()
        place = next((k for k, pair in enumerate(zip(one, other, strict=False)) if pair[0] != pair[1]), len(other))
        assert one == other, (name, place, one[place - 100 : place + 100], other[place - 100 : place + 100])


def test_a_number_in_the_configuration_that_yaml_takes_for_another_is_refused(project: Project, tmp_path: Path) -> None:
    """Before: 010 was a step of 8, and the last of two equal keys held without a word."""
    for text, said in (
        ("fleet: {batch: 010}\n", "line 1: found 010, which YAML takes for 8"),
        ("fleet: {batch: 3}\nfleet: {batch: 4}\n", "line 2: key fleet is there twice (first in line 1)"),
    ):
        own = tmp_path / "own.yaml"
        own.write_text(text)
        done = project.snakemake("-n", "--configfile", str(own), succeeds=False)
        assert done.splitlines()[-1].startswith(f"rotorid: {own}, {said}")
