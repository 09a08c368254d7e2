"""The proof of the next flight: an open question, the flight planned for it, and what both sets together say.

A row is one concealed set that the engine left open, or that holds a pair of confusers flown so that little
distinguishes them. The plan knows the set alone; the simulator that made it records the planned flight, and as a
yardstick a standard flight of the same length; both sets are judged together by the engine. Of stands and benches the
same with sessions in place of flights.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace

import numpy as np
import pandas as pd

from rotorid.mismatch.decide.findings import Finding
from rotorid.mismatch.evidence.regression import Regression, build
from rotorid.mismatch.evidence.rows import Term
from rotorid.mismatch.flight.prepare import assemble_rows, prepare_like
from rotorid.mismatch.flight.wrench import block_seconds
from rotorid.plan.plan import Plan
from rotorid.plan.questions import FittedSet, Question, answers, best_of, joined_sets
from rotorid.plan.separation import Separation, asked_terms, expecting
from rotorid.plan.session import KnownInstrument
from rotorid.plan.simulate import ChangedVehicle
from rotorid.recordings import RecordingSet
from rotorid.report.deliver import analysis_of
from rotorid_proof.intervals import wilson

WITHIN = 1.5
"""Factor within which a predicted separation counts as right."""

NOTHING = "nothing"
"""Stands in a question for the model without a suggested effect."""


@dataclass(frozen=True)
class Row:
    """What became of one set."""

    case: str
    truth: str
    open: str
    """Ids that the set left open; empty where it left none."""
    planned_s: float = float("nan")
    predicted_sigma: float = float("nan")
    """Of the true model against its nearest rival, both sets together; NaN where truth is none of the open ids."""
    predicted_low: float = float("nan")
    """Its 95 % interval as the plan states it."""
    predicted_high: float = float("nan")
    measured_sigma: float = float("nan")
    """The same between the two as recorded: √ of the whitened squares that the true one explains more."""
    standard_sigma: float = float("nan")
    """The same with the standard flight in the planned one's place."""
    promised: bool = False
    """Whether the plan said that all would be settled."""
    outcome: str = ""
    """`right`, `wrong`, `open`, or `no plan` where it said that no flight settles this."""
    standard_outcome: str = ""
    """The same with the standard flight in the planned one's place."""
    said: str = ""
    judged_by: str = ""
    """Hash of the code that planned and judged it."""
    kind: str = "flight"
    """Of the set: `flight`, `stand` or `bench`; of the latter two a session is planned in a flight's place."""
    by_hand: str = ""
    """The step by hand that is predicted to separate the class furthest, where one is."""
    by_hand_sigma: float = float("nan")
    """Separation of the true model from its nearest rival that is predicted for the hover after it."""
    by_hand_measured: float = float("nan")
    """The same as recorded."""


def judged(first: RecordingSet, second: RecordingSet, ids: tuple[str, ...], truth: set[str]):
    """Outcome, sentence, and both sets as one, as `rotorid together` judges them."""
    whole, _ = joined_sets(first, second)
    return (*outcome_of(ids, analysis_of(whole).findings, truth), whole)


def classes_in(found: FittedSet | KnownInstrument) -> list[tuple[str, ...]]:
    """Ids of every class that is open; what is only suggested is compared with nothing and is no class."""
    classes = [q.ids for q in found.questions] + [tuple(m.id for m in chains) for chains in found.chains]
    classes += [ids for ids, _ in found.unanswerable]
    return [ids for ids in classes if len(ids) > 1 and NOTHING not in ids]


def outcome_of(ids: tuple[str, ...], findings: tuple[Finding, ...], truth: set[str]) -> tuple[str, str]:
    """`right`, `wrong` (also where something untrue of the class is established too) or `open`, and the sentence."""
    (answer,) = answers([ids], findings)
    if not answer["answer"]:
        return "open", answer["sentence"]
    named = {f.id for f in findings if f.status == "established" and f.id in ids}
    return ("right" if named <= truth else "wrong"), answer["sentence"]


def predicted(plan: Plan, ids: tuple[str, ...], truth: set[str]) -> Separation | None:
    """Separation of the true model from its nearest rival; None where the truth is none of the class."""
    found = [s for own, separations in plan.questions if set(own) == set(ids) for s in separations]
    return next((s for s in found if s.true in truth), None)


def measured(
    first: FittedSet | KnownInstrument, joint: FittedSet | KnownInstrument, question: Question | None, true: str
) -> float:
    """√ of the whitened squares that the true model still explains given its nearest rival, in both sets together.

    This is what the engine asks before it names a class: is the term still needed with the other in its place? Of each
    rival every form of the question as it was asked of the `first` set is tried, with the coefficients that it had
    there (`as_asked`); what as many coefficients explain of noise alone is taken off. NaN where truth is none of the
    models, or is no term of forces and moments (between command and rotor speed).
    """
    if question is None or true not in question.rivals:
        return float("nan")
    search, active = joint.model.search, joint.model.selection.active
    shared = [*search.always, *(k for k in active if search.terms[k].effect not in question.ids)]

    def able(name: str) -> list[tuple[str, ...]]:
        return [keys for keys in question.rivals[name] if all(k in search.terms for k in keys)]

    if not able(true):
        return float("nan")
    regression = as_asked(first.regression, joint.regression)
    own = best_of(regression, shared, able(true), search.terms)
    left = []
    for keys in (keys for name in question.rivals if name != true for keys in able(name)):
        more = [k for k in own if k not in keys]
        if more:
            beside = [*shared, *keys]
            gain = regression.explained([*beside, *more]) - regression.explained(beside)
            left.append(gain - sum(search.terms[k].size for k in more))
    return float(np.sqrt(max(min(left), 0.0))) if left else float("nan")


def as_asked(first: Regression, joint: Regression) -> Regression:
    """The joint regression with the forms of the first set: of a form that has more coefficients in both sets together
    (crosstalk from loads that the first set has not) those of the first alone."""
    asked = {t.key: t for t in first.terms}
    places = {}
    for term in joint.terms:
        if term.key in asked and term.size > asked[term.key].size:
            had = symbols(asked[term.key])
            places[term.key] = np.array([i for i, symbol in enumerate(symbols(term)) if symbol in had], int)
    return joint.narrowed(places)


def symbols(term: Term) -> list[str]:
    """Symbols of the linear parameters of a term, in the order of its columns."""
    return [term.form.parameters[i].symbol for i in term.form.linear]


def measured_after(
    found: FittedSet, question: Question, change: ChangedVehicle, recorded: RecordingSet, true: str
) -> float:
    """√ of the whitened squares that the true model explains given its nearest rival, in a set and a flight after a
    step by hand; `recorded` is that flight. As `measured`, by the linear terms that the class needs alone."""
    joint = recorded_after(found, change, recorded)
    shared = [*(t.key for t in change.nuisances), *question.shared]
    own = next(h.keys for h in question.hypotheses if h.id == true)
    sizes, left = {t.key: t.size for t in joint.terms}, []
    for name, choices in question.rivals.items():
        for keys in choices if name != true else ():
            if more := [k for k in own if k not in keys]:
                gain = joint.explained([*shared, *keys, *more]) - joint.explained([*shared, *keys])
                left.append(gain - sum(sizes[k] for k in more))
    return float(np.sqrt(max(min(left), 0.0))) if left else float("nan")


def recorded_after(known: FittedSet, change: ChangedVehicle, recorded: RecordingSet) -> Regression:
    """Normal equations of a set and of a flight `recorded` after a change by hand, in the terms that a question needs
    and the nuisances of the change; every block of both is fitted."""
    model, terms = known.model, asked_terms(known)
    acting = [*change.nuisances, *(change.term(t) for t in terms)]
    prepared = replace(known.prepared, vehicle=change.vehicle)
    segments = prepare_like(prepared, replace(recorded, vehicle=change.vehicle))[0]
    starts = dict(zip([t.key for t in model.terms], np.cumsum([0, *(t.size for t in model.terms)]), strict=False))
    at = np.concatenate([starts[t.key] + np.arange(t.size) for t in terms])
    extra = sum(t.size for t in change.nuisances)
    share = np.concatenate([np.ones(extra), *(np.full(t.size, change.shares.get(t.key, 1.0)) for t in terms)])
    rows = [replace(r, x=np.pad(r.x[:, :, at], ((0, 0), (0, 0), (extra, 0)))) for r in model.rows]
    rows += [replace(r, x=r.x * share) for r in assemble_rows(prepared, acting, segments, None)]
    rate_hz = prepared.thinner.rate_hz
    filters = expecting(known, []).regression.filters
    return build(rows, acting, filters, lambda run, t: True, block_seconds(rows, rate_hz), rate_hz)


def table(rows: list[Row]) -> pd.DataFrame:
    """The rows as a table."""
    return pd.DataFrame([asdict(r) for r in rows], columns=[f.name for f in fields(Row)])


def summary(rows: pd.DataFrame, what: str = "flight") -> pd.DataFrame:
    """Shares over the sets that were open, with 95 % intervals (Wilson), and how many they are of.

    `what` was planned: a `flight` or a `session`.
    """
    sigmas = ["predicted_sigma", "predicted_low", "predicted_high", "measured_sigma", "standard_sigma"]
    rows = rows.assign(**{name: rows[name].replace("", np.nan).astype(float) for name in sigmas})
    asked = rows[rows["open"].fillna("") != ""]
    planned = asked[asked["outcome"] != "no plan"]
    both = asked.dropna(subset=["predicted_sigma", "measured_sigma"])
    faster = planned.dropna(subset=["measured_sigma", "standard_sigma"])
    ratio = both["measured_sigma"] / both["predicted_sigma"].clip(lower=1e-9)
    inside = both["measured_sigma"].between(both["predicted_low"], both["predicted_high"])
    fast = faster["measured_sigma"] ** 2 >= 2 * faster["standard_sigma"] ** 2
    rank = {"right": 2, "open": 1, "wrong": 0}
    worse = planned["outcome"].map(rank) < planned["standard_outcome"].map(rank)
    counted = (
        ("settled rightly, of all open", asked["outcome"] == "right"),
        ("settled wrongly, of all open", asked["outcome"] == "wrong"),
        (f"settled rightly, where a {what} was planned", planned["outcome"] == "right"),
        (f"settled rightly by a standard {what} as long", planned["standard_outcome"] == "right"),
        (f"settled wrongly by a standard {what} as long", planned["standard_outcome"] == "wrong"),
        (f"prediction within a factor of {WITHIN:g}", (ratio < WITHIN) & (ratio > 1 / WITHIN)),
        ("measured within the interval stated", inside),
        ("planned at least twice as fast (squares a second)", fast),
        (f"separated further than by a standard {what} as long", faster["measured_sigma"] > faster["standard_sigma"]),
        (f"outcome no worse than of a standard {what} as long", ~worse),
    )
    out = []
    for name, hits in counted:
        count, of = int(hits.sum()), len(hits)
        low, high = wilson(count, of)
        share = count / of if of else float("nan")
        out.append({"what": name, "count": count, "of": of, "share": share, "low": low, "high": high})
    return pd.DataFrame(out)
