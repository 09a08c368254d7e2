"""Vehicles with their effects, flown in windows of half a second that are restarted from the recording, and how far
they drift off.

What belongs to the run (wind, a payload for a time) and to the readings is taken from their files. An error is the
length of the vector between simulation and recording (for attitude the angle of the rotation between them), taken over
all samples of a window but the restart itself.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from rotorid.effects.contract import Form, Motion, SpeedForm, not_testable_reason
from rotorid.mismatch.decide.sizes import WINDOW_S
from rotorid.mismatch.deliver.files import Condition, Conditions, Entry, Instruments
from rotorid.mismatch.evidence.motion import Segment
from rotorid.mismatch.evidence.speedpath import commanded_path
from rotorid.recordings import Vehicle
from rotorid.vehicle.improved import ActiveForm, active_forms, all_forms
from rotorid.vehicle.windows import Inputs, States, Windows, plan_windows, simulate_windows, usable

UNITS = {"position": "m", "velocity": "m/s", "attitude": "rad", "angular_velocity": "rad/s"}


@dataclass(frozen=True)
class WindowErrors:
    """Lengths of the errors in the windows of one stretch, (windows, samples without the restart) by channel."""

    run: str
    start_s: np.ndarray
    stop_s: np.ndarray
    channels: dict[str, np.ndarray]


def errors_of(segments: Sequence[Segment], model: Model) -> list[WindowErrors]:
    """Errors of every stretch's windows."""
    return [_window_errors(*driven, model) for driven in zip(segments, *driven_by(segments, model), strict=True)]


def driven_by(segments: Sequence[Segment], model: Model) -> tuple[list[Inputs], list[States]]:
    """Inputs and recorded states of every segment, rotor speeds by the model's chain where only commanded."""
    voltages = [float(np.nanmax(s.motion.voltage)) for s in segments if s.motion.voltage is not None]
    commands = [float(np.nanmax(s.command)) for s in segments if s.command is not None]
    inputs, states = [], []
    for segment in segments:
        motion = segment.motion
        speed, acceleration = motion.rotor_speed, motion.rotor_acceleration
        if not segment.measured_speed and segment.command is not None:
            speed = _commanded(segment, model, max(commands), max(voltages, default=None))
            acceleration = np.gradient(speed, motion.time_s, axis=0)
        wind = model.conditions.wind(segment.run, motion.time_s) if model.conditions else None
        turning = replace(motion, rotor_speed=speed, wind=wind)
        acting = [(form, v, turning) for form, v in model.forms if _remembers(form, v, motion, model.vehicle)]
        for condition, form, v in model.loads:
            aboard = model.conditions.present(condition, segment.run, motion.time_s)
            acting.append((form, v, replace(turning, on_board=aboard)))
        force, moment = _wrench_along(acting, model.vehicle)
        inputs.append(Inputs(speed, acceleration, motion.height, motion.voltage, wind, force, moment))
        states.append(_states(segment, model))
    return inputs, states


def _commanded(segment: Segment, model: Model, largest_rad_s: float, full_voltage: float | None) -> np.ndarray:
    """Rotor speeds (n, k), rad/s, that the model makes of a segment's commands; a throttle is a share of its own full
    speed."""
    limits = model.vehicle.rotor_speed_limits_rad_s
    full_speed = limits[1] if limits else largest_rad_s
    if segment.full_speed is not None and limits:
        segment = replace(segment, command=segment.command * (full_speed / segment.full_speed))
    values = np.asarray(model.chain_values)
    return commanded_path(segment, model.chain, values, 0.0, full_speed, full_voltage)


def _states(segment: Segment, model: Model) -> States:
    """Recorded states, less the errors of the sensors that the model knows of."""
    motion = segment.motion
    rates = motion.angular_velocity
    for form, values in model.readings:
        if not not_testable_reason(form, motion, model.vehicle):
            error = form.contribution(motion, model.vehicle, values).angular_velocity
            rates = rates if error is None or rates is None else rates - error
    quaternion = velocity = None
    if motion.rotation is not None:
        quaternion = Rotation.from_matrix(motion.rotation).as_quat(scalar_first=True)
        if motion.velocity is not None:
            velocity = np.einsum("nij,nj->ni", motion.rotation, motion.velocity)
    return States(rates, quaternion, velocity, motion.position)


def _remembers(form: Form, values: np.ndarray, motion: Motion, vehicle: Vehicle) -> bool:
    """Whether a form looks at the past: its value at an instant is not the same when the instant comes alone."""
    whole = motion.at(slice(0, min(motion.size, 64)))
    every = np.arange(0, whole.size, 3)
    apart = form.contribution(whole.at(every), vehicle, values)
    together = form.contribution(whole, vehicle, values)
    return any(
        (a := getattr(together, name)) is not None and not np.allclose(a[every], getattr(apart, name), rtol=1e-6)
        for name in ("force", "moment")
    )


def _wrench_along(
    acting: Sequence[tuple[Form, np.ndarray, Motion]], vehicle: Vehicle
) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Wrench of forms with values, each along a motion of its own: (n, 3) N and N m, None for nothing."""
    parts = [form.contribution(motion, vehicle, values) for form, values, motion in acting]
    given = ([x for x in own if x is not None] for own in ([p.force for p in parts], [p.moment for p in parts]))
    force, moment = (np.sum(own, axis=0) if own else None for own in given)
    return force, moment


def predict(
    segment: Segment, model: Model, inputs: Inputs, states: States, sample: np.ndarray | None = None
) -> Windows:
    """Windows of a segment as the model predicts them; `sample` (w, m) takes windows planned before."""
    quick = [(f, v) for f, v in model.forms if not _remembers(f, v, segment.motion, model.vehicle)]
    return simulate_windows(model.vehicle, quick, segment.motion.time_s, inputs, states, WINDOW_S, sample=sample)


def _window_errors(
    segment: Segment, inputs: Inputs, states: States, model: Model, sample: np.ndarray | None = None
) -> WindowErrors:
    """Errors of the windows of one stretch, or of those of `sample`."""
    windows = predict(segment, model, inputs, states, sample)
    recorded = States(**{n: None if v is None else v[windows.sample] for n, v in vars(states).items()})
    channels = {name: values[:, 1:] for name, values in between(windows.predicted, recorded).items()}
    time_s = segment.motion.time_s[windows.sample]
    return WindowErrors(segment.run, time_s[:, 0], time_s[:, -1], {n: v for n, v in channels.items() if v.size})


def between(a: States, b: States) -> dict[str, np.ndarray]:
    """Lengths of the differences of two sets of states, for what both have."""
    out = {}
    for name in ("position", "velocity", "angular_velocity"):
        if getattr(a, name) is not None and getattr(b, name) is not None:
            out[name] = np.linalg.norm(getattr(a, name) - getattr(b, name), axis=-1)
    if a.quaternion is not None and b.quaternion is not None:
        out["attitude"] = 2.0 * np.arccos(np.clip(np.abs((a.quaternion * b.quaternion).sum(axis=-1)), 0.0, 1.0))
    return out


def squares_of_windows(
    segments: Sequence[Segment],
    model: Model,
    unit_of: Callable[[str, np.ndarray], np.ndarray],
    units: int,
    of_unit: Callable[[int], Model] | None = None,
) -> np.ndarray:
    """Mean squares of the windows' errors and their number, (channels, 2, units), channels in the order of UNITS.

    `unit_of` gives the unit (a run or piece; -1 for none) of a run at instants. `of_unit` gives the model of a unit
    where models are learnt without it; what drives them is that of `model`.
    """
    out = np.zeros((len(UNITS), 2, units))
    farthest = 1e6  # Error, in any unit, at which a simulation that runs away is taken to end.
    for segment, inputs, states in zip(segments, *driven_by(segments, model), strict=True):
        time_s = segment.motion.time_s
        plan = plan_windows(time_s, WINDOW_S, None, usable(inputs, states))
        ends = [unit_of(segment.run, time_s[plan[:, k]]) for k in (0, -1)]
        own = np.where(ends[0] == ends[1], ends[0], -1)
        parts = [own >= 0] if of_unit is None else [own == u for u in np.unique(own[own >= 0])]
        for part in parts:
            if not part.any():
                continue
            flown = model if of_unit is None else of_unit(int(own[part][0]))
            errors = _window_errors(segment, inputs, states, flown, plan[part]).channels
            for number, name in enumerate(UNITS):
                if name in errors:
                    square = (np.nan_to_num(np.minimum(errors[name], farthest), nan=farthest) ** 2).mean(axis=1)
                    out[number] += [np.bincount(own[part], square, units), np.bincount(own[part], None, units)]
    return out[out[:, 1].sum(axis=1) > 0]


@dataclass(frozen=True)
class Model:
    """A vehicle with its effects, and the conditions and instruments of the recordings that it is compared with."""

    vehicle: Vehicle
    forms: tuple[ActiveForm, ...] = ()
    """Forms that add a wrench, with their values."""
    chain: tuple[tuple[str, SpeedForm], ...] = ()
    """Forms between command and rotor speed, with their ids."""
    chain_values: tuple[float, ...] = ()
    """Parameters of the chain, form after form."""
    conditions: Conditions | None = None
    loads: tuple[tuple[Condition, Form, np.ndarray], ...] = ()
    """Conditions with a form (a payload for a time), and their values."""
    readings: tuple[ActiveForm, ...] = ()
    """Errors of sensors, with their values."""


def model_of(vehicle: Vehicle, conditions: Conditions | None = None, instruments: Instruments | None = None) -> Model:
    """What the three files say, as forms with values; InputError names a faulty entry."""
    stated = [(entry["id"], *form) for entry, form in zip(vehicle.effects, all_forms(vehicle), strict=True)]
    chain = [(effect_id, form, values) for effect_id, form, values in stated if isinstance(form, SpeedForm)]
    loads = tuple(
        (condition, *form)
        for condition in (conditions.conditions if conditions else ())
        for form in _forms(vehicle, condition)
    )
    readings = tuple(
        form for entry in (instruments.instruments if instruments else ()) for form in _forms(vehicle, entry)
    )
    return Model(
        vehicle,
        tuple(active_forms(vehicle)),
        tuple((effect_id, form) for effect_id, form, _ in chain),
        tuple(float(v) for _, _, values in chain for v in values),
        conditions,
        loads,
        readings,
    )


def _forms(vehicle: Vehicle, entry: Entry) -> list[ActiveForm]:
    """The form of an entry with its values; none where the parameters themselves describe it."""
    if not entry.form:
        return []
    effects = ({"id": entry.id, "form": entry.form, "parameters": entry.parameters},)
    return active_forms(vehicle.model_copy(update={"effects": effects, "derivatives": ()}))
