"""Rotors that are not alike: thrust or torque coefficients differ between them."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter, at_hubs


def _thrust(motion, vehicle, weights):
    thrust = vehicle.thrust_coefficients_n_s2() * motion.rotor_speed**2
    forces = np.zeros((*thrust.shape, 3))
    forces[:, :, 2] = -weights * thrust
    return at_hubs(forces, vehicle.rotor_positions_m())


def _torque(motion, vehicle, weights):
    torque = vehicle.torque_coefficients_n_m_s2() * vehicle.yaw_signs() * motion.rotor_speed**2
    moment = np.zeros((motion.size, 3))
    moment[:, 2] = (weights * torque).sum(axis=1)
    return moment


def both(motion, vehicle, values):
    """C_F,i = C_F (1 + d_i), C_Q,i = C_Q (1 + d_i): one blade shape scales both."""
    weights = np.asarray(values, float)
    wrench = _thrust(motion, vehicle, weights)
    return Contribution(wrench.force, wrench.moment + _torque(motion, vehicle, weights))


def thrust_only(motion, vehicle, values):
    """C_F,i = C_F (1 + d_i)."""
    return _thrust(motion, vehicle, np.asarray(values))


def torque_only(motion, vehicle, values):
    """C_Q,i = C_Q (1 + d_i)."""
    return Contribution(moment=_torque(motion, vehicle, np.asarray(values)))


def _contrast(function):
    """The differences between rotors alone: what all share is a wrong coefficient, not a difference."""

    def contrast(motion, vehicle, values):
        weights = np.asarray(values, float)
        return function(motion, vehicle, weights - weights.mean())

    return contrast


def _one(k, count, function):
    def single(motion, vehicle, values):
        weights = np.zeros(count)
        weights[k] = values[0]
        return function(motion, vehicle, weights)

    return single


def forms(vehicle):
    needs = ("rotor_speed",)
    count = vehicle.rotor_count
    symbols = tuple(Parameter(f"d_{i + 1}", "1", -0.9, 2.0) for i in range(count))
    text = "C_F,{0} = C_F (1 + d_{0}), C_Q,{0} = C_Q (1 + d_{0})"
    singles = [
        Form(f"rotor {i + 1}", text.format(i + 1), (symbols[i],), _one(i, count, both), needs, (), 2)
        for i in range(count)
    ] + [
        Form(
            f"thrust of rotor {i + 1}",
            f"C_F,{i + 1} = C_F (1 + d_{i + 1})",
            (symbols[i],),
            _one(i, count, thrust_only),
            needs,
            (),
            2,
        )
        for i in range(count)
    ]
    return (
        *singles,
        Form("thrust and torque", text.format("i"), symbols, _contrast(both), needs, (), 2),
        Form("thrust", "C_F,i = C_F (1 + d_i)", symbols, _contrast(thrust_only), needs, (), 2),
        Form("torque", "C_Q,i = C_Q (1 + d_i)", symbols, _contrast(torque_only), needs, (), 2),
    )


EFFECT = Effect(
    id="unequal_rotors",
    name="a difference between the rotors",
    sentence="one or more rotors give more or less thrust than the others",
    forms=forms,
    source="physics.md F17",
    confusers=("com_offset", "thrust_tilt"),
    separating_manoeuvre="swap two propellers and repeat the hover, or excite roll, pitch and yaw",
)
