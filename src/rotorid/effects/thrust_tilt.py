"""Thrust not along the body's z axis."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter, at_hubs, rotor_thrusts
from rotorid.effects.loading import on_stand


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


def _at_the_hubs(motion, vehicle, values):
    """F_i += T_i (ε_x, ε_y, 0) at each hub, M_i −= ±Q_i (ε_x, ε_y, 0); small angles, all rotors alike."""
    return _tilted(motion, vehicle, values[0], values[1], np.ones(vehicle.rotor_count))


def _thrust_alone(motion, vehicle, values):
    """F_i += T_i (ε_x, ε_y, 0) at each hub, reaction torques upright: what flows off the rotor leans, not the motor."""
    return at_hubs(_forces(motion, vehicle, values[0], values[1]), vehicle.rotor_positions_m())


def _force_only(motion, vehicle, values):
    """F = T (ε_x, ε_y, 0) at the centre of mass."""
    return Contribution(force=_forces(motion, vehicle, values[0], values[1]).sum(axis=1))


def _single(k):
    def one(motion, vehicle, values):
        return _tilted(motion, vehicle, values[0], values[1], np.eye(vehicle.rotor_count)[k])

    return one


def _kernel_at_the_hubs(m, v, p, w):
    """F_i += T_i (ε_x,i, ε_y,i, 0), M -= ±Q_i (ε_x,i, ε_y,i, 0); `p` is ε_x, ε_y of each rotor."""
    roll = pitch = 0.0
    for i in range(v.rotors):
        torque = v.torque_coefficient[i] * v.yaw_sign[i] * m.rotor_speed[i] ** 2
        roll += torque * p[2 * i]
        pitch += torque * p[2 * i + 1]
        w.hub_force[i, 0] += m.thrust[i] * p[2 * i]
        w.hub_force[i, 1] += m.thrust[i] * p[2 * i + 1]
    w.moment[0] -= roll
    w.moment[1] -= pitch


def _kernel_thrust_alone(m, v, p, w):
    for i in range(v.rotors):
        for j in range(2):
            w.hub_force[i, j] += m.thrust[i] * p[j]


def _kernel_force_only(m, v, p, w):
    for i in range(v.rotors):
        for j in range(2):
            w.force[j] += m.thrust[i] * p[j]


def _of_rotors(leaning):
    """Kernel values of a tilt that the rotors lean by where `leaning` (k,) is 1."""
    return lambda values: [weight * value for weight in leaning for value in values]


def forms(vehicle):
    tilt = tuple(Parameter(f"eps_{a}", "rad", -0.5, 0.5, meaning=f"tilt of the thrust along {a}") for a in "xy")
    needs = ("rotor_speed",)
    singles = [
        Form(
            f"rotor {k + 1}",
            f"F_{k + 1} = T_{k + 1} (ε_x, ε_y, −1)",
            tilt,
            _single(k),
            needs,
            (),
            2,
            kernel=_kernel_at_the_hubs,
            kernel_values=_of_rotors(np.eye(vehicle.rotor_count)[k]),
        )
        for k in range(vehicle.rotor_count)
    ]
    return (
        Form(
            "all rotors, at the hubs",
            "F_i = T_i (ε_x, ε_y, −1)",
            tilt,
            _at_the_hubs,
            needs,
            kernel=_kernel_at_the_hubs,
            kernel_values=_of_rotors(np.ones(vehicle.rotor_count)),
        ),
        Form(
            "all rotors, at the hubs, thrust alone",
            "F_i = T_i (ε_x, ε_y, −1), torques upright",
            tilt,
            _thrust_alone,
            needs,
            kernel=_kernel_thrust_alone,
        ),
        Form(
            "all rotors, at the centre of mass",
            "F = T (ε_x, ε_y, −1)",
            tilt,
            _force_only,
            needs,
            kernel=_kernel_force_only,
        ),
        *singles,
    )


def _each_its_own(motion, vehicle, values):
    """F_i += T_i (ε_x,i, ε_y,i, 0) at each hub, torques leaning with their axes; values (2k,): x of each, then y."""
    tilt_x, tilt_y = np.split(np.asarray(values, float), 2)
    parts = [
        _tilted(motion, vehicle, tilt_x[k], tilt_y[k], np.eye(vehicle.rotor_count)[k])
        for k in range(vehicle.rotor_count)
    ]
    return Contribution(force=sum(p.force for p in parts), moment=sum(p.moment for p in parts))


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
        found.append(Form("each rotor its own way", text, tilts, _each_its_own, ("rotor_speed",)))
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
)
