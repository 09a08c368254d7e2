"""Rotors that are not alike: thrust or torque coefficients differ between them."""

from dataclasses import replace
from functools import partial

import numpy as np

from rotorid.effects.contract import Effect, Form, Parameter
from rotorid.effects.instant import Wrench
from rotorid.effects.loading import NO_ROTORS, on_stand

_MOST_TWIST = 0.5
"""Largest share by which the torque of a rotor differs from that of the others at the same thrust."""


def _thrust(m, v, p, w):
    """C_F,i = C_F (1 + p_i)."""
    for i in range(v.rotors):
        w.hub_force[i, 2] -= p[i] * m.thrust[i]


def _torque(m, v, p, w):
    """C_Q,i = C_Q (1 + p_i)."""
    yaw = 0.0
    for i in range(v.rotors):
        yaw += p[i] * v.torque_coefficient[i] * v.yaw_sign[i] * m.rotor_speed[i] ** 2
    w.moment[2] += yaw


def _both(m, v, p, w):
    """C_F,i = C_F (1 + d_i), C_Q,i = C_Q (1 + q_i); `p` is d of each rotor, then q of each."""
    yaw = 0.0
    for i in range(v.rotors):
        w.hub_force[i, 2] -= p[i] * m.thrust[i]
        yaw += p[v.rotors + i] * v.torque_coefficient[i] * v.yaw_sign[i] * m.rotor_speed[i] ** 2
    w.moment[2] += yaw


def _contrast(values):
    """The differences between rotors alone: what all share is a wrong coefficient, not a difference.

    The last rotor's share is minus the sum of the others'; with one more parameter the common part would be free
    although nothing shows it, and the normal equations singular.
    """
    return np.append(values, -np.sum(values))


def _contrast_of_both(values):
    """One blade shape scales thrust and torque alike."""
    return np.tile(_contrast(values), 2)


def _contrasts_apart(values):
    """Another twist or a chip changes the two by shares of their own."""
    return np.concatenate([_contrast(half) for half in np.split(values, 2)])


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
            Wrench(kernel, partial(np.multiply, np.tile(np.eye(count)[i], repeats))),
            needs,
            (),
            2,
        )
        for name, text, kernel, repeats in (
            ("rotor {}", both_text, _both, 2),
            ("thrust of rotor {}", thrust_text, _thrust, 1),
        )
        for i in range(count)
    ]
    free, closed = symbols[:-1], ", Σ d_i = 0"
    # At the same thrust: blades of another twist or profile, no other propeller.
    twisted = tuple(replace(p, low=-_MOST_TWIST, high=_MOST_TWIST) for p in free)
    return (
        *singles,
        *(
            Form(name, text.format("i") + closed, parameters, Wrench(*kernel), needs, (), 2)
            for name, text, kernel, parameters in (
                ("thrust and torque", both_text, (_both, _contrast_of_both), free),
                ("thrust", thrust_text, (_thrust, _contrast), free),
                ("torque", torque_text, (_torque, _contrast), twisted),
            )
        ),
    )


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
        found.append(Form("thrust and torque apart", text, free, Wrench(_both, _contrasts_apart), ("rotor_speed",)))
    return tuple(on_stand(form) for form in found)


EFFECT = Effect(
    id="unequal_rotors",
    name="a difference between the rotors",
    sentence="one or more rotors give more or less thrust than the others",
    forms=forms,
    reading_forms=reading_forms,
    turns_like="com_offset",
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
    cases=("single/unequal_rotors/strong/0", "single/thrust_tilt/strong/0"),
)
