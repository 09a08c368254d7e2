"""A verdict through Snakemake: its one sentence is the last thing on the screen."""

import json
from pathlib import Path

import pytest
from copied_project import Project

from rotorid.cli import examples


@pytest.mark.slow
def test_the_sentence_is_the_last_thing_on_the_screen(project: Project, tmp_path: Path) -> None:
    examples.write(tmp_path / "sets" / "example")
    target = "results/mismatch/example/verdict.json"
    said = project.snakemake(target, "--config", f"recordings={tmp_path / 'sets'}").strip().splitlines()
    verdict = json.loads((project.root / target).read_text())
    assert said[-2:] == [f"example: {verdict['sentence']}", "results/mismatch/example/report.html"]
    again = project.snakemake(target, "--config", f"recordings={tmp_path / 'sets'}")
    assert verdict["sentence"] not in again
