"""What states the release says the same everywhere, and the recipe asks for what the package asks for."""

import json
import re
import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
RECIPE = yaml.safe_load((ROOT / "packaging" / "conda" / "meta.yaml").read_text())
ZENODO = json.loads((ROOT / ".zenodo.json").read_text())
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text())


def test_the_version_is_one() -> None:
    proof = tomllib.loads((ROOT / "proof" / "pyproject.toml").read_text())["project"]["version"]
    stated = {proof, CITATION["version"], ZENODO["version"], RECIPE["package"]["version"]}
    assert stated == {PROJECT["version"]}


def test_the_changelog_has_the_version_below_what_is_unreleased() -> None:
    heads = re.findall(r"^## (.+)$", (ROOT / "CHANGELOG.md").read_text(), re.M)
    assert heads[:2] == ["Unreleased", PROJECT["version"]]


def test_title_and_licence_are_one() -> None:
    assert ZENODO["title"] == CITATION["title"]
    assert {ZENODO["license"], CITATION["license"], RECIPE["about"]["license"]} == {PROJECT["license"]}
    assert RECIPE["about"]["summary"] == PROJECT["description"]


def test_the_recipe_asks_for_what_the_package_asks_for() -> None:
    wanted = {need.replace("matplotlib", "matplotlib-base") for need in PROJECT["dependencies"]}
    assert {need.replace(" ", "") for need in RECIPE["requirements"]["run"]} == wanted | {
        "python" + PROJECT["requires-python"]
    }
    assert RECIPE["build"]["entry_points"] == [f"{name} = {place}" for name, place in PROJECT["scripts"].items()]


def test_classifiers_are_known() -> None:
    """By the list of the package index, where it is installed."""
    known = pytest.importorskip("trove_classifiers").classifiers
    assert set(PROJECT["classifiers"]) <= known


def test_the_package_is_made_of_the_three_programs_alone() -> None:
    found = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]["find"]
    assert found["where"] == ["src"] and all(
        p.name in ("rotorid", "rotorid_lab", "rotorid_acquire") or p.name.endswith(".egg-info")
        for p in (ROOT / "src").iterdir()
    )
