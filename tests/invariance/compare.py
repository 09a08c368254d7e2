"""What differs between the verdict on a set and the one on its changed copy."""

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rotorid.mismatch.tell.verdict import Verdict
from tests.invariance.changes import Changed

CLAIMED = ("established", "ambiguous")


@dataclass(frozen=True)
class Difference:
    """Words that differ, those of claims and those of hints apart, and by how much the numbers do."""

    words: tuple[str, ...]
    """One clause a difference in the verdict's word, its claims, its named values and its held-out runs."""
    hints: tuple[str, ...]
    """The same of effects that are no claims: suggested, absorbed, not established."""
    moved: float
    """Largest change of a stated number as a share of its 95 % interval; NaN where both state none."""
    which: str
    """The number that moved most."""


def difference(own: Verdict, other: Verdict, changed: Changed) -> Difference:
    """Compare a verdict with the one on the changed set, turned back."""
    words = []
    if own.verdict != other.verdict:
        words.append(f"verdict {own.verdict} became {other.verdict}")
    for side in ("training", "held_out"):
        back = tuple(dict.fromkeys(changed.runs.get(name, name) for name in getattr(other.runs, side)))
        if sorted(back) != sorted(getattr(own.runs, side)):
            words.append(f"{side} runs {', '.join(getattr(own.runs, side))} became {', '.join(back)}")
    words += _changed_words(_said(own, True), _said(other, True))
    words += _changed_words({k: "" for k in own.parameters}, {k: "" for k in other.parameters}, "value ")
    moves = _moves(_numbers(own, {}, 0.0), _numbers(other, changed.rotors, changed.turn_rad))
    which = max(moves, key=lambda name: moves[name], default="")
    return Difference(
        tuple(words),
        tuple(_changed_words(_said(own, False), _said(other, False))),
        moves.get(which, float("nan")),
        which,
    )


def _said(verdict: Verdict, claimed: bool) -> dict[str, str]:
    """To the id of each effect its status; a class goes by its members, since which of them is fitted is no claim."""
    found = {}
    for effect in verdict.effects:
        if (effect.status in CLAIMED) == claimed:
            name = " or ".join(effect.alternatives) if effect.status == "ambiguous" else effect.id
            found[name] = effect.status
    return found


def _changed_words(own: Mapping[str, str], other: Mapping[str, str], kind: str = "") -> list[str]:
    lost = [f"{kind}{k} {own[k]}".strip() + " is gone" for k in own if k not in other]
    new = [f"{kind}{k} {other[k]}".strip() + " is new" for k in other if k not in own]
    turned = [f"{kind}{k} {own[k]} became {other[k]}" for k in own if k in other and own[k] != other[k]]
    return [*lost, *new, *turned]


def _numbers(verdict: Verdict, rotors: Mapping[int, int], turn_rad: float) -> dict[str, tuple[float, float]]:
    """To the name of each number of what is established, and of each wrong value, the value and its interval's width.

    Rotors and axes are turned back to what they were.
    """
    found = {}
    for effect in verdict.effects:
        if effect.status != "established":
            continue
        symbols = {p.symbol: (p.value, p.interval_95[1] - p.interval_95[0]) for p in effect.parameters}
        for north in [s for s in symbols if s.endswith("_north") and turn_rad]:
            east = north.removesuffix("north") + "east"
            (x, wide_x), (y, wide_y) = symbols[north], symbols[east]
            cos, sin = np.cos(turn_rad), np.sin(turn_rad)
            wide = max(wide_x, wide_y)
            symbols[north], symbols[east] = (cos * x + sin * y, wide), (cos * y - sin * x, wide)
        for symbol, number in symbols.items():
            found[f"{effect.id}.{_of_rotor(symbol, rotors)}"] = number
    for name, value in verdict.parameters.items():
        found[_of_rotor(name, rotors)] = (value.refitted, value.interval_95[1] - value.interval_95[0])
    return found


def _of_rotor(symbol: str, rotors: Mapping[int, int]) -> str:
    """A symbol of a rotor (`d_2`) with the number that the rotor had."""
    match = re.fullmatch(r"(.*_)(\d+)", symbol)
    return f"{match[1]}{rotors.get(int(match[2]), int(match[2]))}" if match and rotors else symbol


def _moves(own: Mapping[str, tuple[float, float]], other: Mapping[str, tuple[float, float]]) -> dict[str, float]:
    """Of each number that both state the change as a share of the wider interval."""
    moves = {}
    for name in own.keys() & other.keys():
        wide = max(own[name][1], other[name][1])
        step = abs(own[name][0] - other[name][0])
        moves[name] = step / wide if wide > 0 else float(step > 1e-9 * abs(own[name][0]))
    return moves
