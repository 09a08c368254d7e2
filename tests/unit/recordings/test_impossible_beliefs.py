"""Believed values that no multirotor has together: each is named with the unit that would explain it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rotorid.cli.modelling import fly
from rotorid.recordings import RecordingSet, Vehicle, read_set, read_vehicle, templates
from rotorid.recordings import columns as c
from rotorid.recordings.body import body_of, impossible
from rotorid.recordings.check import doubts_of
from rotorid.recordings.run import Doubt
from tests.unit.mismatch.flights import with_table

ROOT = Path(__file__).parents[3]
RPM = 2 * np.pi / 60
GF = 9.80665e-3
SPEED = "rotor_speed_1_rad_s"


@pytest.fixture(scope="module")
def flown(tmp_path_factory) -> RecordingSet:
    sound = templates.read("thesis").model_copy(update={"rotor_speed_limits_rad_s": (0.0, 2500.0)})
    return read_set(fly(sound, tmp_path_factory.mktemp("sets") / "sound", 21.0, 2, 3))


def believed(recordings: RecordingSet, **factors: float) -> RecordingSet:
    """The set with each value of its vehicle times a factor; `arms` stands for the places of the rotors."""
    vehicle, changed = recordings.vehicle, {}
    for key, factor in factors.items():
        if key == "inertia_kg_m2":
            inertia = vehicle.inertia_kg_m2
            changed[key] = inertia.model_copy(update={k: factor * getattr(inertia, k) for k in ("xx", "yy", "zz")})
        elif key == "arms":
            changed["rotors"] = tuple(
                r.model_copy(update={"x_m": factor * r.x_m, "y_m": factor * r.y_m}) for r in vehicle.rotors
            )
        elif key == "rotor_speed_limits_rad_s":
            changed[key] = tuple(factor * v for v in vehicle.rotor_speed_limits_rad_s)
        else:
            changed[key] = factor * getattr(vehicle, key)
    return replace(recordings, vehicle=vehicle.model_copy(update=changed))


CF, CQ, LIMITS = "thrust_coefficient_n_s2", "torque_coefficient_n_m_s2", "rotor_speed_limits_rad_s"
J, G, PLACE = "inertia_kg_m2", "gravity_m_s2", "accelerometer_position_m"


@pytest.mark.parametrize(
    ("factors", "what", "said"),
    [
        ({J: 100}, J, "zz = 0.4684: a radius of gyration of 0.618 m with arms of 0.125 m"),
        ({J: 1e4}, J, "kg cm² or"),
        ({J: 1e6}, J, "kg mm² or"),
        ({J: 1e7}, J, "g cm² would fit"),
        ({J: 1e-3}, J, "xx = 2.489e-06: a radius of gyration of 0.00195 m"),
        ({"mass_kg": 2}, "mass_kg", "mass_kg = 1.304: the thrust is 0.499 times what carries the vehicle"),
        ({"mass_kg": 1000}, "mass_kg", "; g would fit"),
        ({"arms": 100}, "rotors", "longest arm in m = 12.5"),
        ({"arms": 1000}, "rotors", "mm would fit"),
        ({"arms": 1e-3}, "rotors", "km would fit"),
        ({"arms": 1 / 0.0884}, "rotors", "PX4 logs x and y of 1 m where its geometry was never set"),
        ({"arms": 1 / 0.0884, J: 128}, "rotors", "PX4 logs x and y of 1 m where its geometry was never set"),
        ({"rotor_radius_m": 1000}, "rotor_radius_m", "rotor_radius_m = 63.5: arms of 0.125 m with rotors of 63.5 m"),
        ({"rotor_radius_m": 2}, "rotor_radius_m", "the diameter would fit"),
        ({"arms": 100, "rotor_radius_m": 100}, "rotors", "cm would fit (rotors and rotor_radius_m alike)"),
        ({CF: 1 / GF}, CF, "gf s² would fit"),
        ({CF: RPM**2}, CF, "N per rpm² would fit"),
        ({CF: 0.5 / 1.3877e-6}, CF, "thrust_coefficient_n_s2 = 0.5: a dimensionless C_T of 8.16e+03"),
        ({CF: RPM**2, CQ: RPM**2}, CF, "N per rpm² and N m per rpm² would fit"),
        ({CQ: 1000}, CQ, "N mm s² would fit"),
        ({CQ: 1 / 1.3877e-6}, CQ, "the ratio of torque to thrust in m would fit"),
        ({CQ: 0.3}, CQ, "a figure of merit of 1.68"),
        ({LIMITS: 1 / RPM}, LIMITS, "revolutions per minute would fit"),
        ({G: 1 / 9.81}, G, "gravity_m_s2 = 1: expected that of the earth, 9.5 to 10.1 m/s²; g"),
        ({G: 2}, G, "gravity_m_s2 = 19.62"),
    ],
    ids=lambda value: str(value)[:40] if isinstance(value, dict) else "",
)
def test_an_impossible_value_is_named_with_its_unit(flown, factors, what, said) -> None:
    found = doubts_of(believed(flown, **factors))
    assert [(doubt.what, doubt.stops) for doubt in found] == [(what, True)], found
    assert said in found[0].sentence


def test_two_mistakes_are_two_doubts(flown) -> None:
    found = doubts_of(believed(flown, **{J: 1e6, "mass_kg": 2}))
    assert [doubt.what for doubt in found] == [J, "mass_kg"]


@pytest.mark.parametrize("factor", [0.6, 0.75, 1.3, 1.4])
@pytest.mark.parametrize("key", ["mass_kg", J, CF, CQ, "arms", "rotor_radius_m", LIMITS])
def test_a_value_wrong_by_some_tens_of_percent_is_for_the_verdict(flown, key, factor) -> None:
    assert doubts_of(believed(flown, **{key: factor})) == ()


def test_a_figure_of_merit_just_above_one_is_said_and_does_not_stop(flown) -> None:
    (doubt,) = doubts_of(believed(flown, **{CQ: 0.45}))
    assert (doubt.what, doubt.stops) == (CQ, False)
    assert "a figure of merit of 1.12" in doubt.sentence


def test_speeds_of_one_run_in_another_unit_are_named_with_the_run(flown) -> None:
    def per_minute(table) -> None:
        table[list(c.rotor_columns("rotor_speed", 4))] /= RPM

    last = flown.runs[-1].name
    (doubt,) = doubts_of(with_table(flown, per_minute, last))
    assert (doubt.what, doubt.stops) == (SPEED, True)
    assert doubt.sentence.startswith(f"{last}: {SPEED} and its like")
    assert "revolutions per minute would fit" in doubt.sentence


@pytest.mark.parametrize(
    ("volts", "said"), [(-12.0, "the sign is turned"), (16800.0, "mV would fit"), (168.0, "0.1 V would fit")]
)
def test_a_battery_that_is_not_in_volts_is_named(flown, volts, said) -> None:
    (doubt,) = doubts_of(with_table(flown, lambda table: table.insert(1, c.BATTERY_VOLTAGE, volts)))
    assert (doubt.what, doubt.stops) == (c.BATTERY_VOLTAGE, True)
    assert f"has a median of {volts:.4g}, expected 0 to 120 V: {said}" in doubt.sentence


@pytest.mark.parametrize(
    ("changed", "what", "said"),
    [
        ({PLACE: (12.0, 0.0, 3.0)}, PLACE, "at most 0.247; cm or mm would fit"),
        ({"rotor_inertia_kg_m2": 8.5e-2}, "rotor_inertia_kg_m2", "at most 0.00024; g m² or lb in² or kg cm² would fit"),
    ],
    ids=["accelerometer", "rotor inertia"],
)
def test_an_optional_value_in_another_unit_is_named(flown, changed, what, said) -> None:
    (doubt,) = doubts_of(replace(flown, vehicle=flown.vehicle.model_copy(update=changed)))
    assert (doubt.what, doubt.stops) == (what, True)
    assert said in doubt.sentence


def doubts_without_flight(vehicle: Vehicle) -> list[Doubt]:
    return list(impossible(body_of(vehicle)))


VEHICLES = [
    *(ROOT / "workflow" / "vehicles").glob("*.yaml"),
    *(ROOT / "src" / "rotorid" / "recordings" / "templates").glob("*.yaml"),
    ROOT / "src" / "rotorid" / "cli" / "examples" / "vehicle.yaml",
]


@pytest.mark.parametrize("path", VEHICLES, ids=lambda path: path.stem)
def test_no_real_vehicle_is_in_doubt(path: Path) -> None:
    assert doubts_without_flight(read_vehicle(path)) == []


def test_a_stand_is_looked_at_without_its_weight(flown) -> None:
    stand = templates.read("thesis").model_copy(update={"kind": "stand", "mass_kg": None, "inertia_kg_m2": None})
    assert doubts_without_flight(stand) == []
    (doubt,) = doubts_without_flight(stand.model_copy(update={CF: 1.3877e-6 * RPM**2}))
    assert doubt.what == CF and "N per rpm² would fit" in doubt.sentence
