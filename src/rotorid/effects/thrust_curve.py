"""Thrust that is not proportional to the squared rotor speed."""

import numpy as np

from rotorid.effects.contract import Effect, Form, Parameter
from rotorid.effects.instant import Wrench
from rotorid.effects.loading import NO_ROTORS, on_stand
from rotorid.effects.scale import scale

SQUARE = "Δc_2"
"""Symbol of a squared term's excess over the coefficient believed."""
_NO_CURVE = 0.003
"""Share of the hover thrust below which a term is none: no propeller is square to that."""


def _polynomial(m, v, p, w):
    """T_i += c_0 + c_1 ω_i + Δc_2 ω_i² + c_3 ω_i³; `p` holds the four."""
    for i in range(v.rotors):
        speed = m.rotor_speed[i]
        w.hub_force[i, 2] -= p[0] + speed * (p[1] + speed * (p[2] + speed * p[3]))


def _powers(*powers):
    """The four coefficients of a form whose parameters are the coefficients of these powers of the speed."""

    def four(values):
        out = [0.0] * 4
        for power, value in zip(powers, values, strict=True):
            out[power] = value
        return out

    return four


def forms(vehicle):
    needs = ("rotor_speed",)
    size = scale(vehicle)
    thrust, speed = size.thrust_n, size.hover_speed_rad_s

    def term(symbol: str, unit: str, bound: float, size: float, meaning: str) -> Parameter:
        return Parameter(symbol, unit, -bound, bound, meaning=meaning, negligible=_NO_CURVE * size)

    # A rotor at rest does not carry half the vehicle.
    c0 = term("c_0", "N", 0.5 * thrust, thrust, "thrust beyond the square at any speed")
    c1 = term("c_1", "N s/rad", thrust / speed, thrust / speed, "thrust beyond the square per speed")
    c3 = term("c_3", "N s3/rad3", thrust / speed**3, thrust / speed**3, "cubic thrust")
    # A curve far from a square takes its squared term far from the coefficient believed, beyond any trust in it.
    # It stays positive: thrust rises with speed.
    c2 = Parameter(SQUARE, "N s2/rad2", -0.8 * thrust / speed**2, thrust / speed**2, meaning="squared term beyond C_F")
    always = ("always",)
    return (
        Form("linear term", "T_i = C_F ω_i² + c_1 ω_i", (c1,), Wrench(_polynomial, _powers(1)), needs),
        Form("constant term", "T_i = C_F ω_i² + c_0", (c0,), Wrench(_polynomial, _powers(0)), needs, excited_by=always),
        Form(
            "linear and constant",
            "T_i = C_F ω_i² + c_1 ω_i + c_0",
            (c0, c1),
            Wrench(_polynomial, _powers(0, 1)),
            needs,
            excited_by=always,
        ),
        Form(
            "linear term and its own square",
            "T_i = (C_F + Δc_2) ω_i² + c_1 ω_i",
            (c1, c2),
            Wrench(_polynomial, _powers(1, 2)),
            needs,
            must_show=(0, 1),
        ),
        Form(
            "constant term and its own square",
            "T_i = (C_F + Δc_2) ω_i² + c_0",
            (c0, c2),
            Wrench(_polynomial, _powers(0, 2)),
            needs,
            must_show=(0, 1),
            excited_by=always,
        ),
        Form("cubic term", "T_i = C_F ω_i² + c_3 ω_i³", (c3,), Wrench(_polynomial, _powers(3)), needs),
    )


def _power(m, v, p, w):
    """T_i = (1 + d) C_F ω_h² (ω_i/ω_h)^(2 + e); `p` is e, d and ω_h, the hover speed.

    A coefficient of another power has no value to believe: where the two curves cross is as free as the power.
    """
    for i in range(v.rotors):
        ratio = np.maximum(m.rotor_speed[i], 0.0) / p[2]
        square = v.thrust_coefficient[i] * p[2] ** 2
        w.hub_force[i, 2] -= square * ((1.0 + p[1]) * ratio ** (2.0 + p[0]) - ratio**2)


def reading_forms(instrument):
    """The forms of a flight and, as a stand goes from rest to full speed, a power of the speed."""
    if instrument.bench:
        return ()
    vehicle, starts = instrument.vehicle, (-0.2, -0.05, 0.05, 0.2)
    excess = Parameter(
        "e", "1", -1.5, 1.5, nonlinear=True, starts=starts, meaning="exponent of the speed beyond two", negligible=0.01
    )
    more = Parameter("d", "1", -0.6, 0.6, nonlinear=True, starts=(0.0,), meaning="further thrust at hover speed")
    hover = scale(vehicle).hover_speed_rad_s
    power = Form(
        "power of the speed",
        "T_i = (1 + d) C_F ω_h² (ω_i/ω_h)^(2+e), ω_h the hover speed",
        (excess, more),
        Wrench(_power, lambda values: (*values, hover)),
        ("rotor_speed",),
        takes_up=("thrust",),
    )
    plain = forms(vehicle)
    cube = next(f.parameters for f in plain if f.name == "cubic term")
    square = next(f.parameters[1:] for f in plain if f.name == "linear term and its own square")
    cubic = Form(
        "cubic term and its own square",
        "T_i = (C_F + Δc_2) ω_i² + c_3 ω_i³",
        cube + square,
        Wrench(_polynomial, _powers(3, 2)),
        ("rotor_speed",),
        must_show=(0, 1),
    )
    return tuple(on_stand(form) for form in (*plain, cubic, power))


EFFECT = Effect(
    id="thrust_curve",
    name="a thrust curve that is not a pure square",
    sentence="thrust is off by an amount that depends on rotor speed alone",
    forms=forms,
    reading_forms=reading_forms,
    source="Bitcraze and Förster (ETH 2015), thrust fits of the Crazyflie; Leishman, ch. 2; catalogue F3",
    sign="positive adds thrust (along −z of the body) to every rotor",
    validity=("within the range of rotor speeds flown; a wide range distinguishes the terms, a narrow one does not"),
    excited_by=("rotor_speed",),
    confusers=("axial_inflow", "translational_lift"),
    separating_manoeuvre="step the throttle over its widest range",
    separating_columns=("rotor_speed",),
    same_on_commands="throttle_curve",
    curves_thrust=True,
    curve_of_load=True,
    lack_on=lambda instrument: NO_ROTORS,
    cases=("single/thrust_curve/strong/0", "single/axial_inflow/moderate/0"),
)
