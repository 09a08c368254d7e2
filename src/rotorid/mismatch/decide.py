"""From the selected terms to a word on each id: intervals, held-out gain, sameness between runs, alternatives."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.stats import chi2
from scipy.stats import t as student

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.findings import Estimate, Finding
from rotorid.mismatch.regression import MOST_ATTENUATION, Fit, Regression
from rotorid.mismatch.rows import CHANNELS, Rows
from rotorid.mismatch.select import SMALLEST_SIZE, Search, Selection

VALUE_Z = 3.5
"""A believed value is called wrong beyond this many standard errors: about 1 in 300 over seven values."""
SMALLEST_CHANGE = 0.015
"""A relative change below this is no wrong value: no laboratory knows its numbers better."""
BOOTSTRAPS = 400
EXPECTED_HELD_OUT = 25.0
"""Whitened squares that an effect should explain on the held-out runs before its failing there counts."""


def coefficients(regression: Regression, fit: Fit, key: str) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients of a term and their covariance."""
    cols = regression.columns([key])
    where = [list(fit.columns).index(c) for c in cols]
    return fit.beta[where], fit.covariance[np.ix_(where, where)]


def between_runs(regression: Regression, fit: Fit, key: str) -> tuple[np.ndarray, float]:
    """Variance between runs of a term's coefficients (0 where runs agree), and the p-value that they agree.

    Per run the term is refitted with all other coefficients held (DerSimonian and Laird's moment estimate).
    """
    cols = regression.columns([key])
    where = [list(fit.columns).index(c) for c in cols]
    rest = [i for i in range(len(fit.columns)) if i not in where]
    estimates, variances = [], []
    for run in np.unique(regression.run[regression.training]):
        mask = regression.training & (regression.run == run)
        if mask.sum() < 5:
            continue
        own = regression.gram[mask][:, cols][:, :, cols]
        total = own.sum(axis=0)
        cross = (
            regression.cross[mask][:, cols] - regression.gram[mask][:, cols][:, :, fit.columns[rest]] @ fit.beta[rest]
        )
        if total[0, 0] < 1e-3 * regression.gram[regression.training][:, cols[0], cols[0]].sum():
            continue  # the effect is hardly excited in this run
        inverse = np.linalg.pinv(total, rcond=1e-10, hermitian=True)
        beta = inverse @ cross.sum(axis=0)
        scores = cross - own @ beta
        robust = inverse @ (scores.T @ scores) @ inverse
        estimates.append(beta)
        variances.append(np.maximum(np.diag(robust), np.diag(inverse)))
    if len(estimates) < 2:
        return np.zeros(len(cols)), 1.0
    b, v = np.array(estimates), np.maximum(np.array(variances), 1e-300)
    w = 1.0 / v
    mean = (w * b).sum(axis=0) / w.sum(axis=0)
    q = (w * (b - mean) ** 2).sum(axis=0)
    degrees = len(b) - 1
    scale = w.sum(axis=0) - (w**2).sum(axis=0) / w.sum(axis=0)
    spread = np.maximum(0.0, (q - degrees) / np.maximum(scale, 1e-300))
    p = float(min(1.0, len(cols) * chi2.sf(q, degrees).min()))
    return spread / len(b), p


def estimates(regression: Regression, fit: Fit, search: Search, key: str) -> tuple[Estimate, ...]:
    """Linear parameters of a term with 95 % intervals: within runs and between them."""
    term = search.terms[key]
    beta, covariance = coefficients(regression, fit, key)
    spread, p = between_runs(regression, fit, key)
    variance = np.diag(covariance) + (spread if p < 0.05 else 0.0)
    reach = student.ppf(0.975, max(5, int(regression.training.sum()) - len(fit.columns)))
    out = []
    for index, value, sd in zip(term.form.linear, beta, np.sqrt(variance), strict=False):
        parameter = term.form.parameters[index]
        out.append(Estimate(parameter.symbol, float(value), parameter.unit, value - reach * sd, value + reach * sd))
    return tuple(out)


def predicted(rows: Rows, cols: np.ndarray, beta: np.ndarray) -> np.ndarray:
    """What columns add to the residual, (n, 12)."""
    return rows.x[:, :, cols] @ beta


def held_out_gain(
    rows: list[Rows], regression: Regression, with_it: Fit, without: Fit, channel: int, held: list[np.ndarray]
) -> tuple[float, float, float] | None:
    """rmse with / without a term in its main channel on held-out samples, with a block-bootstrap interval."""
    energies = []
    for r, mask in zip(rows, held, strict=True):
        if not mask.any():
            continue
        a = (r.y - predicted(r, with_it.columns, with_it.beta))[mask, channel]
        b = (r.y - predicted(r, without.columns, without.beta))[mask, channel]
        count = max(1, len(a) // 40)
        energies += [
            (float(x @ x), float(y @ y))
            for x, y in zip(np.array_split(a, count), np.array_split(b, count), strict=True)
        ]
    if len(energies) < 4:
        return None
    e = np.array(energies)
    rng = np.random.default_rng(1)
    draws = e[rng.integers(0, len(e), (BOOTSTRAPS, len(e)))].sum(axis=1)
    ratios = np.sqrt(draws[:, 0] / draws[:, 1])
    low, high = np.quantile(ratios, [0.025, 0.975])
    return float(np.sqrt(e[:, 0].sum() / e[:, 1].sum())), float(low), float(high)


def fails_held_out(regression: Regression, with_it: Fit, without: Fit) -> bool:
    """Whether a term that should help on the held-out blocks does not."""
    mask = regression.held_out
    if mask.sum() < 4:
        return False
    gain = without.residual_square[mask] - with_it.residual_square[mask]
    both = np.concatenate([with_it.columns])
    shift = with_it.beta.copy()
    for i, column in enumerate(with_it.columns):
        where = np.flatnonzero(without.columns == column)
        if len(where):
            shift[i] -= without.beta[where[0]]
    expected = float(np.einsum("bij,i,j->", regression.gram[mask][:, both][:, :, both], shift, shift))
    return expected > EXPECTED_HELD_OUT and gain.sum() < 0.0


def main_channels(rows: list[Rows], cols: np.ndarray, beta: np.ndarray, noise: np.ndarray) -> list[int]:
    """Channels in which a contribution is at least a third of its strongest, the strongest first."""
    energy = np.zeros(12)
    for r in rows:
        energy += (predicted(r, cols, beta) ** 2).sum(axis=0)
    size = np.sqrt(energy / sum(len(r.y) for r in rows)) / np.where(np.isfinite(noise), noise, np.inf)
    order = np.argsort(-size)
    return [int(c) for c in order if size[c] > 0.33 * size[order[0]]]


def wrench_findings(
    rows: list[Rows],
    regression: Regression,
    search: Search,
    selection: Selection,
    noise: np.ndarray,
    held: list[np.ndarray],
    nonlinear: dict[str, tuple[np.ndarray, np.ndarray]],
) -> list[Finding]:
    """A finding for every term that entered, and for those that looked like something and did not survive."""
    effects = catalogue()
    findings = []
    for key in selection.active:
        term = search.terms[key]
        effect = effects[term.effect]
        beta, _ = coefficients(regression, selection.fit, key)
        rest = [k for k in selection.active if k != key]
        without = regression.fit(search.always + rest)
        with_it = regression.fit(search.always + selection.active)
        channels = main_channels(rows, regression.columns([key]), beta, noise)
        alternatives = search.alternatives(key, selection.active)
        _, same = between_runs(regression, selection.fit, key)
        status = "ambiguous" if alternatives else "established"
        if fails_held_out(regression, with_it, without):
            status = "not_established"
        values = np.array(term.values, float)
        if term.form.linear:
            values[list(term.form.linear)] = beta
        parameters = estimates(regression, selection.fit, search, key) if term.form.linear else ()
        if key in nonlinear:
            values, sd = nonlinear[key]
            parameters = tuple(
                Estimate(p.symbol, float(v), p.unit, float(v - 1.96 * s), float(v + 1.96 * s))
                for p, v, s in zip(term.form.parameters, values, sd, strict=True)
            )
        findings.append(
            Finding(
                id=term.effect,
                status=status,
                form=term.form,
                values=tuple(float(v) for v in values),
                equation=term.form.equation,
                sentence=effect.sentence,
                parameters=parameters,
                p_value=selection.p_values[key],
                channels=tuple(CHANNELS[c] for c in channels if c < 6) or tuple(CHANNELS[c] for c in channels),
                alternatives=tuple(sorted({term.effect, *alternatives})) if alternatives else (),
                gain=held_out_gain(rows, regression, with_it, without, channels[0], held),
                windows=(term.window,) if term.window else (),
            )
        )
    for effect_id, reason in selection.not_established.items():
        effect = effects[effect_id]
        findings.append(
            Finding(id=effect_id, status="not_established", sentence=f"{effect.name} did not hold: {reason}")
        )
    return findings


def wrong_values(
    regression: Regression,
    search: Search,
    selection: Selection,
    reverse: dict[str, tuple[float, float]],
    size_of: Callable[[str, float], float],
) -> dict[str, tuple[float, float]]:
    """The fewest believed values that must change: relative change and one-sigma.

    Grown one at a time (the others at their belief) until what all remaining values together still explain is
    not significant. A value is named only where the check from the other side (`reverse`) agrees, and where it
    matters: SMALLEST_CHANGE, and a size in units of the noise (`size_of(key, relative change)`).
    """
    nuisance = [t.key for t in regression.terms if t.kind == "nuisance"]
    values = [t.key for t in regression.terms if t.kind == "value"]
    always = nuisance + selection.active
    free = regression.fit(always + values)
    named: list[str] = []
    count = int(regression.training.sum())

    def penalised(fit: Fit) -> float:
        return fit.gain - float((regression.precision[fit.columns] * fit.beta**2).sum())

    for _ in values:
        base = regression.fit(always + named)
        left = penalised(free) - penalised(base)
        rest = [v for v in values if v not in named]
        if left < chi2.isf(1e-3, max(1, len(rest))):
            break
        options = []
        for key in rest:
            fit = regression.fit(always + named + [key])
            beta, covariance = coefficients(regression, fit, key)
            z = abs(beta[0]) / np.sqrt(covariance[0, 0])
            noisy = regression.noise_share([*always, *named, key], key, np.ones(1)) > MOST_ATTENUATION
            other, sd = reverse.get(key, (beta[0], 0.0))
            agrees = np.sign(other) == np.sign(beta[0]) and abs(other) > 0.3 * abs(beta[0])
            matters = abs(beta[0]) > SMALLEST_CHANGE and size_of(key, float(beta[0])) > SMALLEST_SIZE
            if z > VALUE_Z and matters and not noisy and agrees:
                p = regression.wald(fit, regression.columns([key]), count)
                options.append((penalised(fit) - penalised(base), key, p))
        options = [o for o in options if o[2] < 5e-4]
        if not options:
            break
        named.append(max(options)[1])
    if not named:
        return {}
    fit = regression.fit(always + named, jackknife=True)
    out = {}
    for key in named:
        beta, covariance = coefficients(regression, fit, key)
        out[key] = (float(beta[0]), float(np.sqrt(covariance[0, 0])))
    return out
