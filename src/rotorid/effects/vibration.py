"""Vibration of the rotors in the inertial sensors.

Recognised before the physics (rotorid.mismatch.mistakes); it is no wrench.
"""

import numpy as np
from scipy.integrate import cumulative_trapezoid

from rotorid.effects.contract import Effect, Parameter, SetForm, with_columns
from rotorid.recordings import columns as c


def _shaken(names):
    def apply(recordings, values):
        def change(run, columns):
            speeds = run.array(c.rotor_columns("rotor_speed", recordings.vehicle.rotor_count))
            phase = cumulative_trapezoid(speeds, run.time_s, axis=0, initial=0.0)
            # Rotors start at different angles; one radian apart stands for "no relation between them".
            waves = np.cos(phase + np.arange(phase.shape[1])).sum(axis=1)
            return columns + waves[:, None] * np.asarray(values)

        return with_columns(recordings, names, change)

    return apply


def set_forms(vehicle):
    def form(sensor, symbol, unit, most, names):
        parameters = tuple(
            Parameter(f"A_{a}", unit, 0.0, most, meaning=f"amplitude of each rotor's line along {a}") for a in "xyz"
        )
        equation = f"{symbol}_m = {symbol} + A Σ cos ∫ω_i dt"
        return SetForm(sensor, equation, parameters, _shaken(names), (0.0, 0.0, 0.0), (most / 200, 0.0, 0.0), names)

    return (
        form("accelerometer", "a", "m/s2", 100.0, c.SPECIFIC_FORCE),
        form("gyroscope", "Ω", "rad/s", 10.0, c.ANGULAR_VELOCITY),
    )


EFFECT = Effect(
    id="vibration",
    name="vibration of the rotors",
    sentence="a line that follows the rotors' speed, or its alias, stands in the inertial sensors",
    forms=lambda vehicle: (),
    set_forms=set_forms,
    sign="A is an amplitude, without sign",
    validity="first order of the rotors only; at low sample rates the line is seen at its alias",
    source="imbalance of rotors (once per revolution); catalogue F24",
    confusers=("thrust_curve", "accelerometer_error"),
    separating_manoeuvre="balance the propellers, or hover at several speeds of the rotors",
    kind="sensor",
    cases=("single/vibration/moderate/0", "single/accelerometer_error/moderate/0"),
)
