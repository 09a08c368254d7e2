"""The effects at work in a flight, chosen by the posterior, as the rest of the analysis takes them."""

from __future__ import annotations

from collections.abc import Sequence

from rotorid.mismatch.findings import Reason
from rotorid.mismatch.posterior.evidence import evidence_from
from rotorid.mismatch.posterior.prior import Prior
from rotorid.mismatch.posterior.search import Found, decide
from rotorid.mismatch.posterior.statements import POSSIBLE, by_id, statements_of
from rotorid.mismatch.regression import VALUE_LIMITS, Fit, Regression
from rotorid.mismatch.rows import Term
from rotorid.mismatch.select import Questions, Selection
from rotorid.mismatch.unknowns import UNKNOWNS


class PosteriorSearch:
    """The most probable model of a regression, and what is to be stated of its effects."""

    def __init__(self, regression: Regression, ask: Questions, prior: Prior = Prior()):  # noqa: B008
        self.regression = regression
        self.terms: dict[str, Term] = {t.key: t for t in regression.terms}
        self.always = [t.key for t in regression.terms if t.kind != "effect"]
        self.ask = ask
        self.prior = prior
        self.blocks = int(regression.training.sum())
        self.widened = False
        """Whether believed values have more room than their trust gives."""
        self._found: Found | None = None

    def run(self, start: Sequence[str] | None = None) -> Selection:
        """The effects at work; the search starts from nothing and from `start`.

        Where the model holds a believed value that may be wrong beyond its trust, values have more room from here on.
        """
        found = decide(evidence_from(self.regression), self.prior, start or ())
        self._found = found
        active = [key for key in found.model if key in found.problem.effects]
        self.widened = len(active) < len(found.model)
        if self.widened:
            self.regression = self.regression.with_room(VALUE_LIMITS[1])
        statements = {s.key: s for s in statements_of(found)}
        fit = self.regression.fit(self.always + active, jackknife=True)
        p_values = {k: self.regression.wald(fit, self.regression.columns([k]), self.blocks) for k in active}
        at_work = {self.terms[k].effect for k in active}
        dropped = {
            effect: Reason("probability", f"its probability is {share:.2f}")
            for effect, share in by_id(found).items()
            if share >= POSSIBLE and effect not in at_work and effect not in UNKNOWNS
        }
        return Selection(active, fit, p_values, [], dropped, statements)

    def values_alone(self, selection: Selection) -> None:
        """Whether values alone explain as much is part of the decision itself."""

    def beside(self, active: Sequence[str]) -> Fit | None:
        """The model with the most probable effect in addition to those `active`; None without one.

        As long as it may be there, what is stated may be off by what it would change.
        """
        mine, posterior = set(active), self._found.posterior
        more = {m: v for m, v in posterior.visited.items() if mine < set(m) & set(self._found.problem.effects)}
        best = max(more, key=more.get, default=None)
        if best is None or more[best] < self._found.log_posterior - self.prior.beside_nats:
            return None
        return self.regression.fit([*self.always, *(k for k in best if k in self._found.problem.effects)])
