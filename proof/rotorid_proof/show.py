"""The proof's tables as a reader sees them: shares as percent, targets in words."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

import pandas as pd

from rotorid_proof.intervals import wilson
from rotorid_proof.table import SIMULATORS, row_prefix

RATIOS = ("location_f1", "oracle")
"""Rows whose value is no share."""
METHODS = {
    "rotorid": "rotorid",
    "refit_only": "refit only",
    "stepwise_pse": "stepwise, PSE",
    "pysindy": "PySINDy",
    "boosting": "gradient boosting",
    "sample_split": "sample-split F-test",
}
RELEASE_ROW = re.compile(r"(?P<simulator>\w+)_(?P<date>\d{4}-\d\d-\d\d)_(?P<score>right|clean_alarms|false)")
"""Id of a release's row."""


NOT_KEPT = "not kept"
DEVELOPMENT = "development"
"""In the place of a release's date: the commit that stored the development cases, of which no hash was kept."""


def short_code(code: object) -> str:
    """The beginning of a hash; several, or none that was kept, in words."""
    known = [part for part in str(code).split() if part not in ("nan", "None", "unknown")]
    return " ".join(part[:7] for part in known) or NOT_KEPT


def codes_of(tables: Mapping[str, pd.DataFrame], stored_with: str = "") -> dict[str, str]:
    """Beginnings of the hashes of the code that judged each stored table's rows, in words.

    Where no hash was kept, `stored_with` is the commit that stored the rows: no later code judged them.
    """
    unknown = f"{NOT_KEPT} (of commit {stored_with} or before)" if stored_with else NOT_KEPT
    found = {}
    for name, table in tables.items():
        column = "judged_by" if "judged_by" in table else "code"
        rows = table[column] if column in table else pd.Series([None])
        codes = sorted({short_code(code) for code in rows}, key=lambda code: (code == NOT_KEPT, code))
        found[name] = ", ".join(unknown if code == NOT_KEPT else code for code in codes)
    return found


def commits(releases: pd.DataFrame) -> dict[str, str]:
    """Short name of each release by the date that its cases are drawn from: the commit whose code met them first."""
    return {str(row.released): str(row.commit)[:7] for row in releases.itertuples()}


def of_releases(summary: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """A row for each release and simulator of the release proof, as text, and one for all of them.

    `names` has each release's commit by the date that its cases are drawn from.

    `right` counts the sets in which all that is hidden was named and nothing else, with the 95 % interval of their
    share (Wilson); `alarms` the clean sets that raised one; `false` is the share of names that are wrong.
    """
    short = {row_prefix(*key): simulator.short for key, simulator in SIMULATORS.items()}
    groups: dict[tuple[str, str], dict[str, pd.Series]] = {}
    for _, row in summary.iterrows():
        if found := RELEASE_ROW.fullmatch(row["id"]):
            groups.setdefault((found["date"], found["simulator"]), {})[found["score"]] = row
    rows = [
        {
            "released": names.get(date, date),
            "simulator": short.get(simulator, words(simulator)),
            "right": _of(scores["right"]),
            "share": _span_of(scores["right"]),
            "alarms": _of(scores["clean_alarms"]),
            "false": f"{number('', scores['false']['value'])} of {_count(scores['false'])}",
        }
        for (date, simulator), scores in groups.items()
    ]
    if len(rows) > 1:
        right = [scores["right"] for scores in groups.values()]
        alarms = [scores["clean_alarms"] for scores in groups.values()]
        hits, of = sum(map(_hits, right)), sum(map(_count, right))
        rows.append(
            {
                "released": "all",
                "simulator": "",
                "right": f"{hits} of {of}",
                "share": span("", *wilson(hits, of)) if of else "–",
                "alarms": f"{sum(map(_hits, alarms))} of {sum(map(_count, alarms))}",
                "false": "",
            }
        )
    return pd.DataFrame(rows, columns=["released", "simulator", "right", "share", "alarms", "false"])


def _count(score: pd.Series) -> int:
    """Cases behind a share; of plantings the column is `count`."""
    return int(score["count"] if "count" in score else score["cases"])


def _hits(score: pd.Series) -> int:
    return round(float(score["value"]) * _count(score)) if _count(score) else 0


def _span_of(score: pd.Series) -> str:
    return span("", score["low_95"], score["high_95"]) if _count(score) else "–"


def _of(score: pd.Series) -> str:
    """A share as `14 of 25`."""
    return f"{_hits(score)} of {_count(score)}" if _count(score) else "–"


PLANTED = {
    "named": "named",
    "size covered": "covered",
    "ids new or lost a set": "moved",
    "values new or lost a set": "values",
}
"""Scores of the planted sets that the report shows, and their columns."""


def of_plantings(now: pd.DataFrame) -> pd.DataFrame:
    """What was planted in real flights at the larger size, as text: by flight, and by family of cause.

    `named`, `covered` (size inside the 95 % interval) as counts, `moved` and `values` a set. Below the row of all
    stand their targets and whether these hold.
    """
    rows = []
    for group, own in now[now["size"] == "large"].groupby("group", sort=False):
        kind, _, name = str(group).partition(" ")
        if kind not in ("all", "flight", "family"):
            continue
        row = {"group": words(name) or "all", "kind": kind}
        for what, column in PLANTED.items():
            score = own[own["what"] == what].iloc[0]
            share = what in ("named", "size covered")
            row[column] = _of(score) if share else f"{score['value']:.2f}"
        rows.append(row)
    whole = now[(now["size"] == "large") & (now["group"] == "all")].set_index("what")
    for name, cell in (("target", _target_of_planting), ("verdict", lambda score: score["state"])):
        rows.append({"group": name, "kind": name})
        rows[-1].update({column: cell(whole.loc[what]) for what, column in PLANTED.items()})
    out = pd.DataFrame(rows, columns=["group", "kind", *PLANTED.values()]).fillna("")
    order = out["kind"].map({"all": 0, "target": 1, "verdict": 2, "flight": 3, "family": 4})
    return out.loc[order.sort_values(kind="stable").index].drop(columns="kind")


def _target_of_planting(score: pd.Series) -> str:
    if pd.notna(score["at_least"]):
        return f"≥ {number('', score['at_least'])}"
    return f"≤ {score['at_most']:g}" if pd.notna(score["at_most"]) else ""


def with_target(summary: pd.DataFrame, names: Mapping[str, str] | None = None) -> pd.DataFrame:
    """`what`, `measured`, `interval`, `cases`, `target`, `holds`, `by` as text: every row that has a target.

    `by` says which code judged the row's cases, and how many of them had been looked at. A release is called by its
    commit in `names`.
    """
    shown = _shown(summary[summary["at_least"].notna() | summary["at_most"].notna()])
    shown["what"] = [in_words(what, names or {}) for what in shown["what"]]
    return shown


def in_words(what: str, names: Mapping[str, str]) -> str:
    """What a row is about in few words; a release is called by its commit, not by the date its cases are drawn from."""
    for date, commit in names.items():
        what = what.replace(f"released {date}", commit)
    for simulator in SIMULATORS.values():
        what = what.replace(simulator.what, f"Drawn {simulator.short}")
    return what


def without_target(summary: pd.DataFrame) -> pd.DataFrame:
    """The same for rows without one; those of releases are left to `of_releases`."""
    others = summary["at_least"].isna() & summary["at_most"].isna()
    others &= ~summary["id"].map(lambda key: RELEASE_ROW.fullmatch(key) is not None)
    return _shown(summary[others]).drop(columns=["target", "holds"])


def _shown(rows: pd.DataFrame) -> pd.DataFrame:
    out = pd.DataFrame(
        [
            {
                "what": row["what"],
                "measured": number(row["id"], row["value"]),
                "interval": ""
                if pd.isna(row["low_95"]) or pd.isna(row["value"])
                else span(row["id"], row["low_95"], row["high_95"]),
                "cases": "" if pd.isna(row["cases"]) else str(int(row["cases"])),
                "target": target(row).replace("\u00a0", " "),
                "holds": "" if pd.isna(row["holds"]) else row["holds"],
                "by": provenance(row),
            }
            for _, row in rows.iterrows()
        ]
    )
    out["with_interval"] = [
        f"{row.measured} ({row.interval})" if row.interval else row.measured for row in out.itertuples()
    ]
    return out


def provenance(row: pd.Series) -> str:
    """The code that judged a row's cases; of cases of which some had been looked at, how many."""
    looked, cases = row["looked_at"], row["cases"]
    part = looked > 0 and pd.notna(cases) and looked < cases
    return short_code(row["judged_by"]) + (f", {int(looked)} seen" if part else "")


def of_families(families: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """Drawn cases as text: a row for each family and release with something wrong, its other families in one row."""
    known = families.astype(object).fillna("")
    whole = (known["cases"] == known["right"]) & (known["false_alarms"] == 0)
    rows = []
    for (simulator, released), own in known.groupby(["simulator", "released"], sort=False):
        right = own[whole[own.index]]
        rows += own[~whole[own.index]].to_dict("records")
        if len(right):
            others = {"simulator": simulator, "released": released, "wrong_names": "", "missed": ""}
            sums = {name: right[name].sum() for name in ("cases", "right", "false_alarms")}
            rows.append({"family": f"{len(right)} families, all right", **others, **sums})
    out = pd.DataFrame(rows, columns=[c for c in known.columns if c not in ("judged_by", "looked_at")]).astype(str)
    out["released"] = out["released"].replace({"": "development", **names})
    short = {simulator.what: simulator.short for simulator in SIMULATORS.values()}
    out["simulator"] = [short.get(name, name) for name in out["simulator"]]
    for column in ("family", "wrong_names", "missed"):
        out[column] = out[column].str.replace("_", " ")
    return out


def asked_of_flights(rows: pd.DataFrame) -> pd.DataFrame:
    """Sets of the next flight's proof that left something open: what was hidden, planned and came out, as text."""
    asked = rows[rows["open"].fillna("") != ""]

    def sigma(value) -> str:
        return "" if pd.isna(value) else f"{float(value):.1f}"

    return pd.DataFrame(
        [
            {
                "case": row["case"],
                "truth": words(row["truth"]),
                "open": words(" or ".join(str(row["open"]).split())),
                "planned_s": "" if pd.isna(row["planned_s"]) else f"{float(row['planned_s']):.0f}",
                "predicted": sigma(row["predicted_sigma"]),
                "found": sigma(row["measured_sigma"]),
                "standard": sigma(row["standard_sigma"]),
                "outcome": row["outcome"],
                "code": short_code(row["judged_by"]),
            }
            for _, row in asked.iterrows()
        ],
        columns=["case", "truth", "open", "planned_s", "predicted", "found", "standard", "outcome", "code"],
    )


def of_next_flights(summary: pd.DataFrame) -> pd.DataFrame:
    """`what`, `count`, `share` and its interval of the next flight's proof, as text; shares of nothing are left out."""
    known = summary[summary["of"] > 0]
    return pd.DataFrame(
        [
            {
                "what": row["what"],
                "count": f"{int(row['count'])} of {int(row['of'])}",
                "share": f"{100 * row['share']:.0f} %",
                "interval": f"{100 * row['low']:.0f} to {100 * row['high']:.0f} %",
            }
            for _, row in known.iterrows()
        ],
        columns=["what", "count", "share", "interval"],
    )


def number(key: str, value: float) -> str:
    """A share as percent, a ratio with two decimals, nothing as a dash."""
    if pd.isna(value):
        return "–"
    key = key.removeprefix("stand_").removeprefix("bench_")
    if key == "better":
        return "yes" if value else "no"
    return f"{value:.2f}" if key in RATIOS else f"{100 * value:.1f} %"


def span(key: str, low: float, high: float) -> str:
    """Two ends, the unit once, kept on one line."""
    return f"{number(key, low).removesuffix(' %')} to {number(key, high)}".replace(" ", "\u00a0")


def target(row: pd.Series) -> str:
    """The target in words."""
    low, high = row["at_least"], row["at_most"]
    if pd.notna(low) and pd.notna(high):
        return span(row["id"], low, high)
    if pd.notna(low):
        return "yes" if row["id"] == "better" else f"≥ {number(row['id'], low)}"
    return f"≤ {number(row['id'], high)}" if pd.notna(high) else ""


def of_methods(peers: pd.DataFrame) -> pd.DataFrame:
    """One row a method, shares as percent."""
    out = peers.copy()
    for column in out.columns.drop(["method", "cases"]):
        out[column] = [number(column, value) for value in out[column]]
    out["method"] = [METHODS.get(name, name) for name in out["method"]]
    return out


def of_studies(real: pd.DataFrame) -> pd.DataFrame:
    """Real recordings, one row each: ids and wrong values in words; error of the channel group recorded best."""
    rows = []
    for _, row in real.iterrows():
        group, unit, digits = ("force", "N", 3) if pd.notna(row["force_after"]) else ("rotor_speed", "rad/s", 1)
        stages = [row[f"{group}_{stage}"] for stage in ("before", "refitted", "after")]
        wrong = [VALUE_UNIT.sub("", v.strip()) for v in str(row["values"]).split(";") if pd.notna(row["values"])]
        found = [words(row["found"])] if pd.notna(row["found"]) else []
        found += [f"wrong {'values' if len(wrong) > 1 else 'value'}: {words(', '.join(wrong))}"] if wrong else []
        error = " / ".join("–" if pd.isna(s) else f"{s:.{digits}f}" for s in stages) + f" {unit}"
        error = "–" if row["word"] == "stopped" else error
        share = row["unexplained_share"]
        expected, confirmed = (
            [] if pd.isna(row[name]) else [words(one) for one in str(row[name]).split("; ")]
            for name in ("expected", "expected_found")
        )
        rows.append(
            {
                "study": row["study"],
                "about": row["about"],
                "subject": f"{row['study']}: {row['about']}",
                "found": "the stage stopped" if row["word"] == "stopped" else "; ".join(found) or "nothing",
                "expected": "; ".join(f"{one}: {'found' if one in confirmed else 'no'}" for one in expected) or "–",
                "confirmed": len(confirmed) if expected else "",
                "error": error.replace(" ", "\u00a0"),
                "unexplained": "–" if pd.isna(share) else f"{100 * share:.0f} %",
            }
        )
    return pd.DataFrame(
        rows, columns=["study", "about", "subject", "expected", "confirmed", "found", "error", "unexplained"]
    )


def of_channels(channels: pd.DataFrame) -> pd.DataFrame:
    """Errors on the runs held out of every channel, a row each: three stages and the noise, in the channel's unit.

    `worse`: by how much the delivered model is worse than the refitted values where it is, in percent.
    """
    held = channels[channels["split"] == "held_out"].reset_index(drop=True)
    out = pd.DataFrame({"recordings": held["example"], "channel": held["channel"].map(words), "unit": held["unit"]})
    for name in ("noise_floor", "before", "refitted", "after"):
        out[name] = held[name].map(lambda value: "–" if pd.isna(value) else f"{value:.3g}")
    growth = held["after"] / held["refitted"] - 1
    out["worse"] = [f"{100 * more:.1f} %" if more > LEAST_WORSE else "" for more in growth]
    return out


LEAST_WORSE = 5e-4
"""Growth of an error that its three printed digits may show."""


def power_of(value: float) -> int:
    """The power of ten, a multiple of three, in whose units a small number is written; 0 for others."""
    return 3 * math.floor(math.log10(abs(value)) / 3) if 0 < abs(value) < 1e-3 else 0


def of_effects(effects: pd.DataFrame) -> pd.DataFrame:
    """Effects of a verdict as text: names with their class and status, each number with its interval in one cell."""
    rows = []
    for row in effects.itertuples():
        known = pd.notna(row.value)
        numbers = (row.value, row.low_95, row.high_95) if known else (0.0, 0.0, 0.0)
        largest = max(map(abs, numbers))
        power = power_of(largest)
        # A value that its interval does not separate from zero has no digits of its own.
        decimals = max(0, 2 - math.floor(math.log10(largest / 10**power))) if largest else 0
        form = f".{decimals}f" if abs(numbers[0]) < 0.01 * largest else ".3g"
        value, low, high = (f"{x / 10**power:{form}}".replace("-", "−") for x in numbers)
        others = words(row.alternatives)
        rows.append(
            {
                "effect": words(row.effect) + (f" (or: {others})" if others else ""),
                "status": words(row.status),
                "symbol": row.symbol if isinstance(row.symbol, str) else "",
                "value": f"{value} ({low} to {high})" if known else "",
                "unit": ((f"1e{power} " if power else "") + str(row.unit)) if known else "",
            }
        )
    return pd.DataFrame(rows, columns=["effect", "status", "symbol", "value", "unit"])


def of_campaign_sets(sets: pd.DataFrame) -> pd.DataFrame:
    """The campaign's sets as text: verdict, what is at work, and what of it was named, rightly or wrongly."""
    return sets.apply(lambda column: column.map(words)).replace({"right": {"": "–"}, "wrong": {"": "–"}})


def of_campaign_numbers(numbers: pd.DataFrame) -> pd.DataFrame:
    """A row a set and effect as text: how many numbers are inside, and the one furthest out."""
    rows = []
    for row in numbers.itertuples():
        power = power_of(row.found)
        shown = (row.truth, row.found, row.low_95, row.high_95)
        true, found, low, high = (f"{x / 10**power:.4g}".replace("-", "−") for x in shown)
        rows.append(
            {
                "set": row.set,
                "effect": words(row.effect),
                "inside": f"{row.held} of {row.numbers}",
                "symbol": row.symbol,
                "truth": true,
                "found": f"{found} ({low} to {high})",
                "unit": (f"1e{power} " if power else "") + row.unit,
            }
        )
    return pd.DataFrame(rows, columns=["set", "effect", "inside", "symbol", "truth", "found", "unit"])


VALUE_UNIT = re.compile(r"_(kg_m2|kg|n_m_s2|n_s2|m_s2|rad_s)$")
"""The unit at the end of the name of a believed value."""


def words(ids: object) -> str:
    """Ids with underscores as words; nothing as an empty text."""
    return "" if pd.isna(ids) else str(ids).replace("_", " ")


def of_published(coefficients: pd.DataFrame) -> pd.DataFrame:
    """Coefficients found next to published ones, as text: small ones in units of a power of ten."""
    rows = []
    for row in coefficients.itertuples():
        power = power_of(row.found)
        found, low, high, published = (
            f"{x / 10**power:.3g}" for x in (row.found, row.low_95, row.high_95, row.published)
        )
        rows.append(
            {
                "study": row.study,
                "effect": words(row.effect),
                "symbol": row.symbol,
                "found": f"{found} ({low} to {high})",
                "published": published,
                "unit": (f"1e{power} " if power else "") + row.unit,
                "source": row.source,
            }
        )
    return pd.DataFrame(rows)
