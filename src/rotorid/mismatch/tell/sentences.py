"""A verdict in words: one sentence of at most forty words, and the details that it has no room for."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from rotorid.mismatch.decide.findings import Analysis, Finding, one_per_class, with_status
from rotorid.mismatch.decide.sizes import Size, channel_size, metres_words, scales, share_words
from rotorid.mismatch.decide.status import CLAIMED, Estimate
from rotorid.mismatch.decide.words import (
    WRENCH_WORDS,
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
from rotorid.mismatch.tell.consistency import by_share, carrying, quoted
from rotorid.mismatch.tell.places import in_a_regime, regime_values, size_at

if TYPE_CHECKING:
    from rotorid.mismatch.decide.statements import UpperLimit
    from rotorid.mismatch.tell.verdict import Channel, Location

MOST_WORDS = 40
MOST_NAMES = 2
"""Effects or values that the sentence names; more are counted."""
_NO_BETTER = 0.02
"""Relative change of an error run forward below which it is neither better nor worse."""


_Sizes = Literal["both", "share", "metres", ""]
"""Which sizes stand in a text: share of the weight and metres after half a second."""
_GROUND_WORDS = (
    ("on flights not used", "on runs not used"),
    ("on the flight it was fitted to", "on the run it was fitted to"),
    ("on held-out flight", "on held-out runs"),
    ("What to fly next", "What to measure next"),
    ("Faster, higher or rougher flight would show", "Larger, faster and returning loads would show"),
    ("the believed vehicle describes", "the believed values describe"),
    *WRENCH_WORDS.values(),
)
"""What is said of flights, as it is said of a stand or bench."""


@dataclass(frozen=True)
class Contents:
    """What the words are made from."""

    analysis: Analysis
    word: str
    locations: Sequence[Location]
    channels: Mapping[str, Channel]
    """Of the inverse dynamics, or of the reading."""
    main: str
    """The channel that the sentence names (`main_channel`)."""
    left: float
    """Share of the mismatch that is left."""
    forward: Mapping[str, Channel]

    @property
    def main_size(self) -> Size | None:
        """The size of the error in the main channel as believed."""
        before = quoted(self.channels[self.main]).before if self.main in self.channels else None
        return None if before is None else channel_size(self.analysis, self.main, before, "before")


def names_of(ids: Iterable[str], last: str = "and") -> str:
    """`drag, lift and sag`, each effect once."""
    return listed([effect_words(i) for i in dict.fromkeys(ids)], last)


def with_unit(text: str, unit: str) -> str:
    """A number in words with its unit, where it has one."""
    return text if unit in ("", "-", "1") else f"{text} {unit}"


def spoken(text: str, analysis: Analysis) -> str:
    """A text about flights as it is said of this kind of set."""
    if analysis.recordings.vehicle.kind != "flight":
        for flown, still in _GROUND_WORDS:
            text = text.replace(flown, still).replace(capital(flown), capital(still))
    return text


def first_words(text: str, most: int = MOST_WORDS) -> str:
    """A text cut at its last whole clause within so many words."""
    words = text.split()
    if len(words) <= most:
        return text
    short = " ".join(words[:most])
    ends = [short.rfind(mark) for mark in (";", ":", ",")]
    short = short[: max(ends)] if max(ends) > 0 else short
    return f"{short}." if text.endswith(".") else short


def headline(contents: Contents) -> str:
    """What a pilot reads in at most MOST_WORDS words: where and how much, what was left out, how much better."""
    analysis, main = contents.analysis, contents.main
    if contents.word == "not_judged":
        first = next(d for d in analysis.doubts if d.stops)
        return first_words(f"Not judged. {first.sentence}")
    if contents.word == "no_mismatch":
        return _agreement(analysis, contents.channels)
    stated = with_status(analysis, *CLAIMED)
    if stated and all(_concerns_the_recording(f) for f in stated) and not analysis.wrong_values:
        faults = first_words("; ".join(capital(f.sentence.rstrip(".")) for f in stated), MOST_WORDS - 15)
        faults += "." if len(stated) == 1 else f" ({len(stated)} faults)."
        return first_words(faults if contents.word == "explained" else f"{faults} {_rest(contents)}")
    places, causes = _places(contents), _causes(contents)
    if not causes:
        texts = [capital(f"{where}; {_rest(contents)}") for where in places]
        return next((text for text in texts if len(text.split()) <= MOST_WORDS), first_words(texts[-1]))
    rest = "" if contents.word == "explained" else f"; {unexplained_words(contents.left)}"
    still, short = (_still_off(contents, how) for how in ("both", "share"))
    surely, where, in_metres, off, off_in_metres, plain = places
    # Where a place is said with its own error, the error that falls is that of the whole.
    better = _better_in_short(contents.channels[main], overall=where != off) if main else ""
    for place, *parts in (
        (surely, better, rest, still),
        (where, better, rest, short),
        (in_metres, better, rest, short),
        (where, rest, short),
        (off, rest, short),
        (off_in_metres, rest, short),
        (off_in_metres, "" if short else rest, short),
        (plain, short),
        ("", "" if short else rest, short),
    ):
        text = "".join([f"{place}; " if place else "", causes, *parts, "."])
        if len(text.split()) <= MOST_WORDS:
            return capital(text)
    return first_words(capital(f"{causes}{short or rest}."))


def unexplained_words(share: float) -> str:
    """What stays unexplained given the causes that were named, 0 to 1."""
    nearly_all = 0.99  # Share that stays unexplained from which the causes named explain next to nothing.
    if share >= nearly_all:
        return f"that explains less than {100 * (1 - nearly_all):.0f} % of it"
    return f"{100 * share:.0f} % stays unexplained"


def _still_off(contents: Contents, how: _Sizes) -> str:
    """The channel that stays off most with what was found, as a clause, with its size as far as asked.

    Empty where none is worth a word, or where it is the main one, of which the sentence says so anyway.
    """
    known = scales(contents.analysis)
    left = {}
    for channel, own in contents.channels.items():
        named = quoted(own).named
        if channel in known and named is not None:
            left[channel] = math.sqrt(max(named**2 - (own.noise_floor or 0.0) ** 2, 0.0))
    most = max(left, key=lambda c: left[c] / known[c].value, default=None)
    # Share of the weight, or of the moment that the rotors can make, that a channel must stay off to be named: what a
    # pilot trims without noticing is less.
    worth_a_word = 0.03
    if most in (None, contents.main) or left[most] < worth_a_word * known[most].value:
        return ""
    size = channel_size(contents.analysis, most, left[most], "named")
    off = f"{number(left[most])} {contents.channels[most].unit}"
    return f"; the {channel_words(most)} stays {off} off ({_size_words(size, how)})"


def details(contents: Contents) -> list[str]:
    """What the sentence has no room for: each effect with its numbers and share, values, what is left, what is run
    forward."""
    analysis, shares = contents.analysis, contents.analysis.shares
    out = [_left_out(f, shares.get(f.id)) for f in by_share(with_status(analysis, "established"), shares)]
    out += [_either(f, analysis) for f in by_share(one_per_class(with_status(analysis, "ambiguous")), shares)]
    out += [_wrong(name, values, analysis.instead.get(name, ())) for name, values in analysis.values.items()]
    explained = with_status(analysis, *CLAIMED) or analysis.wrong_values
    if contents.word != "no_mismatch" and explained and contents.main:
        out.append(_better(contents.main, contents.channels[contents.main], analysis.corrected))
    for finding in by_share(with_status(analysis, "suggested"), shares):
        name, numbers = capital(effect_words(finding.id)), _parameters(finding)
        out.append(f"{name} is suggested{f' ({numbers})' if numbers else ''}, not established: {finding.objection}.")
    out += [_wrong(name, values, why=why) for name, (values, why) in analysis.suggested_values.items()]
    if contents.word in ("partly_explained", "unexplained"):
        described = analysis.unexplained_description
        out.append(capital(_rest(contents)) + (f" {capital(described)}." if described else ""))
    out += [_of_commands(analysis), _not_found(analysis.absent), *_run_forward(contents.forward)]
    return [text for text in out if text]


def _of_commands(analysis: Analysis) -> str:
    """What is known of the path from command to thrust where no rotor speed is recorded; empty for nothing."""
    known = {e.symbol: e for e in analysis.command_path}

    def number(e: Estimate, times: float = 1.0, digits: int = 1) -> str:
        value, low, high = (f"{times * x:.{digits}f}" for x in (e.value, e.low, e.high))
        return f"{value} ({low} to {high})"

    parts = []
    if "e_u" in known:
        parts.append(f"1 % more throttle makes {number(known['e_u'])} % more thrust")
    if "e_V" in known:
        parts.append(f"1 % less voltage {number(known['e_V'])} % less")
    if "tau" in known:
        parts.append(f"rotors follow {number(known['tau'], 1e3, 0)} ms late")
    return f"About the hover command {listed(parts)}." if parts else ""


def _not_found(limits: Sequence[UpperLimit]) -> str:
    """What was tested and not found, and how large it may be at most with 95 % probability."""
    most_limits = 3  # Effects that were not found and are named with their limit; more are counted.
    sized = [(effect_words(x.id), percent_words(x.share)) for x in limits if x.share > 0]
    if not sized:
        return ""
    first, rest = sized[:most_limits], sized[most_limits:]
    named = [f"{name} (at most {share} of the weight)" for name, share in first]
    if rest:
        named.append(f"{len(rest)} others (at most {rest[0][1]})" if len(rest) > 1 else f"{rest[0][0]} ({rest[0][1]})")
    return f"Not found: {listed(named)}."


def _causes(contents: Contents) -> str:
    """Effects and values that carry nine tenths of the error, in a clause."""
    analysis = contents.analysis
    stated = [f for f in one_per_class(with_status(analysis, *CLAIMED)) if not _concerns_the_recording(f)]
    names = [
        names_of((f.id, *(f.alternatives if f.status == "ambiguous" else ())), "or")
        for f in carrying(stated, analysis.shares)
    ]
    clauses = []
    if names:
        more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
        shown = f"{', '.join(names[:MOST_NAMES])}{more}" if more else listed(names)
        clauses.append(f"{shown} {'was' if len(names) == 1 else 'were'} left out")
    wrong, most = list(analysis.wrong_values.items()), max(1, MOST_NAMES - len(names))
    for name, (believed, refitted, _, _) in wrong[:most]:
        words, unit = parameter_words(name)
        clauses.append(f"the {words} is {with_unit(number(refitted, 3), unit)}, not {number(believed, 3)}")
    if len(wrong) > most:
        left = len(wrong) - most
        clauses.append(f"{left} more values are wrong" if left > 1 else "one more value is wrong")
    return listed(clauses)


def _off_words(contents: Contents, size: Size | None, how: _Sizes, here: float | None = None) -> str:
    """How much the main channel is off, in all or by `here`, in words; with its size, as far as asked."""
    if not contents.main:
        return "the model and the recordings differ"
    said, channel = _size_words(size, how) if size is not None else "", contents.channels[contents.main]
    off = f"{number(quoted(channel).before if here is None else here)} {channel.unit} off"
    return f"the {channel_words(contents.main)} is {off}{f', {said}' if said else ''}"


def _size_words(size: Size, how: _Sizes) -> str:
    """`6 % of the weight or 0.060 m after 0.5 s simulated`, or one of the two, or neither."""
    metres = metres_words(size) if how in ("both", "metres") else ""
    share = share_words(size) if how in ("both", "share") or (how == "metres" and not metres) else ""
    return " or ".join(filter(None, (share, metres)))


def _better_in_short(channel: Channel, overall: bool) -> str:
    errors = quoted(channel)
    if errors.before is None or errors.named is None:
        return ""
    named = f"{number(errors.named)} {channel.unit}"
    if errors.named >= errors.before:
        return f"; the error is not smaller with this ({named})"
    falls = f"overall the error falls from {number(errors.before)}" if overall else "the error falls"
    return f"; {falls} to {named} (noise {number(channel.noise_floor)})"


def warnings_of(channels: Mapping[str, Channel]) -> list[str]:
    """A sentence for every channel that what is delivered makes worse on the runs held out.

    Worse than the vehicle with its values refitted, or than the believed one.
    """
    out = []
    for name, channel in channels.items():
        errors = channel.rmse.held_out
        known = [(w, e) for w, e in (("refitted", errors.refitted), ("believed", errors.before)) if e is not None]
        if errors.after is None or not known or errors.after <= (channel.noise_floor or 0.0):
            continue
        word, best = min(known, key=lambda pair: pair[1])
        if errors.after > (1 + _NO_BETTER) * best:
            out.append(
                f"On the held-out runs the error of the {channel_words(name)} is larger with the improved vehicle: "
                f"{number(errors.after)} {channel.unit}; with the {word} values alone {number(best)} {channel.unit}."
            )
    return out


def _run_forward(forward: Mapping[str, Channel]) -> list[str]:
    """What the improved vehicle does for the simulation run forward, channel by channel."""
    groups: dict[str, list[str]] = {"better": [], "no better": [], "worse": []}
    for name, channel in forward.items():
        errors = quoted(channel)
        if not errors.before or errors.after is None:
            continue
        change = errors.after / errors.before - 1.0
        word = "better" if change < -_NO_BETTER else "worse" if change > _NO_BETTER else "no better"
        groups[word].append(
            f"{name.replace('_', ' ')} ({number(errors.before)} before, {number(errors.after)} {channel.unit} after)"
        )
    if not any(groups.values()):
        return []
    texts = [f"{word}: {listed(own)}" for word, own in groups.items() if own]
    return [f"Simulated forward with the improved vehicle, RMS over windows of half a second, {'; '.join(texts)}."]


def _concerns_the_recording(finding: Finding) -> bool:
    """Whether a finding is a fault of the recording itself, corrected before any physics was looked at."""
    return finding.form is None and not finding.equation and bool(finding.sentence)


def main_channel(analysis: Analysis, locations: Sequence[Location], channels: Mapping[str, Channel]) -> str:
    """The channel in which the mismatch is largest to a pilot: what goes of its error, or all of it where nothing does.

    Of the channels located, those of what was named come first.
    """
    there = [loc.channel for loc in locations if loc.channel in channels]
    stated, known = with_status(analysis, *CLAIMED), scales(analysis)
    named = [c for f in stated for c in f.channels if c in there]
    explained = bool(stated or analysis.wrong_values)

    def size(name: str) -> float:
        errors = quoted(channels[name])
        before, named = errors.before or 0.0, errors.named or 0.0
        off = math.sqrt(max(before**2 - named**2, 0.0)) if explained else before
        return off / known[name].value if name in known else 0.0

    return max(named or there or [t.channel for t in analysis.traces], key=size, default="")


def surest_location(here: Sequence[Location]) -> Location:
    """The location with the smallest p-value."""
    return min(here, key=lambda loc: loc.p_value if loc.p_value is not None else 1.0)


def _places(contents: Contents) -> tuple[str, str, str, str, str, str]:
    """Where and how much the main channel is off, from all that can be said to the least.

    With regime, size and significance; without the significance; with the metres alone; the same two without regime;
    and the error alone. With a regime or time all sizes are those of this place.
    """
    analysis, size = contents.analysis, contents.main_size
    both, metres, plain = (_off_words(contents, size, how) for how in ("both", "metres", ""))
    here = [loc for loc in contents.locations if loc.channel == contents.main]
    if not contents.main or not here:
        return both, both, metres, both, metres, plain
    best = surest_location(here)
    worth_saying_p = 0.05
    doubt = f" ({sure(best.p_value)})" if best.p_value is not None and best.p_value < worth_saying_p else ""
    when = _when(best, here, analysis)
    there = size_at(analysis, best) if when else None
    if there is None:
        return f"{both}{doubt}", both, metres, both, metres, plain
    said, short = (f"{when}{_off_words(contents, there, how, there.rms)}" for how in ("both", "metres"))
    return f"{said}{doubt}", said, short, both, metres, plain


def _when(best: Location, here: Sequence[Location], analysis: Analysis) -> str:
    """Lead-in that says in which regime, else at what time, the mismatch shows."""
    regime = best.regime
    if in_a_regime(best):
        name, unit = regime_words(regime.variable, regime.either_sign)
        low, high = (with_unit(number(end), unit) for end in (regime.low, regime.high))
        known = [r for r in analysis.regimes.values() if regime.variable in r]
        flown = np.concatenate([regime_values(r, regime) for r in known])
        to_the_end = regime.high >= np.nanquantile(flown, 0.98)
        from_the_start = regime.low <= np.nanquantile(flown, 0.02)
        if from_the_start and to_the_end:
            return ""
        if from_the_start:
            # "Up to −1.3 m/s of forward speed" nobody reads as flying backwards.
            return f"where the {name} is below {high}, " if regime.high < 0 else f"up to {high} of {name}, "
        if to_the_end:
            return f"from {low} of {name} on, "
        return f"between {number(regime.low)} and {high} of {name}, "
    if best.energy_share < 0.99 and best.start_s is not None and best.stop_s is not None:
        more = f" (and in {len(here) - 1} more stretches)" if len(here) > 1 else ""
        return f"from {best.start_s:.1f} to {best.stop_s:.1f} s of {best.run}{more}, "
    return ""


def _parameters(finding: Finding) -> str:
    estimates = surest(finding.parameters)
    return listed([f"{e.symbol} = {with_unit(plus_minus(e.value, e.low, e.high), e.unit)}" for e in estimates])


def surest(parameters: Sequence[Estimate]) -> list[Estimate]:
    """The three parameters that are furthest from zero relative to their intervals, in their order."""

    def beyond(e: Estimate) -> float:
        width = e.high - e.low
        return abs(e.value) / max(width, 1e-12 * abs(e.value), 1e-300) if np.isfinite(width) else 0.0

    kept = sorted(parameters, key=beyond, reverse=True)[:3]
    return [e for e in parameters if e in kept]


def _left_out(finding: Finding, share: float | None) -> str:
    """An established effect, or a fault of the recording, with its numbers and the share of the error that it takes."""
    named, sentence, parameters = capital(effect_words(finding.id)), finding.sentence.rstrip("."), _parameters(finding)
    said = [
        parameters,
        "" if finding.probability is None else f"probability {percent(finding.probability)}",
        "" if not share else f"{100 * share:.0f} % of the squared error that goes needs it",
    ]
    numbers = f" ({', '.join(filter(None, said))})" if any(said) else ""
    if _concerns_the_recording(finding):
        return f"{named}: {sentence}{numbers}."
    kept_out = f" It is not in the delivered vehicle: {finding.withheld}." if finding.withheld else ""
    return f"{named} was left out{f': {sentence}' if sentence else ''}{numbers}.{kept_out}"


def _either(finding: Finding, analysis: Analysis) -> str:
    members = dict.fromkeys((finding.id, *finding.alternatives))
    either, question = ("Either ", "show which") if len(members) > 1 else ("", "settle it")
    text = f"{either}{names_of(members, 'or')} was left out"
    text += "" if finding.probability is None else f" (probability {percent(finding.probability)})"
    text += f"; this recording cannot {question}"
    # The next experiment is made for one class; it need not help with another.
    helps = analysis.next_manoeuvre and (not analysis.next_separates or finding.id in analysis.next_separates)
    return f"{text}, but this may: {analysis.next_manoeuvre.rstrip('.')}." if helps else f"{text}."


def _wrong(name: str, values: tuple[float, float, float, float], instead: Sequence[str] = (), why: str = "") -> str:
    """A wrong value, or with `why` one that is only suggested."""
    believed, refitted, low, high = values
    words, unit = parameter_words(name)
    value, before = with_unit(plus_minus(refitted, low, high), unit), with_unit(number(believed, 4), unit)
    if not np.isfinite(believed):
        return f"The {words} is {value}; nothing was believed about it."
    if why:
        return f"The {words} is suggested to be {value} ({before} believed), not established: {why}."
    # Of a ratio that alone is known the least trusted value is called wrong; the reader may know better.
    other = f" (or, what explains as much here: {listed(list(instead), 'or')})" if instead else ""
    return f"The {words} is {value}, not the {before} believed{other}."


def _better(name: str, channel: Channel, corrected: Sequence[str]) -> str:
    errors, unit = quoted(channel), channel.unit
    error = f"error of the {channel_words(name)} {_said_of(channel)}"
    before, after, noise = map(number, (errors.before, errors.named, channel.noise_floor))
    if errors.before is not None and errors.named is not None and errors.named >= errors.before:
        return f"The {error} is not smaller with this: {before} before, {after} {unit} after."
    also = f", and believed values corrected within their trust ({listed(list(corrected))})," if corrected else ""
    return (
        f"With this{also} the {error} goes from {before} to {after} {unit}; the sensor's own noise is {noise} {unit}."
    )


def _said_of(channel: Channel) -> str:
    held = channel.rmse.held_out.after is not None
    return "on flights not used for fitting" if held else "on the flight it was fitted to"


def _rest(contents: Contents) -> str:
    analysis = contents.analysis
    depends = [regime_words(v)[0] for v in analysis.unexplained_depends_on]
    if with_status(analysis, *CLAIMED) or analysis.wrong_values:
        text = f"{100 * contents.left:.0f} % of the mismatch stays unexplained"
    else:
        text = "none of the known effects explains it"
    if depends:
        text += f"; what is left depends on {listed(depends)}"
    return text + "."


def _agreement(analysis: Analysis, channels: Mapping[str, Channel]) -> str:
    shown = [c for c in ("force_z", "force_x", "moment_x", "moment_z") if c in channels] or list(channels)
    chosen = shown[:1] + [c for c in shown[1:] if c.startswith("moment")][:1]
    errors = [
        f"the {channel_words(c)} is {number(quoted(channels[c]).named)} {channels[c].unit} off "
        f"(noise {number(channels[c].noise_floor)})"
        for c in chosen
    ]
    moved = f", values corrected within their trust ({listed(list(analysis.corrected))})" if analysis.corrected else ""
    where = _said_of(channels[chosen[0]])
    text = f"The believed vehicle describes these recordings{moved}: {where}, {listed(errors)}."
    return text if len(text.split()) <= MOST_WORDS else text.replace(moved, "")
