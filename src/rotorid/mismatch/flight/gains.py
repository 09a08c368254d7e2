"""The gains between force or moment and motion, from two bands and both sides of the regression.

- *Bands.* A moment of the air that nobody modelled is slow, and the controller answers it: at low frequencies the
  rotors' moment makes up for something else and turns nothing, so that a gain is biased (closed-loop bias). Where
  nothing of that kind acts, low frequencies know it best.
- *Sides.* Noise in rotor speeds pulls the estimate one way; with the measured moments as regressors noise in the body
  rates pulls the other way (Frisch bounds).

What bands and sides have in common is not seen in their differences: a bias that grows with the residual over the own
part of the column (`merged`).

The believed vehicle with values refitted and no physics added: what an effect must do better than.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.decide.problem import (
    GAINS,
    LogGain,
    Prior,
    Values,
    called_wrong,
    in_place,
    options_of,
    same_ratio,
)
from rotorid.mismatch.decide.select import Selection
from rotorid.mismatch.decide.selected import SMALLEST_CHANGE, SMALLEST_SIZE, coefficients, wrong_values
from rotorid.mismatch.decide.statements import SURE
from rotorid.mismatch.evidence.regression import DOUBT_OF_CORRECTION, Regression, ridge_inverse
from rotorid.mismatch.evidence.rows import winds_last
from rotorid.mismatch.flight.prepare import assemble_rows, prior_of
from rotorid.mismatch.flight.values import GAINS_OF_COMMANDS
from rotorid.mismatch.flight.wrench import WrenchModel, after_residual, chosen, whitened
from rotorid.recordings.signal.kernels import low_pass

_FREE_SD = 3.0
"""Relative one-sigma of the value by which a gain is estimated."""


def wrong_values_of(model: WrenchModel, prior: Prior = Prior()) -> tuple[Values, dict[str, list[Values]]]:  # noqa: B008
    """The believed values that the model's recordings contradict, and to each what would explain as much in its place.

    Of two values of one ratio the one is named by which the regression explains more, where it does so beyond doubt.
    """
    trust, least = _trust_of(model), float(np.log(SURE / (1.0 - SURE)))
    options = options_of(gains_of(model, prior), trust, prior)
    regression, size = model.search.regression, _size_of_value(model)
    always = [*regression.keys_of("nuisance", "wind"), *model.selection.active]

    def explained(wrong: frozenset[str]) -> float:
        """Nats."""
        return 0.5 * regression.fit([*always, *sorted(wrong)], loose=dict.fromkeys(wrong, _FREE_SD)).gain

    # Any laboratory has weighed its vehicle: from commands alone a mass is named where nothing else explains as much.
    with_mass, others = (
        [o.log_posterior for w, o in options.items() if ("lifted" in w) == own] for own in (True, False)
    )
    refused = ["lifted"] if with_mass and max(with_mass) < max(others) + least else []
    while wrong := called_wrong(options, least, refused):
        best = max((w for w in same_ratio(wrong, trust) if not w.intersection(refused)), key=explained)
        if explained(best) - explained(wrong) > least:
            wrong = best
        changes = options[wrong].changes
        small = [k for k, (x, _) in changes.items() if abs(x) <= SMALLEST_CHANGE or size(k, x) <= SMALLEST_SIZE]
        if not small:
            break
        refused += small
    return dict(options[wrong].changes), in_place(options, wrong, least)


def _trust_of(model: WrenchModel) -> dict[str, float]:
    """Relative one-sigma of every believed value that may be called wrong.

    A payload may be aboard of a vehicle whose centre of mass is off its place: then its mass is the least known of all.
    """
    trust = {t.key: t.prior_sd[0] for t in model.regression.terms if t.kind == "value"}
    trust |= {key: prior_of(key, model.prepared.vehicle) for key in model.regression.keys_of("held")}
    load = next(e for e in catalogue().values() if e.like_on_heavier)
    if {load.id, *load.like_on_heavier} & {model.search.terms[k].effect for k in model.selection.active}:
        trust |= dict.fromkeys({"mass", "lifted"} & trust.keys(), max(trust.values(), default=0.0))
    return trust


def gains_of(model: WrenchModel, prior: Prior) -> dict[str, LogGain]:
    """The gains that a flight shows, by the key of the value in their denominator.

    Where commands alone say how fast rotors turn, a lag that is not quite theirs changes what is quick: no band judges.
    """
    every, free = model.search.regression, [k for k in GAINS if k in model.regression.keys_of("value")]
    measured = all(s.measured_speed for s in model.segments)
    # Shares of the cutoff. Below, disturbances and what the controller does about them; above, mostly the noise of the
    # body rates' derivative, and their sensor's own filter.
    value_band = (0.2, 0.6)
    quick = _band_filters(model, value_band) if measured else {}
    known = {None: model.regression.filters} | ({value_band: {**model.regression.filters, **quick}} if quick else {})
    bands, answered = [], {}
    for (band, filters), bias in zip(known.items(), prior.gain_bias, strict=False):
        forward = every if band is None else _regression_of_gains(model, filters)
        both = [
            _side_of(forward, model.selection.active, free, False),
            _side_of(_regression_of_gains(model, filters, measured_moment=True), model.selection.active, free, True),
        ]
        if band is None:
            answered = {key: side.leftover for key, side in both[0].items()}
        samples = _samples_in(model, band)
        bands.append(
            {
                key: merged([side[key] for side in both], answered[key], bias, samples[key])
                for key, first in both[0].items()
                if first.own > 0
            }
        )
    gains = {key: mean_of([found[key] for found in bands if key in found]) for key in bands[0]}
    return gains if measured else shown_by_commands(gains)


def shown_by_commands(gains: Mapping[str, LogGain]) -> dict[str, LogGain]:
    """The gains less those of moments that are no values: a controller's answers make them."""
    least, most = np.log(GAINS_OF_COMMANDS)
    return {k: g for k, g in gains.items() if k == "mass" or least <= g.log <= most}


@dataclass(frozen=True)
class Side:
    """A gain by one regression."""

    key: str
    log: float
    """Midway between corrected for the noise of the regressors and not."""
    variance: float
    own: float
    """Whitened squares of the value's column that no other takes over."""
    noise: float
    """Share of them that is noise of the regressors."""
    leftover: float
    """Share of the estimate's variance that is more than independent noise gives: it is of a leftover, which a
    controller answers and which makes environments differ."""


def _side_of(
    regression: Regression, active: Sequence[str], free: Sequence[str], measured_moment: bool
) -> dict[str, Side]:
    """Each gain by one regression."""
    keys, loose = [*regression.keys_of("nuisance", "wind"), *active, *free], dict.fromkeys(free, _FREE_SD)
    pair = [r.fit(keys, loose=loose) for r in (regression.with_room(np.inf), _uncorrected(regression))]
    out = {}
    for key in free:
        (corrected, covariance), (plain, _) = (coefficients(regression, fit, key) for fit in pair)
        turned = key == "mass" or not measured_moment
        gain = [_gain_of(float(b[0]), turned) for b in (corrected, plain)]
        slope = np.exp(-gain[0] if turned else gain[0])  # of the logarithm over the coefficient
        own, noise = _own_part_of(regression, keys, loose, key)
        shift = DOUBT_OF_CORRECTION * float(corrected[0] - plain[0])
        robust = max(float(covariance[0, 0]) - shift**2, 0.0)
        out[key] = Side(
            key=key,
            log=float(np.mean(gain)),
            variance=float(covariance[0, 0]) * slope**2 + 0.25 * (gain[0] - gain[1]) ** 2,
            own=own,
            noise=noise,
            leftover=max(0.0, 1.0 - 1.0 / (robust * own)) if robust * own > 0 else 0.0,
        )
    return out


def _gain_of(coefficient: float, turned: bool) -> float:
    """Logarithm of a gain over the believed one, from the coefficient of the value in its denominator.

    `turned` says that the column holds what the believed value makes of a force or moment (`decide.relative_change`).
    """
    least_share = 1e-3  # Of a believed value what an estimate is at least: of what is not excited it may be anything.
    return float(
        np.log(max(1.0 - coefficient, least_share)) if turned else -np.log(max(1.0 + coefficient, least_share))
    )


def merged(sides: Sequence[Side], leftover: float, bias: float, samples: float) -> LogGain:
    """A gain of one band by both sides, the forward one first; along the thrust both are one.

    With u² the residual over the column's own part, a controller's answer to a leftover biases both sides by `bias` u
    (where all is leftover), its answer to the sensors' noise by `bias` u². `leftover` is that of the forward side at
    all frequencies, `samples` are the whitened squares of the residual. Without leftover the forward side, which is
    corrected for noise, is true.
    """
    first, *others = sides if sides[0].key != "mass" else sides[:1]
    # The noise of a measured rotor speed is not answered by a controller.
    size = samples * max(0.0, 1.0 - first.noise) / first.own
    common = bias**2 * size * (leftover + size)
    log, variance = (np.array([getattr(s, name) for s in (first, *others)]) for name in ("log", "variance"))
    weights = np.array([1.0, *(leftover for _ in others)]) / (variance + common)
    weights /= weights.sum()
    mean = float(weights @ log)
    spread = float(variance.min() + weights @ (log - mean) ** 2)
    # The column is that of the believed value: of a smaller gain it is too large.
    return LogGain(mean, spread + common * float(np.exp(-2.0 * min(mean, 0.0))))


def mean_of(gains: Sequence[LogGain]) -> LogGain:
    """One gain of several independent ones, less certain where they differ by more than they should (Birge, The
    calculation of errors by the method of least squares, Physical Review 40, 1932)."""
    log, weights = np.array([g.log for g in gains]), np.array([1.0 / g.variance for g in gains])
    mean = float(weights @ log / weights.sum())
    excess = float(weights @ (log - mean) ** 2) / max(len(gains) - 1, 1)
    return LogGain(mean, max(1.0, excess) / float(weights.sum()))


def _uncorrected(regression: Regression) -> Regression:
    """The same without a correction for the noise of regressors, and with room for any value."""
    apart = regression.apart
    if apart is not None:
        apart = replace(apart, bias_gram=0.0 * apart.bias_gram, bias_cross=0.0 * apart.bias_cross)
    plain = replace(
        regression, bias_gram=0.0 * regression.bias_gram, bias_cross=0.0 * regression.bias_cross, apart=apart
    )
    return plain.with_room(np.inf)


def _own_part_of(
    regression: Regression, keys: Sequence[str], loose: Mapping[str, float], key: str
) -> tuple[float, float]:
    """Whitened squares of a value's column that no other of `keys` takes over, and the share of them that is noise."""
    others, (own,) = regression.columns([k for k in keys if k != key]), regression.columns([key])
    precision = regression.precision.copy()
    for free, sd in loose.items():
        precision[regression.columns([free])] = sd**-2
    gram = regression.gram[regression.training].sum(axis=0)
    inverse = ridge_inverse(gram[np.ix_(others, others)] + np.diag(precision[others]))
    energy = float(gram[own, own] - gram[own, others] @ inverse @ gram[others, own])
    noise = float(regression.bias_gram[own, own] * regression.training.mean())
    never_shown = 1e-6  # Whitened squares of a value's column up to which the flight shows nothing of it.
    return (energy, noise / energy) if energy > never_shown else (0.0, 1.0)


def _samples_in(model: WrenchModel, band: tuple[float, float] | None) -> dict[str, float]:
    """Independent samples of the fitted rows in the channel of each gain."""
    thinner = model.prepared.thinner
    rows = float(model.regression.training.sum() * model.regression.block_s * thinner.rate_hz)
    return {key: rows if band is None or key == "mass" else rows / _copies_in(model, band) for key in GAINS}


def _copies_in(model: WrenchModel, band: tuple[float, float]) -> float:
    """Samples of a band for each that is independent of its neighbours."""
    return model.prepared.thinner.rate_hz / (2 * (band[1] - band[0]) * model.prepared.thinner.cutoff_hz)


def _regression_of_gains(
    model: WrenchModel, filters: dict[int, np.ndarray], measured_moment: bool = False
) -> Regression:
    """Regression of the believed values and the selected effects, each channel filtered by its own of `filters`.

    With `measured_moment` the measured moments are the regressors in place of the predicted ones.
    """
    prepared = model.prepared
    active = [model.search.terms[k] for k in model.selection.active]
    terms = winds_last([*(t for t in model.terms if t.kind != "effect"), *active])
    if measured_moment:
        rows, noisy = assemble_rows(prepared, terms, model.segments, chosen(model), measured_moment=True), None
    else:
        own = model.regression.columns([t.key for t in terms])
        made = model.contributions
        rows, noisy = ([replace(r, x=r.x[:, :, own]) for r in part] for part in (made.rows, made.noisy or []))
    return whitened(prepared, rows, terms, filters, model.segments, noisy or None, apart=True).without_winds()


def _band_filters(model: WrenchModel, band: tuple[float, float]) -> dict[int, np.ndarray]:
    """To each moment's channel the band-pass that makes its residual noise of one sigma; none for short stretches.

    Not whitened in addition: a filter learnt where a slow disturbance is by far the largest is hardly one for the band.
    """
    thinner = model.prepared.thinner
    slow, quick = (low_pass(thinner.rate_hz, share * thinner.cutoff_hz) for share in band)
    middle = np.convolve(np.eye(len(slow))[len(slow) // 2] - slow, quick)
    parts = [part for part in after_residual(model) if len(part) > len(middle)]
    # Share of the rows in stretches longer than the band-pass, without which all frequencies judge.
    least_reached = 0.5
    if sum(len(part) for part in parts) < least_reached * sum(len(r.y) for r in model.rows):
        return {}
    out = {}
    moments = (3, 4, 5)  # Channels of the moments.
    for c in set(moments) & set(model.regression.filters):
        left = np.concatenate([np.convolve(part[:, c], middle, "valid") for part in parts])
        out[c] = middle / (np.sqrt(_copies_in(model, band)) * left.std())
    return out


def values_alone(model: WrenchModel) -> Values:
    """The believed values that the recordings contradict where no effect is at work.

    Given a wind no value is called wrong: it acts through the drag.
    """
    if model.wind is not None:
        return {}
    nothing = Selection([], model.selection.fit)
    return wrong_values(model.search.regression, nothing, _size_of_value(model))


def _size_of_value(model: WrenchModel) -> Callable[[str, float], float]:
    """Function of a value and its relative change that gives the change's size in units of the noise."""

    def size(key: str, change: float) -> float:
        return float(model.search.ask.sizes_of(key, np.array([change])).max())

    return size
