"""Axes and units that the sensors' agreement on one motion gives away: flipped, exchanged, or scaled columns."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t as student

from rotorid.mismatch.decision.findings import Finding
from rotorid.mismatch.mistakes import comparisons as compare
from rotorid.mismatch.mistakes import lagged
from rotorid.mismatch.mistakes.lagged import LaggedFit
from rotorid.mismatch.mistakes.signals import ReadSet, Signals, read_signals, replace_columns, sensor_columns
from rotorid.mismatch.mistakes.units import UnitError, as_finding, corrected, nearest
from rotorid.recordings import RecordingSet, Run

LEAST_EXPLAINED = 0.4
"""Share of an axis that the other sensor must explain before anything is said of it."""
LEAST_T = 8.0
DOMINANCE = 3.0
"""The largest entry of a row over the next, for an axis to be identified."""
LEAST_GRAVITY = 0.6
"""Share of gravity that the mean specific force must show along an axis for its sign to count."""

ATTITUDES = {
    "conjugated": (np.array([1.0, -1.0, -1.0, -1.0]), (0, 1, 2, 3)),
    "forward-left-up in a north-west-up world": (np.array([1.0, 1.0, -1.0, -1.0]), (0, 1, 2, 3)),
    "forward-left-up in a north-west-up world, conjugated": (np.array([1.0, -1.0, 1.0, 1.0]), (0, 1, 2, 3)),
    "stored scalar last": (np.array([1.0, 1.0, 1.0, 1.0]), (3, 0, 1, 2)),
    "stored scalar last and conjugated": (np.array([1.0, -1.0, -1.0, -1.0]), (3, 0, 1, 2)),
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
        for i, (source, sign) in enumerate(zip(self.source, self.sign, strict=True)):
            out[:, source] = sign * values[:, i]
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
class Reading:
    """What a fit of X to Y (both three axes) says: `turn` of X, `scale` of X, and how sure."""

    turn: Turn | None
    scale: float
    scale_sd: float
    p_value: float


def read(fit: LaggedFit | None) -> Reading | None:
    """Signed axes from the gains of a fit Y = M X, None where the motion determines too little.

    An axis that moves too little keeps the sign of the others' rule (itself).
    """
    if fit is None:
        return None
    source, sign, gains, p_values = [0, 1, 2], [1, 1, 1], [], []
    clear = 0
    for j in range(3):
        row, sd = fit.gain[j], np.maximum(fit.gain_sd[j], 1e-12)
        order = np.argsort(-np.abs(row))
        best = int(order[0])
        if fit.explained[j] < LEAST_EXPLAINED or abs(row[best]) < LEAST_T * sd[best]:
            continue
        if abs(row[best]) < DOMINANCE * abs(row[order[1]]):
            continue
        clear += 1
        # Row j of M names the column of X that is true axis j.
        source[best], sign[best] = j, int(np.sign(row[best]))
        gains.append((abs(row[best]), sd[best]))
        p_values.append(float(student.sf(abs(row[best]) / sd[best], max(fit.block_count - 1, 1))))
    if clear < 1 or sorted(source) != [0, 1, 2]:
        return None
    value = float(np.median([g for g, _ in gains]))
    return Reading(Turn(tuple(source), tuple(sign)), value, float(np.median([s for _, s in gains])), max(p_values))


@dataclass(frozen=True)
class Result:
    """A set as corrected so far, and what was found."""

    recordings: RecordingSet
    findings: tuple[Finding, ...] = ()
    notes: tuple[str, ...] = ()


def signals_of(recordings: RecordingSet) -> list[Signals]:
    """Signals of every run."""
    if isinstance(recordings, ReadSet):
        return recordings.signals
    return [read_signals(run, recordings.vehicle) for run in recordings.runs]


def mean_gravity(all_signals: list[Signals], gravity: float) -> np.ndarray | None:
    """Mean of the accelerometer over −g along body z, per axis; about (0, 0, 1) where all is well."""
    parts = [s.values["accelerometer"] for s in all_signals if "accelerometer" in s.values]
    if not parts:
        return None
    return np.nanmean(np.concatenate(parts), axis=0) / -gravity


def apply_turn(recordings: RecordingSet, sensor: str, turn: Turn) -> RecordingSet:
    """The set with one sensor's columns in the contract's axes."""
    names = sensor_columns(recordings.vehicle)[sensor]

    def change(run: Run):
        if not run.has(*names):
            return None
        fixed = turn.undo(run.array(names))
        return {n: fixed[:, k] for k, n in enumerate(names)}

    return replace_columns(recordings, change)


def apply_attitude(recordings: RecordingSet, signs: np.ndarray, order: tuple[int, ...]) -> RecordingSet:
    """The set with its quaternions' columns reordered and flipped."""
    names = sensor_columns(recordings.vehicle)["attitude"]

    def change(run: Run):
        if not run.has(*names):
            return None
        fixed = run.array(names)[:, list(order)] * signs
        return {n: fixed[:, k] for k, n in enumerate(names)}

    return replace_columns(recordings, change)


SENSOR_NAMES = {
    "gyroscope": "the gyroscope's axes",
    "accelerometer": "the accelerometer's axes",
    "velocity": "the velocity's axes",
    "position": "the position's axes",
}


def axis_finding(recordings: RecordingSet, sensor: str, turn: Turn, p_value: float) -> Finding:
    """The finding of a sensor with wrong axes."""
    names = sensor_columns(recordings.vehicle)[sensor]
    touched = [n for i, n in enumerate(names) if turn.sign[i] < 0 or turn.source[i] != i]
    remedy = "flipped" if turn.source == (0, 1, 2) else "put in order"
    return Finding(
        id="axis_sign",
        status="established",
        sentence=f"Of {SENSOR_NAMES[sensor]}, {turn.text()} ({', '.join(touched)}): {remedy}.",
        p_value=p_value,
        channels=tuple(touched),
    )


def find(recordings: RecordingSet) -> Result:
    """Wrong axes and units of inertial sensors, attitude, velocity and position."""
    result = Result(recordings)
    if recordings.vehicle.kind != "flight":
        return result
    for step in (_gravity, _turning, _accelerating, _sideways, _moving):
        found = step(result.recordings)
        result = Result(found.recordings, result.findings + found.findings, result.notes + found.notes)
    return result


def _gravity(recordings: RecordingSet) -> Result:
    """The accelerometer's z axis by gravity: a flying vehicle is supported by thrust along −z."""
    mean = mean_gravity(signals_of(recordings), recordings.vehicle.gravity_m_s2)
    if mean is None or not np.isfinite(mean).all():
        return Result(recordings)
    axis = int(np.argmax(np.abs(mean)))
    if abs(mean[axis]) < LEAST_GRAVITY or (axis == 2 and mean[2] > 0):
        return Result(recordings)
    if axis == 2:
        turn = Turn((0, 1, 2), (1, 1, -1))
    else:
        source = [0, 1, 2]
        source[axis], source[2] = 2, axis
        sign = [1, 1, 1]
        sign[axis] = int(np.sign(mean[axis]))
        turn = Turn(tuple(source), tuple(sign))
    finding = axis_finding(recordings, "accelerometer", turn, _gravity_p(recordings, axis))
    return Result(apply_turn(recordings, "accelerometer", turn), (finding,))


def _gravity_p(recordings: RecordingSet, axis: int) -> float:
    """p-value that the mean of an axis is zero, from means of two seconds."""
    means = []
    for s in signals_of(recordings):
        if "accelerometer" in s.values:
            values = s.values["accelerometer"][:, axis]
            count = max(1, int(len(values) / (2.0 * s.rate_hz)))
            means += [np.nanmean(part) for part in np.array_split(values, count) if np.isfinite(part).any()]
    if len(means) < 3:
        return 1.0
    return float(student.sf(abs(np.mean(means)) / (np.std(means, ddof=1) / np.sqrt(len(means))), len(means) - 1))


def _scaled_sensor(recordings: RecordingSet, sensor: str, what: str, unit, expected: str, reading: Reading) -> Result:
    columns = sensor_columns(recordings.vehicle)[sensor]
    error = UnitError(
        columns,
        what,
        unit[0],
        expected,
        unit[1],
        1.0 / reading.scale,
        1.96 * reading.scale_sd / reading.scale,
        reading.p_value,
    )
    return Result(corrected(recordings, error), (as_finding(error),))


RATE_UNITS = {"deg/s": 180 / np.pi, "rpm": 60 / (2 * np.pi), "mrad/s": 1000.0, "rev/s": 1 / (2 * np.pi)}


def _turning(recordings: RecordingSet) -> Result:
    """The gyroscope against the attitude, and who of the two is wrong."""
    vehicle = recordings.vehicle
    signals = signals_of(recordings)
    reading = read(lagged.fit(compare.turning(signals)))
    if reading is None:
        return _gyroscope_units(recordings, signals)
    unit = nearest(1.0 / reading.scale, RATE_UNITS)
    result = Result(recordings)
    if unit:
        result = _scaled_sensor(recordings, "gyroscope", "the body rates", unit, "rad/s", reading)
        signals = signals_of(result.recordings)
    if reading.turn.identity:
        return result
    if not attitude_fits(signals, vehicle):
        for name, (signs, order) in ATTITUDES.items():
            trial = apply_attitude(result.recordings, signs, order)
            trial_signals = signals_of(trial)
            again = read(lagged.fit(compare.turning(trial_signals)))
            if again and again.turn.identity and attitude_fits(trial_signals, vehicle, strict=True):
                finding = Finding(
                    id="axis_sign",
                    status="established",
                    sentence=f"The attitude's quaternion is {name}: put into the contract's form.",
                    p_value=again.p_value,
                    channels=sensor_columns(vehicle)["attitude"],
                )
                return Result(trial, result.findings + (finding,))
    finding = axis_finding(recordings, "gyroscope", reading.turn, reading.p_value)
    return Result(apply_turn(result.recordings, "gyroscope", reading.turn), result.findings + (finding,))


def attitude_fits(all_signals: list[Signals], vehicle, strict: bool = False) -> bool:
    """Whether the attitude agrees with what carries the vehicle: gravity on average, and velocity's changes.

    `strict` asks for agreement, otherwise a lack of evidence counts as agreement.
    """
    agree = []
    for s in all_signals:
        if "attitude" in s.values and "accelerometer" in s.values:
            world = np.einsum("nij,nj->ni", s.rotation(), s.values["accelerometer"])
            agree.append(np.nanmean(world[:, 2]) < -LEAST_GRAVITY * vehicle.gravity_m_s2)
    if agree and not all(agree):
        return False
    source = "accelerometer" if any("accelerometer" in s.values for s in all_signals) else None
    source = source or next((n for n in map(compare.speeds_of, all_signals) if n in ("rotors", "commands")), None)
    fit = lagged.fit(compare.accelerating(all_signals, vehicle, source)) if source else None
    if fit is None:
        return not strict or bool(agree)
    ratios = [fit.gain[k, k] / max(fit.gain_sd[k, k], 1e-12) for k in (0, 1) if fit.explained[k] > LEAST_EXPLAINED]
    gain = [fit.gain[k, k] for k in (0, 1) if fit.explained[k] > LEAST_EXPLAINED]
    if not ratios:
        crossed = [k for k in (0, 1) if fit.explained[k] > 0.2]
        return not crossed or not strict
    return bool(np.all(np.array(ratios) > LEAST_T / 2) and np.all(np.array(gain) > 0.3))


def _gyroscope_units(recordings: RecordingSet, signals: list[Signals]) -> Result:
    """Without an attitude that shows it: the gyroscope's unit from the size of the believed moments."""
    sensor = next((n for n in map(compare.speeds_of, signals) if n), None)
    if sensor is None or sensor == "throttle" and not recordings.vehicle.rotor_speed_limits_rad_s:
        return Result(recordings)
    blocks = compare.rolling(signals, recordings.vehicle, sensor)
    if blocks is not None and sensor != "rotors":
        # The motors' lag takes most of a quick moment away.
        _, blocks = lagged.through_motor(blocks)
    fit = lagged.fit(blocks)
    if fit is None or np.min(fit.explained) < LEAST_EXPLAINED:
        return Result(recordings)
    gain = np.abs(np.diag(fit.gain))
    sd = np.diag(fit.gain_sd)
    unit = nearest(float(np.sqrt(gain[0] * gain[1])), {"deg/s": 180 / np.pi, "mrad/s": 1000.0})
    if unit is None or np.any(gain < LEAST_T * sd):
        return Result(recordings)
    p = float(student.sf(np.min(gain / sd), max(fit.block_count - 1, 1)))
    size = float(np.sqrt(gain[0] * gain[1]))
    reading = Reading(None, 1.0 / size, float(np.max(sd / gain)) / size, p)
    return _scaled_sensor(recordings, "gyroscope", "the body rates", unit, "rad/s", reading)


def _accelerating(recordings: RecordingSet) -> Result:
    """The velocity against the specific force turned into the world."""
    signals, vehicle = signals_of(recordings), recordings.vehicle
    source = "accelerometer" if any("accelerometer" in s.values for s in signals) else None
    source = source or next((n for n in map(compare.speeds_of, signals) if n in ("rotors", "commands")), None)
    if source is None:
        return Result(recordings)
    fit = lagged.fit(compare.accelerating(signals, vehicle, source))
    return _judge_world(recordings, "velocity", "the velocity", "m/s", fit, _velocity_units())


def _velocity_units() -> dict[str, float]:
    return {"cm/s": 100.0, "mm/s": 1000.0, "km/h": 3.6, "ft/s": 3.28084}


def _judge_world(recordings, sensor, what, expected, fit, units) -> Result:
    """Y is the suspect: Y = M X with X sound."""
    reading = read(_inverse(fit))
    if reading is None:
        return Result(recordings)
    result = Result(recordings)
    unit = nearest(1.0 / reading.scale, units)
    if unit:
        result = _scaled_sensor(recordings, sensor, what, unit, expected, reading)
    if reading.turn.identity:
        return result
    finding = axis_finding(recordings, sensor, reading.turn, reading.p_value)
    return Result(apply_turn(result.recordings, sensor, reading.turn), result.findings + (finding,))


def _inverse(fit: LaggedFit | None) -> LaggedFit | None:
    """The fit as if Y and X had changed places, for a matrix of signed axes."""
    if fit is None:
        return None
    size = np.maximum(np.abs(fit.gain).max(axis=1, keepdims=True), 1e-300)
    # For signed, scaled axes the inverse is the transpose over the squared scale.
    return replace(fit, gain=(fit.gain / size**2).T, gain_sd=(fit.gain_sd / size**2).T, explained=_carried(fit))


def _carried(fit: LaggedFit) -> np.ndarray:
    """Explained share of each axis of X: that of the axis of Y which it feeds."""
    return np.array([fit.explained[int(np.argmax(np.abs(fit.gain[:, k])))] for k in range(fit.gain.shape[1])])


def _sideways(recordings: RecordingSet) -> Result:
    """The accelerometer's x and y, where there is enough sideways force to decide."""
    signals = signals_of(recordings)
    fit = lagged.fit(compare.sideways(signals, recordings.vehicle.gravity_m_s2), np.zeros(1))
    if fit is None:
        return Result(recordings)
    sign, p_values = [1, 1, 1], []
    for k in (0, 1):
        gain, sd = fit.gain[k, k], max(fit.gain_sd[k, k], 1e-12)
        if gain < 0 and -gain > LEAST_T * sd and 0.5 < -gain < 2.0 and fit.explained[k] > LEAST_EXPLAINED:
            sign[k] = -1
            p_values.append(float(student.sf(-gain / sd, max(fit.block_count - 1, 1))))
    turn = Turn((0, 1, 2), tuple(sign))
    if turn.identity:
        return Result(recordings)
    finding = axis_finding(recordings, "accelerometer", turn, max(p_values))
    return Result(apply_turn(recordings, "accelerometer", turn), (finding,))


def _moving(recordings: RecordingSet) -> Result:
    """The position against the velocity (already checked against the forces where there were any)."""
    fit = lagged.fit(compare.moving(signals_of(recordings)))
    return _judge_world(recordings, "position", "the position", "m", fit, {"cm": 100.0, "mm": 1000.0, "ft": 3.28084})
