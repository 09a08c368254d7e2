"""The analysis whose model holds what is claimed, and the vehicle that is taken home, for every kind of set.

What is stated is what is delivered: numbers of effects and believed values by the fit that goes into the files.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from math import exp, nan
from typing import ClassVar, Literal

import numpy as np

from rotorid.mismatch.decide.enough import NOTHING, lowered, may_be_nothing, with_shares
from rotorid.mismatch.decide.findings import Analysis, ChannelTrace, Delivery, Finding, ValueRow
from rotorid.mismatch.decide.problem import Values
from rotorid.mismatch.decide.select import NEAR_LIMIT
from rotorid.mismatch.decide.selected import coefficients
from rotorid.mismatch.decide.status import CLAIMED
from rotorid.mismatch.decide.values import believed_value
from rotorid.mismatch.decide.ways import FittedModel, all_free, ways
from rotorid.mismatch.deliver.candidates import Candidate, CandidateScore, Ground, choose
from rotorid.mismatch.deliver.derivatives import Learnt, learn
from rotorid.mismatch.deliver.files import claimed, improved_vehicle, place_of
from rotorid.mismatch.deliver.usable import exports_lost
from rotorid.mismatch.evidence.rows import CHANNELS, Term
from rotorid.recordings import Split, Vehicle
from rotorid.steps import step
from rotorid.vehicle.derivatives import about_hover_of, own_controls

Stretches = Sequence[tuple[str, np.ndarray, np.ndarray]]
"""Of every stretch its run, the instants of its rows (n,), s, and the quantities of derivatives at them, (n, 12)."""


@dataclass(frozen=True)
class Choice(ABC):
    """What was chosen on the fitted runs alone: the answer, of which everything is asked that comes after.

    A kind of set says how it is accounted for on every run, and what is left of it where less is claimed.
    """

    model: FittedModel
    """Of the fitted runs."""
    values: Values
    """Values called wrong."""
    plain: Values
    """Values called wrong where no effect is at work."""
    stated: Values
    """Wrong values as they are stated."""
    findings: tuple[Finding, ...]
    split: Split
    believed: Vehicle
    question: Callable[[Vehicle], str]
    """Why a vehicle is no body that hovers and flies; empty where it is."""
    remarks: tuple[str, ...]

    names: ClassVar[Mapping[str, str]]
    """Keys of values to their contract names."""
    restates: ClassVar[bool] = True
    """Whether numbers are stated by the fit that is delivered even where nothing else than that was found."""

    @abstractmethod
    def account(self, findings: tuple[Finding, ...]) -> Analysis:
        """What the choice amounts to on every run, given the words on it so far."""

    @abstractmethod
    def only(self, words: Analysis) -> Choice:
        """The choice with what an analysis of it claims alone at work; the same where that is all."""

    @abstractmethod
    def without_effects(self, candidate: Candidate) -> Vehicle:
        """A candidate's vehicle without effects."""

    @abstractmethod
    def believed_left(self) -> list[np.ndarray]:
        """What the believed vehicle leaves of every fitted stretch, (n, channels)."""

    @property
    def active(self) -> tuple[str, ...]:
        """Terms of the effects at work."""
        return tuple(self.model.selection.active)

    @property
    def commanded(self) -> bool:
        """Whether what lies between command and speed is known by force and moment alone: the believed vehicle lacks
        it."""
        return False

    def stretches(self, every_run: bool = False) -> Stretches:
        """Of the fitted rows, or of those of every run; none where there are no derivatives (stands and benches)."""
        return ()

    def vehicle(self, candidate: Candidate, findings: Sequence[Finding]) -> Vehicle:
        """A candidate's vehicle as it would be written, given what is claimed."""
        return self.without_effects(candidate)

    def flown(self, candidate: Candidate, findings: Sequence[Finding], ground: Ground, words: Analysis) -> np.ndarray:
        """Errors of a candidate's vehicle run forward in windows of the fitted runs (`Candidate.flown`).

        `words` is the analysis with conditions and instruments.
        """
        return candidate.flown

    def larger(self, candidate: Candidate, term: Term) -> np.ndarray:
        """Factors of a term's coefficients on a candidate's vehicle (`rotorid.mismatch.deliver.by_vehicle`)."""
        return np.ones(len(term.form.linear))

    def in_rows(self, vehicle: Vehicle) -> np.ndarray:
        """Force and moment on a vehicle over those that its rows hold, (6,)."""
        return np.ones(len(CHANNELS) // 2)

    def embodied(self, values: Values, moved: Values) -> Values:
        """Values moved within their trust such that next to those called wrong they are of one body (`as_a_body`)."""
        return moved

    @cached_property
    def named(self) -> Candidate:
        """The candidate with the effects at work."""
        return self._candidate("named", self.values, self.active)

    @cached_property
    def refitted(self) -> Candidate:
        """The candidate with values alone."""
        return self._candidate("refitted", self.plain, ())

    def _candidate(self, model: Literal["named", "refitted"], values: Values, active: tuple[str, ...]) -> Candidate:
        """A candidate with the other values as believed, or moved within their trust where that pays (`ways`)."""
        way = ways(self.model, values, active)[0]
        left = np.concatenate(way.left)[:, : len(CHANNELS) // 2]
        return Candidate(model, values, active, way.fit, self.embodied(values, way.moved), left)


def delivered(choice: Choice, in_words: Callable[[Analysis], Analysis]) -> Analysis:
    """What a choice amounts to on every run once its words are weighed (`in_words`) and a vehicle is chosen."""
    return _as_delivered(in_words(choice.account(choice.findings)), choice)


@step("choosing what is delivered")
def _as_delivered(words: Analysis, choice: Choice) -> Analysis:
    """The analysis with a vehicle chosen; wrong values and their reasons stay.

    Statuses stay, too, but for an effect whose numbers, fitted as they are delivered, may all be nothing: what is
    delivered is then what is left.
    """
    offered = choice.only(words)
    findings = words.findings
    if offered.restates or offered is not choice:
        findings = _restated(words.findings, offered)
        nothing = {f.id for f in findings if f.status in CLAIMED and f.values and may_be_nothing(f)}
        if nothing:
            stand = tuple(lowered(f, NOTHING) if f.id in nothing else f for f in words.findings)
            return _as_delivered(replace(words, findings=stand), choice)
    ground = _ground_of(offered)
    left = np.concatenate(offered.believed_left())[:, : len(CHANNELS) // 2]
    candidates = [Candidate("believed", {}, (), None, {}, left), offered.refitted]
    if offered.active or offered.values != offered.plain:
        candidates.append(offered.named)
    if offered.stretches():
        candidates += [c.with_derivatives(learnt) for c in candidates if (learnt := _learnt_of(offered, c)).derivatives]
    candidates = [replace(c, flown=offered.flown(c, findings, ground, words)) for c in candidates]
    chosen, scored = choose(
        candidates,
        ground,
        lambda c: "" if c.name == ("believed", False) else offered.question(offered.vehicle(c, findings)),
    )
    taken = chosen.candidate
    findings = tuple(replace(f, withheld=_why_not(f, taken, scored, offered)) for f in findings)
    accounted = words if offered is choice else offered.account(findings)
    last = replace(
        accounted,
        findings=findings,
        values=words.values,
        suggested_values=words.suggested_values,
        instead=words.instead,
        not_testable=words.not_testable,
        improved=offered.without_effects(taken),
    )
    last = _with_taken(last, taken, scored, offered)
    return replace(
        with_shares(last),
        notes=(*last.notes, *offered.remarks, *exports_lost(improved_vehicle(last), offered.believed)),
        believed_values=_value_rows(offered, last.improved),
        value_correlations=_value_correlations(offered),
    )


def _ground_of(offered: Choice) -> Ground:
    """The fitted rows, by what is left out together."""
    regression = offered.model.regression
    units = regression.of_rows(regression.left_out_together())
    places: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    for r, unit in zip(offered.model.rows, units, strict=True):
        places.setdefault(r.run, []).append((r.time_s, unit))
    joined = {run: tuple(map(np.concatenate, zip(*parts, strict=True))) for run, parts in places.items()}
    return Ground(np.concatenate(units), joined)


def _learnt_of(offered: Choice, candidate: Candidate) -> Learnt:
    """The derivatives of what a candidate leaves."""
    vehicle = offered.without_effects(candidate)
    x = about_hover_of(np.concatenate([x for _, _, x in offered.stretches()]), offered.believed, vehicle)
    regression = offered.model.regression
    folds = np.concatenate(regression.of_rows(regression.folds()))
    acting = offered.in_rows(vehicle)
    # Runs held out show that a side force of one or two runs is theirs alone; of a single run nothing shows it.
    of_the_day = offered.split.border_s is None and not regression.leaves_runs
    learnt = learn(x, acting * candidate.left, folds, own_controls(vehicle), of_the_day)
    return replace(learnt, left_out=learnt.left_out / acting)


def _why_not(finding: Finding, taken: Candidate, scored: Sequence[CandidateScore], offered: Choice) -> str:
    """Why a claimed property of the vehicle is not in the vehicle that is taken home; empty where it is."""
    if finding not in claimed([finding]) or place_of(finding) != "vehicle" or taken.model == "named":
        return ""
    between = finding.form is None  # command and speed: the refitted vehicle has it, too
    if between and not (offered.commanded and taken.model == "believed"):
        return ""  # fitted and judged in the rotors' speeds
    having = ("named", "refitted") if between else ("named",)
    best = min((s for s in scored if s.candidate.model in having), key=lambda s: s.score, default=None)
    if best is None:
        return ""
    own = next(s for s in scored if s.candidate.name == taken.name)
    if best.unfit:
        return f"with it {best.unfit}"
    return (
        f"on what was left out of the fit, vehicles with it have {100 * exp(best.score):.0f} % of the "
        f"believed vehicle's error, the plainer one that is delivered {100 * exp(own.score):.0f} %"
    )


def _with_taken(analysis: Analysis, taken: Candidate, scored: Sequence[CandidateScore], offered: Choice) -> Analysis:
    """The analysis with the traces that the vehicle taken home leaves, and that vehicle's derivatives."""
    derivatives = taken.learnt.derivatives if taken.learnt else ()
    acting = offered.in_rows(analysis.improved)
    added = {
        (run, float(time_s[0])): taken.learnt.of(about_hover_of(x, offered.believed, analysis.improved)) / acting
        for run, time_s, x in (offered.stretches(every_run=True) if derivatives else ())
        if len(time_s)
    }

    def left(trace: ChannelTrace) -> ChannelTrace:
        if trace.channel not in CHANNELS[:6]:
            return trace
        base = trace.of_model(taken.model)
        part = added.get((trace.run, float(trace.time_s[0])) if len(trace.time_s) else None)
        return replace(trace, after=base if part is None else base - part[:, CHANNELS.index(trace.channel)])

    scores = tuple((*s.candidate.name, s.score, s.standard_error, s.unfit) for s in scored)
    return replace(
        analysis,
        improved=analysis.improved.model_copy(update={"derivatives": derivatives}),
        traces=tuple(map(left, analysis.traces)),
        delivery=Delivery(taken.model, bool(derivatives), scores),
    )


def _restated(findings: Sequence[Finding], offered: Choice) -> tuple[Finding, ...]:
    """Findings with their linear parameters by a settled fit; intervals reach to where the findings had them."""
    model, named = offered.model, offered.named
    key_of = {model.search.terms[k].form: k for k in named.active}
    out = []
    for finding in findings:
        key = key_of.get(finding.form)
        if key is None or not finding.values or not finding.form.linear:
            out.append(finding)
            continue
        form = finding.form
        values = np.array(finding.values, float)
        beta = coefficients(model.regression, named.fit, key)[0]
        values[list(form.linear)] = form.stated(offered.larger(named, model.search.terms[key]) * beta)
        now = dict(zip((p.symbol for p in form.parameters), values, strict=True))
        parameters = tuple(
            replace(e, value=v, low=min(e.low, e.low + v - e.value), high=max(e.high, e.high + v - e.value))
            if (v := float(now.get(e.symbol, e.value))) != e.value
            else e
            for e in finding.parameters
        )
        out.append(replace(finding, values=tuple(map(float, values)), parameters=parameters))
    return tuple(out)


def _value_rows(offered: Choice, improved: Vehicle) -> tuple[ValueRow, ...]:
    """Every believed value before and after: estimated jointly with the delivered effects, all free, and delivered."""
    model, named, believed, names = offered.model, offered.named, offered.believed, offered.names
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
        if key not in named.values and abs(beta[0]) > NEAR_LIMIT * model.regression.limit[model.regression.start[key]]:
            low = high = nan  # a bound holds it: what the recordings say of it is not known
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


def _value_correlations(offered: Choice) -> dict[tuple[str, str], float]:
    """Correlations of two values' estimates from `only_a_ratio` on, trust left out: what the recordings alone know."""
    model, named, names = offered.model, offered.named, offered.names
    keys = model.values_beside(named.active)
    loose = dict.fromkeys(keys, 1.0)
    fit = model.regression.fit([*model.regression.keys_of("nuisance", "wind"), *keys, *named.active], loose=loose)
    places = fit.places(model.regression.columns(keys))
    covariance = fit.covariance[np.ix_(places, places)]
    sd = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    correlation = covariance / np.outer(sd, sd)
    pairs = combinations(range(len(keys)), 2)
    known = {(names[keys[i]], names[keys[j]]): float(correlation[i, j]) for i, j in pairs}
    only_a_ratio = 0.9  # Correlation of two values' estimates from which little more than their ratio is known.
    return {pair: r for pair, r in known.items() if abs(r) > only_a_ratio}
