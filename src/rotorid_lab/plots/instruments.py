"""Drawings: the instruments and the vehicle, from their measures, and schemes of what is joined to what."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from rotorid.report.plots import style

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from rotorid.recordings.vehicle import Vehicle

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

    Places and directions are those of `rotorid_lab.fem.placement`, which the finite elements have too.
    """
    from matplotlib.patches import Polygon, Rectangle

    from rotorid_lab.fem import placement

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
    boxes = {title: (0.9, 3.7 - 1.1 * row, f"{title}\n{text}") for row, (title, text) in enumerate(_CHAIN)}
    steps = [title for title, _ in _STEPS]
    boxes |= {t: (3.0 + 1.72 * k, 2.05, f"{t}\n{text}".strip()) for k, (t, text) in enumerate(_STEPS)}
    arrows = [(title, steps[0]) for title, _ in _CHAIN] + list(itertools.pairwise(steps))
    return scheme(boxes, arrows, 2.6, (-0.2, 10.5), (-0.2, 4.4))


def scheme(
    boxes: Mapping[str, tuple[float, float, str]],
    arrows: Sequence[tuple[str, ...]],
    height_in: float,
    across: tuple[float, float],
    up: tuple[float, float],
) -> Figure:
    """Boxes by name (place and text) and arrows from one to another, `(from, to)` or `(from, to, label)`."""
    fig, axis = style.figure(height_in)
    look = {"boxstyle": "round,pad=0.35", "facecolor": "#eef3f8", "edgecolor": "#555555", "linewidth": 0.6}
    drawn = {
        name: axis.text(x, y, text, ha="center", va="center", fontsize=8, linespacing=1.15, bbox=look, zorder=2)
        for name, (x, y, text) in boxes.items()
    }
    axis.set_xlim(*across)
    axis.set_ylim(*up)
    axis.set_axis_off()
    for start, stop, *label in arrows:
        way = {"arrowstyle": "-|>", "lw": 0.9, "color": "#444444", "shrinkA": 1, "shrinkB": 3}
        way |= {"patchA": drawn[start].get_bbox_patch(), "patchB": drawn[stop].get_bbox_patch()}
        ends = boxes[start][:2], boxes[stop][:2]
        axis.annotate("", ends[1], ends[0], arrowprops=way, zorder=1)
        for text in label:
            middle = (ends[0][0] + ends[1][0]) / 2, (ends[0][1] + ends[1][1]) / 2
            white = {"facecolor": "white", "edgecolor": "none", "pad": 0.6}
            axis.text(*middle, text, ha="center", va="center", fontsize=7.5, bbox=white, zorder=3)
    return fig


def wiring() -> Figure:
    """The bench's electronics: six cells, two converters, one microcontroller (figure 2.19 of the thesis)."""
    boxes = {f"cell {k}": (0.0, 6.0 - k, f"cell {k}") for k in range(1, 7)}
    boxes |= {
        "a": (2.6, 4.0, "ADS1256, 24 bit\nthree cells"),
        "b": (2.6, 1.0, "ADS1256, 24 bit\nthree cells"),
        "uno": (5.4, 2.5, "Arduino UNO"),
        "pc": (8.0, 2.5, "computer\nrecorder"),
    }
    arrows = [(f"cell {k}", "a" if k < 4 else "b") for k in range(1, 7)]
    arrows += [("a", "uno", "SPI"), ("b", "uno", "SPI"), ("uno", "pc", "USB serial")]
    return scheme(boxes, arrows, 2.3, (-0.7, 9.0), (-0.5, 5.5))


def bench_flow() -> Figure:
    """What the bench's recorder does with a stream of samples (figure 2.35 of the thesis)."""
    boxes = {
        "open": (0.0, 1.0, "open\nthe port"),
        "first": (1.75, 1.0, "10 samples:\nlink and spikes"),
        "filter": (3.7, 1.0, "read and\nlow-pass"),
        "tare": (5.6, 1.0, "25 samples:\ntare"),
        "force": (7.5, 1.0, "voltage to cell\nto force"),
        "store": (7.5, -0.5, "store with\ntime stamp"),
        "end": (5.6, -0.5, "export"),
    }
    arrows = [("open", "first"), ("first", "filter"), ("filter", "tare", "steady"), ("tare", "force")]
    arrows += [("force", "store"), ("store", "end", "done")]
    fig = scheme(boxes, arrows, 1.7, (-0.8, 8.6), (-1.0, 1.9))
    axis = fig.axes[0]
    loop = {"arrowstyle": "-|>", "lw": 0.9, "color": "#444444"}
    bent = "arc3,rad=-1.1"
    axis.annotate("", (3.35, 1.3), (4.05, 1.3), arrowprops=loop | {"connectionstyle": "arc3,rad=0.9"})
    axis.text(3.7, 1.72, "not steady", ha="center", fontsize=7.5)
    axis.annotate("", (8.15, 0.8), (8.1, -0.3), arrowprops=loop | {"connectionstyle": bent.replace("-1.1", "0.4")})
    axis.text(8.55, 0.25, "more", ha="center", fontsize=7.5)
    return fig


def control() -> Figure:
    """The attitude controller and what it drives (figure 4.8 of the thesis)."""
    boxes = {
        "reference": (0.0, 1.0, "references\n$F_{T_d}$, $\\phi_d$, $\\theta_d$, $\\psi_d$"),
        "pid": (2.2, 1.0, "PID\non the angles"),
        "map": (4.2, 1.0, "$C_A^{-1}$\nto $\\omega_i^2$"),
        "vehicle": (6.1, 1.0, "vehicle\n(rigid body)"),
        "out": (8.2, 1.0, "angles, rates,\naccelerations"),
        "disturbance": (6.1, 2.1, "disturbance"),
        "noise": (8.2, 2.1, "noise"),
    }
    arrows = [("reference", "pid"), ("pid", "map", "$\\tau$"), ("map", "vehicle"), ("vehicle", "out")]
    arrows += [("disturbance", "vehicle"), ("noise", "out")]
    fig = scheme(boxes, arrows, 1.6, (-0.9, 9.1), (-0.1, 2.4))
    axis = fig.axes[0]
    axis.plot([8.2, 8.2, 2.2], [0.62, 0.05, 0.05], color="#444444", lw=0.9)
    axis.annotate("", (2.2, 0.66), (2.2, 0.05), arrowprops={"arrowstyle": "-|>", "lw": 0.9, "color": "#444444"})
    axis.text(5.2, 0.12, "$\\phi$, $\\theta$, $\\psi$", ha="center", fontsize=8)
    return fig


_NETWORKS = {
    "rotor: 1–4–1, linear": ([["$\\omega^2$"], [""] * 4, ["$F$ or $Q$"]], None),
    "inertias: masked, linear": (
        [
            ["$qr$", "$pr$", "$pq$", "$\\tau_\\phi$", "$\\tau_\\theta$", "$\\tau_\\psi$"],
            ["$\\dot p$", "$\\dot q$", "$\\dot r$"],
        ],
        {(k, k % 3) for k in range(6)},
    ),
    "wrench: 6–20–20–6, sigmoid": (
        [
            ["$F_1$", "$F_2$", "$F_3$", "$F_4$", "$\\phi$", "$\\theta$"],
            [""] * 5 + ["⋮", ""],
            [""] * 5 + ["⋮", ""],
            ["$F_x$", "$F_y$", "$F_z$", "$M_x$", "$M_y$", "$M_z$"],
        ],
        None,
    ),
}
"""Nodes of each layer of the thesis's three networks, and which first-layer weights there are (None: all)."""


def networks() -> Figure:
    """The thesis's three networks (figures 4.17, 4.21, 4.24), twenty hidden nodes drawn as seven."""
    fig, axes = style.figure(2.3, 1, 3, width_ratios=(1, 1, 1.5))
    for axis, (title, (layers, joined)) in zip(axes, _NETWORKS.items(), strict=True):
        places = [[(k, len(nodes) / 2 - i - 0.5) for i in range(len(nodes))] for k, nodes in enumerate(layers)]
        for left, right in itertools.pairwise(range(len(layers))):
            for (i, a), (j, b) in itertools.product(enumerate(places[left]), enumerate(places[right])):
                hidden = "⋮" in (layers[left][i], layers[right][j])
                if not hidden and (joined is None or (i, j) in joined):
                    axis.plot(*zip(a, b, strict=True), color="#888888", lw=0.35, zorder=0)
        for k, nodes in enumerate(layers):
            for (x, y), name in zip(places[k], nodes, strict=True):
                if name == "⋮":
                    axis.text(x, y, name, ha="center", va="center")
                    continue
                colour = "white" if k == 0 else style.SKY
                axis.plot(x, y, "s" if k == 0 else "o", ms=6, mfc=colour, mec="black", mew=0.6)
                side = -0.14 if k == 0 else 0.14
                if name:
                    axis.text(x + side, y, name, ha="right" if k == 0 else "left", va="center", fontsize=8.5)
        axis.set_xlim(-0.6, len(layers) - 0.4)
        axis.set_title(title)
        axis.set_axis_off()
    return fig


def learning() -> Figure:
    """What a network is and how it learns: a node, its functions, errors that go back, samples a step (thesis 4.10 to
    4.16)."""
    fig, (node, function, layers, samples) = style.figure(1.9, 1, 4, width_ratios=(1.15, 0.8, 1.15, 1.2))
    for k, y in enumerate((0.6, 0.0, -0.6)):
        node.plot(0, y, "s", ms=6, mfc="white", mec="black", mew=0.6)
        node.text(-0.12, y, f"$x_{k + 1}$", ha="right", va="center")
        _arrow(node, (0.06, y), (0.85, 0.13 * y))
        beside = {"va": "top"} if y < 0 else {"va": "bottom"}
        node.text(0.42, 0.66 * y + (0.05 if y >= 0 else -0.07), f"$w_{k + 1}$", ha="center", fontsize=8.5, **beside)
    node.plot(1, 0, "o", ms=13, mfc=style.SKY, mec="black", mew=0.6)
    _arrow(node, (1, 0.75), (1, 0.17))
    node.text(1, 0.8, "$b$", ha="center", va="bottom")
    _arrow(node, (1.15, 0), (1.75, 0))
    node.text(1.8, 0, "$y$", va="center")
    node.text(0.95, -0.9, r"$y = \varphi(\sum w_i x_i + b)$", ha="center", va="center", fontsize=8.5)
    node.set(xlim=(-0.45, 2.0), ylim=(-1.1, 1.1), title="A node")

    v = np.linspace(-4, 4, 101)
    function.plot(v, v / 4, color=style.BLUE)
    function.plot(v, 1 / (1 + np.exp(-v)), color=style.RED)
    function.text(-3.9, 0.55, "sigmoid", color=style.RED, fontsize=8.5)
    function.text(0.2, -0.75, "linear", color=style.BLUE, fontsize=8.5)
    function.set(title=r"Its function $\varphi(v)$", xticks=[0], yticks=[0, 1], xlabel="$v$")

    sizes = (2, 3, 2)
    places = [[(k, (n - 1) / 2 - i) for i in range(n)] for k, n in enumerate(sizes)]
    for left, right in itertools.pairwise(places):
        for a, b in itertools.product(left, right):
            layers.plot(*zip(a, b, strict=True), color="#888888", lw=0.5, zorder=0)
    for k, own in enumerate(places):
        for x, y in own:
            layers.plot(x, y, "o" if k else "s", ms=7, mfc=style.SKY if k else "white", mec="black", mew=0.6)
    _arrow(layers, (0.2, 1.45), (1.8, 1.45))
    layers.text(1, 1.52, "samples", ha="center", va="bottom", fontsize=8.5)
    _arrow(layers, (1.8, -1.45), (0.2, -1.45), colour=style.RED)
    layers.text(1, -1.65, r"errors $\delta$, weights $\Delta w$", ha="center", va="top", fontsize=8.5, color=style.RED)
    layers.set(xlim=(-0.3, 2.3), ylim=(-2.1, 2.1), title="Back-propagation")

    for y, (name, groups) in zip(
        (2, 1, 0), (("stochastic", [1] * 10), ("mini-batch", [3, 3, 4]), ("batch", [10])), strict=True
    ):
        at = 0
        for number, count in enumerate(groups):
            colour = style.SKY if number % 2 == 0 else style.ORANGE
            samples.bar([at + i + 0.5 for i in range(count)], 0.3, 0.85, bottom=y, color=colour)
            at += count
        steps = f"{len(groups)} step{'s' if len(groups) > 1 else ''}"
        samples.text(0, y + 0.34, f"{name}: {steps}", va="bottom", fontsize=8.5)
    samples.set(xlim=(-0.2, 10.2), ylim=(-0.3, 2.9), title="Ten samples, one epoch")
    for axis in (node, layers, samples):
        axis.set_axis_off()
    return fig
