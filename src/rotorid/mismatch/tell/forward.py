"""Simulation run forward in windows of half a second restarted from the recording: how far it drifts off.

Three models are compared on the same windows: the believed vehicle, the refitted one, and the improved one with
its effects. An error is the length of the vector between simulation and recording (for attitude the angle of the
rotation between them), taken over all samples of all windows but the restarts themselves. The noise floor is what
the sensors' own noise would make of a perfect model: the simulation is started and driven once more with as much
white noise again, and the recorded side's noise is added. It is never put above what the improved model leaves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from rotorid.effects.contract import Form, Motion, not_testable_reason
from rotorid.errors import InputError
from rotorid.mismatch.decision.drift import WINDOW_S
from rotorid.mismatch.decision.findings import Analysis
from rotorid.mismatch.decision.shares import fitted_part, segments_of
from rotorid.mismatch.delivery.files import conditions_of, instruments_of
from rotorid.mismatch.delivery.model import Model, model_of
from rotorid.mismatch.delivery.parts import improved_vehicle
from rotorid.mismatch.model.prepare import sensor_noise
from rotorid.mismatch.plant.motion import Segment, SensorNoise
from rotorid.mismatch.plant.speedpath import commanded_path
from rotorid.mismatch.tell.verdict import Channel, Errors, PValues, SplitErrors
from rotorid.recordings import Vehicle
from rotorid.steps import step
from rotorid.vehicle.windows import Inputs, States, simulate_windows

UNITS = {"position": "m", "velocity": "m/s", "attitude": "rad", "angular_velocity": "rad/s"}
SAME = 1e-5
"""Relative difference above which a vehicle read back is not the model written (errors are stated to six digits)."""


@dataclass(frozen=True)
class Forward:
    """Errors of simulation run forward, and what a reader must know about them."""

    channels: dict[str, Channel]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class WindowErrors:
    """Lengths of the errors in the windows of one stretch, (windows, samples without the restart) by channel."""

    run: str
    start_s: np.ndarray
    stop_s: np.ndarray
    channels: dict[str, np.ndarray]


@step("running the simulation forward")
def forward_channels(analysis: Analysis) -> Forward:
    """Errors of every channel that the recording allows, for the three models."""
    vehicle = analysis.recordings.vehicle
    if vehicle.kind != "flight":
        return Forward({})
    segments, notes = _segments(analysis), []
    if not segments:
        return Forward({}, ("No simulation run forward: rotor speeds and body rates are not recorded together.",))
    models = {
        "before": Model(analysis.believed),
        "refitted": Model(analysis.refitted),
        "after": delivered_model(analysis),
    }
    errors: dict[str, list[WindowErrors]] = {}
    for stage, model in models.items():
        try:
            errors[stage] = errors_of(segments, model)
        except InputError as error:
            notes.append(f"Simulation run forward leaves out the effects found: {error}.")
            errors[stage] = errors_of(segments, replace(model, forms=(), chain=(), chain_values=()))
    floor = noise_floor(segments, models["refitted"], sensor_noise(analysis.recordings.runs, analysis.believed))
    channels, part = {}, fitted_part(analysis)
    there = {name for found in errors["before"] for name in found.channels}
    if lacking := [name.replace("_", " ") for name in UNITS if name not in there]:
        notes.append(f"Not run forward for want of recorded columns: {', '.join(lacking)}.")
    for name in filter(there.__contains__, UNITS):
        of_training, of_held_out = (
            Errors(**{stage: _rms(found, name, part, sign) for stage, found in errors.items()}) for sign in (1, -1)
        )
        rmse = SplitErrors(training=of_training, held_out=of_held_out)
        left = [e for e in (rmse.training.after, rmse.held_out.after) if e is not None]
        channels[name] = Channel(
            unit=UNITS[name],
            noise_floor=min([floor[name], *left]) if name in floor else None,
            rmse=rmse,
            p_value=PValues(before=None, after=None),
        )
    return Forward(channels, tuple(notes))


def delivered_model(analysis: Analysis) -> Model:
    """The improved vehicle in the conditions of its runs, read by the instruments as they were found."""
    return model_of(improved_vehicle(analysis), conditions_of(analysis), instruments_of(analysis))


def prove(analysis: Analysis, reloaded: Model, forward: Forward) -> None:
    """Simulate a model read back from its files; RuntimeError unless it makes the errors stated as `after`."""
    segments = _segments(analysis)
    if not forward.channels or not segments or any("leaves out" in note for note in forward.notes):
        return
    errors, part = errors_of(segments, reloaded), fitted_part(analysis)
    for name, channel in forward.channels.items():
        for sign, stated in ((1, channel.rmse.training.after), (-1, channel.rmse.held_out.after)):
            found = _rms(errors, name, part, sign)
            unknown = found is None or stated is None
            if not (found is stated if unknown else abs(found - stated) <= SAME * abs(stated) + 1e-12):
                raise RuntimeError(
                    f"improved_vehicle.yaml read back gives an error of {found} in {name}, the model gave {stated}"
                )


def _segments(analysis: Analysis) -> list[Segment]:
    """Stretches of flight that can be simulated."""
    return [
        s for s in segments_of(analysis) if s.motion.rotor_speed is not None and s.motion.angular_velocity is not None
    ]


def _rms(errors: Sequence[WindowErrors], name: str, part, sign: int) -> float | None:
    """Error over the windows that lie wholly in the fitted (+1) or held-out (-1) part; None without any."""
    own = [e for e in errors if name in e.channels]
    kept = [e.channels[name][(part(e.run, e.start_s) == sign) & (part(e.run, e.stop_s) == sign)] for e in own]
    values = np.concatenate([np.zeros(0), *(k.ravel() for k in kept)])
    return float(np.sqrt(np.mean(values**2))) if len(values) else None


def errors_of(segments: Sequence[Segment], model: Model) -> list[WindowErrors]:
    """Errors of every stretch's windows."""
    return [window_errors(*driven, model) for driven in zip(segments, *driven_by(segments, model), strict=True)]


def driven_by(segments: Sequence[Segment], model: Model) -> tuple[list[Inputs], list[States]]:
    """Inputs and recorded states of every segment, rotor speeds by the model's chain where only commanded."""
    commands = [float(np.nanmax(s.command)) for s in segments if s.command is not None]
    limits = model.vehicle.rotor_speed_limits_rad_s
    full_speed = limits[1] if limits else max(commands, default=1.0)
    voltages = [float(np.nanmax(s.motion.voltage)) for s in segments if s.motion.voltage is not None]
    inputs, states = [], []
    for segment in segments:
        motion = segment.motion
        speed, acceleration = motion.rotor_speed, motion.rotor_acceleration
        if model.chain and not segment.measured_speed and segment.command is not None:
            values = np.asarray(model.chain_values)
            speed = commanded_path(segment, model.chain, values, 0.0, full_speed, max(voltages, default=None))
            acceleration = np.gradient(speed, motion.time_s, axis=0)
        wind = model.conditions.wind(segment.run, motion.time_s) if model.conditions else None
        turning = replace(motion, rotor_speed=speed, wind=wind)
        acting = [(form, v, turning) for form, v in model.forms if remembers(form, v, motion, model.vehicle)]
        for condition, form, v in model.loads:
            aboard = model.conditions.present(condition, segment.run, motion.time_s)
            acting.append((form, v, replace(turning, on_board=aboard)))
        force, moment = _wrench_along(acting, model.vehicle)
        inputs.append(Inputs(speed, acceleration, motion.height, motion.voltage, wind, force, moment))
        states.append(_states(segment, model))
    return inputs, states


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


def remembers(form: Form, values: np.ndarray, motion: Motion, vehicle: Vehicle) -> bool:
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


def predict(segment: Segment, model: Model, inputs: Inputs, states: States):
    """Windows of a segment as the model predicts them."""
    quick = [(f, v) for f, v in model.forms if not remembers(f, v, segment.motion, model.vehicle)]
    return simulate_windows(model.vehicle, quick, segment.motion.time_s, inputs, states, WINDOW_S)


def window_errors(segment: Segment, inputs: Inputs, states: States, model: Model) -> WindowErrors:
    """Errors of the windows of one stretch."""
    windows = predict(segment, model, inputs, states)
    recorded = States(**{n: None if v is None else v[windows.sample] for n, v in vars(states).items()})
    channels = {name: values[:, 1:] for name, values in _between(windows.predicted, recorded).items()}
    time_s = segment.motion.time_s[windows.sample]
    return WindowErrors(segment.run, time_s[:, 0], time_s[:, -1], {n: v for n, v in channels.items() if v.size})


def noise_floor(segments: Sequence[Segment], model: Model, noise: SensorNoise) -> dict[str, float]:
    """Error of each channel that sensor noise alone makes, in the channel's unit."""
    rng = np.random.default_rng(0)
    squares: dict[str, list[np.ndarray]] = {}
    for segment, inputs, states in zip(segments, *driven_by(segments, model), strict=True):
        shaken_inputs = replace(inputs, rotor_speed=_shaken(inputs.rotor_speed, noise.get("rotors"), rng))
        shaken = States(
            _shaken(states.angular_velocity, noise.get("gyroscope"), rng),
            _unit(_shaken(states.quaternion, noise.get("attitude"), rng)),
            _shaken(states.velocity, noise.get("velocity"), rng),
            _shaken(states.position, noise.get("position"), rng),
        )
        windows = predict(segment, model, shaken_inputs, shaken)
        calm = predict(segment, model, inputs, states)
        if windows.sample.shape != calm.sample.shape:
            continue
        drift = _between(windows.predicted, calm.predicted)
        reading = _between(shaken, states)
        for name, values in drift.items():
            squares.setdefault(name, []).append((values[:, 1:] ** 2).ravel() + np.mean(reading[name] ** 2))
    return {name: float(np.sqrt(np.concatenate(parts).mean())) for name, parts in squares.items()}


def _between(a: States, b: States) -> dict[str, np.ndarray]:
    """Lengths of the differences of two sets of states, for what both have."""
    out = {}
    for name in ("position", "velocity", "angular_velocity"):
        if getattr(a, name) is not None and getattr(b, name) is not None:
            out[name] = np.linalg.norm(getattr(a, name) - getattr(b, name), axis=-1)
    if a.quaternion is not None and b.quaternion is not None:
        out["attitude"] = 2.0 * np.arccos(np.clip(np.abs((a.quaternion * b.quaternion).sum(axis=-1)), 0.0, 1.0))
    return out


def _unit(quaternion: np.ndarray | None) -> np.ndarray | None:
    return None if quaternion is None else quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True)


def _shaken(values: np.ndarray | None, sigma: np.ndarray | None, rng) -> np.ndarray | None:
    return values if values is None or sigma is None else values + sigma * rng.standard_normal(values.shape)
