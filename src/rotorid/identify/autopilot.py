"""What a flight says of an autopilot's parameters: each with its 95 % interval, or "not determined by this flight".

A motor's signal u is what it is sent as a share of its range, 0 to 1 (the contract's `throttle_i`). By the autopilot's
own thrust curve, as published, it makes a steady share of the thrust at u = 1 (grams on the Crazyflie); the rotor's
speed, the root of the thrust, follows with a lag of first order. The accelerometer reads, upward, the thrust over the
mass, whatever the attitude and the wind. What else moves the thrust is estimated jointly: the voltage of the battery
(or, where it is not recorded, a drift over the run), the axial speed, the lift of forward flight, and the zero of the
accelerometer, believed to 0.1 m/s².

Drag is by PX4's own law (EKF2_BCOEF_X, EKF2_BCOEF_Y, EKF2_MCOEF), the specific force across the rotors' axis

    a = −½ ρ b |v| v − M √(ρ/1.225) v,   b = |(v_x/B_x, v_y/B_y)| / |(v_x, v_y)|

with v the velocity through the air in body axes. Source: PX4-Autopilot,
src/modules/ekf2/EKF/aid_sources/drag/drag_fusion.cpp. Its own script for the numbers (mc_wind_estimator_tuning.py)
takes the air for still; here each run has a constant wind of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches

import numpy as np
from scipy.signal import lfilter

from rotorid.errors import InputError
from rotorid.identify.correlated import EstimatedNumber, Stretch, fit, stretches_of
from rotorid.io.text.wording import printable
from rotorid.recordings import RecordingSet

_WIDEST_SHARE = 0.5
"""Half width over the value beyond which a time constant or a drag is not determined."""
_WIDEST_HOVER = 0.1
_WIDEST_WIND_M_S = 1.0
_AT_A_BOUND = 0.01
"""Share of the range searched within which a value is at its end."""
_HOVERS = {"px4": ("MPC_THR_HOVER", (0.1, 0.8)), "ardupilot": ("MOT_THST_HOVER", (0.125, 0.6875))}
"""By autopilot the parameter for the share of thrust that hovers, and what it may be."""
_CURVE_POINTS = 3001
_SPIN_MAX = 0.95
"""Default of ArduPilot's MOT_SPIN_MAX, at which its curve ends."""
_SPIN_MIN_BELIEVED = 0.3 / np.sqrt(12)
"""MOT_SPIN_MIN is believed to lie in what ArduPilot takes, 0 to 0.3: the deviation of an even spread. Without it a
curve that is nearly a square (MOT_THST_EXPO near 1) leaves a line of pairs that fit alike."""
_TIME_CONSTANTS_S = (0.002, 0.4)
_RATE_HZ = 100.0
"""Residuals are averaged down to about so many a second: there is nothing above that the motors could do."""
_DRIFT, _AXIAL, _LIFT = 0.1, 1.0, 0.05
"""Usual sizes: share of thrust that drifts over a run, m/s² per m/s of axial speed, m/s² per (m/s)² across."""
_AIR_DENSITY_KG_M3 = 1.225
_DRAG_RATE_HZ = 20.0
"""Residuals are averaged down to about so many a second: drag follows the velocity, which is slow."""
_LEAST_AIRSPEED_M_S = 1e-3
_ZERO_M_S2 = 0.3
"""Believed deviation of the specific force at rest: the accelerometer's zero, and rotors whose axis is not quite z."""


@dataclass(frozen=True)
class _Shape:
    """A number of a map: its name in the autopilot, where its estimate starts, and between what it lies."""

    name: str
    start: float
    low: float
    high: float
    """Bounds of the estimate; wider than what the autopilot takes, so that an interval is not cut."""
    allowed: tuple[float, float]
    """What the autopilot takes."""
    widest: float
    """Half width of the 95 % interval beyond which the flight does not determine it."""
    decimals: int = 3
    factor: float = 1.0
    """From the estimate to the number that the autopilot takes."""
    believed: float = np.inf
    """Standard deviation about the start that is believed before the flight."""


@dataclass(frozen=True)
class _ThrustMap:
    """A thrust curve with its free numbers.

    `thrust` takes signals (n, k), battery voltage (n, 1) or None, and the numbers of `shapes`; it returns shares of the
    thrust at full signal (n, k), or grams where `in_grams`.
    """

    autopilot: str
    shapes: tuple[_Shape, ...]
    thrust: Callable[[np.ndarray, np.ndarray | None, np.ndarray], np.ndarray]
    equation: str
    source: str
    in_grams: bool = False
    full_signal: float = 1.0
    """Signal of full thrust."""


def _px4(signal: np.ndarray, voltage: np.ndarray | None, shape: np.ndarray) -> np.ndarray:
    """T/T_max = f u² + (1 − f) u, f = THR_MDL_FAC."""
    return shape[0] * signal**2 + (1 - shape[0]) * signal


def _ardupilot(signal: np.ndarray, voltage: np.ndarray | None, shape: np.ndarray) -> np.ndarray:
    """T/T_max = e r² + (1 − e) r with r = (u − spin_min)/(spin_max − spin_min); none below spin_min."""
    expo, spin_min = shape
    r = np.maximum(signal - spin_min, 0.0) / (_SPIN_MAX - spin_min)
    return expo * r**2 + (1 - expo) * r


def _betaflight(signal: np.ndarray, voltage: np.ndarray | None, shape: np.ndarray) -> np.ndarray:
    """T/T_max = x where u = x (1 + k (1 − x)²), k = thrust_linear/100; below k = 3 one x for each u."""
    most_share = 1.5  # Shares of thrust up to which Betaflight's curve is inverted: a signal above its range is no use.
    x = np.linspace(0.0, most_share, _CURVE_POINTS)
    return np.interp(signal, x * (1 + shape[0] * (1 - x) ** 2), x)


def _crazyflie(signal: np.ndarray, voltage: np.ndarray | None, shape: np.ndarray) -> np.ndarray:
    """Grams t of a rotor where u V = c_1 t + c_2 t²."""
    volts = signal * (1.0 if voltage is None else voltage)
    root = np.sqrt(np.maximum(shape[0] ** 2 + 4 * shape[1] * volts, 1e-6 * shape[0] ** 2))
    return 2 * volts / (shape[0] + root)


MAPS = {
    "px4": _ThrustMap(
        "PX4",
        (_Shape("THR_MDL_FAC", 0.5, -0.5, 1.6, (0.0, 1.0), 0.25),),
        _px4,
        "T/T_max = f u² + (1 − f) u, f = THR_MDL_FAC",
        "PX4-Autopilot, src/lib/mixer_module/motor_params.c (THR_MDL_FAC) and functions/FunctionMotors.hpp",
    ),
    "ardupilot": _ThrustMap(
        "ArduPilot",
        (
            _Shape("MOT_THST_EXPO", 0.5, -0.9, 1.8, (-1.0, 1.0), 0.25),
            _Shape("MOT_SPIN_MIN", 0.15, -0.2, 0.4, (0.0, 0.3), 0.08, believed=_SPIN_MIN_BELIEVED),
        ),
        _ardupilot,
        f"T/T_max = e r² + (1 − e) r, r = (u − MOT_SPIN_MIN)/({_SPIN_MAX:g} − MOT_SPIN_MIN), e = MOT_THST_EXPO",
        "ardupilot, libraries/AP_Motors/AP_Motors_Thrust_Linearization.cpp, with MOT_SPIN_MAX at its default",
        full_signal=_SPIN_MAX,
    ),
    "betaflight": _ThrustMap(
        "Betaflight",
        (_Shape("thrust_linear", 0.3, -0.6, 2.5, (0.0, 1.5), 0.25, 0, 100.0),),
        _betaflight,
        "u = x (1 + k (1 − x)²), x = T/T_max, k = thrust_linear/100",
        "Betaflight 4.5, src/main/flight/pid.c, pidApplyThrustLinearization, and pid_init.c",
    ),
    "crazyflie": _ThrustMap(
        "Crazyflie",
        (
            _Shape("volts_per_gram", 0.088, 0.01, 0.5, (0.0, np.inf), 0.02, 5),
            _Shape("volts_per_gram_squared", -0.0006239, -0.004, 0.01, (-np.inf, np.inf), 0.0008, 7),
        ),
        _crazyflie,
        "u V = c_1 t + c_2 t², t in grams a rotor, V the battery's voltage",
        "crazyflie-firmware, src/drivers/src/motors.c, motorsCompensateBatteryVoltage (c_1 = 0.088, c_2 = −0.0006239)",
        in_grams=True,
    ),
}
"""By the name that `--to` takes."""


def _fit_thrust(stretches: Sequence[Stretch], chosen: _ThrustMap, mass_kg: float, gravity_m_s2: float) -> tuple | None:
    """The thrust curve; None where no stretch has signals of the motors (or, for grams, the battery's voltage).

    Estimates of the map's numbers in its order, of the time constant, s, of the motors' signal that makes the weight, 0
    to 1, and of the weight over the thrust at full signal; 1 % and 99 % quantile of the signals flown.
    """
    used = [s for s in stretches if s.throttle is not None and not (chosen.in_grams and s.voltage is None)]
    if not used:
        return None
    at, (start, low, high, scale, prior) = _layout(used, chosen)
    shapes = slice(at["shape 0"], at["lag"])
    if not chosen.in_grams:
        mean = np.concatenate([s.throttle for s in used]).mean(keepdims=True)[None]
        share = max(float(chosen.thrust(mean, None, start[shapes]).mean()), 1e-3)
        start[at["full"]] = np.log(gravity_m_s2 / share)
    found = fit(_residuals(used, chosen, at, mass_kg), start, (low, high), scale, prior)
    volts = None
    if chosen.in_grams:
        volts = np.full((1, 1), np.mean(np.concatenate([s.voltage for s in used])))

    def lifted(values: np.ndarray, signal: float) -> float:
        """m/s² of all rotors at one signal."""
        share = chosen.thrust(np.array([[signal]]), volts, values[shapes])
        return float(share[0, 0]) * _per_share(values, chosen, mass_kg, used[0].throttle.shape[1])

    signals = np.concatenate([s.throttle.ravel() for s in used])
    # The exponential of the lag's logarithm: its interval stays positive.
    log = found.of(lambda v: float(v[at["lag"]]))
    least_s, most_s = map(float, np.exp(np.clip(log.interval_95, -50, 50)))
    return (
        [found.of(lambda v, k=k: float(v[k])) for k in range(shapes.start, shapes.stop)],
        EstimatedNumber(float(np.exp(log.value)), (least_s, most_s)),
        found.of(lambda v: _solve(lambda u: lifted(v, u), gravity_m_s2)),
        found.of(lambda v: gravity_m_s2 / lifted(v, chosen.full_signal)),
        (float(np.quantile(signals, 0.01)), float(np.quantile(signals, 0.99))),
    )


def _per_share(values: np.ndarray, chosen: _ThrustMap, mass_kg: float, rotors: int) -> float:
    """m/s² that all rotors make by a share (or a gram a rotor)."""
    standard_gravity = 9.80665  # m/s²: grams of thrust are by it.
    return rotors * 1e-3 * standard_gravity / mass_kg if chosen.in_grams else float(np.exp(values[0]))


def _solve(rising: Callable[[float], float], wanted: float) -> float:
    """Where a rising function reaches a value, by bisection on signals of 0 to 2."""
    low, high = 0.0, 2.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if rising(middle) < wanted else (low, middle)
    return (low + high) / 2


def _layout(used: Sequence[Stretch], chosen: _ThrustMap) -> tuple[dict[str, int], np.ndarray]:
    """Which value is where, by name, and (5, p) of each the start, lowest, highest, usual size and believed deviation.

    `full` is the gain, `shape i` are the map's numbers; `drift of RUN`, `axial` and `lift` are what else moves thrust.
    """
    accelerometer_zero_m_s2 = 0.1  # Standard deviation of the error of an accelerometer's zero that is believed.
    voltage_moves = 0.01  # Share of the voltage that it must vary by for its part to be estimated.
    rows: dict[str, tuple[float, float, float, float, float]] = {}
    if not chosen.in_grams:
        rows["full"] = np.log(25.0), np.log(2.0), np.log(1000.0), 0.1, np.inf
    for i, shape in enumerate(chosen.shapes):
        rows[f"shape {i}"] = shape.start, shape.low, shape.high, (shape.high - shape.low) / 10, shape.believed
    rows["lag"] = np.log(0.04), *np.log(_TIME_CONSTANTS_S), 0.3, np.inf
    rows["zero"] = 0.0, -2.0, 2.0, accelerometer_zero_m_s2, accelerometer_zero_m_s2
    if not chosen.in_grams and all(s.voltage is not None for s in used):
        volts = np.concatenate([s.voltage for s in used])
        if np.ptp(volts) > voltage_moves * float(volts.mean()):
            rows["voltage"] = 1.0, -2.0, 5.0, 0.5, np.inf
    elif not chosen.in_grams:
        rows |= {f"drift of {s.run}": (0.0, -1.0, 1.0, _DRIFT, np.inf) for s in used}
    if all(s.attitude is not None and s.velocity is not None for s in used):
        rows |= {"axial": (0.0, -5.0, 5.0, _AXIAL, np.inf), "lift": (0.0, -1.0, 1.0, _LIFT, np.inf)}
    return {name: place for place, name in enumerate(rows)}, np.array(list(rows.values())).T


def _residuals(used: Sequence[Stretch], chosen: _ThrustMap, at: dict[str, int], mass_kg: float):
    """The function from values to the residuals of each stretch, m/s², averaged down to `_RATE_HZ`."""
    full_voltage = float(np.concatenate([s.voltage for s in used]).mean()) if "voltage" in at else 1.0
    prepared = []
    for s in used:
        through = None
        if "axial" in at:
            body = np.einsum("nji,nj->ni", s.attitude, s.velocity)
            through = np.stack([body[:, 2], body[:, 0] ** 2 + body[:, 1] ** 2], axis=1)
        middle, length = s.time_s.mean(), max(np.ptp(s.time_s), 1e-9)
        prepared.append((s, through, (s.time_s - middle) / length, max(int(round(1 / (_RATE_HZ * s.dt_s))), 1)))

    def residuals(values: np.ndarray) -> list[np.ndarray]:
        out = []
        for s, through, along, every in prepared:
            volts = None if s.voltage is None else s.voltage[:, None]
            steady = np.maximum(chosen.thrust(s.throttle, volts, values[at["shape 0"] : at["lag"]]), 0.0)
            thrust = (lagging(np.sqrt(steady), s.dt_s, np.exp(values[at["lag"]])) ** 2).mean(axis=1)
            up = thrust * _per_share(values, chosen, mass_kg, s.throttle.shape[1])
            if "voltage" in at:
                up = up * (s.voltage / full_voltage) ** values[at["voltage"]]
            if f"drift of {s.run}" in at:
                up = up * (1 + values[at[f"drift of {s.run}"]] * along)
            up = up + values[at["zero"]]
            if through is not None:
                up = up + through @ values[at["axial"] : at["lift"] + 1]
            out.append(_averaged(-s.specific_force[:, 2] - up, every))
        return out

    return residuals


def lagging(series: np.ndarray, dt_s: float, time_constant_s: float) -> np.ndarray:
    """Series (n, k) behind a lag of first order that starts settled; exact for straight lines between samples."""
    keep = np.exp(-dt_s / time_constant_s)
    ahead = 1 - (1 - keep) * time_constant_s / dt_s
    behind = (1 - keep) * time_constant_s / dt_s - keep
    return series[:1] + lfilter([ahead, behind], [1.0, -keep], series - series[:1], axis=0)


def _averaged(series: np.ndarray, every: int) -> np.ndarray:
    """Means of `every` neighbours, (n // every,)."""
    count = len(series) // every
    return series[: count * every].reshape(count, every).mean(axis=1)


def specific_drag(
    through_air: np.ndarray, bluff_x: float, bluff_y: float, momentum: float, density_kg_m3: float = _AIR_DENSITY_KG_M3
) -> np.ndarray:
    """Specific force (n, 2), m/s², along body x and y, of velocities through the air (n, 3), body axes."""
    across = through_air[:, :2]
    speed = np.maximum(np.linalg.norm(across, axis=1), _LEAST_AIRSPEED_M_S)
    bluff = np.linalg.norm(across * [bluff_x, bluff_y], axis=1) / speed
    quadratic = 0.5 * density_kg_m3 * bluff * np.linalg.norm(through_air, axis=1)
    return -(quadratic + momentum * np.sqrt(density_kg_m3 / _AIR_DENSITY_KG_M3))[:, None] * across


def _fit_drag(stretches: Sequence[Stretch]) -> tuple | None:
    """Drag by PX4's law, and wind; None where no stretch has attitude and velocity.

    Estimates of 1/EKF2_BCOEF_X and 1/EKF2_BCOEF_Y, m²/kg, and EKF2_MCOEF, 1/s; by run those of the wind towards north
    and east, m/s; 99 % quantile of the horizontal speed, m/s.
    """
    wind_m_s = 5.0  # Believed deviation of each component of the wind about none.
    used = [s for s in stretches if s.attitude is not None and s.velocity is not None]
    if not used:
        return None
    runs = list(dict.fromkeys(s.run for s in used))
    bluff, momentum = (0.02, -0.2, 1.0, 0.02, np.inf), (0.1, -1.0, 3.0, 0.1, np.inf)
    zero, wind = (0.0, -3.0, 3.0, _ZERO_M_S2, _ZERO_M_S2), (0.0, -30.0, 30.0, 2.0, wind_m_s)
    rows = [bluff, bluff, momentum, zero, zero, *[wind] * (2 * len(runs))]
    start, low, high, scale, prior = np.array(rows).T

    def residuals(values: np.ndarray) -> list[np.ndarray]:
        out = []
        for s in used:
            at = 5 + 2 * runs.index(s.run)
            moving = s.velocity - np.array([*values[at : at + 2], 0.0])
            through = np.einsum("nji,nj->ni", s.attitude, moving)
            force = specific_drag(through, *values[:3]) + values[3:5]
            every = max(int(round(1 / (_DRAG_RATE_HZ * s.dt_s))), 1)
            out += [_averaged(s.specific_force[:, j] - force[:, j], every) for j in range(2)]
        return out

    found = fit(residuals, start, (low, high), scale, prior)
    of = [found.of(lambda v, k=k: float(v[k])) for k in range(len(rows))]
    across = np.concatenate([np.linalg.norm(s.velocity[:, :2], axis=1) for s in used])
    winds = {run: (of[5 + 2 * k], of[6 + 2 * k]) for k, run in enumerate(runs)}
    return of[:3], winds, float(np.quantile(across, 0.99))


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
        meant = f"; did you mean {near[0]}?" if near else f", expected {', '.join(MAPS)}"
        raise InputError(f"no autopilot is called {to!r}{meant}")
    stretches = stretches_of(recordings)
    chosen, vehicle = MAPS[to], recordings.vehicle
    thrust = _fit_thrust(stretches, chosen, vehicle.mass_kg, vehicle.gravity_m_s2)
    if thrust is not None:
        out = _of_thrust(*thrust, chosen, to)
    else:
        with_volts = " together with the battery's voltage" if chosen.in_grams else ""
        names = [s.name for s in chosen.shapes] + ([_HOVERS[to][0]] if to in _HOVERS else [])
        why = f"it holds no signals of the motors (throttle_1 …){with_volts}"
        out = [_nothing(name, "", why) for name in (*names, "hover_signal", "motor_time_constant_s")]
    if to == "px4" and (drag := _fit_drag(stretches)) is not None:
        out += _of_drag(*drag)
    elif to == "px4":
        units = {"EKF2_BCOEF_X": "kg/m²", "EKF2_BCOEF_Y": "kg/m²", "EKF2_MCOEF": "1/s"}
        out += [_nothing(name, unit, "drag needs attitude and velocity") for name, unit in units.items()]
    return tuple(out)


_NOT = "not determined by this flight"


def _nothing(name: str, unit: str, why: str) -> AutopilotParameter:
    return AutopilotParameter(name, np.nan, (-np.inf, np.inf), unit, False, f"{_NOT}: {why}")


def _stated(name, number: EstimatedNumber, unit, fine: bool, sentence, to_set=None, decimals=3) -> AutopilotParameter:
    return AutopilotParameter(
        name, number.value, number.interval_95, unit, fine, sentence, to_set if fine else None, decimals
    )


def _of_thrust(shapes, lag, hover, share, throttle_range, chosen: _ThrustMap, to: str) -> list[AutopilotParameter]:
    flown = "signals from {:.2f} to {:.2f} were flown".format(*throttle_range)
    out = []
    for shape, estimate in zip(chosen.shapes, shapes, strict=True):
        unit = {"volts_per_gram": "V/g", "volts_per_gram_squared": "V/g²"}.get(shape.name, "")
        outside = estimate.interval_95[1] < shape.allowed[0] or estimate.interval_95[0] > shape.allowed[1]
        margin = _AT_A_BOUND * (shape.high - shape.low)
        at_bound = not shape.low + margin < estimate.value < shape.high - margin
        wide = at_bound or not estimate.half_width <= shape.widest
        sentence = f"{chosen.equation}; {flown}"
        if at_bound:
            sentence = f"{_NOT}: {flown}, and no curve of this form fits them"
        elif wide:
            sentence = f"{_NOT}: {flown}, which is too little; fly climbs and descents"
        elif outside:
            ends = f"{shape.factor * shape.allowed[0]:g} to {shape.factor * shape.allowed[1]:g}"
            sentence += f"; {chosen.autopilot} takes {ends}: the nearest is to be set"
        low, high = (shape.factor * end for end in estimate.interval_95)
        number = EstimatedNumber(shape.factor * estimate.value, (low, high))
        settable = shape.factor * float(np.clip(estimate.value, *shape.allowed))
        out.append(_stated(shape.name, number, unit, not wide, sentence, settable, shape.decimals))
    curve = all(p.determined for p in out)
    if to in _HOVERS:
        name, allowed = _HOVERS[to]
        fine = share.half_width <= _WIDEST_HOVER * share.value and curve
        sentence = "weight over full thrust; it belongs to the thrust curve above"
        if not fine:
            sentence = f"{_NOT}: full thrust follows from the curve, which it does not determine"
        out.append(_stated(name, share, "", fine, sentence, float(np.clip(share.value, *allowed))))
    fine = hover.half_width <= _WIDEST_HOVER * hover.value
    out.append(_stated("hover_signal", hover, "", fine, "signal of the motors that makes the weight" if fine else _NOT))
    inside = 1.1 * _TIME_CONSTANTS_S[0] < lag.value < _TIME_CONSTANTS_S[1] / 1.1
    fine = lag.half_width <= _WIDEST_SHARE * lag.value and inside
    sentence = "lag of the rotors' speed behind the signal, with that of the accelerometer's filter"
    if not fine:
        sentence = f"{_NOT}: the thrust changed too slowly, or the log is too coarse, to see it"
    return [*out, _stated("motor_time_constant_s", lag, "s", fine, sentence, decimals=4)]


def _of_drag(drag, wind, fastest_m_s: float) -> list[AutopilotParameter]:
    largest_bcoef = 200.0  # kg/m²: PX4 takes no more (EKF2_BCOEF_X, its range).
    flown = f"speeds up to {fastest_m_s:.1f} m/s were flown"
    out = []
    for name, estimate in zip(("EKF2_BCOEF_X", "EKF2_BCOEF_Y"), drag, strict=False):
        low, high = estimate.interval_95
        ends = (1 / high if high > 0 else np.inf, 1 / low if low > 0 else np.inf)
        value = 1 / estimate.value if estimate.value > 0 else np.inf
        fine = low > 0 and estimate.half_width <= _WIDEST_SHARE * estimate.value
        sentence = f"mass over drag area, jointly with the wind; {flown}"
        if not fine:
            at_least = f"; at least {ends[0]:.3g} kg/m²" if np.isfinite(ends[0]) and ends[0] > 0 else ""
            sentence = f"{_NOT}: {flown}; fly faster, there and back{at_least}"
        number = EstimatedNumber(value, ends)
        out.append(_stated(name, number, "kg/m²", fine, sentence, min(value, largest_bcoef), 1))
    momentum = drag[2]
    fine = momentum.half_width <= _WIDEST_SHARE * abs(momentum.value)
    sentence = f"{'drag of the rotors, jointly with the wind' if fine else _NOT}; {flown}"
    out.append(_stated("EKF2_MCOEF", momentum, "1/s", fine, sentence, max(momentum.value, 0.0)))
    for run, parts in wind.items():
        for word, part in zip(("north", "east"), parts, strict=True):
            fine = part.half_width <= _WIDEST_WIND_M_S
            sentence = "towards which the air moved, on the mean of the run" if fine else _NOT
            out.append(_stated(f"wind_{word}_m_s ({run})", part, "m/s", fine, sentence, decimals=2))
    return out


def as_text(found: Sequence[AutopilotParameter], to: str) -> str:
    """A file that the autopilot's tools load: what is determined as settings, the rest as comments.

    PX4: QGroundControl's parameter file; ArduPilot: `NAME,VALUE`; Betaflight: CLI; Crazyflie: the constants of
    `motors.c` as comments, because its firmware has no parameter for them.
    """
    lines = [f"# {MAPS[to].autopilot}: {MAPS[to].equation}", f"# Source: {MAPS[to].source}"]
    for p in found:
        low, high = p.interval_95
        shown = f"{p.value:.{p.decimals}f} [{low:.{p.decimals}f}, {high:.{p.decimals}f}] {p.unit}".rstrip()
        lines.append(f"# {p.name} = {shown}: {printable(p.sentence)}")
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
