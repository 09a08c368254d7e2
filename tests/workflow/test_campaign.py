"""A new raw log reruns its own kind of test and what follows, on a part of the campaign."""

import csv
import re
import shutil
from pathlib import Path

import pytest
import yaml
from copied_project import Project

TARGETS = ("results/bench/static_series.csv", "results/bench/tensile.csv")


def kept(row: dict[str, str]) -> bool:
    """A part that every stage of the targets can do with: one repeat of each calibration weight, two static ones."""
    if row["kind"] == "calibration":
        return row["repeat"] == "1"
    if row["kind"] == "static":
        return int(row["repeat"]) <= 2 and float(row["load_gf"]) < 600
    return row["kind"] == "tensile" or (row["kind"] == "combined" and row["repeat"] == "1")


def rewrite_index(index: Path, rows: list[dict[str, str]]) -> None:
    with open(index, "w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, rows[0], delimiter="\t", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def jobs(project: Project) -> set[str]:
    """What a run would do now, by the jobs' messages."""
    said = project.snakemake("--dry-run", *TARGETS)
    return set(re.findall(r"^Job \d+: (.+)$", said, flags=re.MULTILINE))


@pytest.mark.slow
def test_what_a_new_log_and_a_changed_cutoff_rerun(project: Project) -> None:
    index = project.root / "raw" / "sessions.tsv"
    with open(index, encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file, delimiter="\t") if kept(row)]
    rewrite_index(index, rows)
    project.snakemake(*TARGETS)
    assert jobs(project) == set()

    config = project.root / "config.yaml"
    settings = config.read_text()
    config.write_text(settings.replace("    low_pass_hz: 0.5\n", "    low_pass_hz: 0.6\n"))
    assert jobs(project) == {"Filter: static, jr3", "Bench: static tests"}
    config.write_text(settings)

    add_calibration_log(project, rows)
    assert jobs(project) == {
        "Ingest: calibration, bench",
        "Filter: calibration, bench",
        "Calibration: load cells of the campaign",
        "Bench: static tests",
    }


def add_calibration_log(project: Project, rows: list[dict[str, str]]) -> None:
    """One more recording of the first cell's first weight, as somebody's own log in a folder of its own."""
    folder = project.root / "raw" / "mine"
    folder.mkdir()
    first = next(row for row in rows if row["kind"] == "calibration")
    for name in ("file", "metadata"):
        source = project.root / "raw" / first[name]
        shutil.copy(source, folder / source.name.replace(first["id"], "new"))
    metadata = folder / "new.yaml"
    content = yaml.safe_load(metadata.read_text())
    del content["metadata_sha256"]  # as from an earlier recorder
    metadata.write_text(yaml.safe_dump(content | {"id": "new", "log": "new.rlog.gz"}))
    row = first | {"id": "new", "file": "mine/new.rlog.gz", "metadata": "mine/new.yaml"}
    rewrite_index(project.root / "raw" / "sessions.tsv", [*rows, row])
