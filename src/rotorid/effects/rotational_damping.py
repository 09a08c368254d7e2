"""Damping of body rates that axial inflow at the rotors does not explain."""

from rotorid.effects.contract import Effect, Form, Parameter
from rotorid.effects.instant import Wrench
from rotorid.effects.scale import scale


def _linear(m, v, p, w):
    """M = -(c_x p, c_y q, c_z r)."""
    for j in range(3):
        w.moment[j] -= p[j] * m.angular_velocity[j]


def _quadratic(m, v, p, w):
    """M_j = -c_j |Ω_j| Ω_j."""
    for j in range(3):
        w.moment[j] -= p[j] * abs(m.angular_velocity[j]) * m.angular_velocity[j]


def _alike(values):
    """c about every axis."""
    return (values[0],) * 3


def forms(vehicle):
    needs = ("angular_velocity",)
    most = scale(vehicle).damping
    each = tuple(Parameter(f"c_{a}", "N m s/rad", 0.0, most, meaning=f"damping about {a}") for a in "xyz")
    square = tuple(Parameter(f"c_{a}", "N m s2/rad2", 0.0, most, meaning=f"damping about {a}") for a in "xyz")
    one = Parameter("c", "N m s/rad", 0.0, most, meaning="damping about every axis")
    return (
        Form("one constant", "M = −c Ω", (one,), Wrench(_linear, _alike), needs),
        Form("linear", "M_j = −c_j Ω_j", each, Wrench(_linear), needs),
        Form("quadratic", "M_j = −c_j |Ω_j| Ω_j", square, Wrench(_quadratic), needs),
    )


EFFECT = Effect(
    id="rotational_damping",
    name="rotational damping",
    sentence="a moment opposes the body rates",
    forms=forms,
    source=(
        "Quan, Introduction to Multicopter Design and Control, ch. 6 (damping moment); the recording "
        "contract (M = −c Ω)"
    ),
    sign="positive c opposes the turning",
    validity="what axial inflow at the hubs does not explain; rates below about 10 rad/s for the linear forms",
    excited_by=("angular_velocity",),
    confusers=("axial_inflow", "delay", "gyro_error"),
    separating_manoeuvre="excite roll, pitch and yaw by doublets of several lengths",
    cases=("single/rotational_damping/strong/0", "single/axial_inflow/moderate/0"),
)
