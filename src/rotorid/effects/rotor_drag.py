"""In-plane drag of the rotors (H-force), with the force part of blade flapping: one class, never split."""

from rotorid.effects.contract import Effect, Form, Parameter
from rotorid.effects.instant import Wrench
from rotorid.effects.scale import scale


def _at_the_hubs(m, v, p, w):
    """F_i = -ω_i (k_x v_x,i, k_y v_y,i, 0), at each hub; v_i = v + Ω × r_i through the air."""
    for i in range(v.rotors):
        w.hub_force[i, 0] -= p[0] * m.rotor_speed[i] * m.hub_velocity[i, 0]
        w.hub_force[i, 1] -= p[1] * m.rotor_speed[i] * m.hub_velocity[i, 1]


def _at_the_centre(m, v, p, w):
    """F = -(k_x v_x, k_y v_y, 0) Σω at the centre of mass: no moment; the airframe may shade x and y differently."""
    w.force[0] -= p[0] * m.rotor_speed_sum * m.air_velocity[0]
    w.force[1] -= p[1] * m.rotor_speed_sum * m.air_velocity[1]


def _linear_in_speed(m, v, p, w):
    """F = -d P v at the centre of mass, not growing with rotor speed."""
    w.force[0] -= p[0] * m.air_velocity[0]
    w.force[1] -= p[0] * m.air_velocity[1]


def _alike(values):
    """k_d along either axis."""
    return (values[0],) * 2


def forms(vehicle):
    needs = ("velocity", "rotor_speed")
    size, unit = scale(vehicle), "N s2/(rad m)"
    most = size.drag_per_rotor_speed
    k_d = Parameter("k_d", unit, 0.0, most, meaning="in-plane drag per rotor speed and airspeed")
    axes = tuple(Parameter(f"k_d_{a}", unit, 0.0, most, meaning=f"{k_d.meaning} along {a}") for a in "xy")
    d = Parameter("d", "N s/m", 0.0, size.drag_per_speed, meaning="linear drag")
    return (
        Form(
            "at the hubs",
            "F_i = −k_d ω_i v_i,⊥",
            (k_d,),
            Wrench(_at_the_hubs, _alike),
            needs,
            linear_drag="times rotor speed",
        ),
        Form(
            "at the centre of mass",
            "F = −k_d Σω v_⊥",
            (k_d,),
            Wrench(_at_the_centre, _alike),
            needs,
            linear_drag="times rotor speed",
        ),
        Form(
            "per axis",
            "F = −Σω (k_d,x v_x, k_d,y v_y, 0)",
            axes,
            Wrench(_at_the_centre),
            needs,
            linear_drag="times rotor speed",
        ),
        Form(
            "per axis, at the hubs",
            "F_i = −ω_i (k_d,x v_x,i, k_d,y v_y,i, 0)",
            axes,
            Wrench(_at_the_hubs),
            needs,
            linear_drag="times rotor speed",
        ),
        Form(
            "independent of rotor speed",
            "F = −d v_⊥",
            (d,),
            Wrench(_linear_in_speed),
            ("velocity",),
            linear_drag="of airspeed alone",
        ),
    )


EFFECT = Effect(
    id="rotor_drag",
    name="rotor drag",
    sentence="the sideways force grows with airspeed times rotor speed",
    forms=forms,
    shows_in=("sideways", "drag"),
    source=("Faessler, Franchi and Scaramuzza, RA-L 2018; Mahony, Kumar and Corke, IEEE RAM 2012; catalogue F5 and F6"),
    sign="positive k_d opposes the hub's motion through the air in the rotor plane",
    validity=(
        "linear in airspeed: advance ratios below about 0.2; holds H-force and the force part of "
        "flapping together (one class)"
    ),
    excited_by=("velocity", "angular_velocity"),
    confusers=("frame_drag", "steady_wind", "thrust_tilt"),
    separating_manoeuvre="fly a speed sweep beyond 10 m/s in both directions, once light and once loaded",
    feels_air=True,
    drag=True,
    cases=("single/rotor_drag/strong/0", "single/thrust_tilt/strong/0"),
)
