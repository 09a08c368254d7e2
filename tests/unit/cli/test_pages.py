"""The pages as somebody types from them: every command is one; blocks `bash` and `python` run in their order."""

import re
import shlex
from pathlib import Path

import pytest
import typer

from rotorid.cli import app
from tests.command_line import invoke

ROOT = Path(__file__).parents[3]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^```(bash|bash fails|python)\n(.*?)^```", flags=re.M | re.S)
RUN = [p for p in PAGES if BLOCK.search(p.read_text())]
COMMANDS = typer.main.get_command(app).commands


def lines(page: Path) -> list[str]:
    """Lines of all fenced blocks without a language or with a shell's."""
    blocks = re.findall(r"^```(?:bash|bash fails|)\n(.*?)^```", page.read_text(), flags=re.M | re.S)
    return [line.split("  #")[0].strip() for block in blocks for line in block.splitlines()]


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_every_command_in_a_page_is_one_with_options_that_it_knows(page: Path) -> None:
    inline = re.findall(r"`(rotorid [^`\n]+)`", page.read_text())
    for line in [*lines(page), *inline]:
        if not re.match(r"rotorid [a-z]", line):
            continue
        name, *words = shlex.split(line)[1:]
        assert name in COMMANDS, line
        known = {option for parameter in COMMANDS[name].params for option in parameter.opts}
        assert {w for w in words if re.match(r"--?[a-z]", w)} <= known | {"--help"}, line


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_a_target_of_snakemake_stands_before_its_settings(page: Path) -> None:
    for line in re.findall(r"snakemake [^`\n]+", page.read_text()):
        settings = line.split("--config ", 1)[1].split(" -")[0] if "--config " in line else ""
        words = [w for w in settings.split() if w.startswith("results/")]
        assert not words, f"Snakemake takes {words} for a setting: {line}"


def test_make_targets_in_the_pages_are_there() -> None:
    known = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), flags=re.M))
    used = {w for page in PAGES for line in lines(page) for w in re.findall(r"^make ([a-z]+)", line)}
    assert used and used <= known


@pytest.mark.slow
@pytest.mark.parametrize("page", RUN, ids=lambda p: str(p.relative_to(ROOT)))
def test_the_blocks_of_a_page_run_as_they_stand(page: Path, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    scope: dict = {}
    for kind, block in BLOCK.findall(page.read_text()):
        if kind == "python":
            exec(compile(block, str(page), "exec"), scope)
            continue
        for line in block.strip().splitlines():
            done = invoke(*shlex.split(line, comments=True)[1:])
            assert (done.exit_code == 0) == (kind == "bash"), f"{line}: {done.output}"
            assert "Traceback" not in done.output
