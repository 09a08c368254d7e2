"""Errors of the accelerometer: bias, scale, misalignment."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter


def bias(motion, vehicle, values):
    """a_m = a + b."""
    return Contribution(specific_force=np.broadcast_to(np.asarray(values, float), (motion.size, 3)))


def scale(motion, vehicle, values):
    """a_m = (1 + s) a per axis."""
    return Contribution(specific_force=np.asarray(values) * motion.accelerometer)


def misalignment(motion, vehicle, values):
    """a_m = a + θ × a: the sensor is turned by small angles θ."""
    return Contribution(specific_force=np.cross(np.asarray(values, float)[None, :], motion.accelerometer))


def all_errors(motion, vehicle, values):
    """a_m = (1 + s) a + θ × a + b."""
    total = (
        bias(motion, vehicle, values[:3]).specific_force
        + scale(motion, vehicle, values[3:6]).specific_force
        + misalignment(motion, vehicle, values[6:9]).specific_force
    )
    return Contribution(specific_force=total)


def forms(vehicle):
    needs = ("accelerometer",)
    b = tuple(Parameter(f"b_{a}", "m/s2", -20.0, 20.0, negligible=0.01) for a in "xyz")
    s = tuple(Parameter(f"s_{a}", "1", -0.9, 2.0, negligible=0.003) for a in "xyz")
    t = tuple(Parameter(f"theta_{a}", "rad", -0.5, 0.5, negligible=0.001) for a in "xyz")
    return (
        Form("bias", "a_m = a + b", b, bias, needs),
        Form("scale", "a_m = (1 + s) a", s, scale, needs),
        Form("misalignment", "a_m = a + θ × a", t, misalignment, needs),
        Form("bias, scale and misalignment", "a_m = (1 + s) a + θ × a + b", b + s + t, all_errors, needs),
    )


EFFECT = Effect(
    id="accelerometer_error",
    name="an error of the accelerometer",
    sentence="the accelerometer reads a constant, a factor or a tilt off",
    forms=forms,
    source="physics.md F21",
    confusers=("thrust_tilt", "steady_wind"),
    separating_manoeuvre="a static six-face calibration, or record position beside the accelerometer",
    kind="sensor",
)
