"""A zero that wanders with time or temperature.

Where the reading was zeroed before each run the drift starts anew with it; where it was not, one function of the
session's time or of the temperature holds over all runs. A tare of each run imitates the latter with many numbers.
"""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter
from rotorid.effects.loading import AXES, TOO_SHORT, on_channels, one_per_channel

_DRIFT = "drift of the zero"
_REACH = 1.0
"""How far outside the temperatures recorded, as a share of their span, the zero may have been right."""


def _warming(instrument, name, equation, span_s, elapsed_s, shares):
    """y = F + b (1 − exp(−t/τ)), t = `elapsed_s(loading)`; τ is sought about these shares of `span_s`."""
    channels = instrument.channels

    def contribution(loading, vehicle, values):
        reading = np.zeros((loading.size, 6))
        shape = 1.0 - np.exp(-elapsed_s(loading) / max(values[-1], 1e-3))
        reading[:, list(channels)] = shape[:, None] * np.asarray(values[:-1])
        return Contribution(reading=reading)

    starts = tuple(share * span_s for share in shares)
    tau = Parameter("tau", "s", 0.08 * span_s, 5 * span_s, True, starts, "time of warming up")
    own = one_per_channel("b", "{}", channels, meaning=_DRIFT + " in the end")
    return Form(name, equation, (*own, tau), contribution)


def _zeroed_at(instrument):
    """y = F + b (T − T_0): zeroed at a temperature that nobody wrote down."""
    channels = instrument.channels

    def contribution(loading, vehicle, values):
        reading = np.zeros((loading.size, 6))
        warmer = loading.temperature_c - values[-1]
        reading[:, list(channels)] = warmer[:, None] * np.asarray(values[:-1])
        return Contribution(reading=reading)

    low, high = instrument.temperatures_c
    reach = _REACH * (high - low)
    guess = instrument.zero_temperature_c
    start = instrument.first_temperature_c if guess is None else guess
    starts = (float(np.clip(start, low - reach, high + reach)),)
    zero = Parameter("T_0", "°C", low - reach, high + reach, True, starts, "temperature at which the zero was right")
    own = one_per_channel("b", "{}/K", channels, meaning=_DRIFT)
    return Form("with temperature, zero at T_0", "y = F + b (T − T_0)", (*own, zero), contribution)


def reading_forms(instrument):
    channels = instrument.channels

    def of(name, equation, unit, signal, of_channels=channels):
        return on_channels(name, equation, "b", unit, of_channels, signal, meaning=_DRIFT)

    def minutes(loading):
        return loading.run_time_s / 60.0

    forms = [of("linear in time", "y = F + b t", "{}/min", minutes)]
    if len(channels) > 1:
        forms += [of(f"linear in time, {AXES[c]}", "y = F + b t", "{}/min", minutes, (c,)) for c in channels]
    text = "y = F + b (1 − exp(−t/τ))"
    if instrument.run_s > 5.0:
        forms.append(_warming(instrument, "warming up", text, instrument.run_s, lambda x: x.run_time_s, (0.15, 0.5)))
    if instrument.session_s > 5.0:
        forms.append(of("linear in the session's time", "y = F + b t_s", "{}/min", lambda x: x.session_time_s / 60.0))
        text, span_s, shares = "y = F + b (1 − exp(−t_s/τ))", instrument.session_s, (0.15, 0.5)
        name = "warming up over the session"
        forms.append(_warming(instrument, name, text, span_s, lambda x: x.session_time_s, shares))
    if instrument.temperature:
        forms.append(of("with temperature", "y = F + b ΔT", "{}/K", lambda x: x.temperature))
    if instrument.temperatures_c[1] > instrument.temperatures_c[0]:
        first = instrument.first_temperature_c
        text = "with temperature over the session"
        forms.append(of(text, "y = F + b (T − T_first)", "{}/K", lambda x: x.temperature_c - first))
        forms.append(_zeroed_at(instrument))
    return tuple(forms)


EFFECT = Effect(
    id="zero_drift",
    name="a drift of the zero",
    sentence="the reading wanders off with time whatever the load",
    forms=lambda vehicle: (),
    reading_forms=reading_forms,
    differs_between_runs="drift",
    remedy="zero",
    source="catalogue B1",
    sign="positive b: the reading rises with time or temperature at any load",
    validity=(
        "linear in time or temperature, or one exponential of warming up, from the start of each run where the "
        "reading was zeroed there, else from the start of the session or from the temperature of the last zeroing; "
        "a change of the gain with temperature is left out"
    ),
    excited_by=("time",),
    confusers=("creep", "tare_offset", "battery_sag", "wall_interference"),
    separating_manoeuvre="record the zero before, between and after the loads",
    separating_columns=("temperature",),
    kind="sensor",
    lack_on=lambda instrument: TOO_SHORT,
    cases=("bench/single/zero_drift/strong/0", "bench/single/tare_offset/strong/0"),
)
