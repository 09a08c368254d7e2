"""Commands beyond what the rotors can do."""

import numpy as np

from rotorid.effects.contract import LIMIT, Effect, Parameter, SpeedForm


def upper(path, values):
    """ω = min(ω_c, ω_high); the parameter is ω_high/ω_max."""
    return np.minimum(path.speed, values[0] * path.full_speed)


def lower(path, values):
    """ω = max(ω_c, ω_low); the parameter is ω_low/ω_max."""
    return np.maximum(path.speed, values[0] * path.full_speed)


EFFECT = Effect(
    id="command_saturation",
    name="saturation of the rotors",
    sentence="rotor speed stops at a limit while the command goes on",
    forms=lambda vehicle: (),
    speed_forms=(
        SpeedForm(
            "upper limit",
            "ω = min(ω_c, ω_high)",
            (Parameter("w_high", "ω_max", 0.3, 1.2, True, (0.95, 0.9, 0.8, 0.7), "highest speed"),),
            LIMIT,
            upper,
            (1.0,),
            excited_by="limit",
        ),
        SpeedForm(
            "lower limit",
            "ω = max(ω_c, ω_low)",
            (Parameter("w_low", "ω_max", -0.1, 0.6, True, (0.1, 0.2, 0.3), "lowest speed"),),
            LIMIT,
            lower,
            (0.0,),
            excited_by="limit",
        ),
    ),
    source="Quan, Introduction to Multicopter Design and Control, ch. 6; catalogue F25",
    sign=("ω_high and ω_low are the speeds at which the rotors stop following, as shares of the largest speed"),
    validity="hard limits, the same for all rotors; rate limits of the speed controllers are left out",
    confusers=("throttle_curve", "motor_lag"),
    separating_manoeuvre="repeat the manoeuvre at half the amplitude",
    separating_columns=("rotor_speed",),
    cases=("single/command_saturation/moderate/0", "single/motor_lag/moderate/0"),
)
