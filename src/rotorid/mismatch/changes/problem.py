"""The posterior over changes: what a second set of flights has that the first does not.

    y_base = X_base b + ε        y_new = X_new (b + Δ) + ε

b are the coefficients of all columns of the catalogue, whatever the vehicle is; they are free and integrated out. With
Gram matrices B and N of the two sets, the leftover of each taken out (`posterior/leftover`),

    S = N − N (B + N + Λ⁻¹)⁻¹ N        s = c_N − N (B + N + Λ⁻¹)⁻¹ (c_B + c_N)

are the products of a problem in Δ alone, which is decided as one flight is. What the catalogue's forms, the whitening
and a controller's answer are wrong by is in b and cancels.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rotorid.mismatch.posterior.evidence import Evidence, EvidenceTerm, LinearParameter
from rotorid.mismatch.posterior.leftover import VARIANCES, Spectrum, spectrum_of, unit_of
from rotorid.mismatch.posterior.prior import Prior
from rotorid.mismatch.posterior.problem import Problem, believed, log_priors
from rotorid.mismatch.posterior.score import scored
from rotorid.mismatch.posterior.search import Found, most_probable
from rotorid.mismatch.rows import PARAMETER_NAMES

SAME_SD = 0.01
"""Relative one-sigma of a value between two flights in which nothing changed: air, battery and temperature."""
LEAST_CHANGE, MOST_CHANGE = 0.015, 0.6
"""Relative change of a value up to which it does not matter, and the largest."""
RIDGE = 1e-4
"""Ridge of the fit of all columns from which the leftover is learnt, in units of their length."""
ROUNDS = 4


def decide_changes(base: Evidence, new: Evidence, prior: Prior) -> Found:
    """The most probable changes between two sets on the same columns.

    The leftover is learnt from both sets with what is common to both: at first all that differs between the sets counts
    as leftover, then what the changes found do not explain.
    """
    unit = unit_of(base, new)
    spectra = spectrum_of(base, unit), spectrum_of(new, unit)
    change, starts = np.zeros(len(unit)), [()]
    variance = leftover_of(spectra, change)
    for _ in range(ROUNDS):
        problem = problem_of_changes(new, spectra, variance, prior)
        found = most_probable(problem, starts)
        starts = [(), found.model]
        before, variance = variance, leftover_of(spectra, change_of(found, len(unit)))
        if np.array_equal(before, variance):
            break
    return found


def leftover_of(spectra: tuple[Spectrum, Spectrum], change: np.ndarray) -> np.ndarray:
    """The variance of each channel's leftover, (C,), with one fit of all columns for both sets.

    `change` (K,) is what the second set's coefficients are more, in units of the spectra.
    """
    base, new = (s.weighed(np.zeros(len(s.channels))) for s in spectra)
    gram = base.gram + new.gram
    common = np.linalg.solve(gram + RIDGE * np.eye(len(gram)), base.cross + new.cross - new.gram @ change)
    gains = spectra[0].gains_of_leftover(common) + spectra[1].gains_of_leftover(common + change)
    return VARIANCES[np.argmax(gains, axis=1)]


def change_of(found: Found, count: int) -> np.ndarray:
    """The changes (count,) of the columns' coefficients in a model, a value's as its own column's."""
    at, out = scored(found.problem, found.model), np.zeros(count)
    for column, beta in zip(at.columns, at.mode.beta, strict=True):
        out[found.problem.same_column[column]] += beta
    return out


def problem_of_changes(
    new: Evidence, spectra: tuple[Spectrum, Spectrum], variance: np.ndarray, prior: Prior
) -> ProblemOfChanges:
    """The problem that two sets pose on the same columns, with a leftover of `variance` (C,) in each channel."""
    base, other = (s.weighed(variance) for s in spectra)
    unit, rows = spectra[1].unit, spectra[1].rows
    inverse = np.linalg.inv(base.gram + other.gram + np.eye(len(unit)) / rows)
    gram = other.gram - other.gram @ inverse @ other.gram
    cross = other.cross - other.gram @ inverse @ (base.cross + other.cross)
    return posed(new, 0.5 * (gram + gram.T), cross, unit, rows, variance, prior)


@dataclass(frozen=True)
class ProblemOfChanges(Problem):
    """A problem in which some columns stand twice."""

    same_column: np.ndarray
    """(K,) number of the column of the evidence that each one is."""


def posed(
    new: Evidence,
    gram: np.ndarray,
    cross: np.ndarray,
    unit: np.ndarray,
    rows: float,
    variance: np.ndarray,
    prior: Prior,
) -> ProblemOfChanges:
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
    return ProblemOfChanges(
        same_column=index,
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
