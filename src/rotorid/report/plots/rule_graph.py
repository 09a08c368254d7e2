"""The graph of the workflow's rules: columns by the steps that lie before a rule, an arrow where one reads another."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from rotorid.report.plots import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_TOGETHER = ("import_public",)
"""Rules whose names begin with one of these are drawn as one."""
_SWEEPS = 30
_LINE_CHARACTERS = 15
_COLOURS = {"ingest": "#dcefe6", "import": "#dcefe6", "prepare": "#dcefe6", "chapter": "#fdf0d5", "render": "#f4dfe9"}
"""By the first word of a rule's name; others are pale blue."""


def merged(steps: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    """Pairs with the rules of one kind drawn together."""

    def name(rule: str) -> str:
        return next((kind for kind in _TOGETHER if rule.startswith(kind)), rule)

    pairs = {(name(a), name(b)) for a, b in steps}
    return sorted((a, b) for a, b in pairs if a != b)


def reduced(pairs: list[tuple[str, str]]) -> list[tuple[str, str]]:
    """The pairs that no way over other rules implies."""
    after: dict[str, set[str]] = {}
    for a, b in pairs:
        after.setdefault(a, set()).add(b)
    behind: dict[str, set[str]] = {}

    def all_behind(rule: str) -> set[str]:
        if rule not in behind:
            behind[rule] = set().union(*({b} | all_behind(b) for b in after.get(rule, ())))
        return behind[rule]

    return [(a, b) for a, b in pairs if not any(b in all_behind(other) for other in after[a] - {b})]


def columns(pairs: list[tuple[str, str]]) -> dict[str, int]:
    """Rule to its column: one more than the last of the rules whose files it reads; chapters share a column."""
    rules = sorted({rule for pair in pairs for rule in pair})
    before = {rule: [a for a, b in pairs if b == rule] for rule in rules}
    place: dict[str, int] = {}

    def of(rule: str) -> int:
        if rule not in place:
            place[rule] = max((of(known) + 1 for known in before[rule]), default=0)
        return place[rule]

    for rule in rules:
        of(rule)
    chapters = [rule for rule in rules if rule.startswith("chapter_")]
    last = max((place[rule] for rule in chapters), default=0)
    for rule in chapters:
        place[rule] = last
    shift = max((last + 1 - place[rule] for rule in rules if rule.startswith("render")), default=0)
    for rule in rules:
        if rule.startswith(("render", "typeset", "build")):
            place[rule] += max(shift, 0)
    return place


def heights(pairs: list[tuple[str, str]], place: dict[str, int]) -> dict[str, float]:
    """Rule to its height, 0 to 1: columns are ordered again and again by the middle of what their rules join to."""
    by_column: dict[int, list[str]] = {}
    for rule in sorted(place):
        by_column.setdefault(place[rule], []).append(rule)
    height = {}

    def spread(rules: list[str]) -> None:
        for k, rule in enumerate(rules):
            height[rule] = (k + 0.5) / len(rules)

    for rules in by_column.values():
        spread(rules)
    for sweep in range(_SWEEPS):
        for column in sorted(by_column, reverse=bool(sweep % 2)):
            middle = {}
            for rule in by_column[column]:
                joined = [height[b] for a, b in pairs if a == rule] + [height[a] for a, b in pairs if b == rule]
                middle[rule] = float(np.mean(joined)) if joined else height[rule]
            by_column[column].sort(key=lambda rule: (middle[rule], rule))
            spread(by_column[column])
    return height


def wrapped(rule: str) -> str:
    """A rule's name on lines of a box's width."""
    lines, line = [], ""
    for word in rule.split("_"):
        if line and len(line) + 1 + len(word) > _LINE_CHARACTERS:
            lines, line = [*lines, line], word
        else:
            line = f"{line} {word}".strip()
    return "\n".join([*lines, line])


def rule_graph(steps: Iterable[tuple[str, str]]) -> Figure:
    """The graph, from pairs of a rule and one that reads its files."""
    pairs = merged(steps)
    place = columns(pairs)
    pairs = reduced(pairs)
    height = heights(pairs, place)
    most = max(np.bincount(list(place.values())))
    fig, axis = style.figure(0.6 + 0.4 * most)
    width = 0.8
    for a, b in pairs:
        start, stop = (place[a] + width / 2, height[a]), (place[b] - width / 2, height[b])
        arrow = {"arrowstyle": "-|>", "lw": 0.4, "color": "#8a8a8a", "shrinkA": 0, "shrinkB": 0, "mutation_scale": 6}
        axis.annotate("", stop, start, arrowprops=arrow, zorder=1)
    for rule, column in place.items():
        colour = _COLOURS.get(rule.split("_")[0], "#e8f1f8")
        axis.text(
            column, height[rule], wrapped(rule), ha="center", va="center", fontsize=7, linespacing=0.95, zorder=2,
            bbox={"boxstyle": "round,pad=0.25", "facecolor": colour, "edgecolor": "#555555", "linewidth": 0.5},
        )  # fmt: skip
    axis.set_xlim(-0.55, max(place.values()) + 0.55)
    axis.set_ylim(1.0, 0.0)
    axis.set_axis_off()
    return fig
