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


def _misalignment(motion, vehicle, values):
    """Ω_m = Ω + θ × Ω."""
    turn = np.asarray(values, float)[None, :]
    return Contribution(
        angular_velocity=np.cross(turn, motion.angular_velocity),
        angular_acceleration=np.cross(turn, motion.angular_acceleration),
    )


def _bias_and_scale(motion, vehicle, values):
    """Ω_m = (1 + s) Ω + b."""
    scaled = scale(motion, vehicle, values[3:])
    return Contribution(
        angular_velocity=bias(motion, vehicle, values[:3]).angular_velocity + scaled.angular_velocity,
        angular_acceleration=scaled.angular_acceleration,
    )


def forms(vehicle):
    needs = ("gyroscope", "rotation", "angular_velocity", "angular_acceleration")

    def each(symbol, unit, low, high, meaning, negligible):
        return tuple(
            Parameter(f"{symbol}_{a}", unit, low, high, meaning=f"{meaning} {a}", negligible=negligible) for a in "xyz"
        )

    b = each("b", "rad/s", -5.0, 5.0, "bias about", 0.001)
    # Data sheets allow 3 %; beyond a fifth it is another unit or another axis (mistakes), not a scale.
    s = each("s", "1", -0.2, 0.2, "scale error about", 0.005)
    t = each("theta", "rad", -0.5, 0.5, "turn of the sensor about", 0.003)
    return (
        Form("bias", "Ω_m = Ω + b", b, bias, needs[:2], excited_by=("always",)),
        Form("scale", "Ω_m = (1 + s) Ω", s, scale, needs, of_reading=((0, 0), (1, 1), (2, 2))),
        Form("misalignment", "Ω_m = Ω + θ × Ω", t, _misalignment, needs),
        Form(
            "bias and scale",
            "Ω_m = (1 + s) Ω + b",
            b + s,
            _bias_and_scale,
            needs,
            of_reading=((0, 3), (1, 4), (2, 5), (3, 3), (4, 4), (5, 5)),
            excited_by=("always",),
        ),
    )


EFFECT = Effect(
    id="gyro_error",
    name="an error of the gyroscope",
    sentence="the gyroscope disagrees with the turning of the attitude",
    forms=forms,
    shows_in=("gyroscope", "gyroscope_scale", "gyroscope_turn"),
    source="Titterton and Weston, Strapdown Inertial Navigation Technology, 2nd ed., ch. 4; catalogue F23",
    sign=("positive b and s make the reading larger about the axis; θ is a right-handed turn of the reading"),
    validity=(
        "constant over a recording and small turns; identified by the attitude that is recorded, too, so attitude "
        "must not come from the same gyroscope alone"
    ),
    excited_by=("angular_velocity", "angular_acceleration"),
    confusers=("inertia_products",),
    separating_manoeuvre="record ten seconds at rest before take-off",
    kind="sensor",
    # Zeros: against the recorded attitude they differ by 0.001 rad/s between four flights of NeuroBEM, by 0.003 between
    # six of imrc's, widened for so few. Alignment: assumed, of a board on rubber that turns a little.
    between_flights={"rad/s": 0.004, "rad": 0.003},
    cases=("single/gyro_error/weak/0", "single/inertia_products/moderate/0"),
)
