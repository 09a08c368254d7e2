"""Effects switched on in a vehicle file: `effects` of `vehicle.yaml` as catalogue forms with values, and its hover.

What adds a wrench or an error of a sensor flies in `simulate_as_stated`, and so does what lies between command and
rotor speed; `record_as_stated` writes what the sensors of such a flight read, with the faults of sensors and logging.

A vehicle of a recording may lack what its effects refer to (where the ground is, the rotor speed of the full command),
and a delay fitted to stamps may be negative. Such a vehicle is flown all the same, and a sentence says each difference.

A controller that knows the believed vehicle asks for a thrust and moments; a curve between command and speed, a payload
or unequal rotors make others of them. A pilot trims his vehicle until it hovers level, and so does `hover`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq, least_squares

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import CURVE, DELAY, LIMIT, Form, SetForm, SpeedForm, SpeedPath
from rotorid.effects.instant import body_of
from rotorid.errors import InputError
from rotorid.recordings.run import RecordingSet
from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle import fast
from rotorid.vehicle.derivatives import derivative_form
from rotorid.vehicle.mixer import allocation_matrix, hover_speed_rad_s
from rotorid.vehicle.simulator import (
    CommandPath,
    Commands,
    Controller,
    Motors,
    Trace,
    WhiteNoise,
    at_rest,
    recording,
    simulate,
)

_LARGEST_SHARE = 10.0
"""Thrust, over the weight, up to which is asked where the file states no limits of the rotor speed."""
_SLOPE_SHARE = 0.02
"""Change of the thrust asked for, as a share of it, over which the gain is measured."""
_HUNG_S, _HUNG_SAMPLES = 2.0, 100
"""Time at rest over which the force of what has a memory (a slung payload) is averaged, and its instants."""
_CLOSE = 1e-9
"""Share of the weight (and of the weight on a rotor's arm) within which a force or moment counts as none."""
_FULL_OVER_HOVER = 2.0
"""Rotor speed of the full command over that of hover where no limits are stated: a thrust of four times the weight."""
LAGS_OF_SPEED = frozenset({"one constant", "up and down"})
"""Forms of `motor_lag` that the simulator's own motors fly."""

ActiveForm = tuple[Form, np.ndarray]
"""A form of an effect and the values of its parameters, in order."""


def active_forms(vehicle: Vehicle) -> list[ActiveForm]:
    """Forms of wrench and sensor effects among `vehicle.effects` with their values, in the order of the file; then the
    vehicle's derivatives.

    An entry is `{id, form, parameters: {symbol: value}}`; `form` may be left out where the effect has one form.
    InputError names the entry and what was expected. Forms between command and rotor speed and forms that spoil
    the recorded set are passed over here: `all_forms` has them.
    """
    found = [found for found in all_forms(vehicle) if isinstance(found[0], Form)]
    derivatives = derivative_form(vehicle)
    return found if derivatives is None else [*found, derivatives]


def active_speed_forms(vehicle: Vehicle) -> list[tuple[SpeedForm, np.ndarray]]:
    """Forms of `vehicle.effects` that act between command and rotor speed, in the order of the path."""
    found = [found for found in all_forms(vehicle) if isinstance(found[0], SpeedForm)]
    return sorted(found, key=lambda pair: pair[0].stage)


def speeds_of_commands(
    vehicle: Vehicle,
    command_rad_s: np.ndarray,
    time_s: np.ndarray,
    voltage_v: np.ndarray | None = None,
    full_voltage_v: float | None = None,
) -> np.ndarray:
    """Rotor speeds (n, k), rad/s, that the vehicle's effects make of commands (n, k) at even instants (n,), s.

    `full_voltage_v` is the voltage that the effect of the supply refers to (default the largest of `voltage_v`).
    """
    limits = vehicle.rotor_speed_limits_rad_s
    full = float(np.max(command_rad_s)) if limits is None else limits[1]
    if voltage_v is not None and full_voltage_v is None:
        full_voltage_v = float(np.max(voltage_v))
    speed = np.asarray(command_rad_s, float)
    for form, values in active_speed_forms(vehicle):
        if "voltage" in form.requires and voltage_v is None:
            raise InputError(f"vehicle {vehicle.name}: effect form {form.name!r} needs the battery's voltage")
        speed = form.apply(SpeedPath(speed, time_s, full, voltage_v, full_voltage_v), values)
    return speed


def all_forms(vehicle: Vehicle) -> list[tuple[Form | SpeedForm | SetForm, np.ndarray]]:
    """Every form of `vehicle.effects` with its values, in the order of the file."""
    return [_active(entry, number, vehicle) for number, entry in enumerate(vehicle.effects, 1)]


def _active(entry: dict, number: int, vehicle: Vehicle) -> tuple[Form | SpeedForm | SetForm, np.ndarray]:
    where, name, effects = f"vehicle {vehicle.name}: effects entry {number}", entry.get("id"), catalogue()
    if name not in effects:
        raise InputError(f"{where} has id {name!r}, expected one of {', '.join(effects)}")
    effect = effects[name]
    named = effect.form_named(entry["form"]) if entry.get("form") else None
    every = (*effect.forms(vehicle), *effect.speed_forms, *effect.set_forms(vehicle), *([named] if named else []))
    forms = {form.name: form for form in every}
    wanted = entry.get("form", next(iter(forms)) if len(forms) == 1 else None)
    if wanted not in forms:
        raise InputError(f"{where} ({name}) has form {wanted!r}, expected one of {', '.join(forms)}")
    form = forms[wanted]
    given = dict(entry.get("parameters") or {})
    symbols = [p.symbol for p in form.parameters]
    if set(given) != set(symbols):
        raise InputError(
            f"{where} ({name}, {wanted}) gives parameters {', '.join(given) or 'none'}, expected {', '.join(symbols)}"
        )
    values = np.array([float(given[s]) for s in symbols])
    if not np.all(np.isfinite(values)):
        raise InputError(f"{where} ({name}, {wanted}) has a parameter that is not a finite number")
    return form, values


def command_path(
    vehicle: Vehicle, voltage_v: np.ndarray | None = None, full_voltage_v: float | None = None
) -> CommandPath | None:
    """What the vehicle's effects put between command and rotor speed, to be flown step by step; None for nothing.

    `voltage_v` (m,) is the battery's voltage at each step; without any it is the full one throughout.
    InputError where a form refers to the speed of the full command and the file states no limits.
    """
    forms, limits = active_speed_forms(vehicle), vehicle.rotor_speed_limits_rad_s
    if not forms:
        return None
    unscaled = [form.name for form, _ in forms if form.stage in (CURVE, LIMIT)]
    if unscaled and limits is None:
        raise InputError(
            f"vehicle {vehicle.name}: effect form {unscaled[0]!r} needs rotor_speed_limits_rad_s, the speed of the "
            "full command (rotorid.vehicle.improved states it)"
        )
    if full_voltage_v is None:
        full_voltage_v = 1.0 if voltage_v is None else float(np.max(voltage_v))
    return CommandPath(tuple(forms), 0.0 if limits is None else limits[1], voltage_v, full_voltage_v)


def _motors_of(vehicle: Vehicle, step_s: float) -> Motors | None:
    """The vehicle's speed forms as motors of the simulator, where one lag of the speed is all there is; else None.

    A lag below a step is left to `CommandPath`, whose law is exact for any step.
    """
    forms = active_speed_forms(vehicle)
    if not forms:
        return Motors(limits_rad_s=vehicle.rotor_speed_limits_rad_s)
    form, values = forms[0]
    if len(forms) == 1 and form.name in LAGS_OF_SPEED and min(values) > step_s:
        return Motors(values[0], values[-1], vehicle.rotor_speed_limits_rad_s)
    return None


def simulate_as_stated(
    vehicle: Vehicle,
    controller: Controller,
    duration_s: float,
    step_s: float = 0.001,
    voltage_v: float | np.ndarray | None = None,
    full_voltage_v: float | None = None,
    **settings,
) -> Trace:
    """Fly a vehicle with every effect that its file states switched on; `settings` as for `simulate`.

    What lies between command and rotor speed is applied to the whole series where the commands are known
    (`Commands`), and step by step under any other controller. `voltage_v` is constant or a series over the steps,
    (steps + 1,), the full one without any; `full_voltage_v` is the voltage at which commands are right (default the
    largest). What a file may lack for this, `rotorid.vehicle.improved` states.
    """
    steps = int(round(duration_s / step_s))
    voltage = np.broadcast_to(np.asarray(1.0 if voltage_v is None else voltage_v, float), (steps + 1,))
    motors, path, command = _motors_of(vehicle, step_s), None, None
    if isinstance(controller, Commands):
        time_s = step_s * np.arange(steps + 1)
        command = controller.rotor_speed[controller.index(time_s)]
        speed = speeds_of_commands(vehicle, command, time_s, voltage, full_voltage_v)
        controller = Commands(time_s, speed, np.gradient(speed, step_s, axis=0))
        motors = None
    elif motors is None:
        path = command_path(vehicle, voltage, full_voltage_v)
    trace = simulate(
        vehicle,
        controller,
        duration_s,
        step_s,
        motors=motors or Motors(limits_rad_s=vehicle.rotor_speed_limits_rad_s),
        effects=active_forms(vehicle),
        voltage_v=None if voltage_v is None else float(voltage.mean()),
        path=path,
        **settings,
    )
    return trace if command is None else replace(trace, rotor_command=np.broadcast_to(command, trace.rotor_speed.shape))


def record_as_stated(
    trace: Trace,
    vehicle: Vehicle,
    name: str,
    noise: WhiteNoise | None = None,
    rng: np.random.Generator | None = None,
    index: int = 0,
    every: int = 1,
) -> RecordingSet:
    """What a user is handed of a simulated flight: one run, with the errors of sensors and logging.

    The set's vehicle is the one believed: the file without its effects (and with what a mistake makes of it).
    """
    run = recording(trace, vehicle, name, noise, rng, index, active_forms(vehicle), every)
    recordings = RecordingSet(vehicle.name, vehicle.model_copy(update={"effects": (), "derivatives": ()}), (run,))
    for form, values in all_forms(vehicle):
        recordings = form.apply(recordings, values) if isinstance(form, SetForm) else recordings
    return recordings


def flyable(vehicle: Vehicle) -> tuple[Vehicle, tuple[str, ...]]:
    """The vehicle as a controller can fly it, and a sentence for each thing that is other than its file says.

    InputError for a stand or bench, and for an effect that the catalogue does not have.
    """
    if vehicle.kind != "flight":
        raise InputError(f"{vehicle.name}: a {vehicle.kind} does not fly, so that there is no flight to simulate")
    forms = all_forms(vehicle)
    between = [form for form, _ in forms if isinstance(form, SpeedForm)]
    changes: dict = {}
    said: list[str] = []
    delays = [(i, v[0]) for i, (form, v) in enumerate(forms) if isinstance(form, SpeedForm) and form.stage == DELAY]
    early = [i for i, delay_s in delays if delay_s < 0]
    if early:
        changes["effects"] = tuple(e for i, e in enumerate(vehicle.effects) if i not in early)
        said.append(
            f"The delay of the command of {forms[early[0]][1][0]:.3g} s is left out: "
            "rotors do not follow a command before it is given."
        )
    if any("voltage" in form.requires for form in between):
        said.append("The battery stays at its full voltage.")
    if vehicle.rotor_speed_limits_rad_s is None and any(form.stage in (CURVE, LIMIT) for form in between):
        full = _FULL_OVER_HOVER * hover_speed_rad_s(vehicle)
        changes["rotor_speed_limits_rad_s"] = (0.0, full)
        said.append(
            f"The file states no rotor_speed_limits_rad_s: the full command is taken as {full:.0f} rad/s, "
            f"{_FULL_OVER_HOVER:g} times the speed of hover."
        )
    if vehicle.ground_z_m is None and any("height" in f.requires for f, _ in forms if isinstance(f, Form)):
        changes["ground_z_m"] = 0.0
        said.append("The file states no ground_z_m: the ground is taken at z = 0.")
    return vehicle.model_copy(update=changes), tuple(said)


@dataclass(frozen=True)
class _Hover:
    """What to ask for."""

    thrust_n: float
    moments_n_m: tuple[float, ...]
    """About roll, pitch and yaw."""
    gain: float
    """Force, N, that a further newton of thrust makes."""
    supported: float = 1.0
    """Upward force over what hover needs; below 1 where all that the rotors can do does not support the vehicle."""


def hover(vehicle: Vehicle, path: CommandPath | None, height_m: float) -> _Hover:
    """The hover of a vehicle with the effects that its file states, at a height above its ground, m.

    `path` is what lies between its command and rotor speed. Where the rotors cannot balance every moment, what is
    asked for leaves the least of them.
    """
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    units = weight * np.array([1.0, *np.repeat(np.linalg.norm(vehicle.rotor_positions_m(), axis=1).mean(), 3)])
    limits = vehicle.rotor_speed_limits_rad_s
    most = _LARGEST_SHARE * weight
    if limits is not None:
        most = float((vehicle.thrust_coefficients_n_s2() * limits[1] ** 2).sum())

    def missing(asked: np.ndarray) -> np.ndarray:
        """Force and moments beyond those of a level hover, over `units`, for thrust and moments over them."""
        return wrench_at_rest(vehicle, path, asked * units, height_m) / units - [1.0, 0.0, 0.0, 0.0]

    def rising(share: float) -> float:
        return float(missing(np.array([share, 0.0, 0.0, 0.0]))[0])

    share = 1.0
    if abs(rising(share)) > _CLOSE:
        if (highest := rising(most / weight)) <= 0:
            return _Hover(most, (0.0, 0.0, 0.0), 1.0, 1.0 + highest)
        if rising(0.0) < 0:
            share = brentq(rising, 0.0, most / weight, xtol=_CLOSE)
    asked = np.array([share, 0.0, 0.0, 0.0])
    if np.abs(missing(asked)).max() > _CLOSE:
        asked = least_squares(missing, asked).x
    less = asked - [_SLOPE_SHARE * asked[0], 0.0, 0.0, 0.0]
    gain = float((missing(asked) - missing(less))[0] / (_SLOPE_SHARE * asked[0]))
    thrust, *moments = (float(v) for v in asked * units)
    return _Hover(thrust, tuple(moments), gain if gain > 0 else 1.0)


def wrench_at_rest(vehicle: Vehicle, path: CommandPath | None, asked: np.ndarray, height_m: float) -> np.ndarray:
    """Upward force, N, and moments, N m, (4,), on the level vehicle at rest where a believed wrench (4,) is asked for.

    They are the accelerations times the believed mass and inertia.
    """
    command = np.sqrt(np.maximum(allocation_matrix(vehicle) @ asked, 0.0))
    limits = vehicle.rotor_speed_limits_rad_s or (0.0, np.inf)
    return wrench_of_command(vehicle, path, np.clip(command, *limits), height_m)


def wrench_of_command(vehicle: Vehicle, path: CommandPath | None, command: np.ndarray, height_m: float) -> np.ndarray:
    """The same where rotor speeds (k,), rad/s, are commanded."""
    command, limits = command[None], vehicle.rotor_speed_limits_rad_s or (0.0, np.inf)
    speed = command if path is None else np.clip(path.steady(command), *limits)
    every = active_forms(vehicle)
    instant = fast.kernels_of([pair for pair in every if not pair[0].memory], vehicle)
    level = np.concatenate([np.zeros(3), [1.0], np.zeros(9), speed[0]])[None]
    flown = fast.fly(body_of(vehicle), instant, level, 0, 1.0, speed, ground_z_m=height_m)
    turning, specific_force = np.split(flown.accelerations[0, 0], 2)
    up = -vehicle.mass_kg * specific_force[2]
    moments = turning @ vehicle.inertia_kg_m2.matrix().T
    time_s = np.linspace(0.0, _HUNG_S, _HUNG_SAMPLES)
    hanging = at_rest(vehicle, time_s, np.repeat(speed, len(time_s), axis=0), height_m)
    for form, values in every:
        if form.memory and (added := form.contribution(hanging, vehicle, values)).force is not None:
            up -= added.force[:, 2].mean()
    return np.array([up, *moments])
