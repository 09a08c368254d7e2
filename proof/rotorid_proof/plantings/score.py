"""A verdict on a planted set against the one on the flight untouched: what was reported, its size, what is new or
lost."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from scipy.stats import norm

from rotorid_proof.intervals import Z95
from rotorid_proof.plantings.kinds import Ratio, Size, Truth
from rotorid_proof.score import CLAIMED

ALONE, IN_CLASS, NOT_NAMED, UNSEEN = "alone", "in a fair class", "not named", "cannot be seen"
MOVED = 0.5
"""A cause that the untouched flight states too counts as named where the statement moves by this share of what was
planted."""


def classes(verdict: Mapping[str, Any]) -> list[frozenset[str]]:
    """Claims of a verdict (established or ambiguous), each as its class of ids."""
    found = []
    for effect in verdict.get("effects", ()):
        if effect["status"] in CLAIMED:
            others = effect["alternatives"] if effect["status"] == "ambiguous" else ()
            found.append(frozenset({effect["id"], *others}))
    return list(dict.fromkeys(found))


def estimates(verdict: Mapping[str, Any], effect_id: str) -> dict[str, tuple[float, float, float]]:
    """Symbol to value and interval of an effect that a verdict claims; empty where it does not."""
    out = {}
    for effect in verdict.get("effects", ()):
        if effect["status"] in CLAIMED and effect["id"] == effect_id:
            for p in effect["parameters"]:
                low, high = p["interval_95"] or (None, None)
                if p["value"] is not None and low is not None and high is not None:
                    out.setdefault(p["symbol"], (p["value"], low, high))
    return out


def log_ratio(verdict: Mapping[str, Any], ratio: Ratio) -> tuple[float, float]:
    """Σ exponent · log(refitted / believed) over the values that a verdict states, and half its 95 % interval."""
    total, variance = 0.0, 0.0
    for name, exponent in ratio.exponents.items():
        p = verdict.get("parameters", {}).get(name)
        if not p or not p["believed"] or not p["refitted"] or p["refitted"] <= 0:
            continue
        total += exponent * math.log(p["refitted"] / p["believed"])
        low, high = p["interval_95"] or (None, None)
        if low is not None and high is not None:
            variance += (exponent * (high - low) / 2 / p["refitted"]) ** 2
    return total, math.sqrt(variance)


def score_truth(verdict: Mapping[str, Any], untouched: Mapping[str, Any], truth: Truth) -> dict[str, Any]:
    """How one planted cause was reported: `named`, `covered` (None where no size can be compared), and the first
    size."""
    unseen = truth.unseen
    before = set().union(*classes(untouched)) if classes(untouched) else set()
    if not unseen and truth.shown_by and not truth.shown_by & before:
        unseen = f"the untouched flight shows none of {', '.join(sorted(truth.shown_by))}"
    if not unseen and (beside := truth.hidden_by & before):
        unseen = f"the untouched flight shows {', '.join(sorted(beside))}, which make up for it"
    row: dict[str, Any] = {"named": NOT_NAMED, "unseen": unseen, "symbol": "", "true": None, "estimate": None}
    row |= {"low_95": None, "high_95": None, "covered": None}
    named = _named(verdict, untouched, truth)
    row["named"] = UNSEEN if unseen else named
    if unseen or named == NOT_NAMED:
        return row
    if truth.ratio is not None:
        return row | _ratio_size(verdict, untouched, truth.ratio)
    if truth.first_only & before:
        return row
    return row | _effect_size(verdict, untouched, truth)


def _named(verdict: Mapping[str, Any], untouched: Mapping[str, Any], truth: Truth) -> str:
    if truth.ratio is not None:
        # Silence on a value that the untouched flight calls wrong counts, too: what was planted corrects it.
        stated = set(verdict.get("parameters", {})) | set(untouched.get("parameters", {}))
        if not stated & (truth.names | truth.fair):
            return NOT_NAMED
        moved = log_ratio(verdict, truth.ratio)[0] - log_ratio(untouched, truth.ratio)[0]
        if moved / truth.ratio.value < MOVED:
            return NOT_NAMED
        return ALONE if stated & truth.names else IN_CLASS
    found = [c for c in classes(verdict) if c & truth.names]
    fair = [c for c in found if c <= truth.names | truth.fair]
    if not fair:
        return NOT_NAMED
    if any(c & truth.names for c in classes(untouched)) and not _moved(verdict, untouched, truth):
        return NOT_NAMED
    return ALONE if any(c <= truth.names for c in fair) else IN_CLASS


def _moved(verdict: Mapping[str, Any], untouched: Mapping[str, Any], truth: Truth) -> bool:
    """Whether what both verdicts state differs by the planted size, or is stated in another form or a second time."""
    for sizes in truth.sizes:
        pairs = [
            (estimates(verdict, s.effect).get(s.symbol), estimates(untouched, s.effect).get(s.symbol), s.value)
            for s in sizes
        ]
        if all(now and then for now, then, _ in pairs):
            along = sum((now[0] - then[0]) * value for now, then, value in pairs)
            return along / sum(value**2 for *_, value in pairs) >= MOVED
    ids = truth.names
    count = [sum(e["status"] in CLAIMED and e["id"] in ids for e in v.get("effects", ())) for v in (verdict, untouched)]
    return count[0] > count[1] or any(
        set(estimates(verdict, i)) != set(estimates(untouched, i)) for i in ids if estimates(verdict, i)
    )


def _ratio_size(verdict, untouched, ratio: Ratio) -> dict[str, Any]:
    value, half = log_ratio(verdict, ratio)
    true = ratio.value + log_ratio(untouched, ratio)[0]
    return {
        "symbol": "log of the ratio shown",
        "true": true,
        "estimate": value,
        "low_95": value - half,
        "high_95": value + half,
        "covered": bool(abs(value - true) <= half) if half > 0 else None,
    }


def _effect_size(verdict, untouched, truth: Truth) -> dict[str, Any]:
    for sizes in truth.sizes:
        found = [estimates(verdict, s.effect).get(s.symbol) for s in sizes]
        if not all(found):
            continue
        rows = [
            _compared(s, f, estimates(untouched, s.effect).get(s.symbol)) for s, f in zip(sizes, found, strict=True)
        ]
        main = max(range(len(sizes)), key=lambda k: abs(sizes[k].value))
        # All must cover at once: Bonferroni's intervals of several parameters.
        widened = float(norm.ppf(1.0 - 0.025 / len(rows))) / Z95
        covered = all(abs(r["estimate"] - r["true"]) <= widened * (r["high_95"] - r["low_95"]) / 2 for r in rows)
        return {**rows[main], "covered": covered}
    claimed = any(estimates(verdict, i) for i in truth.names)
    return {"covered": False} if truth.form_bound and claimed else {}


def _compared(size: Size, found: tuple[float, float, float], then: tuple[float, float, float] | None) -> dict[str, Any]:
    true = size.value + (then[0] if then and size.added else 0.0)
    value, low, high = found
    if not size.added:
        # A length of time, or a rate, whose sign says which of two clocks is called late.
        true, value, (low, high) = abs(true), abs(value), sorted((abs(low), abs(high)))
    return {"symbol": size.symbol, "true": true, "estimate": value, "low_95": low, "high_95": high}


def beside(
    verdict: Mapping[str, Any], untouched: Mapping[str, Any], truths: Sequence[Truth]
) -> dict[str, tuple[str, ...]]:
    """What differs from the untouched verdict but for the planted causes: ids and values that are new, or lost."""
    planted = set().union(*(t.names | t.fair for t in truths))
    now, then = classes(verdict), classes(untouched)
    members_now, members_then = (set().union(*c) if c else set() for c in (now, then))
    values_now, values_then = set(verdict.get("parameters", {})), set(untouched.get("parameters", {}))
    return {
        "new": tuple(sorted(" or ".join(sorted(c)) for c in now if not c & (planted | members_then))),
        "lost": tuple(sorted(" or ".join(sorted(c)) for c in then if not c & members_now)),
        "values_new": tuple(sorted(values_now - values_then - planted)),
        "values_lost": tuple(sorted(values_then - values_now - planted)),
    }
