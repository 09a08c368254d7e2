"""What a flight says of an autopilot's parameters: each with its 95 % interval, or "not determined by this flight"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches

import numpy as np

from rotorid.errors import InputError
from rotorid.identify.autopilot.correlated import EstimatedNumber, stretches_of
from rotorid.identify.autopilot.thrust import (
    MAPS,
    TIME_CONSTANTS_S,
    DragFit,
    ThrustFit,
    ThrustMap,
    fit_drag,
    fit_thrust,
)
from rotorid.recordings import RecordingSet

_WIDEST_SHARE = 0.5
"""Half width over the value beyond which a time constant or a drag is not determined."""
_WIDEST_HOVER = 0.1
_WIDEST_WIND_M_S = 1.0
_AT_A_BOUND = 0.01
"""Share of the range searched within which a value is at its end."""
_LARGEST_BCOEF = 200.0
"""kg/m²: PX4 takes no more (EKF2_BCOEF_X, its range)."""
_HOVERS = {"px4": ("MPC_THR_HOVER", (0.1, 0.8)), "ardupilot": ("MOT_THST_HOVER", (0.125, 0.6875))}
"""By autopilot the parameter for the share of thrust that hovers, and what it may be."""


@dataclass(frozen=True)
class AutopilotParameter:
    """One number for an autopilot."""

    name: str
    value: float
    interval_95: tuple[float, float]
    """Infinite where nothing bounds it."""
    unit: str
    determined: bool
    sentence: str
    """What it is, and why it is not determined where it is not."""
    to_set: float | None = None
    """The number to set; None for what the autopilot has no parameter for, or the flight does not determine."""
    decimals: int = 3


def parameters_of(recordings: RecordingSet, to: str) -> tuple[AutopilotParameter, ...]:
    """The parameters of an autopilot (`px4`, `ardupilot`, `betaflight`, `crazyflie`) by a set of flights.

    InputError names the autopilots there are, or what the recordings lack for all of it.
    """
    if to not in MAPS:
        near = get_close_matches(to, list(MAPS), 1)
        raise InputError(
            f"no autopilot is called {to!r}"
            + (f"; did you mean {near[0]}?" if near else f", expected {', '.join(MAPS)}")
        )
    stretches = stretches_of(recordings)
    chosen, vehicle = MAPS[to], recordings.vehicle
    thrust = fit_thrust(stretches, chosen, vehicle.mass_kg, vehicle.gravity_m_s2)
    out = _missing(chosen, to) if thrust is None else _of_thrust(thrust, chosen, to)
    if to == "px4":
        drag = fit_drag(stretches)
        out += _no_drag() if drag is None else _of_drag(drag)
    return tuple(out)


def _nothing(name: str, unit: str, why: str) -> AutopilotParameter:
    return AutopilotParameter(name, np.nan, (-np.inf, np.inf), unit, False, f"not determined by this flight: {why}")


def _missing(chosen: ThrustMap, to: str) -> list[AutopilotParameter]:
    why = "it holds no signals of the motors (throttle_1 …)"
    if chosen.in_grams:
        why += " together with the battery's voltage"
    names = [s.name for s in chosen.shapes] + ([_HOVERS[to][0]] if to in _HOVERS else [])
    return [_nothing(name, "", why) for name in (*names, "hover_signal", "motor_time_constant_s")]


def _no_drag() -> list[AutopilotParameter]:
    why = "drag needs attitude and velocity"
    units = {"EKF2_BCOEF_X": "kg/m²", "EKF2_BCOEF_Y": "kg/m²", "EKF2_MCOEF": "1/s"}
    return [_nothing(name, unit, why) for name, unit in units.items()]


def _of_thrust(found: ThrustFit, chosen: ThrustMap, to: str) -> list[AutopilotParameter]:
    flown = "signals from {:.2f} to {:.2f} were flown".format(*found.throttle_range)
    out = []
    for shape, estimate in zip(chosen.shapes, found.shapes, strict=True):
        unit = {"volts_per_gram": "V/g", "volts_per_gram_squared": "V/g²"}.get(shape.name, "")
        low, high = (shape.factor * end for end in estimate.interval_95)
        outside = estimate.interval_95[1] < shape.allowed[0] or estimate.interval_95[0] > shape.allowed[1]
        margin = _AT_A_BOUND * (shape.high - shape.low)
        at_bound = not shape.low + margin < estimate.value < shape.high - margin
        wide = at_bound or not estimate.half_width <= shape.widest
        sentence = f"{chosen.equation}; {flown}"
        if at_bound:
            sentence = f"not determined by this flight: {flown}, and no curve of this form fits them"
        elif wide:
            sentence = f"not determined by this flight: {flown}, which is too little; fly climbs and descents"
        elif outside:
            ends = f"{shape.factor * shape.allowed[0]:g} to {shape.factor * shape.allowed[1]:g}"
            sentence += f"; {chosen.autopilot} takes {ends}: the nearest is to be set"
        value = shape.factor * estimate.value
        settable = shape.factor * float(np.clip(estimate.value, *shape.allowed))
        out.append(
            AutopilotParameter(
                shape.name, value, (low, high), unit, not wide, sentence, None if wide else settable, shape.decimals
            )
        )
    curve = all(p.determined for p in out)
    if to in _HOVERS:
        name, allowed = _HOVERS[to]
        share = found.hover_share
        fine = share.half_width <= _WIDEST_HOVER * share.value and curve
        sentence = "weight over full thrust; it belongs to the thrust curve above"
        if not fine:
            sentence = "not determined by this flight: full thrust follows from the curve, which it does not determine"
        out.append(
            AutopilotParameter(
                name, share.value, share.interval_95, "", fine, sentence,
                float(np.clip(share.value, *allowed)) if fine else None,
            )
        )  # fmt: skip
    hover, lag = found.hover_signal, found.time_constant_s
    fine = hover.half_width <= _WIDEST_HOVER * hover.value
    sentence = "signal of the motors that makes the weight" if fine else "not determined by this flight"
    out.append(AutopilotParameter("hover_signal", hover.value, hover.interval_95, "", fine, sentence))
    fine = (
        lag.half_width <= _WIDEST_SHARE * lag.value
        and 1.1 * TIME_CONSTANTS_S[0] < lag.value < TIME_CONSTANTS_S[1] / 1.1
    )
    sentence = "lag of the rotors' speed behind the signal, with that of the accelerometer's filter"
    if not fine:
        sentence = "not determined by this flight: the thrust changed too slowly, or the log is too coarse, to see it"
    out.append(AutopilotParameter("motor_time_constant_s", lag.value, lag.interval_95, "s", fine, sentence, decimals=4))
    return out


def _of_drag(found: DragFit) -> list[AutopilotParameter]:
    flown = f"speeds up to {found.fastest_m_s:.1f} m/s were flown"
    out = []
    for name, estimate in (("EKF2_BCOEF_X", found.bluff_x), ("EKF2_BCOEF_Y", found.bluff_y)):
        low, high = estimate.interval_95
        ends = (1 / high if high > 0 else np.inf, 1 / low if low > 0 else np.inf)
        value = 1 / estimate.value if estimate.value > 0 else np.inf
        fine = low > 0 and estimate.half_width <= _WIDEST_SHARE * estimate.value
        sentence = f"mass over drag area, jointly with the wind; {flown}"
        if not fine:
            at_least = f"; at least {ends[0]:.3g} kg/m²" if np.isfinite(ends[0]) and ends[0] > 0 else ""
            sentence = f"not determined by this flight: {flown}; fly faster, there and back{at_least}"
        out.append(
            AutopilotParameter(
                name, value, ends, "kg/m²", fine, sentence, min(value, _LARGEST_BCOEF) if fine else None, 1
            )
        )
    m = found.momentum
    fine = m.half_width <= _WIDEST_SHARE * abs(m.value)
    sentence = "drag of the rotors, jointly with the wind" if fine else "not determined by this flight"
    sentence = f"{sentence}; {flown}"
    out.append(
        AutopilotParameter(
            "EKF2_MCOEF", m.value, m.interval_95, "1/s", fine, sentence, max(m.value, 0.0) if fine else None
        )
    )
    for run, wind in found.wind.items():
        for word, part in zip(("north", "east"), wind, strict=True):
            out.append(_wind(f"wind_{word}_m_s ({run})", part))
    return out


def _wind(name: str, part: EstimatedNumber) -> AutopilotParameter:
    fine = part.half_width <= _WIDEST_WIND_M_S
    sentence = "towards which the air moved, on the mean of the run" if fine else "not determined by this flight"
    return AutopilotParameter(name, part.value, part.interval_95, "m/s", fine, sentence, decimals=2)


def as_text(found: Sequence[AutopilotParameter], to: str) -> str:
    """A file that the autopilot's tools load: what is determined as settings, the rest as comments.

    PX4: QGroundControl's parameter file; ArduPilot: `NAME,VALUE`; Betaflight: CLI; Crazyflie: the constants of
    `motors.c` as comments, because its firmware has no parameter for them.
    """
    lines = [f"# {MAPS[to].autopilot}: {MAPS[to].equation}", f"# Source: {MAPS[to].source}"]
    for p in found:
        low, high = p.interval_95
        shown = f"{p.value:.{p.decimals}f} [{low:.{p.decimals}f}, {high:.{p.decimals}f}] {p.unit}".rstrip()
        lines.append(f"# {p.name} = {shown}: {p.sentence}")
        if p.to_set is None:
            continue
        value = f"{p.to_set:.{p.decimals}f}"
        lines += {
            "px4": [f"1\t1\t{p.name}\t{value}\t9"],
            "ardupilot": [f"{p.name},{value}"],
            "betaflight": [f"set {p.name} = {value}"],
            "crazyflie": [],
        }[to]
    return "\n".join([*lines, *(["save"] if to == "betaflight" else [])]) + "\n"
