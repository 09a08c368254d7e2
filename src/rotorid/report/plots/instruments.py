"""Drawings: the instruments and the vehicle, from their measures, the way of the data, and the workflow's rules."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rotorid.report.plots import style

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from rotorid.recordings.vehicle import Vehicle

_TOGETHER = ("import_public",)
"""Rules whose names begin with one of these are drawn as one."""
_SWEEPS = 30
_LINE_CHARACTERS = 15
_COLOURS = {"ingest": "#dcefe6", "import": "#dcefe6", "prepare": "#dcefe6", "chapter": "#fdf0d5", "render": "#f4dfe9"}
"""By the first word of a rule's name; others are pale blue."""
_BAR_MM = (70.0, 12.0)
"""Length and width of a cell as drawn; neither is printed in the thesis."""
_BELOW_MM = 25.0
"""From the lower cells to the table, as drawn."""


def _plain(axis: Axes) -> None:
    axis.set_aspect("equal")
    axis.set_axis_off()


def _arrow(axis: Axes, start, stop, label: str = "", colour: str = style.BLACK, **text) -> None:
    axis.annotate(
        "", stop, start, arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.2, "shrinkA": 0, "shrinkB": 0}
    )
    if label:
        way = np.asarray(stop, float) - np.asarray(start, float)
        sideways = abs(way[0]) > 2 * abs(way[1])
        place = np.asarray(stop) + (0.05 if sideways else 0.14) * way
        axis.text(*place, label, color=colour, ha="left" if sideways else "center", va="center", **text)


def bench(distances_mm: Mapping[str, float]) -> Figure:
    """The six cells from above (x up, y right), and the bench from the side, by the distances of table 2.3 (mm).

    Places and directions are those of `rotorid.identify.fem.placement`, which the finite elements have too.
    """
    from matplotlib.patches import Polygon, Rectangle

    from rotorid.identify.fem import placement

    fig, (top, side) = style.figure(3.3, 1, 2, width_ratios=(1.25, 1))
    length, width = _BAR_MM
    for cell, place in sorted(placement.cells(distances_mm).items(), reverse=True):
        colour = style.RED if cell % 2 else style.BLUE
        start, along = place.force_m[:2], place.axis[:2]
        across = np.array([-along[1], along[0]])
        corners = [
            start + t * length * along + w * width * across for t, w in ((0, -0.5), (1, -0.5), (1, 0.5), (0, 0.5))
        ]
        top.add_patch(Polygon([corner[::-1] for corner in corners], facecolor=colour, alpha=0.3, edgecolor=colour))
        top.plot(start[1], start[0], "o", color=colour, markersize=4)
        middle = start + 0.55 * length * along
        outwards = middle / np.linalg.norm(middle)
        label = middle + (-15 if cell % 2 else 15) * outwards
        top.text(label[1], label[0], str(cell), ha="center", va="center", fontweight="bold", color=colour)
    top.plot(0, 0, "o", color="black", markersize=5)
    top.text(-5, -9, "{T}", fontsize=8.5, ha="right")
    _arrow(top, (0, 0), (0, 38), "$x$")
    _arrow(top, (0, 0), (38, 0), "$y$")
    top.set_xlim(-105, 105)
    top.set_ylim(-100, 100)
    top.set_title("from above")
    _plain(top)
    length, upper, lower = (distances_mm[name] for name in ("L", "D_135z", "D_246z"))
    table = -lower - _BELOW_MM
    side.add_patch(Rectangle((-80, table - 10), 160, 10, facecolor="#dddddd", edgecolor="black", lw=0.7))
    side.add_patch(Rectangle((-60, -6), 120, 6, facecolor="#eeeeee", edgecolor="black", lw=0.7))
    side.add_patch(Rectangle((-6, 0), 12, length, facecolor="#eeeeee", edgecolor="black", lw=0.7))
    for depth, colour, name in ((upper, style.RED, "cells 1, 3, 5"), (lower, style.BLUE, "cells 2, 4, 6")):
        side.plot([-60, 60], [-depth, -depth], color=colour, lw=5, alpha=0.35, solid_capstyle="butt")
        side.text(88, -depth, f"{name}: {depth:.1f} mm below", color=colour, va="center", fontsize=8.5)
    side.plot([-62, 62], [length, length], color="black", lw=3)
    side.text(88, 3, "{T}, top of piece D", va="center", fontsize=8.5)
    side.text(68, length, f"vehicle {{B}}: $L$ = {length:.0f} mm", va="center", fontsize=8.5)
    _arrow(side, (-90, 150), (-90, 95), "$z$")
    _arrow(side, (0, length + 8), (0, length + 50), "thrust", fontsize=8.5)
    side.set_xlim(-105, 235)
    side.set_ylim(table - 16, length + 70)
    side.set_title("from the side")
    _plain(side)
    return fig


def vehicle(flown: Vehicle) -> Figure:
    """Rotor numbers, spins and body axes from above, and the frames from behind and the side."""
    from matplotlib.patches import Arc, Circle

    fig, (top, side) = style.figure(2.7, 1, 2, width_ratios=(1.15, 1))
    places = 1000 * flown.rotor_positions_m()
    radius = 1000 * float(flown.rotor_radius_m or 0.0635)
    for number, ((x, y, _), spin) in enumerate(zip(places, flown.yaw_signs(), strict=True), 1):
        # Reaction about +z, which points down, where the rotor turns counter-clockwise seen from above.
        colour = style.BLUE if spin > 0 else style.RED
        top.plot([0, y], [0, x], color="#999999", lw=4, zorder=0)
        top.add_patch(Circle((y, x), radius, fill=True, facecolor=colour, alpha=0.12, edgecolor=colour))
        ends = (40, 140)
        top.add_patch(Arc((y, x), 1.5 * radius, 1.5 * radius, theta1=ends[0], theta2=ends[1], color=colour, lw=1.3))
        angle = np.radians(ends[1] if spin > 0 else ends[0])
        tip = np.array([y, x]) + 0.75 * radius * np.array([np.cos(angle), np.sin(angle)])
        way = np.array([-np.sin(angle), np.cos(angle)]) * (1 if spin > 0 else -1)
        top.annotate("", tip + 12 * way, tip, arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.3})
        top.text(y, x - 0.55 * radius, str(number), ha="center", va="center", fontweight="bold", color=colour)
    _arrow(top, (0, 0), (0, 120), "$x_B$")
    _arrow(top, (0, 0), (120, 0), "$y_B$")
    reach = 1.15 * (np.abs(places[:, :2]).max() + radius)
    top.set_xlim(-reach, reach)
    top.set_ylim(-reach, reach)
    top.set_title("from above: numbers and spins")
    _plain(top)
    _arrow(side, (0, 0), (1, 0), "$x_I$ (north)", fontsize=8.5)
    _arrow(side, (0, 0), (0, -1), "$z_I$ (down)", fontsize=8.5)
    tilt = np.radians(20.0)
    centre, forward = np.array([1.2, 1.3]), np.array([np.cos(tilt), np.sin(tilt)])
    down = np.array([np.sin(tilt), -np.cos(tilt)])
    side.plot(*np.array([centre - forward, centre + forward]).T, color="#999999", lw=4)
    for place in (-1, 1):
        hub = centre + place * forward
        side.plot(
            *np.array([hub - 0.45 * forward - 0.1 * down, hub + 0.45 * forward - 0.1 * down]).T, color=style.BLUE, lw=2
        )
        _arrow(side, hub - 0.1 * down, hub - 0.75 * down, "$F_i$", colour=style.BLUE)
    _arrow(side, centre + 0.2 * down, centre + 0.2 * down + 0.75 * forward, "$x_B$")
    _arrow(side, centre, centre + 0.75 * down, "$z_B$")
    _arrow(side, centre, centre + np.array([0, -0.55]), "", colour=style.GREEN)
    side.text(centre[0] - 0.4, centre[1] - 0.5, "$mg$", color=style.GREEN)
    side.set_xlim(-0.4, 3.0)
    side.set_ylim(-1.5, 2.7)
    side.set_title("from the side: world and body")
    _plain(side)
    return fig


def stand(flown: Vehicle, tilt_deg: float) -> Figure:
    """The vehicle on the six-axis sensor, level and tilted: the sensor stays level."""
    from matplotlib.patches import Rectangle

    fig, axes = style.figure(2.5, 1, 2)
    arm = 1000 * float(np.abs(flown.rotor_positions_m()[:, 1]).max())
    height = 1000 * abs(float(flown.sensor_position_m[2])) if flown.sensor_position_m is not None else 45.0
    for axis, tilt, name in ((axes[0], 0.0, "level"), (axes[1], np.radians(tilt_deg), "rolled to the right")):
        axis.add_patch(Rectangle((-9, -150), 18, 150, facecolor="#dddddd", edgecolor="black", lw=0.7))
        axis.add_patch(Rectangle((-22, 0), 44, 18, facecolor=style.ORANGE, alpha=0.5, edgecolor="black", lw=0.7))
        origin = np.array([0.0, 18.0])
        right, up = np.array([np.cos(tilt), -np.sin(tilt)]), np.array([np.sin(tilt), np.cos(tilt)])
        centre = origin + height * up
        axis.plot(*np.array([origin, centre]).T, color="black", lw=2)
        axis.plot(*np.array([centre - arm * right, centre + arm * right]).T, color="#999999", lw=4)
        for place in (-1, 1):
            hub = centre + place * arm * right
            axis.plot(*np.array([hub - 45 * right + 8 * up, hub + 45 * right + 8 * up]).T, color=style.BLUE, lw=2)
            _arrow(axis, hub + 8 * up, hub + 62 * up, colour=style.BLUE)
        _arrow(axis, centre, centre + np.array([0, -70]), colour=style.GREEN)
        axis.text(centre[0] + 12, centre[1] - 40, "$W$", color=style.GREEN)
        axis.plot(*centre, "o", color="black", markersize=3.5)
        _arrow(axis, (60, -30), (110, -30), "$y$")
        _arrow(axis, (60, -30), (60, -80), "$z$")
        axis.text(-28, 9, "six-axis sensor", ha="right", va="center", fontsize=8.5)
        axis.set_title(name)
        axis.set_xlim(-170, 170)
        axis.set_ylim(-155, 175)
        _plain(axis)
    return fig


_CHAIN = (
    ("load-cell bench", "6 cells, 2 converters,\nArduino, serial port"),
    ("thrust tester", "thrust, speed,\ncurrent, serial port"),
    ("quadrotor", "throttles, voltage,\nESP32, radio"),
    ("six-axis sensor", "forces, moments,\nconversion board"),
)
_STEPS = (
    ("recorder", "frames checked,\nraw log, metadata"),
    ("ingest", "units, gaps, flags,\none clock"),
    ("stages", "calibrate, filter,\nidentify"),
    ("mismatch", "locate, name,\nimprove"),
    ("report", ""),
)


def signal_chain() -> Figure:
    """From the instruments to the report."""
    from matplotlib.patches import FancyBboxPatch

    fig, axis = style.figure(2.6)

    def box(x, y, width, title, text, colour) -> None:
        look = FancyBboxPatch(
            (x, y), width, 0.8, boxstyle="round,pad=0.02", facecolor=colour, edgecolor="black", lw=0.7
        )
        axis.add_patch(look)
        axis.text(
            x + width / 2, y + (0.62 if text else 0.4), title, ha="center", va="center", fontsize=8.5, fontweight="bold"
        )
        axis.text(x + width / 2, y + 0.25, text, ha="center", va="center", fontsize=7.5)

    for row, (title, text) in enumerate(_CHAIN):
        box(0, 3.3 - 1.1 * row, 1.75, title, text, "#e8f1f8")
        axis.annotate("", (2.25, 1.95), (1.8, 3.7 - 1.1 * row), arrowprops={"arrowstyle": "-|>", "lw": 0.9})
    for place, (title, text) in enumerate(_STEPS):
        box(2.3 + 1.72 * place, 1.55, 1.35 if text else 0.8, title, text, "#f4f4f4")
        if place:
            axis.annotate(
                "",
                (2.26 + 1.72 * place, 1.95),
                (1.98 + 1.72 * place, 1.95),
                arrowprops={"arrowstyle": "-|>", "lw": 0.9},
            )
    axis.set_xlim(-0.1, 10.1)
    axis.set_ylim(-0.2, 4.3)
    axis.set_axis_off()
    return fig


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
