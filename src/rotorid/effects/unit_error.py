"""Columns in another unit than their name says.

Recognised before the physics (rotorid.mismatch.mistakes); it is no wrench.
"""

import numpy as np

from rotorid.effects.contract import Effect, Parameter, SetForm, with_columns
from rotorid.recordings import columns as c


def _factor(what, names, example):
    def apply(recordings, values):
        return with_columns(recordings, names, lambda run, columns: values[0] * columns)

    parameter = Parameter("f", "1", 1e-4, 1e4, meaning="number of the column's units in one of the contract's")
    return SetForm(what, "column = f · value", (parameter,), apply, (1.0,), (example,), names)


def set_forms(vehicle):
    count = vehicle.rotor_count
    rpm, degrees, g, milli = 60 / (2 * np.pi), 180 / np.pi, 1 / 9.80665, 1000.0
    return (
        _factor("rotor speeds", c.rotor_columns("rotor_speed", count), rpm),
        _factor("rotor commands", c.rotor_columns("rotor_command", count), rpm),
        _factor("throttle", c.rotor_columns("throttle", count), 100.0),
        _factor("gyroscope", c.ANGULAR_VELOCITY, degrees),
        _factor("accelerometer", c.SPECIFIC_FORCE, g),
        _factor("velocity", c.VELOCITY, milli),
        _factor("position", c.POSITION, milli),
        _factor("height", (c.HEIGHT,), milli),
        _factor("battery voltage", (c.BATTERY_VOLTAGE,), milli),
    )


EFFECT = Effect(
    id="unit_error",
    name="a column in the wrong unit",
    sentence="a column is larger or smaller than it can be by a unit's own factor",
    forms=lambda vehicle: (),
    set_forms=set_forms,
    sign="f is what the column was multiplied with (rpm for rad/s: 9.55; g for m/s²: 0.102; degrees: 57.3)",
    validity="factors of known units beyond a factor of three; smaller ones are wrong values or scale errors",
    source="kinematics, gravity and weight; recording contract (mistakes)",
    confusers=("accelerometer_error", "gyro_error"),
    separating_manoeuvre="hover at rest: the accelerometer must read gravity and the rotors must carry the weight",
    kind="mistake",
    fitted=False,
    contradiction=True,
    cases=("mistake/unit_error/mm/12", "single/accelerometer_error/moderate/0"),
)
