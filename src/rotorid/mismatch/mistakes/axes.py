"""Axes and units that the sensors' agreement on one motion gives away: flipped, exchanged, or scaled columns."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.stats import t as student
from scipy.stats import ttest_1samp

from rotorid.mismatch.mistakes import lagged
from rotorid.mismatch.mistakes.signals import (
    SENSOR_WORDS,
    Corrected,
    ReadSet,
    Signals,
    established,
    replace_sensor,
    sensor_columns,
)
from rotorid.mismatch.mistakes.units import RATES, corrected, nearest
from rotorid.recordings import Vehicle

_LEAST_EXPLAINED = 0.4
"""Share of an axis that the other sensor must explain before anything is said of it."""
_LEAST_T = 8.0
"""Standard errors from zero of a gain that names an axis."""
_LEAST_GRAVITY = 0.6
"""Share of gravity that the mean specific force must show along an axis for its sign to count."""

_ATTITUDES = {
    "conjugated": ([1, -1, -1, -1], [0, 1, 2, 3]),
    "forward-left-up in a north-west-up world": ([1, 1, -1, -1], [0, 1, 2, 3]),
    "forward-left-up in a north-west-up world, conjugated": ([1, -1, 1, 1], [0, 1, 2, 3]),
    "stored scalar last": ([1, 1, 1, 1], [3, 0, 1, 2]),
    "stored scalar last and conjugated": ([1, -1, -1, -1], [3, 0, 1, 2]),
}
"""What may have been done to a quaternion: signs after an order of its columns, that undo it."""


@dataclass(frozen=True)
class Turn:
    """Signed axes of a sensor relative to another: recorded axis i is sign[i] times true axis source[i]."""

    source: tuple[int, ...]
    sign: tuple[int, ...]

    @property
    def identity(self) -> bool:
        return self.source == (0, 1, 2) and self.sign == (1, 1, 1)

    def undo(self, values: np.ndarray) -> np.ndarray:
        """Recorded values (n, 3) in true axes."""
        out = np.empty_like(values)
        out[:, self.source] = values * self.sign
        return out

    def text(self) -> str:
        """In words: which axes are flipped or exchanged."""
        names = "xyz"
        if self.source == (0, 1, 2):
            flipped = [names[i] for i in range(3) if self.sign[i] < 0]
            return f"{' and '.join(flipped)} {'has' if len(flipped) == 1 else 'have'} the wrong sign"
        signs = {1: "", -1: "−"}
        order = ", ".join(signs[s] + names[k] for k, s in zip(self.source, self.sign, strict=True))
        return f"x, y, z hold {order}"


@dataclass(frozen=True)
class _Reading:
    """What a fit of X to Y (both three axes) says: `turn` of X, `scale` of X, and how sure."""

    turn: Turn | None
    """None where only the scale was asked for."""
    scale: float
    scale_sd: float
    p_value: float


def read(fit: lagged.LaggedFit | None) -> _Reading | None:
    """Signed axes from the gains of a fit Y = M X, None where the motion determines too little.

    An axis that moves too little keeps the sign of the others' rule (itself).
    """
    dominance = 3.0  # The largest entry of a row over the next, for an axis to be identified.
    if fit is None:
        return None
    source, sign, gains, p_values = [0, 1, 2], [1, 1, 1], [], []
    for j in range(3):
        row, sd = fit.gain[j], np.maximum(fit.gain_sd[j], 1e-12)
        order = np.argsort(-np.abs(row))
        best = int(order[0])
        if fit.explained[j] < _LEAST_EXPLAINED or abs(row[best]) < _LEAST_T * sd[best]:
            continue
        if abs(row[best]) < dominance * abs(row[order[1]]):
            continue
        # Row j of M names the column of X that is true axis j.
        source[best], sign[best] = j, int(np.sign(row[best]))
        gains.append((abs(row[best]), sd[best]))
        p_values.append(float(student.sf(abs(row[best]) / sd[best], max(fit.block_count - 1, 1))))
    if not gains or sorted(source) != [0, 1, 2]:
        return None
    scale, scale_sd = np.median(gains, axis=0)
    return _Reading(Turn(tuple(source), tuple(sign)), float(scale), float(scale_sd), max(p_values))


def turned(recordings: ReadSet, sensor: str, turn: Turn, p_value: float) -> Corrected:
    """The set with a sensor's columns in the contract's axes, and where they were not the finding that says so."""
    if turn.identity:
        return Corrected(recordings)
    names = sensor_columns(recordings.vehicle)[sensor]
    touched = [n for i, n in enumerate(names) if turn.sign[i] < 0 or turn.source[i] != i]
    remedy = "flipped" if turn.source == (0, 1, 2) else "put in order"
    sentence = f"Of {SENSOR_WORDS[sensor]}'s axes, {turn.text()} ({', '.join(touched)}): {remedy}."
    finding = established("axis_sign", sentence, p_value, touched)
    return Corrected(replace_sensor(recordings, sensor, turn.undo), (finding,))


def find(recordings: ReadSet) -> Corrected:
    """Wrong axes and units of inertial sensors, attitude, velocity and position."""
    result = Corrected(recordings)
    for step in (_gravity, _turning, _accelerating, _sideways, _moving):
        result = result.then(step)
    return result


def _gravity(recordings: ReadSet) -> Corrected:
    """The accelerometer's z axis by gravity: a flying vehicle is supported by thrust along −z."""
    runs = [s for s in recordings.signals if "accelerometer" in s.values]
    if not runs:
        return Corrected(recordings)
    # Over −g along body z: about (0, 0, 1) where all is well.
    mean = np.nanmean(np.concatenate([s.values["accelerometer"] for s in runs]), axis=0)
    mean = mean / -recordings.vehicle.gravity_m_s2
    axis = int(np.argmax(np.abs(mean)))
    if not np.isfinite(mean).all() or abs(mean[axis]) < _LEAST_GRAVITY or (axis == 2 and mean[2] > 0):
        return Corrected(recordings)
    source, sign = [0, 1, 2], [1, 1, 1]
    source[axis], source[2] = 2, axis
    sign[axis] = int(np.sign(mean[axis]))
    means = []  # of two seconds each: whether the mean of the axis is zero
    for s in runs:
        values = s.values["accelerometer"][:, axis]
        count = max(1, int(len(values) / (2.0 * s.rate_hz)))
        means += [np.nanmean(part) for part in np.array_split(values, count) if np.isfinite(part).any()]
    p_value = float(ttest_1samp(means, 0.0).pvalue / 2) if len(means) > 2 else 1.0
    return turned(recordings, "accelerometer", Turn(tuple(source), tuple(sign)), p_value)


_UNITS = {
    "gyroscope": ("the body rates", "rad/s", {**RATES, "mrad/s": 1000.0}),
    "velocity": ("the velocity", "m/s", {"cm/s": 100.0, "mm/s": 1000.0, "km/h": 3.6, "ft/s": 3.28084}),
    "position": ("the position", "m", {"cm": 100.0, "mm": 1000.0, "ft": 3.28084}),
}
"""Of a sensor its quantity, the contract's unit, and other units with their factor."""


def _in_contract_units(recordings: ReadSet, sensor: str, reading: _Reading, among: Collection[str] = ()) -> Corrected:
    """The set with a sensor's columns in the contract's unit, where their scale is that of another (`among` some)."""
    what, expected, factors = _UNITS[sensor]
    unit = nearest(1.0 / reading.scale, {name: f for name, f in factors.items() if not among or name in among})
    if unit is None:
        return Corrected(recordings)
    measured, spread = 1.0 / reading.scale, 1.96 * reading.scale_sd / reading.scale
    columns = sensor_columns(recordings.vehicle)[sensor]
    return corrected(recordings, columns, what, unit, expected, measured, spread, reading.p_value)


def _turning(recordings: ReadSet) -> Corrected:
    """The gyroscope against the attitude, and who of the two is wrong."""
    vehicle = recordings.vehicle
    reading = read(lagged.fit(lagged.turning(recordings.signals)))
    if reading is None:
        return _gyroscope_units(recordings)
    result = _in_contract_units(recordings, "gyroscope", reading)
    if not reading.turn.identity and not _attitude_fits(result.recordings.signals, vehicle):
        for name, (signs, order) in _ATTITUDES.items():
            trial = replace_sensor(
                result.recordings, "attitude", lambda q, order=order, signs=signs: q[:, order] * signs
            )
            again = read(lagged.fit(lagged.turning(trial.signals)))
            if again and again.turn.identity and _attitude_fits(trial.signals, vehicle, strict=True):
                sentence = f"The attitude's quaternion is {name}: put into the contract's form."
                finding = established("axis_sign", sentence, again.p_value, sensor_columns(vehicle)["attitude"])
                return Corrected(trial, (*result.findings, finding))
    return result.then(partial(turned, sensor="gyroscope", turn=reading.turn, p_value=reading.p_value))


def _force_source(all_signals: list[Signals]) -> str | None:
    """What the velocity's changes are compared with: the accelerometer, else rotor speeds read or commanded."""
    if any("accelerometer" in s.values for s in all_signals):
        return "accelerometer"
    return next((n for n in map(lagged.speeds_of, all_signals) if n in ("rotors", "commands")), None)


def _attitude_fits(all_signals: list[Signals], vehicle: Vehicle, strict: bool = False) -> bool:
    """Whether the attitude agrees with what carries the vehicle: gravity on average, and velocity's changes.

    `strict` asks for agreement, otherwise a lack of evidence counts as agreement.
    """
    agree = []
    for s in all_signals:
        if "attitude" in s.values and "accelerometer" in s.values:
            world = np.einsum("nij,nj->ni", s.rotation(), s.values["accelerometer"])
            agree.append(np.nanmean(world[:, 2]) < -_LEAST_GRAVITY * vehicle.gravity_m_s2)
    if agree and not all(agree):
        return False
    source = _force_source(all_signals)
    fit = lagged.fit(lagged.accelerating(all_signals, vehicle, source)) if source else None
    if fit is None:
        return not strict or bool(agree)
    gains = [(fit.gain[k, k], fit.gain_sd[k, k]) for k in (0, 1) if fit.explained[k] > _LEAST_EXPLAINED]
    if not gains:
        return not strict or not np.any(fit.explained[:2] > 0.2)
    return all(gain > max(0.3, _LEAST_T / 2 * max(sd, 1e-12)) for gain, sd in gains)


def _gyroscope_units(recordings: ReadSet) -> Corrected:
    """Without an attitude that shows it: the gyroscope's unit from the size of the believed moments."""
    signals = recordings.signals
    sensor = next((n for n in map(lagged.speeds_of, signals) if n), None)
    if sensor is None or sensor == "throttle" and not recordings.vehicle.rotor_speed_limits_rad_s:
        return Corrected(recordings)
    blocks = lagged.rolling(signals, recordings.vehicle, sensor)
    if blocks is not None and sensor != "rotors":
        # The motors' lag takes most of a quick moment away.
        _, blocks = lagged.through_motor(blocks)
    fit = lagged.fit(blocks)
    if fit is None or np.min(fit.explained) < _LEAST_EXPLAINED:
        return Corrected(recordings)
    gain, sd = np.abs(np.diag(fit.gain)), np.diag(fit.gain_sd)
    if np.any(gain < _LEAST_T * sd):
        return Corrected(recordings)
    p = float(student.sf(np.min(gain / sd), max(fit.block_count - 1, 1)))
    size = float(np.sqrt(gain[0] * gain[1]))
    reading = _Reading(None, 1.0 / size, float(np.max(sd / gain)) / size, p)
    return _in_contract_units(recordings, "gyroscope", reading, ("deg/s", "mrad/s"))


def _accelerating(recordings: ReadSet) -> Corrected:
    """The velocity against the specific force turned into the world."""
    source = _force_source(recordings.signals)
    fit = lagged.fit(lagged.accelerating(recordings.signals, recordings.vehicle, source)) if source else None
    return _in_the_world(recordings, "velocity", fit)


def _in_the_world(recordings: ReadSet, sensor: str, fit: lagged.LaggedFit | None) -> Corrected:
    """Unit and axes of a sensor Y = M X with X sound: of the fit as if Y and X had changed places."""
    if fit is not None:
        size = np.maximum(np.abs(fit.gain).max(axis=1, keepdims=True), 1e-300)
        # Of each axis of X is explained what is of the axis of Y which it feeds.
        explained = fit.explained[np.abs(fit.gain).argmax(axis=0)]
        # For signed, scaled axes the inverse is the transpose over the squared scale.
        fit = replace(fit, gain=(fit.gain / size**2).T, gain_sd=(fit.gain_sd / size**2).T, explained=explained)
    reading = read(fit)
    if reading is None:
        return Corrected(recordings)
    result = _in_contract_units(recordings, sensor, reading)
    return result.then(partial(turned, sensor=sensor, turn=reading.turn, p_value=reading.p_value))


def _sideways(recordings: ReadSet) -> Corrected:
    """The accelerometer's x and y, where there is enough sideways force to decide."""
    fit = lagged.fit(lagged.sideways(recordings.signals, recordings.vehicle.gravity_m_s2), np.zeros(1))
    if fit is None:
        return Corrected(recordings)
    sign, p_values = [1, 1, 1], []
    for k in (0, 1):
        gain, sd = fit.gain[k, k], max(fit.gain_sd[k, k], 1e-12)
        if gain < 0 and -gain > _LEAST_T * sd and 0.5 < -gain < 2.0 and fit.explained[k] > _LEAST_EXPLAINED:
            sign[k] = -1
            p_values.append(float(student.sf(-gain / sd, max(fit.block_count - 1, 1))))
    return turned(recordings, "accelerometer", Turn((0, 1, 2), tuple(sign)), max(p_values, default=1.0))


def _moving(recordings: ReadSet) -> Corrected:
    """The position against the velocity (already checked against the forces where there were any)."""
    return _in_the_world(recordings, "position", lagged.fit(lagged.moving(recordings.signals)))
