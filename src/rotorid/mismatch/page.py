"""The verdict as a page for a person: one HTML file that needs no other."""

from __future__ import annotations

import base64
import html
import math
import re
from collections.abc import Mapping, Sequence

import numpy as np
from jinja2 import Environment
from markupsafe import Markup

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.findings import Analysis, Finding, Trace
from rotorid.mismatch.improve import form_of
from rotorid.mismatch.locate import REGIME_BLOCK_S
from rotorid.mismatch.page_template import CSS, PAGE
from rotorid.mismatch.shares import fitted_part
from rotorid.mismatch.verdict import (
    Channel,
    EffectVerdict,
    Location,
    Verdict,
    main_channel,
    spoken,
)
from rotorid.mismatch.words import (
    FORWARD_WORDS,
    capital,
    channel_words,
    effect_words,
    listed,
    number,
    parameter_words,
    plus_minus,
    regime_words,
    sure,
)

WORDS = {
    "no_mismatch": "no mismatch",
    "explained": "mismatch, explained",
    "partly_explained": "mismatch, partly explained",
    "unexplained": "mismatch, unexplained",
}
MOST_LOCATIONS = 12
MOST_RUNS_IN_STRIP = 8
STRIP_CELLS = 400
NARROWEST = 0.03
"""Interval over plausible range below which the range is zoomed in."""
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def make_page(analysis: Analysis, verdict: Verdict, forward_notes: Sequence[str] = ()) -> str:
    """The page's HTML."""
    main = main_channel(analysis, verdict.locations, verdict.channels)
    environment = Environment(autoescape=True, trim_blocks=False)
    environment.globals.update(figure=figure_html, ranges=ranges_html)
    shown, more = shown_locations(verdict.locations)
    known = {e.id for e in verdict.effects} | {n.id for n in verdict.not_testable}
    silent = [effect_words(i) for i in catalogue() if i not in known]
    page = environment.from_string(PAGE).render(
        css=Markup(CSS),
        set=verdict.set,
        runs=runs_text(verdict),
        word=WORDS[verdict.verdict],
        word_class=verdict.verdict,
        sentence=pretty(verdict.sentence),
        hero=hero(analysis, verdict, main),
        where_text=where_text(verdict),
        strip=strip(analysis, verdict),
        regime=regime_figure(analysis, verdict, main),
        locations=[location_row(loc) for loc in shown],
        more_locations=more,
        what_text=what_text(verdict),
        effects=[
            effect_block(e, f)
            for e, f in zip(verdict.effects, analysis.findings, strict=True)
            if e.status in ("established", "ambiguous")
        ],
        values=[value_range(name, *v) for name, v in analysis.values.items()],
        better_text=better_text(verdict),
        gains=gains_figure(verdict),
        table=error_table(verdict.channels),
        rest=rest_text(verdict),
        ruled_out=[ruled_out(e) for e in verdict.effects if e.status in ("absorbed", "not_established")],
        silent=listed(silent),
        not_testable=[{"name": capital(effect_words(n.id)), "reason": n.reason} for n in verdict.not_testable],
        next=next_text(verdict),
        notes=notes(analysis, forward_notes),
    )
    return spoken(page, analysis)


def pretty(text: str) -> Markup:
    """Text as HTML with powers of ten and units set as they are printed: 5.1e-5 ± 0.2e-5 → (5.1 ± 0.2) × 10⁻⁵."""
    text = re.sub(
        r"(-?[\d.]+)e(-?\d+) ± ([\d.]+)e\2\b",
        lambda m: f"({m[1]} ± {m[3]}) × 10{m[2].translate(SUPERSCRIPTS)}",
        text,
    )
    text = re.sub(r"(\d)e([+-]?\d+)\b", lambda m: f"{m[1]} × 10{m[2].lstrip('+').translate(SUPERSCRIPTS)}", text)
    text = re.sub(r"(?<![\w])-(?=\d)", "−", text)
    return Markup(html.escape(unit_text(text), quote=False))


def subscripts(text: str) -> Markup:
    """`k_d,x` with what follows the underscore set low."""
    return Markup(re.sub(r"_([A-Za-z0-9⊥∥,]+)(?<!,)", r"<sub>\1</sub>", html.escape(text, quote=False)))


def unit_text(text: str) -> str:
    """Units with raised exponents: `N s2/(rad m)` → `N s²/(rad m)`."""
    return re.sub(r"\b(rad|kg|m|s|A|V|K)(-?\d)\b", lambda m: m[1] + m[2].translate(SUPERSCRIPTS), text)


def figure_html(shown: tuple[str, str, str] | None) -> Markup:
    """A figure from (svg, alternative text, caption); nothing for None."""
    if shown is None:
        return Markup("")
    picture, alternative, caption = shown
    data = base64.b64encode(picture.encode()).decode()
    return Markup(
        '<figure><img alt="{}" src="data:image/svg+xml;base64,{}"><figcaption>{}</figcaption></figure>'
    ).format(alternative, Markup(data), caption)


def ranges_html(rows: Sequence[Mapping]) -> Markup:
    """Table of parameters, each with its interval drawn on the range that is physically plausible."""
    if not rows:
        return Markup("")
    out = [Markup("<table>")]
    for row in rows:
        marks = Markup("")
        if row["scale"] is not None:
            low, high = row["scale"]

            def at(x, low=low, high=high):
                return f"{100 * min(max((x - low) / (high - low), 0.0), 1.0):.2f}%"

            first, last = row["interval"]
            wide = f"{100 * (min(max(last, low), high) - min(max(first, low), high)) / (high - low):.2f}%"
            belief = (
                Markup('<i class="belief" style="left:{}" title="believed"></i>').format(at(row["believed"]))
                if row["believed"] is not None
                else ""
            )
            marks = Markup(
                '<div class="range"><i class="track"></i><i class="band" style="left:{};width:{}"></i>{}'
                '<i class="dot" style="left:{}"></i></div><div class="ends"><span>{}</span><span>{}</span></div>'
            ).format(at(first), wide, belief, at(row["value"]), pretty(number(low)), pretty(number(high)))
        out.append(
            Markup('<tr><td><em>{}</em></td><td class="text">{}</td><td class="text">{}</td><td>{}</td></tr>').format(
                subscripts(row["symbol"]), pretty(row["meaning"]), pretty(row["text"]), marks
            )
        )
    return Markup("").join([*out, Markup("</table>")])


def runs_text(verdict: Verdict) -> str:
    held, training = verdict.runs.held_out, verdict.runs.training
    if set(held) == set(training):
        return f"one run, {training[0]}; its last third held out"
    return f"{len(training)} runs to fit, {len(held)} held out ({', '.join(held)})"


def _traces(analysis: Analysis, channel: str, run: str | None = None) -> list[Trace]:
    return [t for t in analysis.traces if t.channel == channel and run in (None, t.run)]


def _joined(traces: Sequence[Trace], name: str) -> np.ndarray:
    return np.concatenate([getattr(t, name) for t in traces])


def hero(analysis: Analysis, verdict: Verdict, main: str) -> tuple[str, str, str] | None:
    """Before and after of the main channel on the held-out run in which most is located."""
    from rotorid.plots import mismatch as plots

    if not main or not _traces(analysis, main):
        return None
    part = fitted_part(analysis)
    traces = _traces(analysis, main)
    held = [t for t in traces if np.any(part(t.run, t.time_s) < 0)] or traces

    def removed(trace):
        return float(np.nanmean(trace.before**2) - np.nanmean(trace.after**2))

    run = max(held, key=removed).run
    chosen = _traces(analysis, main, run)
    where = [(loc.start_s, loc.stop_s) for loc in verdict.locations if (loc.run, loc.channel) == (run, main)]
    channel = verdict.channels[main]
    picture = plots.svg(
        plots.before_and_after(
            _joined(chosen, "time_s"),
            _joined(chosen, "before"),
            _joined(chosen, "after"),
            channel.noise_floor,
            f"{channel_words(main)}, {run}",
            channel.unit,
            where if len(where) > 1 or verdict_is_partial(where, chosen) else (),
        )
    )
    kind = "a flight not used for fitting" if run in verdict.runs.held_out else "a flight that was fitted"
    caption = (
        f"Measured minus simulated {channel_words(main)} on {run}, {kind}. Faint: every sample; strong: mean over "
        "half a second; grey: two sigma of the sensors' own noise"
    )
    caption += "; tinted: where the mismatch was located." if where else "."
    return picture, f"error of the {channel_words(main)} before and after", caption


def verdict_is_partial(where, chosen: Sequence[Trace]) -> bool:
    """Whether intervals leave a visible part of a run untouched."""
    total = sum(float(t.time_s[-1] - t.time_s[0]) for t in chosen)
    return bool(where) and sum(b - a for a, b in where) < 0.9 * total


def where_text(verdict: Verdict) -> list[str]:
    if not verdict.locations:
        return ["Nowhere does the error rise above what the sensors' noise explains."]
    regimes = {}
    for loc in verdict.locations:
        if loc.regime is not None:
            regimes.setdefault(loc.channel, loc.regime)
    texts = []
    for channel, regime in regimes.items():
        name, unit = regime_words(regime.variable)
        span = f"{number(regime.low)} to {number(regime.high)} {unit}".strip()
        texts.append(f"{channel_words(channel)}: {name} {span}")
    first = f"The mismatch shows in {listed([channel_words(c) for c in dict.fromkeys(_channels(verdict))])}."
    return [first] + ([pretty(f"What separates it best: {'; '.join(texts)}.")] if texts else [])


def _channels(verdict: Verdict) -> list[str]:
    return [loc.channel for loc in verdict.locations]


def strip(analysis: Analysis, verdict: Verdict) -> tuple[str, str, str] | None:
    """Heat strip of every channel over every run."""
    from rotorid.plots import mismatch as plots

    channels = [c for c in verdict.channels if c not in FORWARD_WORDS and verdict.channels[c].noise_floor]
    runs = list(dict.fromkeys(t.run for t in analysis.traces))
    located_runs = dict.fromkeys(loc.run for loc in verdict.locations)
    shown = list(dict.fromkeys([*[r for r in runs if r in verdict.runs.held_out], *located_runs, *runs]))
    shown = [r for r in runs if r in shown[:MOST_RUNS_IN_STRIP]]
    if not channels or not shown:
        return None
    sizes = {}
    for trace in analysis.traces:
        if trace.run in shown and trace.channel in channels:
            noise = verdict.channels[trace.channel].noise_floor
            period = float(np.median(np.diff(trace.time_s)))
            per = max(int(plots.STRIP_CELL_S / period), len(trace.time_s) // STRIP_CELLS, 1)
            count = len(trace.time_s) // per
            for stage in ("before", "after"):
                size = np.sqrt(blocks(getattr(trace, stage) ** 2, per, count)) / noise
                key = (stage, trace.run, trace.channel)
                time_s = blocks(trace.time_s, per, count)
                if key in sizes:
                    time_s, size = np.append(sizes[key][0], time_s), np.append(sizes[key][1], size)
                sizes[key] = (time_s, size)
    located: dict[tuple[str, str], list] = {}
    for loc in verdict.locations:
        located.setdefault((loc.run, loc.channel), []).append((loc.start_s, loc.stop_s))
    labels = [channel_words(c) for c in channels]
    held = verdict.runs.held_out if verdict.runs.held_out != verdict.runs.training else ()
    picture = plots.svg(plots.heat_strip(channels, labels, shown, held, sizes, located))
    caption = "Error of each channel over the runs' time, in units of its noise. Black lines: where it was located."
    if len(shown) < len(runs):
        caption += f" {len(shown)} of {len(runs)} runs are shown."
    return picture, "error over noise by channel and time, before and after", caption


def blocks(values: np.ndarray, per: int, count: int) -> np.ndarray:
    """Means of `count` blocks of `per` samples."""
    return values[: count * per].reshape(count, per).mean(axis=1)


def regime_figure(analysis: Analysis, verdict: Verdict, main: str) -> tuple[str, str, str] | None:
    """Size of the error against the variable that separates it best."""
    from rotorid.plots import mismatch as plots

    regimes = [(loc.channel, loc.regime) for loc in verdict.locations if loc.regime is not None]
    if not regimes:
        return None
    channel, regime = next(((c, r) for c, r in regimes if c == main), regimes[0])
    values, before, after = [], [], []
    for trace in _traces(analysis, channel):
        known = analysis.regimes.get(trace.run, {})
        if regime.variable not in known:
            continue
        per = max(2, int(round(REGIME_BLOCK_S / float(np.median(np.diff(trace.time_s))))))
        count = len(trace.time_s) // per
        on_trace = np.interp(trace.time_s, known["time_s"], known[regime.variable])
        values.append(blocks(on_trace, per, count))
        before.append(np.sqrt(blocks(trace.before**2, per, count)))
        after.append(np.sqrt(blocks(trace.after**2, per, count)))
    if not values:
        return None
    name, unit = regime_words(regime.variable)
    shape = verdict.channels[channel]
    picture = plots.svg(
        plots.against_regime(
            np.concatenate(values),
            np.concatenate(before),
            np.concatenate(after),
            shape.noise_floor,
            f"{name} ({unit})" if unit else name,
            f"error, {channel_words(channel)} ({shape.unit})",
            (regime.low, regime.high),
        )
    )
    caption = (
        f"Size of the error of the {channel_words(channel)} against {name}; a dot is half a second of flight, lines "
        "are root mean squares by bin; tinted: the range in which the mismatch lies."
    )
    return picture, f"error against {name}", caption


def shown_locations(locations: Sequence[Location]) -> tuple[list[Location], str]:
    """The locations with most of the energy, in their order, and a word on the others."""
    if len(locations) <= MOST_LOCATIONS:
        return list(locations), ""
    kept = sorted(locations, key=lambda loc: -loc.energy_share)[:MOST_LOCATIONS]
    rest = len(locations) - MOST_LOCATIONS
    return [loc for loc in locations if loc in kept], f"{rest} more are in verdict.json."


def location_row(loc: Location) -> dict:
    regime = ""
    if loc.regime is not None:
        name, unit = regime_words(loc.regime.variable)
        regime = pretty(f"{name} {number(loc.regime.low)}–{number(loc.regime.high)} {unit}".strip())
    return {
        "channel": channel_words(loc.channel),
        "run": loc.run,
        "start": f"{loc.start_s:.1f}",
        "stop": f"{loc.stop_s:.1f}",
        "share": f"{100 * loc.energy_share:.0f} %",
        "regime": regime,
        "p": chance(loc.p_value),
    }


def chance(p_value: float | None) -> str:
    if p_value is None:
        return "–"
    return "< 0.001" if p_value < 1e-3 else f"{p_value:.3f}"


def what_text(verdict: Verdict) -> list[str]:
    at_work = [e for e in verdict.effects if e.status in ("established", "ambiguous")]
    if at_work or verdict.parameters:
        return []
    if verdict.verdict == "no_mismatch":
        return ["Nothing: the believed vehicle describes these recordings to within their noise."]
    return ["None of the known effects explains what was located."]


def effect_block(e: EffectVerdict, finding: Finding) -> dict:
    """One effect at work: name, equation, parameters on their plausible ranges, how sure, what else it could be."""
    effect = catalogue().get(e.id)
    form = form_of(finding)
    bounds = {p.symbol: p for p in form.parameters} if form else {}
    notes = [capital(sure(e.p_value)) + "." if e.p_value is not None else ""]
    if e.held_out_gain is not None and e.held_out_gain.rmse_ratio is not None:
        gain, (low, high) = e.held_out_gain.rmse_ratio, e.held_out_gain.interval_95
        between = f" (95 % interval {number(low)} to {number(high)})" if low is not None and high is not None else ""
        notes[0] += (
            f" On held-out flight the error of the {channel_words(e.channels[0]) if e.channels else 'main channel'} "
            f"is {number(gain)} times what it is without this effect{between}."
        )
    others = [effect_words(i) for i in e.alternatives if i != e.id]
    if others:
        notes.append(
            f"It could as well be {listed(others, 'or')}: these recordings cannot tell them apart; the model holds "
            f"{effect_words(e.id)} in the place of the class."
        )
    elif effect is not None and effect.confusers:
        notes.append(
            f"What is easily mistaken for it ({listed([effect_words(i) for i in effect.confusers])}) was tested beside "
            "it and does not explain these data as well."
        )
    if effect is not None and effect.source:
        notes.append(f"Source: {effect.source}.")
    return {
        "id": e.id,
        "name": capital(effect_words(e.id)),
        "status": e.status,
        "sentence": capital(e.sentence).rstrip(".") + "." if e.sentence else "",
        "equation": subscripts(e.equation),
        "parameters": [
            parameter_range(
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
    }


def parameter_range(symbol, value, unit, low, high, plausible=None, meaning="", believed=None) -> dict:
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
            if high - low > NARROWEST * (ends[1] - ends[0]):
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


def value_range(name: str, believed: float, refitted: float, low: float, high: float) -> dict:
    words, unit = parameter_words(name)
    row = parameter_range(words.rstrip(","), refitted, unit, low, high, believed=believed)
    return row | {"meaning": pretty(f"believed {number(believed, 4)} {unit}".strip())}


def better_text(verdict: Verdict) -> str:
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


def gains_figure(verdict: Verdict) -> tuple[str, str, str] | None:
    """Errors of every channel in units of its noise."""
    from rotorid.plots import mismatch as plots

    rows = {n: c for n, c in verdict.channels.items() if c.noise_floor}
    if not rows:
        return None
    held = any(c.rmse.held_out.after is not None for c in rows.values())

    def ratio(stage):
        picked = [getattr(c.rmse.held_out if held else c.rmse.training, stage) for c in rows.values()]
        return [
            np.nan if v is None or v <= 0 else v / c.noise_floor for v, c in zip(picked, rows.values(), strict=True)
        ]

    labels = [
        channel_words(n).removesuffix(" after half a second") + (" ½ s" if n in FORWARD_WORDS else "") for n in rows
    ]
    picture = plots.svg(plots.gains(labels, ratio("before"), ratio("refitted"), ratio("after")))
    kind = "held-out" if held else "fitted"
    caption = f"Error on {kind} flight beside the sensors' noise; ½ s: simulation run forward for half a second."
    return picture, "error over noise by channel", caption


def error_table(channels: Mapping[str, Channel]) -> list[dict]:
    """Rows of errors, inverse dynamics and simulation run forward apart."""
    groups = []
    for name, chosen in (
        ("inverse dynamics", [c for c in channels if c not in FORWARD_WORDS]),
        ("simulation run forward", [c for c in channels if c in FORWARD_WORDS]),
    ):
        rows = [
            {
                "name": channel_words(c).removesuffix(" after half a second"),
                "unit": unit_text(channels[c].unit),
                "noise": cell(channels[c].noise_floor),
                "held_out": [cell(getattr(channels[c].rmse.held_out, s)) for s in ("before", "refitted", "after")],
                "training": [cell(getattr(channels[c].rmse.training, s)) for s in ("before", "refitted", "after")],
            }
            for c in chosen
        ]
        if rows:
            groups.append({"name": name, "rows": rows})
    return groups


def cell(value: float | None) -> str | Markup:
    return "–" if value is None else pretty(number(value, 3))


def rest_text(verdict: Verdict) -> list[str]:
    rest = verdict.unexplained
    if verdict.verdict == "no_mismatch" or (rest.share <= 0 and not rest.description):
        return ["Nothing that stands out from the noise."]
    texts = [f"{100 * rest.share:.0f} % of the mismatch's energy is left by what was found."]
    if rest.channels:
        texts[0] += f" It is in {listed([channel_words(c) for c in rest.channels])}."
    if rest.depends_on:
        texts.append(f"It depends on {listed([regime_words(v)[0] for v in rest.depends_on])}.")
    return texts + ([pretty(rest.description)] if rest.description else [])


def ruled_out(e: EffectVerdict) -> Markup:
    name = effect_words(e.id)
    sentence = e.sentence or {"absorbed": "explained by the refitted values"}.get(e.status, "did not hold")
    if sentence.lower().startswith(name.lower()):
        return Markup("<strong>{}</strong>{}").format(capital(name), pretty(sentence[len(name) :]))
    return Markup("<strong>{}</strong>: {}").format(capital(name), pretty(sentence))


def next_text(verdict: Verdict) -> str:
    plan = verdict.next_experiment
    if not plan.manoeuvre:
        if verdict.verdict == "no_mismatch":
            return "Nothing is open. Faster, higher or rougher flight would show whether the model holds there too."
        return "Nothing is left to tell apart."
    text = capital(plan.manoeuvre).rstrip(".") + "."
    if plan.separates:
        text += f" It would tell {listed([effect_words(i) for i in plan.separates])} apart"
        sigma = plan.predicted_separation_sigma
        text += f", by about {number(sigma)} standard errors." if sigma else "."
    return text


def notes(analysis: Analysis, forward_notes: Sequence[str]) -> list[str]:
    source = {
        "accelerometer": "Forces come from the accelerometer.",
        "velocity": "No accelerometer is recorded: forces come from velocity and attitude, with the noise that costs.",
        "position": "Neither accelerometer nor velocity is recorded: forces come from position and attitude, with the "
        "noise that costs.",
    }.get(analysis.force_source)
    return [n for n in (source, *analysis.notes, *forward_notes) if n]
