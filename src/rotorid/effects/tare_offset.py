"""A reading that is not zero without a load."""

from dataclasses import replace

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter
from rotorid.effects.loading import AXES, UNITS, on_channels

_ZERO = "reading without a load"
_RESOLUTION, _RESOLUTION_IN_EACH_RUN = 2.0, 4.0
"""A tare is the mean of a few samples, and only as good: an offset must be so many times larger than other effects."""


def _own_in_each_run(instrument):
    runs, channels = instrument.runs, instrument.channels

    def contribution(loading, vehicle, values):
        reading = np.zeros((loading.size, 6))
        if loading.run in runs:
            reading[:, list(channels)] = np.reshape(values, (len(runs), len(channels)))[runs.index(loading.run)]
        return Contribution(reading=reading)

    parameters = tuple(Parameter(f"b_{AXES[c]}({run})", UNITS[c], meaning=_ZERO) for run in runs for c in channels)
    return Form("own in each run", "y = F + b(run)", parameters, contribution, resolution=_RESOLUTION_IN_EACH_RUN)


def reading_forms(instrument):
    def one(loading):
        return np.ones(loading.size)

    channels = instrument.channels
    forms = [on_channels("constant", "y = F + b", "b", "{}", channels, one, meaning=_ZERO)]
    forces = tuple(c for c in channels if c < 3)
    if forces and len(forces) < len(channels):
        forms.append(on_channels("constant in the forces", "y = F + b", "b", "{}", forces, one, meaning=_ZERO))
        moments = tuple(c for c in channels if c >= 3)
        forms.append(on_channels("constant in the moments", "y = F + b", "b", "{}", moments, one, meaning=_ZERO))
    if len(channels) > 1:
        forms += [
            on_channels(f"constant in {AXES[c]}", "y = F + b", "b", "{}", (c,), one, meaning=_ZERO) for c in channels
        ]
    forms = [replace(form, resolution=_RESOLUTION) for form in forms]
    if 1 < len(instrument.runs) <= 60 // len(channels):
        forms.append(_own_in_each_run(instrument))
    return tuple(forms)


EFFECT = Effect(
    id="tare_offset",
    name="a tare offset",
    sentence="the reading is not zero without a load",
    forms=lambda vehicle: (),
    reading_forms=reading_forms,
    differs_between_runs="zero",
    remedy="zero",
    source="catalogue B6",
    sign="positive b: the reading is too large by b at any load",
    validity=(
        "a constant over the set, or over each run for the form that says so; what wanders inside a run is zero_drift"
    ),
    excited_by=("always",),
    confusers=("thrust_curve", "zero_drift", "com_offset"),
    separating_manoeuvre="record a few seconds without a load before and after, at every attitude of the mount",
    kind="sensor",
    exact=True,
    cases=("bench/single/tare_offset/strong/0", "bench/single/zero_drift/strong/0"),
)
