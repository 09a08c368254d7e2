"""What changed between two sets of flights of one vehicle. A payload on a cable that the second set alone carries."""

import json
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.constants import g
from threadpoolctl import threadpool_info, threadpool_limits

from rotorid.effects.catalogue import catalogue
from rotorid.errors import InputError
from rotorid.mismatch.changes.compare import Change, Changes, changes_between, in_percent, price_of, regime_notes
from rotorid.mismatch.changes.joint import FARTHER, joints_of, lasting_effects, moved_by, reference_of, slower
from rotorid.mismatch.changes.level_one import as_one
from rotorid.mismatch.changes.words import as_json, sentences
from rotorid.mismatch.decide.problem import Prior
from rotorid.mismatch.decide.status import Estimate
from rotorid.recordings import RecordingSet, Vehicle, write_set
from rotorid.recordings import columns as c
from rotorid.report.page import make_changes_page
from tests.command_line import answer, refusal
from tests.refusals import refused
from tests.unit.mismatch.flights import Flight, recorded


def flights(name: str, numbers: tuple[int, ...], drag: float = 0.6) -> RecordingSet:
    """Flights of a vehicle whose drag its vehicle.yaml does not hold: what both sets lack is no change."""
    own = {f"run0{k}": Flight(k, 12.0, drag=drag) for k in numbers}
    runs = tuple(flight.record(100.0, name=run) for run, flight in own.items())
    return RecordingSet(name, own[f"run0{numbers[0]}"].vehicle, runs)


def lighter(vehicle: Vehicle, factor: float) -> Vehicle:
    """The same vehicle believed to be lighter by a factor."""
    return vehicle.model_copy(update={"mass_kg": vehicle.mass_kg / factor})


@cache
def monday() -> RecordingSet:
    """The flights that were good."""
    return flights("monday", (1, 2))


@cache
def compared(case: str) -> Changes:
    """Monday's flights against Friday's."""
    new = flights("friday", (3, 4), drag=2.4 if case == "dragging" else 0.6)
    if case == "believed lighter":
        new = replace(new, vehicle=lighter(new.vehicle, 1.1))
    return changes_between(monday(), new)


def sure(found: Changes) -> list[Change]:
    """What surely changed."""
    return [c for c in found.changes if c.status in ("established", "ambiguous")]


def test_between_two_days_of_one_vehicle_nothing_changed_though_both_lack_a_drag():
    found = compared("same")
    assert sure(found) == []
    limits = {x.id: x.at_most for x in found.limits}
    assert {"mass_kg", "thrust_coefficient_n_s2", "inertia_xx_kg_m2"} <= limits.keys()
    assert 0.0 < limits["mass_kg"] < 0.05
    first, second, *_ = sentences(found)
    assert first.startswith("From monday to friday no trim") and "Stated in 19 of 20" in first
    assert second.startswith("Nothing changed from monday to friday")


def test_a_vehicle_that_is_heavier_than_its_file_says_is_told_by_how_much():
    """True mass 10 % more than the second vehicle.yaml has it; mass and thrust coefficient are one ratio."""
    (change,) = sure(compared("believed lighter"))
    assert {change.id, *change.alternatives} & {"mass_kg", "thrust_coefficient_n_s2"}
    (size,) = change.parameters
    true = {"mass_kg": 0.1, "thrust_coefficient_n_s2": 1 / 1.1 - 1}[change.id]
    assert size.value == pytest.approx(true, abs=0.02) and size.low < true < size.high


def test_a_larger_drag_is_the_one_change():
    (change,) = sure(compared("dragging"))
    assert "rotor_drag" in {change.id, *change.alternatives}


def test_columns_are_taken_at_accelerations_that_hold_what_the_first_set_has():
    """What a mass or a lever arm does is proportional to all of an acceleration: of a drag, too."""
    reference = reference_of(monday())
    model = reference.found.model
    assert [form.name for form, _ in lasting_effects(model)] == [k.split("/")[1] for k in model.selection.active]
    at = columns_of_sideways_force(reference, "payload/rigid")
    drag = np.concatenate([r.y[:, 0] for r in reference.rows])
    # A payload is slowed by the drag as the vehicle is: F = -m_p a.
    assert np.corrcoef(at, -drag)[0, 1] > 0.8


def columns_of_sideways_force(reference, key: str) -> np.ndarray:
    """First column of a term in the forward force, all stretches."""
    start = reference.evidence.start[key]
    return np.concatenate([r.x[:, 0, start] for r in reference.rows])


def test_what_changed_moves_the_second_set_alone():
    reference = reference_of(monday())
    (joint,) = joints_of(reference, flights("friday", (3, 4)))
    rigid = next(f for f in catalogue()["payload"].forms(joint.recordings.vehicle) if f.name == "rigid")
    moved = moved_by(reference, joint, [(rigid, np.array([0.1 * joint.recordings.vehicle.mass_kg, 0.0, 0.0, 0.0]))])
    start = joint.new.start["payload/rigid"]
    assert np.array_equal(moved.base.gram, joint.base.gram)
    before, now = (own.new.gram[:, :, start, start].sum() for own in (joint, moved))
    assert now == pytest.approx(0.81 * before, rel=0.02)


def test_the_result_as_json_is_what_the_sentences_say():
    made = json.loads(json.dumps(as_json(compared("dragging"))))
    assert made["base"] == "monday" and made["changes"][0]["probability"] > 0.99
    seen = made["level_1"]
    assert made["sentences"][: len(seen["sentences"])] == seen["sentences"] and not seen["nothing_changed"]
    assert {q["id"] for q in seen["quantities"] if q["stated"]} == {"drag/x", "drag/y"}
    first = made["sentences"][len(seen["sentences"])]
    assert "drag" in first.lower() and "probability" in first
    assert {x["id"] for x in made["unchanged"]} >= {"mass_kg"}


def test_the_command_says_it_and_its_exit_code_is_that_of_a_regression_test(tmp_path):
    folders = [str(write_set(replace(monday(), name=name), tmp_path)) for name in ("monday", "friday")]
    run = answer("compare", *folders, "--ci", "-q", "-o", tmp_path / "changes.json")
    assert "Nothing changed" in run and json.loads((tmp_path / "changes.json").read_text())["changes"] == []
    (tmp_path / "friday" / "vehicle.yaml").unlink()
    assert "vehicle.yaml" in refusal("compare", *folders, "-q")


def test_several_good_sets_are_one_reference_and_their_vehicle_must_be_one():
    first, second = flights("monday", (1,)), flights("tuesday", (2,))
    both = as_one([first, second])
    assert [r.name for r in both.runs] == ["monday-run01", "tuesday-run02"]
    renamed = second.vehicle.model_copy(update={"name": "tuesday", "trust": {"mass_kg": 0.1}})
    stated = Vehicle.model_validate(renamed.model_dump(exclude_unset=True) | {"ground_z_m": 1.0})
    both = as_one([first, replace(second, vehicle=stated)])
    assert both.vehicle.name == first.vehicle.name and both.vehicle.ground_z_m == 1.0
    heavier = lighter(second.vehicle, 1.1)
    said = f"tuesday/vehicle.yaml: .* is {heavier.mass_kg:g}, that of monday {first.vehicle.mass_kg:g}"
    with pytest.raises(InputError, match=said):
        as_one([first, replace(second, vehicle=heavier)])


def test_every_value_has_its_change_with_an_interval():
    same = {p.symbol: p for p in compared("same").values}
    assert same["mass_kg"].low < 0.0 < same["mass_kg"].high
    assert same["inertia_xx_kg_m2"].low < 0.0 < same["inertia_xx_kg_m2"].high
    changed = {p.symbol: p for p in compared("believed lighter").values}
    named = sure(compared("believed lighter"))[0]
    assert changed[named.id].low == pytest.approx(named.parameters[0].low)


def test_the_interval_of_a_mass_that_is_hardly_known_contains_its_value():
    """A coefficient of one is an infinite mass, of more a negative one: the interval ends where the prior does."""
    vehicle = monday().vehicle
    (known,) = in_percent("mass_kg", (Estimate("mass_kg", 0.2, "1", -0.5, 1.2),), vehicle, vehicle)
    assert (known.low, known.value, known.high) == pytest.approx((-1 / 3, 0.25, 1.5))


def test_a_set_that_goes_farther_than_the_good_one_is_noted():
    slow, fast = {"airspeed_m_s": 3.0, "tilt_rad": 0.3}, {"airspeed_m_s": 9.0, "tilt_rad": 0.31}
    (note,) = regime_notes(slow, fast, "monday", "friday")
    assert note.startswith("friday goes farther (") and "9.0 m/s where monday has 3.0 m/s" in note
    assert regime_notes(fast, slow, "friday", "monday") == []
    assert compared("same").notes == ()


def test_airspeeds_that_the_good_flights_never_had_are_not_compared():
    """From some time on the second set is faster than the first ever was: blocks before count, later ones do not."""
    vehicle, time_s = flights("monday", (1,)).vehicle, np.arange(0.0, 20.0, 0.05)
    regimes = [("run", {"time_s": time_s, "airspeed_m_s": np.where(time_s < 10.0, 0.0, 40.0)})]
    within = slower(regimes, vehicle, 2.0, {"airspeed_m_s": 5.0})
    assert within("run", 8.0) is True and within("run", 12.0) is None
    everywhere = slower(regimes, vehicle, 2.0, {"airspeed_m_s": 40.0 / FARTHER})
    assert everywhere("run", 12.0) is True


def test_columns_that_contradict_each_other_speak_for_a_mistake_by_themselves():
    """A flipped axis is corrected unless force and moment plainly speak against it; exchanged rotors, which they alone
    show, only where they speak for it."""
    flipped, exchanged = (SimpleNamespace(id=i) for i in ("axis_sign", "rotor_order"))
    assert price_of([exchanged]) == Prior().effect_nats > 0.0 > price_of([flipped])
    assert price_of([flipped, exchanged]) == price_of([flipped]) + price_of([exchanged])


def test_a_unit_that_is_wrong_is_no_question():
    """Compared as recorded, an accelerometer in g would be a payload, a lag and three errors of sensors."""
    friday = flights("friday", (3, 4))
    in_g = tuple(replace(r, table=r.table.assign(**{n: r.table[n] / g for n in c.SPECIFIC_FORCE})) for r in friday.runs)
    (joint,) = joints_of(reference_of(monday()), replace(friday, runs=in_g))
    assert [m.id for m in joint.mistakes_of_new] == ["unit_error"]


def test_a_set_that_is_faster_throughout_is_refused():
    reference, new = reference_of(flights("monday", (1,))), flights("friday", (2,))
    table = new.runs[0].table.copy()
    for axis in "xyz":
        table[f"velocity_{axis}_m_s"] += 60.0
    with pytest.raises(InputError, match="all of it is more than 1.5 times as fast as monday"):
        joints_of(reference, replace(new, runs=(replace(new.runs[0], table=table),)))


def test_what_differs_between_good_flights_is_no_change():
    """Three good flights, each with another drag: a fourth drag lies within what they differ by."""
    good = tuple(flights(f"day{k}", (k,), drag=drag) for k, drag in ((1, 0.4), (2, 1.0), (3, 0.7)))
    fourth = flights("day4", (4,), drag=1.1)
    assert "rotor_drag" in {i for c in sure(changes_between(good[0], fourth)) for i in (c.id, *c.alternatives)}
    assert sure(changes_between(as_one(good), fourth)) == []


def test_the_page_holds_sentences_limits_and_both_recordings(tmp_path):
    found = compared("believed lighter")
    page = make_changes_page(found)
    assert sentences(found)[0] in page and "<h1>friday compared with monday</h1>" in page
    assert page.count("<svg") == 3 and "Rotor drag" in page
    assert {"force_z", "moment_x"} <= found.residuals[0].keys() & found.residuals[1].keys()
    script_free = page.lower()
    assert "<script" not in script_free and "content-security-policy" in script_free


@pytest.mark.slow
def test_a_payload_that_came_to_hang_below_the_vehicle_is_named_with_its_mass():
    """80 g on 0.6 m below a vehicle of 652 g that is thrown about, out to the side when the recording begins."""
    without = recorded(1, 2, flight={"excitation": 1.5})
    carrying = recorded(3, 4, flight={"load": (0.08, 0.6), "excitation": 1.5})
    (payload,) = [c for c in changes_between(without, carrying).changes if c.status == "established"]
    assert payload.id == "payload"
    mass = next(p for p in payload.parameters if p.symbol == "m_p")
    assert mass.value == pytest.approx(0.08, rel=0.1) and mass.low < 0.08 < mass.high


@pytest.mark.slow
def test_without_a_payload_nothing_hangs():
    found = changes_between(recorded(1, 2), recorded(3, 4, flight={"excitation": 1.5}))
    assert "payload" not in {i for c in found.changes for i in (c.id, *c.alternatives)}


def test_a_comparison_has_one_thread_of_linear_algebra(monkeypatch) -> None:
    """Two that wait for each other take several times as long."""

    def threads(sets: object) -> None:
        raise InputError(str({own["num_threads"] for own in threadpool_info() if own["user_api"] == "blas"}))

    monkeypatch.setattr("rotorid.mismatch.changes.compare.of_one_vehicle", threads)
    with threadpool_limits(2):
        refused(r"\{1\}", changes_between, None, None)
