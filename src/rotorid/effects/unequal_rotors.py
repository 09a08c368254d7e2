"""Rotors that are not alike: thrust or torque coefficients differ between them."""

from dataclasses import replace
from functools import partial

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter, lift_at_hubs, rotor_thrusts
from rotorid.effects.loading import NO_ROTORS, on_stand

_MOST_TWIST = 0.5
"""Largest share by which the torque of a rotor differs from that of the others at the same thrust."""


def _thrust(motion, vehicle, weights):
    return lift_at_hubs(weights * rotor_thrusts(motion, vehicle), vehicle)


def _torque(motion, vehicle, weights):
    torque = vehicle.torque_coefficients_n_m_s2() * vehicle.yaw_signs() * motion.rotor_speed**2
    moment = np.zeros((motion.size, 3))
    moment[:, 2] = sum((weights * torque).T)
    return moment


def both(motion, vehicle, values):
    """C_F,i = C_F (1 + d_i), C_Q,i = C_Q (1 + d_i): one blade shape scales both."""
    weights = np.asarray(values, float)
    wrench = _thrust(motion, vehicle, weights)
    return Contribution(wrench.force, wrench.moment + _torque(motion, vehicle, weights))


def _thrust_only(motion, vehicle, values):
    """C_F,i = C_F (1 + d_i)."""
    return _thrust(motion, vehicle, np.asarray(values))


def _torque_only(motion, vehicle, values):
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


def kernel(m, v, p, w):
    """C_F,i = C_F (1 + d_i), C_Q,i = C_Q (1 + q_i); `p` is d_i, q_i of each rotor."""
    yaw = 0.0
    for i in range(v.rotors):
        w.hub_force[i, 2] -= p[2 * i] * m.thrust[i]
        yaw += p[2 * i + 1] * v.torque_coefficient[i] * v.yaw_sign[i] * m.rotor_speed[i] ** 2
    w.moment[2] += yaw


def _excess(function, weights):
    """Kernel values of `function` (both, thrust_only or torque_only) for what each rotor has in excess."""
    thrust = 0.0 if function is _torque_only else 1.0
    torque = 0.0 if function is _thrust_only else 1.0
    return [share * weight for weight in weights for share in (thrust, torque)]


def _of_one(k, count, function, values):
    """Kernel values where rotor `k` alone differs."""
    return _excess(function, [values[0] if i == k else 0.0 for i in range(count)])


def _of_contrast(function, values):
    """Kernel values where the last rotor has what the others lack."""
    return _excess(function, [*values, -sum(values)])


def forms(vehicle):
    needs = ("rotor_speed",)
    count = vehicle.rotor_count
    symbols = tuple(Parameter(f"d_{i + 1}", "1", -0.9, 2.0, meaning=f"excess of rotor {i + 1}") for i in range(count))
    both_text = "C_F,{0} = C_F (1 + d_{0}), C_Q,{0} = C_Q (1 + d_{0})"
    thrust_text, torque_text = "C_F,{0} = C_F (1 + d_{0})", "C_Q,{0} = C_Q (1 + d_{0})"
    singles = [
        Form(
            name.format(i + 1),
            text.format(i + 1),
            (symbols[i],),
            _one(i, count, function),
            needs,
            (),
            2,
            kernel=kernel,
            kernel_values=partial(_of_one, i, count, function),
        )
        for name, text, function in (("rotor {}", both_text, both), ("thrust of rotor {}", thrust_text, _thrust_only))
        for i in range(count)
    ]
    free, closed = symbols[:-1], ", Σ d_i = 0"
    # At the same thrust: blades of another twist or profile, no other propeller.
    twisted = tuple(replace(p, low=-_MOST_TWIST, high=_MOST_TWIST) for p in free)
    return (
        *singles,
        *(
            Form(
                name,
                text.format("i") + closed,
                parameters,
                _contrast(function),
                needs,
                (),
                2,
                kernel=kernel,
                kernel_values=partial(_of_contrast, function),
            )
            for name, text, function, parameters in (
                ("thrust and torque", both_text, both, free),
                ("thrust", thrust_text, _thrust_only, free),
                ("torque", torque_text, _torque_only, twisted),
            )
        ),
    )


def apart(motion, vehicle, values):
    """C_F,i = C_F (1 + d_i), C_Q,i = C_Q (1 + q_i): another twist or a chip changes the two by shares of their own."""
    thrust, torque = np.split(np.asarray(values, float), 2)
    wrench = _thrust(motion, vehicle, np.append(thrust, -thrust.sum()))
    return Contribution(wrench.force, wrench.moment + _torque(motion, vehicle, np.append(torque, -torque.sum())))


def reading_forms(instrument):
    """The forms of a flight, and on a stand, which reads the torque itself, thrust and torque apart."""
    if instrument.bench:
        return ()
    vehicle = instrument.vehicle

    found = [*forms(vehicle)]
    count = vehicle.rotor_count
    if count > 1 and 5 in instrument.channels and vehicle.torque_coefficients_n_m_s2().any():
        free = tuple(
            Parameter(f"{s}_{i + 1}", "1", -0.9, 2.0, meaning=f"excess of the {what} of rotor {i + 1}")
            for s, what in (("d", "thrust"), ("q", "torque"))
            for i in range(count - 1)
        )
        text = "C_F,i = C_F (1 + d_i), C_Q,i = C_Q (1 + q_i), Σ d_i = Σ q_i = 0"
        found.append(Form("thrust and torque apart", text, free, apart, ("rotor_speed",)))
    return tuple(on_stand(form) for form in found)


EFFECT = Effect(
    id="unequal_rotors",
    name="a difference between the rotors",
    sentence="one or more rotors give more or less thrust than the others",
    forms=forms,
    reading_forms=reading_forms,
    shows_in=("share", "trim", "yaw_trim"),
    source="rotor coefficients per rotor, no further assumption; catalogue F17",
    sign="positive d_i: rotor i gives more than the coefficient believed",
    validity="the same share over all speeds; equal shares of all rotors are a wrong coefficient (under parameters)",
    excited_by=("rotor_speed",),
    between_flights={"1": 0.005},  # half of what a rotor's coefficient differs by in other air
    confusers=("com_offset", "thrust_tilt"),
    separating_manoeuvre="swap two propellers and repeat the hover, or excite roll, pitch and yaw",
    shows_in_moments=True,
    lack_on=lambda instrument: NO_ROTORS,
)
