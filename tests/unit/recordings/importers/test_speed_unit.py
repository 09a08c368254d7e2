"""Rotor speeds in the unit that carries the weight, and a geometry that was never set."""

from itertools import permutations
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rotorid.io.text.files import parse_yaml
from rotorid.recordings import columns as c
from rotorid.recordings import templates
from rotorid.recordings.files import vehicle_of
from rotorid.recordings.importers import px4_ulog
from rotorid.recordings.importers.known import propose
from rotorid.recordings.importers.logfile import in_unit_of_weight, read_log, set_of_logs
from rotorid.recordings.importers.logfile import usual_coefficient as coefficient
from rotorid.recordings.importers.mapping import UNITS, Mapping
from tests.public_logs import public

SPEEDS = list(c.rotor_columns("rotor_speed", 4))


def hover(template: str, spread: float = 0.05) -> pd.DataFrame:
    """Five seconds near hover at 100 Hz, rotor speeds in rad/s."""
    vehicle = templates.read(template)
    n, rng = 500, np.random.default_rng(1)
    share = 1 + spread * rng.standard_normal((n, 1)) + 0.01 * rng.standard_normal((n, 4))
    coefficients = np.asarray(vehicle.thrust_coefficients_n_s2())
    speed = np.sqrt(vehicle.mass_kg * 9.81 * share / coefficients.sum())
    force = -(coefficients * speed**2).sum(axis=1) / vehicle.mass_kg
    table = pd.DataFrame({c.TIME: np.arange(n) / 100, c.SPECIFIC_FORCE[2]: force})
    return table.assign(**dict(zip(SPEEDS, speed.T, strict=True)))


@pytest.mark.parametrize("template", templates.names())
@pytest.mark.parametrize(("stated", "written"), list(permutations(UNITS["rotor"], 2)))
def test_the_unit_that_carries_the_weight_is_taken(template: str, stated: str, written: str) -> None:
    mass = templates.read(template).mass_kg
    true = hover(template)
    factor = UNITS["rotor"][stated] / UNITS["rotor"][written]  # what a reader of the stated unit makes of it
    table = true.assign(**{n: true[n] * factor for n in SPEEDS})
    made, (fault,) = in_unit_of_weight({"run": table}, {"run": stated}, mass, 4)
    np.testing.assert_allclose(made["run"][SPEEDS], true[SPEEDS], rtol=1e-9)
    assert fault.action == f"taken as {written}" and f"in {stated}, as the log states" in fault.found


@pytest.mark.parametrize("template", templates.names())
@pytest.mark.parametrize("wrong", [0.4, 1.0, 2.5])
def test_a_mass_that_is_off_changes_no_unit(template: str, wrong: float) -> None:
    mass = wrong * templates.read(template).mass_kg
    table = hover(template)
    assert in_unit_of_weight({"run": table}, {"run": "rad/s"}, mass, 4)[0]["run"] is table


def test_import_says_which_unit_it_took(tmp_path: Path) -> None:
    """Gazebo's x500 hovers at 770 rad/s, and its log calls them rpm: the thrust would be 1 % of the weight."""
    path = tmp_path / "own.csv"
    hover("x500").to_csv(path, index=False)
    channels = {
        "time": {"columns": [c.TIME], "unit": "s"},
        "specific_force": {"columns": [c.SPECIFIC_FORCE[2]] * 3, "unit": "m/s2"},
        "rotor_speed": {"columns": SPEEDS, "unit": "rpm"},
    }
    mapping = Mapping.model_validate({"channels": channels})
    assert read_log(path, mapping).runs["own"][SPEEDS[0]].median() < 100
    found = set_of_logs([path], "own", like="x500", mapping=mapping)
    assert found.runs["own"][SPEEDS[0]].median() == pytest.approx(770, rel=0.02)
    (fault,) = [f for f in found.faults if f.kind == "unit"]
    assert fault.found.startswith("in rpm, as the log states, the rotors hover at 0.095 times")
    assert fault.action == "taken as rad/s"
    assert "thrust_coefficient_n_s2: 8.5" in found.vehicle_text


@pytest.mark.parametrize(
    ("log", "mass_kg", "unit"),
    [
        ("imrc-crazyflie-rpm/brushless_flights/eckart00", 0.037, "rpm"),
        ("imrc-crazyflie-rpm/brushed_flights/jana01", 0.0347, "rpm"),
        ("neurobem/bemnn20210223114138seg3.mat", 0.772, "rad/s"),
        ("px4-ulog/sample_px4_events.ulg", 1.5, "rpm"),
        ("logs/betaflight/shortLog.BFL", 0.7, "rpm"),
    ],
)
def test_public_logs_keep_their_unit(log: str, mass_kg: float, unit: str) -> None:
    found = read_log(public(log))
    assert found.speed_unit == unit
    for table in found.runs.values():
        assert in_unit_of_weight({"run": table}, {"run": unit}, mass_kg, 4)[0]["run"] is table


def test_a_geometry_of_one_metre_is_directions_alone() -> None:
    parameters: dict[str, float] = {}
    for i, (x, y, km) in enumerate([(1, 1, 0.05), (-1, -1, 0.05), (1, -1, -0.05), (-1, 1, -0.05)]):
        parameters |= {f"CA_ROTOR{i}_PX": x, f"CA_ROTOR{i}_PY": y, f"CA_ROTOR{i}_PZ": 0.0, f"CA_ROTOR{i}_KM": km}
    found, _ = px4_ulog.px4_vehicle(parameters, 4)
    assert found.rotors is None and len(found.directions) == 4
    template = templates.read("x500")
    text, remarks = propose("own", [], found, template, "x500", 2.0)
    rotors = vehicle_of(parse_yaml(text, ""), "").rotors
    arm_m = np.hypot(template.rotors[0].x_m, template.rotors[0].y_m)
    assert [np.hypot(r.x_m, r.y_m) for r in rotors] == pytest.approx([arm_m] * 4, rel=1e-4)
    assert [(np.sign(r.x_m), np.sign(r.y_m), r.spin) for r in rotors] == [
        (1, 1, "ccw"), (-1, -1, "ccw"), (1, -1, "cw"), (-1, 1, "cw"),
    ]  # fmt: skip
    assert any("±1 m is unset" in remark for remark in remarks)
    real, _ = px4_ulog.px4_vehicle(parameters | {"CA_ROTOR0_PX": 0.9}, 4)
    assert real.rotors is not None and real.directions is None


def test_speeds_that_no_unit_explains_are_named_and_kept() -> None:
    """Electrical turns taken for turns: seven times too many."""
    speed = 7 * np.sqrt(0.65 * 9.81 / 4 / coefficient(0.65, 4))
    time_s = np.arange(0, 10, 0.01)
    table = pd.DataFrame({c.TIME: time_s, c.SPECIFIC_FORCE[2]: -9.81} | {n: speed + np.sin(time_s) for n in SPEEDS})
    runs, faults = in_unit_of_weight({"a": table}, {"a": "rpm"}, 0.65, 4)
    assert runs["a"].equals(table)
    assert "7 times the speed that carries" in faults[0].sentence and "electrical turns" in faults[0].sentence
