"""Thrust not along the body's z axis."""

import numpy as np

from rotorid.effects.contract import Effect, Form, Parameter
from rotorid.effects.instant import Wrench
from rotorid.effects.loading import on_stand


def _at_the_hubs(m, v, p, w):
    """F_i += T_i (ε_x,i, ε_y,i, 0) at each hub, M −= ±Q_i (ε_x,i, ε_y,i, 0): reaction torques lean with their axes.

    Small angles; `p` is ε_x, ε_y of each rotor.
    """
    roll = pitch = 0.0
    for i in range(v.rotors):
        torque = v.torque_coefficient[i] * v.yaw_sign[i] * m.rotor_speed[i] ** 2
        roll += torque * p[2 * i]
        pitch += torque * p[2 * i + 1]
        w.hub_force[i, 0] += m.thrust[i] * p[2 * i]
        w.hub_force[i, 1] += m.thrust[i] * p[2 * i + 1]
    w.moment[0] -= roll
    w.moment[1] -= pitch


def _thrust_alone(m, v, p, w):
    """F_i += T_i (ε_x, ε_y, 0) at each hub, reaction torques upright: what flows off the rotor leans, not the motor."""
    for i in range(v.rotors):
        for j in range(2):
            w.hub_force[i, j] += m.thrust[i] * p[j]


def _force_only(m, v, p, w):
    """F = T (ε_x, ε_y, 0) at the centre of mass."""
    for i in range(v.rotors):
        for j in range(2):
            w.force[j] += m.thrust[i] * p[j]


def _of_rotors(leaning):
    """ε_x, ε_y of each rotor, of a tilt that those lean by where `leaning` (k,) is 1."""
    return lambda values: [weight * value for weight in leaning for value in values]


def forms(vehicle):
    tilt = tuple(Parameter(f"eps_{a}", "rad", -0.5, 0.5, meaning=f"tilt of the thrust along {a}") for a in "xy")
    needs = ("rotor_speed",)
    singles = [
        Form(
            f"rotor {k + 1}",
            f"F_{k + 1} = T_{k + 1} (ε_x, ε_y, −1)",
            tilt,
            Wrench(_at_the_hubs, _of_rotors(np.eye(vehicle.rotor_count)[k])),
            needs,
            (),
            2,
        )
        for k in range(vehicle.rotor_count)
    ]
    return (
        Form(
            "all rotors, at the hubs",
            "F_i = T_i (ε_x, ε_y, −1)",
            tilt,
            Wrench(_at_the_hubs, _of_rotors(np.ones(vehicle.rotor_count))),
            needs,
        ),
        Form(
            "all rotors, at the hubs, thrust alone",
            "F_i = T_i (ε_x, ε_y, −1), torques upright",
            tilt,
            Wrench(_thrust_alone),
            needs,
        ),
        Form("all rotors, at the centre of mass", "F = T (ε_x, ε_y, −1)", tilt, Wrench(_force_only), needs),
        *singles,
    )


def _in_pairs(values):
    """ε_x, ε_y of each rotor, of all ε_x before all ε_y."""
    return np.reshape(values, (2, -1)).T.ravel()


def reading_forms(instrument):
    """The forms of a flight and, as a stand drives rotors one by one, each rotor leaning its own way."""
    if instrument.bench:
        return ()
    vehicle, count = instrument.vehicle, instrument.vehicle.rotor_count
    found = [form for form in forms(vehicle) if count >= form.minimum_rotors]
    if count > 1:
        tilts = tuple(
            Parameter(f"eps_{a}{k + 1}", "rad", -0.5, 0.5, meaning=f"tilt of rotor {k + 1} along {a}")
            for a in "xy"
            for k in range(count)
        )
        text = "F_i = T_i (ε_x,i, ε_y,i, −1)"
        found.append(Form("each rotor its own way", text, tilts, Wrench(_at_the_hubs, _in_pairs), ("rotor_speed",)))
    return tuple(on_stand(form) for form in found)


EFFECT = Effect(
    id="thrust_tilt",
    name="a tilted thrust axis",
    sentence="a sideways force proportional to thrust",
    forms=forms,
    reading_forms=reading_forms,
    shows_in=("yaw_trim", "sideways"),
    source="rigid-body mechanics, small angles; catalogue F16",
    sign="positive ε_x pushes forward, positive ε_y to the right",
    validity="angles below about 0.3 rad (loss of lift of second order left out), constant",
    excited_by=("rotor_speed",),
    confusers=("accelerometer_error", "steady_wind", "com_offset"),
    separating_manoeuvre="yaw through 360 degrees in hover",
    separating_columns=("position",),
    cases=("single/thrust_tilt/strong/0", "single/accelerometer_error/moderate/0"),
)
