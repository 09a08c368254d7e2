"""Numbers and sentences as they are read."""

import pytest

from rotorid.mismatch.decide.findings import Finding
from rotorid.mismatch.decide.words import channel_words, listed, number, percent_words, plus_minus, regime_words, sure
from rotorid.mismatch.tell.sentences import _left_out, unexplained_words


@pytest.mark.parametrize(
    ("value", "low", "high", "text"),
    [
        (5.1e-5, 4.9e-5, 5.3e-5, "5.10e-5 ± 0.20e-5"), (5.1e-5, 4.7e-5, 5.5e-5, "5.1e-5 ± 0.4e-5"),
        (0.652, 0.647, 0.657, "0.652 ± 0.005"), (1.0, 1.0, 1.0, "1.00"), (1e-3, -5.0, 5.0, "not determined"),
    ],
)  # fmt: skip
def test_value_and_interval_end_at_the_same_place(value, low, high, text):
    assert plus_minus(value, low, high) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.412, "0.41"), (9.96, "10"), (1234.0, "1200"), (8.08e-6, "8.1e-6"), (0, "0"), (None, "unknown")],
)
def test_number(value, text):
    assert number(value) == text


def test_words():
    assert channel_words("force_y") == "sideways force"
    assert channel_words("rotor_speed_3") == "speed of rotor 3"
    assert regime_words("cargo_bay_temperature_c") == ("cargo bay temperature", "°C")
    assert listed(["a", "b", "c"], "or") == "a, b or c"
    assert sure(1e-9) == "more than 99.9 % sure" and sure(0.02) == "98.0 % sure"


def test_a_fault_of_the_recording_was_not_left_out():
    said = "The rotor columns are in another order than vehicle.yaml: put in order."
    told = _left_out(Finding(id="rotor_order", status="established", sentence=said), None)
    assert told == f"Rotor columns in the wrong order: {said}"


@pytest.mark.parametrize(
    ("share", "words"), [(0.19, "19 % stays unexplained"), (0.996, "that explains less than 1 % of it")]
)
def test_of_causes_that_explain_next_to_nothing_it_is_said(share, words):
    """`Ground effect was left out; 100 % stays unexplained` contradicts itself."""
    assert unexplained_words(share) == words


def test_a_share_beyond_the_whole_is_a_plain_number():
    shown = [percent_words(x) for x in (0.0084, 0.21, 0.999, 5.2, 1.049)]
    assert shown == ["0.84 %", "21 %", "100 %", "520 %", "100 %"]
