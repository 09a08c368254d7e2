"""Stepwise regression with predicted square error, the way of SIDPAC (Klein and Morelli 2006, chapter 5.4).

Terms enter by the largest drop of the squares while the predicted square error falls and the partial F ratio is above
its limit, and leave when it is below. PSE = (1/N) Σ (y − ŷ)² + σ²_max p / N with σ²_max the mean square about the
mean (Barron 1984).
"""

import numpy as np

from rotorid_proof.peers.problem import Answer, Problem, answer_of, believed_precision

F_LIMIT = 20.0
MOST_TERMS = 12


def ask(problem: Problem) -> Answer:
    """Choose terms on the training runs."""
    x, y = problem.stacked(problem.training)
    n = len(y)
    normal, right, total = x.T @ x, x.T @ y, float(y @ y)
    largest = total / n
    penalty = np.zeros(len(problem.keys))
    penalty[problem.columns(problem.values)] = believed_precision(problem, problem.values)

    def squares(terms):
        c = problem.columns([*problem.values, *terms])
        own = normal[np.ix_(c, c)] + np.diag(penalty[c])
        size = np.sqrt(np.diag(normal)[c]) + 1e-300
        scaled = own / np.outer(size, size) + 1e-9 * np.eye(len(c))
        return total - float((right[c] / size) @ np.linalg.solve(scaled, right[c] / size)), len(c)

    def partial_f(without, with_):
        (s0, p0), (s1, p1) = without, with_
        return (s0 - s1) / max(p1 - p0, 1) / max(s1 / max(n - p1, 1), 1e-300)

    active: list[str] = []
    now = squares(active)
    while len(active) < MOST_TERMS:
        offers = {t: squares([*active, t]) for t in problem.terms if t not in active}
        offers = {t: s for t, s in offers.items() if partial_f(now, s) > F_LIMIT}
        offers = {t: s for t, s in offers.items() if pse(s, n, largest) < pse(now, n, largest)}
        if not offers:
            break
        best = min(offers, key=lambda t: pse(offers[t], n, largest))
        active.append(best)
        now = squares(active)
        for term in list(active[:-1]):
            without = squares([t for t in active if t != term])
            if partial_f(without, now) < F_LIMIT:
                active.remove(term)
                now = squares(active)
    found: dict[str, float] = {}
    for term in active:
        ratio = partial_f(squares([t for t in active if t != term]), now)
        effect = problem.effects[term]
        found[effect] = min(found.get(effect, 1.0), float(np.exp(-0.5 * min(ratio, 1400.0))))
    return answer_of(problem, found, active)


def pse(state: tuple[float, int], n: int, largest: float) -> float:
    """Predicted square error of (sum of squares, parameters)."""
    squares, parameters = state
    return squares / n + largest * parameters / n
