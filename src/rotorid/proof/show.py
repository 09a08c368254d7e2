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


def with_target(summary: pd.DataFrame) -> pd.DataFrame:
    """`what`, `measured`, `interval`, `cases`, `target`, `holds` as text, rows that have a target."""
    return _shown(summary[summary["at_least"].notna() | summary["at_most"].notna()])


def without_target(summary: pd.DataFrame) -> pd.DataFrame:
    """The same for rows without one."""
    return _shown(summary[summary["at_least"].isna() & summary["at_most"].isna()]).drop(columns=["target", "holds"])


def _shown(rows: pd.DataFrame) -> pd.DataFrame:
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
                "holds": {"True": "yes", "False": "no"}.get(str(row["holds"]), ""),
            }
            for _, row in rows.iterrows()
        ]
    )


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
