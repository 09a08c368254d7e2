"""What changed between two sets, in sentences and as JSON."""

from __future__ import annotations

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.changes.compare import Change, Changes
from rotorid.mismatch.changes.level_one_words import level_one_json, level_one_sentences
from rotorid.mismatch.changes.problem import NAMES
from rotorid.mismatch.decision.words import (
    capital,
    effect_words,
    listed,
    number,
    parameter_words,
    percent,
    percent_words,
)
from rotorid.mismatch.instrument.columns import VALUE_NAMES
from rotorid.mismatch.posterior.limits import UpperLimit
from rotorid.mismatch.posterior.status import CLAIMED, Estimate

VALUES = frozenset(NAMES.values())
WHOLE = {"flight": "the weight", "stand": "the largest load", "bench": "the largest load"}
"""Kind of the sets to what shares are of."""
_SHARE = {"flight": "share_of_weight", "stand": "share_of_largest_load", "bench": "share_of_largest_load"}
_GAINS = frozenset(name for name in VALUE_NAMES.values() if name.startswith("reading_gain"))
"""Values that a calibration measures, by dead weights on one axis after the other."""
_MOST_LIMITS = 4
"""Things that did not change and are named with their limit; more are counted."""


def sentences(found: Changes) -> list[str]:
    """What differs; then a sentence a change, the most probable first, and one on what did not change."""
    first = [] if found.level_1 is None else level_one_sentences(found.level_1)
    return [*first, *level_two_sentences(found)]


def level_two_sentences(found: Changes) -> list[str]:
    """One sentence a change, the most probable first, and one on what did not change."""
    out = [_change_words(c) for c in found.changes]
    if not out and found.level_1 is not None and found.level_1.stated:
        out.append("No known effect explains this: it stays as it is stated.")
    elif not out:
        out.append(f"Nothing changed from {found.base} to {found.new} as far as these recordings can tell.")
    limits = [_unchanged_words(found.limits, WHOLE[found.kind])] if found.limits else []
    return [*out, *advice(found), *limits, *found.notes]


def advice(found: Changes) -> list[str]:
    """What to do about a stand or bench that changed: one sentence, or none where nothing surely did."""
    if found.kind == "flight":
        return []
    ids = {i for c in found.changes if c.status in CLAIMED for i in (c.id, *c.alternatives)}
    remedies = {effect.remedy for effect in catalogue().values() if effect.id in ids}
    if ids & _GAINS or "calibrate" in remedies:
        return ["Calibrate it again before its readings are used: what was found is part of the calibration."]
    if "zero" in remedies:
        return ["Zero it again before each run; the calibration itself has not changed."]
    return []


def _change_words(change: Change) -> str:
    """`The mass changed: +8.3 ± 0.9 % (99.9 %).`"""
    names = listed([name_words(i) for i in change.alternatives or (change.id,)], "or")
    sizes = [_size_words(p) for p in change.parameters if p.low * p.high > 0]
    of = f" of {name_words(change.id)}" if change.alternatives and sizes else ""
    size = f": {listed(sizes)}{of}" if sizes else ""
    surely = "" if change.probability is None else f" (probability {percent(change.probability)})"
    verb = "may have changed" if change.status == "suggested" else "changed"
    return f"{capital(names)} {verb}{size}{surely}."


def name_words(name: str) -> str:
    """An effect, or a value by its contract name, in words."""
    return f"the {parameter_words(name)[0]}" if name in VALUES else effect_words(name)


def _size_words(estimate: Estimate) -> str:
    """A change with its 95 % interval: of a value in percent of it."""
    half = 0.5 * (estimate.high - estimate.low)
    if estimate.symbol in VALUES:
        return f"{100 * estimate.value:+.1f} ± {100 * half:.1f} %"
    return f"{estimate.symbol} by {number(estimate.value)} ± {number(half)} {estimate.unit}".removesuffix(" 1").rstrip()


def _unchanged_words(limits: tuple[UpperLimit, ...], whole: str) -> str:
    """What did not change: believed values with their limits, then the effects that may have changed most.

    `whole` is what shares are of, in words.
    """
    values = [
        f"{name_words(x.id)} by at most {percent_words(x.at_most)}" for x in limits if x.id in VALUES and x.at_most
    ]
    # A limit above the weight excludes nothing: the page has it in its table.
    others = [x for x in limits if x.id not in VALUES and 0 < x.share < 1]
    named = [f"{name_words(x.id)} by at most {percent_words(x.share)} of {whole}" for x in others[:_MOST_LIMITS]]
    if len(others) > _MOST_LIMITS:
        named.append(f"{len(others) - _MOST_LIMITS} others by less")
    return f"Not changed, with 95 % probability: {listed([*values, *named])}."


def as_json(found: Changes) -> dict:
    """The comparison as `changes.json` holds it."""
    return {
        "base": found.base,
        "new": found.new,
        "kind": found.kind,
        "sentences": sentences(found),
        "notes": list(found.notes),
        "level_1": None if found.level_1 is None else level_one_json(found.level_1, found.explained),
        "changes": [
            {
                "id": c.id,
                "status": c.status,
                "alternatives": list(c.alternatives),
                "probability": c.probability,
                "parameters": [
                    {"symbol": p.symbol, "change": p.value, "unit": p.unit, "interval_95": [p.low, p.high]}
                    for p in c.parameters
                ],
            }
            for c in found.changes
        ],
        "values": [{"name": p.symbol, "change": p.value, "interval_95": [p.low, p.high]} for p in found.values],
        "unchanged": [
            {
                "id": x.id,
                "symbol": x.symbol,
                "at_most": x.at_most,
                "unit": x.unit,
                _SHARE[found.kind]: x.share or None,
            }
            for x in found.limits
        ],
    }
