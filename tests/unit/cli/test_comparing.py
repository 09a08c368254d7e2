"""`rotorid compare`: what may stand on its command line."""

import json
from pathlib import Path
from xml.etree import ElementTree

import pytest

from rotorid.cli.console import keep
from rotorid.cli.junit import as_junit
from rotorid.cli.modelling import fly
from rotorid.cli.sets import Stated
from rotorid.cli.verdicts import explanation_takes, one_flight, read_given
from rotorid.errors import InputError
from rotorid.recordings import read_set, templates
from tests.command_line import answer, invoke
from tests.refusals import refused
from tests.unit.recordings.importers.test_log_formats import PARAMETERS, dataflash, flown


@pytest.fixture(scope="module")
def logs(tmp_path_factory) -> list[Path]:
    """Two flights of a thesis quadrotor, each a table of its own."""
    folder = tmp_path_factory.mktemp("logs")
    flights = fly(templates.read("thesis"), folder / "flights", 12.0, 2, 1)
    out = []
    for name, one in zip(("monday", "friday"), read_set(flights).runs, strict=True):
        out.append(folder / f"{name}.csv")
        one.table.to_csv(out[-1], index=False)
    return out


def read(paths: list[Path], **of_vehicle) -> list:
    """The sets of what a comparison is given."""
    return [one.recordings for one in read_given(paths, Stated(**of_vehicle))]


def test_logs_become_sets_of_one_vehicle(logs: list[Path]) -> None:
    first, second = read(logs, mass_kg=0.652, like="thesis")
    assert (first.name, second.name) == ("monday", "friday")
    assert first.vehicle.model_copy(update={"name": ""}) == second.vehicle.model_copy(update={"name": ""})
    assert [len(s.runs) for s in (first, second)] == [1, 1] and first.vehicle.mass_kg == 0.652


def test_two_logs_are_compared(logs: list[Path], tmp_path: Path) -> None:
    said = answer("compare", *logs, "--like", "thesis", "--mass-kg", "0.652", "-q", "-o", tmp_path / "changes.json")
    assert "from monday to friday" in said
    found = json.loads((tmp_path / "changes.json").read_text())
    assert not [c for c in found["changes"] if c["status"] in ("established", "ambiguous")]
    assert found["level_1"]["nothing_changed"] and found["level_1"]["sentences"][0] in said


def test_what_differs_is_printed_before_its_explanation_is_sought(logs: list[Path], monkeypatch) -> None:
    def stopped(*args, **options):
        raise InputError("the explanation was sought")

    monkeypatch.setattr("rotorid.mismatch.changes.compare.changes_between", stopped)
    done = invoke("compare", *logs, "--like", "thesis", "--mass-kg", "0.652", "-q")
    first, second = done.output.index("no trim, share of a rotor"), done.output.index("the explanation was sought")
    assert done.exit_code == 1 and first < second


def test_a_difference_without_a_name_fails_a_regression_test(logs: list[Path], tmp_path: Path) -> None:
    """Rotor 2 turns a tenth faster than in the good flight: level 1 alone may say so."""
    import pandas as pd

    table = pd.read_csv(logs[1])
    speeds = [name for name in table if name.startswith("rotor_") and "_2_" in name]
    weak = tmp_path / "weak.csv"
    table.assign(**{name: 1.15 * table[name] for name in speeds}).to_csv(weak, index=False)
    report = tmp_path / "changes.xml"
    done = invoke("compare", logs[0], weak, "--like", "thesis", "--mass-kg", "0.652", "-q", "--ci", "--junit", report)
    assert done.exit_code == 1 and "Rotor 2 is asked for" in done.output
    root = ElementTree.parse(report).getroot()
    failed = [case for case in root.iter("testcase") if case.find("failure") is not None]
    assert int(root.get("failures")) == len(failed) and int(root.get("tests")) > len(failed) > 0
    share = next(case for case in failed if case.get("name") == "unchanged: thrust asked of rotor 2 (%)")
    assert "Rotor 2 is asked for" in share.find("failure").get("message")


def test_one_set_or_no_set_is_one_sentence(logs: list[Path]) -> None:
    assert "nothing to compare it with" in invoke("compare", logs[0]).output
    refused("nowhere", read, [Path("nowhere"), logs[0]])


def test_the_time_of_the_explanation_is_said_before_it_is_sought(logs: list[Path], tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr("rotorid.cli.console.record_file", lambda: tmp_path / "waiting.json")
    assert "in about 12 s (if this computer is like" in explanation_takes(60.0)
    assert "about 2 min" in explanation_takes(600.0)
    for pace in (0.5, 0.4, 0.6):
        keep("compare: pace", [("s a second of recording", pace)])
    assert explanation_takes(60.0).startswith("What explains it comes next, in about 30 s (by the last comparisons")

    def stopped(*args, **options):
        raise InputError("the explanation was sought")

    monkeypatch.setattr("rotorid.mismatch.changes.compare.changes_between", stopped)
    done = invoke("compare", *logs, "--like", "thesis", "--mass-kg", "0.652", "-q")
    assert done.output.index("What explains it comes next, in about") < done.output.index("the explanation was sought")


def test_a_flight_inside_a_log_or_set_is_asked_for_by_its_number(logs: list[Path], tmp_path: Path) -> None:
    folder = fly(templates.read("thesis"), tmp_path / "flights", 12.0, 3, 1)
    first, third = read([Path(f"{folder}#1"), Path(f"{folder}#3")])
    assert (first.name, third.name) == ("flights#1", "flights#3")
    assert [run.name for run in third.runs] == [read_set(folder).runs[2].name]
    refused("has 3 flights .* expected #1 to #3", read, [Path(f"{folder}#4")])
    odd = tmp_path / "odd#2"
    odd.mkdir()
    assert one_flight(odd) == (odd, None)  # a name that is there is meant
    only = read([Path(f"{logs[0]}#1"), Path(f"{logs[0]}#1")], mass_kg=0.652, like="thesis")
    assert [own.name for own in only] == ["monday#1", "monday#1"]


def test_parameters_of_the_autopilot_that_differ_are_said_first(tmp_path: Path, monkeypatch) -> None:
    good, new = tmp_path / "good.bin", tmp_path / "new.bin"
    good.write_bytes(dataflash(flown(), PARAMETERS | {"ATC_RAT_RLL_P": 0.135, "STAT_FLTTIME": 9, "OLD": 1}))
    new.write_bytes(dataflash(flown(), PARAMETERS | {"ATC_RAT_RLL_P": 0.18, "STAT_FLTTIME": 99, "NEW": 1}))

    def stopped(*args, **options):
        raise InputError("what differs in flight was sought")

    monkeypatch.setattr("rotorid.mismatch.changes.level_one.seen_by", stopped)
    for sets in ((good, new), tuple(made(path) for path in (good, new))):  # logs, and sets that were made of them
        said = invoke("compare", *sets, "--like", "x500", "--mass-kg", "1.5", "-q").output.splitlines()
        assert said[:2] == [
            "Parameters of the autopilot that differ: 1.",
            "  ATC_RAT_RLL_P: 0.135 in the good logs, now 0.18",
        ]
        assert "only the good logs state: 1 (OLD)" in said[2] and "only the new log states: 1 (NEW)" in said[3]
        assert "what differs in flight was sought" in said[-1] and "STAT" not in "".join(said)


def made(log: Path) -> Path:
    folder = log.parent / f"set-of-{log.stem}"
    answer("import", log, "-o", folder, "--like", "x500", "--mass-kg", "1.5")
    return folder


def test_junit_holds_any_text() -> None:
    text = as_junit("a<b>&\x07", {'case "1"\n': [], "two": ["no < & \x1b[31m", "second"]}, 1.5)
    root = ElementTree.fromstring(text)
    assert (root.get("tests"), root.get("failures")) == ("2", "1")
    assert root.find(".//failure").text.splitlines()[1] == "second"
