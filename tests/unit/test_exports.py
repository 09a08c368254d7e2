"""Exports fly like ours: the same rotor speeds in RotorPy and MuJoCo beside our simulation; what is lost is named."""

import numpy as np
import pytest
from typer.testing import CliRunner

from rotorid import templates
from rotorid.cli import app
from rotorid.exports import export_vehicle
from rotorid.exports.flown import in_mujoco, in_rotorpy
from rotorid.recordings import Vehicle, write_vehicle


def with_effects(*effects: tuple[str, str, dict[str, float]]) -> Vehicle:
    entries = tuple({"id": i, "form": f, "parameters": p} for i, f, p in effects)
    return templates.read("thesis").model_copy(update={"effects": entries})


DRAG = ("rotor_drag", "at the hubs", {"k_d": 6e-5})
OFFSET = ("com_offset", "moment", {"r_x": 0.002, "r_y": -0.001})
PRODUCTS = ("inertia_products", "products", {"J_xy": 1e-4, "J_xz": 2e-4, "J_yz": -1e-4})
FLAP = ("flapping_moment", "at the hubs", {"k_flap": 2e-7})


@pytest.mark.slow
@pytest.mark.parametrize("effects", [(DRAG,), (OFFSET,), (PRODUCTS, FLAP)])
def test_rotorpy_flies_the_same(effects) -> None:
    vehicle = with_effects(*effects)
    exported = export_vehicle(vehicle, "rotorpy")
    found = in_rotorpy(vehicle, exported, 0.05)
    assert found.position_m < 1e-6 * found.flown_m
    assert found.angle_rad < 1e-4 * found.turned_rad
    plain = in_rotorpy(vehicle, export_vehicle(with_effects(), "rotorpy"), 0.05)
    assert plain.position_m > 100 * found.position_m  # the effects show: the comparison could fail


@pytest.mark.slow
def test_the_lag_of_the_motors_goes_along() -> None:
    vehicle = with_effects(("motor_lag", "one constant", {"tau": 0.03}))
    found = in_rotorpy(vehicle, export_vehicle(vehicle, "rotorpy"), 0.1)
    assert found.position_m < 1e-3 * found.flown_m
    assert found.angle_rad < 0.02 * found.turned_rad


@pytest.mark.slow
def test_mujoco_flies_the_same() -> None:
    pytest.importorskip("mujoco")
    vehicle = with_effects(OFFSET, PRODUCTS)
    found = in_mujoco(vehicle, export_vehicle(vehicle, "mjcf"), 0.3)
    assert found.position_m < 1e-3 * found.flown_m
    assert found.angle_rad < 0.02 * found.turned_rad


def test_what_a_form_cannot_express_is_named() -> None:
    vehicle = with_effects(DRAG, ("ground_effect", "any", {"a": 1.0}))
    assert [s.split()[0] for s in export_vehicle(vehicle, "rotorpy").left_out] == ["ground_effect", "rotors"]
    mjcf = export_vehicle(vehicle, "mjcf")
    assert "rotor_drag" in mjcf.left_out[0] and "Not expressed: rotor_drag" in mjcf.text
    assert any("inertia" in s for s in export_vehicle(vehicle, "px4").left_out)


def test_px4_parameters_say_places_and_senses() -> None:
    rows = [r.split("\t") for r in export_vehicle(with_effects(), "px4").text.splitlines() if r[0] != "#"]
    values = {name: float(value) for _, _, name, value, _ in rows}
    assert values["CA_ROTOR1_PY"] == pytest.approx(-0.0884)
    assert np.sign([values[f"CA_ROTOR{i}_KM"] for i in range(4)]).tolist() == [1, -1, 1, -1]
    assert values["CA_ROTOR0_KM"] == pytest.approx(1.8558e-8 / 1.3877e-6)


def test_the_exported_file_is_python_and_an_unknown_form_is_told(tmp_path) -> None:
    write_vehicle(with_effects(DRAG), tmp_path / "v.yaml")
    done = CliRunner().invoke(app, ["export", str(tmp_path / "v.yaml"), "--to", "px4", "-o", str(tmp_path / "x")])
    assert done.exit_code == 0 and (tmp_path / "x").is_file()
    scope: dict = {}
    exec(export_vehicle(with_effects(DRAG), "rotorpy").text, scope)
    assert scope["quad_params"]["k_d"] == 6e-5
    done = CliRunner().invoke(app, ["export", str(tmp_path / "v.yaml"), "--to", "rotorpi"])
    assert done.exit_code == 1 and "did you mean rotorpy?" in done.output
