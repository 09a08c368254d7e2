"""From the scores of all cases to the tables of the proof: targets, confusion, power, parameters, peers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rotorid_proof.intervals import bootstrap_mean, bootstrap_ratio, wilson
from rotorid_proof.score import kind_and_rest

if TYPE_CHECKING:
    import pandas as pd

Score = Mapping[str, Any]
NOTHING, OTHER_VALUE, AMBIGUOUS = "nothing", "a value", "several"
MIXED = ("mixture",)
WELL_SIZED = ("moderate", "strong")
ORACLE_MARGIN = 1.05


def strength(score: Score) -> str:
    """`strong`, `moderate`, `weak` of a single effect; empty otherwise."""
    parts = kind_and_rest(score["case"])[1].split("/")
    return parts[2] if score["family"] == "single" else ""


def family(score: Score) -> str:
    """Family of a case, of an instrument with its kind: `clean`, `stand clean`."""
    return score["family"] if score["kind"] == "flight" else f"{score['kind']} {score['family']}"


def _is_clean(s: Score) -> bool:
    return s["family"] == "clean" or s["case"].startswith("rotorpy/clean/")


def _is_wrong(s: Score) -> bool:
    return s["family"] == "wrong" or s["case"].startswith("rotorpy/wrong")


def _is_moderate(s: Score) -> bool:
    return strength(s) == "moderate" and s["separable"]


def _is_well_sized(s: Score) -> bool:
    return strength(s) in WELL_SIZED or s["family"] in ("confusable", "part")


def rate(scores: Iterable[Score], hit: Callable[[Score], bool | None]) -> dict[str, Any]:
    """Share of cases that hit (None: not counted), with Wilson's interval and who judged them."""
    counted = [(s, bool(h)) for s, h in ((s, hit(s)) for s in scores) if h is not None]
    return share([h for _, h in counted]) | provenance([s for s, _ in counted])


def share(hits: Sequence[bool]) -> dict[str, Any]:
    """Share of hits, with Wilson's interval."""
    low, high = wilson(sum(hits), len(hits))
    return {"value": sum(hits) / len(hits) if hits else None, "low_95": low, "high_95": high, "cases": len(hits)}


def provenance(scores: Iterable[Score]) -> dict[str, Any]:
    """`judged_by`: hash of the code that judged these cases (all hashes, if several; "unknown" if none was kept);
    `looked_at`: how many of them are development cases, which were or may have been looked at while mending."""
    scores = list(scores)
    codes = sorted({s.get("judged_by") or "unknown" for s in scores})
    return {"judged_by": " ".join(codes), "looked_at": sum(not s.get("released") for s in scores)}


def mean(scores: Sequence[Score], value_of: Callable[[Score], float | None]) -> dict[str, Any]:
    """Mean with its interval over the cases that have a value."""
    known = [(s, v) for s, v in ((s, value_of(s)) for s in scores) if v is not None and math.isfinite(v)]
    values = [v for _, v in known]
    low, high = bootstrap_mean(values)
    found = {"value": float(np.mean(values)) if values else None, "low_95": low, "high_95": high, "cases": len(values)}
    return found | provenance([s for s, _ in known])


def false_discoveries(scores: Sequence[Score]) -> dict[str, Any]:
    """False claims over all claims."""
    scores = list(scores)
    claims, false = sum(s["claim_count"] for s in scores), sum(s["false_count"] for s in scores)
    low, high = bootstrap_ratio([s["false_count"] for s in scores], [s["claim_count"] for s in scores])
    if false in (0, claims):  # cases drawn again would give this one value only
        low, high = wilson(false, claims)
    value = false / claims if claims else (0.0 if scores else None)
    return {"value": value, "low_95": low, "high_95": high, "cases": len(scores), **provenance(scores)}


def coverage(scores: Sequence[Score], physics: bool | None = None) -> dict[str, Any]:
    """Share of 95 % intervals that hold the true value; of effects' parameters, of believed values, or of both."""
    held = [
        p["covered"]
        for s in scores
        for p in s["parameters"]
        if p["covered"] is not None and (physics is None or bool(p["effect"]) == physics)
    ]
    return share(held) | provenance([s for s in scores if s["parameters"]])


def oracle_excess(scores: Sequence[Score]) -> dict[str, Any]:
    """Median of the held-out error after over the true model's; its interval by drawing cases."""
    known = [s for s in scores if s["held_out_after"] is not None]
    ratios = np.array([s["held_out_after"] for s in known])
    if not len(ratios):
        return {"value": None, "low_95": math.nan, "high_95": math.nan, "cases": 0, **provenance(known)}
    picks = np.random.default_rng(1).integers(len(ratios), size=(2000, len(ratios)))
    low, high = np.percentile(np.median(ratios[picks], axis=1), [2.5, 97.5])
    return {
        "value": float(np.median(ratios)),
        "low_95": float(low),
        "high_95": float(high),
        "cases": len(ratios),
    } | provenance(known)


GROUND_ROWS = (
    "single_named",
    "inside_class",
    "mixture_whole",
    "mixture_false",
    "clean_alarms",
    "wrong_physics",
    "coverage",
    "oracle",
    "single_strong",
    "single_weak",
    "wrong_found",
    "failed",
)
"""Rows that stands and benches have as flights do."""
KINDS = ("flight", "stand", "bench")


def summary(scores: Sequence[Score]) -> list[dict[str, Any]]:
    """The table of targets: one row each with what was measured, its interval, the target and whether it holds.

    Flights first; then, where there are any, the rows that stands and benches share with them; then those of cases
    that are drawn whole from a seed, which count nowhere else.
    """
    listed = [s for s in scores if (s["kind"], s["family"]) not in SIMULATORS]
    rows = rows_of([s for s in listed if s["kind"] == "flight"])
    for kind in KINDS[1:]:
        own = [s for s in listed if s["kind"] == kind]
        if own:
            picked = [row for row in rows_of(own) if row["id"] in GROUND_ROWS]
            rows += [
                {**row, "id": f"{kind}_{row['id']}", "what": f"{kind.capitalize()}: {lower(row['what'])}"}
                for row in picked
            ]
    return rows + drawn_rows(scores)


def lower(text: str) -> str:
    """The first letter small, for a text that follows a colon."""
    return text[:1].lower() + text[1:]


def rows_of(scores: Sequence[Score]) -> list[dict[str, Any]]:
    """The rows of one kind."""
    clean = [s for s in scores if _is_clean(s)]
    wrong = [s for s in scores if _is_wrong(s)]
    moderate = [s for s in scores if _is_moderate(s)]
    mixed = [s for s in scores if s["family"] in MIXED]
    outside = [s for s in scores if s["family"] == "outside"]
    partial = [s for s in scores if s["family"] == "part"]
    confusable = [s for s in scores if s["family"] == "confusable"]
    sized = [s for s in scores if _is_well_sized(s)]
    fitted = [s for s in scores if strength(s) in WELL_SIZED and s["separable"]]
    rows = [
        ("single_named", "Single effects, moderate, separable: right one named", 0.95, None, rate(moderate, _named)),
        ("inside_class", "Truth inside the reported class", 0.98, None, rate(sized, lambda s: s["inside"])),
        ("mixture_whole", "Mixtures: whole set right", 0.80, None, rate(mixed, lambda s: s["whole_set"])),
        ("mixture_false", "Mixtures: false discoveries", None, 0.05, false_discoveries(mixed)),
        ("clean_alarms", "Clean recordings: false alarms", None, 0.01, rate(clean, lambda s: s["false_alarm"])),
        ("wrong_physics", "Wrong values only: physics claimed", None, 0.02, rate(wrong, lambda s: bool(s["claims"]))),
        ("coverage", "95 % intervals that cover", 0.92, 0.98, coverage(_fitting(scores))),
        ("location_f1", "Location F1 (time), effects in part of the flight", 0.85, None, mean(partial, _f1)),
        ("oracle", "Held-out error after over the oracle's (median)", None, ORACLE_MARGIN, oracle_excess(fitted)),
        (
            "outside_unnamed",
            "Causes outside the catalogue not given a wrong name",
            0.90,
            None,
            rate(outside, lambda s: not s["failed"] and not s["false_count"]),
        ),
        ("single_strong", "Single effects, strong: right one named", None, None, rate(_of(scores, "strong"), _named)),
        ("single_weak", "Single effects, weak: right one named", None, None, rate(_of(scores, "weak"), _named)),
        (
            "top_one",
            "Single effects, moderate: strongest claim right",
            None,
            None,
            rate(moderate, lambda s: s["top_one"]),
        ),
        ("whole_single", "Single effects, moderate: whole set right", None, None, rate(moderate, _whole)),
        (
            "blade_inside",
            "Blade-element rotors: truth inside the class",
            None,
            None,
            rate(_family(scores, "blade"), _in),
        ),
        (
            "rotorpy_named",
            "Flown by RotorPy: whole set right",
            None,
            None,
            rate([s for s in _family(scores, "rotorpy") if s["truth"]], _whole),
        ),
        ("mistakes", "Mistakes in the set: recognised", None, None, rate(_family(scores, "mistake"), _whole)),
        (
            "wrong_found",
            "Wrong values only: the wrong one reported",
            None,
            None,
            rate(wrong, lambda s: s["values_right"]),
        ),
        (
            "outside_recognised",
            "Causes outside the catalogue: said to be unexplained",
            None,
            None,
            rate(outside, lambda s: s["word_right"]),
        ),
        (
            "ambiguity_stated",
            "Ambiguity stated where it is there",
            None,
            None,
            rate([s for s in confusable if s["ambiguity_there"]], lambda s: s["ambiguity_right"]),
        ),
        (
            "ambiguity_not_stated",
            "No ambiguity stated where there is none",
            None,
            None,
            rate([s for s in (*confusable, *moderate) if not s["ambiguity_there"]], lambda s: s["ambiguity_right"]),
        ),
        ("coverage_physics", "95 % intervals that cover: effects", None, None, coverage(_fitting(scores), True)),
        (
            "coverage_values",
            "95 % intervals that cover: wrong values",
            None,
            None,
            coverage(_fitting(scores), False),
        ),
        (
            "oracle_within",
            "Held-out error after within 5 % of the oracle's",
            None,
            None,
            rate([s for s in fitted if s["held_out_after"]], lambda s: s["held_out_after"] <= ORACLE_MARGIN),
        ),
        ("regime", "Location: stated regime is the effect's", None, None, rate(fitted, lambda s: s["regime_right"])),
        ("failed", "Sets on which the stage stopped", None, 0.0, rate(scores, lambda s: s["failed"])),
    ]
    return [finished(*row) for row in rows]


def finished(key: str, what: str, low: float | None, high: float | None, found: Mapping[str, Any]) -> dict[str, Any]:
    """A row of the summary: what was found, next to its target and whether that holds."""
    word = holds(found["value"], low, high, found["low_95"], found["high_95"])
    return {"id": key, "what": what, "at_least": low, "at_most": high, **found, "holds": word}


HOLDS, OPEN, FAILS = "holds", "not refuted", "fails"


def holds(
    value: float | None,
    at_least: float | None,
    at_most: float | None,
    low_95: float = math.nan,
    high_95: float = math.nan,
) -> str | None:
    """`holds` if the whole interval is inside the target, `fails` if all of it is outside, else `not refuted`.

    Without an interval the value decides; None without a value or a target.
    """
    if value is None or (at_least is None and at_most is None):
        return None
    low, high = (x if x is not None and math.isfinite(x) else value for x in (low_95, high_95))
    if (at_least is None or low >= at_least) and (at_most is None or high <= at_most):
        return HOLDS
    if (at_least is not None and high < at_least) or (at_most is not None and low > at_most):
        return FAILS
    return OPEN


SIMULATORS = {
    ("flight", "multibody"): "Drawn flights, multibody engine",
    ("flight", "continuous"): "Drawn flights, differential equations",
    ("flight", "feedback"): "Drawn flights in gusts, commands alone",
    ("stand", "rig"): "Drawn stands",
    ("bench", "rig"): "Drawn benches",
}
"""Kind and family of cases that are drawn whole from one seed, and what their own rows call them."""
MOST_ALARMS, MOST_WRONG = 0.01, 0.05
"""Targets of drawn cases: share of clean sets that raise an alarm, share of names that are wrong."""


def row_prefix(kind: str, name: str) -> str:
    """How the ids of a simulator's rows begin: `multibody`, `stand_rig`."""
    return name if kind == "flight" else f"{kind}_{name}"


def drawn_rows(scores: Sequence[Score]) -> list[dict[str, Any]]:
    """Rows of the simulators whose cases are drawn, for development and for each release's date by themselves."""
    rows = []
    for (kind, name), what in SIMULATORS.items():
        own = [s for s in scores if (s["kind"], s["family"]) == (kind, name)]
        for date in sorted({s["released"] for s in own}):
            part = [s for s in own if s["released"] == date]
            clean = [s for s in part if s["clean"]]
            hidden = [s for s in part if not s["clean"]]
            when = f"released {date}" if date else "development"
            key = "_".join(x for x in (row_prefix(kind, name), date) if x)
            rows += [
                finished(
                    f"{key}_clean_alarms", f"{what}, {when}: false alarms", None, MOST_ALARMS, rate(clean, _alarmed)
                ),
                finished(f"{key}_right", f"{what}, {when}: all that is hidden right", None, None, rate(hidden, _right)),
                finished(
                    f"{key}_false", f"{what}, {when}: false discoveries", None, MOST_WRONG, false_discoveries(part)
                ),
            ]
    at_rates = _family(scores, "rate")
    if at_rates:
        what = "Clean flights at 25, 50, 100 and 1000 Hz: false alarms"
        rows.append(finished("rate_alarms", what, None, MOST_ALARMS, rate(at_rates, _alarmed)))
    return rows


def drawn_families(scores: Sequence[Score]) -> list[dict[str, Any]]:
    """One row a family of drawn cases and a date: how many are right, what was wrongly said or missed, by count."""
    groups: dict[tuple[str, str, str], list[Score]] = {}
    for s in scores:
        if (s["kind"], s["family"]) in SIMULATORS:
            rest = kind_and_rest(s["case"])[1]
            simulator = SIMULATORS[s["kind"], s["family"]]
            groups.setdefault((simulator, rest.split("/")[1], s["released"]), []).append(s)
    return [
        {
            "simulator": simulator,
            "family": family_,
            "released": date,
            "cases": len(own),
            "right": sum(s["right"] for s in own),
            "false_alarms": sum(s["false_alarm"] for s in own if s["clean"]),
            "wrong_names": counted(name for s in own for name in s["false_names"]),
            "missed": counted(name for s in own for name in s["missed"]),
            **provenance(own),
        }
        for (simulator, family_, date), own in sorted(groups.items())
    ]


def counted(names: Iterable[str]) -> str:
    """Names with how often each occurs, the most frequent first: `gust 3, delay 1`."""
    counts: dict[str, int] = {}
    for name in names:
        counts[name] = counts.get(name, 0) + 1
    return ", ".join(f"{n} {k}" for n, k in sorted(counts.items(), key=lambda item: (-item[1], item[0])))


def _alarmed(s: Score) -> bool:
    return s["false_alarm"]


def _right(s: Score) -> bool:
    return s["right"]


def _f1(s: Score) -> float | None:
    return s["location"]["f1"] if s["location"] else None


def _named(s: Score) -> bool:
    return s["named"]


def _whole(s: Score) -> bool:
    return s["whole_set"]


def _in(s: Score) -> bool:
    return s["inside"]


def _family(scores: Sequence[Score], name: str) -> list[Score]:
    return [s for s in scores if s["family"] == name]


def _of(scores: Sequence[Score], size: str) -> list[Score]:
    return [s for s in scores if strength(s) == size and s["separable"]]


def _fitting(scores: Sequence[Score]) -> list[Score]:
    """Cases whose parameters are numbers that an interval can be held against."""
    families = ("single", "mixture", "wrong", "part", "confusable", "rotorpy")
    return [s for s in scores if s["family"] in families]


def confusion(scores: Sequence[Score]) -> list[dict[str, Any]]:
    """What is said of single effects of moderate and strong size, and of none: kind, truth, claimed, share, cases.

    One case adds one in all: to its strongest claim's id if that claim holds the truth, or else spread to what was
    claimed. Without a claim it counts as `nothing` or, where only a value was called wrong, as `a value`.
    """
    counts: dict[tuple[str, str], dict[str, int]] = {}
    for s in scores:
        if strength(s) in WELL_SIZED:
            truth = s["primary"]
        elif _is_clean(s):
            truth = NOTHING
        elif _is_wrong(s):
            truth = OTHER_VALUE
        else:
            continue
        said = said_of(s)
        row = counts.setdefault((s["kind"], truth), {})
        row[said] = row.get(said, 0) + 1
    return [
        {"kind": kind, "truth": truth, "claimed": said, "share": n / sum(row.values()), "cases": sum(row.values())}
        for (kind, truth), row in sorted(counts.items())
        for said, n in sorted(row.items())
    ]


def said_of(score: Score) -> str:
    """The one word for what a verdict says: its strongest claim, or the truth where a claim names it sharply."""
    if not score["claims"]:
        return OTHER_VALUE if score["values_claimed"] else NOTHING
    if score["named"]:
        return score["primary"]
    first = score["claims"][0]
    return AMBIGUOUS if len(first) > 1 else first[0]


def power(scores: Sequence[Score]) -> list[dict[str, Any]]:
    """`effect`, `size_over_noise`, `detected` with its interval: cases of growing size; `all` pools the effects."""
    points: dict[tuple[str, float], list[bool]] = {}
    for s in _family(scores, "power"):
        _, effect, size, _ = s["case"].split("/")
        for name in (effect, "all"):
            points.setdefault((name, float(size)), []).append(s["inside"])
    return [
        {"effect": effect, "size_over_noise": size, **_plain(share(hits))}
        for (effect, size), hits in sorted(points.items())
    ]


def _plain(found: Mapping[str, Any]) -> dict[str, Any]:
    return {"detected": found["value"], "low_95": found["low_95"], "high_95": found["high_95"], "cases": found["cases"]}


def by_effect(scores: Sequence[Score]) -> list[dict[str, Any]]:
    """One row a single effect: how often it was named at each size, and what was said instead."""
    out = []
    singles = _family(scores, "single")
    for kind, effect in sorted({(s["kind"], s["primary"]) for s in singles}):
        own = [s for s in singles if (s["kind"], s["primary"]) == (kind, effect)]
        row: dict[str, Any] = {"kind": kind, "effect": effect}
        for size in ("strong", "moderate", "weak"):
            found = [s["named"] for s in own if strength(s) == size]
            row[size] = f"{sum(found)}/{len(found)}"
        misses = [said_of(s) for s in own if strength(s) in WELL_SIZED and not s["named"]]
        row["instead"] = ", ".join(sorted(set(misses)))
        out.append(row)
    return out


def parameter_rows(scores: Sequence[Score]) -> list[dict[str, Any]]:
    """Every compared parameter of every case."""
    return [{"case": s["case"], **p} for s in scores for p in s["parameters"]]


def case_rows(scores: Sequence[Score]) -> list[dict[str, Any]]:
    """One row a case, lists as text."""
    out = []
    for s in scores:
        row: dict[str, Any] = {}
        for key, value in s.items():
            if key in ("parameters",):
                continue
            if key == "location":
                row["location_f1"] = value["f1"] if value else None
            elif key == "claims":
                row[key] = "; ".join(" or ".join(members) for members in value)
            elif isinstance(value, (list, tuple)):
                row[key] = "; ".join(map(str, value))
            else:
                row[key] = value
        out.append(row)
    return out


def scores_from(cases: pd.DataFrame, parameters: pd.DataFrame) -> list[dict[str, Any]]:
    """The scores behind stored rows of `case_rows` and `parameter_rows`, for the functions above to count anew."""
    known = parameters.astype(object).where(parameters.notna(), None)
    by_case: dict[str, list[dict[str, Any]]] = {}
    for row in known.to_dict("records"):
        by_case.setdefault(row["case"], []).append(row)
    out = []
    for row in cases.astype(object).where(cases.notna(), None).to_dict("records"):
        f1 = row.pop("location_f1")
        out.append(
            row
            | {name: row[name] or "" for name in ("truth", "claims", "false_names", "missed", "released")}
            | {"location": None if f1 is None else {"f1": f1}, "parameters": by_case.get(row["case"], [])}
        )
    return out


PEER_COLUMNS = (
    "single_named",
    "inside_class",
    "mixture_whole",
    "mixture_false",
    "clean_alarms",
    "wrong_physics",
    "outside_unnamed",
    "oracle",
)


def peer_rows(by_method: Mapping[str, Sequence[Score]]) -> list[dict[str, Any]]:
    """One row a method with the same scores as ours, on the sets that all of them saw."""
    out = []
    for method, scores in by_method.items():
        found = {row["id"]: row for row in summary(scores)}
        out.append({"method": method, "cases": len(scores), **{key: found[key]["value"] for key in PEER_COLUMNS}})
    return out


def better_than_all(rows: Sequence[Mapping[str, Any]], ours: str) -> bool | None:
    """Whether our joint score beats every peer's: named and whole sets, less false alarms and false discoveries."""
    mine = [joint(row) for row in rows if row["method"] == ours]
    others = [joint(row) for row in rows if row["method"] != ours]
    if not mine or not others or mine[0] is None:
        return None
    return all(other is None or mine[0] > other for other in others)


def joint(row: Mapping[str, Any]) -> float | None:
    """Mean of the rates of a method, each turned so that one is best; what could not be measured is left out."""
    good = [row[key] for key in ("single_named", "inside_class", "mixture_whole", "outside_unnamed")]
    bad = [row[key] for key in ("mixture_false", "clean_alarms", "wrong_physics")]
    known = [v for v in good if v is not None] + [1 - v for v in bad if v is not None]
    return float(np.mean(known)) if known else None
