"""What changed between two sets, and what differs between flights, in a pilot's words and as JSON."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.changes.compare import Change, Changes
from rotorid.mismatch.changes.level_one import CAUSES, Difference, LevelOne
from rotorid.mismatch.changes.problem import NAMES
from rotorid.mismatch.changes.quantities import KINDS, SENSORS
from rotorid.mismatch.decide.statements import UpperLimit
from rotorid.mismatch.decide.status import CLAIMED, Estimate
from rotorid.mismatch.decide.words import (
    capital,
    listed,
    name_words,
    number,
    percent,
    percent_words,
)
from rotorid.mismatch.instrument.model import VALUE_NAMES

_THRUST = "it gives {} thrust, or there is {} weight near it"
_MEANS = {
    "share": (
        "rotor {m} is asked for {size} {more} than in {good}",
        _THRUST.format("less", "more"),
        _THRUST.format("more", "less"),
    ),
    "roll": (
        "the roll trim differs from that of {good} by {size} of thrust times arm",
        "there is more weight on the right, or the rotors there give less thrust",
        "there is more weight on the left, or the rotors there give less thrust",
    ),
    "pitch": (
        "the pitch trim differs from that of {good} by {size} of thrust times arm",
        "there is more weight at the rear, or the rotors there give less thrust",
        "there is more weight at the front, or the rotors there give less thrust",
    ),
    "yaw_trim": (
        "the yaw trim differs from that of {good} by {size} of the torque of all rotors",
        "a rotor gives another torque (a damaged propeller), or a motor is tilted",
    ),
    "lift": (
        "{size} {more} thrust is asked for than in {good} at the same load{voltage}",
        "the vehicle is heavier, the rotors give less thrust, or the accelerometer reads less",
        "the vehicle is lighter, the rotors give more thrust, or the accelerometer reads more",
    ),
    "sideways": (
        "along {m} there is a force of {size} of the weight that {good} had not at the same speed",
        "the thrust or the accelerometer is tilted, or there is wind",
    ),
    "follows": (
        "rotor {m} turns {size} {faster} than in {good} at the same command",
        "motor, bearing, controller, battery or tachometer",
    ),
    "accelerometer": (
        "against the motion, the accelerometer reads {size} {more} along {m} than in {good}",
        "its zero, its scale or its mounting changed",
    ),
    "gyroscope": (
        "against the attitude, the gyroscope reads {size} {more} about {m} than in {good}",
        "its zero changed",
    ),
    "gyroscope_scale": (
        "of each rate, the gyroscope reads {size} {more} than in {good}",
        "its scale changed",
    ),
    "gyroscope_turn": (
        "the gyroscope is turned by {size} about {m} against its place in {good}",
        "its mounting changed",
    ),
    "drag": (
        "the drag along {m} is {size} of the weight per hover inflow {more} than in {good}",
        "something is added to the frame or gone from it, or another propeller is on",
    ),
    "noise": (
        "the noise of {m} is {size} {more} than in {good}",
        "vibration (propeller, bearing, mount), or the sensor",
    ),
}
"""Of a kind, or of a trim, what is seen and what may be behind it: where it is more, and where it is less."""
_SHOWN = ("share", "trim", "lift", "lift_of_throttle", "lift_without_voltage", "yaw_trim", "sideways")
"""Kinds whose smallest change is stated."""
_SMALLEST = {
    "share": "a rotor's share of the thrust by {}",
    "trim": "the roll or pitch trim by {} of thrust times arm",
    "yaw_trim": "the yaw trim by {}",
    "lift": "the weight over the thrust by {}",
    "sideways": "a sideways force of {} of the weight",
}
VALUES = frozenset(NAMES.values())
WHOLE = {"flight": "the weight", "stand": "the largest load", "bench": "the largest load"}
"""Kind of the sets to what shares are of."""
_SHARE = {"flight": "share_of_weight", "stand": "share_of_largest_load", "bench": "share_of_largest_load"}
_GAINS = frozenset(name for name in VALUE_NAMES.values() if name.startswith("reading_gain"))
"""Values that a calibration measures, by dead weights on one axis after the other."""


def sentences(found: Changes) -> list[str]:
    """What differs; then a sentence a change, the most probable first, and one on what did not change."""
    first = [] if found.level_1 is None else level_one_sentences(found.level_1)
    return [*first, *level_two_sentences(found)]


def level_two_sentences(found: Changes) -> list[str]:
    """One sentence a change, the most probable first, and one on what did not change."""
    out = [change_words(c) for c in found.changes]
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


def change_words(change: Change) -> str:
    """`The mass changed: +8.3 ± 0.9 % (99.9 %).`"""
    names = listed([name_words(i) for i in change.alternatives or (change.id,)], "or")
    sizes = [_size_words(p) for p in change.parameters if p.low * p.high > 0]
    of = f" of {name_words(change.id)}" if change.alternatives and sizes else ""
    size = f": {listed(sizes)}{of}" if sizes else ""
    surely = "" if change.probability is None else f" (probability {percent(change.probability)})"
    verb = "may have changed" if change.status == "suggested" else "changed"
    return f"{capital(names)} {verb}{size}{surely}."


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
    most_limits = 4  # Things that did not change and are named with their limit; more are counted.
    values = [
        f"{name_words(x.id)} by at most {percent_words(x.at_most)}" for x in limits if x.id in VALUES and x.at_most
    ]
    # A limit above the weight excludes nothing: the page has it in its table.
    others = [x for x in limits if x.id not in VALUES and 0 < x.share < 1]
    named = [f"{name_words(x.id)} by at most {percent_words(x.share)} of {whole}" for x in others[:most_limits]]
    if len(others) > most_limits:
        named.append(f"{len(others) - most_limits} others by less")
    return f"Not changed, with 95 % probability: {listed([*values, *named])}."


def as_json(found: Changes) -> dict:
    """The comparison as `changes.json` holds it."""
    return {
        "base": found.base,
        "new": found.new,
        "kind": found.kind,
        "sentences": sentences(found),
        "notes": list(found.notes),
        "level_1": None if found.level_1 is None else _level_one_json(found.level_1, found.explained),
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


def level_one_sentences(found: LevelOne) -> list[str]:
    """What differs, the rarest first; where nothing does, the smallest change that would have been stated."""
    if found.stated:
        return [difference_words(d) for d in found.stated]
    return [
        f"From {found.base} to {found.new} no trim, share of a rotor or sensor differs by more than flights of one "
        f"vehicle do. {_smallest_words(found)}".strip()
    ]


def difference_words(d: Difference) -> str:
    """`Rotor 3 is asked for 7.3 ± 1.8 % more than in the 5 good flights (…): it gives less thrust, or …`"""
    seen, *causes = _MEANS[d.quantity.member if d.quantity.kind == "trim" else _family(d.quantity.kind)]
    signed = "{more}" not in seen and "{faster}" not in seen
    text = seen.format(
        m=f"the {d.quantity.member}" if d.quantity.member in SENSORS else d.quantity.member,
        good=f"the {len(d.good)} good flights" if len(d.good) > 1 else "the good flight",
        size=_size_of(d, signed),
        # The slope of a drag is negative.
        more="more" if (d.value > 0) != (d.quantity.kind == "drag") else "less",
        faster="faster" if d.value > 0 else "slower",
        voltage=" and battery voltage" if d.quantity.kind == "lift_of_throttle" else "",
    )
    return (
        f"{capital(text)} (scatter from flight to flight {_amount(d, d.scatter)}, false-alarm rate "
        f"{_percent_of(d.false_alarms)}): {causes[-1] if d.value < 0 else causes[0]}."
    )


def _percent_of(rate: float) -> str:
    """`0.03 %`; rates that no table of scatter can vouch for are all below a thousandth."""
    return f"{number(100.0 * rate)} %" if rate >= 1e-3 else "below 0.1 %"


def _smallest_words(found: LevelOne) -> str:
    """The smallest changes that would have been stated in 19 of 20 comparisons, of the kinds that a pilot looks at."""
    most: dict[str, Difference] = {}
    for d in found.differences:
        if d.quantity.kind in _SHOWN and d.smallest > getattr(most.get(d.quantity.kind), "smallest", 0.0):
            most[d.quantity.kind] = d
    named = [_SMALLEST[_family(k)].format(_amount(most[k], most[k].smallest)) for k in _SHOWN if k in most]
    return f"Stated in 19 of 20 such comparisons would be: {listed(named)}." if named else ""


def quantity_words(d: Difference) -> str:
    """`share of rotor 3 (%)`: a quantity's name with its unit, for an axis."""
    kind, member = d.quantity.kind, d.quantity.member
    names = {
        "share": f"thrust asked of rotor {member}",
        "trim": f"{member} trim",
        "yaw_trim": "yaw trim",
        "sideways": f"force along {member}",
        "follows": f"speed of rotor {member} over its command",
        "accelerometer": f"accelerometer {member}",
        "gyroscope": f"gyroscope {member}",
        "gyroscope_scale": "scale of the gyroscope",
        "gyroscope_turn": f"turn of the gyroscope about {member}",
        "drag": f"drag along {member}",
        "noise": f"noise of {member}",
    }
    return f"{names.get(kind, 'thrust at the same load')} ({unit_of(d)})"


def in_unit_of_words(d: Difference, value: float) -> float:
    """A quantity in the unit of `quantity_words`."""
    if KINDS[d.quantity.kind].logarithm:
        return 100.0 * float(np.expm1(np.clip(value, -20.0, 20.0)))
    if d.quantity.kind == "gyroscope_turn":
        return float(np.rad2deg(value))
    return value if d.quantity.kind in ("accelerometer", "gyroscope") else 100.0 * value


def _family(kind: str) -> str:
    return "lift" if kind.startswith("lift") else kind


def unit_of(d: Difference) -> str:
    """Unit of `in_unit_of_words`."""
    return {"accelerometer": "g", "gyroscope": "rad/s", "gyroscope_turn": "°"}.get(d.quantity.kind, "%")


def _amount(d: Difference, value: float) -> str:
    return f"{number(abs(in_unit_of_words(d, value)))} {unit_of(d)}"


def _size_of(d: Difference, signed: bool) -> str:
    """`7.3 ± 1.8 %`, with its sign where the words have none; of a noise, which is no small share, the interval."""
    low, high = (in_unit_of_words(d, end) for end in d.interval())
    value, half = in_unit_of_words(d, d.value), 0.5 * (high - low)
    if d.quantity.kind == "noise":
        low, high = sorted((abs(low), abs(high)))
        return f"{abs(value):.0f} ({low:.0f} to {high:.0f}) %"
    digits = max(0, min(4, 1 - int(np.floor(np.log10(max(half, 1e-6))))))
    shown = f"{value:+.{digits}f}" if signed else f"{abs(value):.{digits}f}"
    return f"{shown} ± {half:.{digits}f} {unit_of(d)}"


def _level_one_json(found: LevelOne, explained: Mapping[str, tuple[str, ...]]) -> dict:
    """What differs, with every quantity of every flight, as `changes.json` holds it; `explained` as in `Changes`."""
    return {
        "nothing_changed": not found.stated,
        "sentences": level_one_sentences(found),
        "left_out": list(found.left_out),
        "quantities": [
            {
                "id": d.quantity.key,
                "unit": KINDS[d.quantity.kind].unit,
                "logarithm": KINDS[d.quantity.kind].logarithm,
                "stated": d.stated,
                "difference": d.value,
                "interval_95": list(d.interval()),
                "scatter": d.scatter,
                "false_alarm_rate": d.false_alarms,
                "smallest_stated": d.smallest,
                "may_be": list(CAUSES[d.quantity.kind]),
                "explained_by": list(explained.get(d.quantity.key, ())),
                "good": [{"flight": f.name, "value": f.value, "sd": f.sd} for f in d.good],
                "new": [{"flight": f.name, "value": f.value, "sd": f.sd} for f in d.new],
            }
            for d in found.differences
        ],
    }
