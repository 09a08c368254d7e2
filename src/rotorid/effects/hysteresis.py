"""A reading that depends on whether the load came from below or from above."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter, compiled
from rotorid.effects.loading import AXES, UNITS, change_of_load, cross_channels, on_channels, one_per_channel

_HALF = "half the height of the loop"
NARROW, WIDE = 0.02, 0.15
MIDDLE = (NARROW * WIDE) ** 0.5
"""Half widths of the play as shares of the largest load."""
_WIDTHS = {"narrow": NARROW, "middle": MIDDLE, "wide": WIDE}


@compiled()
def _play(load, width):
    out = np.empty_like(load)
    state = 0.0
    for i in range(len(load)):
        state = min(max(state, load[i] - width), load[i] + width)
        out[i] = state
    return out


def play(load, width):
    """Play (backlash) of half width `width` that follows a load (n,) from zero, (n,)."""
    return _play(np.ascontiguousarray(load), width)


@compiled()
def _settling(load, width):
    out = np.empty_like(load)
    state, before = 0.0, 0.0
    for i in range(len(load)):
        step = load[i] - before
        towards = 1.0 if step > 0.0 else -1.0
        state = towards + (state - towards) * np.exp(-abs(step) / width)
        before = load[i]
        out[i] = state
    return out


def settling(load, width):
    """Branch z of a load (n,) from none: dz = (dF − |dF| z)/width, exact for steps of any length, (n,).

    A turned load changes branch by an exponential of the way gone since (P. Dahl, A Solid Friction Model, 1968, with
    exponent one; the rate-independent Duhem and Bouc-Wen loops of that exponent are the same).
    """
    return _settling(np.ascontiguousarray(load), width)


def _branches(instrument, share):
    """Branch of each channel between −1 (load falling) and 1 (rising), (n, 6), by the play operator."""

    def signal(loading):
        load = change_of_load(loading)
        out = np.zeros_like(load)
        for c in instrument.loaded:
            width = share * instrument.largest[c]
            out[:, c] = (load[:, c] - play(load[:, c], width)) / width
        return out

    return signal


def _lens(instrument, share):
    """The same loop, zero at no load and at the largest: what a spring of metal does, (n, 6)."""
    branch = _branches(instrument, share)

    def signal(loading):
        part = np.abs(change_of_load(loading)) / np.array(instrument.largest)
        return branch(loading) * 4.0 * part * np.clip(1.0 - part, 0.0, 1.0)

    return signal


def reading_forms(instrument):
    loaded = tuple(c for c in instrument.channels if c in instrument.returns)
    if not loaded:
        return ()
    text = "y = F + h (branch of F: 1 rising, −1 falling)"
    forms = []
    for name, share in (("narrow", NARROW), ("wide", WIDE)):
        forms.append(on_channels(f"{name} play", text, "h", "{}", loaded, _branches(instrument, share), meaning=_HALF))
        forms.append(
            on_channels(
                f"{name} lens", text + " × 4 f (1 − f)", "h", "{}", loaded, _lens(instrument, share), meaning=_HALF
            )
        )
        if 1 < len(loaded) <= 3:
            for c in loaded:
                own = one_per_channel("h", "{}", (c,), meaning=_HALF)
                for shape, signal in (("play", _branches(instrument, share)), ("lens", _lens(instrument, share))):
                    forms.append(Form(f"{name} {shape} of {AXES[c]}", text, own, cross_channels(((c, c),), signal)))
    forms += _exponential_forms(instrument, loaded)
    shares = tuple(Parameter(f"h_{n}", "1", meaning=_HALF + " by the largest load") for n in ("narrow", "wide"))
    forms.append(Form("two plays, alike on all channels", text, shares, _alike(instrument, loaded)))
    if len(loaded) == 1:
        for name, widths in (("two plays", ("narrow", "wide")), ("three plays", tuple(_WIDTHS))):
            own = tuple(Parameter(f"h_{n}", UNITS[loaded[0]], meaning=_HALF) for n in widths)
            forms.append(Form(name, text, own, _plays(instrument, loaded[0], widths)))
    else:
        # Not three for each channel: as many parameters would take in what other causes leave.
        groups = tuple(g for g in (tuple(c for c in loaded if c < 3), tuple(c for c in loaded if c >= 3)) if g)
        own = tuple(
            Parameter(f"h_{n}_{'F' if g[0] < 3 else 'M'}", UNITS[g[0]], meaning=_HALF) for g in groups for n in _WIDTHS
        )
        forms.append(Form("three plays, alike on forces and on moments", text, own, _of_a_range(instrument, groups)))
    return tuple(forms)


def _exponential_forms(instrument, loaded):
    """Loops of exponentials: one width for all channels, by their largest loads, then one of its own for each."""
    text = "y = F + h z, dz = (dF − |dF| z)/(w F_max)"
    meaning = "way to the other branch by the largest load"

    def width(name, *starts):
        return Parameter(name, "1", 0.002, 0.6, True, starts, meaning)

    def form(name, channels, widths):
        own = one_per_channel("h", "{}", channels, meaning=_HALF)
        return Form(name, text, (*own, *widths), _exponential(instrument, channels))

    forms = [form("exponential loop", loaded, (width("w", 0.02, 0.06, 0.2),))]
    if 1 < len(loaded) <= 3:
        forms.append(form("exponential loops of own width", loaded, tuple(width(f"w_{AXES[c]}", 0.06) for c in loaded)))
        forms += [form(f"exponential loop of {AXES[c]}", (c,), (width("w", 0.02, 0.06, 0.2),)) for c in loaded]
    return forms


def _exponential(instrument, channels):
    def contribution(loading, vehicle, values):
        reading, load = np.zeros((loading.size, 6)), change_of_load(loading)
        heights, widths = values[: len(channels)], values[len(channels) :]
        for i, c in enumerate(channels):
            width = widths[i if len(widths) > 1 else 0] * instrument.largest[c]
            reading[:, c] = heights[i] * settling(load[:, c], width)
        return Contribution(reading=reading)

    return contribution


def _alike(instrument, loaded):
    signals = [_branches(instrument, share) for share in (NARROW, WIDE)]
    scale = np.zeros(6)
    scale[list(loaded)] = np.array(instrument.largest)[list(loaded)]

    def contribution(loading, vehicle, values):
        return Contribution(reading=sum(v * s(loading) for v, s in zip(values, signals, strict=True)) * scale)

    return contribution


def _plays(instrument, channel, widths):
    """Plays of several widths on one channel."""
    signals = [_branches(instrument, _WIDTHS[n]) for n in widths]

    def contribution(loading, vehicle, values):
        reading = np.zeros((loading.size, 6))
        reading[:, channel] = sum(v * s(loading)[:, channel] for v, s in zip(values, signals, strict=True))
        return Contribution(reading=reading)

    return contribution


def _of_a_range(instrument, groups):
    """Plays of a sensor whose forces have one range, and its moments another: the same widths and heights on each."""
    largest = {g: max(instrument.largest[c] for c in g) for g in groups}

    def contribution(loading, vehicle, values):
        reading, load = np.zeros((loading.size, 6)), change_of_load(loading)
        for group, heights in zip(groups, np.reshape(values, (len(groups), len(_WIDTHS))), strict=True):
            for share, height in zip(_WIDTHS.values(), heights, strict=True):
                width = share * largest[group]
                for c in group:
                    reading[:, c] += height * (load[:, c] - play(load[:, c], width)) / width
        return Contribution(reading=reading)

    return contribution


EFFECT = Effect(
    id="hysteresis",
    name="hysteresis of the sensor",
    sentence="at the same load the reading differs between loading and unloading",
    forms=lambda vehicle: (),
    reading_forms=reading_forms,
    remedy="calibrate",
    source="catalogue B3",
    sign=(
        "positive h: at the same load the reading is higher by h while the load rises (towards +) and lower "
        "by h while it falls; negative h is a reading that hangs behind its load"
    ),
    validity=(
        "a loop independent of the rate of loading, by play operators whose half widths are 2, 5 and 15 per cent of "
        "the largest load or by exponentials of the way since the load turned; shows only where loads come back from "
        "above, and what was loaded before the run is not known"
    ),
    excited_by=("load_change",),
    confusers=("creep", "amplifier_filter", "motor_lag"),
    separating_manoeuvre="load up and down in the same steps at two rates",
    kind="sensor",
    lack_on=lambda instrument: "the load never comes back from above to a value other than none",
    cases=("bench/single/hysteresis/strong/0", "bench/single/amplifier_filter/strong/0"),
)
