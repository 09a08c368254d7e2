"""Errors of the accelerometer: bias, scale, misalignment."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter


def bias(motion, vehicle, values):
    """a_m = a + b."""
    return Contribution(specific_force=np.broadcast_to(np.asarray(values, float), (motion.size, 3)))


def scale(motion, vehicle, values):
    """a_m = (1 + s) a per axis."""
    return Contribution(specific_force=np.asarray(values) * motion.accelerometer)


def _misalignment(motion, vehicle, values):
    """a_m = a + θ × a: the sensor is turned by small angles θ."""
    return Contribution(specific_force=np.cross(np.asarray(values, float)[None, :], motion.accelerometer))


def _all_errors(motion, vehicle, values):
    """a_m = (1 + s) a + θ × a + b."""
    total = (
        bias(motion, vehicle, values[:3]).specific_force
        + scale(motion, vehicle, values[3:6]).specific_force
        + _misalignment(motion, vehicle, values[6:9]).specific_force
    )
    return Contribution(specific_force=total)


def forms(vehicle):
    needs = ("accelerometer",)

    def each(symbol, unit, low, high, meaning, negligible):
        return tuple(
            Parameter(f"{symbol}_{a}", unit, low, high, meaning=f"{meaning} {a}", negligible=negligible) for a in "xyz"
        )

    # Data sheets allow 1 m/s2 and 3 %; far beyond it is another unit or axis (mistakes), or a sensor taken for another.
    b = each("b", "m/s2", -4.0, 4.0, "bias along", 0.01)
    s = each("s", "1", -0.2, 0.2, "scale error along", 0.003)
    t = each("theta", "rad", -0.5, 0.5, "turn of the sensor about", 0.001)
    bias_too = ("always",)
    return (
        Form("bias", "a_m = a + b", b, bias, needs, excited_by=bias_too),
        Form("scale", "a_m = (1 + s) a", s, scale, needs),
        Form("misalignment", "a_m = a + θ × a", t, _misalignment, needs),
        Form(
            "bias, scale and misalignment",
            "a_m = (1 + s) a + θ × a + b",
            b + s + t,
            _all_errors,
            needs,
            excited_by=bias_too,
        ),
    )


EFFECT = Effect(
    id="accelerometer_error",
    name="an error of the accelerometer",
    sentence="the accelerometer reads a constant, a factor or a tilt off",
    forms=forms,
    shows_in=("lift", "lift_of_throttle", "lift_without_voltage", "sideways", "accelerometer"),
    source="Titterton and Weston, Strapdown Inertial Navigation Technology, 2nd ed., ch. 4; catalogue F21",
    sign=("positive b and s make the reading larger along the axis; θ is a right-handed turn of the reading"),
    validity=(
        "constant over a recording and small turns (below 0.5 rad); temperature and g-sensitive drift "
        "are left out. With the accelerometer as only source of force, a bias equals a constant force "
        "and a scale error equals a wrong mass"
    ),
    excited_by=("accelerometer",),
    confusers=("thrust_tilt", "steady_wind"),
    separating_manoeuvre="a static six-face calibration",
    separating_columns=("position",),
    kind="sensor",
    # Ten kelvin of half a milli-g a kelvin (35 mg over 70 K: InvenSense MPU-6000, product specification, 6.2); 0.02
    # to 0.06 between flights of two laboratories (docs/compare.md). How much it turns on its mount is assumed.
    between_flights={"m/s2": 0.05, "rad": 0.003},
    cases=("single/accelerometer_error/moderate/0", "single/thrust_tilt/strong/0"),
)
