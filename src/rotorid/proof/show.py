"""The proof's tables as a reader sees them: shares as percent, targets in words."""

from __future__ import annotations

import pandas as pd

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


def with_target(summary: pd.DataFrame, present: str = "") -> pd.DataFrame:
    """`what`, `measured`, `interval`, `cases`, `target`, `holds`, `by` as text, rows that have a target.

    `by` says whether code older than that of hash `present` judged the row, and how many of its cases were looked at.
    """
    return _shown(present, summary[summary["at_least"].notna() | summary["at_most"].notna()])


def without_target(summary: pd.DataFrame, present: str = "") -> pd.DataFrame:
    """The same for rows without one."""
    return _shown(present, summary[summary["at_least"].isna() & summary["at_most"].isna()]).drop(
        columns=["target", "holds"]
    )


def _shown(present: str, rows: pd.DataFrame) -> pd.DataFrame:
    return pd.DataFrame(
        [
            {
                "what": row["what"],
                "measured": number(row["id"], row["value"]),
                "interval": ""
                if pd.isna(row["low_95"]) or pd.isna(row["value"])
                else f"{number(row['id'], row['low_95'])} to {number(row['id'], row['high_95'])}",
                "cases": "" if pd.isna(row["cases"]) else str(int(row["cases"])),
                "target": target(row),
                "holds": "" if pd.isna(row["holds"]) else row["holds"],
                "by": provenance(row, present),
            }
            for _, row in rows.iterrows()
        ]
    )


def provenance(row: pd.Series, present: str) -> str:
    """Whether older code judged a row's cases, and how many of them are development cases."""
    said = [] if pd.isna(row["judged_by"]) or row["judged_by"] in ("", present) else ["older code"]
    looked, cases = row["looked_at"], row["cases"]
    if looked > 0 and pd.notna(cases):
        said.append("looked at" if looked >= cases else f"{int(looked)} looked at")
    return ", ".join(said)


def of_families(families: pd.DataFrame) -> pd.DataFrame:
    """Drawn cases, one row a family and date, as text."""
    out = families.astype(object).fillna("").astype(str)
    out["released"] = out["released"].replace("", "development")
    for column in ("family", "wrong_names", "missed"):
        out[column] = out[column].str.replace("_", " ")
    return out


def number(key: str, value: float) -> str:
    """A share as percent, a ratio with two decimals, nothing as a dash."""
    if pd.isna(value):
        return "–"
    key = key.removeprefix("stand_").removeprefix("bench_")
    if key == "better":
        return "yes" if value else "no"
    return f"{value:.2f}" if key in RATIOS else f"{100 * value:.1f} %"


def target(row: pd.Series) -> str:
    """The target in words."""
    low, high = row["at_least"], row["at_most"]
    if pd.notna(low) and pd.notna(high):
        return f"{number(row['id'], low)} to {number(row['id'], high)}"
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
    """Real recordings, one row each: ids in words; error of the channel group that was recorded best."""
    rows = []
    for _, row in real.iterrows():
        group, unit, digits = ("force", "N", 3) if pd.notna(row["force_after"]) else ("rotor_speed", "rad/s", 1)
        stages = [row[f"{group}_{stage}"] for stage in ("before", "refitted", "after")]
        own = row.get(f"{group}_neurobem") if group == "force" else None
        share = row["unexplained_share"]
        rows.append(
            {
                "study": row["study"],
                "about": row["about"],
                "found": words(row["found"]) or "nothing",
                "values": words(row["values"]),
                "error": " / ".join("–" if pd.isna(s) else f"{s:.{digits}f}" for s in stages) + f" {unit}",
                "reference": "" if own is None or pd.isna(own) else f"{own:.{digits}f} {unit}",
                "unexplained": "–" if pd.isna(share) else f"{100 * share:.0f} %",
            }
        )
    return pd.DataFrame(rows, columns=["study", "about", "found", "values", "error", "reference", "unexplained"])


def words(ids: object) -> str:
    """Ids with underscores as words; nothing as an empty text."""
    return "" if pd.isna(ids) else str(ids).replace("_", " ")


def of_published(coefficients: pd.DataFrame) -> pd.DataFrame:
    """Coefficients found beside published ones, as text."""
    out = coefficients[["study", "effect", "symbol", "unit", "source"]].copy()
    out["effect"] = [words(e) for e in out["effect"]]
    out["found"] = [
        f"{f:.3g} ({low:.3g} to {high:.3g})"
        for f, low, high in zip(coefficients["found"], coefficients["low_95"], coefficients["high_95"], strict=True)
    ]
    out["published"] = [f"{p:.3g}" for p in coefficients["published"]]
    return out
