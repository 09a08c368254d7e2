"""Rules that can be switched off one by one, and what fires."""

import pytest

from rotorid.errors import InputError
from rotorid.mismatch.decide.rules import RULES, SIZE, asking


def test_a_rule_decides_where_its_condition_holds_and_it_is_on():
    assert SIZE(True) and not SIZE(False) and SIZE.on
    with asking(off=["size"]) as asked:
        assert not SIZE(True) and not SIZE.on and not SIZE(False)
    assert asked.fired == {"size": 1} and SIZE(True)


def test_what_fires_is_counted_whether_or_not_it_decides():
    with asking() as asked:
        assert [SIZE(x) for x in (True, False, True)] == [True, False, True]
    assert asked.fired == {"size": 2}


def test_an_unknown_rule_is_named_with_those_that_there_are():
    with pytest.raises(InputError, match="no rule is named sise; the rules are size"), asking(off=["sise"]):
        pass


def test_every_rule_says_what_it_decides_and_every_limit_why():
    for name, rule in RULES.items():
        assert name == rule.name and rule.decides.endswith(".") and len(rule.decides.split()) >= 5
        assert all(len(why.split()) >= 4 for _, why in rule.limits.values())


def test_limits_are_read_by_name():
    assert SIZE["least"] == 0.15
