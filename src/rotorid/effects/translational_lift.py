"""Translational lift: more thrust in forward flight."""

from rotorid.effects.contract import Effect, Form, Parameter
from rotorid.effects.instant import Wrench
from rotorid.effects.scale import scale

_MOST_SHARE_PER_SQUARE = 0.05
"""Share of hover thrust gained per (m/s)²: published values stay below 0.003."""


def _at_the_hubs(m, v, p, w):
    """T_i += k_h v_h,i², v_h,i the in-plane airspeed of the hub."""
    for i in range(v.rotors):
        w.hub_force[i, 2] -= p[0] * (m.hub_velocity[i, 0] ** 2 + m.hub_velocity[i, 1] ** 2)


def _at_the_centre(m, v, p, w):
    """T_i += k_h v_h², v_h the in-plane airspeed of the centre of mass."""
    for i in range(v.rotors):
        w.hub_force[i, 2] -= p[0] * (m.air_velocity[0] ** 2 + m.air_velocity[1] ** 2)


def forms(vehicle):
    most = _MOST_SHARE_PER_SQUARE * scale(vehicle).thrust_n
    k_h = Parameter("k_h", "N s2/m2", 0.0, most, meaning="lift per rotor and squared in-plane airspeed")
    return (
        Form("at the hubs", "T_i += k_h v_h,i²", (k_h,), Wrench(_at_the_hubs), ("velocity",)),
        Form("at the centre of mass", "T_i += k_h v_h²", (k_h,), Wrench(_at_the_centre), ("velocity",)),
    )


EFFECT = Effect(
    id="translational_lift",
    name="translational lift",
    sentence="the rotors lift more in forward flight",
    forms=forms,
    shows_in=("lift", "lift_of_throttle", "lift_without_voltage"),
    source=(
        "Faessler, Franchi and Scaramuzza, RA-L 2018 (k_h); Leishman, ch. 2 (inflow in forward flight); catalogue F8"
    ),
    sign="positive k_h adds thrust in forward flight, whichever way it goes",
    validity=(
        "in-plane airspeeds below the hover inflow, about constant rotor speed (quadratic onset, later it saturates)"
    ),
    excited_by=("velocity", "angular_velocity"),
    confusers=("thrust_curve", "axial_inflow"),
    separating_manoeuvre="fly level at constant rotor speed and several airspeeds",
    feels_air=True,
    cases=("single/translational_lift/moderate/0", "single/axial_inflow/moderate/0"),
)
