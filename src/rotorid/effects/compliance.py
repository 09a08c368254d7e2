"""A bench or mount that bends under its load."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter
from rotorid.effects.loading import AXES, UNITS, cross_channels


def _growing(loading):
    """F|F|, (n, 6): an arm that gives way in proportion to the load turns and stretches the reading by it."""
    return loading.load * np.abs(loading.load)


def turning(loading, vehicle, values):
    """y − F = θ × F, θ = (−b F_y + e_x F_z, b F_x + e_y F_z, 0): what bends turns the load, loads along two axes too.

    b is the bending by forces across, e_x and e_y that by a vertical force whose line of action is off the support's.
    """
    force = loading.load[:, :3]
    bend, off_x, off_y = values
    angle = np.zeros_like(force)
    angle[:, 0] = -bend * force[:, 1] + off_x * force[:, 2]
    angle[:, 1] = bend * force[:, 0] + off_y * force[:, 2]
    reading = np.zeros((loading.size, 6))
    reading[:, :3] = np.cross(angle, force)
    return Contribution(reading=reading)


_TURNS = (
    Parameter("b", "rad/N", meaning="turn per force across"),
    Parameter("e_x", "rad/N", meaning="turn about x per vertical force"),
    Parameter("e_y", "rad/N", meaning="turn about y per vertical force"),
)


def _form(name, pairs):
    parameters = tuple(
        Parameter(f"k_{AXES[t]},{AXES[s]}", f"{UNITS[t]}/({UNITS[s]})2", meaning="reading per square of the load")
        for t, s in pairs
    )
    aside = tuple(i for i, (t, s) in enumerate(pairs) if t != s)
    must = aside[:1] if len(aside) == 1 else ()
    return Form(name, "y_i = F_i + k_ij F_j |F_j|", parameters, cross_channels(pairs, _growing), must_show=must)


def reading_forms(instrument):
    if not instrument.bench:
        return ()
    sources = tuple(s for s in instrument.loaded if s < 3)
    forms = []
    for s in sources:
        targets = tuple(t for t in instrument.channels if t < 3)
        if len(targets) > 1:
            forms.append(_form(f"under {AXES[s]}", tuple((t, s) for t in targets)))
            aside = [t for t in targets if t != s and t < 3]
            forms += [_form(f"under {AXES[s]}, towards {AXES[t]}", ((s, s), (t, s))) for t in aside]
    if len(sources) > 1:
        pairs = tuple((t, s) for s in sources for t in instrument.channels if t < 3)
        forms.append(_form("under all forces", pairs))
    if sources == (0, 1, 2) and set(sources) <= set(instrument.channels):
        forms.append(Form("turning", "y = F + θ × F, θ = (−b F_y + e_x F_z, b F_x + e_y F_z, 0)", _TURNS, turning))
    return tuple(forms)


EFFECT = Effect(
    id="compliance",
    name="the bending of the bench",
    sentence="under load the structure gives way, so the error grows faster than the load and its direction turns",
    forms=lambda vehicle: (),
    reading_forms=reading_forms,
    of_the_rig=True,
    remedy="calibrate",
    source="thesis 2.5 and 2.8: the PLA bench",
    sign="positive k_ij: a load along +j reads further towards +i, by k_ij times its square",
    validity=(
        "deflections small and elastic, in proportion to the load, without delay; the stiffness of each "
        "direction is taken as constant"
    ),
    excited_by=("load",),
    confusers=("load_nonlinearity", "crosstalk"),
    separating_manoeuvre="measure the deflection as well as the load, or brace the structure and repeat",
    kind="physics",
    lack_on=lambda instrument: (
        "one channel only is read"
        if instrument.bench
        else "a stand has no known load whose direction could be seen to turn"
    ),
    cases=("bench/single/compliance/strong/0", "bench/single/crosstalk/strong/0"),
)
