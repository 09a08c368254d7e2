"""Errors of gyroscope and accelerometer, axes and units that are wrong, sensors that stand still."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rotorid.recordings import RecordingSet, Run
from rotorid.recordings import columns as c
from rotorid_proof.plantings.columns import (
    command_of,
    dense,
    direction,
    has,
    of_sensor,
    scaled,
    signed,
    smooth,
)
from rotorid_proof.plantings.kinds import Kind, Size, both, named, once

NO_ATTITUDE = "no attitude: a gyroscope that reads a share off is the same as inertias that are off"
NO_POSE = "no velocity or attitude: nothing but the accelerometer says what force there is"
AXES = "xyz"


def _gyroscope_alone(recordings: RecordingSet) -> str:
    return "" if has(recordings, "attitude") else NO_ATTITUDE


def _accelerometer_alone(recordings: RecordingSet) -> str:
    return "" if has(recordings, "velocity", "attitude") else NO_POSE


def _vector(effect: str, symbol: str, values: np.ndarray) -> tuple[tuple[Size, ...], ...]:
    return (tuple(Size(effect, f"{symbol}_{a}", float(v)) for a, v in zip(AXES, values, strict=True)),)


def gyroscope_scaled(recordings: RecordingSet, share: float, rng: np.random.Generator):
    """Ω_m = (1 + s) Ω, the same s on every axis."""
    s = np.full(3, share * signed(rng))
    sizes = _vector("gyro_error", "s", s)
    truth = named("gyro_error", sizes=sizes, form_bound=True, unseen=_gyroscope_alone(recordings))
    return scaled(recordings, "gyroscope", 1.0 + s), truth


def gyroscope_turned(recordings: RecordingSet, angle: float, rng: np.random.Generator):
    """Ω_m = Ω + θ × Ω."""
    theta = angle * direction(rng, 3)
    sizes = _vector("gyro_error", "theta", theta)
    truth = named("gyro_error", sizes=sizes, form_bound=True, unseen=_gyroscope_alone(recordings))
    return of_sensor(recordings, "gyroscope", lambda run, values: values + np.cross(theta, values)), truth


def accelerometer_biased(recordings: RecordingSet, size: float, rng: np.random.Generator):
    """a_m = a + b."""
    b = size * direction(rng, 3)
    sizes = _vector("accelerometer_error", "b", b)
    truth = named("accelerometer_error", sizes=sizes, form_bound=True, unseen=_accelerometer_alone(recordings))
    return of_sensor(recordings, "accelerometer", lambda run, values: values + b), truth


def accelerometer_scaled(recordings: RecordingSet, share: float, rng: np.random.Generator):
    """a_m = (1 + s) a, the same s on every axis."""
    s = np.full(3, share * signed(rng))
    sizes = _vector("accelerometer_error", "s", s)
    truth = named("accelerometer_error", sizes=sizes, form_bound=True, unseen=_accelerometer_alone(recordings))
    return scaled(recordings, "accelerometer", 1.0 + s), truth


def accelerometer_turned(recordings: RecordingSet, angle: float, rng: np.random.Generator):
    """a_m = a + θ × a."""
    theta = angle * direction(rng, 3)
    sizes = _vector("accelerometer_error", "theta", theta)
    truth = named("accelerometer_error", sizes=sizes, form_bound=True, unseen=_accelerometer_alone(recordings))
    return of_sensor(recordings, "accelerometer", lambda run, values: values + np.cross(theta, values)), truth


def lever_arm(recordings: RecordingSet, length_m: float, rng: np.random.Generator):
    """a_m = a + dΩ × r + Ω × (Ω × r); `length_m` for a vehicle with arms of 0.1 m, in proportion for others."""
    arm = float(np.abs(recordings.vehicle.rotor_positions_m()[:, :2]).mean())
    r = length_m * arm / 0.1 * direction(rng, 3)

    def change(run, values):
        rates = run.array(c.ANGULAR_VELOCITY)
        return (
            values
            + np.cross(smooth(run, run.array(c.ANGULAR_VELOCITY), slope=True), r)
            + np.cross(rates, np.cross(rates, r))
        )

    truth = named("imu_lever_arm", sizes=_vector("imu_lever_arm", "r", r), form_bound=True)
    return of_sensor(recordings, "accelerometer", change), truth


def flipped(sensor: str, *signs: float):
    """Columns of a sensor with some signs the other way round."""

    def plant(recordings: RecordingSet, size: float, rng: np.random.Generator):
        return scaled(recordings, sensor, np.array(signs)), named("axis_sign", unseen=_unseen_axis(recordings, sensor))

    return plant


def _unseen_axis(recordings: RecordingSet, sensor: str) -> str:
    if sensor in ("velocity", "position") and not has(recordings, "attitude"):
        return "no attitude: world axes have nothing to be compared with"
    return ""


def gyroscope_exchanged(recordings: RecordingSet, size: float, rng: np.random.Generator):
    """x and y of the gyroscope exchanged."""
    out = of_sensor(recordings, "gyroscope", lambda run, values: values[:, [1, 0, 2]])
    return out, named("axis_sign", fair=("rotor_order",))


def in_unit(sensor: str, factor: float):
    """Columns of a sensor in another unit."""

    def plant(recordings: RecordingSet, size: float, rng: np.random.Generator):
        sizes = ((Size("unit_error", "factor", factor, added=False),),)
        return scaled(recordings, sensor, factor), named("unit_error", sizes=sizes)

    return plant


def voltage_in_millivolt(recordings: RecordingSet, size: float, rng: np.random.Generator):
    """The battery's voltage in mV."""
    runs = tuple(
        Run(run.name, run.table.assign(**{c.BATTERY_VOLTAGE: run.table[c.BATTERY_VOLTAGE] * 1000.0}))
        for run in recordings.runs
    )
    sizes = ((Size("unit_error", "factor", 1000.0, added=False),),)
    return replace(recordings, runs=runs), named("unit_error", sizes=sizes)


def stuck(sensor: str, one_column: bool = False):
    """All columns of a sensor (or one of them) repeat a reading for a while, in one run."""

    def plant(recordings: RecordingSet, lasts_s: float, rng: np.random.Generator):
        longest = max(recordings.runs, key=lambda run: run.time_s[-1] - run.time_s[0])
        span = longest.time_s[-1] - longest.time_s[0]
        start = longest.time_s[0] + rng.uniform(0.2, 0.7) * max(span - lasts_s, 0.0)
        k = int(rng.integers(recordings.vehicle.rotor_count))

        def change(run, values):
            if run.name != longest.name:
                return values
            held = np.flatnonzero((run.time_s >= start) & (run.time_s <= start + lasts_s))
            columns = [k % values.shape[1]] if one_column else list(range(values.shape[1]))
            for j in columns:
                known = values[: held[0] + 1, j][np.isfinite(values[: held[0] + 1, j])]
                values[held, j] = known[-1]
            return values

        return of_sensor(recordings, sensor, change), named("sensor_dropout")

    return plant


def command_stuck(recordings: RecordingSet, lasts_s: float, rng: np.random.Generator):
    """The command of one rotor stands still in the log while the others go on."""
    return stuck(command_of(recordings), one_column=True)(recordings, lasts_s, rng)


def _commanded(recordings: RecordingSet) -> bool:
    driver = command_of(recordings)
    return driver is not None and dense(recordings, driver)


def _with(*sensors: str):
    return lambda recordings: has(recordings, *sensors)


def _dense(*sensors: str):
    return lambda recordings: all(dense(recordings, s) for s in sensors)


def _voltage(recordings: RecordingSet) -> bool:
    return all(run.has(c.BATTERY_VOLTAGE) and run.column(c.BATTERY_VOLTAGE).max() < 60 for run in recordings.runs)


GYRO, ACC, POSE = frozenset({"gyroscope"}), frozenset({"accelerometer"}), frozenset({"velocity", "position"})
HELD_S = both(2.0, 0.7)
KINDS = (
    Kind("sensors", "gyroscope_scaled", GYRO, both(0.04, 0.02), _with("gyroscope"), gyroscope_scaled),
    Kind("sensors", "gyroscope_turned", GYRO, both(0.05, 0.02), _with("gyroscope"), gyroscope_turned),
    Kind("sensors", "accelerometer_biased", ACC, both(0.4, 0.15), _with("accelerometer"), accelerometer_biased),
    Kind("sensors", "accelerometer_scaled", ACC, both(0.05, 0.02), _with("accelerometer"), accelerometer_scaled),
    Kind("sensors", "accelerometer_turned", ACC, both(0.05, 0.02), _with("accelerometer"), accelerometer_turned),
    Kind("sensors", "lever_arm", ACC, both(0.03, 0.012), _dense("accelerometer", "gyroscope"), lever_arm),
    Kind("axes", "gyroscope_flipped", GYRO, once(), _with("gyroscope"), flipped("gyroscope", 1.0, -1.0, 1.0)),
    Kind("axes", "gyroscope_exchanged", GYRO, once(), _with("gyroscope"), gyroscope_exchanged),
    Kind(
        "axes", "accelerometer_flipped", ACC, once(), _with("accelerometer"), flipped("accelerometer", 1.0, 1.0, -1.0)
    ),
    Kind("axes", "velocity_flipped", POSE, once(), _with("velocity"), flipped("velocity", 1.0, -1.0, 1.0)),
    Kind("axes", "position_flipped", POSE, once(), _with("position", "velocity"), flipped("position", 1.0, -1.0, 1.0)),
    Kind(
        "axes",
        "attitude_conjugated",
        frozenset({"attitude"}),
        once(),
        _with("attitude"),
        flipped("attitude", 1.0, -1.0, -1.0, -1.0),
    ),
    Kind("units", "rotors_in_rpm", frozenset({"rotors"}), once(), _with("rotors"), in_unit("rotors", 30 / np.pi)),
    Kind("units", "gyroscope_in_degrees", GYRO, once(), _with("gyroscope"), in_unit("gyroscope", 180 / np.pi)),
    Kind("units", "accelerometer_in_g", ACC, once(), _with("accelerometer"), in_unit("accelerometer", 1 / 9.80665)),
    Kind("units", "position_in_centimetres", POSE, once(), _with("position", "velocity"), in_unit("position", 100.0)),
    Kind("units", "voltage_in_millivolt", frozenset({"voltage"}), once(), _voltage, voltage_in_millivolt),
    Kind(
        "units", "throttle_in_percent", frozenset({"throttle"}), once(), _with("throttle"), in_unit("throttle", 100.0)
    ),
    Kind("stuck", "gyroscope_stuck", GYRO, HELD_S, _dense("gyroscope"), stuck("gyroscope")),
    Kind("stuck", "accelerometer_stuck", ACC, HELD_S, _dense("accelerometer"), stuck("accelerometer")),
    Kind("stuck", "rotor_stuck", frozenset({"rotors"}), HELD_S, _dense("rotors"), stuck("rotors", one_column=True)),
    Kind("stuck", "command_stuck", frozenset({"commands", "throttle"}), HELD_S, _commanded, command_stuck),
    Kind("stuck", "velocity_stuck", POSE, HELD_S, _dense("velocity"), stuck("velocity")),
)
