"""Clean regime, residual energy, sample-split F-test: after the description of arXiv 2606.23215.

1. Values are refitted on the clean regime: the third of the training seconds with the least residual energy.
2. On one half of the seconds the term that removes most residual energy is chosen, and again, greedily.
3. On the other half each chosen term is tested by a partial F-test; the level is divided by the number of terms that
   were candidates (false discoveries held over all of them).
"""

import numpy as np
from scipy.stats import f as f_distribution

from rotorid_proof.peers.problem import Answer, Problem, answer_of, fit, least_squares

LEVEL = 0.01
MOST_TERMS = 5
CLEAN_SHARE = 1 / 3
STOP_SHARE = 0.01
"""Energy that a term must remove on the choosing half to be put to the test."""


def ask(problem: Problem) -> Answer:
    """Choose on one half, test on the other."""
    seconds = np.unique(problem.block[problem.training])
    energy = np.array([np.mean(problem.y[problem.training & (problem.block == s)] ** 2) for s in seconds])
    clean = np.isin(problem.block, seconds[energy <= np.quantile(energy, CLEAN_SHARE)]) & problem.training
    columns, beta, _ = fit(problem, [], clean)
    left = problem.y - problem.x[:, :, columns] @ beta
    choosing = problem.training & (problem.block % 2 == 0)
    testing = problem.training & (problem.block % 2 == 1)

    def squares(terms, samples):
        own = problem.columns(terms)
        y = left[samples].reshape(-1)
        x = problem.x[samples][:, :, own].reshape(len(y), len(own))
        b, _ = least_squares(x, y)
        return float(np.sum((y - x @ b) ** 2)), len(own), len(y)

    chosen: list[str] = []
    now, _, _ = squares([], choosing)
    start = now
    while len(chosen) < MOST_TERMS:
        offers = {t: squares([*chosen, t], choosing)[0] for t in problem.terms if t not in chosen}
        best = min(offers, key=offers.get, default=None)
        if best is None or now - offers[best] < STOP_SHARE * start:
            break
        chosen.append(best)
        now = offers[best]
    found: dict[str, float] = {}
    for term in chosen:
        with_all, p1, n = squares(chosen, testing)
        without, p0, _ = squares([t for t in chosen if t != term], testing)
        ratio = (without - with_all) / max(p1 - p0, 1) / (with_all / max(n - p1, 1))
        p = float(f_distribution.sf(ratio, max(p1 - p0, 1), max(n - p1, 1)))
        if p < LEVEL / max(len(problem.terms), 1):
            effect = problem.effects[term]
            found[effect] = min(found.get(effect, 1.0), p)
    kept = [t for t in chosen if problem.effects[t] in found]
    return answer_of(problem, found, kept)
