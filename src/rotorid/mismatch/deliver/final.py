"""The analysis whose model holds what is claimed, and the vehicle that is taken home, for every kind of set.

What is stated is what is delivered: numbers of effects and believed values by the fit that goes into the files.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import exp, nan

import numpy as np

from rotorid.mismatch.decide.enough import NOTHING, lowered, may_be_nothing, with_shares
from rotorid.mismatch.decide.findings import Analysis, ChannelTrace, Delivery, Finding, ValueRow
from rotorid.mismatch.decide.select import NEAR_LIMIT
from rotorid.mismatch.decide.selected import coefficients
from rotorid.mismatch.decide.status import CLAIMED
from rotorid.mismatch.deliver.candidates import Candidate, CandidateScore, Ground, choose
from rotorid.mismatch.deliver.derivatives import Learnt, learn
from rotorid.mismatch.deliver.files import claimed, improved_vehicle, place_of
from rotorid.mismatch.deliver.usable import exports_lost
from rotorid.mismatch.evidence.rows import CHANNELS, Term
from rotorid.mismatch.flight.delivered import FittedModel, Values, all_free, ways
from rotorid.mismatch.flight.values import believed_value
from rotorid.recordings import Vehicle
from rotorid.steps import step
from rotorid.vehicle.derivatives import about_hover_of, own_controls

_ONLY_A_RATIO = 0.9
"""Correlation of two values' estimates from which little more than their ratio is known."""
Stretches = Sequence[tuple[str, np.ndarray, np.ndarray]]
"""Of every stretch its run, the instants of its rows (n,), s, and the quantities of derivatives at them, (n, 12)."""


@dataclass(frozen=True)
class Offered:
    """What an analysis offers for delivery."""

    words: Analysis
    """Of the whole choice, with its statuses, which stay."""
    model: FittedModel
    """Of the fitted runs, with what is claimed alone."""
    values: Values
    """Values called wrong."""
    active: tuple[str, ...]
    """Terms of what is claimed."""
    plain: Values
    """Values called wrong where no effect is at work."""
    believed_left: list[np.ndarray]
    """What the believed vehicle leaves of every fitted stretch, (n, channels)."""
    believed: Vehicle
    names: Mapping[str, str]
    """Keys of values to their contract names."""
    whole: bool
    """Whether `model` lacks nothing of the choice."""
    improved: Callable[[Candidate], Vehicle]
    """A candidate's vehicle without effects."""
    again: Callable[[Candidate, Candidate, tuple[Finding, ...]], tuple[Analysis, Stretches]]
    """The named and the refitted candidate accounted for on every run, and the stretches of every run."""
    stretches: Stretches = ()
    """Of the fitted rows; none where there are no derivatives (stands and benches)."""
    vehicle: Callable[[Candidate, Sequence[Finding]], Vehicle] = lambda candidate, findings: None
    """A candidate's vehicle as it would be written, given what is claimed."""
    flown: Callable[[Candidate, Sequence[Finding], Ground], np.ndarray] = lambda c, findings, ground: c.flown
    """Errors of a candidate's vehicle run forward in windows of the fitted runs (`Candidate.flown`)."""
    unfit: Callable[[Vehicle], str] = lambda vehicle: ""
    """Why a vehicle is no body that hovers and flies; empty where it is."""
    remarks: tuple[str, ...] = ()
    chain_is_named: bool = False
    """Whether what lies between command and speed is known by force and moment alone: the believed vehicle lacks it."""
    larger: Callable[[Candidate, Term], np.ndarray] = lambda candidate, term: np.ones(len(term.form.linear))
    """Factors of a term's coefficients on a candidate's vehicle (`rotorid.mismatch.deliver.by_vehicle`)."""
    in_rows: Callable[[Vehicle], np.ndarray] = lambda vehicle: np.ones(len(CHANNELS) // 2)
    """Force and moment on a vehicle over those that its rows hold, (6,)."""
    embodied: Callable[[Values, Values], Values] = lambda values, moved: moved
    """Values moved within their trust such that next to those called wrong they are of one body (`as_a_body`)."""
    restates: bool = True
    """Whether numbers are stated by the fit that is delivered even where nothing else than that was found."""


@step("choosing what is delivered")
def as_delivered(words: Analysis, offer: Callable[[Analysis], Offered]) -> Analysis:
    """What an analysis amounts to once a vehicle is chosen; wrong values and their reasons stay.

    Statuses stay, too, but for an effect whose numbers, fitted as they are delivered, may all be nothing: what is
    offered is then what is left.
    """
    offered = offer(words)
    named = _fitted_candidate("named", offered, offered.values, offered.active)
    findings = words.findings
    if offered.restates or not offered.whole:
        findings = _restated(words.findings, offered, named)
        nothing = {f.id for f in findings if f.status in CLAIMED and f.values and may_be_nothing(f)}
        if nothing:
            stand = tuple(lowered(f, NOTHING) if f.id in nothing else f for f in words.findings)
            return as_delivered(replace(words, findings=stand), offer)
    model = offered.model
    ground = _ground_of(offered)
    believed = Candidate("believed", {}, (), None, {}, np.concatenate(offered.believed_left)[:, : len(CHANNELS) // 2])
    refitted = _fitted_candidate("refitted", offered, offered.plain, ())
    candidates = [believed, refitted]
    if offered.active or offered.values != offered.plain:
        candidates.append(named)
    if offered.stretches:
        candidates += [c.with_derivatives(learnt) for c in candidates if (learnt := _learnt_of(offered, c)).derivatives]
    candidates = [replace(c, flown=offered.flown(c, findings, ground)) for c in candidates]
    chosen, scored = choose(
        candidates,
        ground,
        lambda c: "" if c.name == ("believed", False) else offered.unfit(offered.vehicle(c, findings)),
    )
    taken = chosen.candidate
    findings = tuple(replace(f, withheld=_why_not(f, taken, scored, offered)) for f in findings)
    accounted, stretches = offered.again(named, refitted, findings)
    last = replace(
        accounted,
        findings=findings,
        values=words.values,
        suggested_values=words.suggested_values,
        instead=words.instead,
        not_testable=words.not_testable,
        improved=offered.improved(taken),
    )
    last = _with_taken(last, taken, scored, stretches, offered)
    return replace(
        with_shares(last),
        notes=(*last.notes, *offered.remarks, *exports_lost(improved_vehicle(last), offered.believed)),
        believed_values=_value_rows(model, named, last.improved, offered.believed, offered.names),
        value_correlations=_value_correlations(model, named, offered.names),
    )


def _ground_of(offered: Offered) -> Ground:
    """The fitted rows, by what is left out together."""
    regression = offered.model.regression
    units = regression.of_rows(regression.left_out_together())
    places: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    for r, unit in zip(offered.model.rows, units, strict=True):
        places.setdefault(r.run, []).append((r.time_s, unit))
    joined = {run: tuple(map(np.concatenate, zip(*parts, strict=True))) for run, parts in places.items()}
    return Ground(np.concatenate(units), joined)


def _fitted_candidate(name: str, offered: Offered, values: Values, active: Sequence[str]) -> Candidate:
    """A candidate with the other values as believed, or moved within their trust where that pays (`ways`)."""
    way = ways(offered.model, values, active)[0]
    left = np.concatenate(way.left)[:, : len(CHANNELS) // 2]
    return Candidate(name, values, tuple(active), way.fit, offered.embodied(values, way.moved), left)


def _learnt_of(offered: Offered, candidate: Candidate) -> Learnt:
    """The derivatives of what a candidate leaves."""
    vehicle = offered.improved(candidate)
    x = about_hover_of(np.concatenate([x for _, _, x in offered.stretches]), offered.believed, vehicle)
    regression = offered.model.regression
    folds = np.concatenate(regression.of_rows(regression.folds()))
    acting = offered.in_rows(vehicle)
    # Runs held out show that a side force of one or two runs is theirs alone; of a single run nothing shows it.
    of_the_day = offered.words.split.border_s is None and not regression.leaves_runs
    learnt = learn(x, acting * candidate.left, folds, own_controls(vehicle), of_the_day)
    return replace(learnt, left_out=learnt.left_out / acting)


def _why_not(finding: Finding, taken: Candidate, scored: Sequence[CandidateScore], offered: Offered) -> str:
    """Why a claimed property of the vehicle is not in the vehicle that is taken home; empty where it is."""
    if finding not in claimed([finding]) or place_of(finding) != "vehicle" or taken.model == "named":
        return ""
    between = finding.form is None  # command and speed: the refitted vehicle has it, too
    if between and not (offered.chain_is_named and taken.model == "believed"):
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


def _with_taken(
    analysis: Analysis, taken: Candidate, scored: Sequence[CandidateScore], stretches: Stretches, offered: Offered
) -> Analysis:
    """The analysis with the traces that the vehicle taken home leaves, and that vehicle's derivatives."""
    derivatives = taken.learnt.derivatives if taken.learnt else ()
    acting = offered.in_rows(analysis.improved)
    added = {
        (run, float(time_s[0])): taken.learnt.of(about_hover_of(x, offered.believed, analysis.improved)) / acting
        for run, time_s, x in stretches
        if len(time_s) and derivatives
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


def _restated(findings: Sequence[Finding], offered: Offered, named: Candidate) -> tuple[Finding, ...]:
    """Findings with their linear parameters by a settled fit; intervals reach to where the findings had them."""
    model = offered.model
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


def _value_rows(
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


def _value_correlations(model: FittedModel, named: Candidate, names: Mapping[str, str]) -> dict[tuple[str, str], float]:
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
    return {pair: r for pair, r in known.items() if abs(r) > _ONLY_A_RATIO}
