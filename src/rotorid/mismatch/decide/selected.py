"""From the selected terms to a word on each id: intervals, held-out gain, sameness between runs, alternatives."""

from __future__ import annotations

from collections.abc import Callable, Collection
from itertools import combinations

import numpy as np
from scipy.stats import t as student

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import LIMIT, SpeedForm
from rotorid.mismatch.decide import rules
from rotorid.mismatch.decide.findings import Finding, in_interval, not_held
from rotorid.mismatch.decide.select import NEAR_LIMIT, SMALLEST_SIZE, VALUE_FLOOR, Search, Selection
from rotorid.mismatch.decide.status import CLAIMED, Estimate
from rotorid.mismatch.evidence.regression import MOST_ATTENUATION, Fit, Regression
from rotorid.mismatch.evidence.rows import CHANNELS, Contributions, Rows, Term
from rotorid.mismatch.evidence.speedpath import SpeedResult
from rotorid.mismatch.evidence.unknowns import UNKNOWNS

WIDEST_TRUST = 0.1
VALUE_Z = 3.5
"""A believed value is called wrong beyond this many standard errors: about 1 in 300 over seven values."""
SMALLEST_CHANGE = 0.015
"""A relative change below this is no wrong value: no laboratory knows its numbers better."""


Factors = tuple[np.ndarray, np.ndarray]
"""Factors of a term's linear coefficients and their one-sigma, (k,) each."""


def as_fitted(term: Term) -> Factors:
    """No other coefficients than the fitted ones, and no doubt of that."""
    return np.ones(len(term.form.linear)), np.zeros(len(term.form.linear))


def coefficients(regression: Regression, fit: Fit, key: str) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients of a term and their covariance."""
    cols = regression.columns([key])
    where = fit.places(cols)
    return fit.beta[where], fit.covariance[np.ix_(where, where)]


def estimates(
    regression: Regression,
    fit: Fit,
    search: Search,
    key: str,
    suggested: Fit | None = None,
    delivered: Fit | None = None,
    larger: Factors | None = None,
) -> tuple[Estimate, ...]:
    """Linear parameters of a term with 95 % intervals: within runs, between them, and with what is `suggested`.

    Stated is the number that is `delivered`; its interval holds the one found with the believed values free, too.
    `larger` are the factors of its coefficients on the vehicle that is delivered, and their one-sigma.
    """
    term = search.terms[key]
    times, doubt = larger or as_fitted(term)
    covariance = coefficients(regression, fit, key)[1]
    spread, p = regression.between_runs(fit, key)
    variance = np.diag(covariance) + (spread if p < 0.05 else 0.0)
    reach = student.ppf(0.975, max(5, int(regression.training.sum()) - len(fit.columns)))
    beta, *others = (times * coefficients(regression, f, key)[0] for f in (delivered or fit, fit, suggested or fit))
    deviations = np.hypot(times * np.sqrt(variance), doubt * beta / np.where(times, times, 1.0))
    out = []
    for k, (index, sd) in enumerate(zip(term.form.linear, deviations, strict=False)):
        parameter = term.form.parameters[index]
        found = [beta[k], *(other[k] for other in others)]
        ends = (beta[k], min(found) - reach * sd, max(found) + reach * sd)
        middle, low, high = (float(term.form.stated(np.where(np.arange(len(beta)) == k, x, beta))[k]) for x in ends)
        out.append(Estimate(parameter.symbol, middle, parameter.unit, low, high))
    return tuple(out)


def _predicted(rows: Rows, cols: np.ndarray, beta: np.ndarray) -> np.ndarray:
    """What columns add to the residual, (n, 12)."""
    return rows.x[:, :, cols] @ beta


def main_channels(rows: list[Rows], cols: np.ndarray, beta: np.ndarray, noise: np.ndarray) -> list[int]:
    """Channels in which a contribution is at least a third of its strongest, the strongest first."""
    energy = np.zeros(12)
    for r in rows:
        energy += (_predicted(r, cols, beta) ** 2).sum(axis=0)
    size = np.sqrt(energy / sum(len(r.y) for r in rows)) / np.where(np.isfinite(noise), noise, np.inf)
    order = np.argsort(-size)
    return [int(c) for c in order if size[c] > 0.33 * size[order[0]]]


_TermReport = tuple[np.ndarray, tuple[Estimate, ...], tuple[str, ...], Collection[str]]
"""Of a term at work its values, parameters, channels and alternatives."""


def findings_of(search: Search, selection: Selection, report_of: Callable[[str], _TermReport]) -> list[Finding]:
    """A finding for every term that entered, and for those that looked like something and did not survive.

    Terms without a name are reported as unexplained instead.
    """
    effects, findings = catalogue(), []
    for key in selection.active:
        term = search.terms[key]
        if term.effect in UNKNOWNS:
            continue
        values, parameters, channels, alternatives = report_of(key)
        found = Finding(
            id=term.effect,
            status="established",
            form=term.form,
            values=tuple(float(v) for v in values),
            equation=term.form.equation,
            sentence=effects[term.effect].sentence,
            parameters=parameters,
            p_value=selection.p_values[key],
            channels=channels,
            windows=(term.window,) if term.window else (),
        )
        findings.append(found.or_else(alternatives) if alternatives else found)
    named = {i for f in findings for i in f.alternatives}
    for effect_id, reason in selection.not_established.items():
        if effect_id not in named and effect_id not in UNKNOWNS:
            findings.append(not_held(effect_id, reason, rule=getattr(reason, "rule", "")))
    return findings


def path_findings(
    result: SpeedResult,
    channels: tuple[str, ...],
    least_sd_s: float = 0.0,
    limited: Callable[[SpeedForm, np.ndarray], tuple[tuple[str, float, float], ...]] = lambda form, values: (),
) -> list[Finding]:
    """Findings between command and rotor speed; `limited` gives the windows in which a limit holds a command.

    `channels` are those in which they show; no time is better known than `least_sd_s`.
    """
    effects, out = catalogue(), []
    for key, form in result.fit.chain:
        where = result.fit.slice_of(key)
        values = result.fit.values[where]
        least = [least_sd_s if p.unit == "s" else 0.0 for p in form.parameters]
        sd = np.hypot(np.sqrt(np.diag(result.fit.covariance)[where]), least)
        numbers = zip(form.parameters, values, sd, strict=True)
        alternatives = result.alternatives[key]
        found = Finding(
            id=key,
            status="established",
            speed_form=form,
            values=tuple(float(v) for v in values),
            equation=form.equation,
            sentence=effects[key].sentence,
            parameters=tuple(in_interval(p.symbol, v, p.unit, s) for p, v, s in numbers),
            p_value=result.p_values[key],
            channels=channels,
            windows=limited(form, values) if form.stage == LIMIT else (),
        )
        out.append(found.or_else(alternatives) if alternatives else found)
    stated = {f.id for f in out}
    return out + [not_held(key, reason) for key, reason in result.dropped.items() if key not in stated]


def wrench_findings(
    contributions: Contributions,
    regression: Regression,
    search: Search,
    selection: Selection,
    noise: np.ndarray,
    nonlinear: dict[str, tuple[np.ndarray, np.ndarray]],
    delivered: Fit,
    larger_of: Callable[[Term], Factors] = as_fitted,
) -> list[Finding]:
    """Findings of the terms of a flight; `nonlinear` holds values and one-sigma of those with nonlinear parameters,
    `delivered` is the fit whose numbers are stated, `larger_of` the factors of a term's coefficients on the vehicle
    that is delivered, and their one-sigma."""
    beside = search.beside(selection.active)

    def report_of(key: str) -> _TermReport:
        term = search.terms[key]
        beta, _ = coefficients(regression, delivered, key)
        channels = main_channels(contributions.rows, regression.columns([key]), beta, noise)
        values, parameters, linear = np.array(term.values, float), (), list(term.form.linear)
        larger = larger_of(term)
        if linear:
            values[linear] = term.form.stated(larger[0] * beta)
            stated = estimates(regression, selection.fit, search, key, beside, delivered, larger)
            # What nothing in the recordings shows (columns that are noise alone) is not stated.
            parameters = tuple(p for p, shown in zip(stated, regression.shown(key), strict=True) if shown)
        if key in nonlinear:
            centre, sd = (own.copy() for own in nonlinear[key])
            sd[linear] = np.hypot(larger[0] * sd[linear], larger[1] * centre[linear])
            centre[linear] *= larger[0]
            values[list(term.form.nonlinear)] = centre[list(term.form.nonlinear)]
            low, high = np.minimum(values, centre) - 1.96 * sd, np.maximum(values, centre) + 1.96 * sd
            parameters = tuple(
                Estimate(p.symbol, float(v), p.unit, float(a), float(b))
                for p, v, a, b in zip(term.form.parameters, values, low, high, strict=True)
            )
        names = tuple(CHANNELS[c] for c in channels if c < 6) or tuple(CHANNELS[c] for c in channels)
        return values, parameters, names, search.alternatives(key, selection.active)

    return findings_of(search, selection, report_of)


def wrong_values(
    regression: Regression,
    selection: Selection,
    size_of: Callable[[str, float], float],
    moving: bool = True,
    refused: Collection[str] = (),
) -> dict[str, tuple[float, float]]:
    """The fewest believed values that must change: relative change and one-sigma.

    Of all small subsets (the others at their belief) the one that explains most for its size. The user's trust
    counts, but only up to `most_distrust` per value: a number may be far off, and a wrong mass must not be
    sold as a wrong thrust and three wrong inertias. A value is named only where it matters: SMALLEST_CHANGE, and a size
    in units of the noise (`size_of(key, relative change)`). `moving` is False on a stand, where a mass only weighs;
    `refused` values are not called wrong.
    """
    # A value that is asked whether it is wrong may be so by this share at least; in the search it has less room, or it
    # would take physics up.
    least_room = 0.6
    regression = regression.with_room(least_room)
    nuisance = regression.keys_of("nuisance", "wind")
    trust = {t.key: t.prior_sd[0] for t in regression.terms if t.kind == "value"}
    always = nuisance + selection.active
    loose = {key: max(sd, WIDEST_TRUST) for key, sd in trust.items()}
    count = int(regression.training.sum())

    cost_per_value = 12.0  # Whitened squares that a further wrong value must explain.
    most_distrust = 9.0
    # Relative one-sigma that no believed value is taken to be better known than, while others are called wrong.
    best_known = 0.004

    def penalised(keys: list[str]) -> float:
        # The others give by a fraction of a percent, or a third value would be called wrong to make up for it.
        room = {k: loose[k] if k in keys else min(best_known, sd) for k, sd in trust.items()}
        fit = regression.fit([*always, *trust], loose=room)
        cost = 0.0
        for key in trust:
            change = coefficients(regression, fit, key)[0][0]
            if key in keys:
                cost += cost_per_value + min((change / trust[key]) ** 2, most_distrust)
            else:
                cost += (change / room[key]) ** 2
        return fit.gain - cost

    most_values = 3
    subsets = [list(c) for size in range(most_values + 1) for c in combinations(trust, size)]
    best_first = sorted(subsets, key=penalised, reverse=True)
    doubtful = set(refused)
    at_limits: list[list[str]] = []
    value_p = 5e-4
    while named := next(s for s in best_first if s not in at_limits and not doubtful.intersection(s)):
        fit = regression.fit(always + named, loose=loose)
        certainty, pinned = {}, False
        for key in named:
            beta, covariance = coefficients(regression, fit, key)
            change, sd = float(beta[0]), float(np.sqrt(covariance[0, 0]))
            noisy = regression.own_part([*always, *named], key, np.ones(1))[1] > MOST_ATTENUATION
            matters = abs(change) > SMALLEST_CHANGE and size_of(key, change) > SMALLEST_SIZE
            p = regression.wald(fit, regression.columns([key]), count)
            pinned |= abs(change) > NEAR_LIMIT * regression.limit[regression.start[key]]
            if abs(change) < VALUE_Z * sd or p > value_p or noisy or not matters:
                certainty[key] = abs(change) / sd
        if pinned:
            # Two values that run away together say nothing against either of them alone.
            at_limits.append(named)
        elif certainty:
            # Without it the others are chosen anew: one in doubt must not hide one that is far off.
            doubtful.add(min(certainty, key=certainty.get))
        else:
            break
    if not named:
        return {}
    fit = regression.fit(always + named, jackknife=True, loose=loose)
    out = {}
    for key in named:
        beta, covariance = coefficients(regression, fit, key)
        change, sd = float(beta[0]), float(np.hypot(np.sqrt(covariance[0, 0]), VALUE_FLOOR))
        if moving:
            change, sd = relative_change(key, change, sd)
        out[key] = change, sd
    return out


def throttle_or_thrust(finding: Finding) -> Finding:
    """Where no rotor speed is measured, a thrust curve and a throttle curve are one and the same column."""
    same = catalogue()[finding.id].same_on_commands if finding.id in catalogue() else ""
    if not rules.THROTTLE_OR_THRUST(bool(same) and finding.status in CLAIMED):
        return finding
    return finding.or_else([same])


def relative_change(key: str, coefficient: float, sd: float) -> tuple[float, float]:
    """Relative change of a believed value, and its one-sigma, from its coefficient.

    The columns of a mass and an inertia m hold the acceleration F / m of the believed one: their coefficient is
    1 − m_believed / m.
    """
    if key == "mass" or key.startswith("inertia"):
        return coefficient / (1.0 - coefficient), sd / (1.0 - coefficient) ** 2
    return coefficient, sd


def coefficient_of(key: str, change: float) -> float:
    """Coefficient of a relative change of a believed value in rows without measured moments (`relative_change`)."""
    return change / (1.0 + change) if key == "mass" or key.startswith("inertia") else change
