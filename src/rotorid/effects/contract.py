"""What every effect of the catalogue states, and the flight data it is evaluated on.

An effect is one physical, sensor or logging cause that the rigid-body baseline leaves out. It may have
several forms that compete inside its id (drag at the hubs or at the centre of mass). A form is a function from
the flight (`Motion`), the vehicle and parameter values to what it adds (`Contribution`); the contribution is
linear in every parameter not marked `nonlinear`, which the selection relies on and a test holds. A fault of sensors or
logging changes the columns of a recorded set (`SetForm`).

Frames: world north-east-down, body forward-right-down. All functions take n instants at once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numba import njit

from rotorid.recordings import columns as c
from rotorid.recordings.run import RecordingSet, Run
from rotorid.recordings.vehicle import Vehicle

if TYPE_CHECKING:
    from rotorid.effects.loading import InstrumentFacts

VECTORS = {
    "accelerometer": c.SPECIFIC_FORCE,
    "gyroscope": c.ANGULAR_VELOCITY,
    "velocity": c.VELOCITY,
    "position": c.POSITION,
}
"""Sensors that read a vector, with their columns."""


@dataclass(frozen=True)
class Motion:
    """Flight at n instants; a field is None where the recording cannot give it.

    Shapes: vectors (n, 3), per rotor (n, k), scalars (n,). Units SI.
    """

    time_s: np.ndarray
    rotor_speed: np.ndarray
    """Rotor speeds, (n, k), rad/s."""
    rotor_acceleration: np.ndarray | None = None
    """Time derivative of the rotor speeds, (n, k), rad/s2."""
    angular_velocity: np.ndarray | None = None
    """Body rates, (n, 3), rad/s, body axes."""
    angular_acceleration: np.ndarray | None = None
    """Derivative of the body rates, (n, 3), rad/s2, body axes."""
    specific_force: np.ndarray | None = None
    """Acceleration without gravity, (n, 3), m/s2, body axes: measured, else derived from velocity or position."""
    accelerometer: np.ndarray | None = None
    """The same as an accelerometer read it, None where none is recorded."""
    gyroscope: np.ndarray | None = None
    """Body rates as a gyroscope read them where the attitude is recorded too, None where there is only one source."""
    rotation: np.ndarray | None = None
    """Rotation of body vectors into the world, (n, 3, 3)."""
    velocity: np.ndarray | None = None
    """Velocity over ground, (n, 3), m/s, body axes."""
    wind: np.ndarray | None = None
    """Velocity of the air over ground, (3,) or (n, 3), m/s, world axes; None for still air."""
    position: np.ndarray | None = None
    """Position of the body origin, (n, 3), m, world axes."""
    height: np.ndarray | None = None
    """Height of the centre of mass above ground, (n,), m."""
    voltage: np.ndarray | None = None
    """Battery voltage, (n,), V."""
    on_board: np.ndarray | None = None
    """Share of a payload that is on board, (n,), 0 or 1; None where it is on board all the time."""
    hung: np.ndarray | None = None
    """How a slung payload hung at some instants, (k, 7): time in s, direction of the cable downward and its rate in
    1/s, both in world axes; None for one that starts at rest."""
    hung_by: np.ndarray | None = None
    """What it swung by since, g − a as measured, (n, 3), m/s2, world axes: a wide swing forgets its state if this is
    predicted. Given together with `hung`."""
    rotor_thrust: np.ndarray | None = None
    """Thrust of each rotor, (n, k), N, where effects are known that change it; None for the believed C_F ω²."""
    tilt_gravity: np.ndarray | None = None
    """Gravity on a stand, (n, 3), m/s2, sensor axes (kind `stand` only)."""

    @property
    def size(self) -> int:
        return len(self.time_s)

    @property
    def air_velocity(self) -> np.ndarray | None:
        """Velocity through the air, (n, 3), m/s, body axes; None where no velocity is known."""
        if self.wind is None or self.velocity is None:
            return self.velocity
        assert self.rotation is not None, "a wind is known in world axes"
        wind = np.broadcast_to(self.wind, self.velocity.shape)
        return self.velocity - np.einsum("nji,nj->ni", self.rotation, wind)

    def has(self, names: tuple[str, ...]) -> bool:
        """Whether every named field is there."""
        return all(getattr(self, name) is not None for name in names)

    def at(self, index) -> Motion:
        """The same flight at selected instants."""
        picked = {}
        for name, value in self.__dict__.items():
            keep = value is None or name == "hung" or (name == "wind" and value.ndim == 1)
            picked[name] = value if keep else value[index]
        return replace(self, **picked)


@dataclass(frozen=True)
class Contribution:
    """What a form adds, each (n, 3) in body axes, None for nothing."""

    force: np.ndarray | None = None
    """Force on the airframe, N."""
    moment: np.ndarray | None = None
    """Moment about the believed centre of mass, N m."""
    specific_force: np.ndarray | None = None
    """Error of the accelerometer's reading, m/s2."""
    angular_velocity: np.ndarray | None = None
    """Error of the gyroscope's reading, rad/s."""
    angular_acceleration: np.ndarray | None = None
    """Time derivative of that error, rad/s2 (stated apart: differentiating a noisy reading would bias it)."""
    reading: np.ndarray | None = None
    """Error of a stand's or bench's reading, (n, 6), N and N m, sensor axes."""


@dataclass(frozen=True)
class Parameter:
    """A parameter of a form.

    `low` and `high` are hard physical bounds in the given unit. `nonlinear` parameters carry the starting
    values for their fit in `starts`.
    """

    symbol: str
    unit: str
    low: float = -np.inf
    high: float = np.inf
    nonlinear: bool = False
    starts: tuple[float, ...] = ()
    meaning: str = ""
    negligible: float = 0.0
    """No instrument is better than this: a form whose parameters are all below it is not worth a word."""


_Adding = Callable[[Motion, Vehicle, np.ndarray], Contribution]
"""What a form adds; a `rotorid.effects.instant.Wrench` where one instant gives its force and moment: then it flies."""
_Residuals = Sequence[tuple[Motion, dict[str, np.ndarray]]]
"""Motions of a recording, each with the `force` and `moment` that are not explained, (n, 3) in body axes."""


@dataclass(frozen=True)
class Form:
    """One way an effect may act: its parameters and its contribution.

    `contribution(motion, vehicle, values)` takes the parameter values in order, shape (p,).
    """

    name: str
    equation: str
    parameters: tuple[Parameter, ...]
    contribution: _Adding
    requires: tuple[str, ...] = ()
    """Fields of `Motion` that must be there."""
    vehicle_requires: tuple[str, ...] = ()
    """Keys of vehicle.yaml that must be stated."""
    minimum_rotors: int = 1
    must_show: tuple[int, ...] = ()
    """Parameters without which the form is another effect: each must differ from zero by two standard errors."""
    memory: bool = False
    """Whether it needs the past (a pendulum of its own): one instant does not give its wrench."""
    excited_by: tuple[str, ...] = ()
    """Fields of `Motion` without which nothing is added: the contribution is zero where all of them are zero
    (`height`: far from the ground). `always` for a form that is there in any flight. Empty takes the effect's."""
    on_loading: bool = False
    """Whether the contribution takes a `Loading` (an instrument's) in place of a `Motion`."""
    of_reading: tuple[tuple[int, int], ...] = ()
    """Linear parameters p of Ω_m = (1 + s) Ω + p (s itself, a bias) and the index of their s, where recordings give the
    reading Ω_m alone: a fit to it is of p/(1 + s)."""
    guess: Callable[[_Residuals, Vehicle], tuple[tuple[float, ...], ...]] | None = None
    """From what the believed vehicle leaves: starting values of the nonlinear parameters, where those stated are too
    far apart to find the right ones. They take the place of those stated; without any, those hold."""

    takes_up: tuple[str, ...] = ()
    """Believed values (keys of the regression) that the form has a part of its own for: with it their trust is no
    room to move in, or the two would share one slope."""

    linear_drag: Literal["", "times rotor speed", "of airspeed alone"] = ""
    """Of a force in proportion to the horizontal velocity through the air (or of a wind's part of it), how its
    coefficient hangs on the rotors; empty for any other force."""
    swings: bool = False
    """Whether it swings: how it hung in a run is read from the run (`Motion.hung`)."""
    comes_and_goes: bool = False
    """Whether it may be there for a part of a run alone (`Motion.on_board`)."""
    brings: tuple[str, ...] = ()
    """Believed values (the contract's names) that it changes as well where it is new in a vehicle."""
    resolution: float = 1.0
    """How many times the size that counts elsewhere its contribution must have."""

    def stated(self, fitted: np.ndarray) -> np.ndarray:
        """The linear parameters as their equation has them, from the coefficients fitted to recordings, each (k,)."""
        out = np.array(fitted, float)
        for index, scale in self.of_reading:
            out[self.linear.index(index)] /= 1.0 - fitted[self.linear.index(scale)]
        return out

    @cached_property
    def linear(self) -> tuple[int, ...]:
        return tuple(i for i, p in enumerate(self.parameters) if not p.nonlinear)

    @cached_property
    def nonlinear(self) -> tuple[int, ...]:
        return tuple(i for i, p in enumerate(self.parameters) if p.nonlinear)


CURVE, SUPPLY, LIMIT, DELAY, LAG = range(5)
"""Stages between command and rotor speed, in the order in which they act."""


@dataclass(frozen=True)
class SpeedPath:
    """What lies between command and rotor speed, at n even instants."""

    speed: np.ndarray
    """Speed so far along the path, (n, k), rad/s."""
    time_s: np.ndarray
    full_speed: float
    """Upper limit of the rotor speed (or its largest command), rad/s; scales the parameters."""
    voltage: np.ndarray | None = None
    """Battery voltage, (n,), V."""
    full_voltage: float | None = None
    """Largest battery voltage of the set, V."""
    holds: bool = True
    """Whether a command holds until the next instant; else it is smooth between instants."""

    @property
    def dt_s(self) -> float:
        return float(self.time_s[1] - self.time_s[0])


@dataclass(frozen=True)
class SpeedForm:
    """One way in which rotor speed differs from its command; `apply(path, values)` gives the new speed (n, k).

    `stage` (`CURVE` to `LAG`) orders the path. `neutral` are the parameter values that change nothing.
    """

    name: str
    equation: str
    parameters: tuple[Parameter, ...]
    stage: int
    apply: Callable[[SpeedPath, np.ndarray], np.ndarray]
    neutral: tuple[float, ...]
    requires: tuple[str, ...] = ()
    excited_by: Literal["command", "change", "voltage", "limit", "time"] = "command"
    """What it takes to show: any command, a command that changes, a voltage below the largest, a command beyond
    the limit, or time since the start of the run."""
    own_scale: bool = False
    """Whether a parameter scales all speeds, as another full speed would."""


@dataclass(frozen=True)
class SetForm:
    """One way in which a recording set is not what it says; `apply(recordings, values)` gives the faulty set.

    For faults of sensors, logging and of the set's own description, which are no wrench. `neutral` are the
    parameter values that change nothing, `example` those of a fault of usual size.
    """

    name: str
    equation: str
    parameters: tuple[Parameter, ...]
    apply: Callable[[RecordingSet, np.ndarray], RecordingSet]
    neutral: tuple[float, ...]
    example: tuple[float, ...]
    columns: tuple[str, ...]
    """Columns that it spoils (or, for the set's description, that show it)."""


@dataclass(frozen=True)
class Effect:
    """One id of the catalogue: adding an effect is adding one file with one of these, named EFFECT."""

    id: str
    name: str
    """What a pilot would call it, fits into "… was left out"."""
    sentence: str
    """How it is observed, one clause."""
    forms: Callable[[Vehicle], tuple[Form, ...]]
    """The forms for a vehicle (their parameters may depend on its number of rotors)."""
    source: str
    sign: str = ""
    """What a positive parameter does, in the contract's axes."""
    validity: str = ""
    """Where the equations hold, and what they leave out."""
    excited_by: tuple[str, ...] = ()
    """As `Form.excited_by`, for the forms that state none of their own."""
    confusers: tuple[str, ...] = ()
    """Ids that imitate it (physics.md); the class is computed from the data, this is for the text."""
    separating_manoeuvre: str = ""
    """What distinguishes it from its confusers, one clause, without the columns that this takes."""
    separating_columns: tuple[str, ...] = ()
    """What to record for this (`rotorid.effects.describe.RECORDABLE`)."""
    kind: Literal["physics", "sensor", "mistake"] = "physics"
    cases: tuple[str, ...] = ()
    """Drawn cases of the proof (`cases.tsv` there): one in which it is claimed, and one in which it must not be; a test
    makes verdicts on both."""
    exact: bool = False
    """Whether its equation is geometry or a definition and can have no other form; else what it leaves of a reading
    may be its form."""
    speed_forms: tuple[SpeedForm, ...] = ()
    """Forms that act between command and rotor speed."""
    about: Callable[..., SpeedForm] | None = None
    """The form about a command or a voltage that is stated where no rotor speed is recorded."""
    of_the_rig: bool = False
    """Whether it is of the stand or of the room around it, and no property of the vehicle."""
    set_forms: Callable[[Vehicle], tuple[SetForm, ...]] = lambda vehicle: ()
    """Forms that spoil a recorded set."""
    form_named: Callable[[str], Form | SpeedForm | None] = lambda name: None
    """A form that the data give rise to (a gust in its window, a curve about the hover command), from its name in a
    vehicle file."""
    reading_forms: Callable[[InstrumentFacts], tuple[Form, ...]] | None = None
    """Forms of kinds `stand` and `bench`, whose contribution takes a `Loading` and gives a `reading`; None where the
    forms for a flight hold on a stand as well."""

    # What the decision asks of an effect

    air_moves: Literal["", "all the time", "in windows"] = ""
    """Whether it is air that moves over the ground, in all runs or in windows of its own."""
    feels_air: bool = False
    """Whether its force hangs on the velocity through the air."""
    drag: bool = False
    """Whether its force opposes the velocity through the air: with it a force can be stated as a wind's velocity."""
    would_change: tuple[str, ...] = ()
    """Believed values (keys of vehicle.yaml) that it would change by itself."""
    like_on_heavier: tuple[str, ...] = ()
    """Ids that on a vehicle heavier than believed may be this one; those after the first only with the first."""
    turns_like: str = ""
    """Id of another that rolls and pitches a hovering vehicle as it does."""
    same_on_commands: str = ""
    """Id from which it cannot be distinguished where rotor speeds are known from their commands alone."""
    contradiction: bool = False
    """Whether columns that contradict each other show it, whatever force and moment are."""
    shows_in: tuple[str, ...] = ()
    """Kinds of what two sets of flights are compared by without a model (`rotorid.mismatch.changes.quantities`) that
    another amount of it changes."""
    curves_thrust: bool = False
    """Whether it adds to the square of the rotor speed, which the thrust coefficient has, too."""
    between_flights: Mapping[str, float] = field(default_factory=dict)
    """To a unit the one-sigma of its parameters of that unit between two flights in which nothing changed."""
    differs_between_runs: Literal["", "zero", "drift", "of other axes"] = ""
    """What of a reading it is that differs from run to run of one day where nothing changed; empty for nothing."""
    remedy: Literal["", "calibrate", "zero"] = ""
    """What to do about an instrument that came to have it; empty where it is not the instrument's."""
    curve_of_load: bool = False
    """Whether it bends a reading by the load alone, as any other such curve does on one rotor that does not tilt."""
    shows: Literal["", "in what takes time", "after a change of load"] = ""
    """What an instrument must record to show it; empty: steady points will do."""
    shows_in_moments: bool = False
    """Whether forces alone do not show it on an instrument."""
    fitted: bool = True
    """Whether the search fits it; else it is found in the recordings themselves."""
    like_of_reading: tuple[str, ...] = ()
    """Ids of an instrument's effects that do to its reading what the speed forms do to a speed nobody measured."""
    lack_on: Callable[[InstrumentFacts], str] | None = None
    """Why an instrument (`rotorid.effects.loading`) gives nothing to test it on, where it has no form there."""

    def excitation(self, form: Form) -> tuple[str, ...]:
        """What excites one of the effect's forms."""
        return form.excited_by or self.excited_by


_RATES = "angular_velocity_*_rad_s, or quaternion_*"
COLUMNS_OF = {
    "rotor_speed": "rotor_speed_*_rad_s, or rotor_command_*_rad_s, or throttle_*",
    "rotor_acceleration": "rotor_speed_*_rad_s, or rotor_command_*_rad_s, or throttle_*",
    "angular_velocity": _RATES,
    "angular_acceleration": _RATES,
    "specific_force": "specific_force_*_m_s2, or velocity_*_m_s (or position_*_m) and quaternion_*",
    "accelerometer": "specific_force_*_m_s2",
    "gyroscope": "angular_velocity_*_rad_s and quaternion_*",
    "rotation": "quaternion_*",
    "velocity": "velocity_*_m_s (or position_*_m) and quaternion_*",
    "position": "position_*_m",
    "height": "height_m, or position_z_m where vehicle.yaml states ground_z_m",
    "voltage": "battery_voltage_v",
}
"""Columns of a run that give a field of `Motion`."""

LACK = {
    "velocity": "no velocity or position recorded",
    "rotation": "no attitude recorded",
    "position": "no position recorded",
    "height": "no height above ground",
    "voltage": "no battery voltage",
    "angular_velocity": "no body rates or attitude recorded",
    "angular_acceleration": "no body rates or attitude recorded",
    "rotor_acceleration": "no rotor speeds recorded",
    "specific_force": "no acceleration, velocity or position recorded",
    "accelerometer": "no accelerometer recorded",
    "gyroscope": "no gyroscope and attitude recorded together",
    "rotor_speed": "no rotor speeds, commands or throttle recorded",
}


def not_testable_reason(form: Form, motion: Motion, vehicle: Vehicle) -> str | None:
    """Why a form cannot be tested on this flight, None if it can."""
    for name in form.requires:
        if getattr(motion, name) is None:
            return LACK.get(name, f"no {name.replace('_', ' ')}")
    for key in form.vehicle_requires:
        if getattr(vehicle, key) in (None, ()):
            return f"vehicle.yaml states no {key}"
    if vehicle.rotor_count < form.minimum_rotors:
        return f"needs at least {form.minimum_rotors} rotors"
    return None


def rotor_thrusts(motion: Motion, vehicle: Vehicle) -> np.ndarray:
    """Thrust of each rotor, shape (n, k), N: the believed C_F ω² where the motion does not have another."""
    if motion.rotor_thrust is not None:
        return motion.rotor_thrust
    return vehicle.thrust_coefficients_n_s2() * motion.rotor_speed**2


def compiled(**options: Any) -> Callable[[Callable], Callable]:
    """A decorator like `numba.njit`, with its cache where numba finds a folder that it may write into.

    An installation that cannot be written, for a user without a home directory, has none: there the function is
    compiled in each process anew.
    """

    def decorated(function: Callable) -> Callable:
        try:
            return njit(cache=True, **options)(function)
        except RuntimeError:
            return njit(**options)(function)

    return decorated


def sensors(vehicle: Vehicle) -> dict[str, tuple[str, ...]]:
    """Every sensor with its columns."""
    return {**VECTORS, "attitude": c.QUATERNION, "rotor speeds": c.rotor_columns("rotor_speed", vehicle.rotor_count)}


def with_columns(recordings: RecordingSet, names: tuple[str, ...], change: Callable[[Run, np.ndarray], np.ndarray]):
    """The set with `change(run, values)` (values (n, m) to (n, m)) in place of the named columns where it has them."""
    runs = []
    for run in recordings.runs:
        if run.has(*names):
            table = run.table.copy()
            table[list(names)] = change(run, run.array(names).copy())
            run = replace(run, table=table)
        runs.append(run)
    return replace(recordings, runs=tuple(runs))


def late(run: Run, values: np.ndarray, late_s: np.ndarray | float) -> np.ndarray:
    """Columns (n, m) as a sensor writes them whose stamps are late by `late_s`: value at t is that of t - late."""
    when = run.time_s - late_s
    return np.stack([np.interp(when, run.time_s, column) for column in values.T], axis=1)


def late_sensors(
    vehicle: Vehicle,
    equation: str,
    parameters: tuple[Parameter, ...],
    example: tuple[float, ...],
    late_s: Callable[[np.ndarray, np.ndarray], np.ndarray | float],
) -> tuple[SetForm, ...]:
    """A form for each sensor whose lateness is `late_s(seconds since the run's start, values)`."""

    def one(sensor: str, names: tuple[str, ...]) -> SetForm:
        def apply(recordings, values):
            def change(run, columns):
                return late(run, columns, late_s(run.time_s - run.time_s[0], values))

            return with_columns(recordings, names, change)

        return SetForm(f"of the {sensor}", equation, parameters, apply, (0.0,) * len(parameters), example, names)

    return tuple(one(sensor, names) for sensor, names in sensors(vehicle).items())
