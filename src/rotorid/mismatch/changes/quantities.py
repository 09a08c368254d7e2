"""What a flight shows before any cause is sought: trims, shares of the rotors, slopes, noise; piece by piece.

No quantity needs a vehicle that is believed right: forces are over the weight, moments over what the rotors give, and
thrust over the thrust that is felt. What a proposed coefficient is wrong by is the same in all flights, and cancels.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rotorid.effects.scale import hover_inflow_m_s
from rotorid.mismatch.evidence.motion import (
    HIGHEST_CUTOFF_HZ,
    Segment,
    analysis_rate_hz,
    build_segments,
    fresh_samples,
    full_speed,
)
from rotorid.mismatch.evidence.rows import Thinner, residual
from rotorid.recordings import RecordingSet, Run, Vehicle
from rotorid.recordings import columns as c

VELOCITY = ("u", "v", "w")
CONDITIONS = (*VELOCITY, "p", "q", "r", "a_x", "a_y", "load", "voltage", "turned_p", "turned_q", "turned_r")
"""Velocity over the hover's inflow and body rates (rad/s), body axes; specific force along x and y, and the thrust that
is felt less one, over gravity; logarithm of the battery's voltage; body rates by the attitude (rad/s)."""
_AXES = ("x", "y", "z")
_TURNS = ("roll", "pitch", "yaw")
_LEAST_FELT = 0.3
"""Least specific force along the rotors' axis over gravity, and least thrust over its mean, that is divided by."""
BY_VOLTAGE, DOUBT_OF_VOLTAGE = (-2.0, 0.0), 0.5
"""Bounds of the slope of the thrust asked for by the voltage, both logarithms (a motor's thrust goes with the voltage
squared at most), and what it may be wrong by: under load the voltage falls, and a flight alone cannot tell which is
cause."""
_PIECES, _SHORTEST_PIECE_S, _LONGEST_PIECE_S = 8, 1.5, 10.0
"""A run is cut into so many pieces of such a length: what is alike within one counts once."""
SENSORS = {"gyroscope": c.ANGULAR_VELOCITY, "accelerometer": c.SPECIFIC_FORCE}
PART = re.compile(r"_\d+$")
"""End of a run's name by which importers number the stretches of one log."""


@dataclass(frozen=True)
class _Kind:
    """Quantities of one kind: what they are counted in, and at which conditions they are compared."""

    name: str
    unit: str
    at: tuple[str, ...] = ()
    """Conditions at which flights are compared; of a slope what else is in its regression."""
    penalty: float = 0.3
    """Of the ridge by which a mean depends on its conditions, over their variance within runs."""
    logarithm: bool = False
    """Whether it is one: differences are relative."""
    other: tuple[str, ...] = ()
    """The conditions of a slope by another sensor, whose noise is in no response with the same sign."""
    moves: bool = False
    """Whether it is a force, and what is left of it moves the vehicle: the velocity follows."""


KINDS = {
    k.name: k
    for k in (
        _Kind("share", "of its own mean share", VELOCITY, 3.0),
        _Kind("trim", "of the thrust times the arm", VELOCITY, 3.0),
        _Kind("yaw_trim", "of the torque of all rotors", VELOCITY, 3.0),
        _Kind("sideways", "of the weight", (*VELOCITY, "load"), 0.1, moves=True),
        _Kind("lift", "", VELOCITY, 1.0, logarithm=True),
        _Kind("lift_of_throttle", "", ("voltage", "load"), 0.1, logarithm=True),
        _Kind("lift_without_voltage", "", ("load",), 0.1, logarithm=True),
        _Kind("follows", "", logarithm=True),
        _Kind("accelerometer", "g"),
        _Kind("gyroscope", "rad/s", ("p", "q", "r"), 0.1),
        _Kind("gyroscope_scale", "of the rate", ("p", "q", "r"), other=CONDITIONS[-3:]),
        _Kind("gyroscope_turn", "rad", ("p", "q", "r"), other=CONDITIONS[-3:]),
        _Kind("drag", "of the weight per hover's inflow", VELOCITY, moves=True),
        _Kind("noise", "", logarithm=True),
    )
}

_TURNED = {"x": ("y", "z"), "y": ("z", "x"), "z": ("x", "y")}
_RATE = dict(zip(_AXES, "pqr", strict=True))
SLOPES: dict[str, dict[str, tuple[tuple[str, str, float], ...]]] = {
    "gyroscope_scale": {"all": tuple((f"gyroscope/{a}", _RATE[a], 1.0) for a in _AXES)},
    # Of θ in Ω_m = Ω + θ × Ω: the part of the slopes that is not symmetric.
    "gyroscope_turn": {
        a: ((f"gyroscope/{j}", _RATE[i], 0.5), (f"gyroscope/{i}", _RATE[j], -0.5)) for a, (i, j) in _TURNED.items()
    },
    "drag": {a: ((f"sideways/{a}", by, 1.0),) for a, by in zip(_AXES[:2], "uv", strict=True)},
}
"""Of each kind of slope, by member: of which response, by which condition, with which sign. Body rates' own moments
(L_p, M_q) are none: a closed loop feigns them. What it can feign of these is taken off before they count."""


@dataclass(frozen=True)
class Quantity:
    """One number of a flight."""

    kind: str
    member: str
    """`3` of rotor 3, `x`, `roll`, or the sensor."""

    @property
    def key(self) -> str:
        """`share/3`."""
        return f"{self.kind}/{self.member}"


@dataclass(frozen=True)
class Flown:
    """What one run shows, by its pieces."""

    run: str
    rows: np.ndarray
    """(P,) rows of each piece."""
    x: np.ndarray
    """(P, 13) mean CONDITIONS; NaN of those that are not recorded."""
    gram: np.ndarray
    """(P, 13, 13) products of the conditions about their means in the run; 0 of those that are not recorded."""
    y: Mapping[str, np.ndarray]
    """Key of a mean quantity, or of what a slope is of, to its mean in each piece, (P,)."""
    cross: Mapping[str, np.ndarray]
    """The same to its products with the conditions, (P, 13), both about their means in the run."""
    feigned: Mapping[str, np.ndarray]
    """Key of a force to what it can feign by each velocity, and the velocity's squares, (2, 3) (`_feigned`)."""
    noise: Mapping[str, float]
    """Key of a noise to its logarithm."""


@dataclass(frozen=True)
class Grid:
    """What all runs that are compared are brought to."""

    rate_hz: float
    cutoff_hz: float
    full_speed_rad_s: float | None
    """Of a throttle; the same for all, whoever proposed it."""
    speeds: bool
    """Whether every run has measured rotor speeds."""
    commands: bool
    """Whether every run has commands or a throttle."""
    throttle: bool
    """Whether those are a throttle."""

    def like(self, other: Grid) -> bool:
        """Whether the same is known of the rotors."""
        return (self.speeds, self.commands, self.throttle) == (other.speeds, other.commands, other.throttle)


def grid_of(sets: Sequence[RecordingSet]) -> Grid:
    """The grid of all runs of some sets of one vehicle; what not every run has is used of none."""
    runs, vehicle = tuple(run for own in sets for run in own.runs), sets[0].vehicle
    names = {k: c.rotor_columns(k, vehicle.rotor_count) for k in ("rotor_speed", "rotor_command", "throttle")}
    has = {k: bool(own) and all(run.has(*own) for run in runs) for k, own in names.items()}
    rate_hz, cutoff_hz = analysis_rate_hz(runs, vehicle, HIGHEST_CUTOFF_HZ)
    return Grid(
        rate_hz=rate_hz,
        cutoff_hz=cutoff_hz,
        full_speed_rad_s=full_speed(sets[0].runs, vehicle) if has["throttle"] else None,
        speeds=has["rotor_speed"],
        commands=has["rotor_command"] or has["throttle"],
        throttle=has["throttle"] and not has["rotor_command"],
    )


def flown(run: Run, vehicle: Vehicle, grid: Grid) -> Flown | None:
    """What a run shows; None where it has no stretch that is long enough."""
    segments = build_segments(run, vehicle, grid.rate_hz, grid.cutoff_hz, full_speed_rad_s=grid.full_speed_rad_s)
    thin = Thinner(grid.rate_hz, grid.cutoff_hz)
    parts = [_rows(s, vehicle, thin, grid) for s in segments if s.motion.size > 2 * len(thin.kernel)]
    if not parts:
        return None
    time_s = np.concatenate([part[0] for part in parts])
    x = np.concatenate([part[1] for part in parts])
    y = {k: np.concatenate([part[2][k] for part in parts]) for k in parts[0][2]}
    length_s = np.clip(len(time_s) / thin.rate_hz / _PIECES, _SHORTEST_PIECE_S, _LONGEST_PIECE_S)
    count = max(2, round(len(time_s) / thin.rate_hz / length_s))
    cuts = [np.arange(k * len(time_s) // count, (k + 1) * len(time_s) // count) for k in range(count)]
    cuts = [cut for cut in cuts if len(cut)]
    about = np.nan_to_num(x - x.mean(axis=0))
    return Flown(
        run=run.name,
        rows=np.array([len(cut) for cut in cuts]),
        x=np.array([x[cut].mean(axis=0) for cut in cuts]),
        gram=np.array([about[cut].T @ about[cut] for cut in cuts]),
        y={k: np.array([v[cut].mean() for cut in cuts]) for k, v in y.items()},
        cross={k: np.array([(v[cut] - v.mean()) @ about[cut] for cut in cuts]) for k, v in y.items()},
        feigned={k: _feigned(v - v.mean(), about[:, :3]) for k, v in y.items() if KINDS[k.split("/")[0]].moves},
        noise=_noise(run, vehicle, grid),
    )


def _feigned(force: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """The most that a force (n,) has in common with each velocity (n, 3) that it moves, over the velocity's squares.

    All that a regression leaves of the force, at the velocity's own frequencies, in phase with it: (2, 3).
    """
    slope = np.linalg.lstsq(velocity, force, rcond=None)[0]
    left, moved = np.abs(np.fft.rfft(force - velocity @ slope)), np.abs(np.fft.rfft(velocity, axis=0))
    return np.stack([left @ moved, np.sum(moved**2, axis=0)])


def _rows(segment: Segment, vehicle: Vehicle, thin: Thinner, grid: Grid):
    """Times, conditions (n, 13) and responses of a stretch, thinned."""
    motion, time_s = segment.motion, thin.times(segment.motion.time_s)
    x, y = np.full((len(time_s), len(CONDITIONS)), np.nan), {}
    if motion.velocity is not None:
        x[:, :3] = thin(motion.velocity) / hover_inflow_m_s(vehicle)
    if motion.angular_velocity is not None:
        x[:, 3:6] = thin(motion.angular_velocity)
    if motion.specific_force is not None:
        felt = thin(motion.specific_force) / vehicle.gravity_m_s2
        x[:, 6:8], x[:, 8] = felt[:, :2], -felt[:, 2] - 1.0
    if motion.voltage is not None:
        x[:, 9] = _log(thin(motion.voltage))
    asked = segment.command if grid.commands else motion.rotor_speed
    turned = motion.rotor_speed if grid.speeds else asked
    groups = residual(replace(segment, motion=replace(motion, rotor_speed=turned)), vehicle)
    if turned is not None:
        y = _of_rotors(asked, turned, groups, x[:, CONDITIONS.index("load")], vehicle, thin, grid)
    for name, unit in (("accelerometer", vehicle.gravity_m_s2), ("gyroscope", 1.0)):
        if name in groups:
            y |= {f"{name}/{a}": column / unit for a, column in zip(_AXES, thin(groups[name]).T, strict=True)}
    if "gyroscope" in groups:
        x[:, -3:] = x[:, 3:6] - thin(groups["gyroscope"])
    lift = "lift"
    if grid.throttle and not grid.speeds:
        # A throttle gives less thrust as the battery empties; a speed does not.
        lift = "lift_without_voltage" if motion.voltage is None else "lift_of_throttle"
    return time_s, x, {k.replace("lift/", f"{lift}/"): v for k, v in y.items()}


def _of_rotors(asked, turned, groups, load, vehicle: Vehicle, thin: Thinner, grid: Grid) -> dict[str, np.ndarray]:
    """Responses that the rotors' speeds are part of: speeds `asked` for and `turned`, (n, k), rad/s; `load` (m,)."""
    coefficient, weight = vehicle.thrust_coefficients_n_s2(), vehicle.mass_kg * vehicle.gravity_m_s2
    wanted, given = (thin(coefficient * w**2) for w in (asked, turned))
    thrust, y = _not_idle(given.sum(axis=1)), {}
    if len(coefficient) > 1:
        shares = wanted / _not_idle(wanted.mean(axis=1))[:, None] - 1.0
        y |= {f"share/{i + 1}": share for i, share in enumerate(shares.T)}
    if grid.speeds and grid.commands:
        pairs = zip(thin(turned).T, thin(asked).T, strict=True)
        y |= {f"follows/{i + 1}": _log(_not_idle(a)) - _log(_not_idle(b)) for i, (a, b) in enumerate(pairs)}
    if "force" in groups:
        force = thin(groups["force"]) / weight
        y |= {f"sideways/{a}": force[:, k] for k, a in enumerate(_AXES[:2])}
        y["lift/all"] = _log(thrust / weight) - _log(np.maximum(1.0 + load, _LEAST_FELT))
    if "moment" in groups:
        # The longest arm, and the rotors' mean torque over their thrust, m.
        arm = float(np.linalg.norm(vehicle.rotor_positions_m()[:, :2], axis=1).max()) or 1.0
        torque = float(vehicle.torque_coefficients_n_m_s2().sum() / vehicle.thrust_coefficients_n_s2().sum())
        turning = thin(groups["moment"]) / thrust[:, None]
        y |= {f"trim/{name}": turning[:, k] / arm for k, name in enumerate(_TURNS[:2])}
        if torque:
            y["yaw_trim/yaw"] = turning[:, 2] / torque
    return y


def _not_idle(values: np.ndarray) -> np.ndarray:
    """A thrust or speed (n,), at least a part of its mean: what is divided by it is of no use where rotors idle."""
    return np.maximum(values, _LEAST_FELT * max(float(values.mean()), 1e-9))


def _log(values: np.ndarray) -> np.ndarray:
    return np.log(np.maximum(values, 1e-9))


def _noise(run: Run, vehicle: Vehicle, grid: Grid) -> dict[str, float]:
    """Logarithms of the white noise of each sensor and of each rotor's measured speed.

    By third differences, which slow motion leaves no trace in, in the quieter quarter of the run's pieces.
    """
    names = {k: own for k, own in SENSORS.items() if run.has(*own)}
    if grid.speeds:
        columns = c.rotor_columns("rotor_speed", vehicle.rotor_count)
        names |= {f"rotor {i + 1}": (name,) for i, name in enumerate(columns)}
    out = {}
    for name, own in names.items():
        values = run.array(own)
        third = np.diff(values[fresh_samples(values)], n=3, axis=0) ** 2
        if len(third) < 8 * _PIECES:
            continue
        size = np.quantile([part.mean() for part in np.array_split(third, 4 * _PIECES)], 0.25)
        if size > 0:
            out[f"noise/{name}"] = 0.5 * float(np.log(size / 20.0))
    return out
