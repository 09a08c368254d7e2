"""A release proof into the tables that are kept: `python -m rotorid_proof.keep_release results/proof docs/proof DATE`.

Rows of the date replace those that were kept of it; everything else stays. Targets are counted anew, cases are not.
The report calls a release by the commit of its code (`releases.csv`): the date is only what its cases are drawn from.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

import pandas as pd

from rotorid.errors import InputError
from rotorid.report.provenance import commit
from rotorid_proof import table


def merged(kept: pd.DataFrame, fresh: pd.DataFrame, of_date: Callable[[pd.DataFrame], pd.Series]) -> pd.DataFrame:
    """Kept rows that are not of the date, then the fresh ones that are (`of_date(table)` is their mask)."""
    old = kept if kept.empty else kept[~of_date(kept)]
    return pd.concat([part for part in (old, fresh[of_date(fresh)]) if not part.empty], ignore_index=True)


def keep(fresh: Path, kept: Path, date: str) -> int:
    """Merge summary, cases and families of a release into the folder `kept`; returns how many cases it has.

    InputError where the fresh tables hold no case of the date.
    """
    masks: dict[str, Callable[[pd.DataFrame], pd.Series]] = {
        "families.csv": lambda t: t["released"].astype(str) == date,
        "cases.csv": lambda t: t["released"].astype(str) == date,
        "summary.csv": lambda t: t["id"].str.contains(f"_{date}_", regex=False),
    }
    tables = {name: pd.read_csv(fresh / name) for name in masks}
    count = int(masks["cases.csv"](tables["cases.csv"]).sum())
    if not count:
        raise InputError(f"{fresh / 'cases.csv'}: no case is of the release {date}")
    for name, of_date in masks.items():
        merged(pd.read_csv(kept / name), tables[name], of_date).to_csv(kept / name, index=False, float_format="%.6g")
    codes = tables["cases.csv"].loc[masks["cases.csv"](tables["cases.csv"]), "judged_by"].dropna().unique()
    named = pd.DataFrame([{"released": date, "commit": commit(kept), "code": " ".join(codes)}])
    known = pd.read_csv(kept / "releases.csv") if (kept / "releases.csv").is_file() else named.iloc[:0]
    merged(known, named, lambda t: t["released"].astype(str) == date).to_csv(kept / "releases.csv", index=False)
    path = kept / "state.json"
    state = json.loads(path.read_text(encoding="utf-8"))
    state |= {"released": sorted({*state["released"], date}), **targets(pd.read_csv(kept / "summary.csv"))}
    path.write_text(json.dumps(state, indent=1) + "\n", encoding="utf-8")
    return count


def targets(summary: pd.DataFrame) -> dict[str, int | list[str]]:
    """How many rows have a target, how many of these hold or are open, and what those are about that fail."""
    holds = summary["holds"]
    missed = summary.loc[holds == table.FAILS, "what"].tolist()
    met, undecided = int((holds == table.HOLDS).sum()), int((holds == table.OPEN).sum())
    return {"targets": int(holds.notna().sum()), "met": met, "open": undecided, "missed": missed}


def main() -> int:
    """Exit code 2 with one sentence where the arguments or the tables are not what is needed."""
    if len(sys.argv) != 4:
        print(f"usage: {Path(sys.argv[0]).name} FRESH KEPT DATE", file=sys.stderr)
        return 2
    try:
        count = keep(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3])
    except (InputError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    print(f"{count} cases of the release {sys.argv[3]} are kept in {sys.argv[2]}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
