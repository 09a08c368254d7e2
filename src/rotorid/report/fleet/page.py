"""The fleet's page: one HTML file that needs no other but the verdicts that it links to."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
from jinja2 import Environment
from markupsafe import Markup

from rotorid.report.page.make import policy_for

_TEMPLATE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Fleet: {{ name }}</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{{ policy }}">
<style>
body { font: 15px/1.45 system-ui, sans-serif; max-width: 70rem; margin: 2rem auto; padding: 0 1rem; color: #222; }
table { border-collapse: collapse; width: 100%; margin: .5rem 0 2rem; }
th, td { text-align: left; padding: .25rem .6rem; border-bottom: 1px solid #ddd; vertical-align: top; }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums; }
svg { max-width: 100%; height: auto; background: #fff; }
.wide { overflow-x: auto; }
summary { cursor: pointer; margin: .5rem 0; }
td { overflow-wrap: break-word; }
td:last-child:not(.number) { min-width: 9rem; }
.failed, .unexplained { color: #a40000; }
</style></head><body>
<h1>Fleet: {{ name }}</h1>
<p>{{ total }} sets of {{ vehicles }} vehicles: {{ words }}. <b>{{ people }}</b> need a person.</p>
<h2>What shows</h2>
{{ figure }}
<div class="wide"><table><tr><th>effect</th><th class="number">established</th><th class="number">ambiguous</th>
<th class="number">suggested</th><th class="number">vehicles</th></tr>
{% for row in counts %}<tr><td>{{ row.effect }}</td><td class="number">{{ row.established }}</td>
<td class="number">{{ row.ambiguous }}</td><td class="number">{{ row.suggested }}</td>
<td class="number">{{ row.vehicles }}</td></tr>
{% endfor %}</table></div>
<h2>Vehicles</h2>
<div class="wide"><table><tr><th>vehicle</th><th class="number">sets</th><th class="number">failed</th>
<th class="number">need a person</th><th>established, in how many sets</th><th>last verdict</th></tr>
{% for row in fleet %}<tr><td>{{ row.vehicle }}</td><td class="number">{{ row.sets }}</td>
<td class="number">{{ row.failed or "" }}</td><td class="number">{{ row.person or "" }}</td><td>{{ row.effects }}</td>
<td class="{{ row.last }}">{{ row.last.replace("_", " ") }}</td></tr>
{% endfor %}</table></div>
{% if history %}<h2>What changed since the first sets</h2>
{% if events %}<ul>{% for row in events %}<li>{{ row.sentence }} {% if row.lasts > 1 %}Seen in {{ row.lasts }} sets.
{% else %}Seen in this set alone.{% endif %}</li>{% endfor %}</ul>{% else %}<p>Nothing.</p>{% endif %}
{{ history }}{% endif %}
<h2>Need a person</h2>
{% if looked %}<div class="wide"><table>
<tr><th>set</th><th>vehicle</th><th>verdict</th><th>why</th><th>what it says</th></tr>
{% for row in looked %}<tr><td>{% if row.verdict == "failed" %}{{ row.set }}{% else %}
<a href="{{ row.link }}">{{ row.set }}</a>{% endif %}</td>
<td>{{ row.vehicle }}</td><td class="{{ row.verdict }}">{{ row.verdict.replace("_", " ") }}</td>
<td>{{ row.person }}</td>
<td>{{ row.sentence }}</td></tr>
{% endfor %}</table></div>{% else %}<p>None.</p>{% endif %}
<h2>Stand by themselves</h2>
{% if alone %}<details{% if alone|length <= 50 %} open{% endif %}><summary>{{ alone|length }} sets</summary>
<div class="wide"><table><tr><th>set</th><th>vehicle</th><th>verdict</th><th>effects</th></tr>
{% for row in alone %}<tr><td><a href="{{ row.link }}">{{ row.set }}</a></td><td>{{ row.vehicle }}</td>
<td>{{ row.verdict.replace("_", " ") }}</td><td>{{ row.effects }}</td></tr>
{% endfor %}</table></div></details>{% else %}<p>None.</p>{% endif %}
</body></html>
"""


VEHICLE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{{ vehicle }}</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{{ policy }}">
<style>
body { font: 15px/1.45 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #222; }
svg { max-width: 100%; height: auto; background: #fff; }
</style></head><body>
<h1>{{ vehicle }}</h1>
<p>{{ sets }} sets, from {{ first }} to {{ last }}.</p>
{% if events %}<ul>{% for row in events %}<li>{{ row.sentence }}</li>{% endfor %}</ul>
{% else %}<p>No quantity differs from some set on by more than flights of one vehicle do.</p>{% endif %}
<p>Each quantity against the mean of the first sets (shaded), with 95 % intervals. Dotted: what would be stated of all
later sets in 19 of 20 histories. Red, with a line: differs from that set on.</p>
{{ figure }}
</body></html>
"""


def make_vehicle_page(vehicle: str, numbers: pd.DataFrame, events: pd.DataFrame, figure: Path) -> str:
    """The page of one vehicle from its rows of the tables of `rotorid.report.fleet.history`, and their figure."""
    sets = list(dict.fromkeys(numbers["set"]))
    return (
        Environment(autoescape=True, trim_blocks=True)
        .from_string(VEHICLE)
        .render(
            policy=policy_for(),
            vehicle=vehicle,
            sets=len(sets),
            first=sets[0],
            last=sets[-1],
            events=events.to_dict("records"),
            figure=drawing(figure),
        )
    )


def make_page(
    name: str,
    sets: pd.DataFrame,
    counts: pd.DataFrame,
    fleet: pd.DataFrame,
    links: dict[str, str],
    figure: Path,
    history: tuple[pd.DataFrame, Path] | None = None,
) -> str:
    """The page of a fleet from its tables (`rotorid.report.fleet.summary`); `links` lead to each set's own page.

    `history` are the events of `rotorid.report.fleet.history` and their figure, where they were asked for.
    """
    rows = [{**row, "link": links.get(row["set"], "")} for row in sets.to_dict("records")]
    words = sets["verdict"].value_counts()
    return (
        Environment(autoescape=True, trim_blocks=True)
        .from_string(_TEMPLATE)
        .render(
            policy=policy_for(),
            name=name,
            total=len(sets),
            vehicles=sets["vehicle"].nunique(),
            words=", ".join(f"{count} {word.replace('_', ' ')}" for word, count in sorted(words.items())),
            people=int((sets["person"] != "").sum()),
            figure=drawing(figure),
            history=drawing(history[1]) if history else "",
            events=history[0].to_dict("records") if history else [],
            counts=counts.to_dict("records"),
            fleet=fleet.to_dict("records"),
            looked=[row for row in rows if row["person"]],
            alone=[row for row in rows if not row["person"]],
        )
    )


def drawing(figure: Path) -> Markup:
    """An SVG file as it stands within a page."""
    text = figure.read_text(encoding="utf-8")
    return Markup(text[text.index("<svg") :])
