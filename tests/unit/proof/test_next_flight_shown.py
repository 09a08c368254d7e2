"""The next flight's proof as a reader sees it: tables as text."""

from rotorid_proof.next_flight import Row, summary, table
from rotorid_proof.show import of_next_flights

ROWS = table(
    [
        Row(
            "a", "rotor_drag", "frame_drag rotor_drag", 30.0, 8.0, 6.0, 10.0, 7.0, 5.0, True, "right", "open", "", "abc"
        ),
        Row(
            "b", "com_offset", "com_offset unequal_rotors", 30.0, 8.0, 6.0, 10.0, 0.0, 5.0, True, "open", "open", "",
            "abc",
        ),
        Row("c", "com_offset", ""),
        Row("d", "delay", "delay motor_lag", outcome="no plan"),
    ]
)  # fmt: skip


def test_shares_are_said_with_their_counts() -> None:
    shown = of_next_flights(summary(ROWS)).set_index("what")
    assert shown.loc["settled rightly, of all open", "count"] == "1 of 3"
    assert shown.loc["prediction within a factor of 1.5", "share"] == "50 %"
    assert not shown["share"].str.contains("nan").any()
