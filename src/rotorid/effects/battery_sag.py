"""Rotor speed that falls with the battery's voltage.

Where no speed is recorded it is stated about the mean voltage of the set, as what commands alone determine: by how
many percent the thrust falls for one percent less voltage (`about`).
"""

import re

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


_ABOUT = re.compile(r"power about ([0-9.e-]+)")


def about(share):
    """The form about a voltage, a share of the set's largest, at which it changes nothing."""

    def apply(path, values):
        return path.speed * ((path.voltage / path.full_voltage / share) ** (0.5 * values[0]))[:, None]

    return SpeedForm(
        f"power about {share:.6g}",
        f"T ∝ V^e_V, as commanded at {share:.3g} of the largest voltage",
        (Parameter("e_V", "1", 0.0, 6.0, meaning="percent less thrust for one percent less voltage", negligible=0.1),),
        SUPPLY,
        apply,
        (0.0,),
        ("voltage",),
        "voltage",
    )


def form_named(name):
    """The form about a voltage, from the name that `about` gave it."""
    found = _ABOUT.fullmatch(name)
    return about(float(found[1])) if found else None


P = Parameter("p", "1", 0.0, 3.0, meaning="exponent of the voltage; 1 for a speed proportional to it")

EFFECT = Effect(
    id="battery_sag",
    name="the sag of the battery",
    sentence="all rotors turn slower than commanded as the battery's voltage falls",
    forms=lambda vehicle: (),
    form_named=form_named,
    about=about,
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
    cases=("single/battery_sag/strong/0", "single/command_saturation/moderate/0"),
)
