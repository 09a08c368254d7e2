"""A reading that goes on growing for a while after a load has come on."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter, compiled
from rotorid.effects.loading import TOO_SHORT, change_of_load, one_per_channel


@compiled()
def _follow(load, share):
    out = np.empty_like(load)
    for j in range(load.shape[1]):
        state = 0.0
        for i in range(load.shape[0]):
            out[i, j] = state
            state += share * (load[i, j] - state)
    return out


def followed(load, tau_s, dt_s):
    """First-order lag of (n, k) from rest, exact for loads that hold over a sample."""
    return _follow(np.ascontiguousarray(load), 1.0 - np.exp(-dt_s / max(tau_s, 1e-6)))


def _creeping(loading, tau_s):
    """What creep adds per unit of its share, (n, 6)."""
    return followed(change_of_load(loading), tau_s, loading.dt_s)


def _all_alike(loading, vehicle, values):
    """y = F + c LP(F), the share alike on all channels."""
    return Contribution(reading=values[0] * _creeping(loading, values[1]))


def _own(channels):
    def contribution(loading, vehicle, values):
        reading = np.zeros((loading.size, 6))
        reading[:, list(channels)] = _creeping(loading, values[-1])[:, list(channels)] * np.asarray(values[:-1])
        return Contribution(reading=reading)

    return contribution


def _two_times(channels, alike):
    """y = F + c (F after t_c) + d (F after t_d), the shares alike on all channels or own."""

    def contribution(loading, vehicle, values):
        reading = np.zeros((loading.size, 6))
        shares = np.reshape(values[:-2], (2, -1))
        for own, tau_s in zip(shares, values[-2:], strict=True):
            reading[:, list(channels)] += _creeping(loading, tau_s)[:, list(channels)] * own
        return Contribution(reading=reading)

    if alike:
        shares = tuple(Parameter(n, "1", -0.05, 0.3, meaning="share of the load") for n in "cd")
    else:
        shares = tuple(
            p for n in "cd" for p in one_per_channel(n, "1", channels, low=-0.05, high=0.3, meaning="share of the load")
        )
    return shares, contribution


def reading_forms(instrument):
    span = instrument.duration_s
    shortest = max(0.5, 10.0 / instrument.rate_hz)
    if span < 4 * shortest:
        return ()
    starts = tuple(t for t in (1.5, 6.0, 25.0, 100.0, 400.0) if shortest <= t <= span) or (0.5 * span,)
    tau = Parameter("t_c", "s", shortest, 3 * span, nonlinear=True, starts=starts, meaning="time constant")
    share = Parameter("c", "1", 0.0, 0.3, meaning="share of the load")
    text = "y = F + c (F after a lag of t_c)"
    forms = [Form("alike on all channels", text, (share, tau), _all_alike)]
    loaded = tuple(c for c in instrument.channels if c in instrument.loaded)
    if len(loaded) > 1:
        own = one_per_channel("c", "1", loaded, low=-0.05, high=0.3, meaning="share of the load")
        forms.append(Form("own on each channel", text, (*own, tau), _own(loaded)))
    if span > 16 * shortest:
        text = "y = F + c (F after a lag of t_c) + d (F after a lag of t_d)"
        quick = Parameter("t_c", "s", shortest, span, True, (0.03 * span, 0.12 * span), "shorter time constant")
        slow = Parameter("t_d", "s", 0.2 * span, 6 * span, True, (span,), "longer time constant")
        for alike in (True, False) if len(loaded) > 1 else (True,):
            shares, contribution = _two_times(loaded, alike)
            where = "alike on all channels" if alike else "own on each channel"
            forms.append(Form(f"two time constants, {where}", text, (*shares, quick, slow), contribution))
    return tuple(forms)


EFFECT = Effect(
    id="creep",
    name="creep of the sensor",
    sentence="after each change of load the reading creeps on in the same direction",
    forms=lambda vehicle: (),
    reading_forms=reading_forms,
    remedy="calibrate",
    source="catalogue B2",
    sign=(
        "positive c: the reading goes on in the direction of the change of load, by c of it in the end, and "
        "comes back likewise after unloading"
    ),
    validity=(
        "one or two exponentials, linear in the load, from rest; what the sensor bore before the run and a change with "
        "temperature are left out"
    ),
    excited_by=("load_change",),
    confusers=("zero_drift", "wall_interference", "battery_sag", "amplifier_filter"),
    separating_manoeuvre="hold a weight for minutes, take it off and go on recording",
    kind="sensor",
    shows="in what takes time",
    lack_on=lambda instrument: TOO_SHORT,
    cases=("bench/single/creep/moderate/0", "bench/single/zero_drift/strong/0"),
)
