"""Whether two spellings of a unit mean the same: `N/(rad/s m/s)` and `N s2/(rad m)`."""

from __future__ import annotations

import re
from collections import Counter

TOKEN = re.compile(r"\s*([A-Za-z]+|\d+|[()/^·*-])")
DIMENSIONLESS = ("rad", "1")


def dimension(unit: str) -> dict[str, int]:
    """Exponent of each base word of a unit; radians count as one, `-` and nothing too.

    A space multiplies, a stroke divides by the next word or bracket, digits are exponents.
    """
    text = "" if unit.strip() in ("-", "1") else unit
    tokens = TOKEN.findall(text.replace("²", "2").replace("^", ""))
    found, _ = _product(tokens, 0)
    return {word: power for word, power in sorted(found.items()) if power and word not in DIMENSIONLESS}


def same_unit(first: str, second: str) -> bool:
    """Whether two units have one dimension and scale, as far as their words show."""
    return dimension(first) == dimension(second)


def _product(tokens: list[str], at: int) -> tuple[Counter, int]:
    total: Counter = Counter()
    sign = 1
    while at < len(tokens) and tokens[at] != ")":
        token = tokens[at]
        if token == "/":
            sign = -1
            at += 1
            continue
        if token in "·*":
            at += 1
            continue
        if token == "(":
            factor, at = _product(tokens, at + 1)
            at += 1
        else:
            factor = Counter({token: 1})
            at += 1
        power = 1
        if at < len(tokens) and tokens[at].isdigit():
            power = int(tokens[at])
            at += 1
        for word, exponent in factor.items():
            total[word] += sign * power * exponent
        sign = 1
    return total, at
