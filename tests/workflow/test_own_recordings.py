"""Somebody's own recordings: taken by the index, from any folder, packed or plain, all kinds or only some."""

import json
import re
import shutil
from hashlib import sha256
from pathlib import Path

import pandas as pd
import pytest
import yaml
from copied_project import Project
from test_campaign import rewrite_index

from rotorid_acquire.io import rawlog
from rotorid_acquire.io.session import read_index, write_index

EXPERIMENTS = {"1", "3", "22", "23", "24", "27"}
TARGETS = (
    "results/bench/static_series.csv", "results/bench/dynamic.json", "results/bench/tensile.csv",
    "results/stand/experiments.csv", "results/black_box/experiments.csv",
)  # fmt: skip
SOME_CHAPTERS = ("--config", "raw=mine", "report={chapters: [white_box, stand]}")
WHITE_BOX = "White box: rotor coefficients and mass properties"
ROTOR = {
    WHITE_BOX,
    "Stand: tests as recording sets",
    "Stand: steady wrenches and characteristics",
    "Black box: samples of the 48 experiments",
}
FOLLOWS = {  # what one more recording of a kind reruns
    "calibration": {
        "Ingest: calibration, bench", "Filter: calibration, bench", "Calibration: load cells of the campaign",
        "Bench: static tests", "Bench: dynamic tests",
    },
    "static": {"Ingest: static, bench", "Filter: static, bench", "Bench: static tests"},
    "combined": {"Ingest: combined, bench", "Filter: combined, bench", "Bench: static tests"},
    # A flight of the dynamic tests is recorded by the bench or by the reference sensor; a group of them holds both.
    "dynamic": {
        "Ingest: dynamic, bench", "Filter: dynamic, bench", "Ingest: dynamic, jr3", "Filter: dynamic, jr3",
        "Bench: dynamic tests",
    },
    "tensile": {"Ingest: tensile, tensile", "Bench: tensile tests"},
    "thrust": {"Ingest: thrust, rotor"} | ROTOR,
    "torque": {"Ingest: torque, rotor", "Ingest: torque, wrench"} | ROTOR,
    "dynamics": {"Ingest: dynamics, quadrotor", "Ingest: dynamics, wrench"} | (ROTOR - {WHITE_BOX}),
}  # fmt: skip


def kept(row: dict[str, str]) -> bool:
    """A part of the campaign that every stage of the targets can do with."""
    kind = row["kind"]
    if kind in ("calibration", "combined"):
        return row["repeat"] == "1"
    if kind == "static":
        return int(row["repeat"]) <= 2 and float(row["load_gf"]) < 600
    if kind in ("thrust", "torque"):
        return round(100 * float(row["throttle"])) % 4 == 0
    return kind in ("tensile", "dynamic") or row["experiment"] in EXPERIMENTS


def jobs(project: Project) -> set[str]:
    said = project.snakemake("--dry-run", *TARGETS)
    return set(re.findall(r"^Job \d+: (.+)$", said, flags=re.MULTILINE))


def record_again(raw: Path, rows: list[dict[str, str]], folder: Path, name: str = "mine") -> None:
    """The recordings of the first row's group once more, under other names and unpacked, in a folder of their own."""
    folder.mkdir(parents=True, exist_ok=True)
    for row in rows:
        if row["group"] != rows[0]["group"] or (row["kind"] == "calibration" and row is not rows[0]):
            continue
        own = f"{name}-{row['kind']}-{row['instrument']}"
        content = yaml.safe_load((raw / row["metadata"]).read_text())
        del content["metadata_sha256"]  # as from an earlier recorder
        log = under_another_name(raw / row["file"], own)
        content |= {
            "id": own,
            "log": f"{own}.rlog",
            "group": f"{name}-{row['kind']}",
            "log_sha256": sha256(log).hexdigest(),
        }
        (folder / f"{own}.rlog").write_bytes(log)
        (folder / f"{own}.yaml").write_text(yaml.safe_dump(content, sort_keys=False))


def under_another_name(log: Path, name: str) -> bytes:
    """The log, unpacked, with another recording's name in the note that opens it."""
    packed = [rawlog.MAGIC]
    for tag, host_ns, data in rawlog.read_raw(log).chunks:
        if tag == rawlog.NOTE and (note := json.loads(data)).get("note") == "begin":
            data = json.dumps(note | {"id": name}).encode()
        packed.append(rawlog.pack_chunk(tag, host_ns, data))
    return b"".join(packed)


def points(project: Project) -> dict[str, int]:
    read = lambda path: len(pd.read_csv(project.root / "results" / path))  # noqa: E731
    fits = json.loads((project.root / "results/white_box/parameters.json").read_text())
    return {
        "calibration": read("calibration/campaign_readings.csv"), "static": read("bench/static_points.csv"),
        "dynamic": read("bench/dynamic_flights.csv"), "combined": read("ingest/combined/bench.csv"),
        "tensile": read("bench/tensile_specimens.csv"), "thrust": fits["c_f"]["points"],
        "torque": fits["c_q"]["points"], "dynamics": read("stand/experiments.csv"),
    }  # fmt: skip


@pytest.mark.slow
def test_one_more_recording_of_each_kind_in_another_folder_reaches_its_results(project: Project) -> None:
    raw = project.root / "raw"
    rows = [row for row in read_index(raw) if kept(row)]
    rewrite_index(raw / "sessions.tsv", rows)
    project.snakemake(*TARGETS)
    before = points(project)
    for kind, expected in FOLLOWS.items():
        of_kind = [row for row in rows if row["kind"] == kind]
        shutil.rmtree(raw / "mine", ignore_errors=True)
        record_again(raw, of_kind, raw / "mine")
        new = [row for row in write_index(raw / "mine") if row["kind"] == kind]
        assert new
        moved = [row | {"file": f"mine/{row['file']}", "metadata": f"mine/{row['metadata']}"} for row in new]
        rewrite_index(raw / "sessions.tsv", rows + moved)
        assert jobs(project) == expected, kind
    record_again_all(raw, rows)
    project.snakemake(*TARGETS)
    after = points(project)
    assert {kind: after[kind] - before[kind] for kind in before if after[kind] <= before[kind]} == {}


def record_again_all(raw: Path, rows: list[dict[str, str]]) -> None:
    for kind in FOLLOWS:
        record_again(raw, [row for row in rows if row["kind"] == kind], raw / "mine")
    mine = write_index(raw / "mine")
    moved = [row | {"file": f"mine/{row['file']}", "metadata": f"mine/{row['metadata']}"} for row in mine]
    rewrite_index(raw / "sessions.tsv", rows + moved)


@pytest.mark.slow
def test_a_folder_with_thrust_tests_alone_gives_the_thrust_coefficient(project: Project) -> None:
    raw = project.root / "raw"
    thrust = [row for row in read_index(raw) if row["kind"] == "thrust"][::5]
    elsewhere = project.root / "mine"
    for number, row in enumerate(thrust):
        record_again(raw, [row], elsewhere, f"mine-{number}")
    write_index(elsewhere)
    project.snakemake("results/white_box/parameters.json", "--config", "raw=mine")
    fits = json.loads((project.root / "results/white_box/parameters.json").read_text())
    assert fits["c_f"]["points"] == len(thrust) and "c_q" not in fits
    project.snakemake("results/report/chapters/bench.md", "--config", "raw=mine")
    text = (project.root / "results/report/chapters/bench.md").read_text()
    assert "needs calibration, static, combined, dynamic and tensile recordings" in text
    # Without torque tests only what needs them is left out.
    project.snakemake("results/report/chapters/white_box.md", "results/grey_box/rotor.json", *SOME_CHAPTERS)
    text = (project.root / "results/report/chapters/white_box.md").read_text()
    assert f"{len(thrust)} thrust tests of one rotor were recorded" in text
    assert "The torque coefficient is left out" in text and "Attitude control" in text
    assert set(json.loads((project.root / "results/grey_box/rotor.json").read_text())) == {"c_f"}


@pytest.mark.slow
def test_one_thrust_test_is_a_sentence_and_no_stop(project: Project) -> None:
    raw, elsewhere = project.root / "raw", project.root / "mine"
    record_again(raw, [row for row in read_index(raw) if row["kind"] == "thrust"][:1], elsewhere)
    write_index(elsewhere)
    chapters = [f"results/report/chapters/{name}.md" for name in ("white_box", "stand")]
    project.snakemake(*chapters, "results/grey_box/rotor.json", *SOME_CHAPTERS)
    white_box, stand = ((project.root / path).read_text() for path in chapters)
    assert "lists too few of them for a curve" in white_box
    assert "This chapter needs thrust, torque and dynamics recordings" in stand
    assert json.loads((project.root / "results/grey_box/rotor.json").read_text()) == {}


def test_first_tries_enter_no_index_unasked(tmp_path: Path) -> None:
    source = Path(__file__).parents[2] / "raw"
    row = next(row for row in read_index(source) if row["kind"] == "thrust")
    record_again(source, [row], tmp_path / "campaign")
    record_again(source, [row], tmp_path / "local")
    assert [entry["file"] for entry in write_index(tmp_path)] == ["campaign/mine-thrust-rotor.rlog"]
    assert [entry["file"] for entry in write_index(tmp_path / "local")] == ["mine-thrust-rotor.rlog"]
    assert len(read_index(tmp_path)) == 1
