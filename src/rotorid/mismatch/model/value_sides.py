"""Which frequencies decide on wrong believed values, and which regression must agree.

A moment of the air that nobody modelled is slow, and the controller answers it: at low frequencies the rotors' moment
makes up for something else and turns nothing, so that an inertia or an arm regressed on it is biased (closed-loop
bias). In recordings without such a moment, low frequencies know those values best.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rotorid.mismatch.decision.decide import WIDEST_TRUST, coefficients
from rotorid.mismatch.decision.select import VALUE_FLOOR
from rotorid.mismatch.model.prepare import assemble_rows
from rotorid.mismatch.model.wrench import SURE_Z, WrenchModel, after_residual, block_seconds, chosen, model_filters
from rotorid.mismatch.plant.regression import VALUE_LIMITS, Regression, build
from rotorid.mismatch.plant.rows import winds_last
from rotorid.mismatch.plant.split import training_rule
from rotorid.mismatch.plant.two_sensors import compared_alone
from rotorid.recordings.signal.kernels import low_pass

VALUE_BAND = (0.2, 0.6)
"""Shares of the cutoff. Below, disturbances and what the controller does about them; above, mostly the noise of the
body rates' derivative, and their sensor's own filter."""
LEAST_REACHED = 0.5
"""Share of the rows in stretches longer than the band-pass, without which all frequencies judge."""
MOMENTS = (3, 4, 5)
"""Channels of the moments."""


class Sides(NamedTuple):
    """Two regressions of believed values."""

    judging: Regression
    agreeing: Regression
    """The one that must agree."""
    measured_moment: bool
    """Whether the latter has the measured moments as regressors."""


def sides_of_values(model: WrenchModel) -> Sides:
    """The regression by which believed values are judged, and the one that must agree with it.

    All frequencies where they show the same gain between the rotors' moments and the motion as those of VALUE_BAND
    do (Hausman's test: an efficient estimate against one that no slow disturbance biases), else that band alone. What
    must agree has the measured moments as regressors. Where commands alone say how fast rotors turn there is no noise
    in their speeds, but a lag that is not quite theirs changes what is quick: a band alone must agree with all.
    """
    every, band = model.search.regression, regression_of_values(model, VALUE_BAND)
    if same_gains(model, every, band):
        return Sides(every, regression_of_values(model, None, measured_moment=True), True)
    if all(s.measured_speed for s in model.segments):
        return Sides(band, regression_of_values(model, VALUE_BAND, measured_moment=True), True)
    return Sides(band, every, False)


def same_gains(model: WrenchModel, every: Regression, band: Regression) -> bool:
    """Whether both show the same gain between moment and angular acceleration, about each axis."""
    inertias = [k for k in every.keys_of("value") if k.startswith("inertia")]
    loose = dict.fromkeys(inertias, WIDEST_TRUST)
    found = []
    for regression in (every, band):
        regression = regression.with_room(VALUE_LIMITS[1])
        keys = [*regression.keys_of("nuisance", "wind"), *model.selection.active, *inertias]
        fit = regression.fit(keys, loose=loose)
        found.append([coefficients(regression, fit, key) for key in inertias])
    return all(
        abs(float(a[0] - b[0])) <= SURE_Z * np.sqrt(max(float(of_b[0, 0]), VALUE_FLOOR**2))
        for (a, _), (b, of_b) in zip(*found, strict=True)
    )


def regression_of_values(
    model: WrenchModel, band: tuple[float, float] | None, measured_moment: bool = False
) -> Regression:
    """Regression of the believed values and the selected effects; of the moments only what lies in a band.

    `band` holds shares of the cutoff, None for all frequencies. With `measured_moment` the measured moments are the
    regressors in place of the predicted ones: noise in the rotor speeds pulls the usual estimate one way, noise in the
    body rates pulls this one the other way, and the truth lies between (Frisch bounds).
    """
    prepared, rate_hz = model.prepared, model.prepared.thinner.rate_hz
    active = [model.search.terms[k] for k in model.selection.active]
    terms = winds_last([*(t for t in model.terms if t.kind != "effect"), *active])
    if measured_moment:
        rows, noisy = assemble_rows(prepared, terms, model.segments, chosen(model), measured_moment=True), None
    else:
        own = model.regression.columns([t.key for t in terms])
        made = model.contributions
        rows, noisy = ([replace(r, x=r.x[:, :, own]) for r in part] for part in (made.rows, made.noisy or []))
    filters = model_filters(model) if band is None else {**model_filters(model), **band_filters(model, band)}
    regression = build(
        rows,
        terms,
        filters,
        training_rule(prepared.split, model.segments),
        block_seconds(rows, rate_hz),
        rate_hz,
        noisy or None,
        *compared_alone(terms, rows),
    )
    return regression.without_winds()


def band_filters(model: WrenchModel, band: tuple[float, float]) -> dict[int, np.ndarray]:
    """To each moment's channel the band-pass that makes its residual noise of one sigma; none for short stretches.

    Not whitened in addition: a filter learnt where a slow disturbance is by far the largest is hardly one for the band.
    """
    thinner = model.prepared.thinner
    slow, quick = (low_pass(thinner.rate_hz, share * thinner.cutoff_hz) for share in band)
    middle = np.convolve(np.eye(len(slow))[len(slow) // 2] - slow, quick)
    # Samples of a band are as many as are independent of each other, and copies between.
    copies = thinner.rate_hz / (2 * (band[1] - band[0]) * thinner.cutoff_hz)
    parts = [part for part in after_residual(model) if len(part) > len(middle)]
    if sum(len(part) for part in parts) < LEAST_REACHED * sum(len(r.y) for r in model.rows):
        return {}
    out = {}
    for c in set(MOMENTS) & set(model_filters(model)):
        left = np.concatenate([np.convolve(part[:, c], middle, "valid") for part in parts])
        out[c] = middle / (np.sqrt(copies) * left.std())
    return out
