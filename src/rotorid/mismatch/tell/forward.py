"""Simulation run forward in windows of half a second restarted from the recording: how far it drifts off.

Four models are compared on the same windows: the believed vehicle, the refitted one, that one with what is named, and
the one that is delivered. The noise floor is what
the sensors' own noise would make of a perfect model: the simulation is started and driven once more with as much
white noise again, and the recorded side's noise is added. It is never put above what the improved model leaves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rotorid.errors import InputError
from rotorid.mismatch.decide.findings import Analysis
from rotorid.mismatch.decide.sizes import fitted_part, segments_of
from rotorid.mismatch.deliver.files import (
    claimed,
    conditions_of,
    improved_vehicle,
    instruments_of,
    place_of,
    with_effects,
)
from rotorid.mismatch.deliver.flown import UNITS, Model, WindowErrors, between, driven_by, errors_of, model_of, predict
from rotorid.mismatch.evidence.motion import Segment, SensorNoise
from rotorid.mismatch.flight.prepare import sensor_noise
from rotorid.mismatch.tell.verdict import Channel, channel_of
from rotorid.steps import step
from rotorid.vehicle.windows import States


@step("running the simulation forward")
def forward_channels(analysis: Analysis) -> tuple[dict[str, Channel], tuple[str, ...]]:
    """Errors of every channel that the recording allows, for the four models, and what a reader must know of them."""
    vehicle = analysis.recordings.vehicle
    if vehicle.kind != "flight":
        return {}, ()
    segments, notes = simulated_segments(analysis), []
    if not segments:
        return {}, ("No simulation run forward: rotor speeds and body rates are not recorded together.",)
    named = with_effects(analysis.named, [f for f in claimed(analysis.findings) if place_of(f) == "vehicle"])
    models = {
        "before": Model(analysis.believed),
        "refitted": Model(analysis.refitted),
        # All that is claimed in the conditions of the runs, whatever is delivered.
        "named": model_of(named, conditions_of(analysis), instruments_of(analysis)),
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
        both = ({stage: _rms(found, name, part, sign) for stage, found in errors.items()} for sign in (1, -1))
        channels[name] = channel_of(UNITS[name], floor.get(name), *both)
    return channels, tuple(notes)


def delivered_model(analysis: Analysis) -> Model:
    """The improved vehicle in the conditions of its runs, read by the instruments as they were found."""
    return model_of(improved_vehicle(analysis), conditions_of(analysis), instruments_of(analysis))


def prove(analysis: Analysis, reloaded: Model, channels: Mapping[str, Channel], notes: Sequence[str]) -> None:
    """Simulate a model read back from its files; RuntimeError unless it makes the errors stated as `after`.

    `channels` and `notes` are those of `forward_channels`.
    """
    # Relative difference above which a vehicle read back is not the model written (errors are stated to six digits).
    same = 1e-5
    segments = simulated_segments(analysis)
    if not channels or not segments or any("leaves out" in note for note in notes):
        return
    errors, part = errors_of(segments, reloaded), fitted_part(analysis)
    for name, channel in channels.items():
        for sign, stated in ((1, channel.rmse.training.after), (-1, channel.rmse.held_out.after)):
            found = _rms(errors, name, part, sign)
            unknown = found is None or stated is None
            if not (found is stated if unknown else abs(found - stated) <= same * abs(stated) + 1e-12):
                raise RuntimeError(
                    f"improved_vehicle.yaml read back gives an error of {found} in {name}, the model gave {stated}"
                )


def simulated_segments(analysis: Analysis) -> list[Segment]:
    """Stretches of flight that can be simulated."""
    return [
        s for s in segments_of(analysis) if s.motion.rotor_speed is not None and s.motion.angular_velocity is not None
    ]


def _rms(errors: Sequence[WindowErrors], name: str, part, sign: int) -> float | None:
    """Error over the windows that lie wholly in the fitted (+1) or held-out (-1) part; None without any, and where a
    simulation left all bounds."""
    own = [e for e in errors if name in e.channels]
    kept = [e.channels[name][(part(e.run, e.start_s) == sign) & (part(e.run, e.stop_s) == sign)] for e in own]
    values = np.concatenate([np.zeros(0), *(k.ravel() for k in kept)])
    error = float(np.sqrt(np.mean(values**2))) if len(values) else np.nan
    return error if np.isfinite(error) else None


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
        drift = between(windows.predicted, calm.predicted)
        reading = between(shaken, states)
        for name, values in drift.items():
            squares.setdefault(name, []).append((values[:, 1:] ** 2).ravel() + np.mean(reading[name] ** 2))
    return {name: float(np.sqrt(np.concatenate(parts).mean())) for name, parts in squares.items()}


def _unit(quaternion: np.ndarray | None) -> np.ndarray | None:
    return None if quaternion is None else quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True)


def _shaken(values: np.ndarray | None, sigma: np.ndarray | None, rng) -> np.ndarray | None:
    return values if values is None or sigma is None else values + sigma * rng.standard_normal(values.shape)
