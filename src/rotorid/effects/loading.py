"""What an instrument (kind `stand` or `bench`) went through, and what a form of its effects is evaluated on.

A stand carries a vehicle on a six-axis sensor and reads the wrench that the vehicle exerts on it; a bench is loaded
with known forces. Either way there is a load that the believed values predict, and a reading. Readings and loads are
(n, 6): force_x … moment_z, N and N m, sensor axes; a channel that is not recorded is NaN in the reading.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Motion, Parameter, compiled
from rotorid.recordings.vehicle import Vehicle

CHANNELS = tuple(f"{g}_{a}" for g in ("force", "moment") for a in "xyz")
UNITS = ("N", "N", "N", "N m", "N m", "N m")
AXES = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
NO_ROTORS = "a bench has no rotors"
TOO_SHORT = "the recordings are too short or too slow to show it"
REST_S = 3.0
"""A gap in the recording longer than this is taken as the load having been off."""


@dataclass(frozen=True)
class InstrumentFacts:
    """What is known of an instrument and its set before any number is fitted."""

    vehicle: Vehicle
    channels: tuple[int, ...]
    """Channels that are recorded, numbers in `CHANNELS`."""
    loaded: tuple[int, ...]
    """Channels whose load varies by more than a twentieth of the largest of their kind."""
    rate_hz: float
    duration_s: float
    """Of the longest stretch without a gap."""
    run_s: float
    """Of the longest run, gaps and all."""
    runs: tuple[str, ...]
    """Those that are fitted."""
    largest: tuple[float, ...] = (1.0,) * 6
    """Largest load of each channel, N and N m."""
    weighed: tuple[int, ...] = ()
    """Others that the weight alone loads by as much, because the mount tilts."""
    tilts: bool = False
    """Whether the mount's attitude differs between runs or within one."""
    temperature: bool = False
    """Whether a temperature is recorded that changes within a run."""
    temperatures_c: tuple[float, float] = (0.0, 0.0)
    """Lowest and highest temperature of the set, where one is recorded; alike where it says nothing."""
    first_temperature_c: float = 0.0
    """Temperature of the set's first sample."""
    zero_temperature_c: float | None = None
    """Temperature at which the readings suggest that the zero was right: where the search for it starts."""
    session_s: float = 0.0
    """How long the session was, all runs together, as far as known; 0 of a single run."""
    session_clock: bool = False
    """Whether `time_s` runs on from run to run; else pauses between the runs are not known."""
    returns: tuple[int, ...] = ()
    """Channels whose load also comes back from above to values that are not zero."""
    by_hand: bool = False
    """Whether loads were put on by hand, so that nothing that happens within seconds can be distinguished from that."""
    distance: str = ""
    """Name of an unknown column that is a distance to a wall or fixture."""

    @property
    def bench(self) -> bool:
        return self.vehicle.kind == "bench"


@dataclass(frozen=True)
class Loading:
    """Even samples of one run without a gap."""

    run: str
    time_s: np.ndarray
    run_time_s: np.ndarray
    """Time since the run's first sample, s."""
    load: np.ndarray
    """Wrench that the believed values predict at the sensor, (n, 6)."""
    reading: np.ndarray
    """Wrench as read, (n, 6)."""
    rest: np.ndarray
    """Load before the first sample as far as known, (6,): the weight on an untared stand, else nothing."""
    motion: Motion
    """Rotor speeds and what acts on them; empty on a bench."""
    attitude: tuple[np.ndarray, np.ndarray] | None = None
    """Roll and pitch of the mount, (n,) each, rad."""
    temperature: np.ndarray | None = None
    """Change of temperature since the run's first sample, (n,), K."""
    temperature_c: np.ndarray | None = None
    """The temperature itself, (n,), °C."""
    session_time_s: np.ndarray | None = None
    """Time since the first sample of the set, (n,), s: `Instrument.session_clock` says whether pauses are in it."""
    distance: np.ndarray | None = None
    """Distance to a wall or fixture, (n,), m."""
    command: np.ndarray | None = None
    """Commanded rotor speeds (throttle times full speed), (n, k), rad/s."""
    measured: bool = True
    """Whether the rotor speeds were measured (not commanded)."""
    keep: np.ndarray | None = None
    """Mask of the samples to be compared, (n,); None for all."""
    speed_read: np.ndarray | None = None
    """Rotor speeds as they were read, (n, k), rad/s, where those of the motion are smoothed."""
    voltage_read: np.ndarray | None = None
    """Battery voltage as it was read, (n,), V, where that of the motion is what can be expected of it."""
    extra: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def size(self) -> int:
        return len(self.time_s)

    @property
    def dt_s(self) -> float:
        return float(self.time_s[1] - self.time_s[0])


def rotation_of(roll: np.ndarray, pitch: np.ndarray) -> np.ndarray:
    """Body vectors into level axes for roll and pitch (n,), rad, shape (n, 3, 3): R_y(pitch) R_x(roll)."""
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    zero = np.zeros_like(cr)
    return np.stack(
        [
            np.stack([cp, sp * sr, sp * cr], axis=-1),
            np.stack([zero, cr, -sr], axis=-1),
            np.stack([-sp, cp * sr, cp * cr], axis=-1),
        ],
        axis=-2,
    )


def turned(rotation: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """R v at every instant, (n, 3); of wrenches R F and R M, (n, 6)."""
    return _turned(rotation, np.broadcast_to(np.asarray(vectors, float), (len(rotation), np.shape(vectors)[-1])))


@compiled()
def _turned(rotation, vectors):
    out = np.empty(vectors.shape)
    for n in range(len(vectors)):
        for i in range(vectors.shape[1]):
            row, first = rotation[n, i % 3], i - i % 3
            out[n, i] = row[0] * vectors[n, first] + row[1] * vectors[n, first + 1] + row[2] * vectors[n, first + 2]
    return out


def at_sensor(force: np.ndarray | None, moment: np.ndarray | None, motion: Motion, vehicle: Vehicle) -> np.ndarray:
    """A wrench about the body's origin as the sensor reads it, (n, 6): moved to the sensor, turned if it stays level.

    M_s = M − r_s × F, r_s = `sensor_position_m` in body axes.
    """
    wrench = np.zeros((motion.size, 6))
    if moment is not None:
        wrench[:, 3:] = moment
    if force is not None:
        wrench[:, :3] = force
        # r × F of the three unit forces: many times faster than a cross product at each instant.
        wrench[:, 3:] -= force @ np.cross(vehicle.sensor_position_m, np.eye(3))
    level = vehicle.sensor_mount == "level" and motion.rotation is not None
    return turned(motion.rotation, wrench) if level else wrench


def weight(motion: Motion, vehicle: Vehicle, arm_m: np.ndarray | None = None) -> np.ndarray:
    """Reading of the vehicle's weight acting at `arm_m` (body axes, default the origin), (n, 6)."""
    down = np.array([0.0, 0.0, vehicle.mass_kg * vehicle.gravity_m_s2])
    if motion.rotation is None:
        force = np.broadcast_to(down, (motion.size, 3))
    else:
        force = turned(np.swapaxes(motion.rotation, 1, 2), down)
    arm = np.zeros(3) if arm_m is None else np.asarray(arm_m, float)
    return at_sensor(force, np.cross(arm, force), motion, vehicle)


def bracketed(unit: str) -> str:
    """A unit as it stands below a stroke: a product in brackets."""
    return f"({unit})" if " " in unit else unit


def one_per_channel(name: str, unit: str, channels: tuple[int, ...], **limits) -> tuple[Parameter, ...]:
    """A parameter for each channel, `name_Fx` …; `unit` takes the channel's unit in place of `{}`."""
    return tuple(Parameter(f"{name}_{AXES[c]}", unit.format(UNITS[c]), **limits) for c in channels)


def on_channels(
    name: str,
    equation: str,
    symbol: str,
    unit: str,
    channels: tuple[int, ...],
    signal: Callable[[Loading], np.ndarray],
    **limits,
) -> Form:
    """A form that adds the same signal (n,), or its own column of (n, 6), to each channel with its own coefficient."""

    def contribution(loading: Loading, vehicle: Vehicle, values) -> Contribution:
        s = signal(loading)
        reading = np.zeros((loading.size, 6))
        for c, value in zip(channels, values, strict=True):
            reading[:, c] = value * (s if s.ndim == 1 else s[:, c])
        return Contribution(reading=reading)

    return Form(name, equation, one_per_channel(symbol, unit, channels, **limits), contribution)


def cross_channels(pairs: tuple[tuple[int, int], ...], signal: Callable[[Loading], np.ndarray]):
    """Contribution of signal[:, source] with its own coefficient on each target, for pairs (target, source)."""

    def contribution(loading: Loading, vehicle: Vehicle, values) -> Contribution:
        gains = np.zeros((6, 6))
        for (target, source), value in zip(pairs, values, strict=True):
            gains[source, target] += value
        return Contribution(reading=signal(loading) @ gains)

    return contribution


def forms_of(effect: Effect, instrument: InstrumentFacts) -> tuple[Form, ...]:
    """Forms of an effect on an instrument; those for a flight hold on a stand, not on a bench."""
    if effect.reading_forms is not None:
        return tuple(replace(form, on_loading=True) for form in effect.reading_forms(instrument))
    return () if instrument.bench else effect.forms(instrument.vehicle)


def on_stand(form: Form) -> Form:
    """A form for a flight as it acts on a stand: through the motion of the `Loading`."""
    return replace(form, contribution=lambda loading, own, values: form.contribution(loading.motion, own, values))


def unsmoothed(load: np.ndarray) -> np.ndarray:
    """Samples (n, k) between which straight lines do not smooth: a twelfth of the second difference taken off.

    Straight lines between samples damp a frequency f by sinc²(f Δt) ≈ 1 − (ω Δt)²/12. Where the frequency is that of
    a ring or a cutoff, its damping would be read off too small.
    """
    out = np.array(load, float)
    out[1:-1] -= np.diff(load, 2, axis=0) / 12.0
    return out


def between_samples(values, steps):
    """Even samples (n, k) at places `steps` (n,) counted from the first; ends held.

    Cubic through the four neighbours (Lagrange): a straight line between samples would smooth what moves fast, and
    by another amount at each place between two samples.
    """
    if len(values) < 4:
        return np.stack([np.interp(steps, np.arange(len(values)), column) for column in values.T], axis=1)
    return _between_samples(values, np.asarray(steps, float))


@compiled()
def _between_samples(values, steps):
    out = np.empty((len(steps), values.shape[1]))
    for n in range(len(steps)):
        step = min(max(steps[n], 0.0), len(values) - 1.0)
        first = min(max(int(step) - 1, 0), len(values) - 4)
        a, b, c, d = weights_of_four(step - first)
        for k in range(values.shape[1]):
            own = values[first : first + 4, k]
            out[n, k] = a * own[0] + b * own[1] + c * own[2] + d * own[3]
    return out


@compiled()
def weights_of_four(place):
    """Lagrange's weights of samples 0, 1, 2 and 3 at a place among them."""
    x = place
    return (
        -(x - 1) * (x - 2) * (x - 3) / 6,
        x * (x - 2) * (x - 3) / 2,
        -x * (x - 1) * (x - 3) / 2,
        x * (x - 1) * (x - 2) / 6,
    )


def change_of_load(loading: Loading) -> np.ndarray:
    """Load less what rested on the sensor before, (n, 6)."""
    return loading.load - loading.rest


def since_the_first(loading: Loading) -> np.ndarray:
    """Load less the first, (n, 6): what is over within seconds has settled on that."""
    return loading.load - loading.load[0]
