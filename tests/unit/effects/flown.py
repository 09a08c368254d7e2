"""Simulated flights for the audit of the catalogue: short, hard, and the same for every effect."""

from functools import cache

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import Form, Motion, SpeedForm
from rotorid.mismatch.evidence.motion import Segment
from rotorid.recordings import Vehicle
from rotorid.vehicle.improved import simulate_as_stated
from rotorid.vehicle.simulator import Commands, Start, Trace, motion_of
from tests.unit.vehicle.thesis import thesis_vehicle

STEP_S = 0.004
DURATION_S = 0.6
VEHICLES = 8
HOVER = float(np.sqrt(0.652 * 9.81 / (4 * 1.3877e-6)))


def audit_vehicle(**changes) -> Vehicle:
    """The thesis's quadrotor over ground at z = 0, with everything stated that any effect asks for."""
    stated = dict(rotor_radius_m=0.0635, rotor_inertia_kg_m2=8.5e-6, ground_z_m=0.0, rotor_speed_limits_rad_s=(0, 2500))
    return thesis_vehicle(**(stated | changes))


@cache
def commands() -> Commands:
    """Rotor speeds that excite every axis: sums of sines about hover, each rotor its own, up to 12 Hz."""
    time_s = STEP_S * np.arange(int(DURATION_S / STEP_S) + 1)
    rng = np.random.default_rng(5)
    frequency = rng.uniform(1.0, 12.0, (6, 4))
    phase = rng.uniform(0, 2 * np.pi, (6, 4))
    waves = np.sin(2 * np.pi * frequency * time_s[:, None, None] + phase).sum(axis=1)
    return Commands(time_s, HOVER * (1.0 + 0.06 * waves))


@cache
def start() -> Start:
    """Eight starts: half of them slow and near the ground, half fast and high, two of these in a steep descent."""
    rng = np.random.default_rng(6)
    velocity = rng.uniform(-1.5, 1.5, (VEHICLES, 3))
    velocity[4:, :2] = rng.uniform(-8, 8, (4, 2))
    velocity[6:] = [[0.5, -0.5, 5.0], [-0.4, 0.8, 7.0]]
    position = np.zeros((VEHICLES, 3))
    position[:, 2] = [-0.6, -0.8, -1.0, -1.2, -50, -50, -50, -50]
    euler = rng.uniform(-0.3, 0.3, (VEHICLES, 3))
    euler[:, 2] = rng.uniform(-np.pi, np.pi, VEHICLES)
    return Start(position, velocity, euler, rng.uniform(-2, 2, (VEHICLES, 3)))


def entry(effect_id: str, form, values) -> dict:
    """An entry under `effects` of a vehicle file."""
    parameters = {p.symbol: float(v) for p, v in zip(form.parameters, values, strict=True)}
    return {"id": effect_id, "form": form.name, "parameters": parameters}


_FLOWN: dict[str, Trace] = {}


def fly(effect_id: str = "", form: Form | None = None) -> Trace:
    """The flight of a vehicle whose file states one effect with its typical values, or none; flown once each."""
    key = f"{effect_id}/{form.name if form else ''}"
    if key not in _FLOWN:
        effects = (entry(effect_id, form, typical_values(effect_id, form)),) if form else ()
        if form and catalogue()[effect_id].kind == "sensor":
            # Sideways forces, so that errors of the horizontal accelerometers show.
            effects += ({"id": "rotor_drag", "form": "independent of rotor speed", "parameters": {"d": 0.5}},)
        stated = audit_vehicle(effects=effects)
        _FLOWN[key] = simulate_as_stated(stated, commands(), DURATION_S, STEP_S, start=start())
    return _FLOWN[key]


def motions(trace: Trace) -> list[Motion]:
    """True flights of all vehicles of a trace."""
    return [motion_of(trace, i, audit_vehicle()) for i in range(len(trace.position))]


def segment(motion: Motion, **changes) -> Segment:
    """A stretch of recording that reads the truth, force from the accelerometer."""
    return Segment("run", 1.0 / STEP_S, motion, "accelerometer", **changes)


def typical_values(effect_id: str, form: Form | SpeedForm) -> np.ndarray:
    """Plain values of a form's parameters: a starting value of the nonlinear ones, a small share of the bounds else."""
    share = {"gust": 2e-3, "payload": 0.05, "com_offset": 0.05, "accelerometer_error": 0.05, "gyro_error": 0.02}.get(
        effect_id, 0.1
    )
    values = []
    for number, p in enumerate(form.parameters):
        if p.nonlinear:
            values.append(1.17 * p.starts[len(p.starts) // 2])
        elif p.low < 0:
            values.append(share * min(p.high, -p.low) * (1.0, -0.7, 0.4, -0.25)[number % 4])
        else:
            values.append(share * p.high * (1.0, 0.7, 0.5)[number % 3])
    return np.array(values)
