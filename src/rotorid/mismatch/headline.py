"""The top of the verdict's page: one sentence of at most 25 words and three tiles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rotorid.mismatch.verdict import Channel, EffectVerdict, Errors, Location, Verdict
from rotorid.mismatch.words import (
    capital,
    channel_words,
    effect_words,
    listed,
    number,
    parameter_words,
    regime_words,
)

MOST_WORDS = 25
FEWEST_NAMED = 1


@dataclass(frozen=True)
class Tile:
    """A heading, what it says in large letters, and a line below."""

    heading: str
    large: str
    small: str = ""


def errors_of(channel: Channel) -> tuple[Errors, str]:
    """Errors to quote and where they were made: on runs held out where there are any."""
    if channel.rmse.held_out.after is not None:
        return channel.rmse.held_out, "on runs held out"
    return channel.rmse.training, "on the runs fitted"


def claims(verdict: Verdict) -> list[str]:
    """What is claimed, in words that fit before "left out": effects, a class as "a or b", each once."""
    said, seen = [], set()
    for effect in verdict.effects:
        if effect.status not in ("established", "ambiguous"):
            continue
        members = frozenset((effect.id, *effect.alternatives))
        if members & seen:
            continue
        seen |= members
        said.append(_name(effect))
    return said


def _name(effect: EffectVerdict) -> str:
    others = [i for i in effect.alternatives if i != effect.id]
    if effect.status != "ambiguous" or not others:
        return effect_words(effect.id)
    if len(others) == 1:
        return f"{effect_words(effect.id)} or {effect_words(others[0])}"
    return f"{effect_words(effect.id)} or one of {len(others)} others"


def headline(verdict: Verdict, main: str) -> str:
    """At most 25 words: what is off, what it is, how much better it gets."""
    if verdict.verdict == "no_mismatch":
        return "The believed vehicle describes these recordings to within the noise of their sensors."
    named, values = claims(verdict), [parameter_words(n)[0].rstrip(",") for n in verdict.parameters]
    # How much better it gets, and what is left, come before the last of the names.
    for tail in (_gain(verdict, main), _left(verdict)):
        for count in range(len(named), min(FEWEST_NAMED, len(named)) - 1, -1):
            for wrong in (values, values[:1]):
                text = _claim(named, count, wrong) + tail + "."
                if (count or wrong) and len(text.split()) <= MOST_WORDS:
                    return capital(text)
    text = _claim(named, FEWEST_NAMED, []) if named else _claim([], 0, values)
    if named or values:
        return capital(f"{' '.join(text.split()[: MOST_WORDS - 1])}.")
    off = f"the {channel_words(main)} differs from the recordings" if main else "model and recordings differ"
    return capital(f"{off}, and nothing in the catalogue explains it.")


def _claim(named: Sequence[str], count: int, values: Sequence[str]) -> str:
    shown = list(named[:count])
    more = len(named) - count
    if more:
        shown.append(f"{more} more")
    parts = []
    if shown:
        parts.append(f"{listed(shown)} {'was' if len(named) == 1 else 'were'} left out")
    if values:
        parts.append(f"{listed(list(values))} {'is' if len(values) == 1 else 'are'} wrong")
    return "; ".join(parts)


def _gain(verdict: Verdict, main: str) -> str:
    if main not in verdict.channels or not (claims(verdict) or verdict.parameters):
        return ""
    channel = verdict.channels[main]
    errors, _ = errors_of(channel)
    if errors.before is None or errors.after is None or errors.after >= errors.before:
        return _left(verdict)
    rest = "" if verdict.verdict == "explained" else f", {100 * verdict.unexplained.share:.0f} % unexplained"
    return f": {channel_words(main)} error {number(errors.before)} → {number(errors.after)} {channel.unit}{rest}"


def _left(verdict: Verdict) -> str:
    if verdict.verdict == "explained":
        return ""
    return f"; {100 * verdict.unexplained.share:.0f} % of the mismatch stays unexplained"


def tiles(verdict: Verdict, main: str) -> list[Tile]:
    """What, where, and how large the error was before and after beside the noise."""
    return [_what(verdict), _where(verdict, main), _how_much(verdict, main)]


def _what(verdict: Verdict) -> Tile:
    named = claims(verdict)
    wrong = [parameter_words(n)[0].rstrip(",") for n in verdict.parameters]
    if not named and not wrong:
        if verdict.verdict == "no_mismatch":
            return Tile("What", "Nothing left out", f"{len(verdict.not_testable)} effects could not be tested")
        return Tile("What", "Not known", "none of the known effects explains it")
    first, *rest = [*map(capital, named), *(f"{capital(w)} wrong" for w in wrong)]
    return Tile("What", first, f"and {listed([r[0].lower() + r[1:] for r in rest])}" if rest else "")


def _where(verdict: Verdict, main: str) -> Tile:
    here = [loc for loc in verdict.locations if loc.channel == main] or list(verdict.locations)
    if not here:
        return Tile("Where", "Nowhere", "no error above the sensors' noise")
    channels = list(dict.fromkeys(loc.channel for loc in verdict.locations))
    best = min(here, key=lambda loc: loc.p_value if loc.p_value is not None else 1.0)
    large = capital(channel_words(best.channel))
    others = f"; also in {len(channels) - 1} other channels" if len(channels) > 1 else ""
    return Tile("Where", large, f"{_when(best, here)}{others}")


def _when(best: Location, here: Sequence[Location]) -> str:
    regime = best.regime
    if regime is not None and regime.low is not None and regime.high is not None:
        name, unit = regime_words(regime.variable)
        return f"{name} {number(regime.low)} to {number(regime.high)} {unit}".strip()
    if best.energy_share < 0.99 and best.start_s is not None and best.stop_s is not None:
        more = f" and {len(here) - 1} more stretches" if len(here) > 1 else ""
        return f"{best.start_s:.1f} to {best.stop_s:.1f} s of {best.run}{more}"
    return f"all through {best.run}" if len({loc.run for loc in here}) == 1 else "in every run"


def _how_much(verdict: Verdict, main: str) -> Tile:
    if main not in verdict.channels:
        return Tile("How much", "–")
    channel = verdict.channels[main]
    errors, where = errors_of(channel)
    large = f"{number(errors.before)} → {number(errors.after)} {channel.unit}"
    noise = f"noise {number(channel.noise_floor)} {channel.unit}, " if channel.noise_floor else ""
    return Tile("Error before and after", large, f"{channel_words(main)}; {noise}{where}")
