"""Thrust not along the body's z axis."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter, at_hubs, rotor_thrusts


def _forces(motion, vehicle, tilt_x, tilt_y):
    thrust = rotor_thrusts(motion, vehicle)
    forces = np.zeros((*thrust.shape, 3))
    forces[:, :, 0] = thrust * tilt_x
    forces[:, :, 1] = thrust * tilt_y
    return forces


def _tilted(motion, vehicle, tilt_x, tilt_y, weight):
    """Tilted thrust at the hubs and the reaction torques, which lean with their axes; `weight` (k,) picks rotors."""
    thrust = at_hubs(_forces(motion, vehicle, tilt_x, tilt_y) * weight[None, :, None], vehicle.rotor_positions_m())
    torque = motion.rotor_speed**2 @ (vehicle.torque_coefficients_n_m_s2() * vehicle.yaw_signs() * weight)
    leaning = -torque[:, None] * np.array([[tilt_x, tilt_y, 0.0]])
    return Contribution(force=thrust.force, moment=thrust.moment + leaning)


def at_the_hubs(motion, vehicle, values):
    """F_i += T_i (ε_x, ε_y, 0) at each hub, M_i −= ±Q_i (ε_x, ε_y, 0); small angles, all rotors alike."""
    return _tilted(motion, vehicle, values[0], values[1], np.ones(vehicle.rotor_count))


def thrust_alone(motion, vehicle, values):
    """F_i += T_i (ε_x, ε_y, 0) at each hub, reaction torques upright: what flows off the rotor leans, not the motor."""
    return at_hubs(_forces(motion, vehicle, values[0], values[1]), vehicle.rotor_positions_m())


def force_only(motion, vehicle, values):
    """F = T (ε_x, ε_y, 0) at the centre of mass."""
    return Contribution(force=_forces(motion, vehicle, values[0], values[1]).sum(axis=1))


def _single(k):
    def one(motion, vehicle, values):
        return _tilted(motion, vehicle, values[0], values[1], np.eye(vehicle.rotor_count)[k])

    return one


def forms(vehicle):
    tilt = tuple(Parameter(f"eps_{a}", "rad", -0.5, 0.5, meaning=f"tilt of the thrust along {a}") for a in "xy")
    needs = ("rotor_speed",)
    singles = [
        Form(f"rotor {k + 1}", f"F_{k + 1} = T_{k + 1} (ε_x, ε_y, −1)", tilt, _single(k), needs, (), 2)
        for k in range(vehicle.rotor_count)
    ]
    return (
        Form("all rotors, at the hubs", "F_i = T_i (ε_x, ε_y, −1)", tilt, at_the_hubs, needs),
        Form(
            "all rotors, at the hubs, thrust alone",
            "F_i = T_i (ε_x, ε_y, −1), torques upright",
            tilt,
            thrust_alone,
            needs,
        ),
        Form("all rotors, at the centre of mass", "F = T (ε_x, ε_y, −1)", tilt, force_only, needs),
        *singles,
    )


EFFECT = Effect(
    id="thrust_tilt",
    name="a tilted thrust axis",
    sentence="a sideways force proportional to thrust",
    forms=forms,
    source="rigid-body mechanics, small angles; catalogue F16",
    sign="positive ε_x pushes forward, positive ε_y to the right",
    validity="angles below about 0.3 rad (loss of lift of second order left out), constant",
    excited_by=("rotor_speed",),
    confusers=("accelerometer_error", "steady_wind", "com_offset"),
    separating_manoeuvre="record position beside the accelerometer while yawing through 360 degrees",
)
