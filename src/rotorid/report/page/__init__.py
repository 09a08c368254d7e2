"""The pages for a person, of a verdict and of a comparison: one HTML file each that needs no other."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import math
import re
import tempfile
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jinja2 import Environment
from markupsafe import Markup

from rotorid.effects.catalogue import catalogue
from rotorid.effects.describe import advice
from rotorid.mismatch.decide.findings import Analysis, Finding
from rotorid.mismatch.decide.words import (
    FORWARD_WORDS,
    capital,
    channel_words,
    effect_words,
    listed,
    number,
    parameter_words,
    percent,
    percent_words,
    plus_minus,
    regime_words,
    sure,
)
from rotorid.mismatch.deliver.files import form_of
from rotorid.mismatch.tell.steps import errors_of, steps_of, tiles, together, would_explain
from rotorid.mismatch.tell.verdict import Absent, Channel, EffectVerdict, Location, Verdict, main_channel, spoken
from rotorid.recordings import RecordingSet
from rotorid.report.page.data import page_data
from rotorid.report.page.strip import strip
from rotorid.report.plots.mismatch import draw_differences, draw_residuals, draw_values
from rotorid.steps import step
from rotorid.vehicle.derivatives import symbol_of

if TYPE_CHECKING:
    from rotorid.mismatch.changes.compare import Changes

_WORDS = {
    "no_mismatch": "no mismatch",
    "explained": "mismatch, explained",
    "partly_explained": "mismatch, partly explained",
    "unexplained": "mismatch, unexplained",
    "not_judged": "not judged",
}
_MOST_LOCATIONS = 12
_NARROWEST = 0.03
"""Interval over plausible range below which the range is zoomed in."""
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@cache
def page_file(name: str) -> str:
    """A file of the page: template, style, script, library."""
    return files("rotorid.report.page").joinpath("files", name).read_text(encoding="utf-8")


@step("drawing")
def make_page(
    analysis: Analysis, verdict: Verdict, forward_notes: Sequence[str] = (), ledger: Sequence[Mapping] = ()
) -> str:
    """The page's HTML. `ledger` holds the rules that decided something, each with a `sentence`."""
    main = main_channel(analysis, verdict.locations, verdict.channels)
    environment = Environment(autoescape=True, trim_blocks=False)
    environment.filters["exp"] = math.exp
    environment.filters |= {"place": _place, "pretty": pretty, "subscripts": _subscripts, "listed": listed}
    environment.filters |= {"unit": _unit_text, "number": number, "cell": _cell, "plus_minus": plus_minus}
    environment.filters |= {"channel": channel_words, "value": parameter_words, "regime": regime_words}
    environment.filters["effect"] = lambda id_: capital(effect_words(id_))
    environment.globals["symbol_of"] = symbol_of
    data = page_data(analysis, verdict, main)
    data["regimes"]["first"] = _first_variable(verdict, main, data["regimes"]["variables"])
    page = environment.from_string(page_file("page.html")).render(
        v=verdict,
        word=_WORDS[verdict.verdict],
        next=next_text(verdict, analysis.recordings),
        ledger=[_ledger_row(row) for row in ledger],
        notes=_notes(analysis, forward_notes),
        **_figures(data),
        **_at_the_top(verdict, main),
        **_what(verdict, analysis),
        **_where(verdict, analysis),
        **_better(verdict, data["fit_percent"]),
        **_not_found(verdict),
    )
    return spoken(page, analysis)


def _figures(data: Mapping) -> dict:
    """What the figures are drawn from, and which of them there are."""
    scripts = page_file("uPlot.iife.min.js"), page_file("page.js")
    return {
        "css": Markup(page_file("uPlot.min.css") + page_file("page.css")),
        "policy": _policy_for(*scripts),
        "library": Markup(scripts[0]),
        "script": Markup(scripts[1]),
        "data": _embedded(data),
        "has_figure": bool(data["traces"]),
        "has_regimes": bool(data["regimes"]["channels"]),
        "has_replay": data["replay"] is not None,
    }


def _at_the_top(verdict: Verdict, main: str) -> dict:
    """The section above all others."""
    return {"runs": _runs_text(verdict), "tiles": tiles(verdict, main), "steps": _step_rows(verdict)}


def _what(verdict: Verdict, analysis: Analysis) -> dict:
    """The section on what was left out, and the one on what is predictable without a name."""
    claimed = by_share([e for e in verdict.effects if e.status in ("established", "ambiguous")])
    suggested = [e for e in verdict.effects if e.status == "suggested"]
    return {
        "what_text": _what_text(verdict),
        "effects": [_effect_block(e, _finding_of(e, analysis)) for e in claimed],
        "suggested": [_effect_block(e, _finding_of(e, analysis)) for e in suggested],
        "values": [_value_range(name, *v) for name, v in analysis.values.items()],
        "correlated": _correlated_text(verdict),
        # Those first whose interval leaves out nothing.
        "derivatives": sorted(verdict.derivatives, key=lambda d: not (d.interval_95[0] > 0 or d.interval_95[1] < 0)),
        "quantities": _QUANTITY_WORDS,
        "causes": lambda d: [effect_words(i) for i in would_explain(d.channel, d.quantity, verdict)],
    }


def _where(verdict: Verdict, analysis: Analysis) -> dict:
    """The section on where it shows."""
    shown, more = _shown_locations(verdict.locations)
    strip_of = strip(analysis, verdict)
    return {"where_text": _where_text(verdict), "strip": strip_of, "locations": shown, "more_locations": more}


def _better(verdict: Verdict, fit_percent: Mapping[str, tuple[float, float]]) -> dict:
    """The section on how much better the improved vehicle is, and the one on what remains."""
    return {
        "models": _MODELS,
        "better_text": _better_text(verdict),
        "forward_text": _forward_text(verdict),
        "table": _error_table(verdict.channels, fit_percent),
        "rest": _rest_text(verdict),
    }


def _not_found(verdict: Verdict) -> dict:
    """The section on what was ruled out."""
    known = {row.id for row in (*verdict.effects, *verdict.not_testable, *verdict.absent)}
    known |= {i for e in verdict.effects for i in e.alternatives}
    flown = verdict.kind == "flight"
    silent = [effect_words(i) for i, e in catalogue().items() if i not in known and not (flown and e.of_the_rig)]
    return {
        "ruled_out": [_ruled_out(e) for e in verdict.effects if e.status in ("absorbed", "not_established")],
        "silent": listed(silent),
        "limits": [_limit_row(a) for a in verdict.absent],
    }


def _policy_for(*scripts: str) -> str:
    """Content security policy under which these scripts alone run, nothing is fetched and nothing sent.

    Without scripts none runs.
    """
    hashes = (base64.b64encode(hashlib.sha256(s.encode()).digest()).decode() for s in scripts)
    allowed = " ".join(f"'sha256-{h}'" for h in hashes) or "'none'"
    return (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; "
        "form-action 'none'"
    )


def filled(template: str, /, **values: object) -> str:
    """A page without scripts: a template of the page's files with its values."""
    environment = Environment(autoescape=True, trim_blocks=True)
    return environment.from_string(page_file(template)).render(policy=_policy_for(), **values)


def drawing(figure: Path) -> Markup:
    """An SVG file as it stands within a page."""
    text = figure.read_text(encoding="utf-8")
    return Markup(text[text.index("<svg") :])


def _embedded(data: Mapping) -> Markup:
    """Data as JSON that cannot end the script element that holds it, whatever names are in it."""
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    return Markup(text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026"))


def by_share(effects: Sequence[EffectVerdict]) -> list[EffectVerdict]:
    """The effects with the largest share of the gain first; in their order where no share is stated."""
    return sorted(effects, key=lambda e: -(getattr(e, "share", None) or 0.0))


def _limit_row(limit: Absent) -> dict[str, str]:
    """A row of the table of what was not found; `bar` is a share of the scale from 0.001 % to 100 % of the weight."""
    limit_decades = 5.0  # Decades below the weight that the bars of the limits show.
    share = limit.share_of_weight
    decades = 0.0 if not share else float(np.clip(1.0 + np.log10(share) / limit_decades, 0.0, 1.0))
    size = Markup("")
    if limit.at_most is not None:
        size = Markup("|{}| ≤ {}").format(
            _subscripts(limit.symbol), pretty(f"{number(limit.at_most)} {limit.unit}".removesuffix(" 1").strip())
        )
    return {
        "name": capital(effect_words(limit.id)),
        "size": size,
        "share": "" if not share else pretty(percent_words(share)),
        "bar": f"{100 * decades:.0f}",
    }


def _finding_of(effect: EffectVerdict, analysis: Analysis) -> Finding:
    """The finding behind an effect of the verdict."""
    same = [f for f in analysis.findings if f.id == effect.id]
    return next((f for f in same if f.status == effect.status), same[0])


def _first_variable(verdict: Verdict, main: str, known: Mapping[str, str]) -> str:
    """The variable that the regime figure opens with: the one that separates the mismatch best."""
    regimes = [(loc.channel, loc.regime.variable) for loc in verdict.locations if loc.regime is not None]
    ordered = [v for c, v in regimes if c == main] + [v for _, v in regimes]
    return next((v for v in ordered if v in known), next(iter(known), ""))


def _ledger_row(row: Mapping) -> Markup:
    """A rule of the ledger: its name, what it decided on and its sentence, with its numbers."""
    head = " ".join(str(row[k]) for k in ("rule", "on", "subject", "id") if row.get(k))
    numbers = row.get("numbers") or {}
    said = ", ".join(f"{k} {number(v, 3) if isinstance(v, float) else v}" for k, v in dict(numbers).items())
    tail = f" ({said})" if said else ""
    return Markup("<strong>{}</strong> {}{}").format(head, pretty(str(row.get("sentence", ""))), tail)


def pretty(text: str) -> Markup:
    """Text as HTML with powers of ten and units set as they are printed: 5.1e-5 ± 0.2e-5 → (5.1 ± 0.2) × 10⁻⁵."""
    text = re.sub(
        r"(-?[\d.]+)e(-?\d+) ± ([\d.]+)e\2\b", lambda m: f"({m[1]} ± {m[3]}) × 10{m[2].translate(_SUPERSCRIPTS)}", text
    )
    text = re.sub(r"(\d)e([+-]?\d+)\b", lambda m: f"{m[1]} × 10{str(int(m[2])).translate(_SUPERSCRIPTS)}", text)
    text = re.sub(r"(?<![\w])-(?=\d)", "−", text)
    return Markup(html.escape(_unit_text(text), quote=False))


def _subscripts(text: str) -> Markup:
    """`k_d,x` with what follows the underscore set low, `u^n` with the exponent set high."""
    low = re.sub(r"_([A-Za-z0-9⊥∥,]+)(?<!,)", r"<sub>\1</sub>", html.escape(text, quote=False))
    return Markup(re.sub(r"\^(\([^()]*\)|\w+)", r"<sup>\1</sup>", low))


def _unit_text(text: str) -> str:
    """Units with raised exponents: `N s2/(rad m)` → `N s²/(rad m)`."""
    return re.sub(r"\b(rad|kg|m|s|A|V|K)(-?\d)\b", lambda m: m[1] + m[2].translate(_SUPERSCRIPTS), text)


def _place(x: float, low: float, high: float) -> str:
    """Where a value lies on a range, in percent of its length."""
    return f"{100 * min(max((x - low) / (high - low), 0.0), 1.0):.2f}"


def _runs_text(verdict: Verdict) -> str:
    held, training = verdict.runs.held_out, verdict.runs.training
    if set(held) == set(training):
        return f"one run, {training[0]}; its last third held out"
    fitted = "1 run" if len(training) == 1 else f"{len(training)} runs"
    return f"{fitted} to fit, {len(held)} held out ({', '.join(held)})"


def _where_text(verdict: Verdict) -> list[str]:
    if not verdict.locations:
        return ["Nowhere does the error rise above what the sensors' noise explains."]
    regimes = {}
    for loc in verdict.locations:
        if loc.regime is not None:
            regimes.setdefault(loc.channel, loc.regime)
    texts = []
    for channel, regime in regimes.items():
        name, unit = regime_words(regime.variable, regime.either_sign)
        span = f"{number(regime.low)} to {number(regime.high)} {unit}".strip()
        texts.append(f"{channel_words(channel)}: {name} {span}")
    channels = dict.fromkeys(loc.channel for loc in verdict.locations)
    first = f"The mismatch shows in {listed([channel_words(channel) for channel in channels])}."
    return [first] + ([pretty(f"What separates it best: {'; '.join(texts)}.")] if texts else [])


def _shown_locations(locations: Sequence[Location]) -> tuple[list[Location], str]:
    """The locations with most of the energy, in their order, and a word on the others."""
    if len(locations) <= _MOST_LOCATIONS:
        return list(locations), ""
    kept = sorted(locations, key=lambda loc: -loc.energy_share)[:_MOST_LOCATIONS]
    rest = len(locations) - _MOST_LOCATIONS
    return [loc for loc in locations if loc in kept], f"{rest} more are in verdict.json."


def _what_text(verdict: Verdict) -> list[str]:
    at_work = [e for e in verdict.effects if e.status in ("established", "ambiguous")]
    if at_work or verdict.parameters:
        return []
    if verdict.verdict == "no_mismatch":
        return ["Nothing: the believed vehicle describes these recordings to within their noise."]
    return ["None of the known effects explains what was located."]


def _effect_block(e: EffectVerdict, finding: Finding) -> dict:
    """One effect at work: name, equation, parameters on their plausible ranges, how sure, what else it could be."""
    effect = catalogue().get(e.id)
    share = getattr(e, "share", None)
    form = form_of(finding)
    bounds = {p.symbol: p for p in form.parameters} if form else {}
    notes = [capital(sure(e.p_value)) + "." if e.p_value is not None else ""]
    if e.probability is not None:
        notes = [f"Probability {percent(e.probability)}."]
    if e.held_out_gain is not None and e.held_out_gain.rmse_ratio is not None:
        gain, (low, high) = e.held_out_gain.rmse_ratio, e.held_out_gain.interval_95
        between = f" (95 % interval {number(low)} to {number(high)})" if low is not None and high is not None else ""
        notes[0] += (
            f" On held-out flight the error of the {channel_words(e.channels[0]) if e.channels else 'main channel'} "
            f"is {number(gain)} times what it is without this effect{between}."
        )
        if low is not None and low > 1.0:
            notes[0] += " It is larger with it: the fitted flights state this effect, the held-out ones contradict it."
        elif high is not None and high >= 1.0:
            notes[0] += " The held-out flights do not confirm it."
    others = [effect_words(i) for i in e.alternatives if i != e.id]
    if others:
        notes.append(
            f"It could as well be {listed(others, 'or')}: these recordings cannot distinguish them; the model holds "
            f"{effect_words(e.id)} in the place of the class."
        )
    if e.size is not None and e.size.share is not None:
        off = e.size.metres_after_half_a_second
        metres = "" if off is None else f", {number(off)} m after half a second of simulation"
        notes.append(
            f"Where it does most it moves the {channel_words(e.size.channel)} by {number(e.size.rms)} {e.size.unit}"
            + f", {number(100 * e.size.share)} % of {e.size.of}{metres} (root mean square on held-out flight)."
        )
    if e.withheld:
        notes.append(f"Not delivered: {e.withheld}.")
    elif effect is not None and effect.confusers:
        notes.append(
            f"What is easily mistaken for it ({listed([effect_words(i) for i in effect.confusers])}) was tested "
            "jointly with it and does not explain these data as well."
        )
    if effect is not None and effect.source:
        notes.append(f"Source: {effect.source}.")
    return {
        "id": e.id,
        "name": capital(effect_words(e.id)),
        "status": e.status,
        "sentence": capital(e.sentence).rstrip(".") + "." if e.sentence else "",
        "equation": _subscripts(e.equation),
        "parameters": [
            _parameter_range(
                p.symbol,
                p.value,
                p.unit,
                *p.interval_95,
                plausible=(bounds[p.symbol].low, bounds[p.symbol].high) if p.symbol in bounds else None,
                meaning=bounds[p.symbol].meaning if p.symbol in bounds else "",
            )
            for p in e.parameters
        ],
        "notes": [n for n in notes if n],
        "share": None if share is None else f"{100 * share:.0f} %",
        "share_width": "" if share is None else f"{60 * min(max(share, 0.0), 1.0):.1f}%",
    }


def _parameter_range(symbol, value, unit, low, high, plausible=None, meaning="", believed=None) -> dict:
    """A parameter with its interval and the range to draw it on: the physical bounds where they are finite."""
    text = plus_minus(value, low, high) if value is not None else "not determined"
    unit = unit if unit not in ("-", "1") else ""
    known = all(x is not None and math.isfinite(x) for x in (value, low, high))
    scale = None
    if known and text != "not determined":
        reach = max(high - low, 1e-12 * abs(value), 1e-300)
        points = [value - 2 * reach, value + 2 * reach, low, high]
        points += [believed] if believed is not None else [0.0]
        first, last = min(points), max(points)
        if plausible is not None and any(map(math.isfinite, plausible)):
            ends = [b if math.isfinite(b) else e for b, e in zip(plausible, (first, last), strict=True)]
            bounds = f"plausible: {_bounds(*plausible)}"
            meaning = f"{meaning} ({bounds})" if meaning else bounds
            # Bounds so wide that the interval would be a hairline are stated, not drawn.
            if high - low > _NARROWEST * (ends[1] - ends[0]):
                first, last = ends
        scale = (first, last) if last > first else None
    return {
        "symbol": symbol,
        "meaning": meaning,
        "text": f"{text} {unit}".strip(),
        "value": value,
        "interval": (low, high),
        "scale": scale,
        "believed": believed,
    }


def _bounds(low: float, high: float) -> str:
    if not math.isfinite(high):
        return f"from {number(low)}"
    return f"to {number(high)}" if not math.isfinite(low) else f"{number(low)} to {number(high)}"


def _value_range(name: str, believed: float, refitted: float, low: float, high: float) -> dict:
    words, unit = parameter_words(name)
    row = _parameter_range(words.rstrip(","), refitted, unit, low, high, believed=believed)
    return row | {"meaning": pretty(f"believed {number(believed, 4)} {unit}".strip())}


def _correlated_text(verdict: Verdict) -> list[str]:
    """Sentences on the values of which little more than a ratio is known."""
    texts = []
    for pair in verdict.correlations:
        first, second = (parameter_words(n)[0] for n in pair.values)
        known = f"know little more than a ratio (correlation {pair.correlation:.3f})"
        texts.append(pretty(f"Of {first} and {second} these recordings {known}."))
    return texts


def _better_text(verdict: Verdict) -> str:
    if verdict.verdict == "no_mismatch":
        return "There is nothing to gain that these recordings could show."
    if verdict.kind != "flight":
        return (
            "“Refitted” has the same physics with its values re-estimated; “improved” adds the effects found. All "
            "compare the reading with what load, rotor speeds and weight predict."
        )
    return (
        "“Refitted” has the same physics with its values re-estimated; “improved” adds the effects found. Forces, "
        "moments and rotor speeds compare inverse dynamics; the others compare simulation run forward for half a "
        "second from the recorded state."
    )


def _error_table(channels: Mapping[str, Channel], fits: Mapping[str, tuple[float, float]]) -> list[dict]:
    """Rows of errors, inverse dynamics and simulation run forward apart; `fits` in per cent, before and after."""
    groups = []
    for name, chosen in (
        ("inverse dynamics", [c for c in channels if c not in FORWARD_WORDS]),
        ("simulation run forward", [c for c in channels if c in FORWARD_WORDS]),
    ):
        rows = [
            {
                "name": channel_words(c).removesuffix(" after half a second"),
                "unit": _unit_text(channels[c].unit),
                "noise": _cell(channels[c].noise_floor),
                "bars": _bars(channels[c]),
                "fit": pretty(" → ".join(f"{v:.0f}" for v in fits[c])) if c in fits else "–",
                "held_out": [_cell(getattr(channels[c].rmse.held_out, s)) for s in _STAGES],
                "training": [_cell(getattr(channels[c].rmse.training, s)) for s in _STAGES],
            }
            for c in chosen
        ]
        if rows:
            groups.append({"name": name, "rows": rows})
    return groups


_STAGES = ("before", "refitted", "named", "after")
_MODELS = {"believed": "as believed", "refitted": "values refitted", "named": "values and named physics"}


def _step_rows(verdict: Verdict) -> list[dict]:
    """A bar a channel: shares of its error, in percent of its length, that values, named physics and derivatives take
    off, noise, and what is left above it."""
    rows, steps = [], steps_of(verdict.channels, verdict.delivered.model)
    whole = together(steps)
    for name, s in {**steps, **({"all channels": whole} if whole else {})}.items():
        ends = np.minimum.accumulate(np.clip([1.0, s.values, s.named, s.delivered], 0.0, 1.0))
        noise = min(s.noise, ends[3])
        widths = [*(ends[:-1] - ends[1:]), ends[3] - noise, noise]
        rows.append(
            {
                "name": capital(channel_words(name)) if name in steps else "All, in the mean",
                "parts": [
                    {"kind": kind, "width": f"{100 * w:.1f}", "said": f"{words} {100 * w:.0f} %"}
                    for kind, words, w in zip(_STEP_KINDS, _STEP_WORDS, widths, strict=True)
                ],
                "worse": s.delivered > 1.0,
            }
        )
    return rows


_STEP_KINDS = ("values", "named", "derivatives", "left", "noise")
_STEP_WORDS = ("values take off", "named physics", "predictable, without a name", "left above the noise", "noise")


_QUANTITY_WORDS = {
    **{"u": "forward velocity", "v": "sideways velocity", "w": "downward velocity"},
    **{"p": "roll rate", "q": "pitch rate", "r": "yaw rate", "thrust": "thrust", "thrust_roll": "rolling thrust"},
    **{"thrust_pitch": "pitching thrust", "thrust_yaw": "thrust by spin", "speed": "rotor speed"},
}


def _bars(channel: Channel) -> Markup:
    """Errors as believed (open) and improved (full) next to the noise (line), on a logarithmic scale."""
    farthest = 100.0  # Error over noise at which the bar of the table of errors ends.
    errors, _ = errors_of(channel)
    if not channel.noise_floor or errors.before is None or errors.after is None:
        return Markup("")

    def at(value: float) -> float:
        ratio = min(max(value / channel.noise_floor, 0.5), farthest)
        return 6 + 100 * math.log(ratio / 0.5) / math.log(farthest / 0.5)

    return Markup(
        '<svg viewBox="0 0 112 14" role="img" aria-label="{}">'
        '<line x1="{n:.1f}" x2="{n:.1f}" y1="1" y2="13" stroke="currentColor" stroke-dasharray="2 2" opacity=".6"/>'
        '<line x1="{a:.1f}" x2="{b:.1f}" y1="7" y2="7" stroke="currentColor" opacity=".3"/>'
        '<circle cx="{b:.1f}" cy="7" r="4" fill="none" stroke="var(--before)" stroke-width="2"/>'
        '<circle cx="{a:.1f}" cy="7" r="4" fill="var(--after)"/></svg>'
    ).format(
        f"{number(errors.before / channel.noise_floor)} times the noise before, "
        f"{number(errors.after / channel.noise_floor)} after",
        n=at(channel.noise_floor),
        a=at(errors.after),
        b=at(errors.before),
    )


def _forward_text(verdict: Verdict) -> list[str]:
    """The simulation run forward in words: how far it drifts off within half a second."""
    parts = []
    for name, said in (("position", "the position"), ("velocity", "the velocity"), ("attitude", "the attitude"),
                       ("angular_velocity", "the body rates")):  # fmt: skip
        if name not in verdict.channels:
            continue
        channel = verdict.channels[name]
        errors, _ = errors_of(channel)
        if errors.before is not None and errors.after is not None:
            parts.append(f"{said} {number(errors.after)} {channel.unit} (believed: {number(errors.before)})")
    if not parts:
        return []
    return [
        pretty(f"Started from a recorded state and run for half a second, the improved vehicle misses {listed(parts)}.")
    ]


def _cell(value: float | None) -> str | Markup:
    return "–" if value is None else pretty(number(value, 3))


def _rest_text(verdict: Verdict) -> list[str]:
    rest = verdict.unexplained
    if verdict.verdict == "no_mismatch" or (rest.share <= 0 and not rest.description):
        return ["Nothing that stands out from the noise."]
    texts = [f"{100 * rest.share:.0f} % of the mismatch's energy is left by what was found."]
    if rest.channels:
        texts[0] += f" It is in {listed([channel_words(c) for c in rest.channels])}."
    if rest.depends_on:
        texts.append(f"It depends on {listed([regime_words(v)[0] for v in rest.depends_on])}.")
    return texts + ([pretty(rest.description)] if rest.description else [])


def _ruled_out(e: EffectVerdict) -> Markup:
    name = effect_words(e.id)
    sentence = e.sentence or {"absorbed": "explained by the refitted values"}.get(e.status, "did not hold")
    if sentence.lower().startswith(name.lower()):
        return Markup("<strong>{}</strong>{}").format(capital(name), pretty(sentence[len(name) :]))
    return Markup("<strong>{}</strong>: {}").format(capital(name), pretty(sentence))


def next_text(verdict: Verdict, recordings: RecordingSet) -> str:
    """What to do next, in words; it asks for no column that is recorded, and states no number that nobody computed."""
    plan = verdict.next_experiment
    if not plan.manoeuvre:
        open_questions = [e for e in verdict.effects if e.status in ("ambiguous", "suggested")]
        wanted = [catalogue()[i] for e in open_questions for i in (e.id, *e.alternatives) if i in catalogue()]
        flown = next((advice(w, recordings) for w in wanted if w.separating_manoeuvre), "")
        if flown:
            return f"{capital(flown).rstrip('.')}. It bears on {listed([effect_words(e.id) for e in open_questions])}."
        if verdict.unexplained.share > 0.15:
            depends = [regime_words(v)[0] for v in verdict.unexplained.depends_on]
            over = f" over {listed(depends)}" if depends else " over the range in which the error is large"
            return f"What is left has no name yet: repeat the flight with slow sweeps{over}, one at a time."
        if verdict.verdict == "no_mismatch":
            return "Nothing is open. Faster, higher or rougher flight would show whether the model holds there too."
        return "Nothing is left to distinguish."
    text = capital(plan.manoeuvre).rstrip(".") + "."
    if plan.separates:
        what = "flight" if verdict.kind == "flight" else "session"
        text += f" It is meant to distinguish {listed([effect_words(i) for i in plan.separates])}. "
        return Markup("{}<code>rotorid plan</code> says which {} within your limits does, if any, and how far.").format(
            text, what
        )
    return text


def _notes(analysis: Analysis, forward_notes: Sequence[str]) -> list[str]:
    source = {
        "accelerometer": "Forces come from the accelerometer.",
        "velocity": "No accelerometer is recorded: forces come from velocity and attitude, with the noise that costs.",
        "position": "Neither accelerometer nor velocity is recorded: forces come from position and attitude, with the "
        "noise that costs.",
    }.get(analysis.force_source)
    return [n for n in (source, *analysis.notes, *forward_notes) if n]


def make_changes_page(found: Changes) -> str:
    """The page of a comparison."""
    from rotorid.mismatch.changes import words
    from rotorid.mismatch.changes.words import level_one_sentences, quantity_words

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
        limits=[_changed_limit_row(limit) for limit in found.limits],
        residuals=_drawn(draw_residuals, found, {c: channel_words(c) for c in found.residuals[0]}),
    )


def _changed_limit_row(limit) -> dict[str, str]:
    """A limit's name, size and share of the weight, in words."""
    from rotorid.mismatch.changes import words

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
