"""Scoring of planned flights: what counts as settled, and the shares over the sets that were open."""

import pandas as pd
import pytest

from rotorid.mismatch.decide.findings import Finding
from rotorid_proof.next_flight import Row, outcome_of, summary, table

IDS = ("frame_drag", "rotor_drag")


@pytest.mark.parametrize(
    ("finding", "outcome"),
    [
        (Finding("rotor_drag", "established"), "right"),
        (Finding("frame_drag", "established"), "wrong"),
        (Finding("rotor_drag", "ambiguous", alternatives=IDS), "open"),
        (Finding("rotor_drag", "suggested"), "open"),
    ],
)
def test_an_outcome_is_what_is_established_of_the_class(finding: Finding, outcome: str) -> None:
    assert outcome_of(IDS, (finding,), {"rotor_drag"})[0] == outcome


def test_what_is_untrue_beside_what_is_true_is_wrong() -> None:
    both = (Finding("rotor_drag", "established"), Finding("frame_drag", "established"))
    assert outcome_of(IDS, both, {"rotor_drag"})[0] == "wrong"
    assert outcome_of(IDS, both, {"rotor_drag", "frame_drag"})[0] == "right"


def row(case: str, outcome: str, standard: str, predicted: float, measured: float, ids: str = "a b") -> Row:
    return Row(
        case=case, truth="a", open=ids, planned_s=30.0, predicted_sigma=predicted, predicted_low=0.8 * predicted,
        predicted_high=1.2 * predicted, measured_sigma=measured, standard_sigma=measured / 2, promised=True,
        outcome=outcome, standard_outcome=standard,
    )  # fmt: skip


def test_shares_are_of_the_sets_that_were_open() -> None:
    rows = table(
        [
            row("1", "right", "open", 10.0, 9.0),
            row("2", "wrong", "right", 10.0, 30.0),
            row("3", "no plan", "", float("nan"), float("nan")),
            row("4", "", "", float("nan"), float("nan"), ids=""),
        ]
    )
    found = summary(rows).set_index("what")
    assert tuple(found.loc["settled rightly, of all open", ["count", "of"]]) == (1, 3)
    assert tuple(found.loc["settled rightly, where a flight was planned", ["count", "of"]]) == (1, 2)
    assert tuple(found.loc["settled rightly by a standard flight as long", ["count", "of"]]) == (1, 2)
    assert tuple(found.loc["prediction within a factor of 1.5", ["count", "of"]]) == (1, 2)
    assert tuple(found.loc["measured within the interval stated", ["count", "of"]]) == (1, 2)
    assert tuple(found.loc["planned at least twice as fast (squares a second)", ["count", "of"]]) == (2, 2)


def test_a_table_read_back_scores_the_same(tmp_path) -> None:
    rows = table([row("1", "right", "open", 10.0, 9.0), row("2", "no plan", "", float("nan"), float("nan"))])
    rows.to_csv(tmp_path / "rows.csv", index=False)
    again = pd.read_csv(tmp_path / "rows.csv", keep_default_na=False)
    pd.testing.assert_frame_equal(summary(again), summary(rows))
