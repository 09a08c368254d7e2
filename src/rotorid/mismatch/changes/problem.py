"""The posterior over changes: what a second set of flights has that the first does not.

    y_base = X_base b + ε        y_new = X_new (b + η + Δ) + ε        η ~ N(0, T)

b are the coefficients of all columns of the catalogue, whatever the vehicle is; they are free and integrated out. η is
by how much they differ between flights in which nothing changed. With Gram matrices B and N of the two sets,
the leftover of each taken out (`evidence.gram`),

    S = N − N (B + N + Λ⁻¹)⁻¹ N        s = c_N − N (B + N + Λ⁻¹)⁻¹ (c_B + c_N)
    S̃ = (1 + S T)⁻¹ S                  s̃ = (1 + S T)⁻¹ s

are the products of a problem in Δ alone, which is decided as one flight is. What the catalogue's forms, the whitening
and a controller's answer are wrong by is in b and cancels. What the noise of the regressors adds to B and N adds to S,
with Q = N (B + N + Λ⁻¹)⁻¹, (1 − Q) N_noise (1 − Q)ᵀ + Q B_noise Qᵀ; it is taken out as in one flight.

By how much flights of one vehicle differ in which nothing changed: the yardstick of a change.

- A believed value differs a little from flight to flight (air, battery, temperature), and so does the zero of a sensor
  (`Effect.between_flights`).
- The form of an effect is a few per cent wrong; seen at other speeds that looks like a little of another effect.
- What differs between the good flights themselves (a load that swings, a hand that moved the battery) may differ again
  by as much. It is found by the very decision that finds changes, one good flight against the others.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.decide.posterior import Found, Model, Posterior, most_probable, places, scored, without
from rotorid.mismatch.decide.problem import Prior, Problem, believed, limiting, log_priors
from rotorid.mismatch.decide.statements import FORM_SD, statements_of
from rotorid.mismatch.evidence.gram import (
    FULL_RIDGE,
    TINY,
    VARIANCES,
    Evidence,
    EvidenceTerm,
    LinearParameter,
    Spectrum,
    Weighed,
    spectrum_of,
    unit_of,
)
from rotorid.mismatch.evidence.regression import NEVER_EXCITED
from rotorid.mismatch.evidence.rows import PARAMETER_NAMES
from rotorid.mismatch.instrument.model import VALUE_NAMES

PRIOR = Prior()
"""What is believed of changes before any recording."""
_OF_THE_AIR = ("thrust", "torque")
"""Values that the air's density changes."""
_DERIVED = "rotor_acceleration"
"""What is a derivative of recorded speeds: how much of it is noise depends on the flight, and is not known."""
NAMES = {**VALUE_NAMES, **PARAMETER_NAMES}
"""Key of every believed value, of a flight or an instrument, to the contract's name."""
MOST_CHANGE = 0.6
"""The largest relative change of a value."""
_UNCHANGED = "unchanged"
"""Kind of a term that is common to both sets and did not change by assumption."""
_RIDGE = 1e-4
"""Ridge of the fit of all columns from which the leftover is learnt, in units of their length."""


def decide_changes(base: Evidence, new: Evidence, spread: np.ndarray) -> Found:
    """The most probable changes between two sets on the same columns; as `weighed_changes`."""
    return weighed_changes(base, new, spread)[0]


def weighed_changes(base: Evidence, new: Evidence, spread: np.ndarray) -> tuple[Found, float]:
    """The most probable changes between two sets on the same columns, and their log posterior.

    `spread` (K,) is the one-sigma of each coefficient between flights in which nothing changed, in its unit. The
    leftover is learnt from both sets, from two ends: all that differs between them is leftover, and none of it is.
    Where both ends are about as probable the larger leftover is believed, as in one flight (`posterior.search.decide`).

    The log posterior, nats, less a constant of the first set alone, is what variants of the second set are compared by:
    as recorded or corrected for a mistake, with the columns of one chain or of another.
    """
    new, normalisation = at_own_noise(base, new)
    pair = pair_of(base, new, spread)
    large, small = (pair.settled(pair.leftover(d)) for d in (np.zeros(len(pair.unit)), pair.difference()))
    end = small if pair.joint(small) - pair.joint(large) > PRIOR.leftover_nats else large
    chosen, value = pair.against_leftover(end)
    return chosen, value - 0.5 * float(new.square.sum()) - normalisation


def at_own_noise(base: Evidence, new: Evidence) -> tuple[Evidence, float]:
    """The second set's evidence in units of its own noise where that is larger than the first's, and by how much
    less probable, in nats, its rows are in them.

    Whitening is the first set's. Rotors with more inertia pass on more of the noise of their speeds; a leftover whose
    coefficients were to explain white noise would hide every change.
    """
    left, blocks = [np.maximum(left_by_all(e), TINY) for e in (base, new)], [e.blocks.sum() for e in (base, new)]
    rows = left[0] * blocks[1] / blocks[0]
    larger = np.maximum(left[1] / rows, 1.0)
    products = {name: getattr(new, name) for name in ("gram", "cross", "square", "bias_gram", "bias_cross")}
    scaled = {name: (own.T / larger).T for name, own in products.items()}
    return replace(new, **scaled), 0.5 * float(rows @ np.log(larger))


def held(new: Evidence, keys: Collection[str]) -> Evidence:
    """Evidence of the second set in which the terms `keys` did not change, by assumption."""
    terms = (replace(t, kind=_UNCHANGED) if t.key in keys else t for t in new.terms)
    return replace(new, terms=tuple(terms))


@dataclass(frozen=True)
class Pair:
    """Two sets on the same columns, to be weighed against each other."""

    new: Evidence
    spectra: tuple[Spectrum, Spectrum]
    """Of both sets, in the same units."""
    spread: np.ndarray
    """(K,) one-sigma of each coefficient between flights in which nothing changed, in its unit."""
    prior: Prior = PRIOR
    sizes: np.ndarray | None = None
    """(C, K, K) products that the sizes of contributions are taken from where they are not those of `new`."""

    @property
    def unit(self) -> np.ndarray:
        """Units (K,) of both spectra."""
        return self.spectra[1].unit

    @property
    def usual(self) -> np.ndarray:
        """`spread` (K,), scaled; 0 of a column that is never excited."""
        return np.divide(self.spread, self.unit, out=np.zeros(len(self.unit)), where=self.unit > 0)

    def weighed(self, variance: np.ndarray) -> tuple[Weighed, Weighed]:
        """Products of both sets with a leftover of `variance` (C,) taken out."""
        base, new = self.spectra
        return base.weighed(variance), new.weighed(variance)

    def at(self, model: Model, variance: np.ndarray) -> Found:
        """The posterior at a model, with a leftover of `variance` (C,)."""
        posterior = Posterior(self.problem(variance))
        return Found(posterior, model, posterior(model))

    def settled(self, variance: np.ndarray) -> Found:
        """The most probable changes and their leftover, from a `variance` (C,) of the leftover."""
        starts: list[Model] = [()]

        def decide(variance: np.ndarray) -> Found:
            found = most_probable(self.problem(variance), starts)
            starts[1:] = [found.model]
            return found

        return self._rounds(variance, decide)[-1]

    def _rounds(self, variance: np.ndarray, decide: Callable[[np.ndarray], Found]) -> list[Found]:
        """What `decide` makes of a `variance` (C,) of the leftover, then of the one that it leaves, until it stays."""
        found: list[Found] = []
        rounds = 4
        for _ in range(rounds):
            found.append(decide(variance))
            before, variance = variance, self.leftover(change_of(found[-1]))
            if np.array_equal(before, variance):
                break
        return found

    def against_leftover(self, found: Found) -> tuple[Found, float]:
        """The most probable changes where each is also compared with the leftover that would explain it.

        A change makes the leftover smaller that is learnt next to it, and looks the surer for it. Without the change
        the leftover is learnt anew. With few environments it may explain as much; then the change is left out. Given
        back is the log posterior of changes and leftover together (`joint`), too.
        """
        value = self.joint(found)
        others = []
        for key in found.model:
            ends = self._rounds(found.problem.variance, partial(self.at, without(found.model, key)))
            values = [self.joint(end) for end in ends]
            best = int(np.argmax(values))
            others.append((ends[best], values[best]))
        best, most = max(others, key=lambda other: other[1], default=(found, value))
        if most > value:
            return self.against_leftover(best)
        for other, own in others:
            visited = found.posterior.visited
            visited[other.model] = max(visited.get(other.model, -np.inf), found.log_posterior + own - value)
        return found, value

    def joint(self, found: Found) -> float:
        """Log posterior of changes and leftover together, nats, less a constant."""
        variance = found.problem.variance
        base, new = self.weighed(variance)
        free = _free_of(found.problem.terms, found.problem.columns_of, self.spectra[1].rows)
        of_common = _integrated(base.gram + new.gram, base.cross + new.cross, free)
        gram, cross, _ = _difference_products(base, new, free)
        of_usual = _integrated(gram, cross, self.usual**2)
        return found.log_posterior + of_common + of_usual + sum(s.evidence_of(variance) for s in self.spectra)

    def leftover(self, change: np.ndarray) -> np.ndarray:
        """The variance of each channel's leftover, (C,), with one fit of all columns for both sets.

        `change` (K,) is what the second set's coefficients are more, in units of the spectra.
        """
        base, new = self.weighed(np.zeros(len(self.new.channels)))
        gram = base.gram + new.gram
        common = np.linalg.solve(gram + _RIDGE * np.eye(len(gram)), base.cross + new.cross - new.gram @ change)
        gains = self.spectra[0].gains_of_leftover(common) + self.spectra[1].gains_of_leftover(common + change)
        return VARIANCES[np.argmax(gains, axis=1)]

    def difference(self) -> np.ndarray:
        """Coefficients (K,) of all columns in the second set less those in the first, each fitted alone, scaled."""
        base, new = self.weighed(np.zeros(len(self.new.channels)))
        ridge = _RIDGE * np.eye(len(base.cross))
        return np.linalg.solve(new.gram + ridge, new.cross) - np.linalg.solve(base.gram + ridge, base.cross)

    def problem(self, variance: np.ndarray) -> Problem:
        """The problem that two sets pose on the same columns, with a leftover of `variance` (C,) in each channel.

        Every effect may have changed, in any direction, and every value.
        """
        # Nats that a change costs without the parameter that makes its form that form (a payload without a mass): none
        # may be stated. Two such forms share what one alone should have where their columns have different noise.
        hidden_nats = 1e4
        prior, new, unit, usual = replace(self.prior, small_nats=hidden_nats), self.new, self.unit, self.usual
        size, rows = len(unit), self.spectra[1].rows
        terms = {t.key: _as_change(t) for t in new.terms}
        columns_of = {key: new.start[key] + np.arange(t.size) for key, t in terms.items()}
        gram, cross, bias, bias_cross = self._products(variance, _free_of(terms, columns_of, rows))
        root = limiting(gram, bias, prior)
        effects = {key: t.effect for key, t in terms.items() if t.kind == "effect"}
        sd, low, high, is_value = believed(terms.values(), {}, columns_of, unit, rows, prior)
        # What one row says is little next to what flights differ by anyway: a narrower prior would shrink the change.
        # What is stated of a nuisance stays.
        own = np.concatenate([np.zeros(0, int), *(columns_of[key] for key in effects)])
        alike = prior.change_reach * _looks_like(self.spectra[1].weighed(variance).gram, usual)
        sd[own] = np.hypot(np.hypot(sd, prior.value_reach * usual), alike)[own]
        for key, effect in effects.items():
            at = columns_of[key]
            if effect not in NAMES.values() and not terms[key].of_change:
                low[at], high[at] = -np.inf, np.inf
            elif effect in NAMES.values() and unit[at].all():
                sd[at] = prior.freed_sd[0] / unit[at]
        always = [columns_of[key] for key, t in terms.items() if t.kind not in ("effect", _UNCHANGED)]
        return Problem(
            terms=terms,
            columns_of=columns_of,
            always=np.concatenate([np.zeros(0, int), *always]),
            effects=effects,
            freed={},
            log_prior_of=log_priors(effects, terms, prior),
            unit=unit,
            gram=gram,
            cross=cross,
            bias=bias,
            limited_bias=bias * np.outer(root, root),
            limited_bias_cross=bias_cross * root,
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
            channel_gram=(new.gram.sum(axis=1) if self.sizes is None else self.sizes) * np.outer(unit, unit),
            brought_by={k: frozenset(b for b in effects if e in terms[b].brings) for k, e in effects.items()},
        )

    def _products(
        self, variance: np.ndarray, free: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """S̃ (K, K) and s̃ (K,) of the module's equations, scaled, and what the regressors' noise adds to each.

        `free` (K,) is the variance of the common coefficients.
        """
        base, new = self.weighed(variance)
        gram, cross, taken = _difference_products(base, new, free)
        usual = self.usual**2
        turn = np.linalg.inv(np.eye(len(cross)) + gram * usual)
        rest = np.eye(len(free)) - taken
        bias = turn @ (rest @ new.bias @ rest.T + taken @ base.bias @ taken.T) @ turn.T
        turned = turn @ gram
        return 0.5 * (turned + turned.T), turn @ cross, bias, -bias @ (usual * cross)


def pair_of(
    base: Evidence, new: Evidence, spread: np.ndarray, prior: Prior = PRIOR, sizes: np.ndarray | None = None
) -> Pair:
    """Two sets, in units in which their columns have unit length in both together; the rest as of `Pair`."""
    unit = unit_of(base, new)
    return Pair(new, (spectrum_of(base, unit), spectrum_of(new, unit)), spread, prior, sizes)


def _integrated(gram: np.ndarray, cross: np.ndarray, variance: np.ndarray) -> float:
    """Log of the integral over coefficients (K,) with normal priors of a `variance` (K,), nats."""
    root = np.sqrt(variance)
    inner = np.eye(len(cross)) + root[:, None] * gram * root
    scaled = root * cross
    return float(0.5 * scaled @ np.linalg.solve(inner, scaled) - 0.5 * np.linalg.slogdet(inner)[1])


def change_of(found: Found) -> np.ndarray:
    """The changes (K,) of the columns' coefficients in a model."""
    at, out = scored(found.problem, found.model), np.zeros(len(found.problem.unit))
    out[at.columns] = at.mode.beta
    return out


def _free_of(terms: Mapping[str, EvidenceTerm], columns_of: Mapping[str, np.ndarray], rows: int | float) -> np.ndarray:
    """Variance (K,) of the coefficients common to both sets, scaled; next to none of what one set has alone."""
    not_common = 1e-9  # The same of what only one set can have.
    # Variance of what is common to both sets, in units of what one row determines. With 1 more unseen pairs got a wrong
    # name; with 100 a change of mass in gentle flight is halved (docs/compare.md).
    free = 10.0
    out = np.full(sum(t.size for t in terms.values()), free * rows)
    for key, term in terms.items():
        if term.alone:
            out[columns_of[key]] = not_common
    return out


def _difference_products(base: Weighed, new: Weighed, free: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """S (K, K) and s (K,): products of the second set with what is common to both integrated out, scaled; and Q (K, K).

    `free` (K,) is the variance of the common coefficients.
    """
    taken = new.gram @ np.linalg.inv(base.gram + new.gram + np.diag(1.0 / free))
    return new.gram - taken @ new.gram, new.cross - taken @ (base.cross + new.cross), taken


def _looks_like(gram: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """One-sigma (K,) of each coefficient by itself where all coefficients differ by their `spread` (K,), scaled."""
    own = np.diag(gram)
    seen = np.sqrt((gram**2) @ spread**2)
    return np.divide(seen, own, out=np.zeros(len(own)), where=own > 0)


def _as_change(term: EvidenceTerm) -> EvidenceTerm:
    """A believed value as something that may have changed, named as the contract names it; another term as it is."""
    least_gain = 0.005  # The least one of a reading's gain.
    if term.kind != "value":
        return term
    name = NAMES[term.key]
    least_change = 0.015  # Relative change of a value up to which it does not matter.
    least = least_gain if term.key.startswith("gain") else least_change
    change = LinearParameter(name, "1", -MOST_CHANGE, MOST_CHANGE, least)
    return replace(term, kind="effect", effect=name, linear=(change,))


def usual_spread(
    base: Evidence, new: Evidence, known: np.ndarray, inertia: np.ndarray, form_sd: float = FORM_SD
) -> np.ndarray:
    """One-sigma (K,) of each coefficient between two flights by values, noise and forms alone, in its unit.

    `known` (K,) are the coefficients of the effects that the first set's model holds; `inertia` (C,) is the mass, or
    the inertia, of the second vehicle.yaml over the first one's in each channel: residual noise grows with it.
    `form_sd` is the share of what effects contribute that their forms are wrong by.
    """
    # Relative one-sigma between two flights in which nothing changed of a rotor's coefficient (3 K of air change its
    # density by a hundredth), and of mass, inertia and arm.
    same_sd, same_body_sd = 0.01, 0.003
    hidden = _hidden_by_noise(new, inertia) - _hidden_by_noise(base, np.ones(len(inertia)))
    out = form_spread(base, known, form_sd)
    forms = Counter((t.effect, p.symbol) for t in base.terms for p in t.linear)
    for term in base.terms:
        at = base.start[term.key] + np.arange(term.size)
        if term.kind == "value":
            out[at] = np.hypot(same_sd if term.key in _OF_THE_AIR else same_body_sd, hidden[at])
        elif term.effect in catalogue() and term.linear:
            effect = catalogue()[term.effect]
            usual = np.array([effect.between_flights.get(p.unit, 0.0) for p in term.linear])
            if _DERIVED in effect.excited_by:
                usual = np.hypot(usual, hidden_in(base, known)[at])
            # Several forms have the same parameter, and with it the same column.
            out[at] = np.hypot(out[at], usual / np.sqrt([forms[term.effect, p.symbol] for p in term.linear]))
    return out


def hidden_in(evidence: Evidence, known: np.ndarray) -> np.ndarray:
    """What noise of its own column may hide of each effect's coefficient (K,) at most, in its unit.

    The coefficient is that of the column by itself, given the effects `known` (K,).
    """
    own = np.maximum(np.einsum("cekk->k", evidence.gram), NEVER_EXCITED)
    left = evidence.cross.sum(axis=(0, 1)) - evidence.gram.sum(axis=(0, 1)) @ known
    size = np.abs(known + left / own)
    noise = left_by_all(evidence)[np.argmax(np.einsum("cekk->ck", evidence.gram), axis=0)]
    return np.minimum(size, noise / np.maximum(own * size, TINY))


def form_spread(evidence: Evidence, known: np.ndarray, form_sd: float) -> np.ndarray:
    """One-sigma (K,) of each effect's coefficient, in its unit, that other effects' forms look like.

    Effects of coefficients `known` (K,) are wrong by a share `form_sd` of what they contribute to each channel.
    """
    gram = evidence.gram.sum(axis=1)
    own = np.einsum("ckk->ck", gram)
    explained = np.einsum("k,ckl,l->c", known, gram, known)
    total = np.maximum(own.sum(axis=0), TINY)
    form = form_sd * np.sqrt((own * explained[:, None]).sum(axis=0)) / total
    return share_of_form(evidence) * form


def share_of_form(evidence: Evidence) -> np.ndarray:
    """What part of an effect's one-sigma each coefficient (K,) has: of its forms one is at work, no matter which.

    Forms of one effect look alike. Were each to differ by the whole, the effect would by the root of their number more.
    What is no effect has no part.
    """
    forms = Counter(t.effect for t in evidence.terms if t.kind == "effect")
    out = np.zeros(evidence.gram.shape[-1])
    for term in evidence.terms:
        if term.kind == "effect":
            out[evidence.start[term.key] + np.arange(term.size)] = forms[term.effect] ** -0.5
    return out


def _hidden_by_noise(evidence: Evidence, inertia: np.ndarray) -> np.ndarray:
    """The share (K,) of each coefficient that noise of its own column may hide at most, 0 to 1.

    At worst all that the model of all columns leaves in the channel is noise of that column: errors in variables reduce
    a coefficient by the share that noise has of the column's squares (Fuller, Measurement Error Models, 1987, 1.1.1).
    """
    own = np.einsum("cekk->ck", evidence.gram)
    left = left_by_all(evidence) / inertia**2
    main = np.argmax(own, axis=0)
    column = np.arange(own.shape[1])
    return np.clip(left[main] / np.maximum(own[main, column], NEVER_EXCITED), 0.0, 1.0)


def feigned(base: Evidence, new: Evidence, inertia: np.ndarray) -> np.ndarray:
    """One-sigma (K,) of what a closed loop feigns of a change of each coefficient, where commands alone tell it.

    Commands answer to what no model explains: with it a delay is found where none is, the same in both sets. What the
    second set has more of is at most all in step with the column (Cauchy and Schwarz): two standard errors. `inertia`
    (C,) as of `usual_spread`.
    """
    own = np.einsum("cekk->ck", new.gram) / new.blocks.sum()
    left = left_by_all(new) / inertia**2 / new.blocks.sum() - left_by_all(base) / base.blocks.sum()
    most = np.sqrt(own * np.maximum(left, 0.0)[:, None]).sum(axis=0)
    return 0.5 * most / np.maximum(own.sum(axis=0), NEVER_EXCITED)


def left_by_all(evidence: Evidence) -> np.ndarray:
    """Whitened squares (C,) that the model of all columns leaves in each channel."""
    gram, cross = evidence.gram.sum(axis=1), evidence.cross.sum(axis=1)
    out = np.empty(len(gram))
    for c, own in enumerate(np.einsum("ckk->ck", gram)):
        unit = np.where(own > NEVER_EXCITED, 1.0 / np.sqrt(np.maximum(own, NEVER_EXCITED)), 0.0)
        scaled = gram[c] * np.outer(unit, unit) + FULL_RIDGE * np.eye(len(unit))
        out[c] = evidence.square[c].sum() - (cross[c] * unit) @ np.linalg.solve(scaled, cross[c] * unit)
    return out


def spread_of_flights(flights: Sequence[Evidence], decide: Callable[[Evidence, Evidence], Found]) -> np.ndarray | float:
    """One-sigma (K,) of each coefficient by which the good flights differ among themselves, in its unit; 0 of too few.

    Of a class each member gets what makes it contribute as much. A variance of n flights is widened by (n + 1)/(n − 1).
    """
    fewest_flights = 3  # Two good flights give one difference alone, of which no variance is known.
    number = len(flights)
    if number < fewest_flights:
        return 0.0
    squares = np.zeros(flights[0].gram.shape[-1])
    for k, flight in enumerate(flights):
        others = joined([f for j, f in enumerate(flights) if j != k])
        squares += _differences(decide(others, flight), len(squares))
    return np.sqrt(squares / (number - 1) * (number + 1) / (number - 1))


def _differences(found: Found, count: int) -> np.ndarray:
    """Squares (count,) of the changes in a model, each member of a class as large as what it would contribute."""
    problem, at, out = found.problem, scored(found.problem, found.model), np.zeros(count)
    for said in statements_of(found):
        own = problem.columns_of[said.key]
        beta = at.mode.beta[places(at.columns, own)]
        out[own] = np.maximum(out[own], (beta * problem.unit[own]) ** 2)
        size = beta @ problem.channel_gram[:, own[:, None], own].sum(axis=0) @ beta
        for key, term in problem.terms.items():
            if term.effect in said.alternatives and key != said.key:
                others = problem.columns_of[key]
                energy = np.maximum(np.einsum("ckk->k", problem.channel_gram[:, others[:, None], others]), TINY)
                out[others] = np.maximum(out[others], size / energy * problem.unit[others] ** 2)
    return out


def joined(flights: Sequence[Evidence]) -> Evidence:
    """The evidence of several flights as one."""
    parts = {
        name: np.concatenate([getattr(f, name) for f in flights], axis=axis)
        for name, axis in (("gram", 1), ("cross", 1), ("square", 1), ("blocks", 0))
    }
    return replace(flights[0], **parts, bias_gram=sum(f.bias_gram for f in flights))


def of_environments(evidence: Evidence, chosen: np.ndarray) -> Evidence:
    """Evidence of some environments, a mask (E,)."""
    return replace(
        evidence,
        gram=evidence.gram[:, chosen],
        cross=evidence.cross[:, chosen],
        square=evidence.square[:, chosen],
        blocks=evidence.blocks[chosen],
        bias_gram=evidence.bias_gram * evidence.blocks[chosen].sum() / max(evidence.blocks.sum(), 1),
    )
