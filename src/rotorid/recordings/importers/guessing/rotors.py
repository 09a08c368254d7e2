"""Speeds, commanded speeds and throttles of rotors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from rotorid.recordings.importers.guessing import names as named
from rotorid.recordings.importers.guessing.agreement import BY_NUMBERS_ALONE, CONTRADICTED, Draft, triples_of
from rotorid.recordings.importers.guessing.names import Family
from rotorid.recordings.importers.mapping import CHANNELS, ELECTRICAL, OPEN, UNITS, bracketed, stated

_RANGES: dict[str, tuple[float, float]] = {
    "a share": (0.0, 1.0),
    "-1 to 1": (-1.0, 1.0),
    "per cent": (0.0, 100.0),
    "8 bits": (0.0, 255.0),
    "per mille": (0.0, 1000.0),
    "10 bits": (0.0, 1023.0),
    "pulses in µs": (1000.0, 2000.0),
    "DShot": (48.0, 2047.0),
    "per ten thousand": (0.0, 10_000.0),
    "15 bits": (0.0, 32767.0),
    "16 bits": (0.0, 65535.0),
}
"""Readings of no and of full throttle; a motor that is off may read 0 in each."""
_RANGES_BY_NAME = {
    "pulses in µs": frozenset("us usec pwm pulse servo rcout rcou".split()),
    "DShot": frozenset(("dshot",)),
    "per cent": frozenset("percent pct".split()),
}
_AS_LARGE_AS_RPM = frozenset(("per ten thousand", "15 bits"))
_BETAFLIGHTS = ("DShot", "pulses in µs")
_UNNAMED = "no name says it"
_OTHER_THINGS = frozenset("current amps temp temperature voltage volt volts power thrust torque force".split())
"""Words of what a motor has besides a speed and a throttle."""


def guess_rotors(draft: Draft, quantity: str) -> None:
    families, how = named.numbered(draft.free()), "by their names"
    offered = [f for f in families if named.is_rotor(f, quantity)]
    if not offered and quantity == "throttle" and not {"rotor_speed", "rotor_command"} & set(draft.channels):
        unnamed = (f for f in families if not f.words & _OTHER_THINGS)
        offered, how = [f for f in unnamed if _carries(draft, f) > BY_NUMBERS_ALONE - 0.1], _UNNAMED
    if offered:
        # Without outputs that keep one value and drive nothing, unless fewer than three would be left.
        family = offered[0]
        spread = pd.DataFrame(draft.values(family.columns)).nunique()
        moving = tuple(n for n, count in zip(family.columns, spread, strict=True) if count > 1)
        several = 3 <= len(moving) < len(family.columns)
        _put(draft, quantity, replace(family, columns=moving) if several else family, how)


def guess_stand(draft: Draft) -> None:
    """Thrust and torque of a stand, and speed and throttle of its one rotor, by their names and the units in these."""
    if {"specific_force", "angular_velocity"} & set(draft.channels):
        return
    for quantity in ("thrust", "torque"):
        name = named.scalar(draft.free(), quantity)
        if name is None or not draft.table[name].notna().any():
            continue
        kind = CHANNELS[quantity][0]
        unit, top = stated(name, kind), float(np.nanmax(np.abs(draft.values([name]))))
        question = "" if unit else f"in which unit? Its largest value is {top:.4g}"
        draft.put(quantity, [name], f"by its name; up to {top:.4g}", question, unit=unit or OPEN)
    for quantity, family in six_axes(draft).items():
        kind = CHANNELS[quantity][0]
        unit = next(iter({stated(n, kind) for n in family.columns})) or OPEN
        draft.put(quantity, family.columns, "by their names", "in which unit?" if unit == OPEN else "", unit=unit)
    if not {"thrust", "force"} & set(draft.channels):
        return
    for quantity in ("rotor_speed", "throttle"):
        name = named.scalar(draft.free(), quantity)
        if quantity not in draft.channels and name is not None:
            unit = stated(name, "turns") if quantity == "rotor_speed" else ""
            words = frozenset(named.words_of(name))
            _put(draft, quantity, Family(name, (name,), "number", unit, words), "by its name")


def six_axes(draft: Draft) -> dict[str, Family]:
    """Force and moment of a stand by their names; next to a gyroscope, or alone without a unit, `f` is specific."""
    triples = triples_of(draft)
    if any(named.is_named(f, "angular_velocity") for f in triples):
        return {}
    moment = next((f for f in triples if named.is_named(f, "moment")), None)
    force = next((f for f in triples if named.is_named(f, "force")), None)
    if force is None or (moment is None and not stated(force.columns[2], "force")):
        return {}
    return {"force": force} | ({} if moment is None else {"moment": moment})


def _put(draft: Draft, quantity: str, family: Family, how: str) -> None:
    """A channel of rotors with its unit or range, or the question that is left."""
    values = draft.values(family.columns)
    if not np.isfinite(values).any():
        return
    top = float(np.nanquantile(np.abs(values), 0.99))
    evidence = f"{how}; up to {top:.5g}"
    follows = _carries(draft, family)
    if follows > CONTRADICTED:
        evidence += f"; with them grows the specific force along z (correlation {follows:.2f})"
    if quantity != "throttle":
        unit, why = _speed_unit(family, float(np.nanmedian(np.abs(values))), _is_betaflight(draft))
        question, more = "" if unit != OPEN else why, {}
        if _is_electrical(family):
            more = {"poles": OPEN}
            poles = "how many magnetic poles has a motor (14 on most of five-inch propellers)?"
            question = f"{question}; {poles}" if question else poles
        draft.put(quantity, family.columns, f"{evidence}; {why}", question, unit=unit, **more)
        return
    betaflight = _is_betaflight(draft)
    found = _possible_ranges(values, family, betaflight)
    speeds = how == _UNNAMED or (not betaflight and _can_be_speeds(values, family, found))
    if found == ["a share"]:
        draft.put(quantity, family.columns, f"{evidence}, so a share", unit="1")
    elif len(found) == 1 and not speeds:
        low, high = _RANGES[found[0]]
        more = f"so {found[0]}: no throttle is taken as {low:g} and full throttle as {high:g}"
        draft.put(quantity, family.columns, f"{evidence}, {more}", unit="raw", range=(low, high))
    else:
        kinds = " or ".join(f"[{_RANGES[k][0]:g}, {_RANGES[k][1]:g}] ({k})" for k in found)
        question = f"which readings are no and full throttle: {kinds or 'no usual range holds them'}?"
        if speeds:
            name = "rotor_command" if "rotor_speed" in draft.channels else "rotor_speed"
            question += f" Or are they speeds? Then call the channel {name} and state their unit"
        draft.put(quantity, family.columns, evidence, question, unit="raw", range=OPEN)


def _can_be_speeds(values: np.ndarray, family: Family, ranges: list[str]) -> bool:
    """Whether numbers that fit some ranges may be speeds, as no word says throttle: in rpm what fits the largest ranges
    alone, in rad/s what fits DShot alone, and never at an end of them."""
    given = values[values > 0]
    low, high = _RANGES["DShot"]
    words = {w.rstrip("0123456789") for column in family.columns for w in named.words_of(column)}
    if words & frozenset.union(*_RANGES_BY_NAME.values(), frozenset(("throttle", "throttles", "thr"))):
        return False
    in_rad_s = low < given.min() < _RANGES["pulses in µs"][0] < given.max() < high
    in_rpm = set(ranges) <= _AS_LARGE_AS_RPM and given.max() not in [_RANGES[kind][1] for kind in ranges]
    return bool(ranges) and (in_rpm or (ranges == ["DShot"] and in_rad_s))


def _is_betaflight(draft: Draft) -> bool:
    """Whether the columns are those of a decoded blackbox log."""
    plain = {bracketed(n)[0] for n in draft.table.columns}
    return {"gyroADC[0]", "motor[0]"} <= plain or {"loopIteration", "motor[0]"} <= plain


def _possible_ranges(values: np.ndarray, family: Family, betaflight: bool) -> list[str]:
    """The `_RANGES` that hold throttles (n, k) and leave a vehicle that hovers in their middle.

    Where several do, one whose end the throttles reach exactly.
    """
    hovers = (0.12, 0.92)  # Shares of full throttle at which multirotors spend most of a flight.
    lowest_pulse_us = 880.0  # Pulses of motors that are disarmed go down to 900 µs.
    # Above this in hover and never below 1000, DShot would be a motor that never gets less than half of its power.
    pulses_of_hover_us = 1300.0
    known = values[np.isfinite(values)]
    given = known[known > 0] if (known >= 0).all() else known
    if not len(given):
        return []
    low, middle, high = np.quantile(given, [0.005, 0.5, 0.995])
    names = {w for column in family.columns for w in named.words_of(column)}
    named_so = next((kind for kind, words in _RANGES_BY_NAME.items() if names & words), None)
    if all(stated(column, "share") == "%" for column in family.columns):
        named_so = "per cent"
    among = (named_so,) if named_so else _BETAFLIGHTS if betaflight else tuple(_RANGES)
    held = []
    for kind in among:
        bottom, full = _RANGES[kind]
        below = lowest_pulse_us if kind == "pulses in µs" else bottom - 0.02 * (full - bottom)
        if (kind == "-1 to 1" and low >= 0) or (kind == "per ten thousand" and high <= _RANGES["DShot"][1]):
            continue
        if below <= low and high <= full + 0.02 * (full - bottom):
            held.append(kind)
    if named_so is None and not betaflight:
        fits = [k for k in held if hovers[0] <= (middle - _RANGES[k][0]) / np.ptp(_RANGES[k]) <= hovers[1]]
        held = fits or [k for k in held if k in ("a share", "-1 to 1")][:1] or held
        if low >= _RANGES["pulses in µs"][0] and middle > pulses_of_hover_us:
            held = [k for k in held if k != "DShot"]
    reached = [k for k in held if given.max() == _RANGES[k][1] or (_RANGES[k][0] > 0 and given.min() == _RANGES[k][0])]
    return reached if len(reached) == 1 and len(held) > 1 else held


def _is_electrical(family: Family) -> bool:
    return "erpm" in family.words or family.unit in ELECTRICAL


def _speed_unit(family: Family, middle: float, betaflight: bool) -> tuple[str, str]:
    """Unit of rotor speeds by their names, else by where only one is possible; and why."""
    slowest_electrical_rpm = 3000.0
    # In hundreds of electrical turns a minute no motor turns faster than this in the middle of a flight.
    fastest_hundreds = 12_000.0
    if _is_electrical(family):
        if family.unit == "100erpm" or betaflight:
            return "100erpm", "hundreds of electrical turns a minute, as Betaflight logs them"
        if middle < slowest_electrical_rpm:
            return "100erpm", f"a median of {middle:.4g} electrical turns a minute is too slow: these are hundreds"
        if middle > fastest_hundreds:
            return "erpm", f"electrical turns a minute by the names; a median of {middle:.4g} is too fast for hundreds"
        return OPEN, f"a median of {middle:.4g} can be electrical turns a minute (erpm) or hundreds of them (100erpm)"
    if family.unit in UNITS["rotor"]:
        return family.unit, "the names state the unit"
    if "krpm" in {family.unit, *family.words}:
        return "krpm", "the names state the unit"
    if "rpm" in "_".join(family.words):
        if middle > 1000:
            return "rpm", "the names state the unit"
        return OPEN, f"the names say rpm, but a median of {middle:.4g} is slow for rpm"
    if middle > 5000:
        return "rpm", f"a median of {middle:.4g} is too fast for rad/s"
    if 600 < middle < 1500:
        return "rad/s", f"a median of {middle:.4g} is too slow for rpm and too fast for Hz"
    return OPEN, f"a median of {middle:.4g} can be {'rad/s or Hz' if middle <= 600 else 'rad/s or rpm'}"


def _carries(draft: Draft, family: Family) -> float:
    """Correlation of the mean of the columns with the size of the specific force along z, over short steps."""
    force = draft.channels.get("specific_force")
    if force is None or draft.instants is None:
        return 0.0
    values = draft.values(family.columns)
    if not np.nanmin(values) >= 0:
        return 0.0
    drive = draft.integrated(values.mean(axis=1, keepdims=True))[:, 0]
    pull = np.abs(draft.integrated(draft.values(force.columns)[:, [2]]))[:, 0]
    known = np.isfinite(drive) & np.isfinite(pull)
    if known.sum() < 10 or drive[known].std() == 0 or pull[known].std() == 0:
        return 0.0
    return float(np.corrcoef(drive[known], pull[known])[0, 1])
