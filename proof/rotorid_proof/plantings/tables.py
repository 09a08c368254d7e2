"""Tables of the plantings: one row a planted cause, and shares by flight, family and kind with Wilson's intervals."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import pandas as pd
from scipy.stats import chi2

from rotorid.recordings import RecordingSet
from rotorid_proof.intervals import wilson
from rotorid_proof.plantings.judge import of_mistakes
from rotorid_proof.plantings.kinds import LARGE
from rotorid_proof.plantings.plan import PAIR, Planting
from rotorid_proof.plantings.score import ALONE, IN_CLASS, UNSEEN, beside, score_truth
from rotorid_proof.plantings.sow import kind, plant

COLUMNS = ["planting", "flight", "set_of", "family", "kind", "size", "seed", "named", "unseen", "symbol", "true"]
COLUMNS += ["estimate", "low_95", "high_95", "covered", "new", "lost", "values_new", "values_lost", "failed", "word"]
COLUMNS += ["seconds", "flown_s", "code"]
SUMMARY_COLUMNS = ["group", "what", "size", "value", "low_95", "high_95", "count", "at_least", "at_most", "state"]
SUMMARY_COLUMNS += ["older_rows"]
NAMED, SIZED, BESIDE = 0.90, 0.90, 0.1


def rows_of(planting: Planting, recordings: RecordingSet, result: Mapping, untouched: Mapping) -> list[dict[str, Any]]:
    """One row for each planted cause of a set.

    Parameters
    ----------
    planting, recordings
        What was planted, and the untouched set.
    result, untouched
        `judge.judge_plantings`'s result on the planted set and the verdict on the untouched one.
    """
    _, truths = plant(recordings, planting)
    verdict = result["verdict"]
    failed = verdict.get("failed", "")
    other = {} if failed else {k: "; ".join(v) for k, v in beside(verdict, untouched, truths).items()}
    common = {
        "planting": planting.name,
        "flight": planting.flight,
        "set_of": PAIR if planting.family == PAIR else "single",
        "size": planting.size,
        "seed": planting.seed,
        "new": "",
        "lost": "",
        "values_new": "",
        "values_lost": "",
        **other,
        "failed": failed,
        "word": verdict.get("verdict", ""),
        "seconds": result["seconds"],
        "flown_s": result["flown_s"],
        "code": result["code"],
    }
    return [
        {**common, "family": kind(name).family, "kind": name, **score_truth(verdict, untouched, truth)}
        for name, truth in zip(planting.kinds, truths, strict=True)
    ]


def mistake_rows(recordings: RecordingSet, plantings: Sequence[Planting], code: str) -> list[dict[str, Any]]:
    """One row a planted mistake, by the search for mistakes alone (seconds a set, where a verdict takes a minute)."""
    untouched, out = of_mistakes(recordings), []
    for planting in plantings:
        changed, (truth,) = plant(recordings, planting)
        found = of_mistakes(changed)
        sentences = " ".join(e["sentence"] for e in found.get("effects", ()))
        row = {"planting": planting.name, "flight": planting.flight, "family": planting.family}
        row |= {"kind": planting.kinds[0], "size": planting.size, **score_truth(found, untouched, truth)}
        out.append({**row, "said": sentences, "failed": found.get("failed", ""), "code": code})
    return out


def kept_with(new: pd.DataFrame, kept: pd.DataFrame | None) -> pd.DataFrame:
    """New rows, and the kept rows of plantings that were not judged now (their own code's hash says so)."""
    if kept is None or kept.empty:
        return new[COLUMNS]
    rest = kept[~kept["planting"].isin(new["planting"])]
    both = pd.concat([new, rest.reindex(columns=COLUMNS)], ignore_index=True) if len(rest) else new
    return both[COLUMNS].sort_values(["flight", "set_of", "size", "family", "kind", "planting"], kind="stable")


def state(value: float | None, low: float, high: float, at_least: float | None, at_most: float | None) -> str:
    """`holds` where the whole interval is inside the target, `fails` where it is outside, else `not refuted`."""
    if value is None or (at_least is None and at_most is None):
        return ""
    if at_least is not None:
        return "holds" if low >= at_least else "fails" if high < at_least else "not refuted"
    return "holds" if high <= at_most else "fails" if low > at_most else "not refuted"


def summary(rows: pd.DataFrame, code: str) -> pd.DataFrame:
    """Shares named, sizes covered and ids new or lost a set: over all, by the code of now, by family, kind and flight.

    Causes that a flight's columns cannot show are counted apart. `code` is the hash of the code of now: `older_rows` of
    a line were judged by another, and the lines of the group `code …` leave these out.
    """
    groups = [("all", rows), (f"code {code[:7]}", rows[rows["code"] == code])]
    groups += [(f"of {s}s", part) for s, part in rows.groupby("set_of")]
    groups += [(f"family {f}", part) for f, part in rows.groupby("family")]
    groups += [(f"flight {f}", part) for f, part in rows.groupby("flight")]
    groups += [(f"kind {k}", part) for k, part in rows.groupby("kind")]
    out = []
    for name, part in groups:
        for size in dict.fromkeys([LARGE, *part["size"]]):
            own = part[part["size"] == size]
            if len(own):
                out += _lines(name, size, own, code)
    return pd.DataFrame(out, columns=SUMMARY_COLUMNS)


def _lines(group: str, size: str, rows: pd.DataFrame, code: str) -> list[dict[str, Any]]:
    seen = rows[rows["named"] != UNSEEN]
    sized = seen[seen["covered"].notna()]
    sets = rows.drop_duplicates("planting")
    # A set in which something cannot be seen may put it down to something else: counted apart too.
    hidden = set(rows.loc[rows["named"] == UNSEEN, "planting"])
    clear = sets[~sets["planting"].isin(hidden) & (sets["failed"].fillna("") == "")]
    target = size == LARGE

    def line(what: str, value, interval, count, at_least=None, at_most=None):
        low, high = interval
        return {
            "group": group,
            "what": what,
            "size": size,
            "value": value,
            "low_95": low,
            "high_95": high,
            "count": count,
            "at_least": at_least,
            "at_most": at_most,
            "state": state(value, low, high, at_least, at_most),
            "older_rows": int((rows["code"] != code).sum()),
        }

    def share(what: str, part: pd.DataFrame, hit: Callable, at_least=None):
        hits = int(hit(part).sum()) if len(part) else 0
        return line(what, hits / len(part) if len(part) else None, wilson(hits, len(part)), len(part), at_least)

    differing = [_count(clear[c]) for c in ("new", "lost")]
    total = sum(int(d.sum()) for d in differing)
    return [
        share("named", seen, lambda p: p["named"].isin([ALONE, IN_CLASS]), NAMED if target else None),
        share("named alone", seen, lambda p: p["named"] == ALONE),
        share("size covered", sized, lambda p: p["covered"].astype(bool), SIZED if target else None),
        line(
            "ids new or lost a set",
            total / len(clear) if len(clear) else None,
            _poisson(total, len(clear)),
            len(clear),
            at_most=BESIDE if target else None,
        ),
        line("ids new a set", *_mean(differing[0])),
        line("ids lost a set", *_mean(differing[1])),
        line("values new or lost a set", *_mean(_count(clear["values_new"]) + _count(clear["values_lost"]))),
        share("cannot be seen", rows, lambda p: p["named"] == UNSEEN),
        share("the stage stopped", sets, lambda p: p["failed"].fillna("") != ""),
    ]


def _count(column: pd.Series) -> pd.Series:
    return column.fillna("").map(lambda text: len(text.split("; ")) if text else 0).astype(int)


def _mean(counts: pd.Series) -> tuple[float | None, tuple[float, float], int]:
    total, trials = int(counts.sum()), len(counts)
    return (total / trials if trials else None), _poisson(total, trials), trials


def _poisson(total: int, trials: int) -> tuple[float, float]:
    """95 % interval of a mean count, exact for Poisson counts (Garwood 1936)."""
    if trials == 0:
        return 0.0, float("inf")
    low = chi2.ppf(0.025, 2 * total) / 2 if total else 0.0
    return float(low / trials), float(chi2.ppf(0.975, 2 * total + 2) / 2 / trials)


def differing_names(rows: pd.DataFrame) -> pd.DataFrame:
    """How often each id or value was new with a planting, or lost: `kind` planted, `what`, `name`, `sets`."""
    out: dict[tuple[str, str, str], int] = {}
    for _, row in rows.drop_duplicates("planting").iterrows():
        for what in ("new", "lost", "values_new", "values_lost"):
            for name in filter(None, str(row[what] if pd.notna(row[what]) else "").split("; ")):
                planted = row["planting"].split("/")[2]
                out[planted, what, name] = out.get((planted, what, name), 0) + 1
    lines = [{"kind": k, "what": w, "name": n, "sets": v} for (k, w, n), v in sorted(out.items())]
    return pd.DataFrame(lines, columns=["kind", "what", "name", "sets"])
