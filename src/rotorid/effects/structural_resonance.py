"""A stand that rings at a frequency of its own."""

from functools import lru_cache

import numpy as np
from scipy.signal import cont2discrete, lfilter

from rotorid.effects.contract import Contribution, Effect, Form, Parameter
from rotorid.effects.loading import TOO_SHORT, since_the_first, unsmoothed


def resonance(signal, frequency_hz, damping, dt_s):
    """ω_n²/(s² + 2 ζ ω_n s + ω_n²) on (n, k), from rest; the gain holds far up to half the rate."""
    b, a = _recursion(float(frequency_hz), float(damping), float(dt_s))
    return lfilter(b, a, unsmoothed(signal), axis=0)


@lru_cache(maxsize=256)
def _recursion(frequency_hz, damping, dt_s):
    """Coefficients of the recursion, exact for inputs that are linear between samples."""
    w = 2 * np.pi * max(frequency_hz, 1e-3)
    b, a, _ = cont2discrete(([w * w], [1.0, 2 * max(damping, 1e-4) * w, w * w]), dt_s, method="foh")
    return b[0], a


def _ringing(loading, vehicle, values):
    """y = F + p (H(s) − 1) F: of a structure's modes one rings in the band, and bends under a part p of the load."""
    load = since_the_first(loading)
    return Contribution(reading=values[2] * (resonance(load, values[0], values[1], loading.dt_s) - load))


def reading_forms(instrument):
    highest = 0.4 * instrument.rate_hz
    starts = tuple(
        f for f in (3.0, 5.0, 8.0, 12.0, 18.0, 26.0, 38.0, 55.0) if f < highest and f > 4 / instrument.duration_s
    )
    if not starts:
        return ()
    frequency = Parameter("f_n", "Hz", 0.5, highest, nonlinear=True, starts=starts, meaning="natural frequency")
    damping = Parameter("zeta", "1", 0.001, 0.6, nonlinear=True, starts=(0.05,), meaning="damping ratio")
    part = Parameter("p", "1", 0.0, 3.0, nonlinear=True, starts=(1.0,), meaning="part of the load that it bends under")
    return (
        Form(
            "second order",
            "y = F + p (H − 1) F, H = f_n² / (f_n² − f² + 2 i ζ f_n f)",
            (frequency, damping, part),
            _ringing,
        ),
    )


EFFECT = Effect(
    id="structural_resonance",
    name="a resonance of the structure",
    sentence="after each change of load the reading rings at one fixed frequency",
    forms=lambda vehicle: (),
    reading_forms=reading_forms,
    of_the_rig=True,
    source="catalogue B8",
    sign="f_n and ζ are positive; no steady reading changes, a step overshoots by exp(−π ζ/√(1 − ζ²))",
    validity=(
        "one linear mode with the same part p on all channels, from rest, below 0.4 of the recording's rate; "
        "further modes and their coupling are left out"
    ),
    excited_by=("load_change",),
    confusers=("motor_lag", "amplifier_filter"),
    separating_manoeuvre="tap the stand with the motors off and look at the ringing",
    kind="physics",
    shows="after a change of load",
    lack_on=lambda instrument: TOO_SHORT,
    cases=("bench/single/structural_resonance/strong/0", "bench/single/amplifier_filter/strong/0"),
)
