"""Which effects are at work: a grouped search over the catalogue with the believed values free throughout."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from heapq import heapify, heappop, heappush
from itertools import combinations

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.decide import rules
from rotorid.mismatch.decide.findings import Reason
from rotorid.mismatch.evidence.regression import (
    MOST_ATTENUATION,
    VALUE_LIMITS,
    Fit,
    Regression,
    Solution,
    hotelling,
    making_room,
    quadratic_form,
)
from rotorid.mismatch.evidence.rows import Term
from rotorid.mismatch.evidence.unknowns import UNKNOWNS

ENTER_P = 5e-5
"""A term enters below this: about 0.5 % over some fifty terms that are not copies of each other."""
KEEP_P = 1e-4
"""A term stays below this."""
COST_PER_PARAMETER = 8.0
"""Whitened squares that each further parameter must explain before a richer form is preferred."""
SMALLEST_SIZE = rules.SIZE["least"]
SHARE_OF_LARGEST = rules.OVERSHADOWED["share"]
COST_PER_EFFECT = 20.0
"""Whitened squares that a further id must explain before two ids are preferred to one form of one of them."""
_COST_OF_UNKNOWN = 40.0
"""Whitened squares, and a tenth of what it explains, that an empirical term pays for having no name."""
_MOST_EFFECTS = 10
VALUE_FLOOR = 0.002
"""Relative one-sigma that no estimate here is better than (filters, timing): of two effects that explain the same but
for twice as much neither explains more."""
_MOST_JUDGED = 20_000
"""Terms in models of which a search remembers what it said."""
LEAST_TRANSFER = rules.TRANSFER["share"]
LEAST_PROMISE = rules.TRANSFER["promise"]
NEAR_LIMIT = 0.98
"""Share of the furthest that a believed value may move at which it counts as held there."""


@dataclass(frozen=True)
class _JudgedTerm:
    """A term judged given the present model."""

    key: str
    beta: np.ndarray
    p_value: float
    gain: float
    inflation: float
    physical: bool
    """Coefficients inside their bounds, regressors that are more than their own noise, and a contribution of which the
    others could not take over all but what its form is wrong by (SHARE_OF_LARGEST): such a one is whatever its sum
    with the others is, and two of them grow against each other without end."""
    named: bool = True
    """Whether it is of the catalogue."""

    @property
    def score(self) -> float:
        """Gain less what its parameters cost; noise that is larger than assumed makes both larger."""
        score = self.gain - COST_PER_PARAMETER * self.inflation * len(self.beta)
        share_of_unknown = 0.1
        return score if self.named else (1 - share_of_unknown) * score - _COST_OF_UNKNOWN * self.inflation


@dataclass
class Selection:
    """The terms that entered, and what was seen on the way."""

    active: list[str]
    fit: Fit
    p_values: dict[str, float] = field(default_factory=dict)
    not_established: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Questions:
    """What a search asks of the recordings that its regression does not hold."""

    sizes_of: Callable[[str, np.ndarray], np.ndarray]
    """Size of a term (key, coefficients) per channel in units of its noise, (12,), less what values would absorb."""
    joint_sizes: Callable[[np.ndarray, np.ndarray], np.ndarray]
    """The same of a contribution as it is, of one term or several together (columns, coefficients), (12,)."""


def _named_first(term: Term) -> int:
    """When a term is looked at: one without a name where nothing else enters."""
    return int(term.effect in UNKNOWNS)


def _price(term: Term) -> float:
    """Whitened squares that a term costs by its parameters, by its id and by its want of a name."""
    return COST_PER_PARAMETER * term.size + COST_PER_EFFECT + _COST_OF_UNKNOWN * (term.effect in UNKNOWNS)


def keys_of(terms: Iterable[Term]) -> list[str]:
    """Keys of terms."""
    return [t.key for t in terms]


class Search:
    """Forward search with replacement of forms and backward checks."""

    refused: Mapping[str, str] = {}
    """Ids that are not to enter, with the reason."""

    def __init__(self, regression: Regression, ask: Questions):
        self.regression = regression
        self.terms: dict[str, Term] = {t.key: t for t in regression.terms}
        self.always = [t.key for t in regression.terms if t.kind != "effect"]
        self.ask = ask
        self.blocks = int(regression.training.sum())
        self._judged: dict[tuple, _JudgedTerm] = {}
        self._failing: dict[tuple, tuple[str | None, float]] = {}
        self._largest: dict[int, np.ndarray] = {}
        self._place = {key: i for i, key in enumerate(self.terms)}.__getitem__

    def within_bounds(self, term: Term, beta: np.ndarray, error: np.ndarray) -> bool:
        """Whether coefficients are inside their bounds, or outside by less than their own uncertainty."""
        if not term.form.linear:
            return bool(0.2 < beta[0] < 5.0)
        for index, value, sd in zip(term.form.linear, beta, error, strict=True):
            parameter = term.form.parameters[index]
            if value < parameter.low - 1.5 * sd or value > parameter.high + 1.5 * sd:
                return False
        return True

    def physical(self, term: Term, beta: np.ndarray, error: np.ndarray) -> bool:
        """Whether coefficients are within their bounds, and large enough for what the form says."""
        if rules.BOUNDS(not self.within_bounds(term, beta, error)):
            return False
        if not term.form.linear:
            return True
        for index, value, sd in zip(term.form.linear, beta, error, strict=True):
            if rules.MUST_SHOW(index in term.form.must_show and abs(value) < 2.0 * sd):
                return False
        limits = [term.form.parameters[i].negligible for i in term.form.linear]
        return not rules.NEGLIGIBLE(not any(abs(value) > limit for value, limit in zip(beta, limits, strict=True)))

    def judge(self, key: str, active: list[str]) -> _JudgedTerm:
        """A term added to (or, if in `active`, kept in) the model; remembered."""
        asked = key, self.regression.set_of([*active, key])
        if asked not in self._judged:
            making_room(self._judged, _MOST_JUDGED)[asked] = self._judge(key, active)
        return self._judged[asked]

    def _judge(self, key: str, active: list[str]) -> _JudgedTerm:
        base = self.without(key, active)
        keys = self.always + sorted({*active, key}, key=self._place)
        fit = self.regression.fit(keys)
        where = fit.places(self.regression.columns([key]))
        beta, covariance = fit.beta[where], fit.covariance[np.ix_(where, where)]
        statistic = quadratic_form(beta, covariance)
        p_value = hotelling(statistic, len(beta), self.blocks)
        gain = fit.gain - base.gain
        inflation = max(1.0, gain / max(statistic, 1e-9)) if gain > 0 else 1.0
        physical = self.physical(self.terms[key], beta, np.sqrt(np.diag(covariance)))
        if physical:
            own, noise = self.regression.own_part(keys, key, beta)
            if own <= SHARE_OF_LARGEST**2 and self.exact(key):
                # Two forms that are exact differ by what they differ, however little.
                others = [k for k in keys if k == key or not self.exact(k)]
                own, _ = self.regression.own_part(others, key, beta)
            physical = not rules.OWN_PART(own <= SHARE_OF_LARGEST**2 or noise >= MOST_ATTENUATION)
        physical = physical and not rules.STRAIN(self.strains(fit, base))
        return _JudgedTerm(key, beta, p_value, gain, inflation, physical, self.terms[key].effect not in UNKNOWNS)

    def exact(self, key: str) -> bool:
        """Whether a term's equation is geometry or a definition, so that its form cannot be wrong."""
        effect = catalogue().get(self.terms[key].effect)
        return effect is not None and effect.exact

    def strains(self, fit: Fit, base: Solution) -> bool:
        """Whether a term needs a believed value far from its belief that the model without it does not need."""
        for term in self.regression.terms:
            if term.kind != "value":
                continue
            column = self.regression.start[term.key]
            most = min(rules.STRAIN["deviations"] * term.prior_sd[0], NEAR_LIMIT * self.regression.limit[column])
            with_it, without = fit.beta[fit.columns == column][0], base.beta[base.columns == column][0]
            side = np.sign(with_it)  # a value that was off the other way is pushed all the further
            if side * with_it > most and side * with_it > side * without + term.prior_sd[0]:
                return True
        return False

    def weight(self, key: str, beta: np.ndarray, active: list[str]) -> float:
        """Largest size of a term over the channels, counting only those where it is not dwarfed by another."""
        own, largest = self.ask.sizes_of(key, beta), self.largest([k for k in active if k != key])
        limits, burst = rules.OVERSHADOWED, self.terms[key].run
        dwarfed = own < (limits["share_of_burst"] if burst else limits["share"]) * largest
        if limits(bool(dwarfed.any())):
            own = np.where(dwarfed, 0.0, own)
        # A burst is easily imitated by what the form of a strong effect leaves over.
        return float(own.max()) / (limits["times_for_burst"] if burst else 1.0)

    def largest(self, active: list[str]) -> np.ndarray:
        """Largest size of what is in a model per channel, (12,), or (1,) where it holds nothing; remembered."""
        asked = self.regression.set_of(active)
        if asked not in self._largest:
            fit = self.regression.solution(self.always + active)
            beta = {key: fit.beta[fit.places(self.regression.columns([key]))] for key in active}
            sizes = [self.ask.sizes_of(key, own) for key, own in beta.items()]
            making_room(self._largest, _MOST_JUDGED)[asked] = np.max(sizes or [np.zeros(1)], axis=0)
        return self._largest[asked]

    def without(self, key: str, active: list[str]) -> Solution:
        return self.regression.solution(self.always + [k for k in active if k != key])

    def most(self, terms: Sequence[Term], active: list[str]) -> list[float]:
        """What each of further terms explains less what its parameters cost: the most that its score can be."""
        present = [*self.always, *active]
        base, with_each = self.regression.explained(present), self.regression.explained_with(present, keys_of(terms))
        return [whole - base - COST_PER_PARAMETER * t.size for t, whole in zip(terms, with_each, strict=True)]

    def judged(
        self, terms: Iterable[Term], active: list[str], turn: Callable[[Term], int] = lambda _: 0
    ) -> Iterator[_JudgedTerm]:
        """Terms judged given a model, by their turn, then the best first.

        To judge one costs many times what `most` does: it is done only where no other is sure to be better.
        """
        terms = list(terms)
        most = self.most(terms, active)
        waiting = [(turn(t), -m, number, t) for number, (t, m) in enumerate(zip(terms, most, strict=True))]
        heapify(waiting)
        while waiting:
            own, _, number, found = heappop(waiting)
            if isinstance(found, _JudgedTerm):
                yield found
            else:
                candidate = self.judge(found.key, active)
                heappush(waiting, (own, -candidate.score, number, candidate))

    def candidates(
        self, active: list[str], dropped: Collection[str] = (), turn: Callable[[Term], int] = lambda _: 0
    ) -> Iterator[_JudgedTerm]:
        """Terms whose id is neither in the model yet nor dropped and that are worth their parameters, judged."""
        taken = {self.terms[k].once for k in active} | set(dropped)
        free = [t for t in self.terms.values() if t.kind == "effect" and t.once not in taken]
        most = self.most(free, active)
        return self.judged([t for t, m in zip(free, most, strict=True) if m > 0], active, turn)

    def best_form(self, key: str, active: list[str]) -> str:
        """The form of the same id that explains most for its parameters, the others in the model kept."""
        if self.terms[key].run:
            return key
        forms = [t for t in self.terms.values() if t.kind == "effect" and t.effect == self.terms[key].effect]
        judged = self.judged(forms, [k for k in active if k != key])
        return next((c.key for c in judged if c.physical), key)

    def worth(self, keys: list[str]) -> float:
        """Whitened squares that a model explains, less what its parameters and ids cost."""
        return self.regression.explained(self.always + keys) - sum(_price(self.terms[k]) for k in keys)

    def worth_with(self, keys: list[str], further: Sequence[Term]) -> list[float]:
        """The same of a model with each of further terms."""
        gains = self.regression.explained_with(self.always + keys, keys_of(further))
        cost = sum(_price(self.terms[k]) for k in keys)
        return [gain - cost - _price(term) for gain, term in zip(gains, further, strict=True)]

    def swapped(self, active: list[str], dropped: dict[str, str]) -> list[str] | None:
        """A model with one id in another's place, if it explains clearly more: the first to enter may be wrong.

        Or with a plainer form of the same id and a further id: the freer form may stand for both. The newcomer must
        hold by itself: what it displaces is not looked at again, and would be lost with it.
        """
        if not rules.EXCHANGE.on:
            return None
        taken = {self.terms[k].once for k in active} | set(dropped)
        others = [t for t in self.terms.values() if t.kind == "effect" and not t.run and t.once not in taken]
        present, whole = self.worth(active), self.regression.explained(self.always + active)
        trials = []
        for gone in active:
            if self.terms[gone].run:
                continue
            rest = [k for k in active if k != gone]
            # Rivals that explain the same to what estimates are known are equally good.
            floor = (2 * VALUE_FLOOR) ** 2 * (whole - self.regression.explained(self.always + rest))
            for kept in (rest, *([*rest, plainer] for plainer in self.plainer_forms(gone))):
                least = present + max(COST_PER_PARAMETER / 2, floor if kept is rest else 0.0)
                worths = self.worth_with(kept, others)
                trials += [
                    (worth, other.key, [*kept, other.key])
                    for other, worth in zip(others, worths, strict=True)
                    if worth > least
                ]
        most_trials = 12  # Exchanges looked at closely, the most promising first.
        for _, new, trial in sorted(trials, key=lambda t: -t[0])[:most_trials]:
            if self.failing(new, trial)[0] is None and all(self.judge(key, trial).physical for key in trial):
                return trial
        return None

    def plainer_forms(self, key: str) -> list[str]:
        """Forms of the same id with fewer parameters."""
        own = self.terms[key]
        return [t.key for t in self.terms.values() if t.kind == "effect" and t.once == own.once and t.size < own.size]

    def beside(self, active: list[str]) -> Fit | None:
        """The model with the strongest further effect that explains more than it costs and is still not stated.

        It may be too small, too unsure or too much like the others; as long as it may be there, what is stated may be
        off by what it would change.
        """
        found = next((c for c in self.candidates(active) if c.score > 0 and c.physical), None)
        return None if found is None else self.regression.fit([*self.always, *active, found.key])

    def failing(self, key: str, active: list[str]) -> tuple[str | None, float]:
        """Why a term of the model does not hold given the others (None where it does), and its score; remembered."""
        asked = key, self.regression.set_of(active)
        if asked not in self._failing:
            making_room(self._failing, _MOST_JUDGED)[asked] = self._fails(key, active)
        return self._failing[asked]

    def _fails(self, key: str, active: list[str]) -> tuple[str | None, float]:
        judged = self.judge(key, active)
        reason = None
        if judged.p_value > KEEP_P:
            reason = Reason("significance", f"p = {judged.p_value:.2g} given the others")
        elif not judged.physical:
            reason = Reason("physical_bounds", "its coefficients are outside physical bounds")
        elif rules.SIZE((size := self.weight(key, judged.beta, active)) < SMALLEST_SIZE):
            reason = Reason("size", f"its size is {size:.2g} of the noise")
        return reason, judged.score

    def weak(self, active: list[str]) -> tuple[str, str] | None:
        """The worst term of the model that fails a test, with the reason; None if all hold."""
        found = [(key, *self.failing(key, active)) for key in active]
        weak = [(score, key, reason) for key, reason, score in found if reason]
        return min(weak)[1:] if weak else None

    def run(self, active: list[str] | None = None) -> Selection:
        """Grow the model, take out what the held-out runs refute, and grow again without it until nothing changes."""
        active = list(active or [])
        refuted: dict[str, str] = dict(self.refused)
        for _ in range(_MOST_EFFECTS):
            dropped = dict(refuted)
            active = self._grown(active, dropped)
            found = self._refuted(active)
            if found is None:
                break
            key, reason = found
            active = [k for k in active if k != key]
            refuted[self.terms[key].once] = reason
        # No single block of the recording decides.
        fit = self.regression.fit(self.always + active, jackknife=True)
        final = {k: self.regression.wald(fit, self.regression.columns([k]), self.blocks) for k in active}
        kept = {self.terms[k].effect for k in active}
        # What acts in one window of one run was dropped under its key.
        reasons = {self.terms[name].effect if name in self.terms else name: r for name, r in dropped.items()}
        return Selection(active, fit, final, {e: r for e, r in reasons.items() if e not in kept})

    def _grown(self, active: list[str], dropped: dict[str, str]) -> list[str]:
        """The model grown, its forms replaced and its weak terms taken out; `dropped` is filled."""
        for _ in range(4 * _MOST_EFFECTS):
            added = self._next(active, dropped) or []
            active = active + added
            for key in list(active):
                better = self.best_form(key, active)
                if better != key:
                    active[active.index(key)] = better
            exchanged = None if added else self.swapped(active, dropped)
            if exchanged is not None and rules.EXCHANGE(True):
                for gone in {self.terms[k].once for k in active} - {self.terms[k].once for k in exchanged}:
                    dropped[gone] = Reason("exchange", "another explains more in its place")
                active = exchanged
            while (weak := self.weak(active)) is not None:
                key, reason = weak
                active = [k for k in active if k != key]
                dropped[self.terms[key].once] = reason
            if not added and exchanged is None:
                break
        return active

    def _next(self, active: list[str], dropped: dict[str, str]) -> list[str] | None:
        """The best term that may enter, in a list; terms too small to matter go to `dropped`."""
        if len(active) >= _MOST_EFFECTS:
            return None
        for candidate in self.candidates(active, dropped, _named_first):
            effect = self.terms[candidate.key].once
            if candidate.score <= 0 or candidate.p_value > ENTER_P or not candidate.physical or effect in dropped:
                continue
            size = self.weight(candidate.key, candidate.beta, active)
            if not rules.SIZE(size < SMALLEST_SIZE):
                return [candidate.key]
            dropped.setdefault(effect, Reason("size", f"its size is {size:.2g} of the noise"))
        return None

    def _refuted(self, active: list[str]) -> tuple[str, str] | None:
        """A term that other environments or another term speak against, with the reason."""
        if rules.TRANSFER((failed := self.refuted_elsewhere(active)) is not None):
            return failed, Reason("transfer", "where it was not fitted it does not keep what it promises")
        if rules.STEADY((unsteady := self.unsteady(active)) is not None):
            return unsteady, Reason("steady", "it differs from run to run")
        if rules.CANCELS((cancelling := self.cancelling(active)) is not None):
            return cancelling, Reason("cancels", "where it is strongest it only cancels another")
        if rules.FREE_VALUES((imitating := self.imitates_values(active)) is not None):
            return imitating, Reason("free_values", "given believed values that are free it is not significant")
        return None

    def imitates_values(self, active: list[str]) -> str | None:
        """The least significant term of those that are not significant once believed values are free.

        The search holds values by their trust. Where one is off by many times that, an effect may absorb the rest: a
        thrust curve stands for a wrong mass or arm.
        """
        values = {t.key: VALUE_LIMITS[1] for t in self.regression.terms if t.kind == "value"}
        if not values or not active:
            return None
        wide = self.regression.with_room(VALUE_LIMITS[1])
        fit = wide.fit(self.always + active, jackknife=True, loose=values)
        p_values = {k: wide.wald(fit, wide.columns([k]), self.blocks) for k in active if not self.terms[k].run}
        least = max(p_values, key=p_values.get, default=None)
        return least if least is not None and p_values[least] > KEEP_P else None

    def cancelling(self, active: list[str]) -> str | None:
        """The term of least worth that in its strongest channel is cancelled by another.

        Something the catalogue lacks is in a channel where noise is low: a tilt of ten degrees is bought there, and
        an accelerometer that is turned by ten degrees hides it in the force.
        """
        if len(active) < 2:
            return None
        fit = self.regression.solution(self.always + active)
        named = [k for k in active if self.terms[k].effect not in UNKNOWNS and not self.terms[k].run]

        def sizes(keys: list[str]) -> np.ndarray:
            cols = self.regression.columns(keys)
            return self.ask.joint_sizes(cols, fit.beta[fit.places(cols)])

        alone, found = {k: sizes([k]) for k in named}, set()
        for pair in combinations(named, 2):
            both = sizes(list(pair))
            for key in pair:
                c = int(np.argmax(alone[key]))
                least = min(alone[k][c] for k in pair)
                if least > SMALLEST_SIZE and both[c] < rules.CANCELS["share"] * least:
                    found.add(key)
        return min(found, key=lambda k: fit.gain - self.without(k, active).gain, default=None)

    def refuted_elsewhere(self, active: list[str]) -> str | None:
        """The term that keeps least of what it promises on environments it was not fitted on, if that is too little.

        One that is at work keeps nearly all of it in nearly every environment that excites it; one that fills a gap
        which another cause left gains on average only.
        """
        worst, found = LEAST_TRANSFER, None
        for key in active:
            if self.terms[key].run:
                continue
            seen = self.regression.compare(self.always + active, self.always + [k for k in active if k != key])
            if seen.promised.sum() <= LEAST_PROMISE or not seen.votes.any():
                continue
            kept = seen.transfer
            if seen.won < rules.TRANSFER["won"] * seen.expected_won:
                kept = min(kept, LEAST_TRANSFER - 1e-9)
            if kept < worst:
                worst, found = kept, key
        return found

    def unsteady(self, active: list[str]) -> str | None:
        """A term whose coefficients are not the same from run to run, beyond doubt and by much."""
        fit = self.regression.solution(self.always + active)
        for key in active:
            if self.terms[key].run:
                continue
            spread, p = self.regression.between_runs(fit, key)
            cols = self.regression.columns([key])
            beta = fit.beta[fit.places(cols)]
            runs = len(np.unique(self.regression.run[self.regression.training]))
            # Coefficients of one term have different units: what counts is how much of its contribution changes.
            gram = self.regression.products(cols)
            changes = np.diag(gram) @ spread * runs > rules.STEADY["spread"] ** 2 * (beta @ gram @ beta)
            if p < rules.STEADY["p_value"] and changes:
                return key
        return None

    def alternatives(self, key: str, active: list[str]) -> list[str]:
        """Ids that are collinear with a term: with one of them in its place the term is no longer needed."""
        rest = [k for k in active if k != key]
        taken = {self.terms[k].effect for k in rest}
        own = self.judge(key, rest)
        no_rivals = {*taken, *UNKNOWNS, self.terms[key].effect}
        found: list[str] = []
        for term in self.terms.values():
            if term.kind == "effect" and term.effect not in no_rivals and term.effect not in found:
                found += [term.effect] if self._replaces(term.key, own, rest) else []
        return found

    def _replaces(self, other: str, own: _JudgedTerm, rest: list[str]) -> bool:
        """Whether given another term alone one of the model is no longer needed."""
        instead = self.judge(other, rest)
        instead_p = 1e-3  # It must itself be as significant as this in the other's place.
        if not instead.physical or instead.p_value > instead_p or instead.gain < 0.5 * own.gain:
            return False
        # An alternative with more further parameters than this explains by its freedom, not by its cause.
        most_extra_parameters = 3
        if len(instead.beta) > len(own.beta) + most_extra_parameters:
            return False
        # A term that given an alternative is less significant than this could be that alternative instead.
        alternative_p = 0.01
        return self.judge(own.key, [*rest, other]).p_value > alternative_p
