"""A fleet's vehicles over their flights: a change is reported at the set in which it begins, once."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import pandas as pd

from rotorid.recordings import RecordingSet, write_set
from rotorid.recordings.templates import read
from rotorid.report.fleet import change_points, history, sets_of_vehicles, shown_by, vehicle_page
from rotorid.report.plots.mismatch import draw_history
from rotorid.vehicle.control import swings
from workflow.scripts import fleet_history

DAYS = 6
HEAVIER_FROM = 5


def flown(day: int) -> RecordingSet:
    """A day's flight of the thesis's vehicle, a tenth heavier from the fifth day on, with the vehicle as believed."""
    believed = read("thesis")
    mass = believed.mass_kg * (1.1 if day >= HEAVIER_FROM else 1.0)
    recorded = swings(believed.model_copy(update={"mass_kg": mass}), f"heron-2026-10-0{day}", 14.0, 1, day)
    return replace(recorded, vehicle=believed, held_out=None)


@cache
def made() -> tuple[pd.DataFrame, pd.DataFrame]:
    """Tables of the numbers and events of that vehicle."""
    return history({"heron": [flown(day) for day in range(1, DAYS + 1)]}, good=3)


def test_the_heavier_vehicle_is_the_one_event_at_the_day_it_begins():
    _, events = made()
    (event,) = events.to_dict("records")
    assert event["set"] == "heron-2026-10-05" and event["day"] == "2026-10-05" and event["lasts"] == 2
    assert event["id"] == "lift/all"
    assert event["sentence"].startswith("heron, from heron-2026-10-05 on: ") and "heavier" in event["sentence"]


def test_a_second_change_is_an_event_of_its_own_and_the_first_ends_there():
    def weak(day: int, factor: float) -> RecordingSet:
        own = flown(day)
        speed = "rotor_speed_2_rad_s"
        runs = tuple(replace(r, table=r.table.assign(**{speed: factor * r.table[speed]})) for r in own.runs)
        return replace(own, runs=runs)

    sets = [flown(1), flown(2), flown(3), weak(4, 1.1), replace(weak(3, 1.1), name="heron-2026-10-07")]
    points = change_points(shown_by(sets, 2, print), 2)
    assert [point[:2] for point in points] == [("heron-2026-10-04", 2)]
    assert points[0][2][0].quantity.key in ("share/2", "trim/roll", "trim/pitch")
    mended = [*sets, *(replace(flown(day), name=f"heron-2026-11-0{day}") for day in (5, 6))]
    points = change_points(shown_by(mended, 2, print), 2)
    assert [point[:2] for point in points] == [("heron-2026-10-04", 2), ("heron-2026-11-05", 2)]
    (*_, before), (*_, after) = points
    # The rotor is as it was: its trims go back.
    back = {d.quantity.key: d.value for d in after}
    there = {d.quantity.key: d.value for d in before}
    assert back["trim/roll"] * there["trim/roll"] < 0


def test_a_set_without_what_the_first_ones_have_is_left_out_with_a_line():
    lacking = replace(
        flown(4), runs=tuple(replace(r, table=r.table.filter(regex="^(?!angular_velocity)")) for r in flown(4).runs)
    )
    said: list[str] = []
    shown = shown_by([flown(1), flown(2), lacking, flown(3)], 2, said.append)
    assert list(shown) == [flown(k).name for k in (1, 2, 3)]
    assert said == [f"{lacking.name} is left out: it lacks flight or columns that the first sets have"]


def test_every_later_set_has_its_numbers_with_intervals():
    numbers, _ = made()
    assert list(dict.fromkeys(numbers["set"])) == [f"heron-2026-10-0{day}" for day in range(1, 7)]
    assert (numbers["good"] == (numbers["day"] < "2026-10-04")).all() and (numbers["limit"] > 0).all()
    lift = numbers.pivot(index="set", columns="name", values="change")["lift/all"]
    assert abs(lift["heron-2026-10-04"]) < 2.0
    assert 8.0 < lift["heron-2026-10-06"] < 12.0 and set(numbers["unit"]) >= {"%"}
    assert (numbers["low_95"] < numbers["high_95"]).all()


def test_the_history_is_drawn(tmp_path: Path):
    draw_history(*made(), tmp_path / "history.svg")
    assert "heron" in (tmp_path / "history.svg").read_text(encoding="utf-8")


def test_a_vehicle_has_a_page_with_its_events_and_every_quantity(tmp_path: Path):
    numbers, events = made()
    (tmp_path / "heron.html").write_text(vehicle_page("heron <1>", numbers, events), encoding="utf-8")
    page = (tmp_path / "heron.html").read_text(encoding="utf-8")
    assert "heron &lt;1&gt;" in page and "6 sets, from heron-2026-10-01 to heron-2026-10-06" in page
    assert page.count("<svg") == 1 and "heron, from heron-2026-10-05 on: " in page
    assert fleet_history.file_of("a/b c") == "a-b-c"


def test_sets_are_ordered_by_vehicle_and_day_and_a_broken_one_is_named(tmp_path: Path):
    for day in (2, 1):
        write_set(flown(day), tmp_path)
    (tmp_path / "broken-2026-10-03").mkdir()
    (tmp_path / "broken-2026-10-03" / "vehicle.yaml").write_text("name: x\n", encoding="utf-8")
    said: list[str] = []
    found = sets_of_vehicles(list(tmp_path.iterdir()), said.append)
    assert {v: [s.name for s in own] for v, own in found.items()} == {
        flown(1).vehicle.name: ["heron-2026-10-01", "heron-2026-10-02"]
    }
    assert len(said) == 1 and said[0].startswith("broken-2026-10-03 is left out: ")


def test_a_vehicle_whose_first_sets_believe_different_things_is_left_out_with_a_line():
    first, second = flown(1), flown(2)
    other = replace(second, vehicle=second.vehicle.model_copy(update={"mass_kg": 2.0 * second.vehicle.mass_kg}))
    said: list[str] = []
    numbers, events = history({"heron": [first, other, flown(3)]}, good=2, left_out=said.append)
    assert numbers.empty and events.empty
    masses = f"{other.vehicle.mass_kg:g}, that of heron-2026-10-01 {first.vehicle.mass_kg:g}"
    assert said == [
        f"heron is left out: heron-2026-10-02/vehicle.yaml: mass_kg is {masses}; expected one vehicle in all good sets"
    ]
