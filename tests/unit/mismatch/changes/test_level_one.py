"""What differs between flights before any cause is sought, and what is said of it."""

from dataclasses import replace

import numpy as np
import pytest

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.changes.compare import Change, explaining, predicted
from rotorid.mismatch.changes.level_one import (
    BUDGET,
    CAUSES,
    FALSE_ALARMS,
    SCATTER,
    LevelOne,
    flights_of,
    level_one,
    of_one_vehicle,
    usual_scatter,
)
from rotorid.mismatch.changes.problem import NAMES
from rotorid.mismatch.changes.quantities import KINDS
from rotorid.mismatch.changes.words import level_one_sentences
from rotorid.mismatch.decide.status import Estimate
from rotorid.recordings import RecordingSet, Run
from rotorid.recordings import columns as c
from rotorid.recordings.run import Doubt
from tests.refusals import refused
from tests.unit.mismatch.flights import Flight, controlled, quad, with_table


def flights(name: str, numbers: range, **options) -> RecordingSet:
    """Flights of one vehicle."""
    runs = tuple(Flight(k, 12.0, drag=0.6, **options).record(100.0, name=f"run0{k}") for k in numbers)
    return RecordingSet(name, quad(), runs)


def scaled(own: RecordingSet, factors: dict[str, float]) -> RecordingSet:
    """A set with some columns times a factor."""
    runs = tuple(replace(r, table=r.table.assign(**{k: r.table[k] * f for k, f in factors.items()})) for r in own.runs)
    return replace(own, runs=runs)


@pytest.fixture(scope="module")
def good() -> RecordingSet:
    return flights("good", range(1, 5))


@pytest.fixture(scope="module")
def later() -> RecordingSet:
    return flights("later", range(5, 9))


def keys(found: LevelOne) -> list[str]:
    return [d.quantity.key for d in found.stated]


def weaker(own: RecordingSet, rotor: int, by: float) -> RecordingSet:
    """The same motion by a rotor that gives less: it turns faster."""
    return scaled(own, {f"rotor_speed_{rotor}_rad_s": (1.0 - by) ** -0.5})


def test_other_flights_of_the_same_vehicle_differ_in_nothing(good, later):
    found = level_one(good, later)
    assert not found.stated
    (sentence,) = level_one_sentences(found)
    assert "no trim, share of a rotor or sensor differs" in sentence and "19 of 20" in sentence


@pytest.mark.parametrize("rotor", [1, 3])
def test_a_weaker_rotor_is_stated_at_that_rotor_with_both_causes(good, later, rotor):
    found = level_one(good, weaker(later, rotor, 0.15))
    first = next(d for d in found.stated if d.quantity.kind == "share")
    assert first.quantity.member == str(rotor)
    low, high = first.interval()
    # Of four alike one is asked for 1/0.85 as much, over the mean of all four.
    true = (1 / 0.85) / (1 + (1 / 0.85 - 1) / 4) - 1
    assert low < true < high
    sentence = next(s for s in level_one_sentences(found) if s.startswith(f"Rotor {rotor} is asked for"))
    assert "it gives less thrust, or there is more weight near it" in sentence and "4 good flights" in sentence


def test_more_weight_is_stated_with_its_size_and_a_lighter_believed_vehicle_is_no_share(good, later):
    heavier = scaled(later, {f"rotor_speed_{i}_rad_s": np.sqrt(1.1) for i in range(1, 5)})
    found = level_one(good, heavier)
    assert keys(found) == ["lift/all"]
    low, high = found.stated[0].interval()
    assert low < np.log(1.1) < high


def test_a_turned_accelerometer_is_stated_along_its_axis(good, later):
    angle = np.deg2rad(2.0)

    def turned(run: Run) -> Run:
        x, y, z = run.array(c.SPECIFIC_FORCE).T
        columns = dict(zip(c.SPECIFIC_FORCE, (x, y - angle * z, z + angle * y), strict=True))
        return replace(run, table=run.table.assign(**columns))

    found = level_one(good, replace(later, runs=tuple(turned(run) for run in later.runs)))
    assert set(keys(found)) <= {"sideways/y", "accelerometer/y"} and keys(found)
    assert found.stated[0].value == pytest.approx(angle, abs=0.01)


def test_a_value_that_both_proposals_scale_otherwise_cancels(good, later):
    """A coefficient that nobody measured moves no share, no trim and no scatter."""
    vehicle = quad(thrust_coefficient_n_s2=2.0 * 1.3877e-6)
    plain = level_one(good, weaker(later, 2, 0.15))
    other = level_one(replace(good, vehicle=vehicle), weaker(replace(later, vehicle=vehicle), 2, 0.15))
    sizes = [{d.quantity.key: d.value for d in found.differences} for found in (plain, other)]
    assert sizes[0]["share/2"] == pytest.approx(sizes[1]["share/2"], rel=1e-6)
    assert sizes[0]["lift/all"] == pytest.approx(sizes[1]["lift/all"], rel=1e-6)


def test_two_sets_get_one_number_for_what_was_only_proposed(good, later):
    def guess(own: RecordingSet, coefficient: float) -> RecordingSet:
        doubt = Doubt("thrust_coefficient_n_s2", "only proposed.", stops=False)
        return replace(own, vehicle=quad(thrust_coefficient_n_s2=coefficient), proposed=(doubt,))

    first, second = of_one_vehicle((guess(good, 1e-6), guess(later, 2e-6)))
    assert first.vehicle == second.vehicle and first.vehicle.thrust_coefficient_n_s2 == 1e-6
    first, second = of_one_vehicle((guess(good, 1e-6), later))
    assert first.vehicle.thrust_coefficient_n_s2 == later.vehicle.thrust_coefficient_n_s2 == 1.3877e-6
    assert of_one_vehicle((good, later)) == (good, later)


def test_stretches_of_one_log_are_one_flight():
    def named(name: str, *runs: str) -> RecordingSet:
        return RecordingSet(name, quad(), tuple(Run(run, None) for run in runs))

    assert flights_of(named("set", "log04_1", "log04_2", "log05")) == ["log04", "log04", "log05"]
    assert flights_of(named("set", "run_1", "run_2")) == ["run_1", "run_2"]
    assert flights_of(named("log", "log_1", "log_2")) == ["log", "log"]


def test_the_table_can_leave_a_laboratory_out_and_no_yardstick_is_below_another():
    laboratories = {row[1] for row in SCATTER}
    for usual in (usual_scatter(), *(usual_scatter(name) for name in laboratories)):
        assert usual.keys() == KINDS.keys()
        assert all(u.most >= u.sd > 0 and u.freedom >= 2 for u in usual.values())
    assert usual_scatter("NeuroBEM")["share"] != usual_scatter()["share"]


def test_one_flight_against_one_is_held_against_the_usual_scatter(good, later):
    one = replace(good, runs=good.runs[:1]), replace(weaker(later, 1, 0.04), runs=later.runs[:1])
    found = level_one(one[0], replace(one[1], runs=weaker(later, 1, 0.04).runs[:1]))
    share = next(d for d in found.differences if d.quantity.key == "share/1")
    assert not share.stated and share.smallest > 0.04 and share.scatter > 0.01
    assert share.false_alarms > FALSE_ALARMS


def test_a_while_with_idle_rotors_does_not_move_the_shares(good, later):
    """Shares are divided by the rotors' mean thrust, which is next to nothing there."""

    def idle(table) -> None:
        table.loc[200:260, [f"rotor_speed_{i}_rad_s" for i in range(1, 5)]] = [1.0, 0.01, 0.01, 0.01]

    found = level_one(good, with_table(later, idle))
    assert all(abs(d.value) < 0.2 for d in found.differences if d.quantity.kind == "share")
    assert not [d for d in found.stated if d.quantity.kind == "share"]


def test_other_numbers_of_rotors_and_no_stretch_are_one_sentence(good, later):
    short = with_table(later, lambda t: t.iloc[:50].reset_index(drop=True))
    refused("set later: no stretch of flight", level_one, good, short)
    fewer = replace(later, vehicle=quad(rotors=list(quad().model_dump()["rotors"])[:3]))
    refused("3 rotors, expected 4", level_one, good, fewer)


def change(name: str, **sizes: float) -> Change:
    return Change(name, "established", (), 0.999, tuple(Estimate(k, v, "", v, v) for k, v in sizes.items()))


def test_a_name_that_contradicts_the_trims_is_refused_and_one_that_predicts_them_explains(good, later):
    found = level_one(good, weaker(later, 3, 0.15))
    right = change("unequal_rotors", d_3=-0.15)
    # Far to the front right, where rotor 3 is at the rear left.
    wrong = change("com_offset", r_x=0.03, r_y=0.03)
    left, refused, explained = explaining([right], found, later.vehicle)
    assert left == [right] and not refused and explained["share/3"] == ("unequal_rotors",)
    left, refused, explained = explaining([wrong], found, later.vehicle)
    assert not left and refused == [wrong] and not explained
    left, refused, _ = explaining([right, wrong], found, later.vehicle)
    assert left == [right] and refused == [wrong]


def test_of_what_predicts_too_much_together_the_suggested_goes(good, later):
    """Before, the larger part went: a payload that is established, because of a thrust that is only suggested."""
    found = level_one(good, weaker(later, 3, 0.15))
    established = change("unequal_rotors", d_3=-0.15)
    suggested = replace(change("unequal_rotors", d_3=-0.12), status="suggested")
    left, refused, _ = explaining([established, suggested], found, later.vehicle)
    assert left == [established] and refused == [suggested]


def test_every_kind_has_its_causes_its_share_of_the_false_alarms_and_ids_that_exist():
    assert CAUSES.keys() == BUDGET.keys() == KINDS.keys()
    assert {i for own in CAUSES.values() for i in own} <= catalogue().keys() | set(NAMES.values())


def test_what_changes_predict_has_the_sign_of_what_is_seen(good, later):
    assert predicted(change("mass_kg", mass_kg=0.1), quad())["lift/all"] == pytest.approx(np.log(1.1))
    assert predicted(change("thrust_coefficient_n_s2", thrust_coefficient_n_s2=0.1), quad())["lift/all"] < 0
    offset = predicted(change("com_offset", r_x=-0.005, r_y=0.0), quad())
    assert offset.keys() == {"trim/pitch"} and offset["trim/pitch"] > 0
    moved = quad(rotors=[r | {"x_m": r["x_m"] - 0.02} for r in quad().model_dump()["rotors"]])
    seen = level_one(good, replace(later, vehicle=moved))
    pitch = next(d for d in seen.stated if d.quantity.key == "trim/pitch")
    assert pitch.value == pytest.approx(predicted(change("com_offset", r_x=-0.02), moved)["trim/pitch"], rel=0.2)


def under_control(seeds: range, **options) -> RecordingSet:
    """Flights under a controller."""
    return RecordingSet("controlled", quad(), tuple(controlled(k, name=f"run{k}", **options) for k in seeds))


def test_what_disturbances_do_in_a_hover_is_no_drag_and_noise_no_scale():
    """In a hover forces move the vehicle, and the gyroscope reads its own noise: both have slopes that mean nothing."""
    hover, moving = under_control(range(1, 4)), under_control(range(4, 5), away_m=0.6)
    found = level_one(hover, moving)
    assert not found.stated
    slopes = [d for d in found.differences if d.quantity.kind in ("drag", "gyroscope_scale")]
    assert len(slopes) == 3 and max(abs(d.value) for d in slopes) > 0.1
    assert all(d.interval()[0] < 0 < d.interval()[1] for d in slopes)


def test_a_drag_that_motion_shows_is_stated():
    good, new = under_control(range(1, 4), away_m=3.0), under_control(range(4, 6), away_m=3.0, drag=1.0)
    (first, *_) = level_one(good, new).stated
    low, high = first.interval()
    assert first.quantity.kind == "drag" and high < 0 and first.feigned > 0
