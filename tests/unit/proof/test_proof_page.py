"""The page of the proof opens with the numbers of one release, counted from the table that is kept."""

import re
from pathlib import Path

import pandas as pd

from rotorid_proof.path import page_table, summary

PROOF = Path(__file__).parents[3] / "docs" / "proof"
PAGE = (PROOF / "README.md").read_text(encoding="utf-8")
METHOD = (PROOF / "method.md").read_text(encoding="utf-8")
ROW = re.compile(r"^\| (flights|stands|benches) \| (\d+) of (\d+) \| (\d+) \| (\d+) \| (\d+) \|$", flags=re.MULTILINE)


def counts(cases: pd.DataFrame) -> tuple[int, ...]:
    """Of recordings with something to be named those that are right, and all; with a wrong name; clean ones, alarms."""
    hidden, clean = cases[~cases["clean"]], cases[cases["clean"]]
    named = hidden[hidden["truth"].notna() | hidden["values_true"].notna()]
    wrong = hidden["false_count"] > 0
    return int(named["right"].sum()), len(named), int(wrong.sum()), len(clean), int(clean["false_alarm"].sum())


def test_the_page_opens_with_what_the_last_release_counted() -> None:
    """What had to be named is counted apart from what had not: `test_show` compares both with the report's table."""
    cases = pd.read_csv(PROOF / "cases.csv")
    released = pd.read_csv(PROOF / "releases.csv")["released"].iloc[-1]
    last = cases[cases["released"] == released]
    (code,) = last["judged_by"].unique()
    shown = {kind: tuple(map(int, numbers)) for kind, *numbers in ROW.findall(PAGE)}
    assert shown == {f"{kind}{'es' if kind == 'bench' else 's'}": counts(own) for kind, own in last.groupby("kind")}
    right, named, _, clean, alarms = counts(last)
    assert f"**{right} of {named}**" in PAGE and f"| {clean - alarms} of {clean} " in PAGE
    assert code in PAGE and released in PAGE


def test_every_kept_table_is_in_the_method_and_every_table_that_it_lists_is_kept() -> None:
    kept = {path.name for path in PROOF.iterdir() if path.suffix in (".csv", ".tsv", ".json")}
    listed = METHOD[METHOD.index("## The files") : METHOD.index("- `holds`")]
    assert set(re.findall(r"`([\w.]+\.(?:csv|tsv|json))`", listed)) <= kept
    assert not {name for name in kept if f"`{name}`" not in METHOD and f"/{name}" not in METHOD}


def test_the_page_shows_what_is_stated_without_the_recorded_speeds() -> None:
    rows = pd.read_csv(PROOF / "concealed_speeds.csv")
    assert page_table(rows) in PAGE
    pd.testing.assert_frame_equal(pd.read_csv(PROOF / "concealed_speeds_summary.csv"), summary(rows), check_dtype=False)
