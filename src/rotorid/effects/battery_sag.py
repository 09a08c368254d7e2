"""Rotor speed that falls with the battery's voltage."""

import numpy as np

from rotorid.effects.contract import SUPPLY, Effect, Parameter, SpeedForm


def power(path, values):
    """ω = ω_c (V/V_0)^p, V_0 the set's largest voltage."""
    return path.speed * ((path.voltage / path.full_voltage) ** values[0])[:, None]


def _power_of_reference(path, values):
    """ω = ω_c (1 + g) (V/V_0)^p: the command is right at another voltage than the largest."""
    return (1 + values[1]) * power(path, values[:1])


def drift(path, values):
    """ω = ω_c (1 - k t) within a run, without a voltmeter; t in minutes from the run's start."""
    minutes = (path.time_s - path.time_s[0]) / 60.0
    return path.speed * np.maximum(1.0 - values[0] * minutes, 0.05)[:, None]


P = Parameter("p", "1", 0.0, 3.0, meaning="exponent of the voltage; 1 for a speed proportional to it")

EFFECT = Effect(
    id="battery_sag",
    name="the sag of the battery",
    sentence="all rotors turn slower than commanded as the battery's voltage falls",
    forms=lambda vehicle: (),
    speed_forms=(
        SpeedForm("power of voltage", "ω = ω_c (V/V_0)^p", (P,), SUPPLY, power, (0.0,), ("voltage",), "voltage"),
        SpeedForm(
            "power of voltage, own reference",
            "ω = (1 + g) ω_c (V/V_0)^p",
            (P, Parameter("g", "1", -0.5, 1.0, meaning="excess of speed at the largest voltage")),
            SUPPLY,
            _power_of_reference,
            (0.0, 0.0),
            ("voltage",),
            own_scale=True,
        ),
        SpeedForm(
            "drift in time",
            "ω = ω_c (1 − k t)",
            (Parameter("k", "1/min", 0.0, 1.0, meaning="share of the speed lost per minute", negligible=0.01),),
            SUPPLY,
            drift,
            (0.0,),
            excited_by="time",
        ),
    ),
    shows_in=("lift_of_throttle", "lift_without_voltage", "follows"),
    source=(
        "Bitcraze, thrust against battery voltage of the Crazyflie; Quan, Introduction to Multicopter "
        "Design and Control, ch. 6; catalogue F4"
    ),
    sign="positive p and k make the rotors slower as the voltage falls or time passes",
    validity=("speed controllers without feedback of the speed; the exponent is constant over the battery's range"),
    confusers=("throttle_curve", "command_saturation"),
    separating_manoeuvre="rest the battery and repeat the same hover",
    separating_columns=("voltage",),
)
