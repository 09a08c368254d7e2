"""From a recorded run to evenly sampled stretches of flight, with what is missing derived where that is honest:
velocity, height, voltage and regime variables (what a mismatch may depend on).

A recorded velocity may be an estimate made from the recorded accelerometer. An autopilot's filter integrates its
accelerometer between the fixes of a slower sensor: the accelerometer's errors, its noise and the vibrations that it
feels are then in the velocity, too, and comparing the two shows nothing of them. It shows at frequencies above those at
which a vehicle moves: the change of an independent velocity is that sensor's own noise there and has nothing in common
with the accelerometer.

The height is freed of its sensor's flutter, which the steep laws of ground effect would take for thrust, and the
battery's voltage of its voltmeter's noise: noise in a regressor flattens what multiplies it, so the exponent of the sag
comes out too small, and what is left follows the command (which loads the battery), as a throttle curve would. A
battery changes slowly, and quickly only as it is loaded: the reading's slow part, and of its quick part what follows
the commanded load, is what can be expected of the voltage (two-stage least squares with time and load as instruments).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d
from scipy.signal import csd, lfilter, welch

from rotorid.effects.contract import Motion
from rotorid.effects.scale import hover_inflow_m_s
from rotorid.recordings import Run, Vehicle
from rotorid.recordings import columns as c
from rotorid.recordings.run import stretches
from rotorid.recordings.signal import kernels

SLOW_S = 5.0
"""Length of the mean that is taken for slow."""
SensorNoise = dict[str, np.ndarray]
"""One-sigma per sample of white noise of each column of a sensor, (columns,), by the sensor's key."""
LONGEST_BRIDGED_SAMPLES = 6
"""A hole of up to this many of a column's own periods is interpolated; a longer one splits the run or stays a hole."""
SHORTEST_SEGMENT_S = 2.0


@dataclass(frozen=True)
class Segment:
    """An evenly sampled stretch of one run.

    `motion` holds the measured (or derived) flight. `kinematic_*` are what position and attitude say of the same
    quantity that an inertial sensor measures, None where only one source exists.
    """

    run: str
    rate_hz: float
    motion: Motion
    force_source: str
    """`accelerometer`, `velocity`, `position` or `none`."""
    kinematic_specific_force: np.ndarray | None = None
    kinematic_angular_velocity: np.ndarray | None = None
    command: np.ndarray | None = None
    """Commanded rotor speeds, (n, k), rad/s; throttle times `full_speed` where only throttle is recorded."""
    full_speed: float | None = None
    """rad/s; None where speeds are commanded."""
    measured_speed: bool = True
    independent_velocity: bool = True
    """Whether the velocity knows nothing of the accelerometer, so that comparing the two shows errors of the latter."""
    extra: dict[str, np.ndarray] = field(default_factory=dict)
    """Unknown columns of the run, candidates for a regime variable."""

    @property
    def dt_s(self) -> float:
        return 1.0 / self.rate_hz

    def part(self, start: int, stop: int) -> Segment:
        """The samples from start to stop (exclusive)."""
        cut = slice(start, stop)

        def of(values):
            return None if values is None else values[cut]

        return replace(
            self,
            motion=self.motion.at(cut),
            kinematic_specific_force=of(self.kinematic_specific_force),
            kinematic_angular_velocity=of(self.kinematic_angular_velocity),
            command=of(self.command),
            extra={name: values[cut] for name, values in self.extra.items()},
        )


def own_rate_hz(time_s: np.ndarray, values: np.ndarray) -> float:
    """Rate at which a column (or columns, (n, m)) truly changes: missing and held samples do not count."""
    fresh = fresh_samples(values)
    if fresh.sum() < 3:
        return 0.0
    return 1.0 / float(np.median(np.diff(time_s[fresh])))


def fresh_samples(values: np.ndarray) -> np.ndarray:
    """Mask of samples that carry a new value, shape (n,): present, and not a repeat of a held reading.

    Repeats count as held only where they are the rule (over 40 % of the samples) and come as evenly as a slower
    sensor's do: a constant column is no sample-and-hold, nor is a coarsely quantised one, whose repeats come by chance.
    """
    values = values.reshape(len(values), -1)
    present = np.isfinite(values).all(axis=1)
    index = np.flatnonzero(present)
    if len(index) < 3:
        return present
    changed = np.ones(len(index), bool)
    changed[1:] = np.any(np.diff(values[index], axis=0) != 0.0, axis=1)
    share = changed.mean()
    if 0.02 < share < 0.6 and _evenly_spaced(np.flatnonzero(changed)):
        present = np.zeros(len(values), bool)
        present[index[changed]] = True
    return present


def _evenly_spaced(index: np.ndarray) -> bool:
    """Whether the gaps between rising indices are nearly all one length, give or take a sample.

    Where each sample repeats by chance with a probability above 0.4, fewer than `even_share` of the (geometrically
    distributed) gaps lie within one sample of their median.
    """
    gaps = np.diff(index)
    even_share = 0.85
    return bool(np.mean(np.abs(gaps - np.median(gaps)) <= 1) >= even_share)


def _resample(time_s, values, grid_s, smooth):
    """Values on the grid, NaN inside long holes; cubic where the signal is smooth, else linear."""
    keep = fresh_samples(values)
    t, v = time_s[keep], values[keep]
    if len(t) < 4:
        return np.full((len(grid_s),) + values.shape[1:], np.nan)
    if len(t) == len(grid_s) and np.allclose(t, grid_s, atol=1e-6 * (t[1] - t[0]), rtol=0):
        return v.copy()
    if smooth:
        out = CubicSpline(t, v, axis=0, extrapolate=False)(grid_s)
    else:
        out = np.stack(
            [np.interp(grid_s, t, col, left=np.nan, right=np.nan) for col in v.reshape(len(t), -1).T], axis=1
        ).reshape((len(grid_s),) + values.shape[1:])
    gap = np.diff(t)
    longest = LONGEST_BRIDGED_SAMPLES * float(np.median(gap))
    for k in np.flatnonzero(gap > longest):
        out[(grid_s > t[k]) & (grid_s < t[k + 1])] = np.nan
    return out


def rotation_matrices(quaternion: np.ndarray) -> np.ndarray:
    """Body-to-world rotations, (n, 3, 3), of unit quaternions (n, 4), scalar first, Hamilton."""
    w, x, y, z = quaternion.T
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], axis=-1),
            np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], axis=-1),
            np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=-1),
        ],
        axis=-2,
    )


def continuous(quaternion: np.ndarray) -> np.ndarray:
    """The same attitudes with signs flipped so that successive quaternions stay on one side; NaN kept."""
    out = quaternion.copy()
    present = np.flatnonzero(np.isfinite(out).all(axis=1))
    dots = np.einsum("ij,ij->i", out[present[1:]], out[present[:-1]])
    out[present[1:]] *= np.cumprod(np.where(dots < 0, -1.0, 1.0))[:, None]
    return out


def rates_from_attitude(quaternion: np.ndarray, derivative_of: np.ndarray) -> np.ndarray:
    """Body rates (n, 3), rad/s: Ω = 2 q* ⊗ dq/dt."""
    w, x, y, z = quaternion.T
    dw, dx, dy, dz = derivative_of.T
    return 2 * np.stack(
        [
            w * dx - x * dw - y * dz + z * dy,
            w * dy - y * dw - z * dx + x * dz,
            w * dz - z * dw - x * dy + y * dx,
        ],
        axis=1,
    )


HIGHEST_CUTOFF_HZ = 20.0
"""Cutoff of an analysis where the sensors' rates allow it."""


def analysis_rate_hz(runs: tuple[Run, ...], vehicle: Vehicle, highest_cutoff_hz: float) -> tuple[float, float]:
    """Rate of the common grid and cutoff of the analysis, Hz, for all runs of a set."""
    rates, cutoffs = [], []
    # Rate below which readings of rotors limit the band: of what a vehicle does within a second they hold nothing,
    # while a curve through ten readings a second follows motions of one and a half hertz.
    seldom_hz = 5.0
    for run in runs:
        t = run.time_s
        base = 1.0 / float(np.median(np.diff(t)))
        own = []
        inertial = [c.ANGULAR_VELOCITY if run.has(*c.ANGULAR_VELOCITY) else c.QUATERNION]
        force = next((s for s in (c.SPECIFIC_FORCE, c.VELOCITY, c.POSITION, c.FORCE) if run.has(*s)), None)
        inertial += [force] if force else []
        for kind in ("rotor_speed", "rotor_command", "throttle"):
            names = c.rotor_columns(kind, vehicle.rotor_count)
            if names and run.has(*names):
                inertial.append(names)
                break
        for names in inertial:
            if run.has(*names):
                joined_hz = run.joined_hz.get(names[0], np.inf)
                own.append(min(own_rate_hz(t, run.array(names)), joined_hz if joined_hz < seldom_hz else np.inf))
        rates.append(base)
        cutoffs.append(0.4 * min([r for r in own if r > 0], default=base))
    return float(np.median(rates)), float(min(highest_cutoff_hz, *cutoffs))


def build_segments(
    run: Run,
    vehicle: Vehicle,
    rate_hz: float,
    cutoff_hz: float,
    shift_s: dict[str, float] | None = None,
    noise: SensorNoise | None = None,
    rng: np.random.Generator | None = None,
    full_speed_rad_s: float | None = None,
) -> list[Segment]:
    """Evenly sampled stretches of a run in which every column needed for the analysis is there.

    `shift_s` moves a sensor's columns in time: a positive value says that the sensor's stamps are late by it.
    Keys: `accelerometer`, `gyroscope`, `attitude`, `velocity`, `position`, `rotors`. `noise` adds white noise of
    that one-sigma per sample to each of a sensor's columns (same keys), to learn what noise does to the analysis. A
    throttle is one of `full_speed_rad_s` (`full_speed` of the run alone where None).
    """
    shift_s, noise = shift_s or {}, noise or {}
    t = run.time_s
    dt = 1.0 / rate_hz
    grid = t[0] + dt * np.arange(int(np.floor((t[-1] - t[0]) * rate_hz + 1e-6)) + 1)

    def take(names, key, smooth=True):
        if not names or not run.has(*names):
            return None
        values = run.array(tuple(names))
        if key == "attitude":
            values = continuous(values / np.linalg.norm(values, axis=1, keepdims=True))
        out = _resample(t - shift_s.get(key, 0.0), values, grid, smooth)
        if np.any(noise.get(key, 0.0)):
            out = out + noise[key] * rng.standard_normal(out.shape)
        return None if np.isfinite(out).all(axis=1).sum() < 4 else out

    count = vehicle.rotor_count
    speed = take(c.rotor_columns("rotor_speed", count), "rotors", smooth=False)
    command = take(c.rotor_columns("rotor_command", count), "commands", smooth=False)
    of_full = None
    if command is None:
        throttle = take(c.rotor_columns("throttle", count), "commands", smooth=False)
        if throttle is not None:
            of_full = full_speed_rad_s or full_speed((run,), vehicle)
            command = throttle * of_full
    measured = speed is not None
    used_speed = speed if measured else command
    gyro = take(c.ANGULAR_VELOCITY, "gyroscope")
    attitude = take(c.QUATERNION, "attitude")
    accelerometer = take(c.SPECIFIC_FORCE, "accelerometer")
    velocity = take(c.VELOCITY, "velocity")
    position = take(c.POSITION, "position")
    height = take((c.HEIGHT,), "height")
    voltage = take((c.BATTERY_VOLTAGE,), "voltage", smooth=False)
    needed = [a for a in (used_speed, command, gyro, attitude, accelerometer, velocity, position) if a is not None]
    good = np.ones(len(grid), bool)
    for array in needed:
        good &= np.isfinite(array).all(axis=1)
    if velocity is None and position is None and height is not None:
        good &= np.isfinite(height).all(axis=1)

    segments = []
    # Highest cutoff of a derivative, as a share of the rate: at 0.45 its gain below 4 Hz is 1.5 to 3 % too large.
    widest_slope = 0.4
    inner = min(widest_slope * rate_hz, 1.6 * cutoff_hz)
    margin = kernels.half_length(rate_hz, inner)
    slope = kernels.derivative(rate_hz, inner)
    for start, stop in stretches(good):
        if (stop - start) * dt < SHORTEST_SEGMENT_S + 4 * margin * dt:
            continue
        cut = slice(start, stop)
        inside = slice(start + margin, stop - margin)

        def rate_of(array, cut=cut):
            return kernels.apply(slope, array[cut])

        def core(array, inside=inside):
            return None if array is None else array[inside]

        rotation = kinematic_rate = None
        if attitude is not None:
            q = attitude[inside] / np.linalg.norm(attitude[inside], axis=1, keepdims=True)
            rotation = rotation_matrices(q)
            kinematic_rate = rates_from_attitude(q, rate_of(attitude))
        rate = core(gyro) if gyro is not None else kinematic_rate
        if gyro is not None:
            acceleration = rate_of(gyro)
        elif attitude is not None:
            acceleration = np.zeros_like(kinematic_rate)
            acceleration[:] = np.gradient(kinematic_rate, dt, axis=0)
        else:
            acceleration = None

        world_velocity = world_acceleration = None
        if velocity is not None:
            world_velocity, world_acceleration = core(velocity), rate_of(velocity)
        elif position is not None:
            world_velocity = rate_of(position)
            world_acceleration = np.gradient(world_velocity, dt, axis=0)
        body_velocity = kinematic_force = None
        if rotation is not None and world_velocity is not None:
            body_velocity = np.einsum("nji,nj->ni", rotation, world_velocity)
            gravity = np.array([0.0, 0.0, vehicle.gravity_m_s2])
            kinematic_force = np.einsum("nji,nj->ni", rotation, world_acceleration - gravity)
        if accelerometer is not None:
            source, specific_force = "accelerometer", core(accelerometer)
        elif kinematic_force is not None:
            source, specific_force = ("velocity" if velocity is not None else "position"), kinematic_force
            kinematic_force = None
        else:
            source, specific_force = "none", None
        if gyro is None:
            kinematic_rate = None

        above = None
        if height is not None:
            above = core(height)[:, 0]
        elif position is not None and vehicle.ground_z_m is not None:
            above = vehicle.ground_z_m - core(position)[:, 2]
        if above is not None:
            above = quiet_height(above, None if world_velocity is None else -world_velocity[:, 2], dt)
        motion = Motion(
            time_s=grid[inside],
            rotor_speed=core(used_speed),
            rotor_acceleration=None if used_speed is None else rate_of(used_speed),
            angular_velocity=rate,
            angular_acceleration=acceleration,
            specific_force=specific_force,
            accelerometer=specific_force if source == "accelerometer" else None,
            gyroscope=rate if gyro is not None and kinematic_rate is not None else None,
            rotation=rotation,
            velocity=body_velocity,
            position=core(position),
            height=above,
            voltage=None if voltage is None else _held_through_gaps(core(voltage)[:, 0]),
        )
        extra = {n: between_readings(motion.time_s, t, run.column(n)) for n in run.unknown_columns}
        segments.append(
            Segment(
                run=run.name,
                rate_hz=rate_hz,
                motion=motion,
                force_source=source,
                kinematic_specific_force=kinematic_force,
                kinematic_angular_velocity=kinematic_rate,
                command=core(command),
                full_speed=of_full,
                measured_speed=measured,
                extra=extra,
            )
        )
    return segments


def between_readings(instants: np.ndarray, time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """A column (n,) at instants (m,) by straight lines between its readings; 0 where it has none at all."""
    known = np.isfinite(values)
    return np.interp(instants, time_s[known], values[known]) if known.any() else np.zeros(len(instants))


def _held_through_gaps(values: np.ndarray) -> np.ndarray | None:
    """A slow signal (n,) with its missing samples interpolated, held at the ends; None where nothing is there."""
    known = np.isfinite(values)
    if not known.any():
        return None
    index = np.arange(len(values))
    return np.interp(index, index[known], values[known])


def full_speed(runs: Sequence[Run], vehicle: Vehicle) -> float | None:
    """Rotor speed at full throttle, rad/s: the limit stated, else estimated from all runs; None without throttle."""
    if vehicle.rotor_speed_limits_rad_s:
        return vehicle.rotor_speed_limits_rad_s[1]
    names = c.rotor_columns("throttle", vehicle.rotor_count)
    throttle = [run.array(names) for run in runs if names and run.has(*names)]
    return estimated_full_speed(vehicle, np.concatenate(throttle)) if throttle else None


def estimated_full_speed(vehicle: Vehicle, throttle: np.ndarray) -> float:
    """Full-throttle rotor speed, rad/s, such that the mean squared throttle carries the believed weight."""
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    mean_square = float(np.nanmean(throttle**2, axis=0) @ vehicle.thrust_coefficients_n_s2())
    return float(np.sqrt(weight / mean_square))


def made_from_accelerometer(segments: Iterable[Segment], cutoff_hz: float) -> bool:
    """Whether velocity and accelerometer of these stretches share what is above `cutoff_hz`."""
    window = 128  # Samples of a window of the spectra.
    cross = np.zeros((3, window // 2 + 1), complex)
    read, moved = np.zeros(cross.shape), np.zeros(cross.shape)
    band = np.zeros(cross.shape[1], bool)
    highest = 0.48  # Highest frequency compared, as a share of the rate.
    for s in segments:
        motion = s.motion
        both = motion.accelerometer is not None and motion.velocity is not None and motion.rotation is not None
        if not both or motion.size <= window:
            continue
        velocity, force = (
            np.einsum("nij,nj->in", motion.rotation, own) for own in (motion.velocity, motion.accelerometer)
        )
        change, between = np.diff(velocity) * s.rate_hz, 0.5 * (force[:, 1:] + force[:, :-1])
        how = {"fs": s.rate_hz, "nperseg": window, "axis": 1}
        f_hz, own = csd(between, change, **how)
        band |= (f_hz > cutoff_hz) & (f_hz < highest * s.rate_hz)
        cross += motion.size * own
        read += motion.size * welch(between, **how)[1]
        moved += motion.size * welch(change, **how)[1]
    if not band.any():
        return False
    coherence = np.abs(cross) ** 2 / np.maximum(read * moved, 1e-300)
    # Coherence from which the two have a source in common: simulated autopilots have 0.2 to 1, independent sensors up
    # to 0.03, which is what chance alone makes of forty windows.
    least_common = 0.15
    return bool(coherence[:, band].mean() > least_common)


def quiet_height(height_m: np.ndarray, climb_m_s: np.ndarray | None, dt_s: float) -> np.ndarray:
    """Height (n,), m, from readings (n,) and the vertical velocity upwards (n,), m/s; NaN stays NaN.

    A complementary filter without phase: slow changes of `height_m` less the climb integrated, and the climb on top.
    1/z² of a height with noise is more than of the height: 7 mm at 3 cm make a third of the ground effect.
    """
    known = np.isfinite(height_m)
    if known.sum() < 2:
        return height_m
    # Below it the height is the sensor's, above it the climb integrated (half the power passes); and the same where no
    # climb is known: no vehicle near the ground changes its height faster.
    slow_hz, slow_alone_hz = 1.0, 3.0
    cutoff_hz, climbed = slow_alone_hz, np.zeros(len(height_m))
    if climb_m_s is not None and np.isfinite(climb_m_s).all():
        cutoff_hz = slow_hz
        climbed[1:] = np.cumsum((climb_m_s[1:] + climb_m_s[:-1]) / 2 * dt_s)
    index = np.arange(len(height_m))
    rest = np.interp(index, index[known], (height_m - climbed)[known])
    sigma_s = np.sqrt(np.log(2.0)) / (2 * np.pi * cutoff_hz)
    return np.where(known, gaussian_filter1d(rest, sigma_s / dt_s, mode="nearest") + climbed, np.nan)


def regime_variables(segment: Segment, prepared) -> dict[str, np.ndarray]:
    """Regime variables on the thinned instants of a segment, with units in their names."""
    motion, vehicle, thin = segment.motion, prepared.vehicle, prepared.thinner
    out = {"time_s": thin.times(motion.time_s)}

    def add(name, values):
        if values is not None:
            out[name] = thin(np.asarray(values, float))

    if motion.velocity is not None:
        add("airspeed_m_s", np.linalg.norm(motion.velocity, axis=1))
        add("forward_speed_m_s", motion.velocity[:, 0])
        add("sideward_speed_m_s", motion.velocity[:, 1])
        add("vertical_speed_over_hover_inflow", motion.velocity[:, 2] / hover_inflow_m_s(vehicle))
    if motion.height is not None:
        add("height_over_rotor_radius", motion.height / (vehicle.rotor_radius_m or 1.0))
    if motion.rotor_speed is not None:
        add("rotor_speed_rad_s", motion.rotor_speed.mean(axis=1))
        if motion.rotor_acceleration is not None:
            add("rotor_acceleration_rad_s2", motion.rotor_acceleration.mean(axis=1))
    if motion.rotation is not None:
        add("tilt_rad", np.arccos(np.clip(motion.rotation[:, 2, 2], -1, 1)))
    if motion.angular_velocity is not None:
        add("body_rate_rad_s", np.linalg.norm(motion.angular_velocity, axis=1))
    add("battery_voltage_v", motion.voltage)
    for name, values in segment.extra.items():
        if np.ptp(values) > 0:
            add(name, values)
    return out


def without_noise(segments: list[Segment]) -> list[Segment]:
    """Segments with the expected voltage in place of the reading; as they are where voltage or command is missing."""
    if not segments or any(s.motion.voltage is None or s.command is None for s in segments):
        return segments
    expected = expected_voltages(
        [s.motion.voltage for s in segments], [s.command for s in segments], [s.dt_s for s in segments]
    )
    return [replace(s, motion=replace(s.motion, voltage=v)) for s, v in zip(segments, expected, strict=True)]


def expected_voltages(voltages: list[np.ndarray], commands: list[np.ndarray], steps_s: list[float]) -> list[np.ndarray]:
    """What can be expected of voltages (n,), V, read in stretches of even steps with commanded rotor speeds (n, k)."""
    slow, quick, loads = [], [], []
    for voltage, command, dt_s in zip(voltages, commands, steps_s, strict=True):
        size = min(len(voltage) - 1, int(SLOW_S / dt_s)) | 1
        slow.append(running_mean(voltage, size))
        quick.append(voltage - slow[-1])
        columns = _relaxed((command**3).sum(axis=1), dt_s)
        loads.append(columns - np.stack([running_mean(c, size) for c in columns.T], axis=1))
    all_loads = np.concatenate(loads)
    scale = np.maximum(all_loads.std(axis=0), 1e-300)
    drop, *_ = np.linalg.lstsq(all_loads / scale, np.concatenate(quick), rcond=1e-6)
    return [a + (b / scale) @ drop for a, b in zip(slow, loads, strict=True)]


def is_noise(rests: list[np.ndarray], steps_s: list[float]) -> bool:
    """Whether what was taken off voltages (n,) is a voltmeter's noise: means over `memory_s` of it are near nothing.

    A supply that is switched over in steps is neither slow nor does it follow the load; it stays as it was read.
    """
    power, kept = 0.0, 0.0
    # Noise has forgotten itself after so long: means over it hold less than this share of its power.
    memory_s, most_memory = 1.0, 0.2
    for rest, dt_s in zip(rests, steps_s, strict=True):
        size = max(int(memory_s / dt_s), 1)
        count = len(rest) // size
        power += float(rest[: count * size] @ rest[: count * size]) / size
        kept += float(np.sum(rest[: count * size].reshape(count, size).mean(axis=1) ** 2))
    return kept < most_memory * power


def _relaxed(load: np.ndarray, dt_s: float) -> np.ndarray:
    """A load (n,) through first-order lags of every time constant, settled at the start, (n, 5)."""
    relaxation_s = (0.0, 0.03, 0.1, 0.3, 1.0)  # Time constants with which the voltage may follow the load.
    keeps = [np.exp(-dt_s / tau) if tau > 0 else 0.0 for tau in relaxation_s]
    return np.stack([lfilter([1 - k], [1, -k], load, zi=[k * load[0]])[0] for k in keeps], axis=1)


def running_mean(values: np.ndarray, size: int) -> np.ndarray:
    """Mean of `size` (odd) samples about each of (n,), continued at the ends along a line through the last `size`."""
    half = size // 2
    total = np.cumsum(np.concatenate([[0.0], values - values[0]]))
    inner = values[0] + (total[size:] - total[:-size]) / size
    at = np.arange(size)
    first, last = (np.polyval(np.polyfit(at, end, 1), at) for end in (values[:size], values[-size:]))
    return np.concatenate([first[:half], inner, last[size - half :]])
