"""The verdict on a recording set: a typed model of `verdict.json` and how it follows from an analysis.

The JSON schema in `workflow/schemas/verdict.schema.json` is generated from this model
(`python -m rotorid.mismatch.verdict --write-schema`). A number that is not known is written as null.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from rotorid.mismatch.findings import Analysis, Estimate, Finding, Trace
from rotorid.mismatch.shares import fitted_part
from rotorid.mismatch.words import (
    capital,
    channel_words,
    effect_words,
    listed,
    number,
    on_the_ground,
    parameter_words,
    plus_minus,
    regime_words,
    sure,
)

SCHEMA_PATH = Path(__file__).parents[3] / "workflow" / "schemas" / "verdict.schema.json"
SIGNIFICANT_DIGITS = 6
EXPLAINED_SHARE = 0.15
"""Up to this share of the mismatch's energy may be left for the word `explained`."""
UNEXPLAINED_SHARE = 0.85
"""From this share on the findings are said to explain nothing that matters."""
OFF_SHARE = 0.05
"""Without findings, a share left below this is no mismatch."""
SMALLEST_P = 1e-300


def _rounded(value: float | None) -> float | None:
    """To six significant digits; what is not a finite number becomes null."""
    if value is None or not math.isfinite(value):
        return None
    return float(f"{float(value):.{SIGNIFICANT_DIGITS - 1}e}")


Number = Annotated[float | None, BeforeValidator(_rounded)]
Probability = Annotated[Annotated[float, Field(ge=0, le=1)] | None, BeforeValidator(_rounded)]
Share = Annotated[float, BeforeValidator(_rounded), Field(ge=0, le=1)]
Magnitude = Annotated[Annotated[float, Field(ge=0)] | None, BeforeValidator(_rounded)]
Interval = tuple[Number, Number]


class Part(BaseModel):
    """A group of keys of the verdict: none unknown, none missing."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Runs(Part):
    """Runs used to fit and runs held out."""

    training: tuple[str, ...]
    held_out: tuple[str, ...]


class Errors(Part):
    """Root mean square error with believed values, with values refitted, and with the established effects."""

    before: Magnitude
    refitted: Magnitude
    after: Magnitude


class SplitErrors(Part):
    """Errors on the runs of each kind; null where there is none."""

    training: Errors
    held_out: Errors


class PValues(Part):
    """p-value that the residual does not depend on the inputs; null for simulation run forward."""

    before: Probability
    after: Probability


class Channel(Part):
    """One channel's errors beside its noise, in its unit."""

    unit: str
    noise_floor: Magnitude
    rmse: SplitErrors
    p_value: PValues


class Regime(Part):
    """Range of a variable in which the mismatch shows."""

    variable: str
    low: Number
    high: Number


class Location(Part):
    """Where the mismatch shows: a channel of a run, from when to when, in which regime."""

    run: str
    channel: str
    start_s: Number
    stop_s: Number
    p_value: Probability
    energy_share: Share = Field(description="Share of the channel's mismatch energy in this run that lies here.")
    regime: Regime | None


class ParameterEstimate(Part):
    """A parameter of an effect with its 95 % interval."""

    symbol: str
    value: Number
    unit: str
    interval_95: Interval


class Gain(Part):
    """Held-out rmse with the effect over that without it, block-bootstrap interval."""

    rmse_ratio: Magnitude
    interval_95: Interval


class EffectVerdict(Part):
    """What the data say of one id."""

    id: str
    status: Literal["established", "ambiguous", "absorbed", "not_established"]
    alternatives: tuple[str, ...]
    sentence: str
    equation: str
    channels: tuple[str, ...]
    parameters: tuple[ParameterEstimate, ...]
    p_value: Probability
    held_out_gain: Gain | None


class WrongValue(Part):
    """A value of vehicle.yaml that the data contradict."""

    believed: Number
    refitted: Number
    interval_95: Interval


class NotTestable(Part):
    """An id that no column of the recording allows to test."""

    id: str
    reason: str


class Unexplained(Part):
    """What the findings leave."""

    share: Share
    channels: tuple[str, ...]
    depends_on: tuple[str, ...]
    description: str


class NextExperiment(Part):
    """What to fly to tell the alternatives apart; empty where nothing is open."""

    manoeuvre: str
    separates: tuple[str, ...]
    predicted_separation_sigma: Magnitude


class Verdict(Part):
    """The whole of `verdict.json`."""

    set: str
    kind: Literal["flight", "stand", "bench"]
    runs: Runs
    verdict: Literal["no_mismatch", "explained", "partly_explained", "unexplained"]
    sentence: str
    channels: dict[str, Channel]
    locations: tuple[Location, ...]
    effects: tuple[EffectVerdict, ...]
    parameters: dict[str, WrongValue]
    not_testable: tuple[NotTestable, ...]
    unexplained: Unexplained
    next_experiment: NextExperiment

    def text(self) -> str:
        """The file's text."""
        return json.dumps(self.model_dump(mode="json"), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def schema_text() -> str:
    """The JSON schema of `verdict.json` as text."""
    return json.dumps(Verdict.model_json_schema(), indent=1, sort_keys=True) + "\n"


def make_verdict(analysis: Analysis, locations: Sequence[Location], forward: Mapping[str, Channel]) -> Verdict:
    """The verdict that an analysis, its locations and the simulation run forward amount to."""
    channels = inverse_channels(analysis) | dict(forward)
    word = verdict_word(analysis, locations)
    return Verdict(
        set=analysis.recordings.name,
        kind=analysis.recordings.vehicle.kind,
        runs=Runs(training=analysis.split.training, held_out=analysis.split.held_out),
        verdict=word,
        sentence=spoken(plain_sentence(analysis, word, locations, channels), analysis),
        channels=channels,
        locations=tuple(locations),
        effects=tuple(effect_verdict(f) for f in analysis.findings),
        parameters={
            name: WrongValue(believed=believed, refitted=refitted, interval_95=(low, high))
            for name, (believed, refitted, low, high) in analysis.values.items()
        },
        not_testable=tuple(NotTestable(id=i, reason=r) for i, r in sorted(analysis.not_testable.items())),
        unexplained=Unexplained(
            share=float(np.clip(np.nan_to_num(analysis.unexplained_share), 0.0, 1.0)),
            channels=analysis.unexplained_channels,
            depends_on=analysis.unexplained_depends_on,
            description=analysis.unexplained_description,
        ),
        next_experiment=NextExperiment(
            manoeuvre=analysis.next_manoeuvre,
            separates=analysis.next_separates,
            predicted_separation_sigma=analysis.next_sigma,
        ),
    )


def spoken(text: str, analysis: Analysis) -> str:
    """A text about flights as it is said of this kind of set."""
    return text if analysis.recordings.vehicle.kind == "flight" else on_the_ground(text)


def inverse_channels(analysis: Analysis) -> dict[str, Channel]:
    """Errors of every channel that the traces hold, by inverse dynamics."""
    found, part = {}, fitted_part(analysis)
    for channel in dict.fromkeys(t.channel for t in analysis.traces):
        traces = [t for t in analysis.traces if t.channel == channel]
        before, after = analysis.p_values.get(channel, (None, None))
        masks = [part(t.run, t.time_s) for t in traces]
        found[channel] = Channel(
            unit=traces[0].unit,
            noise_floor=analysis.noise_floor.get(channel),
            rmse=SplitErrors(
                training=_errors(traces, [m > 0 for m in masks]), held_out=_errors(traces, [m < 0 for m in masks])
            ),
            p_value=PValues(before=before, after=after),
        )
    return found


def _errors(traces: Sequence[Trace], masks: Sequence[np.ndarray]) -> Errors:
    return Errors(
        **{
            stage: rms([getattr(t, stage)[mask] for t, mask in zip(traces, masks, strict=True)])
            for stage in Errors.model_fields
        }
    )


def rms(parts: Sequence[np.ndarray]) -> float:
    """Root mean square over stretches, missing samples left out; NaN where nothing is there."""
    values = np.concatenate([np.ravel(p) for p in parts]) if parts else np.zeros(0)
    values = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(values**2))) if len(values) else math.nan


def effect_verdict(finding: Finding) -> EffectVerdict:
    """One entry under `effects`."""
    return EffectVerdict(
        id=finding.id,
        status=finding.status,
        alternatives=finding.alternatives,
        sentence=finding.sentence,
        equation=finding.equation or (finding.form.equation if finding.form else ""),
        channels=finding.channels,
        parameters=tuple(
            ParameterEstimate(symbol=e.symbol, value=e.value, unit=e.unit, interval_95=(e.low, e.high))
            for e in finding.parameters
        ),
        p_value=finding.p_value,
        held_out_gain=None
        if finding.gain is None
        else Gain(rmse_ratio=finding.gain[0], interval_95=(finding.gain[1], finding.gain[2])),
    )


def with_status(analysis: Analysis, *statuses: str) -> list[Finding]:
    """Findings of these statuses, the surest first."""
    return sorted((f for f in analysis.findings if f.status in statuses), key=lambda f: f.p_value)


def verdict_word(analysis: Analysis, locations: Sequence[Location]) -> str:
    """One of the four words, from what was found and the share that is left."""
    found = with_status(analysis, "established", "ambiguous") or analysis.wrong_values
    share = analysis.unexplained_share
    if not found:
        return "unexplained" if share > OFF_SHARE or locations else "no_mismatch"
    if share <= EXPLAINED_SHARE:
        return "explained"
    return "partly_explained" if share < UNEXPLAINED_SHARE else "unexplained"


def plain_sentence(
    analysis: Analysis, word: str, locations: Sequence[Location], channels: Mapping[str, Channel]
) -> str:
    """What a pilot is told: where, how much, what was left out, with which numbers, and how much better it gets."""
    if word == "no_mismatch":
        return _agreement(analysis, channels)
    established = with_status(analysis, "established")
    claimed_else = analysis.wrong_values or with_status(analysis, "ambiguous")
    if word == "explained" and not claimed_else and all(_concerns_the_recording(f) for f in established):
        said = [capital(f.sentence.rstrip(".")) + "." for f in established]
        return " ".join([*said, _agreement(analysis, channels, "Apart from that the believed vehicle")])
    main = main_channel(analysis, locations, channels)
    parts = [_where(main, locations, channels, analysis)]
    parts += [_left_out(f, k == 0) for k, f in enumerate(established)]
    parts += [_either(f, analysis) for f in one_per_class(with_status(analysis, "ambiguous"))]
    parts += [_wrong(name, values, analysis.instead.get(name, ())) for name, values in analysis.values.items()]
    if with_status(analysis, "established", "ambiguous") or analysis.wrong_values:
        parts.append(_better(main, channels, analysis.put_right))
    if word != "explained":
        parts.append(_rest(analysis, locations))
    return " ".join(p for p in parts if p)


def _concerns_the_recording(finding: Finding) -> bool:
    """Whether a finding is a fault of the recording itself, put right before any physics was looked at."""
    return finding.form is None and not finding.equation and bool(finding.sentence)


def one_per_class(findings: Sequence[Finding]) -> list[Finding]:
    """The surest of each class of alternatives."""
    kept, seen = [], set()
    for finding in findings:
        members = frozenset(finding.alternatives) | {finding.id}
        if not members & seen:
            kept.append(finding)
        seen |= members
    return kept


def main_channel(analysis: Analysis, locations: Sequence[Location], channels: Mapping[str, Channel]) -> str:
    """The channel in which the mismatch stands out most: its error before over its noise.

    Of the channels of what was named; without any, of those that are left unexplained; else of those located.
    """
    inverse = [t.channel for t in analysis.traces]
    named = [c for f in with_status(analysis, "established", "ambiguous") for c in f.channels if c in channels]
    left = [] if analysis.wrong_values else [c for c in analysis.unexplained_channels if c in channels]
    pool = named or left or [loc.channel for loc in locations if loc.channel in channels] or inverse

    def excess(name):
        errors = channels[name].rmse.training
        before, after = errors.before or 0.0, errors.after or 0.0
        removed = math.sqrt(max(before**2 - after**2, 0.0)) if named or analysis.wrong_values else before
        return removed / max(channels[name].noise_floor or after or 1e-12, 1e-12)

    return max(dict.fromkeys(pool), key=excess) if pool else ""


def _either_split(channel: Channel) -> tuple[Errors, str]:
    """Errors to quote: of runs held out where there are any."""
    if channel.rmse.held_out.after is not None:
        return channel.rmse.held_out, "on flights not used for fitting"
    return channel.rmse.training, "on the flight it was fitted to"


def _where(main: str, locations: Sequence[Location], channels: Mapping[str, Channel], analysis: Analysis) -> str:
    if not main:
        return ""
    here = [loc for loc in locations if loc.channel == main]
    errors, _ = _either_split(channels[main])
    off = f"the {channel_words(main)} is {number(errors.before)} {channels[main].unit} off"
    if not here:
        return capital(off) + "."
    best = min(here, key=lambda loc: loc.p_value if loc.p_value is not None else 1.0)
    doubt = f" ({sure(best.p_value if best.p_value is not None else 1.0)})"
    return capital(f"{_when(best, here, analysis)}{off}{doubt}.")


def _when(best: Location, here: Sequence[Location], analysis: Analysis) -> str:
    """Lead-in that says in which regime, else at what time, the mismatch shows."""
    regime = best.regime
    if regime is not None and regime.variable != "time_s" and regime.low is not None and regime.high is not None:
        name, unit = regime_words(regime.variable)
        space = f" {unit}" if unit else ""
        flown = np.concatenate([r[regime.variable] for r in analysis.regimes.values() if regime.variable in r])
        to_the_end = regime.high >= np.nanquantile(flown, 0.98)
        from_the_start = regime.low <= np.nanquantile(flown, 0.02)
        if from_the_start and not to_the_end:
            return f"up to {number(regime.high)}{space} of {name}, "
        if to_the_end and not from_the_start:
            return f"from {number(regime.low)}{space} of {name} on, "
        if not to_the_end:
            return f"between {number(regime.low)} and {number(regime.high)}{space} of {name}, "
        return ""
    if best.energy_share < 0.99 and best.start_s is not None and best.stop_s is not None:
        more = f" (and in {len(here) - 1} more stretches)" if len(here) > 1 else ""
        return f"from {best.start_s:.1f} to {best.stop_s:.1f} s of {best.run}{more}, "
    return ""


def _parameters(finding: Finding) -> str:
    shown = [
        f"{e.symbol} = {plus_minus(e.value, e.low, e.high)}{' ' + e.unit if e.unit not in ('', '-', '1') else ''}"
        for e in surest(finding.parameters)
    ]
    return listed(shown)


def surest(parameters: Sequence[Estimate], most: int = 3) -> list[Estimate]:
    """The parameters that are furthest from zero beside their intervals, in their order."""

    def beyond(e: Estimate) -> float:
        width = e.high - e.low
        return abs(e.value) / max(width, 1e-12 * abs(e.value), 1e-300) if np.isfinite(width) else 0.0

    kept = sorted(range(len(parameters)), key=lambda k: -beyond(parameters[k]))[:most]
    return [parameters[k] for k in sorted(kept)]


def _left_out(finding: Finding, first: bool) -> str:
    named = effect_words(finding.id)
    sentence = finding.sentence.rstrip(".")
    clause = f"{capital(named)} {'was' if first else 'too was'} left out"
    text = f"{clause}: {sentence}" if sentence else clause
    parameters = _parameters(finding)
    return f"{text} ({parameters})." if parameters else f"{text}."


def _either(finding: Finding, analysis: Analysis) -> str:
    names = [effect_words(i) for i in dict.fromkeys((finding.id, *finding.alternatives))]
    text = f"{capital('either ' if len(names) > 1 else '')}{listed(names, 'or')} was left out"
    text += "; this recording cannot tell which" if len(names) > 1 else "; this recording cannot settle it"
    # The next experiment is made for one class; it need not help with another.
    helps = analysis.next_manoeuvre and (not analysis.next_separates or finding.id in analysis.next_separates)
    return f"{text}, but this would: {analysis.next_manoeuvre.rstrip('.')}." if helps else f"{text}."


def _wrong(name: str, values: tuple[float, float, float, float], instead: Sequence[str] = ()) -> str:
    believed, refitted, low, high = values
    words, unit = parameter_words(name)
    space = f" {unit}" if unit else ""
    if not np.isfinite(believed):
        return f"The {words} is {plus_minus(refitted, low, high)}{space}; nothing was believed about it."
    # Of a ratio that alone is known the least trusted value is called wrong; the reader may know better.
    other = f" (or, what explains as much here: {listed(list(instead), 'or')})" if instead else ""
    value = plus_minus(refitted, low, high)
    return f"The {words} is {value}{space}, not the {number(believed, 4)}{space} believed{other}."


def _better(main: str, channels: Mapping[str, Channel], put_right: Sequence[str] = ()) -> str:
    if not main:
        return ""
    channel = channels[main]
    errors, where = _either_split(channel)
    noise = number(channel.noise_floor)
    if errors.before is not None and errors.after is not None and errors.after >= errors.before:
        return (
            f"The error of the {channel_words(main)} {where} is not smaller with this: {number(errors.before)} before, "
            f"{number(errors.after)} {channel.unit} after."
        )
    also = f", and what was believed put right within its trust ({listed(list(put_right))})," if put_right else ""
    return (
        f"With this{also} the error of the {channel_words(main)} {where} goes from {number(errors.before)} to "
        f"{number(errors.after)} {channel.unit}; the sensor's own noise is {noise} {channel.unit}."
    )


def _rest(analysis: Analysis, locations: Sequence[Location]) -> str:
    found = with_status(analysis, "established", "ambiguous") or analysis.wrong_values
    depends = [regime_words(v)[0] for v in analysis.unexplained_depends_on]
    if found:
        text = f"{100 * analysis.unexplained_share:.0f} % of the mismatch remains unexplained"
    else:
        text = "None of the known effects explains it"
    if depends:
        text += f"; what is left depends on {listed(depends)}"
    return text + "."


def _agreement(analysis: Analysis, channels: Mapping[str, Channel], who: str = "The believed vehicle") -> str:
    shown = [c for c in ("force_z", "force_x", "moment_x", "moment_z") if c in channels] or list(channels)
    chosen = shown[:1] + [c for c in shown[1:] if c.startswith("moment")][:1]
    left = listed(
        [
            f"{number(_either_split(channels[c])[0].after)} {channels[c].unit} in the {channel_words(c)} "
            f"(the sensors' own noise: {number(channels[c].noise_floor)})"
            for c in chosen
        ]
    )
    if not left:
        return f"{who} leaves out nothing that was found."
    where = _either_split(channels[chosen[0]])[1]
    moved = f", put right within its trust ({listed(list(analysis.put_right))})," if analysis.put_right else ""
    return (
        f"{who}{moved} describes these recordings: the error that is left {where}, {left}, does not depend on "
        "how it was flown."
    )


if __name__ == "__main__":
    if "--write-schema" in sys.argv:
        SCHEMA_PATH.write_text(schema_text())
    else:
        print(schema_text(), end="")
