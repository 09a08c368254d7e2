"""The top of the verdict's page: three tiles below its sentence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rotorid.mismatch.decision.words import (
    capital,
    channel_words,
    effect_words,
    listed,
    number,
    parameter_words,
    regime_words,
)
from rotorid.mismatch.posterior.status import CLAIMED
from rotorid.mismatch.tell.consistency import quoted
from rotorid.mismatch.tell.sentences import surest_location
from rotorid.mismatch.tell.verdict import Channel, EffectVerdict, Errors, Location, Verdict


@dataclass(frozen=True)
class _Tile:
    """A heading, what it says in large letters, and a line below."""

    heading: str
    large: str
    small: str = ""


def errors_of(channel: Channel) -> tuple[Errors, str]:
    """Errors to quote and where they were made: on runs held out where there are any."""
    return quoted(channel), "on the runs fitted" if channel.rmse.held_out.after is None else "on runs held out"


def claims(verdict: Verdict) -> list[str]:
    """What is claimed, in words that fit before "left out": effects, a class as "a or b", each once."""
    said, seen = [], set()
    for effect in verdict.effects:
        members = {effect.id, *effect.alternatives}
        if effect.status in CLAIMED and not members & seen:
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


def tiles(verdict: Verdict, main: str) -> list[_Tile]:
    """What, where, and how large the error was before and after relative to the noise."""
    return [_what(verdict), _where(verdict, main), _how_much(verdict, main)]


def _what(verdict: Verdict) -> _Tile:
    named = claims(verdict)
    wrong = [parameter_words(n)[0].rstrip(",") for n in verdict.parameters]
    if not named and not wrong:
        if verdict.verdict == "no_mismatch":
            return _Tile("What", "Nothing left out", f"{len(verdict.not_testable)} effects could not be tested")
        return _Tile("What", "Not known", "none of the known effects explains it")
    first, *rest = [*map(capital, named), *(f"{capital(w)} wrong" for w in wrong)]
    return _Tile("What", first, f"and {listed([r[0].lower() + r[1:] for r in rest])}" if rest else "")


def _where(verdict: Verdict, main: str) -> _Tile:
    here = [loc for loc in verdict.locations if loc.channel == main] or list(verdict.locations)
    if not here:
        return _Tile("Where", "Nowhere", "no error above the sensors' noise")
    channels = list(dict.fromkeys(loc.channel for loc in verdict.locations))
    best = surest_location(here)
    large = capital(channel_words(best.channel))
    others = f"; also in {len(channels) - 1} other channels" if len(channels) > 1 else ""
    return _Tile("Where", large, f"{_when(best, here)}{others}")


def _when(best: Location, here: Sequence[Location]) -> str:
    regime = best.regime
    if regime is not None and regime.low is not None and regime.high is not None:
        name, unit = regime_words(regime.variable)
        return f"{name} {number(regime.low)} to {number(regime.high)} {unit}".strip()
    if best.energy_share < 0.99 and best.start_s is not None and best.stop_s is not None:
        more = f" and {len(here) - 1} more stretches" if len(here) > 1 else ""
        return f"{best.start_s:.1f} to {best.stop_s:.1f} s of {best.run}{more}"
    return f"all through {best.run}" if len({loc.run for loc in here}) == 1 else "in every run"


def _how_much(verdict: Verdict, main: str) -> _Tile:
    if main not in verdict.channels:
        return _Tile("How much", "–")
    channel = verdict.channels[main]
    errors, where = errors_of(channel)
    large = f"{number(errors.before)} → {number(errors.after)} {channel.unit}"
    size = verdict.size
    metres = size.metres_after_half_a_second if size is not None and size.channel == main else None
    led = "" if metres is None else f"; as believed {number(metres)} m off after half a second of simulation"
    noise = f"noise {number(channel.noise_floor)} {channel.unit}, " if channel.noise_floor else ""
    return _Tile("Error before and after", large, f"{channel_words(main)}; {noise}{where}{led}")
