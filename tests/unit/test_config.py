"""The configuration: what is accepted, and one sentence naming the key for what is not."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from rotorid.errors import InputError
from rotorid_lab.config import SCHEMA_PATH, Config, check, schema_text

ROOT = Path(__file__).parents[2]


@pytest.fixture
def values() -> dict[str, Any]:
    return yaml.safe_load((ROOT / "config.yaml").read_text())


def merged(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """As Snakemake lays one configuration file over another."""
    both = dict(base)
    for key, value in over.items():
        both[key] = merged(base[key], value) if isinstance(value, dict) and key in base else value
    return both


def test_the_projects_own_files_are_valid(values: dict[str, Any]) -> None:
    check(values)
    for path in (ROOT / "tests" / "configs").glob("*.yaml"):
        check(merged(values, yaml.safe_load(path.read_text())), source=path.name)


TWICE = ["introduction", "introduction"]


@pytest.mark.parametrize(
    ("over", "said"),
    [
        ({"report": {"titel": "x"}}, [r"report\.titel: no such key is known; did you mean title\?"]),
        ({"report": {"zzz": 1}}, [r"report\.zzz: no such key is known; known here are chapters, subtitle and title"]),
        ({"recordings": 7}, ["recordings: found 7, expected text"]),
        ({"report": {"chapters": TWICE}}, [".*chapters must not name a chapter twice, but introduction is"]),
        ({"recordings": 7, "more": 1}, ["more: no such key is known.*", "recordings: found 7, expected text"]),
    ],
    ids=["unknown key, with what was meant", "unknown key like no other", "wrong type", "impossible", "two at once"],
)
def test_each_wrong_key_gets_a_line(values: dict[str, Any], over: dict[str, Any], said: list[str]) -> None:
    with pytest.raises(InputError) as error:
        check(merged(values, over))
    for line, words in zip(str(error.value).splitlines(), said, strict=True):
        assert re.fullmatch(rf"config\.yaml: {words}", line), line


def test_a_missing_key_is_named(values: dict[str, Any]) -> None:
    del values["report"]["title"]
    with pytest.raises(InputError, match=r"^config\.yaml: report\.title: is missing$"):
        check(values)


def test_the_committed_schema_is_the_models_own() -> None:
    assert SCHEMA_PATH.read_text() == schema_text(), "run: python -m rotorid_lab.config --write-schema"


def leaves(schema: dict[str, Any], whole: dict[str, Any], at: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    for key, entry in schema.get("properties", {}).items():
        if "$ref" in entry:
            yield from leaves(whole["$defs"][entry["$ref"].rsplit("/", 1)[-1]], whole, f"{at}{key}.")
        else:
            yield f"{at}{key}", entry


def test_every_key_is_described_with_its_unit() -> None:
    schema = Config.model_json_schema()
    found = dict(leaves(schema, schema))
    assert found
    bare = [key for key, entry in found.items() if not entry.get("description", "").endswith("].")]
    assert not bare, f"these keys' descriptions do not end in their unit, like '... [Hz].': {bare}"
