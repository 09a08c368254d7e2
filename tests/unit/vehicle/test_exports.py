"""Exports fly like ours: the same rotor speeds in other engines next to our simulation; what is lost is named.

Drake and pybullet are large and no dependency: `pip install drake pybullet` into the environment runs their tests.
"""

import ast
import dataclasses
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from rotorid.errors import InputError
from rotorid.recordings import Vehicle, templates, write_vehicle
from rotorid.recordings.vehicle import Inertia, Rotor
from rotorid.vehicle import exports
from rotorid.vehicle.exports import export_vehicle, flown, forms
from rotorid.vehicle.exports import names as names_of_forms
from rotorid.vehicle.exports.flown import commands_of, in_drake, in_mujoco, in_pybullet, in_rotorpy, lagging
from rotorid.vehicle.mixer import hover_speed_rad_s
from tests import packages
from tests.command_line import answer, refusal
from tests.refusals import refused


def with_effects(*effects: tuple[str, str, dict[str, float]]) -> Vehicle:
    entries = tuple({"id": i, "form": f, "parameters": p} for i, f, p in effects)
    return templates.read("thesis").model_copy(update={"effects": entries})


DRAG = ("rotor_drag", "at the hubs", {"k_d": 6e-5})
OFFSET = ("com_offset", "moment", {"r_x": 0.002, "r_y": -0.001})
PRODUCTS = ("inertia_products", "products", {"J_xy": 1e-4, "J_xz": 2e-4, "J_yz": -1e-4})
IN_SPACE = ("com_offset", "moment and lever arm, in space", {"r_x": 0.002, "r_y": -0.001, "r_z": 0.003})
FLAP = ("flapping_moment", "at the hubs", {"k_flap": 2e-7})


@pytest.mark.slow
@pytest.mark.parametrize("effects", [(DRAG,), (OFFSET,), (PRODUCTS, FLAP)])
def test_rotorpy_flies_the_same(effects) -> None:
    vehicle = with_effects(*effects)
    found = in_rotorpy(vehicle, export_vehicle(vehicle, "rotorpy"), 0.05)
    assert found.position_m < 1e-6 * found.flown_m and found.angle_rad < 1e-4 * found.turned_rad
    plain = in_rotorpy(vehicle, export_vehicle(with_effects(), "rotorpy"), 0.05)
    assert plain.position_m > 100 * found.position_m  # the effects show: the comparison could fail


@pytest.mark.slow
def test_the_lag_of_the_motors_goes_along() -> None:
    vehicle = with_effects(("motor_lag", "one constant", {"tau": 0.03}))
    found = in_rotorpy(vehicle, export_vehicle(vehicle, "rotorpy"), 0.1)
    assert found.position_m < 1e-3 * found.flown_m and found.angle_rad < 0.02 * found.turned_rad


@pytest.mark.slow
def test_mujoco_flies_the_same() -> None:
    pytest.importorskip("mujoco")
    vehicle = with_effects(OFFSET, PRODUCTS)
    found = in_mujoco(vehicle, export_vehicle(vehicle, "mjcf"), 0.3)
    assert found.position_m < 1e-3 * found.flown_m and found.angle_rad < 0.02 * found.turned_rad


LAG = ("motor_lag", "up and down", {"tau_up": 0.02, "tau_down": 0.04})


def other_than_a_file_holds() -> Vehicle:
    """Own products of inertia, coefficients of each rotor, another gravity, drag at the centre, a moved centre."""
    own = with_effects(("rotor_drag", "at the centre of mass", {"k_d": 6e-5}), IN_SPACE)
    products = own.inertia_kg_m2.model_copy(update={"xy": 1e-4, "xz": 2e-4, "yz": -1e-4})
    each = np.array([1.0, 1.03, 0.98, 1.01])
    return own.model_copy(
        update={
            "inertia_kg_m2": products,
            "thrust_coefficient_n_s2": tuple(own.thrust_coefficients_n_s2() * each),
            "torque_coefficient_n_m_s2": tuple(own.torque_coefficients_n_m_s2() * each),
            "gravity_m_s2": 9.7,
            "rotor_speed_limits_rad_s": (100.0, 1.01 * hover_speed_rad_s(own)),
        }
    )


@pytest.mark.parametrize(("form", "fly"), [("rotorpy", in_rotorpy), ("mjcf", in_mujoco)])
def test_a_trial_flight_compares_with_what_the_file_holds(form: str, fly) -> None:
    pytest.importorskip({"rotorpy": "rotorpy", "mjcf": "mujoco"}[form])
    vehicle = other_than_a_file_holds()
    found = fly(vehicle, export_vehicle(vehicle, form), 0.1)
    assert found.position_m < 1e-8 * found.flown_m and found.angle_rad < 1e-7 * found.turned_rad
    # With what the file leaves out ours parts from it: the comparison could fail.
    time, speeds = commands_of(vehicle, 0.1)
    held, whole = (flown.ours(v, speeds) for v in (forms.expressed(vehicle, form), vehicle))
    assert flown.difference(held[:2], whole, form).angle_rad > 1e3 * found.angle_rad


def test_what_the_urdf_and_the_frame_leave_of_the_vehicles_own_values_is_named() -> None:
    vehicle = other_than_a_file_holds()
    held = forms.expressed(vehicle, "gym-pybullet-drones")
    np.testing.assert_array_equal(held.inertia_kg_m2.matrix(), np.diag(np.diag(vehicle.inertia_kg_m2.matrix())))
    assert np.ptp(held.thrust_coefficients_n_s2()) == 0
    assert held.effects[0]["form"] == "at the centre of mass"
    in_x = vehicle.model_copy(update={"rotors": templates.read("x500").rotors})
    for form in ("gym-pybullet-drones", "ardupilot-json", "px4"):
        said = [s for s in export_vehicle(in_x, form).left_out if s.startswith("products of inertia")]
        assert said == ["products of inertia (J_xy = 0.0001, J_xz = 0.0002, J_yz = -0.0001)"], form
    for form in ("rotorpy", "mjcf", "sdf"):
        assert not any("products" in s for s in export_vehicle(vehicle, form).left_out)


def test_rotorpy_hovers_from_the_state_of_the_file() -> None:
    multirotor = pytest.importorskip("rotorpy.vehicles.multirotor").Multirotor
    vehicle = with_effects().model_copy(update={"accelerometer_position_m": (0.02, 0.01, -0.03)})
    exported = export_vehicle(vehicle, "rotorpy")
    scope: dict = {}
    exec(exported.text, scope)
    hover = {"cmd_motor_speeds": scope["initial_state"]["rotor_speeds"]}

    def fallen(*state: dict) -> float:
        flyer = multirotor(scope["quad_params"] | {"tau_m": 0.05}, *state)
        return abs(flyer.step(flyer.initial_state, hover, 0.1)["v"][2])

    assert fallen(scope["initial_state"]) < 1e-9
    assert fallen() > 0.5  # it starts at a speed of its own: the file's state is needed
    (said,) = [s for s in exported.left_out if "accelerometer" in s]
    assert "p_BS" in said
    np.testing.assert_allclose(scope["quad_params"]["rI"], [0.02, -0.01, 0.03])


def test_the_page_lists_what_each_form_holds() -> None:
    page = (Path(__file__).parents[3] / "docs/own-vehicle.md").read_text()
    table = page.split("| `FORM` |")[1].split("\n\n")[0].splitlines()
    rows = [line.strip("| ").split(" | ") for line in table if line.startswith("| `")]
    listed = {form.strip("`"): set(re.findall("`([a-z_]+)`", held)) for form, _, held in rows}
    assert listed == forms.KNOWS
    assert set(forms.KNOWS) == set(names_of_forms())


def test_the_flights_beside_turn_about_every_axis() -> None:
    vehicle = with_effects()
    speed = commands_of(vehicle, 0.3)[1]
    thrust = vehicle.thrust_coefficients_n_s2() * speed**2
    x, y, _ = vehicle.rotor_positions_m().T
    for moment in (-thrust @ y, thrust @ x, thrust @ vehicle.yaw_signs()):
        assert np.ptp(moment) > 1e-3 * thrust.mean() * np.abs(x).mean()


@pytest.mark.slow
@pytest.mark.parametrize("effects", [(), (DRAG,), (OFFSET, PRODUCTS), (LAG,)])
def test_the_sdf_model_flies_the_same_in_drake(effects) -> None:
    pytest.importorskip("pydrake", reason="drake is not installed: the exported SDF was not flown")
    vehicle = with_effects(*effects)
    exported = export_vehicle(vehicle, "sdf")
    found = in_drake(vehicle, exported)
    assert found.position_m < 5e-5 * found.flown_m and found.angle_rad < 5e-3 * found.turned_rad
    # A sense the wrong way round shows: the comparison could fail.
    swapped = exported.text.replace(">ccw<", ">?<").replace(">cw<", ">ccw<").replace(">?<", ">cw<")
    assert in_drake(vehicle, dataclasses.replace(exported, text=swapped)).angle_rad > 100 * found.angle_rad


@pytest.mark.slow
@pytest.mark.parametrize("template", ["thesis", "x500"])
@pytest.mark.parametrize("effects", [(), (DRAG,), (OFFSET,)])
def test_the_urdf_flies_the_same_in_bullet(template: str, effects) -> None:
    pytest.importorskip("pybullet", reason="pybullet is not installed: the exported URDF was not flown")
    vehicle = templates.read(template).model_copy(update={"effects": with_effects(*effects).effects})
    exported = export_vehicle(vehicle, "gym-pybullet-drones")
    found = in_pybullet(vehicle, exported, damping=0)
    assert found.position_m < 5e-5 * found.flown_m and found.angle_rad < 5e-3 * found.turned_rad
    turned = in_pybullet(vehicle, dataclasses.replace(exported, mirrored=not exported.mirrored), damping=0)
    assert turned.angle_rad > 100 * found.angle_rad
    # What the tool's own damping does is named, and is far more than the export's error.
    assert any("damping" in s for s in exported.left_out)
    assert in_pybullet(vehicle, exported).position_m > 100 * found.position_m


def test_what_a_form_cannot_express_is_named() -> None:
    vehicle = with_effects(DRAG, ("ground_effect", "inverse square", {"c": 1.0}))
    assert [s.split()[0] for s in export_vehicle(vehicle, "rotorpy").left_out] == ["ground_effect", "rotors"]
    mjcf = export_vehicle(vehicle, "mjcf")
    assert "rotor_drag" in mjcf.left_out[0] and "Not expressed: rotor_drag" in mjcf.text
    assert any("inertia" in s for s in export_vehicle(vehicle, "px4").left_out)


def test_a_centre_of_mass_that_the_accelerometer_showed_moves_the_rotors_as_well() -> None:
    """The form that real flights are found to have: its moment is that of the plain one."""
    plain, found = (export_vehicle(with_effects(effect), "rotorpy") for effect in (OFFSET, IN_SPACE))
    for name, place in plain.parameters["rotor_pos"].items():
        assert found.parameters["rotor_pos"][name] == pytest.approx(place)
    assert any("accelerometer stays" in s for s in found.left_out)


def test_px4_parameters_say_places_and_senses() -> None:
    rows = [r.split("\t") for r in export_vehicle(with_effects(), "px4").text.splitlines() if r[0] != "#"]
    values = {name: float(value) for _, _, name, value, _ in rows}
    assert values["CA_ROTOR1_PY"] == pytest.approx(-0.0884)
    assert np.sign([values[f"CA_ROTOR{i}_KM"] for i in range(4)]).tolist() == [1, -1, 1, -1]
    assert values["CA_ROTOR0_KM"] == pytest.approx(1.8558e-8 / 1.3877e-6)


def test_the_exported_file_is_python_and_an_unknown_form_is_told(tmp_path) -> None:
    write_vehicle(with_effects(DRAG), tmp_path / "v.yaml")
    answer("export", tmp_path / "v.yaml", "--to", "px4", "-o", tmp_path / "x")
    assert (tmp_path / "x").is_file()
    scope: dict = {}
    exec(export_vehicle(with_effects(DRAG), "rotorpy").text, scope)
    assert scope["quad_params"]["k_d"] == 6e-5
    assert "did you mean rotorpy?" in refusal("export", tmp_path / "v.yaml", "--to", "rotorpi")


def matrix_of(element, prefix: str = "") -> np.ndarray:
    """The inertia of an SDF or URDF element, (3, 3)."""
    get = element.get if prefix else element.findtext
    return np.array([[float(get(f"i{''.join(sorted(a + b))}")) for a in "xyz"] for b in "xyz"])


def numbers(text: str) -> np.ndarray:
    return np.array([float(x) for x in text.split()])


def test_sdf_carries_the_vehicles_mass_and_inertia_once() -> None:
    lag = ("motor_lag", "up and down", {"tau_up": 0.03, "tau_down": 0.05})
    vehicle = with_effects(DRAG, OFFSET, PRODUCTS, lag, FLAP)
    exported = export_vehicle(vehicle, "sdf")
    model = ElementTree.fromstring(exported.text).find("model")
    mass, first, spread = 0.0, np.zeros(3), np.zeros((3, 3))
    for link in model.findall("link"):
        inertial = link.find("inertial")
        place = sum(numbers(part.findtext("pose", "0 0 0 0 0 0"))[:3] for part in (link, inertial))
        own = float(inertial.findtext("mass"))
        mass, first = mass + own, first + own * place
        spread += matrix_of(inertial.find("inertia")) + own * (place @ place * np.eye(3) - np.outer(place, place))
    assert mass == pytest.approx(vehicle.mass_kg)
    np.testing.assert_allclose(first, 0, atol=1e-9)
    turned = np.diag([1.0, -1.0, -1.0])
    products = np.array([[0, 1e-4, 2e-4], [1e-4, 0, -1e-4], [2e-4, -1e-4, 0]])
    expected = turned @ (vehicle.inertia_kg_m2.matrix() + products) @ turned
    np.testing.assert_allclose(spread, expected, atol=1e-9)
    motors = model.findall("plugin")
    assert [m.findtext("turningDirection") for m in motors] == [r.spin for r in vehicle.rotors]
    assert float(motors[0].findtext("timeConstantDown")) == 0.05
    assert float(motors[0].findtext("motorConstant")) == pytest.approx(1.3877e-6)
    assert float(motors[0].findtext("rotorDragCoefficient")) == 6e-5
    assert [s.split()[0] for s in exported.left_out] == ["com_offset", "flapping_moment"]


@pytest.mark.parametrize("order", ["thesis", "x500"])
def test_gym_pybullet_drones_makes_our_forces_of_the_same_speeds(order: str) -> None:
    vehicle = templates.read(order)
    exported = export_vehicle(vehicle, "gym-pybullet-drones")
    root = ElementTree.fromstring(exported.text)
    # Read as that tool reads it: by place in the file.
    kf, km = float(root[0].get("kf")), float(root[0].get("km"))
    assert float(root[1][0][1].get("value")) == pytest.approx(vehicle.mass_kg)
    np.testing.assert_allclose(matrix_of(root[1][0][2], "u"), vehicle.inertia_kg_m2.matrix(), rtol=1e-8)
    assert float(root[1][2][1][0].get("radius")) > 0
    props = [link for link in root.findall("link") if "prop" in link.get("name")]
    places = [numbers(link.find("inertial/origin").get("xyz")) for link in props]
    said = next(s for s in exported.left_out if s.startswith("order of the rotors"))
    rotors = [int(w.strip(",")) - 1 for w in said.split("are rotors ")[1].split(" here")[0].split()]
    speed = np.array([500.0, 520.0, 480.0, 510.0])
    rpm = speed[rotors] * 60 / (2 * np.pi)
    thrust, twist = kf * rpm**2, km * rpm**2 * (-1 if any("RACE" in s for s in exported.left_out) else 1)
    there = np.sum([np.cross(p, [0, 0, f]) for p, f in zip(places, thrust, strict=True)], axis=0)
    there[2] += -twist[0] + twist[1] - twist[2] + twist[3]
    force = vehicle.thrust_coefficients_n_s2() * speed**2
    ours = np.sum([np.cross(p, [0, 0, -f]) for p, f in zip(vehicle.rotor_positions_m(), force, strict=True)], axis=0)
    ours[2] += vehicle.yaw_signs() @ (vehicle.torque_coefficients_n_m_s2() * speed**2)
    np.testing.assert_allclose(there * [1, -1, -1], ours, rtol=1e-6)
    assert thrust.sum() == pytest.approx(force.sum())
    # Its own dynamics take rotors 0 and 3 for the front, 0 and 1 for the left.
    assert [np.sign(p[:2]).tolist() for p in places] == [[1, 1], [-1, 1], [-1, -1], [1, -1]]


def test_gym_pybullet_drones_refuses_what_it_cannot_fly() -> None:
    four = with_effects().rotors
    for rotors in (tuple(r.model_copy(update={"y_m": 0.0}) for r in four), four[:3]):
        with pytest.raises(ValueError, match="gym-pybullet-drones"):
            export_vehicle(with_effects().model_copy(update={"rotors": rotors}), "gym-pybullet-drones")


THRUST_LAG = ("motor_lag", "on thrust", {"tau": 0.04})
CHAIN = (
    ("throttle_curve", "affine", {"a_0": 0.05, "a_1": 0.1}),
    ("battery_sag", "power of voltage", {"p": 1.0}),
    ("delay", "of the command", {"T": -0.01}),
    THRUST_LAG,
)
NEAR_GROUND = ("ground_effect", "image rotor", {"c": 1.0})


def limited(*effects: tuple[str, str, dict[str, float]]) -> Vehicle:
    return with_effects(*effects).model_copy(update={"rotor_speed_limits_rad_s": (100.0, 2000.0)})


def test_a_lag_of_the_thrust_goes_along_wherever_a_lag_is_known() -> None:
    vehicle = with_effects(THRUST_LAG)
    rotorpy = export_vehicle(vehicle, "rotorpy")
    assert rotorpy.parameters["tau_m"] == 0.04
    (said,) = rotorpy.left_out
    assert said.startswith("motor_lag") and "near hover has the same time constant" in said
    motor = ElementTree.fromstring(export_vehicle(vehicle, "sdf").text).find("model/plugin")
    assert [float(motor.findtext(f"timeConstant{way}")) for way in ("Up", "Down")] == [0.04, 0.04]
    mjcf = export_vehicle(vehicle, "mjcf")
    actuators = ElementTree.fromstring(mjcf.text).findall("actuator/general")
    assert [(a.get("dyntype"), float(a.get("dynprm"))) for a in actuators] == [("filterexact", 0.04)] * 4
    assert mjcf.left_out == ()
    assert "taken as one of the thrust, 0.03 s" in export_vehicle(with_effects(LAG), "mjcf").left_out[0]
    for form in ("gym-pybullet-drones", "px4"):
        assert any(s.startswith("motor_lag (on thrust") for s in export_vehicle(vehicle, form).left_out)


@pytest.mark.parametrize("form", ["rotorpy", "mjcf", "sdf", "gym-pybullet-drones", "px4"])
def test_what_lies_before_the_motors_is_named(form: str) -> None:
    named = [s.split(" (")[0] for s in export_vehicle(with_effects(*CHAIN), form).left_out]
    assert named[:3] == ["throttle_curve", "battery_sag", "delay"]


def test_saturation_is_a_limit_where_a_tool_has_limits() -> None:
    high = ("command_saturation", "upper limit", {"w_high": 0.8})
    low = ("command_saturation", "lower limit", {"w_low": 0.2})
    vehicle = limited(high, low)
    rotorpy = export_vehicle(vehicle, "rotorpy")
    assert (rotorpy.parameters["rotor_speed_min"], rotorpy.parameters["rotor_speed_max"]) == (320.0, 1600.0)
    sdf = export_vehicle(vehicle, "sdf")
    assert "<maxRotVelocity>1600<" in sdf.text and any("lowest rotor speed of 320 rad/s" in s for s in sdf.left_out)
    motor = ElementTree.fromstring(export_vehicle(vehicle, "mjcf").text).find("actuator/general")
    np.testing.assert_allclose(numbers(motor.get("ctrlrange")), 1.3877e-6 * np.array([320.0, 1600.0]) ** 2, rtol=1e-8)
    assert not any("command_saturation" in s for s in (*rotorpy.left_out, *sdf.left_out))
    # Without limits nothing says what the shares are of.
    assert export_vehicle(with_effects(high), "rotorpy").left_out[0].startswith("command_saturation")


def test_px4_has_a_map_of_its_own_for_a_thrust_curve_of_the_throttle() -> None:
    curve = ("throttle_curve", "thrust curve of the throttle", {"b": 0.3})
    for vehicle in (limited(curve), with_effects(curve)):
        exported = export_vehicle(vehicle, "px4")
        assert "THR_MDL_FAC\t0.7\t" in exported.text
        assert not any("throttle_curve" in s for s in exported.left_out)
    assert "THR_MDL_FAC\t1\t" in export_vehicle(limited(), "px4").text


def export_words(folder, vehicle: Vehicle, form: str, file: str) -> list:
    """The command that exports a vehicle to `folder`/out."""
    write_vehicle(vehicle, folder / "v.yaml")
    return ["export", folder / "v.yaml", "--to", form, "-o", folder / "out" / file]


@pytest.mark.parametrize(("form", "module"), [("rotorpy", "rotorpy"), ("mjcf", "mujoco")])
def test_the_trial_flight_is_made_for_any_chain(tmp_path, monkeypatch, form: str, module: str) -> None:
    pytest.importorskip(module)
    said = answer(*export_words(tmp_path, with_effects(*CHAIN, NEAR_GROUND, DRAG), form, "vehicle"))
    assert "next to our own flight of what the file holds" in said and (tmp_path / "out" / "vehicle").is_file()
    fly = {"rotorpy": in_rotorpy, "mjcf": in_mujoco}[form]
    vehicle = with_effects(*CHAIN)
    found = fly(vehicle, export_vehicle(vehicle, form))
    assert found.position_m < 1e-4 * found.flown_m and found.angle_rad < 5e-3 * found.turned_rad
    # Twice the lag shows: the comparison could fail.
    other = export_vehicle(with_effects(("motor_lag", "on thrust", {"tau": 0.08})), form)
    monkeypatch.setattr(flown, "lagging", lambda speeds, up_s, down_s: lagging(speeds, up_s / 2, down_s / 2))
    assert fly(vehicle, other).angle_rad > 10 * found.angle_rad


@pytest.mark.parametrize("trouble", [ImportError("no module", name="rotorpy"), ValueError("it\nfell")])
def test_a_trial_that_fails_is_one_sentence_and_the_file_is_there(tmp_path, monkeypatch, trouble: Exception) -> None:
    def fail(vehicle, exported):
        raise trouble

    monkeypatch.setitem(flown.FLYERS, "rotorpy", ("a_module_that_nobody_has", fail))
    last = answer(*export_words(tmp_path, with_effects(THRUST_LAG), "rotorpy", "vehicle.py")).splitlines()[-1].strip()
    assert last.startswith("not flown there") or last == "the trial flight there did not end: it fell"
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["vehicle.py"]


FLAT = with_effects().model_copy(update={"inertia_kg_m2": Inertia(xx=0.002, yy=0.002, zz=0.0041)})
"""A yaw inertia 2.5 % above what a body can have, as estimates of flat vehicles are."""


def six_rotors() -> Vehicle:
    angles = np.pi / 3 * np.arange(6)
    rotors = [Rotor(x_m=0.1 * np.cos(a), y_m=0.1 * np.sin(a), spin=("ccw", "cw")[i % 2]) for i, a in enumerate(angles)]
    return with_effects().model_copy(update={"rotors": tuple(rotors)})


@pytest.mark.parametrize(
    ("vehicle", "form", "said"),
    [
        (FLAT, "mjcf", "MuJoCo takes no principal moment of inertia above the sum of the others"),
        (FLAT, "sdf", "Gazebo takes no principal moment"),
        (six_rotors(), "rotorpy", "RotorPy knows four rotors, found 6"),
        (six_rotors(), "gym-pybullet-drones", "knows four rotors, found 6"),
    ],
)
def test_what_a_tool_does_not_take_is_one_sentence_before_anything_is_written(tmp_path, vehicle, form, said) -> None:
    assert said in refusal(*export_words(tmp_path, vehicle, form, "file")) and not (tmp_path / "out").exists()


def test_a_tool_refuses_what_is_refused_for_it(monkeypatch) -> None:
    """The limits are the tools' own: without them the tools say the same."""
    monkeypatch.setattr("rotorid.vehicle.exports.refusal", lambda *asked: "")
    for vehicle, form, module in ((FLAT, "mjcf", "mujoco"), (six_rotors(), "rotorpy", "rotorpy")):
        pytest.importorskip(module)
        refused("does not read the exported vehicle", flown.try_out, vehicle, form, export_vehicle(vehicle, form))


def test_other_tools_take_what_one_refuses() -> None:
    for form in ("rotorpy", "gym-pybullet-drones", "px4"):
        assert export_vehicle(FLAT, form).text
    for form in ("mjcf", "sdf", "px4"):
        assert export_vehicle(six_rotors(), form).text


def test_a_file_that_the_tool_does_not_read_is_not_written(tmp_path, monkeypatch) -> None:
    pytest.importorskip("mujoco")
    monkeypatch.setattr("rotorid.vehicle.exports.refusal", lambda *asked: "")
    said = refusal(*export_words(tmp_path, FLAT, "mjcf", "v.xml"))
    assert "MuJoCo does not read the exported vehicle" in said and not (tmp_path / "out").exists()


@pytest.mark.parametrize(("size", "told"), [(1.0, False), (1e-3, True)])
def test_an_inertia_that_sih_cannot_invert_is_named(size: float, told: bool) -> None:
    """Its inverse of 100 times the inertia is zero below a determinant of single precision's epsilon."""
    inertia = Inertia(xx=1.7e-2 * size, yy=1.7e-2 * size, zz=2.9e-2 * size)
    vehicle = templates.read("x500").model_copy(update={"inertia_kg_m2": inertia})
    assert any("too small for SIH" in said for said in export_vehicle(vehicle, "px4-sih").left_out) == told


WRONG_NAMES = ('quad"""; marker = 1 #', "quad\\", "two\nmarker = 1", "-->\x01---", "a\u2028marker = 1\r\x0c")


@pytest.mark.parametrize("name", WRONG_NAMES)
@pytest.mark.parametrize("to", names_of_forms())
def test_a_name_never_becomes_code_of_another_file(name: str, to: str) -> None:
    vehicle = with_effects(DRAG, OFFSET).model_copy(update={"name": name})
    exported, plain = (export_vehicle(v, to) for v in (vehicle, with_effects(DRAG, OFFSET)))
    assert exported.companions.keys() == plain.companions.keys()
    if to == "rotorpy":
        code = ([ast.dump(n) for n in ast.parse(e.text).body[1:]] for e in (exported, plain))
    elif to in ("mjcf", "sdf", "gym-pybullet-drones"):
        code = ([n.tag for n in ElementTree.fromstring(e.text).iter()] for e in (exported, plain))
    else:
        code = ([row for row in e.text.splitlines() if row[:1] != "#"] for e in (exported, plain))
    assert next(code) == next(code)


def test_an_effect_that_is_none_is_not_written_into_a_comment() -> None:
    vehicle = with_effects(("rotor_drag\nmarker = 1", "", {}))
    with pytest.raises(InputError, match="has id"):
        export_vehicle(vehicle, "px4")


def test_a_form_of_an_installed_package_is_written_and_none_takes_the_name_of_one_of_ours(tmp_path, monkeypatch):
    text = (
        "from rotorid.vehicle.exports import Exported\n\n"
        "def card(vehicle):\n    return Exported(vehicle.name, 'card.txt', ('all else: a card has a name alone',))\n"
    )
    points = "[rotorid.exports]\ncard = hangar:card\nmjcf = hangar:card\n"
    packages.installed(tmp_path, monkeypatch, "hangar", text, points)
    exports._of_packages.cache_clear()
    try:
        assert "card" in names_of_forms() and list(names_of_forms()).count("mjcf") == 1
        vehicle = templates.read("x500")
        made = export_vehicle(vehicle, "card")
        assert made.file_name == "card.txt" and made.text == vehicle.name and "a name alone" in made.left_out[0]
        assert export_vehicle(vehicle, "mjcf").file_name != "card.txt"
    finally:
        exports._of_packages.cache_clear()
