"""Figures of the bench by finite elements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from rotorid.report.plots import style
from rotorid_lab.fem.placement import turn

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_NAMES = {"aluminium": "Al-6061", "pla": "PLA"}
_COLOURS = {"aluminium": style.BLUE, "pla": style.RED}
_LEGS = 3
_PARTS = ("upper cell", "lower cell", "A", "B", "C", "D")
_LIGHT = np.array([0.36, -0.48, 0.8])
"""Direction from which the parts are lit."""
_TICKS_UV_N = (20, 50, 100, 200, 500)
_RATIOS = {
    "ratio_deformation": "deformation",
    "ratio_narrow_upper": "stress, upper cell",
    "ratio_narrow_lower": "stress, lower cell",
}


def whole_bench(surface: pd.DataFrame, column: str, factor: float, label: str, gamma: float = 1.0) -> Figure:
    """The whole bench, once a material, coloured by what a load does to it; each material has a scale of its own.

    `surface`: triangles of one leg's surface (results/fem/surface.parquet). `column`: of the surface, without the
    ending of the material. `factor`: from the column's value to what is shown. `label`: quantity and unit. `gamma`:
    power of the scale of colours; below 1 small values can be distinguished.
    """
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import PowerNorm

    fig, axes = style.figure(2.8, 1, 2, subplot_kw={"projection": "3d"})
    legs = _legs_mm(surface)
    colours = colormaps["viridis"]
    for axis, (end, name) in zip(axes, _NAMES.items(), strict=True):
        values = np.tile(surface[f"{column}_{end}"].to_numpy() * factor, _LEGS)
        scale = PowerNorm(gamma, 0, values.max())
        _put(axis, legs, colours(scale(values)))
        axis.set_title(name)
        bar = ScalarMappable(scale, colours)
        fig.colorbar(bar, ax=axis, shrink=0.75, pad=0.0, label=label, orientation="horizontal")
    return fig


def parts(surface: pd.DataFrame) -> Figure:
    """What the model is made of: the whole bench, and one leg with its third of plate D, a colour a part."""
    from matplotlib.colors import to_rgb
    from matplotlib.patches import Patch

    fig, axes = style.figure(2.9, 1, 2, subplot_kw={"projection": "3d"})
    legs = _legs_mm(surface)
    colours = dict(zip(_PARTS, style.CYCLE, strict=False))
    triangles = surface["part"].to_numpy()
    for axis, number in zip(axes, (_LEGS, 1), strict=True):
        shown = legs[: number * len(triangles)]
        normal = np.cross(shown[:, 1] - shown[:, 0], shown[:, 2] - shown[:, 0])
        light = 0.55 + 0.45 * np.abs(normal @ _LIGHT) / np.linalg.norm(normal, axis=1)
        plain = np.array([to_rgb(colours[name]) for name in np.tile(triangles, number)])
        _put(axis, shown, plain * light[:, None], legs, zoom=1.3)
    axes[0].set_title("the bench")
    axes[1].set_title("what is solved")
    handles = [
        Patch(color=colour, label=name if "cell" in name else f"piece {name}") for name, colour in colours.items()
    ]
    fig.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    return fig


def _legs_mm(surface: pd.DataFrame) -> np.ndarray:
    """Triangles of all legs [mm], shape (k, 3, 3), seen from above in a right-handed view: y to the left, z upwards."""
    corners = np.stack([surface[[f"x_{k}_m", f"y_{k}_m", f"z_{k}_m"]].to_numpy() for k in (1, 2, 3)], axis=1)
    legs = np.concatenate([1e3 * corners @ turn(2 * np.pi / _LEGS * leg).T for leg in range(_LEGS)])
    return legs * np.array([1.0, -1.0, -1.0])


def _put(
    axis: Axes, triangles: np.ndarray, colours: np.ndarray, within: np.ndarray | None = None, zoom: float = 1.6
) -> None:
    """Draw triangles in space, in a frame that holds those of `within`."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    axis.add_collection3d(
        Poly3DCollection(triangles, facecolors=colours, linewidths=0, antialiased=False, rasterized=True)
    )
    frame = triangles if within is None else within
    reach, low, high = np.abs(frame[..., :2]).max(), frame[..., 2].min(), frame[..., 2].max()
    axis.set(xlim=(-reach, reach), ylim=(-reach, reach), zlim=(low, high))
    axis.set_box_aspect((2 * reach, 2 * reach, high - low), zoom=zoom)
    axis.view_init(elev=28, azim=-62)
    axis.set_axis_off()


def against_load(loads: pd.DataFrame) -> Figure:
    """Deformation, largest stress and stress in the narrow sections against the load (thesis fig. 2.18)."""
    fig, axes = style.figure(2.4, 1, 3)
    panels = (
        ("deformation_m", 1e6, "largest deformation (µm)", "-"),
        ("stress_pa", 1e-6, "largest stress (MPa)", "-"),
        ("narrow_lower_pa", 1e-6, "narrow section (MPa)", "-"),
    )
    for axis, (column, factor, label, line) in zip(axes, panels, strict=True):
        for end, name in _NAMES.items():
            axis.plot(loads["load_gf"], factor * loads[f"{column}_{end}"], "o" + line, color=_COLOURS[end], label=name)
        axis.set(xlabel="load (gf)", ylabel=label, xlim=(0, None), ylim=(0, None))
    for end, name in _NAMES.items():
        upper = 1e-6 * loads[f"narrow_upper_pa_{end}"]
        axes[2].plot(loads["load_gf"], upper, "s--", color=_COLOURS[end], markerfacecolor="white", label=name)
    axes[0].legend(loc="upper left")
    handles, _ = axes[2].get_legend_handles_labels()
    axes[2].legend([handles[0], handles[2]], ["lower cell", "upper cell"], loc="upper left")
    return fig


def over_sizes(benches: pd.DataFrame) -> Figure:
    """How far each assumed size moves the ratios between the materials, and where benches drawn at random lie."""
    first = benches.iloc[0]
    alone = benches[benches["end"].isin(["low", "high"])]
    drawn = benches[benches["end"] == "drawn"]
    sizes = list(dict.fromkeys(alone["size"]))
    fig, axes = style.figure(0.17 * len(sizes) + 1.2, 1, len(_RATIOS), sharey=True)
    for axis, (column, label) in zip(axes, _RATIOS.items(), strict=True):
        for place, size in enumerate(sizes):
            part = alone[alone["size"] == size].set_index("end")[column]
            for end, colour in (("low", style.BLUE), ("high", style.ORANGE)):
                if end in part:
                    axis.plot([first[column], part[end]], [place, place], color=colour, lw=3, solid_capstyle="butt")
        axis.axvline(first[column], color=style.BLACK, lw=0.7)
        if len(drawn):
            axis.plot(drawn[column], np.full(len(drawn), len(sizes) + 0.3), "|", color=style.GREEN, markersize=9)
        if "narrow" in column:
            axis.axvline(1.0, color=style.GREY, lw=0.7, ls=":")
        axis.set_xlabel(f"{label}\n(PLA over aluminium)")
    axes[0].set_yticks(
        [*range(len(sizes)), len(sizes) + 0.3], [_plain(size) for size in sizes] + ["all drawn at once"], fontsize=7.5
    )
    axes[0].invert_yaxis()
    return fig


def _plain(size: str) -> str:
    words = {"poisson_aluminium": "Poisson's ratio, aluminium", "poisson_pla": "Poisson's ratio, PLA"}
    for unit in ("_mm", "_gpa", "_v"):
        size = size.removesuffix(unit)
    return words.get(size, size.replace("_", " "))


def sensitivity(variants: pd.DataFrame, measured_v_per_n: Sequence[float]) -> Figure:
    """Sensitivity of a cell as computed, with each size at its ends, and what the six cells have."""
    first, alone = variants.iloc[0], variants.iloc[1:]
    sizes = list(dict.fromkeys(alone["size"]))
    fig, axis = style.figure(0.17 * len(sizes) + 1.1)
    for place, size in enumerate(sizes):
        part = alone[alone["size"] == size].set_index("end")["volts_per_n"]
        for end, colour in (("low", style.BLUE), ("high", style.ORANGE)):
            if end in part:
                ends = 1e6 * np.array([first["volts_per_n"], part[end]])
                axis.plot(ends, [place, place], color=colour, lw=3, solid_capstyle="butt", label=end)
    axis.axvline(1e6 * first["volts_per_n"], color=style.BLACK, lw=0.7)
    for value in measured_v_per_n:
        axis.axvline(1e6 * value, color=style.GREEN, lw=0.7)
    axis.set(xscale="log", xlabel="sensitivity (µV/N)")
    axis.set_xticks(_TICKS_UV_N, [f"{value:g}" for value in _TICKS_UV_N])
    axis.minorticks_off()
    axis.set_yticks(range(len(sizes)), [_plain(size) for size in sizes], fontsize=7.5)
    axis.invert_yaxis()
    lines: Mapping[str, object] = {
        "size at its least": axis.plot([], [], color=style.BLUE, lw=3)[0],
        "at its largest": axis.plot([], [], color=style.ORANGE, lw=3)[0],
        "the six cells, calibrated": axis.plot([], [], color=style.GREEN, lw=0.7)[0],
    }
    axis.legend(lines.values(), lines.keys(), loc="lower left", bbox_to_anchor=(0.12, 0.0))
    return fig
