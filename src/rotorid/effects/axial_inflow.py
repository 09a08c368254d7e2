"""Axial inflow: a climbing rotor loses thrust, and so damps rolling and pitching at its hub."""

from rotorid.effects.contract import Effect, Form, Parameter
from rotorid.effects.instant import Wrench
from rotorid.effects.scale import scale


def _at_the_hubs(m, v, p, w):
    """T_i += k_z ω_i w_i, w_i the hub's velocity along body z (down) through the air."""
    for i in range(v.rotors):
        w.hub_force[i, 2] -= p[0] * m.rotor_speed[i] * m.hub_velocity[i, 2]


def _at_the_centre(m, v, p, w):
    """T += k_z Σω w at the centre of mass: no damping moment."""
    w.force[2] -= p[0] * m.rotor_speed_sum * m.air_velocity[2]


def _independent_of_speed(m, v, p, w):
    """F_z = -d_z w at the centre of mass."""
    w.force[2] -= p[0] * m.air_velocity[2]


def forms(vehicle):
    size = scale(vehicle)
    k_z = Parameter(
        "k_z", "N s2/(rad m)", 0.0, size.drag_per_rotor_speed, meaning="thrust lost per rotor speed and climb speed"
    )
    d_z = Parameter("d_z", "N s/m", 0.0, size.drag_per_speed, meaning="thrust lost per climb speed")
    needs = ("velocity", "rotor_speed")
    return (
        Form("at the hubs", "T_i −= k_z ω_i v_z,i (climbing)", (k_z,), Wrench(_at_the_hubs), needs),
        Form("at the centre of mass", "T −= k_z Σω v_z (climbing)", (k_z,), Wrench(_at_the_centre), needs),
        Form("independent of rotor speed", "F_z = −d_z v_z", (d_z,), Wrench(_independent_of_speed), ("velocity",)),
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
    cases=("single/axial_inflow/moderate/0", "single/frame_drag/strong/0"),
)
