"""The reference of the decision quotes the numbers that the code uses, and modules that exist."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

from rotorid.mismatch.decision.rules import markdown

PAGE = (Path(__file__).parents[3] / "docs" / "decision-reference.md").read_text()


def test_the_numbers_that_decide_are_those_of_the_code():
    rows = re.findall(r"^\| `([\w.]+)\.([A-Z_]+)` \| ([^|]+) \|", PAGE, flags=re.M)
    assert len(rows) > 10
    for module, name, value in rows:
        assert getattr(importlib.import_module(f"rotorid.mismatch.{module}"), name) == float(value), name


def test_the_modules_named_exist():
    table = PAGE.split("## Steps and modules")[1].split("##")[0]
    names = [
        n for line in re.findall(r"^\|[^|]+\|([^|]+)\|", table, flags=re.M)[2:] for n in re.findall(r"`([\w/]+)`", line)
    ]
    assert len(names) > 12
    for name in names:
        importlib.import_module("rotorid.mismatch." + name.replace("/", "."))


def test_the_rules_are_those_of_the_code():
    found = PAGE.split("<!-- rules -->\n")[1].split("<!-- end of rules -->")[0]
    assert found == markdown(), "put what rotorid.mismatch.decision.rules.markdown() returns between the marks"
