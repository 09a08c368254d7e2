"""Errors of the gyroscope: bias, scale, misalignment."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter


def bias(motion, vehicle, values):
    """Ω_m = Ω + b."""
    return Contribution(angular_velocity=np.broadcast_to(np.asarray(values, float), (motion.size, 3)))


def scale(motion, vehicle, values):
    """Ω_m = (1 + s) Ω per axis."""
    return Contribution(angular_velocity=np.asarray(values) * motion.angular_velocity)


def misalignment(motion, vehicle, values):
    """Ω_m = Ω + θ × Ω."""
    return Contribution(angular_velocity=np.cross(np.asarray(values, float)[None, :], motion.angular_velocity))


def forms(vehicle):
    needs = ("gyroscope", "rotation")
    return (
        Form("bias", "Ω_m = Ω + b", tuple(Parameter(f"b_{a}", "rad/s") for a in "xyz"), bias, needs),
        Form(
            "scale",
            "Ω_m = (1 + s) Ω",
            tuple(Parameter(f"s_{a}", "1", -0.9, 2.0) for a in "xyz"),
            scale,
            needs,
        ),
        Form(
            "misalignment",
            "Ω_m = Ω + θ × Ω",
            tuple(Parameter(f"theta_{a}", "rad", -0.5, 0.5) for a in "xyz"),
            misalignment,
            needs,
        ),
    )


EFFECT = Effect(
    id="gyro_error",
    name="an error of the gyroscope",
    sentence="the gyroscope disagrees with the turning of the attitude",
    forms=forms,
    source="physics.md F23",
    confusers=("inertia_products",),
    separating_manoeuvre="record ten seconds at rest before take-off",
    kind="sensor",
)
