"""Commands beyond what the rotors can do."""

import numpy as np

from rotorid.effects.contract import Effect, Parameter, SpeedForm


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
            (Parameter("w_high", "ω_max", 0.3, 1.2, nonlinear=True, starts=(0.95, 0.9, 0.8, 0.7)),),
            2,
            upper,
            (1.0,),
        ),
        SpeedForm(
            "lower limit",
            "ω = max(ω_c, ω_low)",
            (Parameter("w_low", "ω_max", -0.1, 0.6, nonlinear=True, starts=(0.1, 0.2, 0.3)),),
            2,
            lower,
            (0.0,),
        ),
    ),
    source="physics.md F25",
    confusers=("throttle_curve", "motor_lag"),
    separating_manoeuvre="repeat the manoeuvre at half the amplitude",
)
