"""Hub moment of blade flapping."""

from rotorid.effects.contract import Effect, Form, Parameter
from rotorid.effects.instant import Wrench
from rotorid.effects.scale import scale


def _hub_moment(m, v, p, w):
    """M = k_flap Σ ω_i (v_i × e3): the disc tilts back and pulls the nose up in forward flight.

    v × e3 with e3 down has y component −v_x; nose up is +y, hence the sign.
    """
    along = across = 0.0
    for i in range(v.rotors):
        along += m.rotor_speed[i] * m.hub_velocity[i, 0]
        across += m.rotor_speed[i] * m.hub_velocity[i, 1]
    w.moment[0] -= p[0] * across
    w.moment[1] += p[0] * along


def _independent_of_speed(m, v, p, w):
    """M = k_m (-v × e3) at the centre of mass."""
    w.moment[0] -= p[0] * m.air_velocity[1]
    w.moment[1] += p[0] * m.air_velocity[0]


def _rolling(m, v, p, w):
    """M = −k_roll Σ ω_i (v_i − (v_i · e3) e3): about the airspeed itself, whichever way a rotor spins."""
    along = across = 0.0
    for i in range(v.rotors):
        along += m.rotor_speed[i] * m.hub_velocity[i, 0]
        across += m.rotor_speed[i] * m.hub_velocity[i, 1]
    w.moment[0] -= p[0] * along
    w.moment[1] -= p[0] * across


def forms(vehicle):
    size = scale(vehicle)
    k_flap = size.arm_m * size.drag_per_rotor_speed
    k_m = size.arm_m * size.drag_per_speed
    return (
        Form(
            "at the hubs",
            "M = k_flap Σ ω_i (e3 × v_i)",
            (Parameter("k_flap", "N m s2/(rad m)", 0.0, k_flap, meaning="moment per rotor speed and airspeed"),),
            Wrench(_hub_moment),
            ("velocity", "rotor_speed"),
        ),
        Form(
            "independent of rotor speed",
            "M = k_m (e3 × v)",
            (Parameter("k_m", "N s", 0.0, k_m, meaning="moment per airspeed"),),
            Wrench(_independent_of_speed),
            ("velocity",),
        ),
        Form(
            "about the airspeed, at the hubs",
            "M = −k_roll Σ ω_i (v_i − (v_i · e3) e3)",
            (Parameter("k_roll", "N m s2/(rad m)", 0.0, k_flap, meaning="moment about the airspeed per rotor speed"),),
            Wrench(_rolling),
            ("velocity", "rotor_speed"),
        ),
    )


EFFECT = Effect(
    id="flapping_moment",
    name="the hub moment of blade flapping",
    sentence="a pitching or rolling moment grows with airspeed",
    forms=forms,
    source=(
        "Mahony, Kumar and Corke, Multirotor aerial vehicles, IEEE RAM 2012; RotorPy's k_flap; catalogue F6; the "
        "moment about the airspeed: Martin and Salaün, ICRA 2010, rolling moment of Gazebo's RotorS"
    ),
    sign=(
        "positive raises the nose in forward flight (the disc tilts back) and rolls away from sideways flight; k_roll "
        "is positive where the moment points against the airspeed"
    ),
    validity=("advance ratios below about 0.1 to 0.2; the force part of flapping is rotor_drag (one class with it)"),
    excited_by=("velocity", "angular_velocity"),
    confusers=("rotor_interference", "rotor_drag"),
    separating_manoeuvre="fly forward, backward and sideways at several speeds",
    feels_air=True,
    cases=("single/flapping_moment/strong/0", "single/rotor_drag/strong/0"),
)
