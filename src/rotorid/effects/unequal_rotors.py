"""Rotors that are not alike: thrust or torque coefficients differ between them."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter, lift_at_hubs, rotor_thrusts


def _thrust(motion, vehicle, weights):
    return lift_at_hubs(weights * rotor_thrusts(motion, vehicle), vehicle)


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
    """The differences between rotors alone: what all share is a wrong coefficient, not a difference.

    The last rotor's share is minus the sum of the others'; with one more parameter the common part would be free
    although nothing shows it, and the normal equations singular.
    """

    def contrast(motion, vehicle, values):
        return function(motion, vehicle, np.append(values, -np.sum(values)))

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
    symbols = tuple(Parameter(f"d_{i + 1}", "1", -0.9, 2.0, meaning=f"excess of rotor {i + 1}") for i in range(count))
    both_text = "C_F,{0} = C_F (1 + d_{0}), C_Q,{0} = C_Q (1 + d_{0})"
    thrust_text, torque_text = "C_F,{0} = C_F (1 + d_{0})", "C_Q,{0} = C_Q (1 + d_{0})"
    singles = [
        Form(name.format(i + 1), text.format(i + 1), (symbols[i],), _one(i, count, function), needs, (), 2)
        for name, text, function in (("rotor {}", both_text, both), ("thrust of rotor {}", thrust_text, thrust_only))
        for i in range(count)
    ]
    free, closed = symbols[:-1], ", Σ d_i = 0"
    return (
        *singles,
        Form("thrust and torque", both_text.format("i") + closed, free, _contrast(both), needs, (), 2),
        Form("thrust", thrust_text.format("i") + closed, free, _contrast(thrust_only), needs, (), 2),
        Form("torque", torque_text.format("i") + closed, free, _contrast(torque_only), needs, (), 2),
    )


EFFECT = Effect(
    id="unequal_rotors",
    name="a difference between the rotors",
    sentence="one or more rotors give more or less thrust than the others",
    forms=forms,
    source="rotor coefficients per rotor, no further assumption; catalogue F17",
    sign="positive d_i: rotor i gives more than the coefficient believed",
    validity="the same share over all speeds; equal shares of all rotors are a wrong coefficient (under parameters)",
    excited_by=("rotor_speed",),
    confusers=("com_offset", "thrust_tilt"),
    separating_manoeuvre="swap two propellers and repeat the hover, or excite roll, pitch and yaw",
)
