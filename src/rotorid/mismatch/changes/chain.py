"""The chain from command to rotor speed in two sets: lag, delay, throttle curve, battery.

What a small change of each of its parameters does is a column like any other: of the rotor speeds where they are
measured, of force and moment where they are known from the commands alone. The chain holds the forms that the first
set has, and one of every other id at the values that change nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rotorid.effects.contract import DELAY, LIMIT, Parameter
from rotorid.mismatch.changes.problem import PRIOR, change_of, held, weighed_changes
from rotorid.mismatch.decide.posterior import Found
from rotorid.mismatch.evidence.gram import Evidence, EvidenceTerm, LinearParameter, evidence_from
from rotorid.mismatch.evidence.motion import Segment
from rotorid.mismatch.evidence.regression import autoregression, build
from rotorid.mismatch.evidence.rows import Rows, Term
from rotorid.mismatch.evidence.speedpath import Chain, candidate_forms
from rotorid.mismatch.flight.every_run import as_flown
from rotorid.mismatch.flight.fitted import Fitted
from rotorid.mismatch.flight.prepare import assemble_rows

_OF_ROTORS = "offset:rotors"
"""Start of the keys of offsets in time that are a delay of the commands: the chain has it."""


@dataclass(frozen=True)
class ChainTerms:
    """The forms of a chain, and the parameters at which their columns are taken."""

    chain: Chain
    values: np.ndarray
    """(P,) parameters of every form in order."""
    rate_hz: float
    """Of the stretches."""

    @property
    def parameters(self) -> list[Parameter]:
        """All parameters, in the order of `values`."""
        return [p for _, form in self.chain for p in form.parameters]

    @property
    def terms(self) -> list[Term]:
        """A term for each form."""
        sizes = [len(form.parameters) for _, form in self.chain]
        return [
            Term(f"{effect}/{form.name}", "effect", effect, size=size, prior_sd=(np.inf,) * size)
            for (effect, form), size in zip(self.chain, sizes, strict=True)
        ]

    @property
    def places(self) -> dict[str, slice]:
        """Key of each form's term to where its parameters stand in `values`."""
        ends = np.cumsum([0, *(t.size for t in self.terms)])
        return {t.key: slice(a, b) for t, a, b in zip(self.terms, ends, ends[1:], strict=False)}

    @property
    def spread(self) -> np.ndarray:
        """One-sigma (P,) of each parameter between two flights in which nothing changed, in its unit."""
        # One-sigma between two flights in which nothing changed: of a time constant relative to itself, and of a number
        # without unit (another charge of the battery).
        same_time_sd, same_share_sd = 0.03, 0.01
        # One-sigma of the instant between two samples at which commands are stamped, in samples: evenly spread over
        # one.
        same_phase_sd = 0.29
        times = np.array([p.unit == "s" for p in self.parameters])
        least = np.array([p.negligible for p in self.parameters])
        late = np.array([form.stage == DELAY for _, form in self.chain for _ in form.parameters])
        usual = np.where(times, same_time_sd * np.abs(self.values), same_share_sd)
        return np.sqrt(usual**2 + least**2 + np.where(late, same_phase_sd / self.rate_hz, 0.0) ** 2)

    @property
    def steps(self) -> np.ndarray:
        """(P,) changes from which columns are taken, away from the upper bound."""
        own = self.parameters
        step_s, step = 0.002, 0.01  # Changes of a time and of another parameter from which its column is taken.
        size = np.array([step_s if p.unit == "s" else step for p in own])
        return np.where(self.values + size > [p.high for p in own], -size, size)

    def at(self, values: np.ndarray) -> ChainTerms:
        """The same forms with other parameters (P,), within their bounds."""
        own = self.parameters
        return replace(self, values=np.clip(values, [p.low for p in own], [p.high for p in own]))

    def starts(self) -> list[tuple[str, ChainTerms]]:
        """Chains to start from, each with the key of the form whose time constants are longer or shorter than here."""
        start_s = 0.025  # By how much longer or shorter time constants are from which a change is sought, too.
        out = [("", self)]
        for key, own in self.places.items():
            times = [i for i in range(own.start, own.stop) if self.parameters[i].unit == "s"]
            for away in (start_s, -start_s) if times else ():
                values = self.values.copy()
                values[times] += away
                moved = self.at(values)
                if not np.array_equal(moved.values, self.values):
                    out.append((key, moved))
        return out

    def stepped(self) -> list[ChainTerms]:
        """The chain with each parameter changed by its step."""
        return [replace(self, values=self.values + row) for row in np.diag(self.steps)]

    def named(self, evidence: Evidence, first: ChainTerms) -> Evidence:
        """Evidence whose terms know the parameters' symbols, as changes from those of the first set."""
        places = self.places

        def named(term: EvidenceTerm) -> EvidenceTerm:
            if term.key not in places:
                return term
            own = places[term.key]
            linear = (
                LinearParameter(p.symbol, p.unit, p.low - v, p.high - v, p.negligible)
                for p, v in zip(self.parameters[own], first.values[own], strict=True)
            )
            form = term.key.removeprefix(f"{term.effect}/")
            return replace(term, form=form, linear=tuple(linear), of_change=True)

        offsets = {t.key for t in evidence.terms if t.key.startswith(_OF_ROTORS)}
        return held(replace(evidence, terms=tuple(named(t) for t in evidence.terms)), offsets)


def chain_terms(found: Fitted, segments: Sequence[Segment]) -> ChainTerms | None:
    """The chain of a set's model, and one form of every other id; None where no commands are recorded."""
    if found.chain is None:
        return None
    result, full_voltage = found.chain.result, found.chain.full_voltage
    chain, values = list(result.fit.chain), [float(v) for v in result.fit.values]
    taken = {effect for effect, _ in chain}
    for effect, form in candidate_forms(list(segments), full_voltage is not None):
        if effect not in taken and form.stage != LIMIT:
            taken.add(effect)
            chain.append((effect, form))
            values += form.neutral
    kept = ChainTerms(tuple(chain), np.array(values), segments[0].rate_hz)
    return kept.at(kept.values)


def turning(found: Fitted, chain: ChainTerms) -> Fitted:
    """The set's model with another chain."""
    result = found.chain.result
    fit = replace(result.fit, chain=chain.chain, values=chain.values)
    return replace(found, chain=found.chain._replace(result=replace(result, fit=fit)))


def chain_columns(
    rows: Sequence[Rows], recorded: Sequence[Segment], found: Fitted, chain: ChainTerms
) -> list[np.ndarray]:
    """What a unit of each parameter of the chain leaves less in every channel of some stretches, (n, 12, P) each.

    `rows` are those of the stretches with the rotors turning as `chain` makes of their commands.
    """
    prepared, effects = found.model.prepared, found.model.effects
    columns = []
    for other, step in zip(chain.stepped(), chain.steps, strict=True):
        moved = assemble_rows(prepared, [], as_flown(list(recorded), turning(found, other)), effects)
        columns.append([(r.y - m.y) / step for r, m in zip(rows, moved, strict=True)])
    return [np.stack(own, axis=2) for own in zip(*columns, strict=True)]


def speed_rows(segments: Sequence[Segment], found: Fitted, chain: ChainTerms, first: ChainTerms) -> list[Rows]:
    """Rows of measured rotor speeds, rad/s: what the chain leaves of them, and a column for each of its parameters.

    `first` is the first set's chain: what the rows leave is that of it.
    """
    out = []
    for segment in segments:
        now, *moved = (found.chain.speeds(segment, own.chain, own.values) for own in (chain, *chain.stepped()))
        x = np.stack([(other - now) / step for other, step in zip(moved, chain.steps, strict=True)], axis=2)
        y = segment.motion.rotor_speed - now + x @ (chain.values - first.values)
        out.append(Rows(segment.run, segment.motion.time_s, y, x))
    return out


def speed_evidence(rows: list[Rows], filters: dict[int, np.ndarray], chain: ChainTerms, first: ChainTerms) -> Evidence:
    """The evidence of measured rotor speeds, one channel a rotor."""
    rate_hz = chain.rate_hz
    regression = build(rows, chain.terms, filters, None, 1.0, rate_hz, by_channel=True)
    return chain.named(evidence_from(regression), first)


def speed_filters(rows: list[Rows]) -> dict[int, np.ndarray]:
    """Whitening filters of what the chain leaves of each rotor's speed."""
    return {k: autoregression([r.y[:, k] for r in rows]) for k in range(rows[0].y.shape[1])}


def squares_of_speeds(rows: list[Rows], segments: Sequence[Segment], chain: ChainTerms) -> dict[str, np.ndarray]:
    """To the key of each form what its columns amount to (k, k), as mean squares of shares of the thrust."""
    out, count = {}, sum(len(r.y) for r in rows)
    for key, own in chain.places.items():
        shares = [
            2.0 * r.x[:, :, own] / np.maximum(s.motion.rotor_speed, 1.0)[:, :, None]
            for r, s in zip(rows, segments, strict=True)
        ]
        out[key] = sum(np.einsum("nci,ncj->ij", x, x) / x.shape[1] for x in shares) / count
    return out


@dataclass(frozen=True)
class ChainOption:
    """Changes found with the chain's columns taken where they lead to."""

    found: Found
    chain: ChainTerms
    log_posterior: float
    """Nats, less a constant of the first set."""


_Products = Callable[[ChainTerms | None], tuple[Evidence, Evidence]]
"""Evidence of both sets with the second one's columns taken at a chain."""


def remembering(products_at: _Products) -> _Products:
    """The same, asked once for each chain: its columns cost many times what a decision does."""
    kept: dict[tuple[float, ...], tuple[Evidence, Evidence]] = {}

    def remembered(chain: ChainTerms | None) -> tuple[Evidence, Evidence]:
        key = () if chain is None else tuple(chain.values)
        if key not in kept:
            kept[key] = products_at(chain)
        return kept[key]

    return remembered


def options_of(
    first: ChainTerms | None,
    products_at: _Products,
    spread: np.ndarray,
    base_at: Callable[[ChainTerms], Evidence],
) -> list[ChainOption]:
    """The most probable changes, and those without each form of the chain that changed in them; the best first.

    `first` is None where the chain's columns are not among those compared. Each is sought from several chains: a delay
    of some samples is not seen from where there is none, nor from where a lag in its place has led to. Where another
    chain is found the first set is looked at with it, too (`base_at`): what suits both sets better is no change.
    `spread` (K,) is the one-sigma of each coefficient between flights in which nothing changed.
    """

    def decided_at(chain: ChainTerms | None, same: Collection[str] = ()) -> ChainOption:
        """The most probable changes with the columns taken at a chain; the forms `same` did not change."""
        base, new = products_at(chain)
        found, log_posterior = weighed_changes(base, held(new, same), spread)
        return ChainOption(found, chain, log_posterior)

    if first is None:
        return [decided_at(None)]

    def from_start(now: ChainTerms, same: Collection[str]) -> ChainOption:
        """The same with the columns of the chain taken anew at what was found (Gauss and Newton)."""
        chain_rounds = 4  # Times that the chain's columns are taken, at most.
        for _ in range(chain_rounds):
            option = decided_at(now, same)
            problem, change = option.found.problem, change_of(option.found) * option.found.problem.unit
            away = np.concatenate([change[problem.columns_of[t.key]] for t in first.terms])
            chain = first.at(first.values + away)
            if np.all(np.abs(chain.values - now.values) < first.spread):
                break
            now = chain
        return option

    def best(same: Collection[str] = ()) -> ChainOption:
        tried = (from_start(start, same) for key, start in first.starts() if key not in same)
        return max(tried, key=lambda o: o.log_posterior)

    plain = best()
    others = [best((t.key,)) for t in first.terms if t.key in plain.found.model]
    if not np.array_equal(plain.chain.values, first.values):
        base, moved, new = products_at(first)[0], base_at(plain.chain), products_at(plain.chain)[1]
        found, log_posterior = weighed_changes(moved, new, spread)
        gained = 0.5 * float(base.square.sum() - moved.square.sum())
        others.append(ChainOption(found, plain.chain, log_posterior + gained))
    return sorted([plain, *others], key=lambda o: -o.log_posterior)


def others_in_place(options: Sequence[ChainOption], effect: str) -> frozenset[str]:
    """Ids that changed, in place of `effect`, in an option nearly as probable as the best one."""

    def ids(option: ChainOption) -> set[str]:
        return {option.found.problem.terms[key].effect for key in option.found.model}

    best = options[0]
    near = [ids(o) for o in options[1:] if best.log_posterior - o.log_posterior < PRIOR.open_nats]
    return frozenset().union(*(own - ids(best) for own in near if effect not in own))
