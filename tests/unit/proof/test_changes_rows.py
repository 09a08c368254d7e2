"""Scoring of comparisons: what counts as named, as wrong and as inside, and the shares by kind."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rotorid.mismatch.changes.compare import Change, Changes
from rotorid.mismatch.decide.status import Estimate
from rotorid.recordings import RecordingSet, Run
from rotorid_proof.changes import pairs
from rotorid_proof.changes.score import Sought, halves, row_of, some_runs, summary, table
from tests.unit.mismatch.flights import Flight


def change(effect: str, *others: str, value: float = 1.0, status: str = "established") -> Change:
    size = Estimate("k", value, "1", value - 0.1, value + 0.1)
    return Change(effect, "ambiguous" if others else status, (effect, *others) if others else (), 0.995, (size,))


def changes(*found: Change) -> Changes:
    return Changes("base", "new", found, (), (), ({}, {}))


def row(sought: list[Sought], *found: Change, fair: tuple[str, ...] = ()):
    return row_of("pair", "drawn", changes(*found), sought, fair)


DRAG = Sought("rotor_drag", sizes={"k": 1.05})


def test_a_change_is_named_alone_or_in_a_class_and_its_size_is_compared() -> None:
    alone, in_class = row([DRAG], change("rotor_drag")), row([DRAG], change("frame_drag", "rotor_drag"))
    assert alone.right and (alone.named, alone.inside, alone.compared) == (1, 1, 1)
    assert in_class.right and in_class.named == 1 and in_class.compared == 0
    assert not row([DRAG], change("rotor_drag", status="suggested")).right


def test_a_claim_of_what_did_not_change_is_wrong_unless_it_is_fair() -> None:
    assert row([], change("gust")).wrong == "gust" and not row([], change("gust")).right
    assert row([], change("gust"), fair=("gust",)).right
    assert row([DRAG], change("rotor_drag"), change("gust")).wrong == "gust"
    assert row([]).right


def test_what_is_too_small_to_be_found_may_be_left_unsaid_but_not_misnamed() -> None:
    small = Sought("rotor_drag", must=False)
    assert row([small]).right and row([small]).changed == ""
    assert row([small], change("rotor_drag")).changed == "rotor_drag"
    assert not row([small], change("gust")).right


def test_the_summary_counts_by_kind() -> None:
    rows = [row([DRAG], change("rotor_drag")), row([DRAG]), row([]), row([], change("gust"))]
    counted = summary(pd.DataFrame(table(rows))).set_index("what")
    assert counted.loc["nothing changed: a change claimed", ["count", "of"]].tolist() == [1, 2]
    assert counted.loc["something changed: right as a whole", ["count", "of"]].tolist() == [1, 2]
    assert counted.loc["changes named", "share"] == pytest.approx(0.5)


def recorded() -> RecordingSet:
    own = Flight(1, 4.0)
    return RecordingSet("set", own.vehicle, (own.record(100.0, name="a"), own.record(100.0, name="b")))


def test_halves_hold_every_row_once() -> None:
    whole = recorded()
    first, second = halves(whole)
    for run, a, b in zip(whole.runs, first.runs, second.runs, strict=True):
        assert np.array_equal(np.concatenate([a.time_s, b.time_s]), run.time_s)
        assert abs(len(a.time_s) - len(b.time_s)) <= 1
    assert [type(r) for r in some_runs(whole, ["b"]).runs] == [Run]


def test_a_flight_that_could_not_be_had_gives_no_pair(tmp_path: Path) -> None:
    """Before: the folder that holds the reason alone was taken for a set."""
    plantings = tmp_path / "plantings.tsv"
    plantings.write_text("planting\narpl-10/values/mass/large/0\narpl-15/values/mass/large/0\n")
    for name in ("crazyflie-arpl-log10", "crazyflie-arpl-log15"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "import_report.json").write_text('{"available": false}')
    (tmp_path / "crazyflie-arpl-log15" / "vehicle.yaml").write_text("name: x\n")
    assert {pair.name.split("/")[1] for pair in pairs.planted(tmp_path, plantings)} == {"arpl-15"}
