"""Thrust that is not proportional to the squared rotor speed."""

import numpy as np

from rotorid.effects.contract import Effect, Form, Parameter, at_hubs


def _thrust(extra, vehicle):
    forces = np.zeros((*extra.shape, 3))
    forces[:, :, 2] = -extra
    return at_hubs(forces, vehicle.rotor_positions_m())


def linear_term(motion, vehicle, values):
    """T_i += c_1 ω_i."""
    return _thrust(values[0] * motion.rotor_speed, vehicle)


def constant_term(motion, vehicle, values):
    """T_i += c_0."""
    return _thrust(values[0] * np.ones_like(motion.rotor_speed), vehicle)


def linear_and_constant(motion, vehicle, values):
    """T_i += c_0 + c_1 ω_i."""
    return _thrust(values[0] + values[1] * motion.rotor_speed, vehicle)


def cubic_term(motion, vehicle, values):
    """T_i += c_3 ω_i³."""
    return _thrust(values[0] * motion.rotor_speed**3, vehicle)


def forms(vehicle):
    needs = ("rotor_speed",)
    c0, c1 = Parameter("c_0", "N"), Parameter("c_1", "N s/rad")
    return (
        Form("linear term", "T_i = C_F ω_i² + c_1 ω_i", (c1,), linear_term, needs),
        Form("constant term", "T_i = C_F ω_i² + c_0", (c0,), constant_term, needs),
        Form("linear and constant", "T_i = C_F ω_i² + c_1 ω_i + c_0", (c0, c1), linear_and_constant, needs),
        Form(
            "cubic term",
            "T_i = C_F ω_i² + c_3 ω_i³",
            (Parameter("c_3", "N s3/rad3"),),
            cubic_term,
            needs,
        ),
    )


EFFECT = Effect(
    id="thrust_curve",
    name="a thrust curve that is not a pure square",
    sentence="thrust is off by an amount that depends on rotor speed alone",
    forms=forms,
    source="physics.md F3; Bitcraze thrust fits",
    confusers=("axial_inflow", "translational_lift"),
    separating_manoeuvre="step the throttle over the widest range of rotor speeds",
)
