"""The page of the proof opens with the numbers of one release, counted from the table that is kept."""

import re
from pathlib import Path

import pandas as pd

from rotorid_proof.path import page_table, summary

PROOF = Path(__file__).parents[3] / "docs" / "proof"
PAGE = (PROOF / "README.md").read_text(encoding="utf-8")
METHOD = (PROOF / "method.md").read_text(encoding="utf-8")
ROW = re.compile(
    r"^\| (flights|stands|benches|all) \| (\d+) \| (\d+) \| (\d+) \| (\d+) \| (\d+) \|$", flags=re.MULTILINE
)


def counts(cases: pd.DataFrame) -> tuple[int, ...]:
    """Recordings with something hidden, right, with a wrong name; with nothing hidden, alarms."""
    hidden, clean = cases[~cases["clean"]], cases[cases["clean"]]
    wrong = hidden["false_count"] > 0
    return len(hidden), int(hidden["right"].sum()), int(wrong.sum()), len(clean), int(clean["false_alarm"].sum())


def test_the_page_opens_with_what_the_last_release_counted() -> None:
    cases = pd.read_csv(PROOF / "cases.csv")
    released = pd.read_csv(PROOF / "releases.csv")["released"].iloc[-1]
    last = cases[cases["released"] == released]
    (code,) = last["judged_by"].unique()
    shown = {kind: tuple(map(int, numbers)) for kind, *numbers in ROW.findall(PAGE)}
    expected = {f"{kind}{'es' if kind == 'bench' else 's'}": counts(own) for kind, own in last.groupby("kind")}
    assert shown == expected | {"all": counts(last)}
    hidden, right, *_ = counts(last)
    assert f"Of {hidden} recordings with something hidden" in PAGE.partition("\n\n")[2][:60]
    assert f"**{right} were right as a whole**" in PAGE and code in PAGE and released in PAGE


def test_every_kept_table_is_in_the_method_and_every_table_that_it_lists_is_kept() -> None:
    kept = {path.name for path in PROOF.iterdir() if path.suffix in (".csv", ".tsv", ".json")}
    listed = METHOD[METHOD.index("## The files") : METHOD.index("- `holds`")]
    assert set(re.findall(r"`([\w.]+\.(?:csv|tsv|json))`", listed)) <= kept
    assert not {name for name in kept if f"`{name}`" not in METHOD and f"/{name}" not in METHOD}


def test_the_page_shows_what_is_stated_without_the_recorded_speeds() -> None:
    rows = pd.read_csv(PROOF / "concealed_speeds.csv")
    assert page_table(rows) in PAGE
    pd.testing.assert_frame_equal(pd.read_csv(PROOF / "concealed_speeds_summary.csv"), summary(rows), check_dtype=False)
