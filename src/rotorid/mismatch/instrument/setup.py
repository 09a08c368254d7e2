"""From a recording set of kind `stand` or `bench` to even stretches of load and reading.

The load is what the believed values predict at the sensor: on a bench the known force, on a stand thrust and torque
of the rotors moved to the sensor, and the weight where the reading was not zeroed with it on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from rotorid.effects.contract import Motion
from rotorid.effects.hysteresis import NARROW, play
from rotorid.effects.loading import REST_S, InstrumentFacts, Loading, at_sensor, rotation_of, weight
from rotorid.errors import InputError
from rotorid.mismatch.evidence.motion import SLOW_S, expected_voltages, is_noise
from rotorid.mismatch.evidence.rows import baseline_wrench
from rotorid.mismatch.evidence.split import split_runs
from rotorid.mismatch.instrument.sampling import noise_of, quieter, settling_s, without_noise, without_settling
from rotorid.recordings import RecordingSet, Run, Split, Vehicle
from rotorid.recordings import columns as c
from rotorid.recordings.sufficient import compared_readings, driven_by

_GAP_STEPS = 4.0
"""Where readings are missing for longer than this many median steps they are not compared."""
_SHORTEST = 4
_NO_ROWS = f"{{}}: no run has {_SHORTEST} samples in a row with every channel"
SHORT = 60
"""Stretches of fewer samples or rows are blocks: too short to learn the colour of their noise from."""
_LEAST_SHARE = 0.05
"""Share of the largest load from which a channel is loaded, or a sample is, and of the samples that come back."""
_STEADY_HZ = 5.0
"""Below this rate a recording is a list of steady points: nothing that takes time can be seen."""
_QUARTIC = np.array([[-25.0, 48.0, -36.0, 16.0, -3.0], [-3.0, -10.0, 18.0, -6.0, 1.0]])
"""Twelve times the slope at the first two of five samples of the quartic through them, per step."""


@dataclass(frozen=True)
class _SessionTimes:
    """When the runs of a set were recorded, and how warm each was at its start."""

    first_s: Mapping[str, float]
    """First instant of every run on its own clock, s."""
    start_s: Mapping[str, float]
    """When in the session every run started, s."""
    length_s: float
    """Length of the session, s; 0 of a single run."""
    clock: bool
    """Whether one clock ran on through all runs, pauses and all."""
    first_temperature_c: Mapping[str, float]
    """Temperature at the start of every run that has one, °C."""


@dataclass(frozen=True)
class _Preparation:
    """How runs become stretches: the same for all runs of a set."""

    vehicle: Vehicle
    channels: tuple[int, ...]
    dt_s: float
    full_speed: float | None
    session: _SessionTimes
    distance: str
    """Name of the column of a distance to a wall or fixture; empty where there is none."""
    rows: Mapping[str, np.ndarray]
    """By run the mask of the rows, (n,), that are looked at: those with readings, where they are slower than rows."""

    def stretches(self, recordings: RecordingSet) -> list[Loading]:
        """The stretches of all runs with their loads predicted."""
        return [loaded_by(x, self.vehicle) for run in recordings.runs for x in _stretches_of(run, self)]


@dataclass(frozen=True)
class PreparedInstrument:
    """A set of kind `stand` or `bench` ready for analysis."""

    recordings: RecordingSet
    vehicle: Vehicle
    split: Split
    instrument: InstrumentFacts
    loadings: tuple[Loading, ...]
    average: int
    """Samples that one row of the analysis is the mean of."""
    full_speed: float | None
    """Rotor speed at full throttle, rad/s; None where it is not stated and not needed."""
    estimated_full_speed: bool = False
    settling_s: float = 0.0
    """How long after a step of the load a bench's readings are left out, s."""
    noisier: tuple[Loading, ...] | None = None
    """The same loadings with the noise of measured rotor speeds added once more; None where there is none."""
    full_voltage: float | None = None
    """Voltage, V, at which the full speed is reached; None where none is recorded."""
    session: _SessionTimes | None = None
    """When each run was recorded."""

    @property
    def rate_hz(self) -> float:
        """Rate of the rows."""
        return self.instrument.rate_hz / self.average

    @property
    def steady_points(self) -> bool:
        return self.instrument.rate_hz < _STEADY_HZ


def compared_channels(recordings: RecordingSet) -> tuple[int, ...]:
    """Channels that can be compared: read and, on a bench, known."""
    names = c.FORCE + c.MOMENT
    found = []
    for k, name in enumerate(names):
        if recordings.vehicle.kind == "bench" and (
            k >= 3 or not any(r.has(c.REFERENCE_FORCE[k]) for r in recordings.runs)
        ):
            continue
        if all(run.has(name) for run in recordings.runs):
            found.append(k)
    if not found:
        raise InputError(
            f"{recordings.name}: no force or moment is recorded in every run"
            + (" together with its reference" if recordings.vehicle.kind == "bench" else "")
            + ": nothing can be compared"
        )
    return tuple(found)


def _filled(run: Run, name: str) -> np.ndarray | None:
    """A column with empty cells interpolated, its ends held; None where there is no value at all."""
    if not run.has(name):
        return None
    values, time_s = run.column(name), run.time_s
    known = np.isfinite(values)
    return values if known.all() else np.interp(time_s, time_s[known], values[known])


def _is_known(run: Run, names: tuple[str, ...]) -> np.ndarray:
    """Mask of the rows, (n,), in which every column that is there has a value, or lies between two that are no more
    than some of its own steps apart: what is missing for longer is no straight line."""
    usual = 0.75  # Share of a column's steps that are no longer than its usual one.
    time_s, good = run.time_s, np.ones(len(run.time_s), bool)
    for name in filter(run.has, names):
        known_s = time_s[np.isfinite(run.column(name))]
        if len(known_s) == len(time_s):
            continue
        good &= (time_s >= known_s[0]) & (time_s <= known_s[-1])
        if len(known_s) > 1:
            within = _within(time_s, known_s, _GAP_STEPS * float(np.quantile(np.diff(known_s), usual)))
            good &= True if within is None else within
    return good


def _reading_rows(runs: Sequence[Run], channels: tuple[int, ...]) -> dict[str, np.ndarray]:
    """By run the mask of its rows, (n,), that are looked at: those with a reading in every channel where readings come
    more slowly than rows, else all rows, of which some lack readings."""
    slower = 1.5  # Readings whose usual step is so many of the rows' are taken at their own rate.
    names = tuple((c.FORCE + c.MOMENT)[k] for k in channels)
    read = {run.name: np.isfinite(run.array(names)).all(axis=1) for run in runs}
    steps_s = np.concatenate([np.zeros(0), *(np.diff(run.time_s[read[run.name]]) for run in runs)])
    rows_s = np.concatenate([np.zeros(0), *(np.diff(run.time_s) for run in runs)])
    if len(steps_s) and np.median(steps_s) < slower * np.median(rows_s):
        return {name: np.ones(len(mask), bool) for name, mask in read.items()}
    return read


def _several(run: Run, names: tuple[str, ...]) -> np.ndarray | None:
    columns = [_filled(run, n) for n in names]
    return None if not columns or any(x is None for x in columns) else np.stack(columns, axis=1)


def commands(run: Run, count: int) -> tuple[np.ndarray | None, bool]:
    """Commands of a run, (n, k), and whether they are throttles (to be multiplied by the full speed)."""
    commanded = _several(run, c.rotor_columns("rotor_command", count))
    if commanded is not None:
        return commanded, False
    return _several(run, c.rotor_columns("throttle", count)), True


def _pieces(time_s: np.ndarray, keep: np.ndarray, dt_s: float) -> list[np.ndarray]:
    """Indices of stretches: over a short gap a sensor remembers the load, after a longer one it starts from rest."""
    index = np.flatnonzero(keep)
    cuts = np.flatnonzero(np.diff(time_s[index]) > max(REST_S, _GAP_STEPS * dt_s)) + 1
    return [np.arange(p[0], p[-1] + 1) for p in np.split(index, cuts) if len(p) >= _SHORTEST]


def _within(time_s: np.ndarray, known_s: np.ndarray, longest_s: float) -> np.ndarray | None:
    """Mask of the instants that lie in no gap between known ones longer than this; None if all are good."""
    after = np.searchsorted(known_s, time_s).clip(1, len(known_s) - 1)
    inside = (time_s > known_s[after - 1]) & (time_s < known_s[after])
    good = ~(inside & (known_s[after] - known_s[after - 1] > longest_s))
    return None if good.all() else good


def _even(time_s: np.ndarray, dt_s: float) -> np.ndarray | None:
    """An even grid to interpolate to, None where the samples are even already."""
    # Deviation of a step from the median, as a share of it, beyond which samples are interpolated to an even grid.
    uneven = 0.3
    steps = np.diff(time_s)
    if np.all(np.abs(steps - np.median(steps)) < uneven * np.median(steps)):
        return None
    return time_s[0] + dt_s * np.arange(int((time_s[-1] - time_s[0]) / dt_s) + 1)


def _straight(time_s: np.ndarray, known_s: np.ndarray, values: np.ndarray, load: bool) -> np.ndarray:
    """Mask of the instants, (n,), at which a column with these readings has one, or is straight between two: a step of
    a `load` between two readings was at any time between them."""
    if len(known_s) < 3:
        return np.isin(time_s, known_s)
    bends = np.abs(np.diff(values, 2, prepend=values[0], append=values[-1]))
    # Change of a column's slope from one reading to the next, as a share of its range, and in the lower quartile of
    # such changes, up to which it is straight between the two.
    straight, curved = 0.02, 12.0
    least = max(straight * float(np.ptp(values)), curved * float(np.quantile(bends, 0.25)))
    load_bends = 0.05  # What a load, which is no noise, may bend by at most, as a share of its largest value.
    least = min(least, load_bends * float(np.abs(values).max())) if load else least
    after = np.searchsorted(known_s, time_s).clip(1, len(known_s) - 1)
    off_s = np.minimum(np.abs(time_s - known_s[after - 1]), np.abs(known_s[after] - time_s))
    bent = np.minimum(bends[after - 1], bends[after]) > least
    return ~bent | (off_s < 1e-3 * float(np.median(np.diff(known_s))))


def _compared(run: Run, vehicle: Vehicle, time_s: np.ndarray, known_s: np.ndarray, dt_s: float) -> np.ndarray | None:
    """Mask of the instants, (n,), near known rows, at which no column is bent between its readings; None for all."""
    near = _within(time_s, known_s, _GAP_STEPS * dt_s)
    out = np.ones(len(time_s), bool) if near is None else near
    for name in filter(run.has, (*compared_readings(run, vehicle), *driven_by(run, vehicle), *c.MOUNT)):
        values = run.column(name)
        known = np.isfinite(values)
        out &= _straight(time_s, run.time_s[known], values[known], name not in c.FORCE + c.MOMENT)
    return None if out.all() else out


def _stretches_of(run: Run, how: _Preparation) -> list[Loading]:
    """Loadings of one run, load still empty."""
    vehicle, channels, dt_s, session = how.vehicle, how.channels, how.dt_s, how.session
    names = c.FORCE + c.MOMENT
    read = np.full((len(run.time_s), 6), np.nan)
    for k in channels:
        read[:, k] = run.column(names[k])
    keep = np.isfinite(read[:, list(channels)]).all(axis=1)
    reference = None
    if vehicle.kind == "bench":
        known = [_filled(run, name) for name in c.REFERENCE_FORCE]
        reference = np.stack([np.zeros(len(run.time_s)) if x is None else x for x in known], axis=1)
        keep &= _is_known(run, tuple(c.REFERENCE_FORCE[k] for k in channels))
    count = vehicle.rotor_count
    keep &= _is_known(run, (*driven_by(run, vehicle), *c.MOUNT))
    speeds = _several(run, c.rotor_columns("rotor_speed", count)) if count else None
    command, throttle = commands(run, count) if count else (None, False)
    if command is not None and throttle:
        command = command * how.full_speed if how.full_speed else None
    attitude = _several(run, c.MOUNT)
    others = {
        name: _filled(run, name)
        for name in (c.BATTERY_VOLTAGE, c.TEMPERATURE, c.HEIGHT, *run.unknown_columns)
        if run.has(name)
    }
    out, rows = [], np.flatnonzero(how.rows[run.name])
    for piece in (rows[p] for p in _pieces(run.time_s[rows], keep[rows], dt_s)):
        stamps, good = run.time_s[piece], keep[piece]
        grid = _even(stamps, dt_s)

        def at(values, piece=piece, stamps=stamps, grid=grid):
            if values is None:
                return None
            values = values[piece]
            if grid is None:
                return values
            if values.ndim == 1:
                return np.interp(grid, stamps, values)
            return np.stack([np.interp(grid, stamps, v) for v in values.T], axis=1)

        time_s = stamps if grid is None else grid
        if len(time_s) < _SHORTEST:
            continue
        reading = np.stack([np.interp(time_s, stamps[good], v) for v in read[piece][good].T], axis=1)
        own = {name: at(values) for name, values in others.items()}
        speed, ordered, tilt = at(speeds), at(command), at(attitude)
        rotation = None if tilt is None else rotation_of(tilt[:, 0], tilt[:, 1])
        if vehicle.kind == "stand" and rotation is None:
            rotation = np.broadcast_to(np.eye(3), (len(time_s), 3, 3))
            tilt = np.zeros((len(time_s), 2))
        motion = Motion(
            time_s=time_s,
            rotor_speed=None,
            rotation=rotation,
            voltage=own.get(c.BATTERY_VOLTAGE),
            height=own.get(c.HEIGHT),
        )
        if count:
            motion = with_speed(motion, ordered if speed is None else speed)
        temperature = own.get(c.TEMPERATURE)
        load = np.zeros((len(time_s), 6))
        if reference is not None:
            load[:, :3] = at(reference)
        out.append(
            Loading(
                run=run.name,
                time_s=time_s,
                run_time_s=time_s - session.first_s[run.name],
                session_time_s=session.start_s[run.name] + time_s - session.first_s[run.name],
                load=load,
                reading=reading,
                rest=np.zeros(6),
                motion=motion,
                attitude=None if tilt is None else (tilt[:, 0], tilt[:, 1]),
                temperature=None if temperature is None else temperature - session.first_temperature_c[run.name],
                temperature_c=temperature,
                command=ordered,
                measured=speed is not None,
                distance=own.get(how.distance),
                keep=_compared(run, vehicle, time_s, stamps[good], dt_s),
                extra={k: v for k, v in own.items() if k not in (c.BATTERY_VOLTAGE, c.TEMPERATURE, c.HEIGHT)},
            )
        )
    return out


def _turned(loading: Loading, change: Callable[[np.ndarray, float], np.ndarray]) -> Loading:
    """The loading with what `change` makes of measured rotor speeds and their rate; the speeds read are kept too."""
    read = loading.motion.rotor_speed
    if not loading.measured or read is None:
        return loading
    return replace(loading, motion=with_speed(loading.motion, change(read, 1.0 / loading.dt_s)), speed_read=read)


def _noised(speed: np.ndarray, rate_hz: float) -> np.ndarray:
    """Speeds with as much white noise as they have once more, less the noise of both."""
    draws = np.random.default_rng(1).standard_normal(speed.shape)
    return without_noise(speed + noise_of(speed, rate_hz) * draws, rate_hz)


def without_voltmeter_noise(loadings: list[Loading]) -> list[Loading]:
    """The loadings with the expected voltage in place of the reading, where what that takes off is noise.

    Through the sag the noise of a voltmeter is a noise of the rotors' speed: a lag that nothing is late by would take
    it out, and be found for that.
    """
    read = [x.motion.voltage for x in loadings]
    if any(v is None or x.command is None or x.size * x.dt_s < SLOW_S for v, x in zip(read, loadings, strict=True)):
        return loadings
    if 1 / loadings[0].dt_s < _STEADY_HZ:
        return loadings
    steps = [x.dt_s for x in loadings]
    expected = expected_voltages(read, [x.command for x in loadings], steps)
    noise = is_noise([a - b for a, b in zip(read, expected, strict=True)], steps)
    return _with_expected_voltages(loadings) if noise else loadings


def _with_expected_voltages(loadings: list[Loading]) -> list[Loading]:
    """The loadings with the voltage that the commands make expected in place of the reading, which is kept too."""
    read, steps = [x.motion.voltage for x in loadings], [x.dt_s for x in loadings]
    expected = expected_voltages(read, [x.command for x in loadings], steps)
    return [
        replace(x, motion=replace(x.motion, voltage=v), voltage_read=x.motion.voltage)
        for x, v in zip(loadings, expected, strict=True)
    ]


def with_speed(motion: Motion, speed: np.ndarray | None) -> Motion:
    """The motion with these rotor speeds (n, k), rad/s, and their derivative.

    Of the quartic through five samples, which reads 0.01 % less at 8 Hz of 200 Hz; a parabola would read 3.5 % less,
    and a rotor's inertia be found as much too large.
    """
    if speed is None:
        return motion
    acceleration = None
    if motion.size >= 7:
        step = 12.0 * float(np.median(np.diff(motion.time_s)))
        middle = (speed[:-4] - speed[4:] + 8.0 * (speed[3:-1] - speed[1:-3])) / step
        first, last = _QUARTIC @ speed[:5] / step, -_QUARTIC[::-1, ::-1] @ speed[-5:] / step
        acceleration = np.concatenate([first, middle, last])
    return replace(motion, rotor_speed=speed, rotor_acceleration=acceleration)


def rotor_wrench(motion: Motion, vehicle: Vehicle) -> np.ndarray:
    """Reading of the believed thrusts and torques, (n, 6)."""
    force, arm, torque = baseline_wrench(motion, vehicle)
    return at_sensor(force, arm + torque, motion, vehicle)


def has_weight(vehicle: Vehicle) -> bool:
    """Whether the weight is in the reading."""
    return vehicle.kind == "stand" and not vehicle.tared and vehicle.mass_kg is not None


def loaded_by(loading: Loading, vehicle: Vehicle) -> Loading:
    """The loading with its load predicted from the believed values (a bench knows its load already)."""
    if vehicle.kind == "bench":
        return loading
    load = rotor_wrench(loading.motion, vehicle)
    rest = np.zeros(6)
    if has_weight(vehicle):
        heavy = weight(loading.motion, vehicle)
        load, rest = load + heavy, heavy[0]
    return replace(loading, load=load, rest=rest)


def _first_full_speed(recordings: RecordingSet, channels: tuple[int, ...]) -> float:
    """Speed at full throttle that explains the thrust read best, rad/s, a constant left free in each run."""
    vehicle = recordings.vehicle
    thrusts, reads = [], []
    if 2 not in channels:
        raise InputError(f"{recordings.name}: throttle without rotor_speed_limits_rad_s needs force_z_n")
    for run in recordings.runs:
        u, _ = commands(run, vehicle.rotor_count)
        thrust = -(u**2) @ vehicle.thrust_coefficients_n_s2()
        good = np.isfinite(run.column(c.FORCE[2]))
        read = run.column(c.FORCE[2])[good]
        thrusts.append(thrust[good] - thrust[good].mean())
        reads.append(read - read.mean())
    x, y = np.concatenate(thrusts), np.concatenate(reads)
    square = float(x @ y) / max(float(x @ x), 1e-300)
    return float(np.sqrt(abs(square))) if square else 1000.0


def session_of(recordings: RecordingSet) -> _SessionTimes:
    """When each run of a set was recorded: its runs are in the order of time.

    Where each has a clock of its own the pauses between them are not known, and the next is taken to start when the one
    before ends.
    """
    runs = recordings.runs
    lengths = [float(r.time_s[-1] - r.time_s[0]) for r in runs]
    first = float(runs[0].time_s[0])
    clock = len(runs) > 1 and all(b.time_s[0] > a.time_s[-1] for a, b in pairwise(runs))
    starts = [float(r.time_s[0]) - first for r in runs] if clock else [0.0, *np.cumsum(lengths[:-1]).tolist()]
    names = [r.name for r in runs]
    warmth = {r.name: float(_filled(r, c.TEMPERATURE)[0]) for r in runs if r.has(c.TEMPERATURE)}
    length = starts[-1] + lengths[-1] if len(runs) > 1 else 0.0
    times = {r.name: float(r.time_s[0]) for r in runs}
    return _SessionTimes(times, dict(zip(names, starts, strict=True)), length, clock, warmth)


def set_up(recordings: RecordingSet, whole: RecordingSet | None = None) -> PreparedInstrument:
    """Stretches and loads of the runs of a set.

    Parameters
    ----------
    recordings
        The runs to be fitted.
    whole
        The set that they are of, if that has more: which channels every run has, when each was recorded, and which runs
        are held out. Nothing else of the other runs is used.
    """
    # Samples times channels that are analysed; longer sets are averaged over several samples first.
    most_values = 45_000
    vehicle, whole = recordings.vehicle, whole or recordings
    channels, session = compared_channels(whole), session_of(whole)
    rows = _reading_rows(recordings.runs, channels)
    dt_s = float(np.median(np.concatenate([np.diff(r.time_s[rows[r.name]]) for r in recordings.runs])))
    full, estimated = _full_speed_of(recordings, channels)
    how, noisier = _Preparation(vehicle, channels, dt_s, full, session, _distance_column(recordings), rows), None
    loadings = how.stretches(recordings)
    if vehicle.kind == "stand" and loadings:
        loadings = without_voltmeter_noise(loadings)
        calm = [loaded_by(_turned(x, without_noise), vehicle) for x in loadings]
        if quieter(loadings, calm) is calm:
            noisier = tuple(loaded_by(_turned(x, _noised), vehicle) for x in loadings)
            loadings = calm
    if not loadings:
        raise InputError(_NO_ROWS.format(recordings.name))
    instrument = _instrument_of(recordings, how, loadings)
    wait_s = 0.0
    if instrument.bench and 1 / dt_s > _STEADY_HZ:
        wait_s = settling_s(loadings, instrument.loaded, instrument.largest, dt_s)
        if wait_s:
            loadings = without_settling(loadings, instrument.loaded, instrument.largest, wait_s)
            instrument = replace(instrument, by_hand=True)
    total = sum(x.size for x in loadings) * len(channels)
    average = max(1, int(np.ceil(total / most_values)))
    average = average if 1 / dt_s / average > _STEADY_HZ else 1
    if not any(pieces_of(x, average) for x in loadings):
        raise InputError(_NO_ROWS.format(recordings.name))
    return PreparedInstrument(
        recordings=recordings,
        vehicle=vehicle,
        split=split_runs(whole),
        instrument=instrument,
        loadings=tuple(loadings),
        average=average,
        full_speed=full,
        estimated_full_speed=estimated,
        settling_s=wait_s,
        noisier=noisier,
        full_voltage=full_voltage_of(loadings),
        session=session,
    )


def with_unseen(setup: PreparedInstrument, unseen: RecordingSet) -> PreparedInstrument:
    """The setup with the stretches of other runs behind its own, prepared by what was decided on its own.

    Runs that lack a column which the model needs are left out.
    """
    vehicle, instrument = setup.vehicle, setup.instrument
    needed = [(c.FORCE + c.MOMENT)[k] for k in instrument.channels]
    if all(x.measured for x in setup.loadings) and vehicle.rotor_count:
        needed += c.rotor_columns("rotor_speed", vehicle.rotor_count)
    commanded = all(x.command is not None for x in setup.loadings)
    runs = [r for r in unseen.runs if r.has(*needed)]
    runs = [r for r in runs if not commanded or commands(r, vehicle.rotor_count)[0] is not None]
    dt_s = 1.0 / instrument.rate_hz
    how = _Preparation(
        vehicle=unseen.vehicle,
        channels=instrument.channels,
        dt_s=dt_s,
        full_speed=setup.full_speed,
        session=setup.session,
        distance=instrument.distance,
        rows=_reading_rows(runs, instrument.channels),
    )
    own = how.stretches(replace(unseen, runs=tuple(runs)))
    if own and any(x.voltage_read is not None for x in setup.loadings):
        own = _with_expected_voltages(own)
    if setup.noisier is not None:
        own = [loaded_by(_turned(x, without_noise), vehicle) for x in own]
    if setup.settling_s:
        own = list(without_settling(own, instrument.loaded, instrument.largest, setup.settling_s))
    every = replace(unseen, runs=(*setup.recordings.runs, *runs))
    return replace(setup, recordings=every, loadings=(*setup.loadings, *own))


def full_voltage_of(loadings: Sequence[Loading]) -> float | None:
    """Largest battery voltage that was read, V; None where none was."""
    read = [x.motion.voltage if x.voltage_read is None else x.voltage_read for x in loadings]
    known = [float(np.max(v)) for v in read if v is not None]
    return max(known, default=None)


def _full_speed_of(recordings: RecordingSet, channels: tuple[int, ...]) -> tuple[float | None, bool]:
    """Rotor speed at full throttle, rad/s (None where it is not stated and not needed), and whether it is estimated."""
    vehicle = recordings.vehicle
    if not vehicle.rotor_count:
        return None, False
    measured = all(r.has(*c.rotor_columns("rotor_speed", vehicle.rotor_count)) for r in recordings.runs)
    known = [commands(r, vehicle.rotor_count) for r in recordings.runs]
    if not measured and not any(command is not None for command, _ in known):
        raise InputError(f"{recordings.name}: neither rotor speeds nor commands nor throttles are recorded")
    if vehicle.rotor_speed_limits_rad_s is not None:
        return float(vehicle.rotor_speed_limits_rad_s[1]), False
    if not any(throttle for _, throttle in known):
        return None, False
    return _measured_full_speed(recordings) if measured else _first_full_speed(recordings, channels), True


def _measured_full_speed(recordings: RecordingSet) -> float:
    """Speed per unit of throttle, robustly, from speeds that were measured with it."""
    count = recordings.vehicle.rotor_count
    ratios = []
    for run in recordings.runs:
        u, _ = commands(run, count)
        speed = _several(run, c.rotor_columns("rotor_speed", count))
        if u is not None and speed is not None:
            turning = u > 0.1 * np.nanmax(u)
            ratios.append((speed[turning] / u[turning]).ravel())
    return float(np.median(np.concatenate(ratios))) if ratios else 1000.0


def _distance_column(recordings: RecordingSet) -> str:
    """Unknown column that is a distance to a wall or fixture and differs between runs or within one."""
    for name in recordings.runs[0].unknown_columns:
        if name.endswith("_m") and any(w in name for w in ("distance", "wall", "fixture")):
            values = np.concatenate([r.column(name) for r in recordings.runs])
            if np.isfinite(values).all() and np.ptp(values) > 0:
                return name
    return ""


def _instrument_of(recordings: RecordingSet, how: _Preparation, loadings: Sequence[Loading]) -> InstrumentFacts:
    """What the forms of effects need to know beforehand."""
    least_warmth_k = 0.1  # A temperature that changes by less says nothing.
    channels, session = how.channels, how.session
    load = np.concatenate([x.load for x in loadings])
    spread = np.concatenate([x.load - x.rest for x in loadings]).std(axis=0)
    still = load.std(axis=0) < 1e-9
    loaded, weighed = [], []
    for group in ((0, 1, 2), (3, 4, 5)):
        top = max(spread[list(group)].max(), 1e-12)
        moved = [k for k in group if not still[k] and k in channels]
        loaded += [k for k in moved if spread[k] > _LEAST_SHARE * top]
        weighed += [k for k in moved if spread[k] <= _LEAST_SHARE * top < load[:, k].std()]
    if not any(k < 3 for k in loaded) and spread[:3].max() > 1e-9:
        loaded.insert(0, int(np.argmax(spread[:3])))
    largest = np.maximum(np.abs(np.concatenate([x.load - x.rest for x in loadings])).max(axis=0), 1e-9)
    attitudes = [np.concatenate([x.attitude[i] for x in loadings]) for i in (0, 1)] if loadings[0].attitude else []
    known = [x.temperature_c for x in loadings if x.temperature_c is not None]
    warmth = np.concatenate(known) if len(known) == len(loadings) else np.zeros(1)
    return InstrumentFacts(
        vehicle=how.vehicle,
        channels=channels,
        loaded=tuple(loaded),
        rate_hz=1.0 / how.dt_s,
        duration_s=float(max(x.time_s[-1] - x.time_s[0] for x in loadings)),
        runs=tuple(r.name for r in recordings.runs),
        run_s=float(max(r.time_s[-1] - r.time_s[0] for r in recordings.runs)),
        largest=tuple(float(v) for v in largest),
        weighed=tuple(weighed),
        returns=tuple(k for k in loaded if _comes_back(loadings, k, float(largest[k]))),
        tilts=any(np.ptp(a) > 0.02 for a in attitudes),
        temperature=all(x.temperature is not None for x in loadings)
        and any(np.ptp(x.temperature) > least_warmth_k for x in loadings),
        temperatures_c=(float(warmth.min()), float(warmth.max())) if np.ptp(warmth) > least_warmth_k else (0.0, 0.0),
        first_temperature_c=float(warmth[0]),
        zero_temperature_c=zero_temperature(loadings, channels) if np.ptp(warmth) > least_warmth_k else None,
        session_s=session.length_s,
        session_clock=session.clock,
        distance=how.distance,
    )


def zero_temperature(loadings: Sequence[Loading], channels: tuple[int, ...]) -> float | None:
    """Temperature, °C, at which all readings less loads would be nothing if they went with it; None if none do.

    From a line y = b T + z + g F in every channel: T_0 = −Σ w b z / Σ w b², w one over the squares left.
    """
    warmth = np.concatenate([x.temperature_c for x in loadings])
    above = below = 0.0
    for k in channels:
        load = np.concatenate([x.load[:, k] for x in loadings])
        left = np.concatenate([x.reading[:, k] for x in loadings]) - load
        columns = np.stack([warmth - warmth.mean(), np.ones_like(warmth), load], axis=1)
        (slope, middle, gain), *_ = np.linalg.lstsq(columns, left, rcond=1e-9)
        weight = 1.0 / max(float(np.sum((left - columns @ (slope, middle, gain)) ** 2)), 1e-300)
        above += weight * slope * middle
        below += weight * slope**2
    return float(warmth.mean() - above / below) if below > 0 else None


def _comes_back(loadings: Sequence[Loading], channel: int, largest: float) -> bool:
    """Whether a load is met from above as well as from below at values other than none."""
    falling = total = 0
    for x in loadings:
        load = x.load[:, channel] - x.rest[channel]
        width = NARROW * largest
        branch = (load - play(load, width)) / width * np.sign(load)
        at_work = np.abs(load) > _LEAST_SHARE * largest
        falling += int(np.sum(at_work & (branch < -0.5)))
        total += int(np.sum(at_work))
    return falling > _LEAST_SHARE * max(total, 1)


def pieces_of(loading: Loading, count: int) -> list[np.ndarray]:
    """Numbers of the rows (means of `count` samples) of each part of a stretch that is compared."""
    total = loading.size // count
    if loading.keep is None:
        return [np.arange(total)] if total >= 2 else []
    good = np.flatnonzero(loading.keep[: total * count].reshape(total, count).all(axis=1))
    return [p for p in np.split(good, np.flatnonzero(np.diff(good) > 1) + 1) if len(p) >= _SHORTEST]


def averaged(values: np.ndarray, count: int) -> np.ndarray:
    """Means of `count` samples in a row, (n, …) to (n // count, …)."""
    if count == 1:
        return values
    whole = len(values) // count * count
    return values[:whole].reshape(len(values) // count, count, *values.shape[1:]).mean(axis=1)
