"""The decision knows effects by what their files declare, never by their names."""

import ast
from pathlib import Path

import rotorid.mismatch
from rotorid.effects.catalogue import catalogue, ids_of, ids_of_stage, moving_air
from rotorid.effects.contract import CURVE, DELAY, LAG, LIMIT, SUPPLY

ROOT = Path(rotorid.mismatch.__file__).parent
DETECTORS = {"mistakes", "instrument/mistakes.py", "instrument/sampling.py", "instrument/analyse.py"}
"""What finds one plain mistake, or the steps of a reading, says its name."""


def strings(path: Path) -> set[str]:
    return {n.value for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.Constant) and n.value.__hash__}


def test_no_effect_is_named_in_the_decision():
    ids = set(catalogue())
    named = {}
    for path in ROOT.rglob("*.py"):
        place = path.relative_to(ROOT).as_posix()
        if place.split("/")[0] not in DETECTORS and place not in DETECTORS and (found := ids & strings(path)):
            named[place] = found
    assert not named


def test_traits_name_effects_that_exist():
    ids = set(catalogue())
    for effect in catalogue().values():
        assert {*effect.like_on_heavier, *effect.like_of_reading} <= ids
        assert not effect.same_on_commands or effect.same_on_commands in ids


def test_one_effect_for_what_the_decision_asks_of_one():
    assert moving_air("all the time").id == "steady_wind"
    assert moving_air("in windows").id == "gust"
    assert [len(ids_of_stage(stage)) for stage in (CURVE, SUPPLY, LIMIT, DELAY, LAG)] == [1] * 5
    assert ids_of("drag") < ids_of("feels_air")
    assert sum(bool(e.like_on_heavier) for e in catalogue().values()) == 1
