"""The report on a machine that reaches no public recording and no network: it is built, and says what was left out."""

import json
import re
from pathlib import Path

import pytest
from copied_project import ROOT, Project

from rotorid_lab import public_sets
from rotorid_lab.public_list import read_manifest
from rotorid_lab.typeset import render
from workflow.scripts import import_public

NOWHERE = "http://127.0.0.1:9"
"""A proxy that refuses every connection."""
SETTINGS = ("--configfile", "tests/configs/small.yaml", "tests/configs/without_public.yaml")
SAID = {
    "public_recordings": "Of 6 sources 0 could be obtained for this report. What was left out, and why:",
    "rotor_coefficients": "which could not be obtained: ",
    "neurobem": "which could not be obtained:",
    "real_flights": "**The labelled flights are left out here:** ",
}


@pytest.mark.slow
def test_the_report_is_built_and_says_what_was_left_out(
    project: Project, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    monkeypatch.setenv("ROTORID_PUBLIC_DATA", str(empty))
    for name in ("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY"):
        monkeypatch.setenv(name, NOWHERE)
    project.snakemake(*SETTINGS)
    report = project.root / "results" / "report"
    assert (report / "report.pdf").is_file() and (report / "report.html").is_file()
    for chapter, said in SAID.items():
        text = (report / "chapters" / f"{chapter}.md").read_text()
        assert said in text and f"{empty}/" in text.replace("\\", "")
        assert "is not set" not in text
        for line, after in zip(text.splitlines(), [*text.splitlines()[1:], ""], strict=True):
            assert after.startswith("|") or not re.match(r"\|[ :|-]+\|$", line), f"{chapter}: a table without rows"
        for figure in re.findall(r"\]\((results/\S+\.svg)\)", text):
            # A placeholder is a sentence on axes that are not drawn.
            assert "matplotlib.axis_1" in (project.root / figure).read_text(), f"{chapter}: {figure} shows nothing"


@pytest.mark.parametrize(
    ("folder", "said", "unsaid"),
    [
        ("empty", "names a folder and files are taken from there alone, so put the missing ones", "is not set"),
        ("", "is not set and files are downloaded, so run again where the network reaches", "names a folder"),
    ],
)
def test_what_to_do_about_missing_files_is_what_helps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: str, said: str, unsaid: str
) -> None:
    """Before: "or run again with a network", which changes nothing where a folder is named."""
    for name in ("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY"):
        monkeypatch.setenv(name, NOWHERE)
    manifest, status = ROOT / "workflow" / "public_data.yaml", []
    vehicles = sorted(str(path) for path in (ROOT / "workflow" / "vehicles").glob("*.yaml"))
    for source in read_manifest(str(manifest)):
        status.append(tmp_path / f"{source}.json")
        places = (str(tmp_path / folder) if folder else "", str(tmp_path / "cache"), str(tmp_path / "sets"))
        import_public.main(source, str(manifest), vehicles, *places, str(status[-1]))
    state = public_sets.state(public_sets.sources(status))
    assert state["obtained"] == 0 and said in state["how"] and unsaid not in state["how"]
    files = {"state": tmp_path / "state.json"}
    files["state"].write_text(json.dumps(state))
    whole = (ROOT / "notebooks" / "public_recordings.md").read_text()
    part = tmp_path / "public_recordings.md"
    part.write_text(whole[: whole.index("{{ table(")])
    assert f"To have them: ROTORID\\_PUBLIC\\_DATA {said}" in render(part, {k: str(v) for k, v in files.items()})


@pytest.mark.parametrize("available", [True, False])
def test_the_conclusions_say_of_real_propellers_what_this_report_has(tmp_path: Path, available: bool) -> None:
    """Before: they were concluded about where the chapter said that their recordings could not be obtained."""
    whole = (ROOT / "notebooks" / "conclusions.md").read_text()
    section = tmp_path / "conclusions.md"
    section.write_text(whole[whole.index("{% if propellers") : whole.index("## Can neural")] + "## Next\n")
    (tmp_path / "propellers.json").write_text(json.dumps({"available": available}))
    text = render(section, {"propellers": str(tmp_path / "propellers.json")})
    assert ("their thrust is no exact parabola" in text) == available
    assert ("could not be\nobtained (@sec:rotor-coefficients).\n\n## Next" in text) != available


@pytest.mark.parametrize("available", [True, False])
def test_the_grey_box_names_real_flights_that_are_left_out(tmp_path: Path, available: bool) -> None:
    whole = (ROOT / "notebooks" / "grey_box.md").read_text()
    section = tmp_path / "grey_box.md"
    section.write_text(whole[whole.index("## Real flights") : whole.index("## Validation")])
    missing = "imrc-brushless: 9 files could not be had"
    summary = {"available": available, "missing": [missing], "band_hz": [5.0, 15.0], "sets": {}}
    files = {"flight_summary": tmp_path / "summary.json", "flights": tmp_path / "flights.csv"}
    files["flight_summary"].write_text(json.dumps(summary))
    columns = "set,axis,published,lower,estimate,upper,low_95,high_95,ratio,r2"
    files["flights"].write_text(f"{columns}\nneurobem,xx,1,1,1,1,1,1,1,1\n")
    text = render(section, {name: str(path) for name, path in files.items()})
    assert f"could not be obtained: {missing}." in text
    assert ("| neurobem" in text) == available
