"""The pages for a person, of a verdict and of a comparison: one HTML file each that needs no other."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import math
import re
import tempfile
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jinja2 import Environment
from markupsafe import Markup

from rotorid.effects.catalogue import catalogue
from rotorid.effects.describe import advice
from rotorid.mismatch.decide.findings import Analysis
from rotorid.mismatch.decide.status import CLAIMED
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
from rotorid.mismatch.tell.consistency import quoted
from rotorid.mismatch.tell.places import range_words
from rotorid.mismatch.tell.sentences import names_of, with_unit
from rotorid.mismatch.tell.steps import steps_of, tiles, together, would_explain
from rotorid.mismatch.tell.verdict import Channel, EffectVerdict, Location, Verdict, main_channel, spoken
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
    data = page_data(analysis, verdict, main)
    data["regimes"]["first"] = _first_variable(verdict, main, data["regimes"]["variables"])
    page = filled(
        "page.html",
        ("uPlot.iife.min.js", "page.js"),
        v=verdict,
        analysis=analysis,
        main=main,
        data=data,
        word=_WORDS[verdict.verdict],
        claimed=by_share([e for e in verdict.effects if e.status in CLAIMED]),
        suggested=[e for e in verdict.effects if e.status == "suggested"],
        ruled_out=[e for e in verdict.effects if e.status in ("absorbed", "not_established")],
        # Those first whose interval leaves out nothing.
        derivatives=sorted(verdict.derivatives, key=lambda d: not (d.interval_95[0] > 0 or d.interval_95[1] < 0)),
        ledger=ledger,
        notes=_notes(analysis, forward_notes),
    )
    return spoken(page, analysis)


@cache
def _environment() -> Environment:
    """What the templates know: how numbers and names are set, and who writes the sentences of a section."""
    made = Environment(autoescape=True)
    made.filters |= {"place": _place, "pretty": pretty, "subscripts": _subscripts, "names": names_of, "exp": math.exp}
    made.filters |= {"unit": _unit_text, "number": number, "cell": _cell, "plus_minus": plus_minus}
    made.filters |= {"channel": channel_words, "value": parameter_words, "regime": regime_words}
    made.filters |= {"effect": lambda id_: capital(effect_words(id_)), "sentence": _sentence, "embedded": _embedded}
    sections = (_runs_text, _step_rows, _parameters, _effect_notes, _values, _where_text, _shown_locations)
    sections += (_forward_text, _by_method, _bars, _rest_text, _ruled_out_text, _silent, _limit_bar, _ledger_row)
    sections += (page_file, tiles, strip, next_text, symbol_of, would_explain, percent_words, with_unit)
    made.globals |= {writer.__name__.removeprefix("_"): writer for writer in sections}
    made.globals |= {"models": _MODELS, "quantities": _QUANTITY_WORDS}
    return made


def _policy_for(scripts: Sequence[str]) -> str:
    """Content security policy under which these scripts alone run, nothing is fetched and nothing sent.

    Without scripts none runs.
    """
    hashes = (base64.b64encode(hashlib.sha256(s.encode()).digest()).decode() for s in scripts)
    allowed = " ".join(f"'sha256-{h}'" for h in hashes) or "'none'"
    return (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; "
        "form-action 'none'"
    )


def filled(template: str, scripts: Sequence[str] = (), /, **values: object) -> str:
    """A page: a template of the page's files with its values; of scripts it runs these files alone."""
    texts = [page_file(name) for name in scripts]
    policy, scripts = _policy_for(texts), [Markup(text) for text in texts]
    return _environment().from_string(page_file(template)).render(policy=policy, scripts=scripts, **values)


def drawing(figure: Path) -> Markup:
    """An SVG file as it stands within a page."""
    text = figure.read_text(encoding="utf-8")
    return Markup(text[text.index("<svg") :])


def drawn(draw: Callable[..., None], *what: object) -> Markup:
    """A figure as SVG within a page; `draw` takes what is to be drawn, and the file's path."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "figure.svg"
        draw(*what, path)
        return drawing(path)


def _embedded(data: Mapping) -> Markup:
    """Data as JSON that cannot end the script element that holds it, whatever names are in it."""
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    return Markup(text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026"))


def by_share(effects: Sequence[EffectVerdict]) -> list[EffectVerdict]:
    """The effects with the largest share of the gain first; in their order where no share is stated."""
    return sorted(effects, key=lambda e: -(e.share or 0.0))


def _limit_bar(share: float | None) -> str:
    """A limit as a part of the scale from 0.001 % to 100 % of the weight, in percent."""
    limit_decades = 5.0  # Decades below the weight that the bars of the limits show.
    return f"{100 * (np.clip(1.0 + np.log10(share) / limit_decades, 0.0, 1.0) if share else 0.0):.0f}"


def _silent(verdict: Verdict) -> str:
    """Names of the effects that a verdict says nothing of; what only a rig can have is not looked for in flights."""
    known = {row.id for row in (*verdict.effects, *verdict.not_testable, *verdict.absent)}
    known |= {i for e in verdict.effects for i in e.alternatives}
    flown = verdict.kind == "flight"
    return names_of(i for i, e in catalogue().items() if i not in known and not (flown and e.of_the_rig))


def _first_variable(verdict: Verdict, main: str, known: Mapping[str, str]) -> str:
    """The variable that the regime figure opens with: the one that separates the mismatch best."""
    regimes = [(loc.channel, loc.regime.variable) for loc in verdict.locations if loc.regime is not None]
    ordered = [v for c, v in regimes if c == main] + [v for _, v in regimes]
    return next((v for v in ordered if v in known), next(iter(known), ""))


def _ledger_row(row: Mapping) -> Markup:
    """A rule of the ledger: its name, what it decided on and its sentence, with its numbers."""
    said = ", ".join(f"{k} {number(v, 3) if isinstance(v, float) else v}" for k, v in row["numbers"].items())
    tail = f" ({said})" if said else ""
    return Markup("<strong>{} {}</strong> {}{}").format(row["rule"], row["on"], pretty(row["sentence"]), tail)


def _sentence(text: str) -> str:
    """A text as a sentence; nothing stays nothing."""
    return capital(text).rstrip(".") + "." if text else ""


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
    texts = [f"{channel_words(channel)}: {range_words(regime)}" for channel, regime in regimes.items()]
    channels = dict.fromkeys(loc.channel for loc in verdict.locations)
    first = f"The mismatch shows in {listed([channel_words(channel) for channel in channels])}."
    return [first] + ([pretty(f"What separates it best: {'; '.join(texts)}.")] if texts else [])


def _shown_locations(locations: Sequence[Location]) -> list[Location]:
    """The locations with most of the energy, in their order."""
    kept = sorted(locations, key=lambda loc: -loc.energy_share)[:_MOST_LOCATIONS]
    return [loc for loc in locations if loc in kept]


def _effect_notes(e: EffectVerdict) -> list[str]:
    """How sure an effect at work is, what else it could be, how much it does, and where it is published."""
    effect = catalogue().get(e.id)
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
    if others := [i for i in e.alternatives if i != e.id]:
        notes.append(
            f"It could as well be {names_of(others, 'or')}: these recordings cannot distinguish them; the model holds "
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
            f"What is easily mistaken for it ({names_of(effect.confusers)}) was tested "
            "jointly with it and does not explain these data as well."
        )
    if effect is not None and effect.source:
        notes.append(f"Source: {effect.source}.")
    return [n for n in notes if n]


def _parameters(e: EffectVerdict, analysis: Analysis) -> list[dict]:
    """An effect's parameters on their plausible ranges."""
    same = [f for f in analysis.findings if f.id == e.id]
    form = form_of(next((f for f in same if f.status == e.status), same[0]))
    bounds = {p.symbol: (p.meaning, (p.low, p.high)) for p in form.parameters} if form else {}
    return [
        _parameter_range(p.symbol, p.value, p.unit, *p.interval_95, *bounds.get(p.symbol, ())) for p in e.parameters
    ]


def _parameter_range(symbol, value, unit, low, high, meaning="", plausible=None, believed=None) -> dict:
    """A parameter with its interval and the range to draw it on: the physical bounds where they are finite."""
    text = plus_minus(value, low, high) if value is not None else "not determined"
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
        "text": with_unit(text, unit),
        "value": value,
        "interval": (low, high),
        "scale": scale,
        "believed": believed,
    }


def _bounds(low: float, high: float) -> str:
    if not math.isfinite(high):
        return f"from {number(low)}"
    return f"to {number(high)}" if not math.isfinite(low) else f"{number(low)} to {number(high)}"


def _values(analysis: Analysis) -> list[dict]:
    """The values to correct, next to what was believed."""
    rows = []
    for name, (believed, refitted, low, high) in analysis.values.items():
        words, unit = parameter_words(name)
        before = f"believed {with_unit(number(believed, 4), unit)}"
        row = _parameter_range(words.rstrip(","), refitted, unit, low, high, believed=believed)
        rows.append(row | {"meaning": pretty(before)})
    return rows


def _by_method(channels: Mapping[str, Channel]) -> list[tuple[str, dict[str, Channel]]]:
    """Channels by what they are compared by: inverse dynamics, or simulation run forward."""
    groups: dict[str, dict[str, Channel]] = {"inverse dynamics": {}, "simulation run forward": {}}
    for name, channel in channels.items():
        groups["simulation run forward" if name in FORWARD_WORDS else "inverse dynamics"][name] = channel
    return [(method, own) for method, own in groups.items() if own]


_AFTER = " after half a second"
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
    errors = quoted(channel)
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
    for name in filter(verdict.channels.__contains__, FORWARD_WORDS):
        channel, said = verdict.channels[name], FORWARD_WORDS[name].removesuffix(_AFTER)
        errors = quoted(channel)
        if errors.before is not None and errors.after is not None:
            parts.append(f"the {said} {number(errors.after)} {channel.unit} (believed: {number(errors.before)})")
    said = f"Started from a recorded state and run for half a second, the improved vehicle misses {listed(parts)}."
    return [pretty(said)] if parts else []


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


def _ruled_out_text(e: EffectVerdict) -> Markup:
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
            return f"{_sentence(flown)} It bears on {listed([effect_words(e.id) for e in open_questions])}."
        if verdict.unexplained.share > 0.15:
            depends = [regime_words(v)[0] for v in verdict.unexplained.depends_on]
            over = f" over {listed(depends)}" if depends else " over the range in which the error is large"
            return f"What is left has no name yet: repeat the flight with slow sweeps{over}, one at a time."
        if verdict.verdict == "no_mismatch":
            return "Nothing is open. Faster, higher or rougher flight would show whether the model holds there too."
        return "Nothing is left to distinguish."
    text = _sentence(plan.manoeuvre)
    if plan.separates:
        what = "flight" if verdict.kind == "flight" else "session"
        text += f" It is meant to distinguish {names_of(plan.separates)}. "
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
        quantities="" if seen is None else drawn(draw_differences, found, names),
        changes=sentences[: max(1, len(found.changes)) + len(words.advice(found))],
        notes=found.notes,
        whole=words.WHOLE[found.kind],
        left="What each believed vehicle leaves" if flown else "Reading less load",
        measured="Measured less simulated force and moment" if flown else "Reading less the load that is believed",
        values=drawn(draw_values, found, {p.symbol: words.name_words(p.symbol) for p in found.values}),
        limits=[_changed_limit_row(limit) for limit in found.limits],
        residuals=drawn(draw_residuals, found, {c: channel_words(c) for c in found.residuals[0]}),
    )


def _changed_limit_row(limit) -> dict[str, str]:
    """A limit's name, size and share of the weight, in words."""
    from rotorid.mismatch.changes import words

    row = {"name": capital(words.name_words(limit.id)), "at_most": "", "share": ""}
    if limit.id in words.VALUES:
        return row | {"at_most": percent_words(limit.at_most)}
    size = "" if limit.at_most is None else f"{limit.symbol} {number(limit.at_most)} {limit.unit}"
    return row | {"at_most": size, "share": percent_words(limit.share) if limit.share else ""}
