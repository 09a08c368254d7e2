"""The proof's tables as a reader sees them: shares as percent, targets in words."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

import pandas as pd

from rotorid_proof import table
from rotorid_proof.intervals import wilson

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
    for name, stored in tables.items():
        column = "judged_by" if "judged_by" in stored else "code"
        rows = stored[column] if column in stored else pd.Series([None])
        codes = sorted({short_code(code) for code in rows}, key=lambda code: (code == NOT_KEPT, code))
        found[name] = ", ".join(unknown if code == NOT_KEPT else code for code in codes)
    return found


def commits(releases: pd.DataFrame) -> dict[str, str]:
    """Short name of each release by the date that its cases are drawn from: the commit whose code met them first."""
    return {str(row.released): str(row.commit)[:7] for row in releases.itertuples()}


DRAWN_KINDS = {"flights": ("flight",), "stands": ("stand",), "benches": ("bench",), "all": table.KINDS}


def of_drawn(cases: pd.DataFrame, released: str) -> pd.DataFrame:
    """Drawn cases of one release, judged once by one code, as text: a row a kind, one of all, their target and state.

    `right`: of the sets with something hidden (`hidden`), those in which all of it was named and nothing else;
    `share`, with its 95 % interval (Wilson); `wrong`: those with a wrong name; `alarms`: of the clean sets; `names`:
    wrong ones of all.
    """
    own = cases[cases["released"].astype(str) == released]
    rows = [{"kind": name, **_drawn(own[own["kind"].isin(kinds)])} for name, kinds in DRAWN_KINDS.items()]
    rows = [row for row in rows if row["hidden"]]
    if rows:
        states = _states_of_drawn(own)
        rows.append(
            {"kind": "target", "alarms": f"≤ {100 * table.MOST_ALARMS:g} %", "names": f"≤ {100 * table.MOST_WRONG:g} %"}
        )
        rows.append({"kind": "state", **states})
    return pd.DataFrame(rows, columns=["kind", "hidden", "right", "share", "wrong", "alarms", "names"]).fillna("")


def of_releases(cases: pd.DataFrame, releases: pd.DataFrame) -> pd.DataFrame:
    """The same for each release, a row each, all its kinds together, and one for all releases; `releases`: their code.

    `state`: what the alarms are, held against their target.
    """
    drawn = cases[cases["released"].notna()]
    rows = []
    for release in releases.itertuples():
        own = drawn[drawn["released"].astype(str) == str(release.released)]
        if len(own):
            named = {"released": str(release.commit)[:7], "by": short_code(release.code)}
            rows.append({**named, **_drawn(own), "state": _states_of_drawn(own)["alarms"]})
    if len(rows) > 1:
        rows.append({"released": "all", "by": "each its own", **_drawn(drawn), "state": ""})
    columns = ["released", "by", "hidden", "right", "share", "wrong", "alarms", "state", "names"]
    return pd.DataFrame(rows, columns=columns)


def _drawn(own: pd.DataFrame) -> dict[str, str]:
    """Counts of drawn cases as text."""
    clean = own["clean"].astype(bool)
    hidden, nothing = own[~clean], own[clean]
    right = int(hidden["right"].astype(bool).sum())
    return {
        "hidden": str(len(hidden)) if len(hidden) else "",
        "right": str(right),
        "share": span("", *wilson(right, len(hidden))) if len(hidden) else "–",
        "wrong": str(int((hidden["false_count"] > 0).sum())),
        "alarms": f"{int(nothing['false_alarm'].astype(bool).sum())} of {len(nothing)}" if len(nothing) else "–",
        "names": f"{int(own['false_count'].sum())} of {int(own['claim_count'].sum())}",
    }


def _states_of_drawn(own: pd.DataFrame) -> dict[str, str]:
    scores = own.to_dict("records")
    alarms = table.rate([s for s in scores if s["clean"]], lambda s: s["false_alarm"])
    wrong = table.false_discoveries(scores)
    return {
        name: table.finished(name, "", None, most, found)["holds"] or ""
        for name, most, found in (("alarms", table.MOST_ALARMS, alarms), ("names", table.MOST_WRONG, wrong))
    }


def of_questions(cases: pd.DataFrame, parameters: pd.DataFrame, better: pd.DataFrame) -> pd.DataFrame:
    """Cases for development as text, a row a question: those of flights, stands and benches together where all have it.

    `kinds`: what was measured of each kind of recordings alone, where more than one has the question. `better`: rows
    of the summary that count no cases, put below.
    """
    listed = [s for s in table.scores_from(cases, parameters) if (s["kind"], s["family"]) not in table.SIMULATORS]
    by_kind = [table.rows_of([s for s in listed if s["kind"] == kind]) for kind in table.KINDS]
    together = table.rows_of(listed)
    rows = []
    for k, whole in enumerate(together):
        shared = whole["id"] in table.GROUND_ROWS
        own = [of_one[k] for of_one in by_kind]
        known = [number(row["id"], row["value"]) for row in own if row["cases"]] if shared else []
        rows.append({**(whole if shared else own[0]), "kinds": _side_by_side(known)})
    measured = pd.DataFrame([*(row for row in rows if row["cases"]), *better.to_dict("records")])
    shown = _shown(measured).assign(kinds=measured["kinds"].fillna(""))
    # What has a target stands first.
    return shown.loc[(shown["target"] == "").sort_values(kind="stable").index]


def _side_by_side(numbers: list[str]) -> str:
    """Numbers of several kinds in one cell, the unit once; nothing where they are one."""
    if len(numbers) < 2:
        return ""
    unit = " %" if numbers[-1].endswith(" %") else ""
    return " / ".join(text.removesuffix(" %").removesuffix(".0") for text in numbers) + unit


def _of(score: pd.Series) -> str:
    """A share as `14 of 25`."""
    count = int(score["count"])
    return f"{round(float(score['value']) * count)} of {count}" if count else "–"


PLANTED = {
    "named": "named",
    "size covered": "covered",
    "ids new or lost a set": "moved",
    "values new or lost a set": "values",
}
"""Scores of the planted sets that the report shows, and their columns."""
PLANTED_KINDS = ("code", "all", "target", "state", "flight", "family")
"""What a row of the plantings is of, in the order shown; those of single causes stay in the stored table."""


def of_plantings(now: pd.DataFrame) -> pd.DataFrame:
    """What was planted in real flights at the larger size, as text: by one code, by all; then by flight and family.

    `named`, `covered` (size inside the 95 % interval) as counts, `moved` and `values` a set. Below the first two stand
    the targets, and whether these hold by the one code. `kind` says what a row is of.
    """
    large = now[now["size"] == "large"]
    rows, judged = [], large[large["group"] == "all"]
    for group, own in large.groupby("group", sort=False):
        kind, _, name = str(group).partition(" ")
        if kind not in PLANTED_KINDS:
            continue
        row = {"group": {"code": group, "all": "all codes"}.get(kind) or words(name), "kind": kind}
        for what, column in PLANTED.items():
            score = own[own["what"] == what].iloc[0]
            share = what in ("named", "size covered")
            row[column] = _of(score) if share else f"{score['value']:.2f}"
        rows.append(row)
        judged = own if kind == "code" else judged
    by_score = judged.set_index("what")
    for name, cell in (("target", _target_of_planting), ("state", lambda score: score["state"])):
        rows.append({"group": name, "kind": name})
        rows[-1].update({column: cell(by_score.loc[what]) for what, column in PLANTED.items()})
    out = pd.DataFrame(rows, columns=["group", "kind", *PLANTED.values()]).fillna("")
    return out.loc[out["kind"].map(PLANTED_KINDS.index).sort_values(kind="stable").index]


def _target_of_planting(score: pd.Series) -> str:
    if pd.notna(score["at_least"]):
        return f"≥ {number('', score['at_least'])}"
    return f"≤ {score['at_most']:g}" if pd.notna(score["at_most"]) else ""


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
            }
            for _, row in rows.iterrows()
        ]
    )
    out["with_interval"] = [
        f"{row.measured} ({row.interval})" if row.interval else row.measured for row in out.itertuples()
    ]
    return out


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
                "found": "the stage stopped" if row["word"] == "stopped" else "; ".join(found) or "nothing",
                "expected": "; ".join(expected) or "–",
                "lacking": "; ".join(one for one in expected if one not in confirmed) or "–",
                "confirmed": len(confirmed) if expected else "",
                "error": error.replace(" ", "\u00a0"),
                "unexplained": "–" if pd.isna(share) else f"{100 * share:.0f} %",
            }
        )
    return pd.DataFrame(
        rows, columns=["study", "about", "expected", "lacking", "confirmed", "found", "error", "unexplained"]
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
        others = " or ".join(x for x in words(row.alternatives).split(" or ") if x != words(row.effect))
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
