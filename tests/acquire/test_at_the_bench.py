"""The files that lie ready for the person at the bench, and what an installed package holds of all this."""

import re
import shutil
import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

import pytest

from rotorid_acquire.io.lines import read_description
from rotorid_acquire.run_plan import read_plan, steps_of

ROOT = Path(__file__).parents[2]
BENCH = ROOT / "acquire"
PLANS = sorted(BENCH.glob("plans/*.yaml"))
DESCRIPTIONS = sorted(BENCH.glob("instruments/*.yaml"))


@pytest.mark.parametrize("path", PLANS, ids=lambda path: path.stem)
def test_a_plan_to_copy_has_steps_that_can_be_set_up(path):
    steps = steps_of(read_plan(path))
    assert len(steps) >= 4 and all(step.setup(None).kind and step.ask for step in steps)


@pytest.mark.parametrize("path", DESCRIPTIONS, ids=lambda path: path.stem)
def test_a_description_to_copy_can_be_read(path):
    assert read_description(path).columns


def test_each_line_of_the_rule_names_a_board_and_gives_it_to_the_group():
    rule = re.compile(
        r'SUBSYSTEM=="tty", ATTRS\{idVendor\}=="[0-9a-f]{4}", ATTRS\{idProduct\}=="[0-9a-f]{4}", '
        r'GROUP="dialout", MODE="0660", ENV\{ID_MM_DEVICE_IGNORE\}="1"'
    )
    text = (BENCH / "60-rotorid.rules").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    assert len(lines) >= 5 and all(rule.fullmatch(line) for line in lines)


def test_the_folder_runs_the_same_commands():
    shown = subprocess.run([sys.executable, "-m", "acquire", "--help"], cwd=ROOT, capture_output=True, text=True)
    assert shown.returncode == 0 and "campaign" in shown.stdout


def test_a_wheel_holds_the_three_programs_and_nothing_of_another_name(tmp_path):
    """Nothing of another name comes into site-packages, where it would lie in the way of others."""
    source = tmp_path / "source"
    source.mkdir()
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    shutil.copytree(ROOT / "src", source / "src", ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", str(source)]
    subprocess.run([*command, "--wheel-dir", str(tmp_path)], check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    names = ZipFile(wheel).namelist()
    packages = {"rotorid", "rotorid_lab", "rotorid_acquire"}
    assert {name.split("/")[0] for name in names if ".dist-info/" not in name} == packages
    assert (
        "rotorid_acquire/cli.py" in names
        and "rotorid_acquire/emulators/truth.py" in names
        and "rotorid/py.typed" in names
    )
