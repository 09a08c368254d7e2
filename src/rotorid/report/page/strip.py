"""The heat strip of a page: size of the error relative to the noise, channels down, the runs' time across.

Drawn as SVG text with one small picture a run, so that a verdict's page needs no drawing library.
"""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image

from rotorid.mismatch.decide.findings import Analysis
from rotorid.mismatch.decide.words import FORWARD_WORDS, channel_words
from rotorid.mismatch.tell.verdict import Verdict
from rotorid.report.page.data import blocks

_CELL_S = 0.5
_MOST_CELLS = 400
_MOST_RUNS = 8
_LOWEST, _LARGEST = 0.7, 10.0
"""Sizes relative to the noise at which the colours begin and end."""
_COLOURS = ("ffffcc", "ffeda0", "fed976", "feb24c", "fd8d3c", "fc4e2a", "e31a1c", "bd0026", "800026")
"""YlOrRd of ColorBrewer 2.0 (Cynthia Brewer)."""
_WIDTH, _LEFT, _RIGHT, _BETWEEN = 640, 104, 62, 6
_LINE, _HEAD, _FOOT, _APART = 18, 30, 30, 14
_LETTER = 4.6
"""Width of a letter of a run's name."""
_STAGES = {"before": "as believed", "after": "improved"}

_Sizes = Mapping[tuple[str, str, str], tuple[np.ndarray, np.ndarray]]
"""(stage, run, channel) to instants, s, and sizes in units of the noise."""


@dataclass(frozen=True)
class _Place:
    """Where a run stands in the strip, and its time."""

    run: str
    left: float
    width: float
    start_s: float
    stop_s: float

    def x(self, time_s: float) -> float:
        """Place of an instant, at the edges for those outside."""
        share = (time_s - self.start_s) / (self.stop_s - self.start_s)
        return self.left + self.width * min(max(share, 0.0), 1.0)


def strip(analysis: Analysis, verdict: Verdict) -> tuple[str, str, str] | None:
    """SVG of every channel over every run, what it shows, and its caption; None where nothing was compared."""
    channels = [c for c in verdict.channels if c not in FORWARD_WORDS and verdict.channels[c].noise_floor]
    runs = list(dict.fromkeys(t.run for t in analysis.traces))
    located_runs = dict.fromkeys(loc.run for loc in verdict.locations)
    shown = list(dict.fromkeys([*[r for r in runs if r in verdict.runs.held_out], *located_runs, *runs]))
    shown = [r for r in runs if r in shown[:_MOST_RUNS]]
    if not channels or not shown:
        return None
    sizes: dict[tuple[str, str, str], tuple[np.ndarray, np.ndarray]] = {}
    for trace in analysis.traces:
        if trace.run in shown and trace.channel in channels:
            noise = verdict.channels[trace.channel].noise_floor
            period = float(np.median(np.diff(trace.time_s)))
            per = max(int(_CELL_S / period), len(trace.time_s) // _MOST_CELLS, 1)
            per = min(per, len(trace.time_s))  # A stretch that is shorter than a cell is one cell.
            count = len(trace.time_s) // per
            for stage in ("before", "after"):
                size = np.sqrt(blocks(getattr(trace, stage) ** 2, per, count)) / noise
                key = (stage, trace.run, trace.channel)
                before = sizes.get(key, (np.zeros(0), np.zeros(0)))
                sizes[key] = np.append(before[0], blocks(trace.time_s, per, count)), np.append(before[1], size)
    picture = _drawn(channels, shown, sizes, verdict)
    caption = "Error of each channel over the runs' time, in units of its noise. Black lines: where it was located."
    if len(shown) < len(runs):
        caption += f" {len(shown)} of {len(runs)} runs are shown."
    return picture, "error over noise by channel and time, before and after", caption


def _drawn(channels: Sequence[str], runs: Sequence[str], sizes: _Sizes, verdict: Verdict) -> str:
    """The strip: as believed above improved; what was located is underlined in the upper part."""
    held_out = verdict.runs.held_out if verdict.runs.held_out != verdict.runs.training else ()
    places = _places(runs, sizes)
    body = _LINE * len(channels)
    tops = dict(zip(_STAGES, (_HEAD, _HEAD + body + _APART), strict=True))
    height = tops["after"] + body + _FOOT
    out = []
    for stage, top in tops.items():
        out.append(f'<text transform="translate(9 {top + body / 2}) rotate(-90)" class="m">{_STAGES[stage]}</text>')
        for line, label in enumerate(map(channel_words, channels)):
            y = top + _LINE * (line + 0.68)
            out.append(f'<text x="{_LEFT - 6}" y="{y:.1f}" class="e">{html.escape(label)}</text>')
        for place in places:
            picture = _picture(place, [sizes.get((stage, place.run, channel)) for channel in channels])
            out.append(
                f'<image x="{place.left:.1f}" y="{top}" width="{place.width:.1f}" height="{body}" '
                f'preserveAspectRatio="none" style="image-rendering:pixelated" href="{picture}"/>'
            )
    for place in places:
        out += _around(place, tops, body, place.run in held_out)
        for line, channel in enumerate(channels):
            under = tops["before"] + _LINE * (line + 1) - 1
            out += [
                f'<path d="M{place.x(loc.start_s):.1f} {under}H{place.x(loc.stop_s):.1f}" class="l"/>'
                for loc in verdict.locations
                if (loc.run, loc.channel) == (place.run, channel)
            ]
    middle = _LEFT + (_WIDTH - _LEFT - _RIGHT) / 2
    out += [f'<text x="{middle}" y="{height - 4}" class="m">time (s)</text>', *_scale(tops["before"], height - _FOOT)]
    return f'<svg viewBox="0 0 {_WIDTH} {height}" class="strip" role="img">{"".join(out)}</svg>'


def _places(runs: Sequence[str], sizes: _Sizes) -> list[_Place]:
    """The runs side by side, each as wide as it is long."""
    spans = []
    for run in runs:
        times = [t for (_, r, _), (t, _) in sizes.items() if r == run and len(t)]
        start, stop = (min(t[0] for t in times), max(t[-1] for t in times)) if times else (0.0, 0.0)
        # One of a single cell is as wide as that.
        spans.append((start, stop) if stop > start else (start - _CELL_S / 2, stop + _CELL_S / 2))
    room = _WIDTH - _LEFT - _RIGHT - _BETWEEN * (len(runs) - 1)
    scale = room / sum(stop - start for start, stop in spans)
    out, left = [], float(_LEFT)
    for run, (start, stop) in zip(runs, spans, strict=True):
        out.append(_Place(run, left, scale * (stop - start), start, stop))
        left += out[-1].width + _BETWEEN
    return out


def _picture(place: _Place, sizes: Sequence[tuple[np.ndarray, np.ndarray] | None]) -> str:
    """The sizes of each channel as a PNG's address: a channel is five lines high, the lowest of them empty."""
    sharp = 2  # Columns of a picture per unit of width.
    columns = max(1, round(sharp * place.width))
    at_s = place.start_s + (np.arange(columns) + 0.5) / columns * (place.stop_s - place.start_s)
    pixels = np.zeros((5 * len(sizes), columns, 4), np.uint8)
    for line, own in enumerate(sizes):
        if own is not None:
            # A cell reaches half a step to both sides, or to the next one.
            time_s, size = own
            step_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else _CELL_S
            cell = np.clip(np.searchsorted(time_s - step_s / 2, at_s, side="right") - 1, 0, len(size) - 1)
            pixels[5 * line : 5 * line + 4] = _coloured(size[cell])
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "png")
    return "data:image/png;base64," + base64.b64encode(file.getvalue()).decode()


def _coloured(size: np.ndarray) -> np.ndarray:
    """Colours (n, 4) of sizes (n,), on a logarithmic scale."""
    table = np.array([[*bytes.fromhex(colour), 255] for colour in _COLOURS], float)
    at = _share(np.clip(size, _LOWEST, _LARGEST)) * (len(table) - 1)
    return np.stack([np.interp(at, np.arange(len(table)), own) for own in table.T], axis=1).round().astype(np.uint8)


def _share(size: np.ndarray | float) -> np.ndarray | float:
    """How far up the scale of colours a size stands, 0 to 1."""
    return np.log(size / _LOWEST) / np.log(_LARGEST / _LOWEST)


def _around(place: _Place, tops: Mapping[str, int], body: int, held_out: bool) -> list[str]:
    """A run's name above it, and its time below."""
    fits = max(1, int((place.width + _BETWEEN) / _LETTER))
    name = place.run if len(place.run) <= fits else f"{place.run[: max(1, fits - 1)]}…"
    middle, bottom = place.left + place.width / 2, tops["after"] + body
    out = [f'<text x="{middle:.1f}" y="12" class="n">{html.escape(name)}</text>']
    if held_out:
        out.append(f'<text x="{middle:.1f}" y="24" class="n">held out</text>')
    for time_s in _ticks(place):
        x = place.x(time_s)
        out.append(f'<path d="M{x:.1f} {bottom}v3" class="t"/><text x="{x:.1f}" y="{bottom + 13}" class="n">')
        out.append(f"{time_s:g}</text>")
    return out


def _ticks(place: _Place) -> np.ndarray:
    """Round instants within a run, at most four, and as many as have room."""
    most = int(np.clip(place.width // 16, 1, 4))
    least = (place.stop_s - place.start_s) / most
    decade = 10.0 ** np.floor(np.log10(least))
    step = next(n * decade for n in (1, 2, 5, 10, 20) if n * decade >= least)
    return step * np.arange(np.ceil(place.start_s / step), np.floor(place.stop_s / step) + 1)


def _scale(top: float, bottom: float) -> list[str]:
    """The scale of the colours at the right edge."""
    left, height = _WIDTH - 46, bottom - top
    stops = "".join(
        f'<stop offset="{i / (len(_COLOURS) - 1):.3f}" stop-color="#{colour}"/>' for i, colour in enumerate(_COLOURS)
    )
    out = [
        f'<linearGradient id="heat" x1="0" x2="0" y1="1" y2="0">{stops}</linearGradient>',
        f'<rect x="{left}" y="{top}" width="9" height="{height}" fill="url(#heat)"/>',
        f'<text transform="translate({_WIDTH - 4} {top + height / 2}) rotate(-90)" class="m">error / noise</text>',
    ]
    for size in (1, 2, 5, 10):
        y = bottom - height * float(_share(size))
        out.append(f'<path d="M{left + 9} {y:.1f}h3" class="t"/><text x="{left + 14}" y="{y + 3.5:.1f}">{size}</text>')
    return out
