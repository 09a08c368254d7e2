"""The posterior over changes: what a second set of flights has that the first does not.

    y_base = X_base b + ε        y_new = X_new (b + Δ) + ε

b are the coefficients of all columns of the catalogue, whatever the vehicle is; they are free and integrated out. With
Gram matrices B and N of the two sets, the leftover of each taken out (`posterior/leftover`),

    S = N − N (B + N + Λ⁻¹)⁻¹ N        s = c_N − N (B + N + Λ⁻¹)⁻¹ (c_B + c_N)

are the products of a problem in Δ alone, which is decided as one flight is. What the catalogue's forms, the whitening
and a controller's answer are wrong by is in b and cancels.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rotorid.mismatch.posterior.evidence import Evidence, EvidenceTerm, LinearParameter
from rotorid.mismatch.posterior.leftover import Spectrum, Weighed, spectrum_of
from rotorid.mismatch.posterior.prior import Prior
from rotorid.mismatch.posterior.problem import Problem, believed, log_priors
from rotorid.mismatch.rows import PARAMETER_NAMES

SAME_SD = 0.01
"""Relative one-sigma of a value between two flights in which nothing changed: air, battery and temperature."""
LEAST_CHANGE, MOST_CHANGE = 0.015, 0.6
"""Relative change of a value up to which it does not matter, and the largest."""
RIDGE = 1e-4
"""Ridge of the fit of all columns from which the leftover is learnt, in units of their length."""
ROUNDS = 4


def problem_of_changes(base: Evidence, new: Evidence, prior: Prior) -> Problem:
    """The problem that two sets pose on the same columns."""
    spectra = spectrum_of(base), spectrum_of(new)
    first, second = (in_units(weighed(s)[0], s.unit) for s in spectra)
    variance = weighed(spectra[1])[1]
    seen = np.diag(second[0]) > 0
    unit = np.where(seen, 1.0 / np.sqrt(np.where(seen, np.diag(second[0]), 1.0)), 0.0)
    gram_base, gram_new = (own[0] * np.outer(unit, unit) for own in (first, second))
    cross_base, cross_new = (own[1] * unit for own in (first, second))
    rows = spectra[1].rows
    inverse = np.linalg.inv(gram_base + gram_new + np.eye(len(unit)) / rows)
    gram = gram_new - gram_new @ inverse @ gram_new
    cross = cross_new - gram_new @ inverse @ (cross_base + cross_new)
    return posed(new, 0.5 * (gram + gram.T), cross, unit, rows, variance, prior)


def weighed(spectrum: Spectrum) -> tuple[Weighed, np.ndarray]:
    """Products of a set with its leftover taken out, and the leftover's variance in each channel (C,).

    The leftover is what one fit of all columns leaves over from environment to environment.
    """
    variance = np.zeros(len(spectrum.channels))
    for _ in range(ROUNDS):
        found = spectrum.weighed(variance)
        beta = np.linalg.solve(found.gram + RIDGE * np.eye(len(found.gram)), found.cross)
        before, variance = variance, spectrum.variance_of_leftover(beta)
        if np.array_equal(before, variance):
            break
    return spectrum.weighed(variance), variance


def in_units(found: Weighed, unit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gram matrix and cross products in the units of the coefficients."""
    own = np.where(unit > 0, 1.0 / np.where(unit > 0, unit, 1.0), 0.0)
    return found.gram * np.outer(own, own), found.cross * own


def posed(
    new: Evidence,
    gram: np.ndarray,
    cross: np.ndarray,
    unit: np.ndarray,
    rows: float,
    variance: np.ndarray,
    prior: Prior,
) -> Problem:
    """The problem of changes: every effect may have changed, in any direction, and every value.

    A value has its column twice: as what is a little different in every flight, and as an id that changed.
    """
    values = [t for t in new.terms if t.kind == "value"]
    again = np.array([new.start[t.key] for t in values], int)
    index = np.concatenate([np.arange(len(unit)), again]).astype(int)
    changed = [value_as_id(t) for t in values]
    columns_of = {t.key: new.start[t.key] + np.arange(t.size) for t in new.terms}
    columns_of |= {t.key: np.array([len(unit) + k]) for k, t in enumerate(changed)}
    terms = {t.key: replace(t, must_show=()) for t in (*new.terms, *changed)}
    effects = {key: t.effect for key, t in terms.items() if t.kind == "effect"}
    unit, grid = unit[index], np.ix_(index, index)
    same = dict.fromkeys((t.key for t in values), SAME_SD)
    sd, low, high, is_value = believed(terms.values(), same, columns_of, unit, rows, prior)
    free = [columns_of[key] for key, effect in effects.items() if effect not in PARAMETER_NAMES.values()]
    free = np.concatenate(free) if free else np.zeros(0, int)
    low[free], high[free] = -np.inf, np.inf
    size = len(unit)
    return Problem(
        terms=terms,
        columns_of=columns_of,
        always=np.concatenate([columns_of[t.key] for t in new.terms if t.kind != "effect"]),
        effects=effects,
        freed={},
        log_prior_of=log_priors(effects, terms, prior),
        unit=unit,
        gram=gram[grid],
        cross=cross[index],
        bias=np.zeros((size, size)),
        limited_bias=np.zeros((size, size)),
        limited_bias_cross=np.zeros(size),
        place_apart=np.full(size, -1),
        gram_apart=np.zeros((0, size)),
        cross_apart=np.zeros(0),
        prior_sd=sd,
        low=low,
        high=high,
        is_value=is_value,
        rows=rows,
        variance=variance,
        prior=prior,
        channel_gram=new.gram.sum(axis=1)[:, index[:, None], index] * np.outer(unit, unit),
    )


def value_as_id(term: EvidenceTerm) -> EvidenceTerm:
    """A believed value as something that may have changed, named as the contract names it."""
    name = PARAMETER_NAMES[term.key]
    change = LinearParameter(name, "1", -MOST_CHANGE, MOST_CHANGE, LEAST_CHANGE)
    return replace(term, key=f"{name}/changed", kind="effect", effect=name, linear=(change,))
