"""A load on one axis that another channel reads."""

from rotorid.effects.contract import Effect, Form, Parameter
from rotorid.effects.loading import AXES, UNITS, bracketed, cross_channels


def _form(name, pairs):
    parameters = tuple(
        Parameter(
            f"C_{AXES[t]},{AXES[s]}",
            "1" if UNITS[t] == UNITS[s] else f"{UNITS[t]}/{bracketed(UNITS[s])}",
            meaning="reading on i per load on j",
        )
        for t, s in pairs
    )
    return Form(name, "y_i = F_i + C_ij F_j", parameters, cross_channels(pairs, lambda x: x.load))


def reading_forms(instrument):
    channels = instrument.channels
    sources = instrument.loaded
    forms = []
    for s in sources:
        targets = tuple(t for t in channels if t != s)
        if targets:
            forms.append(_form(f"from {AXES[s]}", tuple((t, s) for t in targets)))
            if len(targets) > 1 and s < 3:
                forms += [_form(f"from {AXES[s]} to {AXES[t]}", ((t, s),)) for t in targets]
    forces = tuple((t, s) for s in sources if s < 3 for t in channels if t != s and t < 3)
    every = tuple((t, s) for s in sources for t in channels if t != s)
    if len(sources) > 1:
        if forces and forces != every:
            forms.append(_form("between the forces", forces))
        forms.append(_form("between all", every))
    if instrument.weighed:
        whole = (*sources, *instrument.weighed)
        forms.append(_form("between all, of the weight too", tuple((t, s) for s in whole for t in channels if t != s)))
    return tuple(forms)


EFFECT = Effect(
    id="crosstalk",
    name="crosstalk between the axes",
    sentence="a load on one axis is read on another in proportion",
    forms=lambda vehicle: (),
    reading_forms=reading_forms,
    differs_between_runs="of other axes",
    remedy="calibrate",
    source="catalogue B5",
    sign="positive C_ij: a load along +j reads as one along +i on channel i",
    validity=(
        "linear and without delay; of the cells, or of equations that make forces of their readings: a set of forces "
        "does not show which, cell readings under loads of known direction do; a gain error on the load's own axis is "
        "no crosstalk, and curvature is left to compliance and load_nonlinearity"
    ),
    excited_by=("load",),
    confusers=("mount_tilt", "sensor_origin", "thrust_tilt"),
    separating_manoeuvre="put known weights on along one axis after the other",
    kind="sensor",
    lack_on=lambda instrument: "one channel only is read",
    cases=("bench/single/crosstalk/strong/0", "bench/single/mount_tilt/strong/0"),
)
