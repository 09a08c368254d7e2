"""Axial inflow: a climbing rotor loses thrust, and so damps rolling and pitching at its hub."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter, at_hubs
from rotorid.effects.scale import scale


def _at_the_hubs(motion, vehicle, values):
    """T_i += k_z ω_i w_i, w_i the hub's velocity along body z (down) through the air."""
    positions = vehicle.rotor_positions_m()
    hub = motion.hub_velocity(positions)
    forces = np.zeros_like(hub)
    forces[:, :, 2] = -values[0] * motion.rotor_speed * hub[:, :, 2]
    return at_hubs(forces, positions)


def _at_the_centre(motion, vehicle, values):
    """T += k_z Σω w at the centre of mass: no damping moment."""
    force = np.zeros_like(motion.air_velocity)
    force[:, 2] = -values[0] * motion.rotor_speed.sum(axis=1) * motion.air_velocity[:, 2]
    return Contribution(force=force)


def _independent_of_speed(motion, vehicle, values):
    """F_z = -d_z w at the centre of mass."""
    force = np.zeros_like(motion.air_velocity)
    force[:, 2] = -values[0] * motion.air_velocity[:, 2]
    return Contribution(force=force)


def _kernel_at_the_hubs(m, v, p, w):
    for i in range(v.rotors):
        w.hub_force[i, 2] -= p[0] * m.rotor_speed[i] * m.hub_velocity[i, 2]


def _kernel_at_the_centre(m, v, p, w):
    w.force[2] -= p[0] * m.rotor_speed_sum * m.air_velocity[2]


def _kernel_independent_of_speed(m, v, p, w):
    w.force[2] -= p[0] * m.air_velocity[2]


def forms(vehicle):
    size = scale(vehicle)
    k_z = Parameter(
        "k_z",
        "N s2/(rad m)",
        0.0,
        size.drag_per_rotor_speed,
        meaning="thrust lost per rotor speed and climb speed",
    )
    d_z = Parameter("d_z", "N s/m", 0.0, size.drag_per_speed, meaning="thrust lost per climb speed")
    needs = ("velocity", "rotor_speed")
    return (
        Form("at the hubs", "T_i −= k_z ω_i v_z,i (climbing)", (k_z,), _at_the_hubs, needs, kernel=_kernel_at_the_hubs),
        Form(
            "at the centre of mass",
            "T −= k_z Σω v_z (climbing)",
            (k_z,),
            _at_the_centre,
            needs,
            kernel=_kernel_at_the_centre,
        ),
        Form(
            "independent of rotor speed",
            "F_z = −d_z v_z",
            (d_z,),
            _independent_of_speed,
            ("velocity",),
            kernel=_kernel_independent_of_speed,
        ),
    )


EFFECT = Effect(
    id="axial_inflow",
    name="axial inflow",
    sentence="thrust falls when climbing and grows when sinking",
    forms=forms,
    source="Hoffmann et al., Quadrotor helicopter flight dynamics and control, AIAA GNC 2007; catalogue F9",
    sign=(
        "positive k_z takes thrust from a climbing rotor and gives thrust to a sinking one; at the hubs "
        "it damps roll and pitch"
    ),
    validity=(
        "axial speeds small against the induced velocity (climb or descent below half the hover inflow), no vortex ring"
    ),
    excited_by=("velocity", "angular_velocity"),
    confusers=("frame_drag", "motor_lag", "rotational_damping"),
    separating_manoeuvre="fly steady climbs and descents",
    feels_air=True,
)
