"""Hub moment of blade flapping."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter

E3 = np.array([0.0, 0.0, 1.0])


def hub_moment(motion, vehicle, values):
    """M = k_flap Σ ω_i (v_i × e3): the disc tilts back and pulls the nose up in forward flight."""
    hub = motion.hub_velocity(vehicle.rotor_positions_m())
    weighted = (motion.rotor_speed[:, :, None] * hub).sum(axis=1)
    # v × e3 with e3 down has y component -v_x; nose up is +y, hence the sign.
    return Contribution(moment=-values[0] * np.cross(weighted, E3))


def independent_of_speed(motion, vehicle, values):
    """M = k_m (-v × e3) at the centre of mass."""
    return Contribution(moment=-values[0] * np.cross(motion.air_velocity, E3))


def forms(vehicle):
    return (
        Form(
            "at the hubs",
            "M = k_flap Σ ω_i (e3 × v_i)",
            (Parameter("k_flap", "N m s2/(rad m)", 0.0),),
            hub_moment,
            ("velocity", "rotor_speed"),
        ),
        Form(
            "independent of rotor speed",
            "M = k_m (e3 × v)",
            (Parameter("k_m", "N s", 0.0),),
            independent_of_speed,
            ("velocity",),
        ),
    )


EFFECT = Effect(
    id="flapping_moment",
    name="the hub moment of blade flapping",
    sentence="a pitching or rolling moment grows with airspeed",
    forms=forms,
    source="physics.md F6; RotorPy's k_flap; Mahony et al., 2012",
    confusers=("rotor_interference", "rotor_drag"),
    separating_manoeuvre="fly forward, backward and sideways at several speeds",
)
