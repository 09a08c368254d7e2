"""The reference of the decision quotes the numbers that the code uses, and modules that exist."""

import importlib
import re

from rotorid.mismatch import OPEN
from rotorid.mismatch.decide.rules import RULES, markdown
from tests.hooks import hook

PAGE = hook("site").decision_page()


def test_the_numbers_that_decide_are_those_of_the_code():
    rows = re.findall(r"^\| `([\w.]+)\.([A-Z_0-9]+)` \| ([^|]+) \| [^|]+ \|$", PAGE, flags=re.M)
    names = {name for _, name, _ in rows}
    assert len(rows) > 200 and {"ENTER_P", "KEEP_P", "VALUE_Z", "ENVIRONMENT_S", "EXPLAINED_SHARE"} <= names
    for module, name, value in rows:
        assert f"{getattr(importlib.import_module(f'rotorid.mismatch.{module}'), name):g}" == value, name


def test_the_modules_named_exist():
    names = re.findall(r"^\| `([a-z_.]+)` \| [^|]+ \|$", PAGE.split("## Modules and constants")[1], flags=re.M)
    assert len(names) > 60 and set(OPEN) <= set(names)
    for name in names:
        importlib.import_module(f"rotorid.mismatch.{name}")


def test_the_rules_are_those_of_the_code():
    assert f"\n{markdown()}\n## Modules" in PAGE
    assert re.findall(r"^\| `(\w+)` \|", markdown(), flags=re.M) == list(RULES)
