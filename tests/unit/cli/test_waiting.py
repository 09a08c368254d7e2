"""How long is left: never a number that nothing speaks for."""

import json

import pytest

from rotorid.cli import console
from rotorid.cli.console import SOON_S, Waiting, keep, read_record, time_left, words_left
from rotorid.steps import heard_by, step

RUN = [("", 4.0), ("flight/prepare", 2.0), ("flight/search", 10.0), ("flight/search", 10.0), ("draw", 4.0)]


class Clock:
    """Seconds that pass when a test says so."""

    def __init__(self):
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def slower(by: float) -> list[tuple[str, float]]:
    return [(name, by * seconds) for name, seconds in RUN]


def test_without_earlier_runs_no_number_is_shown() -> None:
    for known in ([], [RUN], [RUN, RUN]):
        assert time_left(known, RUN[:2], "flight/search", 1.0) is None
    assert words_left(None) == ""


def test_while_it_reads_no_number_is_shown() -> None:
    assert time_left([RUN] * 5, [], "", 3.0) is None


def test_the_rest_goes_as_in_earlier_runs_at_the_pace_of_now() -> None:
    assert time_left([RUN] * 3, RUN[:2], "flight/search", 4.0) == pytest.approx(20.0, rel=0.05)
    measured = [*slower(3.0)[:3]]
    then = time_left([RUN] * 3, measured, "flight/search", 0.0)
    assert then == pytest.approx(30.0 + 4.0 * 3.0**console.UNMET, rel=0.05)


def test_a_step_that_takes_longer_than_ever_renews_the_estimate() -> None:
    told = [time_left([RUN] * 3, RUN[:2], "flight/search", spent) for spent in (5.0, 30.0, 100.0)]
    assert told == sorted(told) and told[0] < told[-1]


def test_runs_that_disagree_say_nothing() -> None:
    long = [*RUN[:3], *[("flight/search", 10.0)] * 20, RUN[-1]]
    assert time_left([RUN, RUN, RUN, long, long], RUN[:3], "flight/search", 1.0) is None


def test_the_runs_most_alike_are_asked() -> None:
    other = [("", 4.0), ("stand/prepare", 1.0), ("draw", 1.0)]
    known = [*[other] * 9, *[RUN] * 5]
    assert time_left(known, RUN[:3], "flight/search", 0.0) == time_left([RUN] * 5, RUN[:3], "flight/search", 0.0)


def test_what_ends_soon_is_said_in_words() -> None:
    assert time_left([RUN] * 3, RUN[:-1], "draw", 3.0) == SOON_S
    assert [words_left(s) for s in (SOON_S, 43.0, 150.0)] == [
        "; a few seconds left",
        "; about 40 s left",
        "; about 2 min left",
    ]


def test_the_line_has_time_step_and_what_is_left() -> None:
    clock = Clock()
    shown = Waiting([RUN] * 3, clock=clock)
    assert shown.line() == "     0 s  reading"
    with heard_by(shown.heard):
        clock.now += 4.0
        with step("flight"), step("prepare"):
            clock.now += 2.0
            assert shown.line() == "     6 s  flight: prepare; about 20 s left"
        assert shown.path == ()
    assert [seconds for name, seconds in shown.done if name == "flight/prepare"] == [2.0]


def test_without_a_terminal_lines_are_few() -> None:
    clock, said = Clock(), []
    shown = Waiting([], said.append, clock)
    for number in range(100):
        clock.now += 1.0
        shown.heard((f"step {number}",))
    assert 8 <= len(said) <= 11 and said[0] == "     1 s  step 0"


def test_the_record_holds_the_last_runs_and_survives_what_is_broken() -> None:
    for _ in range(console.KEPT + 3):
        keep("verdict", RUN)
    record = read_record()
    assert len(record["verdict"]) == console.KEPT and record["verdict"][0] == RUN
    good = json.loads(console.record_file().read_text())
    outdated, negative = good | {"version": "0"}, good | {"runs": {"a": [[["b", -1]]]}}
    for text in ("", "[]", '{"runs": 3}', json.dumps(outdated), json.dumps(negative)):
        console.record_file().write_text(text)
        assert read_record() == {}
    keep("verdict", RUN)
    assert read_record() == {"verdict": [RUN]}


def test_a_record_that_cannot_be_written_stops_nothing(monkeypatch, tmp_path) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setattr(console, "record_file", lambda: tmp_path / "file" / "waiting.json")
    keep("verdict", RUN)
    assert read_record() == {}


def test_steps_are_told_from_outside_in_and_end_on_errors() -> None:
    paths = []

    @step("inner")
    def fails() -> None:
        raise ValueError

    with heard_by(paths.append), pytest.raises(ValueError), step("outer"):
        fails()
    assert paths == [("outer",), ("outer", "inner"), ("outer",), ()]
