"""A release proof goes into the kept tables once, beside what is there."""

import json
from pathlib import Path

import pandas as pd

from rotorid_proof.keep_release import keep
from tests.refusals import refused

DATE = "2026-11-26"


def tables(folder: Path, dates: list[str], right: int) -> Path:
    folder.mkdir()
    pd.DataFrame({"family": ["gust"] * len(dates), "released": dates, "right": right}).to_csv(
        folder / "families.csv", index=False
    )
    pd.DataFrame({"case": [f"multibody/gust/{d}/000" for d in dates], "released": dates, "judged_by": "ab12"}).to_csv(
        folder / "cases.csv", index=False
    )
    ids = ["single_named", *(f"multibody_{d}_right" for d in dates if d)]
    rows = {"id": ids, "what": ids, "value": float(right), "holds": ["not refuted", *["fails"] * (len(ids) - 1)]}
    pd.DataFrame(rows).to_csv(folder / "summary.csv", index=False)
    (folder / "state.json").write_text(json.dumps({"cases": 1, "released": []}))
    return folder


def test_rows_of_the_date_are_replaced_and_the_rest_stays(tmp_path):
    kept = tables(tmp_path / "kept", [""], right=0)
    for name, right in (("first", 1), ("second", 2)):
        assert keep(tables(tmp_path / name, [DATE], right), kept, DATE) == 1
    summary = pd.read_csv(kept / "summary.csv").set_index("id")["value"]
    assert summary.to_dict() == {"single_named": 0.0, f"multibody_{DATE}_right": 2.0}
    families = pd.read_csv(kept / "families.csv").fillna("")
    assert families[["released", "right"]].to_numpy().tolist() == [["", 0], [DATE, 2]]
    assert len(pd.read_csv(kept / "cases.csv")) == 2
    releases = pd.read_csv(kept / "releases.csv")
    assert releases[["released", "code"]].to_numpy().tolist() == [[DATE, "ab12"]] and releases["commit"].notna().all()
    counted = {"targets": 2, "met": 0, "open": 1, "missed": [f"multibody_{DATE}_right"]}
    assert json.loads((kept / "state.json").read_text()) == {"cases": 1, "released": [DATE], **counted}


def test_a_proof_without_the_date_is_refused(tmp_path):
    kept = tables(tmp_path / "kept", [""], right=0)
    refused("no case is of the release 2026-11-27", keep, tables(tmp_path / "fresh", [DATE], 1), kept, "2026-11-27")
