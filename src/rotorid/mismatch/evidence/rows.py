"""Rows of the joint regression: residual channels of a flight or an instrument, and what every candidate would add.

Channels (each (n, 3)): `force` N and `moment` N m by inverse dynamics, `accelerometer` m/s2 (reading against
position or velocity) and `gyroscope` rad/s (reading against attitude), where the recording has both sources.
Both sides pass the same low-pass and are then thinned, so that the equation stays exact.

An error of a sensor is estimated by the comparison with another sensor, where there is one.

The balance of forces and moments holds it, too, but only as far as the model of them is right. A moment that nobody
modelled, which the controller answers, asks for a gyroscope that reads half of what it does; a cable that pulls at the
tail turns the vehicle and pulls it sideways, as a lever arm of the accelerometer would.

What a model adds to the channels, less what is only the sensors' noise come in through its regressors.

A true model with a noisy tachometer as its input may leave more than no model at all: the acceleration of rotors that
turn evenly is all noise. The noise added once more shows how much of a contribution is noise at each frequency; the
best that can be said of the contribution itself is what Wiener's filter passes. Where noise is a small part of it the
contribution stands as it is.

What a form adds to the reading of a stand's or bench's instrument.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import fftconvolve, upfirdn, welch

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import Contribution, Form, Motion
from rotorid.effects.loading import Loading, at_sensor
from rotorid.effects.pendulum import moved
from rotorid.mismatch.evidence.motion import Segment
from rotorid.recordings import Vehicle
from rotorid.recordings.signal import kernels

_COMPARISONS = range(6, 12)
"""Channels in which two sensors are compared: accelerometer and velocity, gyroscope and attitude."""
Block = dict[str, np.ndarray]
"""What a column adds to each channel group, (n, 3)."""
GROUPS = ("force", "moment", "accelerometer", "gyroscope")
CHANNELS = tuple(f"{g}_{a}" for g in GROUPS for a in "xyz")
PARAMETER_NAMES = {
    "thrust": "thrust_coefficient_n_s2",
    "torque": "torque_coefficient_n_m_s2",
    "mass": "mass_kg",
    "lifted": "mass_kg",
    "inertia_xx": "inertia_xx_kg_m2",
    "inertia_yy": "inertia_yy_kg_m2",
    "inertia_zz": "inertia_zz_kg_m2",
    "arm": "arm_scale",
    "speed": "rotor_speed_limits_rad_s",
}
"""Keys of believed values to their contract names. `lifted` is the mass where commands alone say how fast rotors turn:
their thrust is then what lifts the believed mass, and a heavier vehicle has larger moments of the rotors."""

UNKNOWNS_OF_A_STATE = 4
"""Of what swings, where a piece of a run begins: two angles and two rates."""


@dataclass(frozen=True)
class Term:
    """A block of columns that enters or leaves the model together."""

    key: str
    """Unique: `id/form` for an effect, a name of `PARAMETER_NAMES`, or `offset:…` for a nuisance."""
    kind: str
    """`effect`, `value` (a believed number), `held` (one that stays as believed until it is called wrong), `nuisance`,
    `wind`, or, for intervals alone, `slope` and `state`."""
    effect: str = ""
    form: Form | None = None
    values: tuple[float, ...] = ()
    """Current values of a form's parameters (nonlinear ones matter for its columns)."""
    size: int = 1
    prior_sd: tuple[float, ...] = (np.inf,)
    run: str = ""
    """Only run that the term acts in; empty for all."""
    window: tuple[str, float, float] | None = None
    """(run, start_s, stop_s) of an effect in part of the flight."""
    slope_of: int | None = None
    """For the slope of a nonlinear parameter its index in the form, for that of a state its number, 0 to 3."""

    @property
    def once(self) -> str:
        """What can be in a model only once: an effect in one of its forms, or what acts in one window of one run."""
        return self.key if self.run else self.effect


def winds_last(terms: Iterable[Term]) -> list[Term]:
    """Terms with the winds of single runs after all others, where `Regression.without_winds` expects them."""
    return sorted(terms, key=lambda t: t.kind == "wind" and bool(t.run))


def baseline_wrench(motion: Motion, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Thrust force, thrust moment and reaction torque of the believed rotors, each (n, 3), N and N m."""
    squared = motion.rotor_speed**2
    thrust = vehicle.thrust_coefficients_n_s2() * squared
    positions = vehicle.rotor_positions_m()
    force = np.zeros((motion.size, 3))
    force[:, 2] = -thrust @ np.ones(len(positions))
    arm = np.zeros_like(force)
    # r × (0, 0, -T) = (-y T, x T, 0)
    arm[:, 0] = -thrust @ positions[:, 1]
    arm[:, 1] = thrust @ positions[:, 0]
    torque = np.zeros_like(force)
    torque[:, 2] = squared @ (vehicle.torque_coefficients_n_m_s2() * vehicle.yaw_signs())
    return force, arm, torque


def residual(segment: Segment, vehicle: Vehicle) -> dict[str, np.ndarray]:
    """Measured minus baseline for every channel group the segment has, native rate, each (n, 3)."""
    motion, out = segment.motion, {}
    if motion.rotor_speed is not None:
        force, arm, torque = baseline_wrench(motion, vehicle)
        if motion.specific_force is not None:
            out["force"] = vehicle.mass_kg * at_centre(segment, vehicle) - force
        if motion.angular_acceleration is not None:
            inertia = vehicle.inertia_kg_m2.matrix()
            rate = motion.angular_velocity
            out["moment"] = motion.angular_acceleration @ inertia + np.cross(rate, rate @ inertia) - arm - torque
    if segment.kinematic_specific_force is not None:
        out["accelerometer"] = at_centre(segment, vehicle) - segment.kinematic_specific_force
    if segment.kinematic_angular_velocity is not None:
        out["gyroscope"] = motion.angular_velocity - segment.kinematic_angular_velocity
    return out


def at_centre(segment: Segment, vehicle: Vehicle) -> np.ndarray:
    """Specific force at the believed centre of mass, (n, 3), m/s2: the accelerometer's lever arm removed."""
    motion = segment.motion
    arm = np.array(vehicle.accelerometer_position_m)
    if segment.force_source != "accelerometer" or not arm.any() or motion.angular_acceleration is None:
        return motion.specific_force
    rate = motion.angular_velocity
    return (
        motion.specific_force
        - np.cross(motion.angular_acceleration, arm[None, :])
        - np.cross(rate, np.cross(rate, arm[None, :]))
    )


def project(
    contribution: Contribution, segment: Segment, vehicle: Vehicle, groups: tuple[str, ...]
) -> dict[str, np.ndarray]:
    """What a contribution adds to each channel group's residual, each (n, 3)."""
    out = {}
    reading, turning = contribution.specific_force, contribution.angular_velocity
    if "force" in groups:
        parts = [contribution.force, None if reading is None else vehicle.mass_kg * reading]
        out["force"] = _sum(parts)
    if "moment" in groups:
        parts = [contribution.moment]
        if turning is not None:
            inertia = vehicle.inertia_kg_m2.matrix()
            rate = segment.motion.angular_velocity
            parts.append(np.cross(turning, rate @ inertia) + np.cross(rate, turning @ inertia))
            if contribution.angular_acceleration is not None:
                parts.append(contribution.angular_acceleration @ inertia)
        out["moment"] = _sum(parts)
    if "accelerometer" in groups and segment.independent_velocity:
        out["accelerometer"] = reading
    if "gyroscope" in groups:
        out["gyroscope"] = turning
    return {k: v for k, v in out.items() if v is not None}


def _sum(parts):
    parts = [p for p in parts if p is not None]
    return None if not parts else sum(parts[1:], parts[0])


def form_columns(form: Form, values, segment: Segment, vehicle: Vehicle, groups) -> list[dict[str, np.ndarray]]:
    """Channel contributions of each parameter: unit columns of linear ones, slopes of nonlinear ones.

    A form whose parameters are all nonlinear gives its contribution at `values` as one column of free gain.
    """
    motion = segment.motion
    values = np.asarray(values, float)
    if not form.linear:
        return [project(form.contribution(motion, vehicle, values), segment, vehicle, groups)]
    columns = []
    for index in form.linear:
        unit = values.copy()
        unit[list(form.linear)] = 0.0
        unit[index] = 1.0
        columns.append(project(form.contribution(motion, vehicle, unit), segment, vehicle, groups))
    return columns


def slope_column(term: Term, segment: Segment, vehicle: Vehicle, groups) -> dict[str, np.ndarray]:
    """Derivative of a form's contribution by one nonlinear parameter at the term's values."""
    values = np.asarray(term.values, float)
    step = 1e-3 * max(abs(values[term.slope_of]), 1e-6)
    up, down = values.copy(), values.copy()
    up[term.slope_of] += step
    down[term.slope_of] -= step
    a = project(term.form.contribution(segment.motion, vehicle, up), segment, vehicle, groups)
    b = project(term.form.contribution(segment.motion, vehicle, down), segment, vehicle, groups)
    return {k: (a[k] - b[k]) / (2 * step) for k in a}


def state_terms(segments: Iterable[Segment], term: Term) -> list[Term]:
    """Slopes of a term by what its states may be off, in each piece: they widen the intervals of its numbers."""
    return [
        Term(
            f"slope:{term.key}/{s.run}/{start_s:.3f}/{i}",
            "state",
            term.effect,
            term.form,
            term.values,
            prior_sd=(1.0,),
            run=s.run,
            window=(s.run, float(start_s), float(start_s)),
            slope_of=i,
        )
        for s in segments
        if s.motion.hung is not None
        for start_s in s.motion.hung[:, 0]
        for i in range(UNKNOWNS_OF_A_STATE)
    ]


def state_column(term: Term, segment: Segment, vehicle: Vehicle, groups) -> dict[str, np.ndarray]:
    """Derivative of what swings by one number of the state in which a piece of the stretch begins."""
    motion, values = segment.motion, np.asarray(term.values, float)
    pieces = np.flatnonzero(np.abs(motion.hung[:, 0] - term.window[1]) < 1e-6)
    if not len(pieces):
        return {}
    rate = float(np.sqrt(vehicle.gravity_m_s2 / values[term.form.nonlinear[0]]))
    parts = []
    state_step = 1e-3  # Of a slope by a state, rad.
    for step in (state_step, -state_step):
        hung = motion.hung.copy()
        hung[pieces[0], 1:] = moved(hung[pieces[0], 1:], step * np.eye(UNKNOWNS_OF_A_STATE)[term.slope_of], rate)
        there = replace(motion, hung=hung)
        parts.append(project(term.form.contribution(there, vehicle, values), segment, vehicle, groups))
    return {k: (parts[0][k] - parts[1][k]) / (2 * state_step) for k in parts[0]}


def measured_moment(segment: Segment, vehicle: Vehicle) -> np.ndarray:
    """J dΩ/dt + Ω × J Ω from the measured body rates, (n, 3), N m."""
    inertia, rate = vehicle.inertia_kg_m2.matrix(), segment.motion.angular_velocity
    return segment.motion.angular_acceleration @ inertia + np.cross(rate, rate @ inertia)


def high_passed(angular_acceleration: np.ndarray, rate_hz: float) -> np.ndarray:
    """A predicted angular acceleration (n, k) without its low frequencies.

    Body rates stay bounded: a lasting predicted acceleration is the mark of something left out. (Neither a mean over a
    window, which makes a fifth too much of what turns a little faster than it lasts, nor ends that are held: one wild
    instant would then last.)
    """
    # No vehicle keeps up an angular acceleration for longer: one-sigma of the mean in time that is taken away.
    sustained_s = 6.0
    return angular_acceleration - kernels.gaussian(angular_acceleration, sustained_s * rate_hz)


def value_columns(
    key: str,
    segment: Segment,
    vehicle: Vehicle,
    groups,
    model: dict[str, np.ndarray],
    reverse: np.ndarray | None = None,
    low_frequencies: bool = False,
):
    """Column of a relative change of one believed value, as channel contributions.

    Accelerations on the left side are replaced by what the current model predicts (`model`: force N and moment
    N m, native rate), because a regression on a noisy derivative of the body rate would be biased. `reverse`
    (the measured moment, (n, 3), N m) takes the predicted moments' place for a check from the other side. With
    `low_frequencies` those of a predicted angular acceleration stay (`high_passed`).
    """
    motion = segment.motion
    force, arm, torque = baseline_wrench(motion, vehicle)
    if reverse is not None:
        arm = reverse * np.array([1.0, 1.0, 0.0])
        torque = reverse * np.array([0.0, 0.0, 1.0])
        model = {**model, "moment": reverse}
    out = {}
    if key == "thrust":
        out = {"force": force, "moment": arm}
    elif key == "torque":
        out = {"moment": torque}
    elif key == "lifted":
        out = {"moment": arm + torque}
    elif key == "arm":
        out = {"moment": arm}
    elif key == "mass":
        out = {"force": -model["force"]}
    elif key.startswith("inertia") and "moment" in groups:
        axis = "xyz".index(key[-1])
        inertia = vehicle.inertia_kg_m2.matrix()
        rate = motion.angular_velocity
        predicted = (model["moment"] - np.cross(rate, rate @ inertia)) @ np.linalg.inv(inertia)
        predicted = predicted[:, [axis]] if low_frequencies else high_passed(predicted[:, [axis]], segment.rate_hz)
        part = np.zeros((3, 3))
        part[axis, axis] = inertia[axis, axis]
        out = {"moment": -(predicted * part[axis] + np.cross(rate, rate @ part))}
    return {k: v for k, v in out.items() if k in groups}


def offset_columns(key: str, segment: Segment, vehicle: Vehicle, groups) -> dict[str, np.ndarray]:
    """Column of a nuisance as channel contributions: a time offset of one second between two sensors, or a
    relative change of the thrust in one run."""
    motion = segment.motion
    if key.startswith(RUN_SCALE):
        return value_columns("thrust", segment, vehicle, groups, {})
    if key == "offset:rotors-accelerometer" and "force" in groups:
        force, _, _ = baseline_wrench(motion, vehicle)
        return {"force": np.gradient(force, segment.dt_s, axis=0)}
    if key == "offset:rotors-gyroscope" and "moment" in groups:
        _, arm, torque = baseline_wrench(motion, vehicle)
        return {"moment": np.gradient(arm + torque, segment.dt_s, axis=0)}
    if key == "offset:accelerometer-velocity" and "accelerometer" in groups:
        return {"accelerometer": np.gradient(segment.kinematic_specific_force, segment.dt_s, axis=0)}
    if key == "offset:gyroscope-attitude" and "gyroscope" in groups:
        return {"gyroscope": np.gradient(segment.kinematic_angular_velocity, segment.dt_s, axis=0)}
    return {}


RUN_SCALE = "thrust of "
OFFSETS = (
    "offset:rotors-accelerometer",
    "offset:rotors-gyroscope",
    "offset:accelerometer-velocity",
    "offset:gyroscope-attitude",
)


@dataclass(frozen=True)
class Rows:
    """Filtered and thinned rows of one segment."""

    run: str
    time_s: np.ndarray
    y: np.ndarray
    """Residual of the baseline, (n, 12); NaN columns for channels the set lacks."""
    x: np.ndarray
    """Columns of all terms, (n, 12, K)."""


class Thinner:
    """Low-pass and thinning, the same for everything."""

    def __init__(self, rate_hz: float, cutoff_hz: float):
        self.cutoff_hz = cutoff_hz
        self.kernel = kernels.low_pass(rate_hz, cutoff_hz)
        self.step = max(1, int(np.floor(rate_hz / (2 * cutoff_hz) + 1e-9)))
        self.rate_hz = rate_hz / self.step
        blocks = -(-len(self.kernel) // self.step)
        taps = np.pad(self.kernel[::-1], (0, blocks * self.step - len(self.kernel)))
        self._taps = np.ascontiguousarray(taps.reshape(blocks, self.step).T)

    def __call__(self, signal: np.ndarray) -> np.ndarray:
        """(n, …) at the native rate to (m, …) at the thinned rate; only fully covered samples."""
        # upfirdn's sample j·step is the kernel's last tap at input j·step; the uncovered start is skipped.
        skip = -(-(len(self.kernel) - 1) // self.step)
        count = (len(signal) - 1) // self.step + 1 - skip
        by_blocks = 4  # Thinning from which blocks of samples are multiplied as matrices.
        # A reading that is missing must not reach its neighbours, which share a product with it.
        if self.step < by_blocks or count < 1 or not np.isfinite(signal).all():
            return upfirdn(self.kernel, signal, up=1, down=self.step, axis=0)[skip : skip + max(count, 0)]
        start, columns = skip * self.step - len(self.kernel) + 1, signal.reshape(len(signal), -1)
        return self._by_blocks(columns[start:], count).T.reshape(count, *signal.shape[1:])

    def _by_blocks(self, signal: np.ndarray, count: int) -> np.ndarray:
        """Weighted sums (c, count) of a signal (n, c) from every `step`-th sample on, the kernel's taps the weights.

        Blocks of `step` samples by the kernel's own blocks are one product of matrices, many times as quick as taps.
        """
        blocks = self._taps.shape[1]
        whole = np.zeros((signal.shape[1], (count - 1 + blocks) * self.step))
        reach = min(len(signal), whole.shape[1])
        whole[:, :reach] = signal[:reach].T
        products = whole.reshape(len(whole), -1, self.step) @ self._taps
        return sum(products[:, b : b + count, b] for b in range(blocks))

    def times(self, time_s: np.ndarray) -> np.ndarray:
        """Time stamps of the thinned samples (centre of the kernel)."""
        half = (len(self.kernel) - 1) // 2
        skip = int(np.ceil(2 * half / self.step))
        index = np.arange(skip, (len(time_s) - 1) // self.step + 1) * self.step - half
        return time_s[index]


def assemble(
    segment: Segment,
    vehicle: Vehicle,
    thinner: Thinner,
    columns: Sequence[Block],
    known: Block | None = None,
) -> Rows:
    """Rows of one segment with thinned columns; `known` (native rate) is in the model already and is subtracted."""
    groups = residual(segment, vehicle)
    for name, part in (known or {}).items():
        groups[name] = groups[name] - part
    time_s = thinner.times(segment.motion.time_s)
    y, x = np.full((len(time_s), 12), np.nan), np.zeros((len(time_s), 12, len(columns)))
    for index, group in enumerate(GROUPS):
        if group not in groups:
            continue
        own = slice(3 * index, 3 * index + 3)
        y[:, own] = thinner(groups[group])
        of_group = np.zeros((3, len(columns), len(time_s)))  # time last: a column is written in one go
        for k, block in enumerate(columns):
            if group in block:
                of_group[:, k] = block[group].T
        x[:, own] = of_group.transpose(2, 0, 1)
    return Rows(segment.run, time_s, y, x)


def compared_alone(terms: Sequence[Term], rows: Sequence[Rows]) -> tuple[list[int], list[str]]:
    """Channels in which two sensors are compared, and keys of the errors of a sensor that act in them."""
    channels = [c for c in _COMPARISONS if np.isfinite(rows[0].y[:, c]).all()]
    sensors = {i for i, effect in catalogue().items() if effect.kind == "sensor"}
    start, keys = 0, []
    for term in terms:
        own = slice(start, start + term.size)
        if term.kind == "effect" and term.effect in sensors and any(r.x[:, channels, own].any() for r in rows):
            keys.append(term.key)
        start += term.size
    return channels, keys


@dataclass(frozen=True)
class Contributions:
    """Rows of every stretch, and the same with the sensors' noise added once more (None where that is not known)."""

    rows: list[Rows]
    noisy: list[Rows] | None = None
    rate_hz: float = 1.0

    def of(self, columns: np.ndarray, beta: np.ndarray) -> list[np.ndarray]:
        """What coefficients `beta` (k,) of some columns add to the channels of each stretch, (n, 12)."""
        # All columns in one product: to pick some out of an array of gigabytes costs several times as much.
        whole = np.zeros(self.rows[0].x.shape[2])
        whole[columns] = beta
        return self._less_noise(lambda rows: [_product(r.x, whole) for r in rows])

    def left_out(self, columns: np.ndarray, betas: np.ndarray, fold: list[np.ndarray]) -> list[np.ndarray]:
        """The same where every row has the coefficients that were fitted without its fold.

        `betas` (folds, k); `fold` holds the fold of every row of each stretch, (n,), -1 for a row of none, of which
        nothing is said (zero).
        """

        def made(rows: list[Rows]) -> list[np.ndarray]:
            out = [np.zeros_like(r.y) for r in rows]
            for part, r, own in zip(out, rows, fold, strict=True):
                for number, beta in enumerate(betas):
                    where = np.flatnonzero(own == number)
                    part[where] = r.x[where][:, :, columns] @ beta
            return out

        return self._less_noise(made)

    def _less_noise(self, made: Callable[[list[Rows]], list[np.ndarray]]) -> list[np.ndarray]:
        """Contributions (n, 12) made of rows, through Wiener's filter where much of them is noise."""
        parts = made(self.rows)
        if self.noisy is None:
            return parts
        noise = [again - p for again, p in zip(made(self.noisy), parts, strict=True)]
        for run in dict.fromkeys(r.run for r in self.rows):
            own = [k for k, r in enumerate(self.rows) if r.run == run]
            for c in range(parts[0].shape[1]):
                cleared = self.cleared([parts[k][:, c] for k in own], [noise[k][:, c] for k in own])
                for k, part in zip(own, cleared, strict=True):
                    parts[k][:, c] = part
        return parts

    def cleared(self, parts: list[np.ndarray], noise: list[np.ndarray]) -> list[np.ndarray]:
        """Contributions (n,) to one channel of one run, through Wiener's filter if much of them is noise."""
        whole, own = sum(float(p @ p) for p in parts), sum(float(n @ n) for n in noise)
        # Share of a contribution's energy in a channel of a run that must be noise before it is filtered.
        least_noise = 0.1
        if own <= least_noise * whole:
            return parts
        shortest = 16  # Rows that a stretch must have to be filtered; in a shorter one the contribution stands.
        long = [k for k, p in enumerate(parts) if len(p) >= shortest]
        if not long:
            return parts
        piece_s = 4.0  # Length of the pieces that spectra are averaged over, and of the filter.
        size = min(int(piece_s * self.rate_hz), max(len(parts[k]) for k in long)) // 2 * 2
        long = [k for k in long if len(parts[k]) >= size // 2]
        power, of_noise = (_spectrum([x[k] for k in long], size) for x in (parts, noise))
        passed = np.clip(1.0 - of_noise / np.maximum(power, 1e-300), 0.0, 1.0)
        taps = np.fft.fftshift(np.fft.irfft(passed, size))
        taps = np.append(taps, taps[0]) * np.hanning(size + 3)[1:-1]
        half = size // 2
        return [fftconvolve(np.pad(p, half, mode="reflect"), taps, mode="valid") if len(p) > half else p for p in parts]


def _product(x: np.ndarray, beta: np.ndarray) -> np.ndarray:
    """x @ beta, (n, 12)."""
    return (x.reshape(-1, x.shape[2]) @ beta).reshape(x.shape[:2])


def _spectrum(parts: list[np.ndarray], size: int) -> np.ndarray:
    """Power spectrum of stretches in pieces of `size`, weighed by their lengths, (size / 2 + 1,)."""
    total = sum(len(p) for p in parts)
    padded = [p if len(p) >= size else np.pad(p, (0, size - len(p))) for p in parts]
    return sum(len(p) / total * welch(q, nperseg=size, detrend=False)[1] for p, q in zip(parts, padded, strict=True))


def _reading_of(added: Contribution, loading: Loading, vehicle: Vehicle) -> np.ndarray:
    """What a contribution adds to the reading, (n, 6)."""
    if added.reading is not None:
        return added.reading
    return at_sensor(added.force, added.moment, loading.motion, vehicle)


def _contribution_of(form: Form, values, loading: Loading, vehicle: Vehicle) -> Contribution:
    """What a form adds at parameter values; forms for a flight act through the motion."""
    return form.contribution(loading if form.on_loading else loading.motion, vehicle, np.asarray(values, float))


def form_reading(form: Form, values, loading: Loading, vehicle: Vehicle) -> np.ndarray:
    """Reading that a form adds at parameter values, (n, 6)."""
    return _reading_of(_contribution_of(form, values, loading, vehicle), loading, vehicle)


def forms_reading(acting: Iterable, loading: Loading, vehicle: Vehicle) -> np.ndarray:
    """Reading that all (form, values) add, (n, 6): wrenches on the body are summed before they are read."""
    added = [_contribution_of(form, values, loading, vehicle) for form, values in acting]
    on_body = [
        sum(parts) if (parts := [part for a in added if (part := getattr(a, kind)) is not None]) else None
        for kind in ("force", "moment")
    ]
    return sum((a.reading for a in added if a.reading is not None), at_sensor(*on_body, loading.motion, vehicle))


def form_terms(effect_id: str, form: Form, suggested: tuple[tuple[float, ...], ...] = ()) -> list[Term]:
    """One term per starting point of a form's nonlinear parameters: those `suggested`, or else the form's own."""
    starts = list(suggested) or [()]
    for index in () if suggested else form.nonlinear:
        starts = [s + (v,) for s in starts for v in form.parameters[index].starts]
    terms = []
    for number, start in enumerate(starts):
        values = np.zeros(len(form.parameters))
        values[list(form.nonlinear)] = start
        suffix = f"#{number}" if len(starts) > 1 else ""
        terms.append(
            Term(
                f"{effect_id}/{form.name}{suffix}",
                "effect",
                effect_id,
                form,
                tuple(values),
                max(1, len(form.linear)),
                (np.inf,) * max(1, len(form.linear)),
            )
        )
    return terms
