"""The stand's experiments: recording sets of kind `stand`, and steady wrenches with intervals, rest reading, weight.

Two instruments with their own clocks are put on one (`rotorid_lab.clocks`); a run's samples are the wrench
sensor's, with throttle, speed and voltage interpolated to them. Before and after a programme the vehicle sends nothing:
its motors stand.

The throttles alone say where a programme rests, ramps and holds. The sensor stays level and the vehicle is tilted on
it, so the weight pulls along the sensor's z whatever the tilt; what turns with the vehicle is the arm from the sensor
to the centre of mass, and with it the weight's moment.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.special import stdtrit as student_quantile

from rotorid.effects.loading import rotation_of
from rotorid.errors import InputError
from rotorid.recordings import columns as c
from rotorid.recordings.run import RecordingSet, Run
from rotorid.recordings.signal import block_count, mean_and_error
from rotorid.recordings.vehicle import Vehicle
from rotorid_acquire.io.frames import Quality
from rotorid_acquire.io.logs import by_recording
from rotorid_acquire.io.wire import EXPERIMENTS
from rotorid_lab.clocks import THROTTLES, Aligned, Pair, both_on_host, pair_of, torque_offset

_RPM = 2 * np.pi / 60
_REST, _RAMP, PLATEAU = "rest", "ramp", "plateau"
_SLOPE_1_S = 0.004
"""A throttle that changes by less than this per second is constant (the slowest ramp of table A.1: 0.0167)."""
_WINDOW_S = 0.1
_SHORTEST_S = 0.5
"""A plateau is at least that long; a sine's turning points are not."""
WRENCH = (*c.FORCE, *c.MOMENT)
_SETTLE_S = 0.5
"""Left off the beginning of a plateau and of the rest after a programme: motors and structure settle."""
_REST_MARGIN_S = 0.15


def _felt(wrench: pd.DataFrame, offset_s: float) -> tuple[np.ndarray, pd.DataFrame]:
    """Times of the sensor's samples, s, its offset taken off, and their wrench; a saturated channel's are empty."""
    out = wrench[list(WRENCH)].astype(float).reset_index(drop=True)
    out.loc[(wrench["quality"].to_numpy() & int(Quality.SATURATED)) != 0] = np.nan
    return wrench["host_s"].to_numpy() - offset_s, out


def _within(when: np.ndarray, times: np.ndarray, values: np.ndarray, outside: float) -> np.ndarray:
    """Values interpolated to `when`, and `outside` where nothing was sent."""
    return np.interp(when, times, values, left=outside, right=outside)


def _experiment_run(session, aligned: Aligned) -> Run:
    """One of the 48 experiments: throttles, battery voltage, attitude of the mount, wrench."""
    quadrotor = aligned.pair.quadrotor
    when, felt = _felt(aligned.pair.wrench, aligned.offset_s)
    sent = quadrotor["host_s"].to_numpy()
    table = pd.DataFrame({c.TIME: when - when[0]})
    for column in THROTTLES:
        table[column] = _within(when, sent, quadrotor[column].to_numpy(), 0.0)
    table[c.BATTERY_VOLTAGE] = _within(when, sent, quadrotor["battery_voltage_v"].to_numpy(), np.nan)
    table["roll_rad"] = np.radians(session.mount_roll_deg)
    table["pitch_rad"] = np.radians(session.mount_pitch_deg)
    table[list(WRENCH)] = felt
    return Run(aligned.pair.name, table)


def _torque_run(name: str, rotor: pd.DataFrame, wrench: pd.DataFrame, offset_s: float) -> Run:
    """One torque test: motor 1 alone turns, driven and counted by the thrust tester; both tables have `host_s`."""
    when, felt = _felt(wrench, offset_s)
    sent = rotor["host_s"].to_numpy()
    table = pd.DataFrame({c.TIME: when - when[0]})
    table["throttle_1"] = _within(when, sent, rotor["throttle"].to_numpy(), 0.0)
    table["rotor_speed_1_rad_s"] = _within(when, sent, rotor["speed_rpm"].to_numpy() * _RPM, 0.0)
    for i in (2, 3, 4):
        table[f"throttle_{i}"] = 0.0
        table[f"rotor_speed_{i}_rad_s"] = 0.0
    table[c.BATTERY_VOLTAGE] = _within(when, sent, rotor["battery_voltage_v"].to_numpy(), np.nan)
    table[c.BATTERY_CURRENT] = _within(when, sent, rotor["battery_current_a"].to_numpy(), np.nan)
    table["roll_rad"] = table["pitch_rad"] = 0.0
    table[list(WRENCH)] = felt
    return Run(name, table)


def _thrust_run(name: str, rotor: pd.DataFrame) -> Run:
    """One thrust test: a single rotor on the tester; its thrust pulls along −z."""
    table = pd.DataFrame(
        {
            c.TIME: rotor["time_s"].to_numpy(),
            "throttle_1": rotor["throttle"].to_numpy(float),
            "rotor_speed_1_rad_s": rotor["speed_rpm"].to_numpy() * _RPM,
            "force_z_n": -rotor["thrust_n"].to_numpy(),
            c.BATTERY_VOLTAGE: rotor["battery_voltage_v"].to_numpy(),
            c.BATTERY_CURRENT: rotor["battery_current_a"].to_numpy(),
        }
    )
    return Run(name, table)


def _stand_vehicle(name: str, believed: Vehicle, session, noise: dict[str, float]) -> Vehicle:
    """The believed vehicle as it stands on the sensor, from its flight file and the recording's metadata."""
    content = believed.model_dump(exclude_defaults=True)
    content.update(name=name, kind="stand", tared=bool(session.tared), sensor_mount="level", noise=noise)
    content["sensor_position_m"] = [session.sensor_x_m, session.sensor_y_m, session.sensor_z_m]
    return Vehicle.model_validate(content)


def _tester_vehicle(name: str, believed: Vehicle, noise: dict[str, float]) -> Vehicle:
    """Motor 1 alone on the thrust tester, which claims to read zero at rest."""
    content = {
        "name": name,
        "kind": "stand",
        "rotors": [{"x_m": 0.0, "y_m": 0.0, "spin": believed.rotors[0].spin}],
        "thrust_coefficient_n_s2": float(believed.thrust_coefficients_n_s2()[0]),
        "torque_coefficient_n_m_s2": float(believed.torque_coefficients_n_m_s2()[0]),
        "rotor_radius_m": believed.rotor_radius_m,
        "tared": True,
        "noise": noise,
    }
    return Vehicle.model_validate(content)


def _pairs(first: pd.DataFrame, second: pd.DataFrame) -> list[tuple]:
    """Rows of two tables of recordings that belong to one group, in the order of the first."""
    others = {row.group: row for row in second.itertuples()}
    return [(row, others[row.group]) for row in first.itertuples() if row.group in others]


def read_pairs(quadrotor: tuple, wrench: tuple, largest_error: float) -> list[Pair]:
    """The experiments' two recordings each; both arguments are (samples, recordings) of `rotorid_acquire.io.logs`."""
    commands, felt = by_recording(quadrotor[0]), by_recording(wrench[0])
    return [
        pair_of(
            sent.group,
            int(sent.experiment),
            EXPERIMENTS[int(sent.experiment)].frequency_hz is not None,
            commands[sent.id],
            felt[read.id],
            largest_error,
        )
        for sent, read in _pairs(quadrotor[1], wrench[1])
    ]


def dynamics_set(
    name: str, aligned: list[Aligned], recordings: pd.DataFrame, believed: Vehicle, noise: dict[str, float]
) -> RecordingSet:
    """The 48 experiments; `recordings` are the wrench sensor's."""
    session_of = {session.group: session for session in recordings.itertuples()}
    runs = [_experiment_run(session_of[entry.pair.name], entry) for entry in aligned]
    vehicle = _stand_vehicle(name, believed, session_of[aligned[0].pair.name], noise)
    return RecordingSet(name, vehicle, tuple(sorted(runs, key=lambda run: run.name)))


_LARGEST_OFFSET_ERROR_S = 0.01


def torque_set(
    name: str, rotor: tuple, wrench: tuple, believed: Vehicle, noise: dict[str, float], largest_error: float
) -> RecordingSet:
    """The 20 torque tests; where a test's lift is too weak to show its clocks' offset, the others' median is taken."""
    counted, felt = by_recording(rotor[0]), by_recording(wrench[0])
    tests = []
    for drive, read in _pairs(rotor[1], wrench[1]):
        (speed, _), (reading, _) = both_on_host(counted[drive.id], felt[read.id], largest_error)
        tests.append((drive.group, speed, reading))
    lags = [torque_offset(speed, reading) for _, speed, reading in tests]
    clear = [lag.delay_s for lag in lags if lag.delay_error_s < _LARGEST_OFFSET_ERROR_S]
    usual = float(np.median(clear)) if clear else 0.0
    runs = [
        _torque_run(test, speed, reading, lag.delay_s if lag.delay_error_s < _LARGEST_OFFSET_ERROR_S else usual)
        for (test, speed, reading), lag in zip(tests, lags, strict=True)
    ]
    vehicle = _stand_vehicle(name, believed, next(wrench[1].itertuples()), noise)
    return RecordingSet(name, vehicle, tuple(sorted(runs, key=lambda run: run.name)))


def thrust_set(name: str, rotor: tuple, believed: Vehicle, noise: dict[str, float]) -> RecordingSet:
    """The 50 thrust tests."""
    runs = [_thrust_run(str(key), table) for key, table in by_recording(rotor[0]).items()]
    return RecordingSet(name, _tester_vehicle(name, believed, noise), tuple(sorted(runs, key=lambda run: run.name)))


@dataclass(frozen=True)
class _StandStretch:
    """A stretch of one kind, from `start_s` to `stop_s`."""

    kind: str
    start_s: float
    stop_s: float

    @property
    def length_s(self) -> float:
        return self.stop_s - self.start_s


def segments(time_s: np.ndarray, throttle: np.ndarray) -> list[_StandStretch]:
    """Stretches of a programme in the order of time.

    `time_s`: shape (n,), increasing. `throttle`: fractions 0 to 1, shape (n, motors). InputError: the motors never run.
    """
    time_s, throttle = np.asarray(time_s, float), np.atleast_2d(np.asarray(throttle, float))
    running = (throttle > 0).any(axis=1)
    if not running.any():
        raise InputError("the motors never ran")
    half = _WINDOW_S / 2
    ahead = np.minimum(np.searchsorted(time_s, time_s + half, side="right") - 1, len(time_s) - 1)
    behind = np.searchsorted(time_s, time_s - half)
    span_s = np.maximum(time_s[ahead] - time_s[behind], 1e-9)
    slope = np.abs(throttle[ahead] - throttle[behind]).max(axis=1) / span_s
    kinds = np.where(~running, _REST, np.where(slope < _SLOPE_1_S, PLATEAU, _RAMP)).astype(object)
    for segment in _stretches(time_s, kinds):
        if segment.kind == PLATEAU and segment.length_s < _SHORTEST_S:
            kinds[(time_s >= segment.start_s) & (time_s <= segment.stop_s)] = _RAMP
    return _stretches(time_s, kinds)


def _stretches(time_s: np.ndarray, kinds: np.ndarray) -> list[_StandStretch]:
    """Runs of equal kind."""
    edges = np.flatnonzero(kinds[1:] != kinds[:-1]) + 1
    starts, stops = np.concatenate([[0], edges]), np.concatenate([edges - 1, [len(kinds) - 1]])
    return [
        _StandStretch(str(kinds[a]), float(time_s[a]), float(time_s[b])) for a, b in zip(starts, stops, strict=True)
    ]


def longest(found: list[_StandStretch], kind: str) -> _StandStretch | None:
    """The longest stretch of a kind, None where there is none."""
    those = [segment for segment in found if segment.kind == kind]
    return max(those, key=lambda segment: segment.length_s) if those else None


def programme(found: list[_StandStretch]) -> _StandStretch:
    """From the first moment at which a motor runs to the last."""
    moving = [segment for segment in found if segment.kind != _REST]
    return _StandStretch(_RAMP, moving[0].start_s, moving[-1].stop_s)


def weight_wrench(mass_kg: float, gravity_m_s2: float, centre_m: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """What the weight exerts on the level sensor, shape (6,), N and N m.

    `centre_m` is the centre of mass from the sensor in body axes, `rotation` body to level.
    """
    weight = np.array([0.0, 0.0, mass_kg * gravity_m_s2])
    return np.concatenate([weight, np.cross(rotation @ np.asarray(centre_m, float), weight)])


@dataclass(frozen=True)
class _Steady:
    """Mean wrench of one stretch, N and N m, shape (6,), and its standard error from the means of some blocks."""

    mean: np.ndarray
    error: np.ndarray
    samples: int
    blocks: int

    @property
    def half_width_95(self) -> np.ndarray:
        """Half width of the 95 % intervals, shape (6,)."""
        return student_quantile(self.blocks - 1, 0.975) * self.error


def _steady_mean(run: Run, start_s: float, stop_s: float, periods: int | None = None) -> _Steady:
    """Mean wrench between two times, which hold `periods` of a periodic signal if given.

    Raises InputError for fewer than two samples.
    """
    inside = (run.time_s >= start_s) & (run.time_s <= stop_s)
    if inside.sum() < 2:
        raise InputError(f"{run.name}: no samples between {start_s:.2f} and {stop_s:.2f} s")
    blocks = periods or block_count(int(inside.sum()))
    pairs = [mean_and_error(column, blocks) for column in run.array(WRENCH)[inside].T]
    return _Steady(np.array([m for m, _ in pairs]), np.array([e for _, e in pairs]), int(inside.sum()), blocks)


@dataclass(frozen=True)
class _Evaluated:
    """One experiment: rest before and after, and the steady stretch with the rest reading off."""

    name: str
    roll_rad: float
    pitch_rad: float
    throttle: np.ndarray
    """Mean throttles of the steady stretch, shape (4,)."""
    voltage_v: float
    rest: _Steady
    drift: np.ndarray
    """Rest after minus rest before, shape (6,)."""
    steady: _Steady
    """With the rest reading (interpolated between before and after) taken off; the rest's error is in it."""
    start_s: float
    stop_s: float
    kind: str
    """plateau, or cycles where the programme has none (a sine)."""


def evaluate(run: Run, frequency_hz: float | None) -> _Evaluated:
    """Steady wrench of one experiment.

    Of a trapezoid the plateau, of a sine (`frequency_hz` given) as many whole cycles as the programme holds, so
    that the mean is one over the cycle.
    """
    throttle = run.array(THROTTLES)
    found = segments(run.time_s, throttle)
    active = programme(found)
    flat = longest(found, PLATEAU)
    cycles = None
    if frequency_hz:
        cycles = int((active.length_s - _SETTLE_S) * frequency_hz)
        if cycles < 2:
            raise InputError(f"{run.name}: less than two cycles of {frequency_hz:g} Hz")
        start, stop, kind = active.start_s + _SETTLE_S, active.start_s + _SETTLE_S + cycles / frequency_hz, "cycles"
    elif flat is not None:
        start, stop, kind = flat.start_s + _SETTLE_S, flat.stop_s - _REST_MARGIN_S, "plateau"
    else:
        raise InputError(f"{run.name}: no plateau and no frequency of a sine")
    before = _steady_mean(run, -np.inf, active.start_s - _REST_MARGIN_S)
    after = _steady_mean(run, active.stop_s + _SETTLE_S, np.inf)
    loaded = _steady_mean(run, start, stop, cycles)
    first, last = active.start_s / 2, (active.stop_s + run.time_s[-1]) / 2
    share = ((start + stop) / 2 - first) / (last - first)
    rest = before.mean + share * (after.mean - before.mean)
    rest_error = np.hypot((1 - share) * before.error, share * after.error)
    steady = _Steady(loaded.mean - rest, np.hypot(loaded.error, rest_error), loaded.samples, loaded.blocks)
    inside = (run.time_s >= start) & (run.time_s <= stop)
    return _Evaluated(
        name=run.name,
        roll_rad=float(run.column("roll_rad")[0]),
        pitch_rad=float(run.column("pitch_rad")[0]),
        throttle=throttle[inside].mean(axis=0),
        voltage_v=float(np.nanmean(run.column(c.BATTERY_VOLTAGE)[inside])),
        rest=before,
        drift=after.mean - before.mean,
        steady=steady,
        start_s=float(start),
        stop_s=float(stop),
        kind=kind,
    )


def mean_thrust(run: Run, entry: _Evaluated, thrust_of: Callable) -> np.ndarray:
    """Thrust that the throttles ask of each motor, N, shape (4,), mean over the steady stretch.

    The mean of the thrust, not the thrust of the mean throttle: over a sine they differ.
    """
    inside = (run.time_s >= entry.start_s) & (run.time_s <= entry.stop_s)
    return np.clip(thrust_of(run.array(THROTTLES)[inside]), 0.0, None).mean(axis=0)


def weights(evaluated: list[_Evaluated], mass_kg: float, centre_m: np.ndarray, gravity_m_s2: float) -> np.ndarray:
    """The weight's wrench in the attitude of each experiment, shape (n, 6)."""
    return np.array(
        [weight_wrench(mass_kg, gravity_m_s2, centre_m, rotation_of(e.roll_rad, e.pitch_rad)) for e in evaluated]
    )


def fit_weight(evaluated: list[_Evaluated], mass_kg: float, centre_m: np.ndarray, gravity_m_s2: float) -> dict:
    """Mass and centre of mass from the readings at rest under all tilts, next to the believed ones.

    `mass_kg` and `centre_m` (3,), from the sensor in body axes, with `_interval_95`; RMS over the experiments of what
    the believed and the fitted weight leave at rest, `rms_before` and `rms_after` (6,).

    Fz gives the mass, the moments M = (R c) × W give c: under tilt also its height. The sensor's own zero is
    taken as zero (it was zeroed without the vehicle), and its frame as level.
    """
    rest = np.array([e.rest.mean for e in evaluated])
    rotations = [rotation_of(e.roll_rad, e.pitch_rad) for e in evaluated]
    freedom = len(rest) - 1
    if freedom < 3:
        raise InputError(f"a weight under tilt needs at least four experiments, found {len(rest)}")
    mass = rest[:, 2].mean() / gravity_m_s2
    mass_half = student_quantile(freedom, 0.975) * rest[:, 2].std(ddof=1) / np.sqrt(len(rest)) / gravity_m_s2
    pull = mass * gravity_m_s2
    # (R c) × (0, 0, W) = W (c_y', −c_x', 0) with c' = R c
    rows = np.concatenate([pull * np.array([r[1], -r[0]]) for r in rotations])
    moments = rest[:, 3:5].reshape(-1)
    centre, *_ = np.linalg.lstsq(rows, moments, rcond=None)
    left = moments - rows @ centre
    covariance = np.linalg.inv(rows.T @ rows) * (left @ left) / (len(left) - 3)
    # The moments give W c; that the weight itself is known so well only adds to the arm along c.
    mass_share = rest[:, 2].std(ddof=1) / np.sqrt(len(rest)) / pull
    covariance += mass_share**2 * np.outer(centre, centre)
    half = student_quantile(len(left) - 3, 0.975) * np.sqrt(np.diag(covariance))

    def rms(m: float, place: np.ndarray) -> np.ndarray:
        return np.sqrt(((rest - weights(evaluated, m, place, gravity_m_s2)) ** 2).mean(axis=0))

    return {
        "mass_kg": float(mass),
        "mass_interval_95": (float(mass - mass_half), float(mass + mass_half)),
        "centre_m": centre,
        "centre_interval_95": np.column_stack([centre - half, centre + half]),
        "rms_before": rms(mass_kg, np.asarray(centre_m, float)),
        "rms_after": rms(mass, centre),
    }


def table(
    evaluated: list[_Evaluated],
    numbers: list[int],
    expected: np.ndarray,
    believed_rest: np.ndarray,
    fitted_rest: np.ndarray,
) -> pd.DataFrame:
    """One row an experiment: throttles, attitude, voltage, mean wrench with its interval, the model's, rest, drift.

    `numbers` are the experiments' numbers in table A.1, `expected` is the believed vehicle's wrench at these throttles
    without weight, `believed_rest` and `fitted_rest` that of the weight with the believed and the fitted centre of
    mass, shape (n, 6) each.
    """
    rows = []
    for entry, number, model, believed, fitted in zip(
        evaluated, numbers, expected, believed_rest, fitted_rest, strict=True
    ):
        row = {
            "name": entry.name,
            "experiment": number,
            "kind": entry.kind,
            **{f"throttle_{i + 1}": value for i, value in enumerate(entry.throttle)},
            "roll_deg": np.degrees(entry.roll_rad),
            "pitch_deg": np.degrees(entry.pitch_rad),
            "voltage_v": entry.voltage_v,
            "start_s": entry.start_s,
            "stop_s": entry.stop_s,
            "samples": entry.steady.samples,
        }
        for k, name in enumerate(WRENCH):
            row |= {
                name: entry.steady.mean[k],
                f"{name}_half_95": entry.steady.half_width_95[k],
                f"{name}_model": model[k],
                f"{name}_rest": entry.rest.mean[k],
                f"{name}_rest_believed": believed[k],
                f"{name}_rest_fitted": fitted[k],
                f"{name}_drift": entry.drift[k],
            }
        rows.append(row)
    return pd.DataFrame(rows)


def weight_as_dict(found: dict, mass_kg: float, centre_m: np.ndarray, experiments: pd.DataFrame) -> dict:
    """The weight for a JSON file, next to the believed one, and how far the believed vehicle's steady wrench is off."""
    off = np.array([experiments[name] - experiments[f"{name}_model"] for name in WRENCH])
    half = np.array([experiments[f"{name}_half_95"] for name in WRENCH])

    def named(names: Sequence[str], values: np.ndarray) -> dict:
        return dict(zip(names, values.tolist(), strict=True))

    low, high = found["mass_interval_95"]
    return {
        "experiments": len(experiments),
        "mass_kg": found["mass_kg"],
        "mass_interval_95": found["mass_interval_95"],
        "mass_believed_kg": mass_kg,
        "mass_believed_inside": low <= mass_kg <= high,
        "centre_m": named("xyz", found["centre_m"]),
        "centre_interval_95_m": named("xyz", found["centre_interval_95"]),
        "centre_believed_m": named("xyz", np.asarray(centre_m)),
        "rest_rms_before": named(WRENCH, found["rms_before"]),
        "rest_rms_after": named(WRENCH, found["rms_after"]),
        "steady_rms_off_model": named(WRENCH, np.sqrt((off**2).mean(axis=1))),
        "steady_half_width_95": named(WRENCH, half.mean(axis=1)),
    }
