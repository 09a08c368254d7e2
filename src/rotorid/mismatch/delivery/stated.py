"""What is stated is what is delivered: numbers of effects and believed values by the fit that goes into the files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from rotorid.mismatch.decision.decide import coefficients
from rotorid.mismatch.decision.findings import Finding, ValueRow
from rotorid.mismatch.delivery.candidates import Candidate
from rotorid.mismatch.model.delivered import FittedModel
from rotorid.mismatch.model.values import believed_value
from rotorid.mismatch.model.within_trust import all_free
from rotorid.recordings import Vehicle

ONLY_A_RATIO = 0.9
"""Correlation of two values' estimates from which little more than their ratio is known."""


def restated(findings: Sequence[Finding], model: FittedModel, named: Candidate) -> tuple[Finding, ...]:
    """Findings with their linear parameters by a settled fit; intervals reach to where the findings had them."""
    key_of = {model.search.terms[k].form: k for k in named.active}
    out = []
    for finding in findings:
        key = key_of.get(finding.form)
        if key is None or not finding.values or not finding.form.linear:
            out.append(finding)
            continue
        form = finding.form
        values = np.array(finding.values, float)
        values[list(form.linear)] = form.stated(coefficients(model.regression, named.fit, key)[0])
        now = dict(zip((p.symbol for p in form.parameters), values, strict=True))
        parameters = tuple(
            replace(e, value=v, low=min(e.low, e.low + v - e.value), high=max(e.high, e.high + v - e.value))
            if (v := float(now.get(e.symbol, e.value))) != e.value
            else e
            for e in finding.parameters
        )
        out.append(replace(finding, values=tuple(map(float, values)), parameters=parameters))
    return tuple(out)


def value_rows(
    model: FittedModel,
    named: Candidate,
    improved: Vehicle,
    believed: Vehicle,
    names: Mapping[str, str],
) -> tuple[ValueRow, ...]:
    """Every believed value before and after: estimated jointly with the delivered effects, all free, and delivered."""
    fit = all_free(model, named.values, list(named.active))[1]
    rows = []
    for key in model.values_beside(named.active):
        beta, covariance = coefficients(model.regression, fit, key)
        if key in named.values:
            change, sd = named.values[key]
        else:
            change, sd = model.change(key, float(beta[0]), float(np.sqrt(covariance[0, 0])))
        was = believed_value(believed, key)
        low, high = (was * (1 + change + z * sd) for z in (-1.96, 1.96))
        given = delivered_value(improved, believed, key)
        rows.append(ValueRow(names[key], was, was * (1 + change), low, high, given))
    return tuple(rows)


def delivered_value(improved: Vehicle, believed: Vehicle, key: str) -> float:
    """A value of the improved vehicle; of an arm and a reading's gain the factor on what was believed."""
    if key == "arm":
        was, now = (v.rotor_positions_m()[:, :2] for v in (believed, improved))
        believed_m = float(np.linalg.norm(was))
        return float(np.linalg.norm(now)) / believed_m if believed_m > 0 else 1.0
    if key.startswith("gain"):
        gains = improved.reading_gain or (1.0, 1.0, 1.0)
        return float(gains["xyz".index(key[-1])] if key[-2:] in ("_x", "_y", "_z") else gains[0])
    return believed_value(improved, key)


def value_correlations(model: FittedModel, named: Candidate, names: Mapping[str, str]) -> dict[tuple[str, str], float]:
    """Correlations of two values' estimates from ONLY_A_RATIO on, trust left out: what the recordings alone know."""
    keys = model.values_beside(named.active)
    loose = dict.fromkeys(keys, 1.0)
    fit = model.regression.fit([*model.regression.keys_of("nuisance", "wind"), *keys, *named.active], loose=loose)
    places = fit.places(model.regression.columns(keys))
    covariance = fit.covariance[np.ix_(places, places)]
    sd = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    correlation = covariance / np.outer(sd, sd)
    pairs = combinations(range(len(keys)), 2)
    known = {(names[keys[i]], names[keys[j]]): float(correlation[i, j]) for i, j in pairs}
    return {pair: r for pair, r in known.items() if abs(r) > ONLY_A_RATIO}
