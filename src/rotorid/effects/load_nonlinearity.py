"""A reading that is not proportional to the load on its own axis."""

from dataclasses import replace

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter
from rotorid.effects.loading import AXES, UNITS, bracketed, cross_channels, one_per_channel

_CURVE = "curvature of the characteristic"


def reading_forms(instrument):
    loaded = tuple(c for c in instrument.channels if c in instrument.loaded)
    forms = []
    shapes = (
        ("square", "y = F + a_2 F²", "a_2", "1/{}", lambda x: x.load**2),
        ("odd square", "y = F + a_2 F|F|", "a_2", "1/{}", lambda x: x.load * np.abs(x.load)),
        ("cube", "y = F + a_3 F³", "a_3", "1/{}2", lambda x: x.load**3),
    )
    groups = [(loaded, "")] + [((c,), f" of {AXES[c]}") for c in loaded if len(loaded) > 1 and c < 3]
    for group, suffix in groups:
        if not group:
            continue
        pairs = tuple((c, c) for c in group)
        for name, text, symbol, unit, signal in shapes:
            own = tuple(
                Parameter(f"{symbol}_{AXES[c]}", unit.format(bracketed(UNITS[c])), meaning=_CURVE) for c in group
            )
            forms.append(Form(name + suffix, text, own, cross_channels(pairs, signal)))
        both = tuple(Parameter(f"a_2_{AXES[c]}", f"1/{bracketed(UNITS[c])}", meaning=_CURVE) for c in group) + tuple(
            Parameter(f"a_3_{AXES[c]}", f"1/{bracketed(UNITS[c])}2", meaning=_CURVE) for c in group
        )
        forms.append(Form("square and cube" + suffix, "y = F + a_2 F² + a_3 F³", both, _both(pairs)))
        gains = tuple(f"gain_{AXES[c][-1].lower()}" for c in group if c < 3) + (("gain",) if group == loaded else ())
        forms.append(replace(_s_shape(instrument, group, "S-shape" + suffix), takes_up=gains))
        if group != loaded:
            continue
        fifth = tuple(Parameter(f"a_3_{AXES[c]}", f"1/{bracketed(UNITS[c])}2", meaning=_CURVE) for c in group) + tuple(
            Parameter(f"a_5_{AXES[c]}", f"1/{bracketed(UNITS[c])}4", meaning=_CURVE) for c in group
        )
        odd = _both(pairs, lambda x: x.load**3, lambda x: x.load**5)
        forms.append(Form("cube and fifth power", "y = F + a_3 F³ + a_5 F⁵", fifth, odd))
    return tuple(forms)


def _s_shape(instrument, group, name):
    """y = F + a sin(π F/(s F_max)): right at no load and at the full scale, s times the largest load recorded.

    Its slope at no load is a part of the curve: what it takes there of the linear gain is no wrong calibration.
    """
    largest = np.array(instrument.largest)

    def contribution(loading, vehicle, values):
        reading = np.zeros((loading.size, 6))
        turn = np.sin(np.pi * loading.load / (values[-1] * largest))
        reading[:, list(group)] = turn[:, list(group)] * np.asarray(values[:-1])
        return Contribution(reading=reading)

    own = one_per_channel("a", "{}", group, meaning=_CURVE)
    starts = (0.9, 1.4) if len(group) > 1 else (1.2,)
    scale = Parameter("s", "1", 0.7, 3.0, True, starts, "full scale by the largest load")
    return Form(name, "y = F + a sin(π F/(s F_max))", (*own, scale), contribution)


def _both(pairs, one=lambda x: x.load**2, other=lambda x: x.load**3):
    square, cube = cross_channels(pairs, one), cross_channels(pairs, other)

    def contribution(loading, vehicle, values):
        first, second = square(loading, vehicle, values[: len(pairs)]), cube(loading, vehicle, values[len(pairs) :])
        return type(first)(reading=first.reading + second.reading)

    return contribution


EFFECT = Effect(
    id="load_nonlinearity",
    name="a curved characteristic of the sensor",
    sentence="the reading's error grows with the load on the same axis, faster than in proportion",
    forms=lambda vehicle: (),
    reading_forms=reading_forms,
    remedy="calibrate",
    source="catalogue B4",
    sign=(
        "positive a_2 of the square raises the reading under a load of either sign; positive a of the odd "
        "square and of the cube make it too large in magnitude"
    ),
    validity=(
        "a static curve of each channel by the load on its own axis, inside the loads recorded; the linear "
        "gain is the calibration's and no part of it"
    ),
    excited_by=("load",),
    confusers=("thrust_curve", "compliance", "hysteresis"),
    separating_manoeuvre="load with dead weights over the whole range, motors off",
    kind="sensor",
    curve_of_load=True,
    cases=("bench/single/load_nonlinearity/strong/0", "bench/single/compliance/strong/0"),
)
