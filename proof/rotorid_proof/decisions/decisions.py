"""Decisions: what is said of a set by the evidence that is kept of it.

A decision takes what is kept and gives effects and values as `verdict.json` states them, so that the rules that score
verdicts score it. Each effect may carry a `probability`, that one of its class is at work.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.decide.posterior import Found, decide, ranked
from rotorid.mismatch.decide.problem import Prior
from rotorid.mismatch.decide.statements import Statement, statements_of
from rotorid.mismatch.decide.status import CLAIMED
from rotorid_proof.decisions.store import Kept

MOST_RANKED, MOST_STARTS = 200, 4
"""True models that are ranked, and from which an ideal observer starts, at most."""
Said = Mapping[str, Any]
"""`effects`, `parameters` and `verdict` of a verdict, or `{"failed": reason}`."""
Decision = Callable[[Kept], Said]
NOTHING, SOMETHING = "no_mismatch", "explained"
"""Word of a decision that has none of its own, by whether it states anything."""
PROBABILITY_OF = {"established": 0.99, "ambiguous": 0.99, "suggested": 0.5}
"""What the contract's statuses promise, for a decision that states no probability."""


def engine(kept: Kept) -> Said:
    """The verdict as the engine delivers it."""
    return kept.verdict


def selection(kept: Kept) -> Said:
    """What the engine selects from the fitted runs, before its rules for words lower it."""
    if kept.selection is None:
        return kept.verdict
    return said(kept.selection["effects"], kept.selection["parameters"])


def posterior(kept: Kept) -> Said:
    """Effects of force, moment and sensors by the posterior; the rest, and values, by the engine's selection."""
    return kept.verdict if kept.evidence is None else stated(kept, decide(kept.evidence, Prior(), kept.evidence.active))


def ideal_observer(kept: Kept, answer: Mapping[str, Any]) -> Said:
    """The posterior that also starts at the truth: what it does not name, no search for its best model can.

    Wrong believed values and what has no column are the engine's. Columns are linearised where the engine's search
    ended, not at the truth.
    """
    if kept.evidence is None:
        return kept.verdict
    found = decide(kept.evidence, Prior(), kept.evidence.active)
    truth = {effect["id"] for effect in answer["effects"]}
    return stated(kept, decide(kept.evidence, Prior(), kept.evidence.active, *starts(found, truth)))


def starts(found: Found, truth: Iterable[str]) -> list[tuple[str, ...]]:
    """Models of the ids that are true, each in one of its forms; the most probable first."""
    terms = found.problem.terms
    forms = [[key for key, t in terms.items() if t.kind == "effect" and t.effect == one] for one in sorted(truth)]
    every = itertools.islice(itertools.product(*(own for own in forms if own)), MOST_RANKED)
    models = [tuple(sorted(model)) for model in every]
    values = ranked(found.problem, models)
    return [models[k] for k in sorted(range(len(models)), key=lambda k: -values[k])[:MOST_STARTS]]


def stated(kept: Kept, found: Found) -> Said:
    """What a posterior states, next to what it does not decide."""
    # What is unlikely, or too small to matter, is not stated.
    likely = [s for s in statements_of(found) if s.status != "not_established"]
    effects = [as_effect(s, kept.selection["commanded"]) for s in likely]
    return said([*kept.selection["outside"], *effects], kept.selection["parameters"])


DECISIONS: Mapping[str, Decision] = {"engine": engine, "selection": selection, "posterior": posterior}


def said(effects: Iterable[Mapping[str, Any]], values: Mapping[str, Any]) -> Said:
    """Effects and values with a word."""
    stated = list(effects)
    claims = bool(values) or any(e["status"] in CLAIMED for e in stated)
    return {"effects": stated, "parameters": dict(values), "verdict": SOMETHING if claims else NOTHING}


def as_effect(statement: Statement, commanded: bool) -> dict[str, Any]:
    """A statement as `verdict.json` has it.

    Where rotor speeds are known from `commanded` ones alone, some ids have the very columns of another.
    """
    status, members = statement.status, set(statement.alternatives)
    same = catalogue()[statement.id].same_on_commands if statement.id in catalogue() else ""
    if commanded and same and status in CLAIMED:
        status, members = "ambiguous", members | {statement.id, same}
    return {
        "id": statement.id,
        "status": status,
        "alternatives": sorted(members),
        "probability": statement.probability,
        "p_value": float(np.exp(-max(statement.odds, 0.0))),
        "parameters": [
            {"symbol": p.symbol, "value": p.value, "unit": p.unit, "interval_95": [p.low, p.high]}
            for p in statement.parameters
        ],
    }
