"""The proof of the next flight: an open question, the flight planned for it, and what both sets together say.

A row is one concealed set that the engine left open, or that holds a pair of confusers flown so that little tells them
apart. The plan knows the set alone; the simulator that made it records the planned flight, and as a yardstick a
standard flight of the same length; both sets are judged together by the engine.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields

import numpy as np
import pandas as pd

from rotorid.experiment.plan import Plan
from rotorid.experiment.questions import Known, best_of
from rotorid.experiment.together import answers
from rotorid.mismatch.findings import Finding
from rotorid.proof.intervals import wilson

WITHIN = 1.5
"""Factor within which a predicted separation counts as right."""


@dataclass(frozen=True)
class Row:
    """What became of one set."""

    case: str
    truth: str
    open: str
    """Ids that the set left open; empty where it left none."""
    planned_s: float
    predicted_sigma: float
    """Of the true model against its nearest rival, both sets together; NaN where truth is none of the open ids."""
    measured_sigma: float
    """The same between the two as recorded."""
    promised: bool
    """Whether the plan said that all would be settled."""
    outcome: str
    """`right`, `wrong`, `open`, or `no plan` where it said that no flight settles this."""
    standard_outcome: str
    """The same with the standard flight in the planned one's place."""
    said: str


def outcome_of(ids: tuple[str, ...], findings: tuple[Finding, ...], truth: set[str]) -> tuple[str, str]:
    """`right`, `wrong` or `open`, and the sentence."""
    (answer,) = answers([ids], findings)
    if not answer.answer:
        return "open", answer.sentence
    return ("right" if answer.answer in truth else "wrong"), answer.sentence


def predicted(plan: Plan, ids: tuple[str, ...], truth: set[str]) -> tuple[float, str, str]:
    """Separation of the true model from its nearest rival, and the two ids."""
    for own, found in plan.questions:
        if set(own) == set(ids):
            for s in found:
                if s.true in truth:
                    return s.sigma, s.true, s.rival
    return float("nan"), "", ""


def measured(joint: Known, true: str, rival: str) -> float:
    """√ of the whitened squares that the true model explains more than its rival in both sets together."""
    search, active = joint.fitted.model.search, joint.fitted.model.selection.active
    shared = [*search.always, *(k for k in active if search.terms[k].effect not in (true, rival))]
    explained = []
    for name in (true, rival):
        choices = [(t.key,) for t in search.terms.values() if t.effect == name and not t.run]
        if not choices:
            return float("nan")
        best = best_of(joint.regression, shared, choices, search.terms)
        explained.append(joint.regression.explained([*shared, *best]))
    return float(np.sqrt(max(explained[0] - explained[1], 0.0)))


def table(rows: list[Row]) -> pd.DataFrame:
    """The rows as a table."""
    return pd.DataFrame([asdict(r) for r in rows], columns=[f.name for f in fields(Row)])


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """Shares over the sets that were open, with 95 % intervals (Wilson), and how many they are of."""
    asked = rows[rows["open"].fillna("") != ""]
    planned = asked[asked["outcome"] != "no plan"]
    both = asked.dropna(subset=["predicted_sigma", "measured_sigma"])
    ratio = both["measured_sigma"] / both["predicted_sigma"].clip(lower=1e-9)
    counted = (
        ("settled rightly, of all open", asked["outcome"] == "right"),
        ("settled wrongly, of all open", asked["outcome"] == "wrong"),
        ("settled rightly, where a flight was planned", planned["outcome"] == "right"),
        ("settled rightly by a standard flight as long", planned["standard_outcome"] == "right"),
        ("settled wrongly by a standard flight as long", planned["standard_outcome"] == "wrong"),
        (f"prediction within a factor of {WITHIN:g}", (ratio < WITHIN) & (ratio > 1 / WITHIN)),
    )
    out = []
    for name, hits in counted:
        count, of = int(hits.sum()), len(hits)
        low, high = wilson(count, of)
        share = count / of if of else float("nan")
        out.append({"what": name, "count": count, "of": of, "share": share, "low": low, "high": high})
    return pd.DataFrame(out)
