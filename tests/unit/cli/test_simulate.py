"""`rotorid simulate` flies every vehicle file: each form of the catalogue in turn, and what it says."""

import numpy as np
import pytest

from rotorid.recordings import RecordingSet, Vehicle, read_set, templates, write_vehicle
from rotorid.vehicle.control import START_HEIGHT_M
from tests.command_line import answer, refusal
from tests.unit.effects.flown import entry, typical_values
from tests.unit.effects.test_catalogue_audit import set_forms, speed_forms, speed_values, wrench_forms


def simulated(folder, *effects: dict, like: str = "thesis", seconds: int = 1, **changes) -> tuple[str, RecordingSet]:
    """What the command says, and the set that it wrote, of a template that states some effects."""
    vehicle = templates.read(like).model_copy(update={"effects": effects, **changes})
    write_vehicle(vehicle, folder / "vehicle.yaml")
    said = answer("simulate", folder / "vehicle.yaml", "-o", folder / "flown", "--seconds", seconds, "--flights", "1")
    return said, read_set(folder / "flown")


def tilt_rad(table) -> float:
    """Largest angle from level, by the recorded attitude."""
    _, x, y, _ = table[[f"quaternion_{a}" for a in "wxyz"]].to_numpy().T
    return float(np.arccos(1 - 2 * (x**2 + y**2)).max())


def of_a_vehicle():
    """Every form of the vehicle, of its command path and of its sensors."""
    return [*wrench_forms(), *speed_forms()]


@pytest.mark.parametrize(("effect", "form"), of_a_vehicle())
def test_every_form_flies_and_is_held_in_the_air(tmp_path, effect, form):
    values = speed_values(form) if effect.speed_forms and not hasattr(form, "contribution") else None
    values = typical_values(effect.id, form) if values is None else values
    if form.name == "lower limit":
        values = [0.3]  # of a full command that is stated as twice the speed of hover
    _, flown = simulated(tmp_path, entry(effect.id, form, values))
    table = flown.runs[0].table
    assert tilt_rad(table) < 1.0
    assert np.abs(table["position_z_m"] - table["position_z_m"].iloc[0]).max() < 2.0
    needs_ground = "height" in form.requires
    assert (table["position_z_m"].iloc[0] < -0.9 * START_HEIGHT_M) == needs_ground
    assert flown.vehicle.effects == ()


@pytest.mark.parametrize(("effect", "form"), list(set_forms()))
def test_every_fault_of_a_set_is_written(tmp_path, effect, form):
    simulated(tmp_path, entry(effect.id, form, form.example))


def test_a_crazyflie_with_all_that_lies_between_command_and_speed(tmp_path):
    """As verdicts of logs state it, slow rotors and all: no form needs the whole series of commands."""
    chain = (
        {"id": "throttle_curve", "form": "power of the throttle", "parameters": {"n": 0.6}},
        {"id": "battery_sag", "form": "drift in time", "parameters": {"k": 0.05}},
        {"id": "delay", "form": "of the command", "parameters": {"T": 0.02}},
        {"id": "motor_lag", "form": "on thrust", "parameters": {"tau": 0.09}},
        {"id": "rotor_drag", "form": "at the hubs", "parameters": {"k_d": 1e-7}},
    )
    _, flown = simulated(tmp_path, *chain, like="crazyflie-2.1", rotor_speed_limits_rad_s=(0.0, 2800.0))
    table = flown.runs[0].table
    speed, command = (table[f"rotor_{kind}_1_rad_s"].to_numpy() for kind in ("speed", "command"))
    assert tilt_rad(table) < 1.0 and abs(table["position_z_m"].iloc[-1]) < 2.0
    assert speed.mean() == pytest.approx(2800 * (command.mean() / 2800) ** 0.6, rel=0.02)


def test_what_is_flown_otherwise_is_said(tmp_path):
    early = {"id": "delay", "form": "of the command", "parameters": {"T": -0.02}}
    weak = {"id": "command_saturation", "form": "upper limit", "parameters": {"w_high": 0.4}}
    said, _ = simulated(tmp_path, early, weak)
    said = [line for line in said.splitlines() if line.startswith("  - ")]
    assert len(said) == 3 and "left out" in said[0] and "full command" in said[1]
    assert said[2].endswith("The vehicle sinks: all that its rotors can do carries 64 % of what hover needs.")


@pytest.mark.parametrize(("k_d", "said_of"), [(1e-3, "at most"), (-1e-4, "at least"), (1.2e-4, None)])
def test_a_parameter_beyond_its_bound_is_said(tmp_path, k_d: float, said_of: str | None):
    said, _ = simulated(tmp_path, {"id": "rotor_drag", "form": "at the hubs", "parameters": {"k_d": k_d}})
    doubts = [line for line in said.splitlines() if "The k_d of rotor_drag (at the hubs) is" in line]
    assert len(doubts) == (said_of is not None)
    assert not doubts or f"is {k_d:.4g}, beyond" in doubts[0] and f"({said_of} " in doubts[0]


def test_a_vehicle_that_turns_over_is_said(tmp_path):
    tipping = {"id": "flapping_moment", "form": "at the hubs", "parameters": {"k_flap": -1e-4}}
    said, _ = simulated(tmp_path, tipping, seconds=3)
    assert "The vehicle turned over in flight_1" in said
    (tmp_path / "held").mkdir()
    held, _ = simulated(tmp_path / "held")
    assert "turned over" not in held


@pytest.mark.parametrize("kind", ["stand", "bench"])
def test_what_does_not_fly_is_one_sentence(tmp_path, kind: str):
    creep = {"id": "creep", "form": "one time constant", "parameters": {}}
    vehicle = Vehicle.model_validate({**templates.read("thesis").model_dump(), "kind": kind, "effects": (creep,)})
    write_vehicle(vehicle, tmp_path / "improved_vehicle.yaml")
    said = refusal("simulate", tmp_path / "improved_vehicle.yaml", "-o", tmp_path / "flown")
    assert f"a {kind} does not fly" in said
    assert not (tmp_path / "flown").exists()
