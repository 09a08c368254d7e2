"""A low-pass of the amplifier, or a mean over the last readings, common to all channels."""

import numpy as np
from scipy.signal import bessel, lfilter, sosfilt

from rotorid.effects.contract import Contribution, Effect, Form, Parameter
from rotorid.effects.creep import followed
from rotorid.effects.loading import TOO_SHORT, since_the_first, unsmoothed
from rotorid.effects.structural_resonance import resonance

_HIGHEST = 0.49
"""Share of its rate up to which a digital filter has a cutoff."""


def _first_order(loading, vehicle, values):
    """y = F / (1 + i f/f_c)."""
    load = since_the_first(loading)
    return Contribution(reading=followed_now(load, 1.0 / (2 * np.pi * max(values[0], 1e-3)), loading.dt_s) - load)


def followed_now(load, tau_s, dt_s):
    """The lag without the hold's delay of one sample: linear between samples."""
    load = unsmoothed(load)
    late = followed(load, tau_s, dt_s)
    ratio = dt_s / max(tau_s, 1e-6)
    share = 1.0 - np.exp(-ratio)
    # First-order hold: y_k = y_(k-1) e^-r + x_(k-1) (share/r − e^-r) + x_k (1 − share/r).
    weight = 1.0 - share / ratio
    # `late` holds x_(k-1) over the sample; correct by the ramp to x_k.
    step = np.diff(load, axis=0, prepend=np.zeros((1, load.shape[1])))
    return late + lfilter([weight], [1.0, -(1.0 - share)], step, axis=0)


def _second_order(loading, vehicle, values):
    """Butterworth of second order with cutoff f_c: as a structure with a damping ratio of √½."""
    load = since_the_first(loading)
    return Contribution(reading=resonance(load, values[0], np.sqrt(0.5), loading.dt_s) - load)


def _fourth_order(loading, vehicle, values):
    """Bessel of fourth order with cutoff f_c, as amplifiers of strain gauges have: nearly a delay, and smooth."""
    load = since_the_first(loading)
    # A stretch that comes more seldom than the others sees next to nothing of a cutoff above half its own rate.
    cutoff_hz = min(max(values[0], 1e-3), _HIGHEST / loading.dt_s)
    sos = bessel(4, cutoff_hz, fs=1.0 / loading.dt_s, output="sos", norm="mag")
    return Contribution(reading=sosfilt(sos, unsmoothed(load), axis=0) - load)


def _moving_mean(loading, vehicle, values):
    """Mean of the readings of the last T seconds, as programs that average return it; a part of one counts in part."""
    load = since_the_first(loading)
    count = max(values[0] / loading.dt_s, 1.0)
    plain = unsmoothed(load)
    total, at = np.cumsum(plain, axis=0), np.arange(len(plain))
    before = np.stack([np.interp(at - count, at, t, left=0.0) for t in total.T], axis=1)
    # Between rest and the first reading the sum grows as between any two.
    early = (at - count > -1.0) & (at < count)
    before[early] = (at[early] - count + 1.0)[:, None] * plain[0]
    return Contribution(reading=(total - before) / count - load)


def reading_forms(instrument):
    lowest, highest = 1.0 / max(instrument.duration_s, 1.0), 0.4 * instrument.rate_hz
    starts = tuple(f for f in (0.3, 0.8, 2.0, 5.0, 12.0, 30.0) if 3 * lowest < f < highest)
    if not starts:
        return ()
    # What is late by less than a sample is a nuisance: 1/(2π f_c) or √2/(2π f_c) of at least two samples.
    first, second = 0.08 * instrument.rate_hz, 0.11 * instrument.rate_hz

    def cutoff(high):
        own = tuple(f for f in starts if f < high)
        return Parameter("f_c", "Hz", lowest, high, nonlinear=True, starts=own or (0.5 * high,), meaning="cutoff")

    return (
        Form("first order", "y = F / (1 + i f/f_c)", (cutoff(first),), _first_order),
        Form("second order", "|y| = |F| / √(1 + (f/f_c)⁴)", (cutoff(second),), _second_order),
        Form("fourth order", "y = F / B₄(i f/f_c), B₄ the reverse Bessel polynomial", (cutoff(second),), _fourth_order),
        *_means(instrument),
    )


def _means(instrument):
    """The moving mean over T, where it may be as long as is late by two samples."""
    shortest, longest = 5.0 / instrument.rate_hz, 0.2 * instrument.duration_s
    starts = tuple(t for t in (0.1, 0.25, 0.6, 1.5, 4.0) if shortest < t < longest)
    if not starts:
        return ()
    length = Parameter("T", "s", shortest, longest, nonlinear=True, starts=starts, meaning="length of the mean")
    return (Form("moving mean", "y = (1/T) ∫ F over the last T", (length,), _moving_mean),)


EFFECT = Effect(
    id="amplifier_filter",
    name="the low-pass of the amplifier",
    sentence="every channel follows changes of the load late and smoothed",
    forms=lambda vehicle: (),
    reading_forms=reading_forms,
    source="catalogue B13",
    sign="f_c is positive; every reading lags behind its load, more so the lower f_c, and no steady reading changes",
    validity=(
        "one linear low-pass from rest, alike on all channels, with its cutoff below 0.08 (first order) or "
        "0.11 (second order) of the recording's rate; aliasing and unequal filters of the channels are left "
        "out"
    ),
    excited_by=("load_change",),
    confusers=("motor_lag", "delay", "creep"),
    separating_manoeuvre="tap the stand with the motors off",
    separating_columns=("rotor_speed",),
    kind="sensor",
    shows="after a change of load",
    lack_on=lambda instrument: TOO_SHORT,
    cases=("bench/single/amplifier_filter/strong/0", "bench/single/creep/moderate/0"),
)
