"""`rotorid history`: a folder of flights of one vehicle, without Snakemake."""

import json
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest

from rotorid.recordings import read_set, templates, write_set
from rotorid.vehicle.control import swings
from tests.command_line import answer, invoke, refusal


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Five days of one vehicle under five names; from the fourth on rotor 2 turns a tenth faster."""
    folder = tmp_path_factory.mktemp("months") / "heron"
    believed = templates.read("thesis")
    for day in range(1, 6):
        own = swings(believed, f"2026-10-0{day}", 12.0, 1, day)
        if day >= 4:
            speed = "rotor_speed_2_rad_s"
            runs = tuple(replace(r, table=r.table.assign(**{speed: 1.1 * r.table[speed]})) for r in own.runs)
            own = replace(own, runs=runs)
        named = believed.model_copy(update={"name": f"flight of day {day}"})
        write_set(replace(own, vehicle=named, held_out=None), folder)
    (folder / "notes.md").write_text("no log")
    (folder / "2026-10-06").mkdir()
    (folder / "2026-10-06" / "vehicle.yaml").write_text("name: 1\n")
    return folder


def test_the_change_is_said_with_the_day_it_begins(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = invoke("history", folder, "-o", out, "-q", "--ci", "--junit", out / "history.xml")
    assert done.exit_code == 1, done.output
    first, *rest = done.output.splitlines()
    assert first.startswith("! 2026-10-06 is left out: ")
    assert rest[0].startswith("heron, from 2026-10-04 on: ")
    assert (out / "history.html").read_text().count("<svg") == 1
    assert len((out / "numbers.csv").read_text().splitlines()) > 5 and "2026-10-04" in (out / "events.csv").read_text()
    root = ElementTree.parse(out / "history.xml").getroot()
    failed = [case.get("name") for case in root.iter("testcase") if case.find("failure") is not None]
    assert failed == ["unchanged at 2026-10-04"] and root.get("tests") == "2"
    said = json.loads(answer("history", folder, "-o", out, "-q", "--json"))
    assert said["sets"][0] == "2026-10-01" and {e["set"] for e in said["events"]} == {"2026-10-04"}


def test_a_folder_that_has_no_history_is_one_sentence(folder: Path, tmp_path: Path) -> None:
    assert "expected a folder of logs" in refusal("history", tmp_path / "none", "-q")
    assert "is one recording set" in refusal("history", folder / "2026-10-01", "-q")
    done = invoke("history", folder, "--good", "5", "-o", tmp_path / "out", "-q")
    assert done.exit_code == 1 and "has 5 sets of flights" in done.output.splitlines()[-1]
    assert not (tmp_path / "out").exists() and len(read_set(folder / "2026-10-01").runs) == 1
