"""The next flight's proof as a reader sees it: tables as text, and the figure."""

import pandas as pd
import pytest

from rotorid_proof.next_flight import Row, summary, table
from rotorid_proof.plots import next_flight
from rotorid_proof.show import asked_of_flights, of_next_flights

ROWS = table(
    [
        Row(
            "a", "rotor_drag", "frame_drag rotor_drag", 30.0, 8.0, 6.0, 10.0, 7.0, 5.0, True, "right", "open", "", "abc"
        ),
        Row(
            "b",
            "com_offset",
            "com_offset unequal_rotors",
            30.0,
            8.0,
            6.0,
            10.0,
            0.0,
            5.0,
            True,
            "open",
            "open",
            "",
            "abc",
        ),
        Row("c", "com_offset", ""),
        Row("d", "delay", "delay motor_lag", outcome="no plan"),
    ]
)


def test_sets_that_left_nothing_open_are_not_listed() -> None:
    shown = asked_of_flights(ROWS)
    assert list(shown["truth"]) == ["rotor drag", "com offset", "delay"]
    assert list(shown["open"]) == ["frame drag or rotor drag", "com offset or unequal rotors", "delay or motor lag"]
    assert list(shown["predicted"]) == ["8.0", "8.0", ""]


def test_shares_are_said_with_their_counts() -> None:
    shown = of_next_flights(summary(ROWS)).set_index("what")
    assert shown.loc["settled rightly, of all open", "count"] == "1 of 3"
    assert shown.loc["prediction within a factor of 1.5", "share"] == "50 %"
    assert not shown["share"].str.contains("nan").any()


@pytest.mark.parametrize("rows", [ROWS, ROWS[2:]])
def test_the_figure_is_drawn_with_and_without_flights(rows: pd.DataFrame, tmp_path) -> None:
    fig = next_flight(rows)
    fig.savefig(tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 3000
    drawn = [t.get_text() for t in (fig.axes[0].get_legend().get_texts() if fig.axes[0].get_legend() else [])]
    assert ("settled rightly" in drawn) == (len(rows) == 4)
