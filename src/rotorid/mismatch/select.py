"""Which effects are at work: a grouped search over the catalogue with the believed values free throughout."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from rotorid.mismatch.regression import MOST_ATTENUATION, Fit, Regression
from rotorid.mismatch.rows import Term

ENTER_P = 1e-4
"""A term enters below this: about 0.5 % over some fifty terms that are not copies of each other."""
KEEP_P = 1e-4
COST_PER_PARAMETER = 8.0
"""Whitened squares that each further parameter must explain before a richer form is preferred."""
SMALLEST_SIZE = 0.15
"""An effect below this share of the channel's noise (its strongest second) does not matter."""
ALTERNATIVE_P = 0.01
MOST_EFFECTS = 10


@dataclass(frozen=True)
class Candidate:
    """A term judged beside the present model."""

    key: str
    beta: np.ndarray
    p_value: float
    gain: float
    inflation: float
    physical: bool
    """Coefficients inside their bounds, and regressors that are more than their own noise."""

    @property
    def score(self) -> float:
        return self.gain / self.inflation - COST_PER_PARAMETER * len(self.beta)


@dataclass
class Selection:
    """The terms that entered, and what was seen on the way."""

    active: list[str]
    fit: Fit
    p_values: dict[str, float] = field(default_factory=dict)
    trail: list[str] = field(default_factory=list)
    not_established: dict[str, str] = field(default_factory=dict)


class Search:
    """Forward search with replacement of forms, backward checks and pair moves."""

    def __init__(self, regression: Regression, size_of, always: list[str] | None = None):
        """`size_of(key, beta, others)` gives the size of a term in units of the channel's noise."""
        self.regression = regression
        self.terms: dict[str, Term] = {t.key: t for t in regression.terms}
        self.always = always if always is not None else [t.key for t in regression.terms if t.kind != "effect"]
        self.size_of = size_of
        self.blocks = int(regression.training.sum())

    def physical(self, term: Term, beta: np.ndarray, error: np.ndarray) -> bool:
        """Whether coefficients are inside their bounds, or outside by less than their own uncertainty."""
        if not term.form.linear:
            return bool(0.2 < beta[0] < 5.0)
        for index, value, sd in zip(term.form.linear, beta, error, strict=True):
            parameter = term.form.parameters[index]
            if value < parameter.low - 1.5 * sd or value > parameter.high + 1.5 * sd:
                return False
        return True

    def judge(self, key: str, active: list[str], base: Fit, jackknife: bool = False) -> Candidate:
        """A term added to (or, if in `active`, kept in) the model."""
        keys = self.always + [k for k in active if k != key] + [key]
        fit = self.regression.fit(keys, jackknife=jackknife)
        cols = self.regression.columns([key])
        where = len(fit.columns) - len(cols) + np.arange(len(cols))
        beta, covariance = fit.beta[where], fit.covariance[np.ix_(where, where)]
        p_value = self.regression.wald(fit, cols, self.blocks)
        gain = fit.gain - base.gain
        statistic = float(beta @ np.linalg.pinv(covariance, hermitian=True) @ beta)
        inflation = max(1.0, gain / max(statistic, 1e-9)) if gain > 0 else 1.0
        physical = self.physical(self.terms[key], beta, np.sqrt(np.diag(covariance)))
        physical = physical and self.regression.noise_share(keys, key, beta) < MOST_ATTENUATION
        return Candidate(key, beta, p_value, gain, inflation, physical)

    def without(self, key: str, active: list[str]) -> Fit:
        return self.regression.fit(self.always + [k for k in active if k != key])

    def candidates(self, active: list[str]) -> list[Candidate]:
        """Every term whose id is not in the model yet, best first."""
        taken = {self.terms[k].effect for k in active}
        base = self.regression.fit(self.always + active)
        found = [
            self.judge(t.key, active, base) for t in self.terms.values() if t.kind == "effect" and t.effect not in taken
        ]
        return sorted(found, key=lambda c: -c.score)

    def best_form(self, key: str, active: list[str]) -> str:
        """The form of the same id that explains most for its parameters, the others in the model kept."""
        effect = self.terms[key].effect
        if self.terms[key].run:
            return key
        base = self.without(key, active)
        rest = [k for k in active if k != key]
        judged = [
            self.judge(t.key, rest, base) for t in self.terms.values() if t.kind == "effect" and t.effect == effect
        ]
        judged = [c for c in judged if c.physical] or judged
        return max(judged, key=lambda c: c.score).key

    def weak(self, active: list[str]) -> tuple[str, str] | None:
        """The worst term of the model that fails a test, with the reason; None if all hold."""
        worst = None
        for key in active:
            judged = self.judge(key, active, self.without(key, active))
            size = self.size_of(key, judged.beta, active)
            reason = None
            if judged.p_value > KEEP_P:
                reason = f"p = {judged.p_value:.2g} beside the others"
            elif not judged.physical:
                reason = "its coefficients are outside physical bounds"
            elif size < SMALLEST_SIZE:
                reason = f"its size is {size:.2g} of the noise"
            if reason and (worst is None or judged.score < worst[2]):
                worst = (key, reason, judged.score)
        return None if worst is None else worst[:2]

    def run(self, active: list[str] | None = None) -> Selection:
        """Grow, replace forms and prune until nothing changes."""
        active = list(active or [])
        trail, dropped = [], {}
        for _ in range(4 * MOST_EFFECTS):
            grown = False
            if len(active) < MOST_EFFECTS:
                for candidate in self.candidates(active):
                    effect = self.terms[candidate.key].effect
                    if candidate.score <= 0:
                        break
                    if candidate.p_value > ENTER_P or not candidate.physical or effect in dropped:
                        continue
                    size = self.size_of(candidate.key, candidate.beta, active)
                    if size < SMALLEST_SIZE:
                        dropped.setdefault(effect, f"its size is {size:.2g} of the noise")
                        continue
                    active.append(candidate.key)
                    trail.append(f"+ {candidate.key} (p {candidate.p_value:.1e}, size {size:.2f})")
                    grown = True
                    break
            if not grown:
                pair = self.pair(active, dropped)
                if pair:
                    active += pair
                    trail.append(f"+ {' and '.join(pair)} together")
                    grown = True
            changed = grown
            for key in list(active):
                better = self.best_form(key, active)
                if better != key:
                    active[active.index(key)] = better
                    trail.append(f"  {key} → {better}")
                    changed = True
            while (weak := self.weak(active)) is not None:
                key, reason = weak
                active.remove(key)
                dropped[self.terms[key].effect] = reason
                trail.append(f"- {key}: {reason}")
                changed = True
            if not changed or not grown:
                break
        fit = self.regression.fit(self.always + active, jackknife=True)
        final = {k: self.regression.wald(fit, self.regression.columns([k]), self.blocks) for k in active}
        kept = {self.terms[k].effect for k in active}
        return Selection(active, fit, final, trail, {e: r for e, r in dropped.items() if e not in kept})

    def pair(self, active: list[str], dropped: dict[str, str], most: int = 14) -> list[str] | None:
        """Two terms that mask each other: neither enters alone, both hold together."""
        if len(active) > MOST_EFFECTS - 2:
            return None
        base = self.regression.fit(self.always + active)
        best = {}
        for c in self.candidates(active):
            effect = self.terms[c.key].effect
            if effect not in dropped and (effect not in best or c.score > best[effect].score):
                best[effect] = c
        pool = sorted(best.values(), key=lambda c: -c.score)[:most]
        winner, top = None, 0.0
        for i, first in enumerate(pool):
            for second in pool[i + 1 :]:
                keys = [first.key, second.key]
                fit = self.regression.fit(self.always + active + keys)
                gain = fit.gain - base.gain
                if gain < max(first.gain, 0) + max(second.gain, 0) + 20.0 or gain <= top:
                    continue
                if all(self._holds(k, active + keys) for k in keys):
                    winner, top = keys, gain
        return winner

    def _holds(self, key: str, active: list[str]) -> bool:
        judged = self.judge(key, active, self.without(key, active))
        return (
            judged.p_value < ENTER_P / 10
            and judged.physical
            and judged.score > 0
            and self.size_of(key, judged.beta, active) > SMALLEST_SIZE
        )

    def alternatives(self, key: str, active: list[str]) -> list[str]:
        """Ids that could stand in for a term: with one of them in its place the term is no longer needed."""
        rest = [k for k in active if k != key]
        taken = {self.terms[k].effect for k in rest}
        own = self.judge(key, rest, self.without(key, active))
        found = []
        for term in self.terms.values():
            if term.kind != "effect" or term.effect in taken or term.effect == self.terms[key].effect:
                continue
            if term.effect in found:
                continue
            other = self.judge(term.key, rest, self.without(key, active))
            if not other.physical or other.p_value > ENTER_P or other.score < 0.5 * own.score:
                continue
            if other.score < own.score - COST_PER_PARAMETER and len(other.beta) > len(own.beta):
                continue
            both = self.judge(key, [*rest, term.key], self.regression.fit(self.always + rest + [term.key]))
            if both.p_value > ALTERNATIVE_P:
                found.append(term.effect)
        return found


def with_values(term: Term, values: np.ndarray) -> Term:
    """The term at new parameter values."""
    return replace(term, values=tuple(float(v) for v in values))
