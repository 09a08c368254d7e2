"""A candidate flown: what the controller leaves of the reference, and what the set's sensors would record of it.

The vehicle follows the reference as a cascade does: a position loop with the reference's velocity and acceleration fed
forward, around an attitude loop of the stated bandwidth, around rotors and filters five times as fast. The attitude
loop's lag leaves the position loop a resonance, so that motions near its bandwidth come out larger than asked and fast
ones smaller. For that motion the forces and moments are known, and the rotor
speeds that make them, with the effects of the competing model at work, follow by solving its equations for them: the
controller finds them by feedback in the same way. Commands are what the chain between command and speed needs for these
speeds. Sensors read the truth here: their noise enters where the comparison is predicted.

After a step by hand (two propellers swapped, or a known mass attached at a known place) what a set left open stays in
the vehicle, so the columns of its terms are those of the same parameters as before: the coefficients of a propeller act
where it now sits, and an offset of the centre of mass moves the common centre of both masses by the vehicle's share of
them. How well the mass and its place are known is a nuisance of that flight alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import combinations

import numpy as np
import pandas as pd
from scipy.signal import bilinear_zpk, butter, sosfilt, sosfiltfilt, zpk2sos
from scipy.spatial.transform import Rotation

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import Form, Motion, SpeedPath
from rotorid.errors import InputError
from rotorid.mismatch.evidence.rows import Term
from rotorid.plan.candidates import Reference
from rotorid.recordings import Run, Vehicle
from rotorid.recordings import columns as c
from rotorid.recordings.vehicle import Inertia, Rotor
from rotorid.vehicle.mixer import allocation_matrix

_DAMPING = 0.8
_FASTER = 5.0
"""Bandwidth of rotors and filters over that of the attitude loop."""
_EDGE = 8
"""Samples by which a flight is longer on both sides while its derivatives are taken."""
OF_PROPELLER = ("unequal_rotors",)
"""Effects whose coefficients, one a rotor, go with the propeller. A tilt stays with the motor's mount."""
OF_CENTRE = "com_offset"
WITH_MASS_OF_ITS_OWN = ("payload",)
"""Effects whose parameters are of a further mass: with a known one attached their columns are not those of before."""
MASS_SHARE = 0.05
"""A mass to attach over the vehicle's."""


@dataclass(frozen=True)
class CompetingModel:
    """A competing model: the vehicle, effects with their values, and what lies between command and rotor speed."""

    vehicle: Vehicle
    effects: tuple[tuple[Form, np.ndarray], ...] = ()
    derivatives: tuple[tuple[Form, np.ndarray], ...] = ()
    """Of what the model leaves: they fly, and separate no model from another."""
    chain: tuple = ()
    """Speed forms with their values, in the order of their stages."""
    full_speed_rad_s: float = 1.0
    scale: float = 1.0
    """Rotor speed over the one that the chain makes (`CommandChain.scale`)."""
    voltage_v: float | None = None
    full_voltage_v: float | None = None
    wind_m_s: np.ndarray | None = None


@dataclass(frozen=True)
class SimulatedFlight:
    """A flight as it would be: the motion, the commands (n, k), rad/s, and the reference it came from."""

    motion: Motion
    command_rad_s: np.ndarray
    world_velocity: np.ndarray

    @property
    def tilt_rad(self) -> float:
        """Largest tilt."""
        return float(np.arccos(np.clip(self.motion.rotation[:, 2, 2], -1, 1)).max())

    @property
    def speed_m_s(self) -> float:
        """Largest speed over ground along the level."""
        return float(np.linalg.norm(self.world_velocity[:, :2], axis=1).max())


def low_pass(natural_rad_s: float) -> np.ndarray:
    """Denominator of a second-order low-pass of unit gain, highest power first."""
    return np.array([1.0 / natural_rad_s**2, 2 * _DAMPING / natural_rad_s, 1.0])


def _filtered(signal: np.ndarray, over: np.ndarray, under: np.ndarray, step_s: float) -> np.ndarray:
    """A signal (n, …) through a transfer function `over` / `under` in s, at rest before; second-order sections, as
    poles thousands of times slower than the step lose all digits in one polynomial."""
    zeros, poles = np.roots(over), np.roots(under)
    first = np.trim_zeros(over, "f")[0] / np.trim_zeros(under, "f")[0]
    return sosfilt(zpk2sos(*bilinear_zpk(zeros, poles, first, 1.0 / step_s)), signal, axis=0)


def followed(signal: np.ndarray, natural_rad_s: float, lag: np.ndarray, step_s: float) -> np.ndarray:
    """What a loop leaves of a reference (n, …) whose derivatives are fed forward, starting at rest at its first value.

    The loop asks for the acceleration a_r + 2 ζ ω (v_r - v) + ω² (p_r - p); the vehicle has it a lag later, whose
    denominator is `lag`.
    """
    loop = np.array([2 * _DAMPING * natural_rad_s, natural_rad_s**2])
    asked = np.concatenate([[1.0], loop])
    held = np.polyadd(np.polymul([1.0, 0.0, 0.0], lag), loop)
    return _filtered(signal - signal[:1], asked, held, step_s) + signal[:1]


def _turned(yaw_rad: np.ndarray, natural_rad_s: float, step_s: float) -> np.ndarray:
    """What a yaw loop leaves of a yaw reference (n,), rad, whose rate is fed forward."""
    own, lag = low_pass(natural_rad_s), low_pass(_FASTER * natural_rad_s)
    return _filtered(yaw_rad - yaw_rad[:1], own[1:], np.polymul(own, lag), step_s) + yaw_rad[:1]


def _attitude(thrust_direction: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """Rotations of body vectors into the world (n, 3, 3) with body z along a direction (n, 3) and the nose at a yaw."""
    down = thrust_direction / np.linalg.norm(thrust_direction, axis=1, keepdims=True)
    nose = np.stack([np.cos(yaw), np.sin(yaw), np.zeros(len(yaw))], axis=1)
    right = np.cross(down, nose)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    return np.stack([np.cross(right, down), right, down], axis=2)


def _body_rates(rotation: np.ndarray, step_s: float) -> np.ndarray:
    """Body rates (n, 3), rad/s, of rotations (n, 3, 3) at even instants."""
    turning = np.einsum("nji,njk->nik", rotation, np.gradient(rotation, step_s, axis=0))
    return np.stack([turning[:, 2, 1], turning[:, 0, 2], turning[:, 1, 0]], axis=1)


def fly(
    world: CompetingModel,
    reference: Reference,
    bandwidth_rad_s: float,
    place_m: Sequence[float],
    position_rad_s: float | None = None,
) -> SimulatedFlight:
    """The flight of a reference whose zero lies at `place_m` (north, east, height above ground).

    `bandwidth_rad_s` is of the attitude loop, `position_rad_s` of the position loop (a share of it where not stated).

    Raises InputError: the rotors cannot do it: one would have to turn backwards.
    """
    slower = 0.2  # Bandwidth of the position loop over that of the attitude loop, where its bandwidth is not stated.
    rounds = 6  # Times that rotor speeds and attitude are solved for with the effects at their last values.
    vehicle, step = world.vehicle, float(reference.time_s[1] - reference.time_s[0])
    gravity, reference = np.array([0.0, 0.0, vehicle.gravity_m_s2]), _held_longer(reference, step)
    t = reference.time_s
    ground = vehicle.ground_z_m or 0.0
    start = np.array([place_m[0], place_m[1], ground - place_m[2]])
    outer = slower * bandwidth_rad_s if position_rad_s is None else position_rad_s
    rotors = low_pass(_FASTER * bandwidth_rad_s)
    level = followed(reference.position_m[:, :2], outer, np.polymul(low_pass(bandwidth_rad_s), rotors), step)
    # The height needs no tilt.
    height = followed(reference.position_m[:, 2:], outer, rotors, step)
    position = np.concatenate([level, height], axis=1) + start
    yaw = _turned(reference.yaw_rad, bandwidth_rad_s / 2, step)
    velocity = np.gradient(position, step, axis=0)
    wanted = vehicle.mass_kg * (np.gradient(velocity, step, axis=0) - gravity)
    inertia, allocation = vehicle.inertia_kg_m2.matrix(), allocation_matrix(vehicle)
    force = moment = np.zeros((len(t), 3))
    hover = np.sqrt(vehicle.mass_kg * vehicle.gravity_m_s2 / vehicle.thrust_coefficients_n_s2().sum())
    speed = np.full((len(t), vehicle.rotor_count), hover)
    inner = slice(_EDGE, -_EDGE)
    rotation = _attitude(-wanted, yaw)
    for _ in range(rounds if (*world.effects, *world.derivatives) else 1):
        left = wanted - np.einsum("nij,nj->ni", rotation, force)
        rotation = _attitude(-left, yaw)
        rates = _body_rates(rotation, step)
        turning = np.gradient(rates, step, axis=0)
        asked = turning @ inertia + np.cross(rates, rates @ inertia) - moment
        thrust = np.linalg.norm(left, axis=1)
        square = np.column_stack([thrust, asked]) @ allocation.T
        if not np.isfinite(square).all() or (square[inner] < 0).any():
            raise InputError("the rotors cannot fly this: one would have to turn backwards")
        speed = np.sqrt(np.maximum(square, 0.0))
        motion = Motion(
            time_s=t,
            rotor_speed=speed,
            rotor_acceleration=np.gradient(speed, step, axis=0),
            angular_velocity=rates,
            angular_acceleration=turning,
            specific_force=np.einsum("nji,nj->ni", rotation, wanted) / vehicle.mass_kg,
            rotation=rotation,
            velocity=np.einsum("nji,nj->ni", rotation, velocity),
            wind=world.wind_m_s,
            position=position,
            height=ground - position[:, 2],
            voltage=None if world.voltage_v is None else np.full(len(t), world.voltage_v),
        )
        motion = replace(motion, accelerometer=motion.specific_force, gyroscope=rates)
        force, moment = np.zeros((motion.size, 3)), np.zeros((motion.size, 3))
        for form, values in (*world.effects, *world.derivatives):
            part = form.contribution(motion, world.vehicle, values)
            force = force if part.force is None else force + part.force
            moment = moment if part.moment is None else moment + part.moment
        # The tilt answers a force, and turning into it asks for moments that grow with the square of the frequency:
        # beyond what the rotors follow the rounds would not converge.
        force = sosfiltfilt(butter(2, _FASTER * bandwidth_rad_s * step / np.pi, output="sos"), force, axis=0)
    cut = {f.name: getattr(motion, f.name) for f in fields(motion)}
    cut = {name: v[inner] for name, v in cut.items() if isinstance(v, np.ndarray) and len(v) == len(t)}
    motion = replace(motion, **cut)
    return SimulatedFlight(motion, commands(world, motion), velocity[inner])


def _held_longer(reference: Reference, step_s: float) -> Reference:
    """A reference held EDGE samples longer at both ends: derivatives at an end would be taken from one side."""
    t = np.arange(-_EDGE, len(reference.time_s) + _EDGE) * step_s + reference.time_s[0]
    ends = ((_EDGE, _EDGE), (0, 0))
    return Reference(t, np.pad(reference.position_m, ends, "edge"), np.pad(reference.yaw_rad, _EDGE, "edge"))


def commands(world: CompetingModel, motion: Motion) -> np.ndarray:
    """Commands (n, k), rad/s, that make the rotor speeds of a motion through the model's chain."""
    steps_back = 8  # Rounds of the inversion of what lies between command and speed.
    wanted = command = motion.rotor_speed / world.scale
    if not world.chain:
        return command
    start = SpeedPath(command, motion.time_s, world.full_speed_rad_s, motion.voltage, world.full_voltage_v)
    for _ in range(steps_back):
        path = replace(start, speed=command)
        for form, values in sorted(world.chain, key=lambda pair: pair[0].stage):
            path = replace(path, speed=form.apply(path, values))
        command = command + (wanted - path.speed)
    return command


def recorded(flown: SimulatedFlight, world: CompetingModel, columns: Sequence[str], rate_hz: float, name: str) -> Run:
    """What the set's columns would hold of a flight, without noise; a column that a flight cannot give is left out."""
    motion, k = flown.motion, world.vehicle.rotor_count
    every = max(1, int(round(1.0 / (rate_hz * (motion.time_s[1] - motion.time_s[0])))))
    specific_force, rates = motion.specific_force.copy(), motion.angular_velocity.copy()
    for form, values in world.effects:
        part = form.contribution(motion, world.vehicle, values)
        specific_force += 0.0 if part.specific_force is None else part.specific_force
        rates += 0.0 if part.angular_velocity is None else part.angular_velocity
    arm = np.array(world.vehicle.accelerometer_position_m)
    if arm.any():
        w = motion.angular_velocity
        specific_force += np.cross(motion.angular_acceleration, arm) + np.cross(w, np.cross(w, arm))
    quaternion = Rotation.from_matrix(motion.rotation).as_quat(scalar_first=True)
    given = {
        (c.TIME,): motion.time_s[:, None],
        c.rotor_columns("rotor_speed", k): motion.rotor_speed,
        c.rotor_columns("rotor_command", k): flown.command_rad_s,
        c.rotor_columns("throttle", k): flown.command_rad_s / world.full_speed_rad_s,
        c.POSITION: motion.position,
        c.VELOCITY: flown.world_velocity,
        c.QUATERNION: quaternion,
        c.ANGULAR_VELOCITY: rates,
        c.SPECIFIC_FORCE: specific_force,
        (c.HEIGHT,): motion.height[:, None],
    }
    if motion.voltage is not None:
        given[(c.BATTERY_VOLTAGE,)] = motion.voltage[:, None]
    table = {n: v[::every, i] for names, v in given.items() for i, n in enumerate(names) if n in (*columns, c.TIME)}
    return Run(name, pd.DataFrame(table))


@dataclass(frozen=True)
class ChangedVehicle:
    """A step by hand and the vehicle after it."""

    of: str
    """The effect that the step is there for."""
    words: str
    vehicle: Vehicle
    """As believed after the step; rotors by their place."""
    moved: Mapping[str, Callable[[Form], Form]] = field(default_factory=dict)
    """To an effect its forms after the step, in the parameters of before."""
    shares: Mapping[str, float] = field(default_factory=dict)
    """To a believed value (key of the regression) its relative change after the step over that of before."""
    nuisances: tuple[Term, ...] = ()
    """Terms of the flight after the step alone, with the one-sigma of their coefficients as `prior_sd`."""
    pairs: tuple[tuple[int, int], ...] = ()
    """Places, from 0, whose propellers change places."""
    mass_kg: float = 0.0
    """What is attached, at `place_m` (forward, right, down of the believed centre of mass)."""
    place_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def term(self, term: Term) -> Term:
        """A term of the set as it acts after the step."""
        return replace(term, form=self.moved[term.effect](term.form)) if term.effect in self.moved else term

    def world(self, world: CompetingModel, effect_of: Mapping[int, str]) -> CompetingModel:
        """A competing model after the step; `effect_of` has the effect of every form by the form's `id()`."""
        effects = tuple(
            (self.moved[effect_of[id(f)]](f) if effect_of.get(id(f)) in self.moved else f, values)
            for f, values in world.effects
        )
        return replace(world, vehicle=self.vehicle, effects=effects)


def swaps(vehicle: Vehicle) -> list[ChangedVehicle]:
    """Every swap of two propellers that turn the same way, and of all such pairs at once where there are several."""
    spins = [rotor.spin for rotor in vehicle.rotors]
    alike = [(i, j) for i, j in combinations(range(vehicle.rotor_count), 2) if spins[i] == spins[j]]
    choices = [(pair,) for pair in alike]
    if len(alike) > 1 and len({i for pair in alike for i in pair}) == 2 * len(alike):
        choices.append(tuple(alike))
    return [_swapped(vehicle, pairs) for pairs in choices]


def _swapped(vehicle: Vehicle, pairs: tuple[tuple[int, int], ...]) -> ChangedVehicle:
    order = np.arange(vehicle.rotor_count)
    for i, j in pairs:
        order[[i, j]] = j, i
    names = " and ".join(f"{i + 1} with {j + 1}" for i, j in pairs)
    words = f"swap the propellers of rotor{'s' if len(pairs) > 1 else ''} {names} (they turn the same way)"
    return ChangedVehicle(
        "unequal_rotors",
        words,
        _with_coefficients(vehicle, order),
        {effect: lambda form: _by_propeller(form, order) for effect in OF_PROPELLER},
        pairs=pairs,
    )


def _with_coefficients(vehicle: Vehicle, order: np.ndarray) -> Vehicle:
    """The vehicle whose believed coefficients, where each rotor has its own, are those of the propeller there now."""
    names = ("thrust_coefficient_n_s2", "torque_coefficient_n_m_s2")
    own = {n: getattr(vehicle, n) for n in names if isinstance(getattr(vehicle, n), tuple)}
    return vehicle.model_copy(update={n: tuple(v[k] for k in order) for n, v in own.items()})


def _by_propeller(form: Form, order: np.ndarray) -> Form:
    """A form whose rotors are numbered by their propeller; `order` (k,) is the propeller at each place, and, as pairs
    are swapped, the place of each propeller too."""

    def contribution(motion: Motion, vehicle: Vehicle, values):
        own = {n: getattr(motion, n) for n in ("rotor_speed", "rotor_acceleration")}
        turned = replace(motion, **{n: v[:, order] for n, v in own.items() if v is not None})
        placed = _with_coefficients(vehicle, order).model_copy(
            update={"rotors": tuple(vehicle.rotors[k] for k in order)}
        )
        return form.contribution(turned, placed, values)

    return replace(form, contribution=contribution)


def _attached(vehicle: Vehicle, place_m: tuple[float, float, float], words: str) -> ChangedVehicle:
    """A mass of MASS_SHARE of the vehicle's attached at `place_m` (forward, right, down of the believed centre)."""
    place_sd_m, mass_sd = 0.002, 0.01  # How well the place of an attached mass is known, and its size as a share of it.
    mass, more = vehicle.mass_kg, MASS_SHARE * vehicle.mass_kg
    place = np.array(place_m)
    centre = more / (mass + more) * place
    own = vehicle.inertia_kg_m2.matrix()
    inertia = own + _of_point(mass, centre) + _of_point(more, place - centre)
    rotors = tuple(
        Rotor(x_m=r.x_m - centre[0], y_m=r.y_m - centre[1], z_m=r.z_m - centre[2], spin=r.spin) for r in vehicle.rotors
    )
    moments = {a + b: float(inertia["xyz".index(a), "xyz".index(b)]) for a, b in ("xx", "yy", "zz", "xy", "xz", "yz")}
    after = vehicle.model_copy(
        update={
            "mass_kg": mass + more,
            "rotors": rotors,
            "inertia_kg_m2": Inertia(**moments),
            "accelerometer_position_m": tuple(float(v) for v in np.array(vehicle.accelerometer_position_m) - centre),
        }
    )
    share = mass / (mass + more)

    def smaller(form: Form) -> Form:
        return replace(form, contribution=lambda m, v, values: form.contribution(m, v, share * np.asarray(values)))

    # The mass sits next to where it should, or weighs other than stated: either moves the centre.
    doubt = np.hypot(place_sd_m, mass_sd * np.linalg.norm(place)) * (1.0 - share)
    plane = catalogue()[OF_CENTRE].forms(vehicle)[0]
    nuisance = Term("by hand/place", "effect", "", plane, (0.0, 0.0), 2, (doubt, doubt))
    inertias = {f"inertia_{a}{a}": own[i, i] / inertia[i, i] for i, a in enumerate("xyz")}
    return ChangedVehicle(
        OF_CENTRE, words, after, {OF_CENTRE: smaller}, {"mass": share, **inertias}, (nuisance,), (), more, place_m
    )


def _of_point(mass_kg: float, at_m: np.ndarray) -> np.ndarray:
    """Inertia (3, 3), kg m2, of a point mass about the origin."""
    return mass_kg * (at_m @ at_m * np.eye(3) - np.outer(at_m, at_m))


def masses(vehicle: Vehicle) -> list[ChangedVehicle]:
    """A known mass in front and at the side, as far from the middle as the rotors."""
    hubs = vehicle.rotor_positions_m()
    reach = float(np.linalg.norm(hubs[:, :2], axis=1).mean())
    if reach == 0:
        return []
    grams = 1000 * MASS_SHARE * vehicle.mass_kg

    def one(place, where):
        words = f"attach {grams:.3g} g ({100 * MASS_SHARE:.0f} % of the weight) {reach:.2g} m {where} of the middle"
        return _attached(vehicle, place, words)

    return [one((reach, 0.0, 0.0), "in front"), one((0.0, reach, 0.0), "to the right")]
