"""The page of a comparison: one HTML file that needs no other."""

from __future__ import annotations

import tempfile
from pathlib import Path

from jinja2 import Environment
from markupsafe import Markup

from rotorid.mismatch.changes import words
from rotorid.mismatch.changes.compare import Changes
from rotorid.mismatch.changes.level_one_words import level_one_sentences, quantity_words
from rotorid.mismatch.decision.words import capital, channel_words
from rotorid.report.page.make import policy_for
from rotorid.report.plots.mismatch import draw_differences, draw_residuals, draw_values

_TEMPLATE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{{ new }} compared with {{ base }}</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{{ policy }}">
<style>
body { font: 15px/1.45 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #222; }
h1 { font-size: 1.4rem; } .changes { font-size: 1.15rem; }
table { border-collapse: collapse; width: 100%; margin: .5rem 0 2rem; }
th, td { text-align: left; padding: .25rem .6rem; border-bottom: 1px solid #ddd; vertical-align: top; }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums; }
svg { width: 100%; max-width: 50rem; height: auto; background: #fff; }
.wide { overflow-x: auto; }
</style></head><body>
<h1>{{ new }} compared with {{ base }}</h1>
{% if seen %}<h2>What differs</h2>
<ul class="changes">{% for sentence in seen %}<li>{{ sentence }}</li>{% endfor %}</ul>
<p>Each quantity over the flights in the order of their names. Shaded: the good flights. Dotted: by how much the mean of
the new flights would have to differ to be stated in 19 of 20 comparisons. Red: stated.</p>
{{ quantities }}
<h2>What explains it</h2>{% endif %}
<ul class="changes">{% for sentence in changes %}<li>{{ sentence }}</li>{% endfor %}</ul>
{% if notes %}<h2>To bear in mind</h2><ul>{% for note in notes %}<li>{{ note }}</li>{% endfor %}</ul>{% endif %}
<h2>Believed values</h2>
{{ values }}
<h2>Not changed by more than</h2>
<p>With 95 % probability. Each set is compared with its own vehicle.yaml.</p>
<div class="wide"><table><tr><th>what</th><th class="number">at most</th><th class="number">of {{ whole }}</th></tr>
{% for row in limits %}<tr><td>{{ row.name }}</td><td class="number">{{ row.at_most }}</td>
<td class="number">{{ row.share }}</td></tr>{% endfor %}</table></div>
<h2>{{ left }}</h2>
<p>{{ measured }}, one stretch of each set. What both sets have alike is no change.</p>
{{ residuals }}
</body></html>
"""


def make_changes_page(found: Changes) -> str:
    """The page of a comparison."""
    sentences, flown = words.level_two_sentences(found), found.kind == "flight"
    seen = found.level_1
    names = {} if seen is None else {d.quantity.key: quantity_words(d) for d in seen.differences}
    return (
        Environment(autoescape=True, trim_blocks=True)
        .from_string(_TEMPLATE)
        .render(
            policy=policy_for(),
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
        text = path.read_text(encoding="utf-8")
    return Markup(text[text.index("<svg") :])
