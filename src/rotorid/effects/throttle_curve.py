"""Steady rotor speed that is not proportional to its command.

Where no speed is recorded the curve is stated about the hover command, as what commands alone determine: by how many
percent the thrust grows for one percent more command (`about`).
"""

import re

import numpy as np

from rotorid.effects.contract import CURVE, Effect, Parameter, SpeedForm

SLOPE = "a_1"
"""Symbol of what a curve adds to the slope between command and speed."""


def affine(path, values):
    """ω = ω_c + a_0 ω_max + a_1 ω_c."""
    return np.maximum(path.speed * (1 + values[1]) + values[0] * path.full_speed, 0.0)


def quadratic(path, values):
    """ω = ω_c + a_1 ω_c + a_2 ω_c (ω_c/ω_max): the gain changes with the command."""
    return np.maximum(path.speed * (1 + values[0] + values[1] * path.speed / path.full_speed), 0.0)


def _dead_zone(path, values):
    """ω = ω_max (u - u_0)/(1 - u_0), zero below u_0; u = ω_c/ω_max."""
    start = values[0]
    return path.full_speed * np.maximum(path.speed / path.full_speed - start, 0.0) / (1.0 - start)


def root(path, values):
    """T/T_max = (1 - a) u + a u², u = ω_c/ω_max, no thrust where that is negative; a = 1 is a proportional speed."""
    u = np.clip(path.speed / path.full_speed, 0.0, None)
    a = 1.0 - values[0]
    return path.full_speed * np.sqrt(np.maximum((1 - a) * u + a * u**2, 0.0))


def power(path, values):
    """ω = ω_max u^n, u = ω_c/ω_max."""
    u = np.clip(path.speed / path.full_speed, 0.0, None)
    return path.full_speed * u ** values[0]


def _power_from(path, values):
    """ω = ω_max ((u - u_0)/(1 - u_0))^n, zero below u_0."""
    return path.full_speed * (_dead_zone(path, values[:1]) / path.full_speed) ** values[1]


_ABOUT = re.compile(r"(power|line) about ([0-9.e-]+)")


def about(reference, shape="power"):
    """The form about a command `reference`, a share of the full one, at which it changes nothing.

    `power`: thrust goes with a power of the command; `line`: the speed is a straight line of it.
    """
    law = {"power": "T ∝ u^e_u", "line": "√T ∝ 1 + e_u (u/u_h − 1)/2"}[shape]

    def apply(path, values):
        u = path.speed / (path.full_speed * reference)
        if shape == "power":
            over = np.maximum(u, 0.0) ** (0.5 * values[0])
        else:
            over = np.maximum(1.0 + 0.5 * values[0] * (u - 1.0), 0.0)
        return path.full_speed * reference * over

    return SpeedForm(
        f"{shape} about {reference:.6g}",
        f"{law}, u_h = {reference:.3g}",
        (Parameter("e_u", "1", 0.3, 6.0, meaning="percent more thrust for one percent more command", negligible=0.04),),
        CURVE,
        apply,
        (2.0,),
    )


def form_named(name):
    """The form about a command, from the name that `about` gave it."""
    found = _ABOUT.fullmatch(name)
    return about(float(found[2]), found[1]) if found else None


_LINEAR = 0.005
"""No speed controller is proportional to its command within less, and a calibration of its throttle is no better."""


EFFECT = Effect(
    id="throttle_curve",
    name="the curve between throttle and rotor speed",
    sentence="the steady rotor speed is not proportional to its command",
    forms=lambda vehicle: (),
    form_named=form_named,
    about=about,
    speed_forms=(
        SpeedForm(
            "affine",
            "ω = (1 + a_1) ω_c + a_0 ω_max",
            (
                Parameter("a_0", "1", -0.8, 0.8, meaning="speed at no command, share of ω_max", negligible=_LINEAR),
                Parameter(SLOPE, "1", -0.8, 2.0, meaning="excess of the slope", negligible=_LINEAR),
            ),
            CURVE,
            affine,
            (0.0, 0.0),
            own_scale=True,
        ),
        SpeedForm(
            "quadratic",
            "ω = (1 + a_1 + a_2 ω_c/ω_max) ω_c",
            (
                Parameter(SLOPE, "1", -0.8, 2.0, meaning="excess of the slope at no command", negligible=_LINEAR),
                Parameter("a_2", "1", -2.0, 2.0, meaning="growth of the slope with the command", negligible=_LINEAR),
            ),
            CURVE,
            quadratic,
            (0.0, 0.0),
            own_scale=True,
        ),
        SpeedForm(
            "dead zone",
            "ω = ω_max (u − u_0)/(1 − u_0)",
            (Parameter("u_0", "1", -0.3, 0.5, meaning="command at which the rotors start", negligible=_LINEAR),),
            CURVE,
            _dead_zone,
            (0.0,),
        ),
        SpeedForm(
            "thrust curve of the throttle",
            "T/T_max = b u + (1 − b) u²",
            (Parameter("b", "1", -0.3, 1.0, meaning="linear share of thrust", negligible=2 * _LINEAR),),
            CURVE,
            root,
            (0.0,),
        ),
        SpeedForm(
            "power of the throttle",
            "ω = ω_max u^n",
            (
                Parameter(
                    "n",
                    "1",
                    0.2,
                    3.0,
                    meaning="exponent; 0.5 for a thrust proportional to the throttle",
                    negligible=_LINEAR,
                ),
            ),
            CURVE,
            power,
            (1.0,),
        ),
        SpeedForm(
            "power above a dead zone",
            "ω = ω_max ((u − u_0)/(1 − u_0))^n",
            (
                Parameter("u_0", "1", -0.05, 0.5, meaning="command at which the rotors start", negligible=_LINEAR),
                Parameter("n", "1", 0.2, 3.0, meaning="exponent", negligible=_LINEAR),
            ),
            CURVE,
            _power_from,
            (0.0, 1.0),
        ),
    ),
    shows_in=("lift_of_throttle", "lift_without_voltage", "follows"),
    source="PX4's THR_MDL_FAC; Quan, Introduction to Multicopter Design and Control, ch. 6; catalogue F2",
    sign=(
        "positive a_0 and a_1 turn faster than commanded; positive u_0 is a dead zone; b = 0 and n = 1 "
        "are a speed proportional to the command, as is e_u = 2"
    ),
    validity="static and the same for all rotors; at one voltage, or together with battery_sag",
    confusers=("battery_sag", "thrust_curve", "command_saturation"),
    separating_manoeuvre="step the throttle up and down over its whole range with two battery charges",
    separating_columns=("rotor_speed",),
    would_change=("thrust_coefficient_n_s2", "torque_coefficient_n_m_s2", "rotor_speed_limits_rad_s"),
    cases=("stand/single/throttle_curve/strong/0", "single/thrust_curve/strong/0"),
)
