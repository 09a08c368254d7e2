"""Errors of the gyroscope: bias, scale, misalignment."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter


def bias(motion, vehicle, values):
    """Ω_m = Ω + b."""
    return Contribution(angular_velocity=np.broadcast_to(np.asarray(values, float), (motion.size, 3)))


def scale(motion, vehicle, values):
    """Ω_m = (1 + s) Ω per axis."""
    factor = np.asarray(values)
    return Contribution(
        angular_velocity=factor * motion.angular_velocity, angular_acceleration=factor * motion.angular_acceleration
    )


def misalignment(motion, vehicle, values):
    """Ω_m = Ω + θ × Ω."""
    turn = np.asarray(values, float)[None, :]
    return Contribution(
        angular_velocity=np.cross(turn, motion.angular_velocity),
        angular_acceleration=np.cross(turn, motion.angular_acceleration),
    )


def forms(vehicle):
    needs = ("gyroscope", "rotation")
    return (
        Form(
            "bias",
            "Ω_m = Ω + b",
            tuple(Parameter(f"b_{a}", "rad/s", -5.0, 5.0, negligible=0.001) for a in "xyz"),
            bias,
            needs,
        ),
        Form(
            "scale",
            "Ω_m = (1 + s) Ω",
            tuple(Parameter(f"s_{a}", "1", -0.9, 2.0, negligible=0.005) for a in "xyz"),
            scale,
            needs,
        ),
        Form(
            "misalignment",
            "Ω_m = Ω + θ × Ω",
            tuple(Parameter(f"theta_{a}", "rad", -0.5, 0.5, negligible=0.003) for a in "xyz"),
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
