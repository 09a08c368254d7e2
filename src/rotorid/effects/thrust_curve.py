"""Thrust that is not proportional to the squared rotor speed."""

import numpy as np

from rotorid.effects.contract import Effect, Form, Parameter, lift_at_hubs
from rotorid.effects.loading import NO_ROTORS, on_stand
from rotorid.effects.scale import scale

SQUARE = "Δc_2"
"""Symbol of a squared term's excess over the coefficient believed."""
_NO_CURVE = 0.003
"""Share of the hover thrust below which a term is none: no propeller is square to that."""


def _linear_term(motion, vehicle, values):
    """T_i += c_1 ω_i."""
    return lift_at_hubs(values[0] * motion.rotor_speed, vehicle)


def _constant_term(motion, vehicle, values):
    """T_i += c_0."""
    return lift_at_hubs(values[0] * np.ones_like(motion.rotor_speed), vehicle)


def _linear_and_constant(motion, vehicle, values):
    """T_i += c_0 + c_1 ω_i."""
    return lift_at_hubs(values[0] + values[1] * motion.rotor_speed, vehicle)


def _cubic_term(motion, vehicle, values):
    """T_i += c_3 ω_i³."""
    return lift_at_hubs(values[0] * motion.rotor_speed**3, vehicle)


def _linear_and_square(motion, vehicle, values):
    """T_i += c_1 ω_i + Δc_2 ω_i²."""
    return lift_at_hubs(values[0] * motion.rotor_speed + values[1] * motion.rotor_speed**2, vehicle)


def _constant_and_square(motion, vehicle, values):
    """T_i += c_0 + Δc_2 ω_i²."""
    return lift_at_hubs(values[0] + values[1] * motion.rotor_speed**2, vehicle)


def kernel(m, v, p, w):
    """T_i += c_0 + c_1 ω_i + Δc_2 ω_i² + c_3 ω_i³; `p` holds the four."""
    for i in range(v.rotors):
        speed = m.rotor_speed[i]
        w.hub_force[i, 2] -= p[0] + speed * (p[1] + speed * (p[2] + speed * p[3]))


def _powers(*powers):
    """Kernel values of a form whose parameters are the coefficients of these powers."""

    def kernel_values(values):
        out = [0.0] * 4
        for power, value in zip(powers, values, strict=True):
            out[power] = value
        return out

    return kernel_values


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
        Form(
            "linear term",
            "T_i = C_F ω_i² + c_1 ω_i",
            (c1,),
            _linear_term,
            needs,
            kernel=kernel,
            kernel_values=_powers(1),
        ),
        Form(
            "constant term",
            "T_i = C_F ω_i² + c_0",
            (c0,),
            _constant_term,
            needs,
            excited_by=always,
            kernel=kernel,
            kernel_values=_powers(0),
        ),
        Form(
            "linear and constant",
            "T_i = C_F ω_i² + c_1 ω_i + c_0",
            (c0, c1),
            _linear_and_constant,
            needs,
            excited_by=always,
            kernel=kernel,
            kernel_values=_powers(0, 1),
        ),
        Form(
            "linear term and its own square",
            "T_i = (C_F + Δc_2) ω_i² + c_1 ω_i",
            (c1, c2),
            _linear_and_square,
            needs,
            must_show=(0, 1),
            kernel=kernel,
            kernel_values=_powers(1, 2),
        ),
        Form(
            "constant term and its own square",
            "T_i = (C_F + Δc_2) ω_i² + c_0",
            (c0, c2),
            _constant_and_square,
            needs,
            must_show=(0, 1),
            excited_by=always,
            kernel=kernel,
            kernel_values=_powers(0, 2),
        ),
        Form(
            "cubic term",
            "T_i = C_F ω_i² + c_3 ω_i³",
            (c3,),
            _cubic_term,
            needs,
            kernel=kernel,
            kernel_values=_powers(3),
        ),
    )


def _cubic_and_square(motion, vehicle, values):
    """T_i += c_3 ω_i³ + Δc_2 ω_i²."""
    return lift_at_hubs(values[0] * motion.rotor_speed**3 + values[1] * motion.rotor_speed**2, vehicle)


def _power_of_speed(vehicle):
    """Contribution T_i = (1 + d) C_F ω_h² (ω_i/ω_h)^(2 + e), ω_h the hover speed.

    A coefficient of another power has no value to believe: where the two curves cross is as free as the power.
    """
    hover = scale(vehicle).hover_speed_rad_s

    def contribution(motion, own, values):
        excess, more = values
        ratio = np.maximum(motion.rotor_speed, 0.0) / hover
        square = own.thrust_coefficients_n_s2() * hover**2
        return lift_at_hubs(square * ((1.0 + more) * ratio ** (2.0 + excess) - ratio**2), own)

    return contribution


def reading_forms(instrument):
    """The forms of a flight and, as a stand goes from rest to full speed, a power of the speed."""
    if instrument.bench:
        return ()
    vehicle, starts = instrument.vehicle, (-0.2, -0.05, 0.05, 0.2)
    excess = Parameter(
        "e", "1", -1.5, 1.5, nonlinear=True, starts=starts, meaning="exponent of the speed beyond two", negligible=0.01
    )
    more = Parameter("d", "1", -0.6, 0.6, nonlinear=True, starts=(0.0,), meaning="further thrust at hover speed")
    power = Form(
        "power of the speed",
        "T_i = (1 + d) C_F ω_h² (ω_i/ω_h)^(2+e), ω_h the hover speed",
        (excess, more),
        _power_of_speed(vehicle),
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
        _cubic_and_square,
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
)
