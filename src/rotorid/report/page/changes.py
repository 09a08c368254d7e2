"""The page of a comparison: one HTML file that needs no other."""

from __future__ import annotations

import tempfile
from pathlib import Path

from markupsafe import Markup

from rotorid.mismatch.changes import words
from rotorid.mismatch.changes.compare import Changes
from rotorid.mismatch.changes.words import level_one_sentences, quantity_words
from rotorid.mismatch.decide.words import capital, channel_words
from rotorid.report.page.make import drawing, filled
from rotorid.report.plots.mismatch import draw_differences, draw_residuals, draw_values


def make_changes_page(found: Changes) -> str:
    """The page of a comparison."""
    sentences, flown = words.level_two_sentences(found), found.kind == "flight"
    seen = found.level_1
    names = {} if seen is None else {d.quantity.key: quantity_words(d) for d in seen.differences}
    return filled(
        "changes.html",
        base=found.base,
        new=found.new,
        seen=[] if seen is None else level_one_sentences(seen),
        quantities="" if seen is None else _drawn(draw_differences, found, names),
        changes=sentences[: max(1, len(found.changes)) + len(words.advice(found))],
        notes=found.notes,
        whole=words.WHOLE[found.kind],
        left="What each believed vehicle leaves" if flown else "Reading less load",
        measured="Measured less simulated force and moment" if flown else "Reading less the load that is believed",
        values=_drawn(draw_values, found, {p.symbol: words.name_words(p.symbol) for p in found.values}),
        limits=[_limit_row(limit) for limit in found.limits],
        residuals=_drawn(draw_residuals, found, {c: channel_words(c) for c in found.residuals[0]}),
    )


def _limit_row(limit) -> dict[str, str]:
    """A limit's name, size and share of the weight, in words."""
    share = words.percent_words(limit.share) if limit.share else ""
    if limit.id in words.VALUES:
        return {"name": capital(words.name_words(limit.id)), "at_most": words.percent_words(limit.at_most), "share": ""}
    size = "" if limit.at_most is None else f"{limit.symbol} {words.number(limit.at_most)} {limit.unit}"
    return {"name": capital(words.name_words(limit.id)), "at_most": size, "share": share}


def _drawn(draw, found: Changes, names: dict[str, str]) -> Markup:
    """A figure as SVG within the page."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "figure.svg"
        draw(found, names, path)
        return drawing(path)
