"""PySINDy on the residual: sequentially thresholded least squares over the catalogue's columns (Brunton 2016).

Columns are normalised. Of an effect's forms, near copies of each other, the one that fits best alone is offered. The
threshold is the largest of a grid whose model predicts the last third of the training samples within one percent of
the best, as a careful user would choose it.
"""

import numpy as np

from rotorid_proof.peers.problem import Answer, Problem, answer_of, fit, least_squares

WITHIN = 1.01
THRESHOLDS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.4)
"""Smallest coefficient kept, in units of the residual's rms (columns have rms one)."""


def ask(problem: Problem) -> Answer:
    """Sparse terms on the residual that refitted values leave."""
    from pysindy.optimizers import STLSQ

    columns, beta, _ = fit(problem, [], problem.training)
    left = problem.y - problem.x[:, :, columns] @ beta
    effects = problem.columns(best_forms(problem, left))
    keys = [problem.keys[k] for k in effects]
    instants = np.flatnonzero(problem.training)
    border = len(instants) * 2 // 3

    def table(samples):
        x = problem.x[samples][:, :, effects].reshape(-1, len(effects))
        return x, left[samples].reshape(-1)

    x_all, y_all = table(instants)
    size = np.sqrt(np.mean(x_all**2, axis=0))
    size[size == 0] = np.inf
    (x_fit, y_fit), (x_check, y_check) = table(instants[:border]), table(instants[border:])
    nothing = float(np.mean(y_check**2))
    errors = {}
    for threshold in THRESHOLDS:
        sparse = STLSQ(threshold=threshold, alpha=1e-3, max_iter=20)
        coefficients = np.ravel(sparse.fit(x_fit / size, y_fit[:, None]).coef_)
        errors[threshold] = float(np.mean((y_check - x_check / size @ coefficients) ** 2))
    least = min(nothing, *errors.values())
    best = None if nothing <= WITHIN * least else max(t for t, e in errors.items() if e <= WITHIN * least)
    if best is None:
        return answer_of(problem, {}, [])
    sparse = STLSQ(threshold=best, alpha=1e-3, max_iter=20)
    coefficients = np.ravel(sparse.fit(x_all / size, y_all[:, None]).coef_)
    active: dict[str, float] = {}
    for key, value in zip(keys, coefficients, strict=True):
        if value:
            active[key] = max(active.get(key, 0.0), abs(float(value)))
    found: dict[str, float] = {}
    for key, value in active.items():
        effect = problem.effects[key]
        found[effect] = min(found.get(effect, 1.0), float(np.exp(-value)))
    return answer_of(problem, found, list(active))


def best_forms(problem: Problem, left: np.ndarray) -> list[str]:
    """Of each effect the term that removes most of the residual alone, on the training samples."""
    y = left[problem.training].reshape(-1)
    best: dict[str, tuple[float, str]] = {}
    for term in problem.terms:
        own = problem.columns([term])
        x = problem.x[problem.training][:, :, own].reshape(len(y), len(own))
        beta, _ = least_squares(x, y)
        error = float(np.sum((y - x @ beta) ** 2))
        effect = problem.effects[term]
        if effect not in best or error < best[effect][0]:
            best[effect] = (error, term)
    return [term for _, term in best.values()]
