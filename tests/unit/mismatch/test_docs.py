"""The reference of the decision quotes the numbers that the code uses, and modules that exist."""

import importlib
import inspect
import re
from functools import cached_property
from types import CodeType, FunctionType

from rotorid.mismatch import OPEN
from rotorid.mismatch.decide.rules import RULES, markdown
from tests.hooks import hook

PAGE = hook("site").decision_page()


def test_the_numbers_that_decide_are_those_of_the_code():
    rows = re.findall(r"^\| `([\w.]+)\.([A-Z_0-9]+)` \| ([^|]+) \| [^|]+ \|$", PAGE, flags=re.M)
    names = {name for _, name, _ in rows}
    assert len(rows) > 80 and {"ENTER_P", "KEEP_P", "VALUE_Z", "ENVIRONMENT_S", "EXPLAINED_SHARE"} <= names
    for module, name, value in rows:
        assert f"{getattr(importlib.import_module(f'rotorid.mismatch.{module}'), name):g}" == value, name


def test_the_numbers_that_one_function_uses_are_those_that_it_holds():
    rows = re.findall(r"^\| `([\w.]+)\.(\w+)\.([a-z]\w+)` \| (-?[\d.e+-]+) \| [^|]+ \|$", PAGE, flags=re.M)
    assert len(rows) > 150 and "least_share" in {name for *_, name, _ in rows}
    for module, function, _, value in rows:
        held = [f for f in functions_of(f"rotorid.mismatch.{module}") if f.__name__ == function]
        numbers = [c for f in held for c in constants_of(f.__code__) if isinstance(c, int | float)]
        assert value in {f"{number:g}" for number in numbers}, (module, function)


def constants_of(code: CodeType) -> list:
    """Constants of a function, those of functions in it among them."""
    inner = [constants_of(c) for c in code.co_consts if isinstance(c, CodeType)]
    return [*code.co_consts, *(one for constants in inner for one in constants)]


def functions_of(module: str) -> list[FunctionType]:
    """The functions of a module and the methods of its classes, those of properties among them."""
    home = importlib.import_module(module)
    owners = [home, *(c for c in vars(home).values() if isinstance(c, type))]
    found = [inspect.unwrap(f) for owner in owners for f in vars(owner).values() if callable(f)]
    found += [
        f.fget if isinstance(f, property) else f.func
        for owner in owners
        for f in vars(owner).values()
        if isinstance(f, property | cached_property)
    ]
    return [f for f in found if isinstance(f, FunctionType)]


def test_the_modules_named_exist():
    names = re.findall(r"^\| `([a-z_.]+)` \| [^|]+ \|$", PAGE.split("## Modules and constants")[1], flags=re.M)
    assert len(names) > 60 and set(OPEN) <= set(names)
    for name in names:
        importlib.import_module(f"rotorid.mismatch.{name}")


def test_the_rules_are_those_of_the_code():
    assert f"\n{markdown()}\n## Modules" in PAGE
    assert re.findall(r"^\| `(\w+)` \|", markdown(), flags=re.M) == list(RULES)
