"""Translational lift: more thrust in forward flight."""

import numpy as np

from rotorid.effects.contract import Effect, Form, Parameter, at_hubs


def _along_thrust(extra, vehicle):
    forces = np.zeros((*extra.shape, 3))
    forces[:, :, 2] = -extra
    return at_hubs(forces, vehicle.rotor_positions_m())


def at_the_hubs(motion, vehicle, values):
    """T_i += k_h v_h,i², v_h,i the in-plane airspeed of the hub."""
    hub = motion.hub_velocity(vehicle.rotor_positions_m())
    return _along_thrust(values[0] * (hub[:, :, 0] ** 2 + hub[:, :, 1] ** 2), vehicle)


def at_the_centre(motion, vehicle, values):
    """T_i += k_h v_h², v_h the in-plane airspeed of the centre of mass."""
    v = motion.air_velocity
    extra = values[0] * (v[:, 0] ** 2 + v[:, 1] ** 2)
    return _along_thrust(np.repeat(extra[:, None], vehicle.rotor_count, axis=1), vehicle)


def forms(vehicle):
    k_h = Parameter("k_h", "N s2/m2", 0.0, meaning="lift per rotor and squared in-plane airspeed")
    return (
        Form("at the hubs", "T_i += k_h v_h,i²", (k_h,), at_the_hubs, ("velocity",)),
        Form("at the centre of mass", "T_i += k_h v_h²", (k_h,), at_the_centre, ("velocity",)),
    )


EFFECT = Effect(
    id="translational_lift",
    name="translational lift",
    sentence="the rotors lift more in forward flight",
    forms=forms,
    source="Faessler et al., RA-L 2018 (k_h); physics.md F8",
    confusers=("thrust_curve", "axial_inflow"),
    separating_manoeuvre="fly level at constant rotor speed and several airspeeds",
)
