"""A zero that wanders with time or temperature."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter
from rotorid.effects.loading import AXES, on_channels, one_per_channel


def warming(instrument):
    """y = F + b (1 − exp(−t/τ)), t from the run's start."""
    channels = instrument.channels

    def contribution(loading, vehicle, values):
        reading = np.zeros((loading.size, 6))
        shape = 1.0 - np.exp(-loading.run_time_s / max(values[-1], 1e-3))
        reading[:, list(channels)] = shape[:, None] * np.asarray(values[:-1])
        return Contribution(reading=reading)

    span = instrument.run_s
    tau = Parameter(
        "tau",
        "s",
        0.08 * span,
        5 * span,
        nonlinear=True,
        starts=(0.15 * span, 0.5 * span),
        meaning="time of warming up",
    )
    parameters = (*one_per_channel("b", "{}", channels, meaning="drift of the zero in the end"), tau)
    return Form("warming up", "y = F + b (1 − exp(−t/τ))", parameters, contribution)


def reading_forms(instrument):
    channels = instrument.channels
    linear = "y = F + b t"
    forms = [
        on_channels(
            "linear in time",
            linear,
            "b",
            "{}/min",
            channels,
            lambda x: x.run_time_s / 60.0,
            meaning="drift of the zero",
        ),
        *(
            on_channels(
                f"linear in time, {AXES[c]}",
                linear,
                "b",
                "{}/min",
                (c,),
                lambda x: x.run_time_s / 60.0,
                meaning="drift of the zero",
            )
            for c in channels
            if len(channels) > 1
        ),
    ]
    if instrument.run_s > 5.0:
        forms.append(warming(instrument))
    forms.append(
        on_channels(
            "with temperature",
            "y = F + b ΔT",
            "b",
            "{}/K",
            channels,
            lambda x: x.temperature,
            meaning="drift of the zero",
        )
        if instrument.temperature
        else None
    )
    return tuple(f for f in forms if f is not None)


EFFECT = Effect(
    id="zero_drift",
    name="a drift of the zero",
    sentence="the reading wanders off with time whatever the load",
    forms=lambda vehicle: (),
    reading_forms=reading_forms,
    source="catalogue B1",
    sign="positive b: the reading rises with time or temperature at any load",
    validity=(
        "linear in time or temperature, or one exponential of warming up, from the start of each run; a "
        "change of the gain with temperature is left out"
    ),
    excited_by=("time",),
    confusers=("creep", "battery_sag", "wall_interference"),
    separating_manoeuvre="record the zero before, between and after the loads, with the temperature",
    kind="sensor",
)
