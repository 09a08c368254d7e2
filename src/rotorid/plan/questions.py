"""What a set leaves open, with the competing models ready to be compared: fitted once more by the engine itself."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rotorid.effects.contract import Form
from rotorid.errors import InputError
from rotorid.mismatch.analyse import findings_inside, findings_outside
from rotorid.mismatch.decision.findings import Finding, with_probabilities
from rotorid.mismatch.decision.select import COST_PER_PARAMETER
from rotorid.mismatch.delivery.derivatives import learn
from rotorid.mismatch.mistakes import find_mistakes
from rotorid.mismatch.model.absent import chosen_already
from rotorid.mismatch.model.fitted import Fitted, fitted
from rotorid.mismatch.model.next_flight import CURVES, beyond_flying
from rotorid.mismatch.model.prepare import Prepared, prepare
from rotorid.mismatch.model.within_trust import Way, ways
from rotorid.mismatch.plant.motion import HIGHEST_CUTOFF_HZ
from rotorid.mismatch.plant.regression import Regression
from rotorid.mismatch.plant.rows import Term
from rotorid.mismatch.plant.split import parts_of, split_runs
from rotorid.mismatch.posterior.status import CLAIMED
from rotorid.plan.between import ChainQuestion, chain_question
from rotorid.recordings import RecordingSet
from rotorid.recordings.sufficient import sufficient
from rotorid.vehicle.derivatives import derivative_form, own_controls, quantities

_LEAST_WEIGHT = 0.05
"""Relative probability from which a form may as well be the true one."""


@dataclass(frozen=True)
class Hypothesis:
    """One competing model: the terms of its id, given what all of them share, and their coefficients on this set."""

    id: str
    keys: tuple[str, ...]
    """Terms of its own, of the regression; empty where nothing stands in the id's place."""
    beta: np.ndarray
    """Coefficients of these, (k,)."""
    covariance: np.ndarray
    """Theirs, (k, k)."""
    weight: float = 1.0
    """Probability of this form on the set, relative to the most probable one of its id."""
    others: tuple[Hypothesis, ...] = ()
    """Other forms of the id that the set does not distinguish from this one."""


@dataclass(frozen=True)
class Question:
    """Ids of which one is at work, as a model each; `shared` are the keys that all models hold."""

    ids: tuple[str, ...]
    hypotheses: tuple[Hypothesis, ...]
    shared: tuple[str, ...]
    rivals: dict[str, tuple[tuple[str, ...], ...]]
    """To an id every set of terms that may stand for it when it is the other's rival."""


@dataclass(frozen=True)
class FittedSet:
    """A set as the engine fitted it, and what it leaves open."""

    recordings: RecordingSet
    prepared: Prepared
    fitted: Fitted
    findings: tuple[Finding, ...]
    questions: tuple[Question, ...]
    chains: tuple[ChainQuestion, ...]
    """The same of what lies between command and rotor speed."""
    unanswerable: tuple[tuple[tuple[str, ...], str], ...]
    """Classes that no flight with these columns can settle, with what it takes."""
    whitened: Regression | None = None
    """The set's normal equations through the filters that the engine would learn from it and a flight together."""
    derivatives: tuple[tuple[Form, np.ndarray], ...] = ()
    """Of what the fitted model leaves, as a form with its values; none where they do not predict."""

    @property
    def regression(self) -> Regression:
        """The engine's normal equations of the set."""
        return self.fitted.model.search.regression if self.whitened is None else self.whitened


def known(
    recordings: RecordingSet,
    suggested: Sequence[str] = (),
    claimed: Collection[str] | None = None,
    cutoff_hz: float = HIGHEST_CUTOFF_HZ,
) -> FittedSet:
    """The set fitted, and its open questions: classes left open, and ids in `suggested` that may as well be nothing.

    Of ids that the verdict on the set does not claim (`claimed`, all members of its classes) nothing is asked: they are
    too small to matter.

    Raises
    ------
    InputError
        The set is no flight.
    """
    if recordings.vehicle.kind != "flight":
        raise InputError(f"set {recordings.name}: a plan is made for flights; this is a {recordings.vehicle.kind}")
    recordings, mistakes, _ = find_mistakes(recordings)
    split = split_runs(recordings)
    fit_part, unseen = parts_of(recordings, split)
    prepared = prepare(fit_part, cutoff_hz, unseen=tuple(r.name for r in unseen.runs))
    found = fitted(prepared)
    way = ways(found.model, found.values, found.model.selection.active)[0]
    inside = with_probabilities(findings_inside(found, prepared, way.fit), chosen_already(found.model))
    findings = (*mistakes, *findings_outside(found, prepared), *inside)
    chain = () if found.chain is None else tuple(k for k, _ in found.chain[0].fit.chain)
    if claimed is not None:
        findings = tuple(f for f in findings if f.id in claimed or f.id in suggested)
    questions, chains, unanswerable, seen = [], [], [], set()
    for finding in findings:
        ids = tuple(finding.alternatives) if finding.status == "ambiguous" else ()
        if found.commanded and finding.id in CURVES and finding.status in CLAIMED:
            # Whichever was found: known from commands alone the other would do as well.
            ids = tuple(sorted({*ids, *CURVES}))
        if not ids and finding.id in suggested and finding.status in ("established", "suggested"):
            ids = (finding.id,)
        if not ids or frozenset(ids) in seen:
            continue
        seen.add(frozenset(ids))
        if needed := beyond_flying(found, ids):
            unanswerable.append((ids, needed))
        elif finding.id in chain:
            if (between := chain_question(found, finding, ids)) is not None:
                chains.append(between)
            else:
                needed = "these columns give no chain of the others to compare with"
                more = "" if found.measured else "; record the rotor speeds next to the commands"
                unanswerable.append((ids, needed + more))
        elif (question := question_of(found, finding, ids)) is not None:
            questions.append(question)
        else:
            unanswerable.append((ids, "these columns give no model of the others to compare with"))
    own = _derivatives_of(found, way)
    asked = tuple(questions), tuple(chains), tuple(unanswerable)
    return FittedSet(recordings, prepared, found, findings, *asked, derivatives=own)


def _derivatives_of(found: Fitted, way: Way) -> tuple[tuple[Form, np.ndarray], ...]:
    """Derivatives of what a fit leaves where it was not fitted, as a form with its values."""
    model, vehicle, thinner = found.model, found.prepared.vehicle, found.prepared.thinner
    x = np.concatenate([thinner(quantities(s.motion, vehicle)) for s in model.segments])
    folds = np.concatenate(model.regression.of_rows(model.regression.folds()))
    learnt = learn(x, np.concatenate(way.left)[:, :6], folds, own_controls(vehicle))
    form = derivative_form(vehicle.model_copy(update={"derivatives": learnt.derivatives}))
    return () if form is None else (form,)


def known_from(recordings: RecordingSet, verdict: dict) -> FittedSet:
    """A set fitted, with the questions that its verdict leaves open; `verdict` is the content of its verdict.json.

    Raises
    ------
    InputError
        The set is no flight, or does not suffice.
    """
    suggested = [e["id"] for e in verdict["effects"] if e["status"] == "suggested"]
    return known(sufficient(recordings), suggested, claimed_in(verdict))


def claimed_in(verdict: dict) -> set[str]:
    """Ids that a verdict (the content of its verdict.json) claims, and the members of its classes."""
    claims = [e for e in verdict["effects"] if e["status"] in ("established", "ambiguous")]
    return {i for e in claims for i in (e["id"], *e["alternatives"])}


def question_of(found: Fitted, finding: Finding, ids: tuple[str, ...]) -> Question | None:
    """The competing models of a class of which `finding` is the one in the model; None with fewer than two models."""
    search, selection = found.model.search, found.model.selection
    own = next((k for k in selection.active if search.terms[k].effect == finding.id), None)
    if own is None:
        return None
    rest = [k for k in selection.active if k != own]
    shared = tuple([*search.always, *rest])
    forms = {i: [t for t in search.terms.values() if t.effect == i and not t.run] for i in ids}
    forms[finding.id] = sorted(forms[finding.id], key=lambda t: t.key != own)
    hypotheses, rivals = [], {}
    for i in ids:
        choices = [(t.key,) for t in forms[i]]
        if not choices:
            continue
        rivals[i] = tuple(choices)
        hypotheses.append(_hypothesis_of(search.regression, shared, i, choices, search.terms, own))
    if len(ids) == 1:
        hypotheses.append(Hypothesis("nothing", (), np.zeros(0), np.zeros((0, 0))))
        rivals["nothing"] = ((),)
    if len(hypotheses) < 2:
        return None
    return Question(tuple(h.id for h in hypotheses), tuple(hypotheses), shared, rivals)


def best_of(regression: Regression, shared: Sequence[str], choices, terms: dict[str, Term]) -> tuple[str, ...]:
    """The terms that explain most for their parameters."""

    def worth(keys: tuple[str, ...]) -> float:
        return regression.explained([*shared, *keys]) - COST_PER_PARAMETER * sum(terms[k].size for k in keys)

    return max(choices, key=worth)


def _hypothesis_of(
    regression: Regression, shared: Sequence[str], name: str, choices, terms: dict[str, Term], own: str
) -> Hypothesis:
    """The model of an id in its best form, `own` where that is one of its `choices`, with the forms nearly as good."""

    def worth(keys: tuple[str, ...]) -> float:
        return regression.explained([*shared, *keys]) - COST_PER_PARAMETER * sum(terms[k].size for k in keys)

    best = (own,) if (own,) in choices else best_of(regression, shared, choices, terms)
    weights = {keys: float(np.exp(min(worth(keys) - worth(best), 0.0) / 2)) for keys in choices if keys != best}
    others = (
        replace(hypothesis(regression, shared, name, k), weight=w) for k, w in weights.items() if w > _LEAST_WEIGHT
    )
    return replace(hypothesis(regression, shared, name, best), others=tuple(others))


def hypothesis(regression: Regression, shared: Sequence[str], name: str, keys: tuple[str, ...]) -> Hypothesis:
    """A competing model with its coefficients as this set has them."""
    fit = regression.fit([*shared, *keys])
    where = fit.places(regression.columns(keys))
    return Hypothesis(name, keys, fit.beta[where], fit.covariance[np.ix_(where, where)])
