"""Derivatives of a vehicle file: every flight adds the same, files come back as they were, exports fly like ours."""

import math
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml

from rotorid.effects.contract import Motion
from rotorid.effects.instant import body_of
from rotorid.errors import InputError
from rotorid.recordings import Vehicle, read_vehicle, templates, write_vehicle
from rotorid.recordings.vehicle import Derivative, unit_of
from rotorid.report import next_to_log
from rotorid.vehicle.control import swings, turned_over
from rotorid.vehicle.derivatives import (
    CHANNELS,
    QUANTITIES,
    about_hover_of,
    derivative_form,
    own_controls,
    quantities,
    table_of,
    wrench,
)
from rotorid.vehicle.exports import autopilots, export_vehicle
from rotorid.vehicle.exports import names as names_of_forms
from rotorid.vehicle.exports.derivatives import MUJOCO_FILE, ROTORPY_FILE
from rotorid.vehicle.exports.flown import gazebo_damping_of, in_drake, in_mujoco, in_rotorpy
from rotorid.vehicle.improved import active_forms, flyable, hover, record_as_stated, simulate_as_stated, wrench_at_rest
from rotorid.vehicle.simulator import Commands, simulate
from rotorid_lab.batch import Batch
from tests.command_line import answer
from tests.refusals import refused
from tests.unit.effects.flown import audit_vehicle, commands, start
from tests.unit.vehicle.by_numpy import by_numpy
from tests.unit.vehicle.test_compiled import (
    ADDED,
    TRACE,
    _record,
    assert_same,
    assert_same_windows,
    commands_of,
    instants_of,
    motion_at_random,
    recorded,
)

STATE = QUANTITIES[:7]
RANGES = dict(zip(QUANTITIES, [(1, 1), (-1, 1.5), (-1.5, 3), (-2, 2), (-3, 3), (-3, 2), (-1, 1)], strict=False))
DRAG = {"id": "rotor_drag", "form": "at the hubs", "parameters": {"k_d": 3e-5}}


def at_random(quantities=STATE, seed: int = 1, channels=CHANNELS) -> tuple[Derivative, ...]:
    """Derivatives by every quantity, damping on the diagonal, with ranges that the flights here leave."""
    rng = np.random.default_rng(seed)
    damping = dict(zip("uvwpqr", CHANNELS, strict=True))
    return tuple(
        Derivative(
            channel=channel,
            quantity=quantity,
            unit=unit_of(channel, quantity),
            value=float(
                (0.2 if channel.startswith("force") else 2e-3)
                * (-rng.uniform(0.5, 1) if damping.get(quantity) == channel else rng.uniform(-1, 1))
            ),
            interval_95=(-1.0, 1.0),
            low=RANGES.get(quantity, (-0.1, 0.15))[0],
            high=RANGES.get(quantity, (-0.1, 0.15))[1],
        )
        for channel in channels
        for quantity in quantities
    )


def stated(vehicle: Vehicle, derivatives=None) -> Vehicle:
    return vehicle.model_copy(update={"derivatives": at_random() if derivatives is None else derivatives})


def test_the_kernel_adds_at_each_instant_what_it_adds_to_all_at_once():
    vehicle = stated(audit_vehicle(), at_random(QUANTITIES))
    form, values = derivative_form(vehicle)
    motion, body = motion_at_random(), body_of(vehicle)[0]
    expected, instants = form.contribution(motion, vehicle, values), instants_of(motion, vehicle)
    for n in range(motion.size):
        added = np.zeros(1, ADDED).view(np.recarray)
        form.contribution.kernel(_record(instants[n]), _record(body), values, added[0])
        np.testing.assert_allclose(added[0].force, expected.force[n], rtol=1e-11, atol=1e-12)
        np.testing.assert_allclose(added[0].moment, expected.moment[n], rtol=1e-11, atol=1e-13)


def test_by_hand_a_drag_is_held_at_the_edge_of_its_range():
    (drag,) = (d for d in at_random() if (d.channel, d.quantity) == ("force_x", "u"))
    x = np.zeros((3, 12))
    x[:, 1] = 1.0, 4.0, -4.0
    np.testing.assert_allclose(wrench(x, *table_of((drag,)))[:, 0], drag.value * np.array([1.0, 1.5, -1.0]))


@pytest.mark.parametrize("quantities", [STATE, QUANTITIES], ids=["state", "rotors too"])
def test_a_compiled_flight_is_that_of_numpy(quantities):
    vehicle = stated(audit_vehicle(), at_random(quantities))
    how = dict(duration_s=0.4, step_s=0.004, start=start(), effects=active_forms(vehicle))
    fast = simulate(vehicle, commands(), **how)
    with by_numpy(vehicle):
        assert_same(fast, simulate(vehicle, commands(), **how))
    assert np.abs(fast.velocity - simulate(audit_vehicle(), commands(), 0.4, 0.004, start()).velocity).max() > 0.01


def test_windows_are_those_of_numpy():
    vehicle = stated(audit_vehicle())
    assert_same_windows(vehicle, active_forms(vehicle), *recorded())


def test_a_batch_flies_them_and_changes_of_an_effect_and_of_the_mass():
    vehicle, dt = stated(audit_vehicle(effects=(DRAG,)), at_random(QUANTITIES)), 0.004
    drag, mass = np.array([1e-5, 6e-5]), np.array([0.6, 0.7])
    batch = Batch(vehicle, 2, {"rotor_drag.k_d": drag, "mass_kg": mass})
    flown = batch.fly(batch.hover(), commands_of(60, dt), dt, every=5)
    for i in range(2):
        entry = DRAG | {"parameters": {"k_d": float(drag[i])}}
        one = vehicle.model_copy(update={"effects": (entry,), "mass_kg": float(mass[i])})
        alone = simulate_as_stated(one, Commands(dt * np.arange(60), commands_of(60, dt)), 60 * dt, dt)
        for name in TRACE[:4]:
            a, b = getattr(flown, name)[i], getattr(alone, name)[0, ::5]
            np.testing.assert_allclose(a, b, rtol=0, atol=1e-9 * max(1.0, np.abs(b).max()), err_msg=name)
    refused("has no parameter 'derivatives.X_u'", Batch, vehicle, 2, {"derivatives.X_u": drag})


def test_a_file_comes_back_byte_for_byte(tmp_path):
    vehicle = stated(audit_vehicle(effects=(DRAG,)), at_random(QUANTITIES))
    write_vehicle(vehicle, tmp_path / "a.yaml")
    again = read_vehicle(tmp_path / "a.yaml")
    write_vehicle(again, tmp_path / "b.yaml")
    assert again == vehicle and (tmp_path / "a.yaml").read_bytes() == (tmp_path / "b.yaml").read_bytes()
    write_vehicle(audit_vehicle(), tmp_path / "none.yaml")
    assert "derivatives" not in (tmp_path / "none.yaml").read_text()


def of(i: int, **changes):
    def change(entries: list[dict]) -> list[dict]:
        return [e | changes if k == i else e for k, e in enumerate(entries)]

    return change


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (of(2, quantity="speeed"), "derivatives.2.quantity: found 'speeed', expected"),
        (of(2, channel="lift"), "derivatives.2.channel: found 'lift', expected"),
        (of(1, low=2.0, high=-2.0), "derivatives.1: low is 2, above high, -2"),
        (of(1, unit="N"), "derivatives.1: unit is 'N', expected 'N s/m' of force_x by u"),
        (of(0, low=0.0, high=0.0), "derivatives.0: a constant is 1, outside low to high, 0 to 0"),
        (lambda entries: [*entries, entries[3]], "derivatives.42 states force_x by w again, after derivatives.3"),
        (of(8, high=9.0), "derivatives.8 has another range of u than derivatives.1"),
        (of(5, value="0.1x"), "derivatives.5.value: found '0.1x', expected a number"),
        (of(5, valeu=1.0), "derivatives.5.valeu: no such key is known; did you mean value?"),
    ],
)
def test_what_does_not_fit_is_one_sentence_with_file_and_key(tmp_path, change, said):
    path = tmp_path / "vehicle.yaml"
    write_vehicle(stated(audit_vehicle()), path)
    content = yaml.safe_load(path.read_text())
    content["derivatives"] = change(content["derivatives"])
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(InputError) as caught:
        read_vehicle(path)
    assert str(caught.value).startswith(f"{path}: ") and said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_bench_has_none():
    with pytest.raises(ValueError, match="derivatives belong to a vehicle of kind flight, this is a bench"):
        Vehicle(name="bench", kind="bench", derivatives=at_random())


def test_the_vehicle_believed_of_a_recording_has_none():
    vehicle = stated(audit_vehicle(effects=(DRAG,)))
    trace = simulate_as_stated(vehicle, commands(), 0.2, 0.004, start=replace(start()))
    believed = record_as_stated(trace, vehicle, "flight").vehicle
    assert believed.derivatives == () and believed.effects == ()
    assert believed == audit_vehicle()


def test_a_pilot_trims_them_and_flies():
    vehicle = stated(templates.read("thesis"))
    same, said = flyable(vehicle)
    assert same.derivatives == vehicle.derivatives and said == ()
    found = hover(vehicle, None, 100.0)
    at_rest = wrench_at_rest(vehicle, None, np.array([found.thrust_n, *found.moments_n_m]), 100.0)
    np.testing.assert_allclose(at_rest, [vehicle.mass_kg * vehicle.gravity_m_s2, 0, 0, 0], atol=1e-7)
    constant = {d.channel: d.value for d in vehicle.derivatives if d.quantity == "constant"}
    assert found.moments_n_m[0] == pytest.approx(-constant["moment_x"], rel=1e-4)
    flown = swings(vehicle, "trial", 4.0, 1, 1)
    assert turned_over(flown) == () and flown.vehicle.derivatives == ()


@pytest.mark.parametrize(("form", "fly"), [("rotorpy", in_rotorpy), ("mjcf", in_mujoco)])
@pytest.mark.parametrize(
    ("known", "channels"),
    [(QUANTITIES[:7], CHANNELS), (QUANTITIES[:7], CHANNELS[3:5]), (QUANTITIES, CHANNELS)],
    ids=["of the state", "two", "of the rotors, too"],
)
def test_a_companion_flies_them_in_the_tools_own_step(form, fly, known, channels):
    pytest.importorskip({"rotorpy": "rotorpy", "mjcf": "mujoco"}[form])
    vehicle = stated(templates.read("thesis"), at_random(known, channels=channels))
    exported = export_vehicle(vehicle, form)
    (text,) = exported.companions.values()
    assert len(text.splitlines()) < 60 and "next to it adds them" in " ".join(exported.left_out)
    found = fly(vehicle, exported, 0.1)
    assert found.position_m < 1e-8 * found.flown_m and found.angle_rad < 1e-6 * found.turned_rad
    # Without the companion, and with ranges that are not held: the comparison could fail.
    assert fly(vehicle, replace(exported, companions={}), 0.1).angle_rad > 1e3 * found.angle_rad
    wide = text.replace("1.5", "99").replace("LOW = np.array([1, -1, -3", "LOW = np.array([1, -1, -9")
    assert fly(vehicle, replace(exported, companions=dict.fromkeys(exported.companions, wide)), 0.1).angle_rad > (
        1e3 * found.angle_rad
    )


def test_mujoco_has_its_own_callback_back():
    mujoco = pytest.importorskip("mujoco")
    vehicle = stated(templates.read("thesis"))
    in_mujoco(vehicle, export_vehicle(vehicle, "mjcf"), 0.01)
    assert mujoco.get_mjcb_passive() is None


@pytest.mark.slow
def test_gazebos_linear_damping_flies_the_same_in_drake():
    pytest.importorskip("pydrake", reason="drake is not installed: the exported SDF was not flown")
    vehicle = stated(audit_vehicle(effects=(DRAG,)))
    exported = export_vehicle(vehicle, "sdf")
    found = in_drake(vehicle, exported)
    assert found.position_m < 5e-5 * found.flown_m and found.angle_rad < 5e-3 * found.turned_rad
    without = replace(exported, text=exported.text.replace("::Hydrodynamics", "::Nothing"))
    assert in_drake(vehicle, without).position_m > 100 * found.position_m


def test_gazebos_terms_are_the_derivatives_in_its_axes():
    vehicle = stated(audit_vehicle())
    text = export_vehicle(vehicle, "sdf").text
    assert len(ElementTree.fromstring(text).findall("model/plugin")) == 5
    matrix = table_of(vehicle.derivatives)[0][:, 1:7]
    signs = np.tile([1.0, -1.0, -1.0], 2)
    np.testing.assert_allclose(gazebo_damping_of(text), signs[:, None] * matrix * signs, rtol=1e-8)
    assert "Hydrodynamics" not in export_vehicle(audit_vehicle(), "sdf").text


@pytest.mark.parametrize("window_wind", [(0.0, 0.0, 0.0), (3.0, -2.0, 0.5)])
@pytest.mark.parametrize(("form", "module"), [("rotorpy", "rotorpy"), ("mjcf", "mujoco")])
def test_next_to_a_log_the_companion_flies_too(form, module, window_wind):
    pytest.importorskip(module)
    from tests.unit.report.test_next_to_log import hovering

    vehicle = stated(templates.read("x500"))
    window = replace(hovering(vehicle, (2.0, -1.0, 0.5)), wind=np.array(window_wind))
    (flown,) = next_to_log.FLYERS[form][2](vehicle, export_vehicle(vehicle, form), [window])
    (ours,) = next_to_log.as_expressed(form, vehicle, export_vehicle(vehicle, form), [window])
    np.testing.assert_allclose(flown.velocity, ours.velocity, atol=1e-7)
    np.testing.assert_allclose(flown.angular_velocity, ours.angular_velocity, atol=1e-7)


def x500_with(*values: tuple[str, str, float]) -> Vehicle:
    own = tuple(
        d.model_copy(update={"value": value})
        for channel, quantity, value in values
        for d in at_random()
        if (d.channel, d.quantity) == (channel, quantity)
    )
    return stated(templates.read("x500"), own)


ALIKE = [("force_x", "u", -0.3), ("force_y", "v", -0.3), ("force_z", "w", -0.3)]
TURNS = [("moment_x", "p", -0.01), ("moment_y", "q", -0.01), ("moment_z", "r", -0.02)]


@pytest.mark.parametrize("form", ["px4-sih", "ardupilot-json"])
def test_linear_drag_of_sih_and_ardupilot_slows_as_it_should(form):
    """v(t) = v0 exp(−0.3 t/m) at the hover."""
    from tests.unit.report.test_next_to_log import FORMS, hovering

    vehicle = x500_with(*ALIKE)
    (flown,) = FORMS[form](vehicle, export_vehicle(vehicle, form), [hovering(vehicle, (4.0, 0.0, 0.0))])
    assert flown.velocity[-1, 0] == pytest.approx(4.0 * math.exp(-0.3 * 0.5 / vehicle.mass_kg), rel=2e-3)


def test_one_drag_and_one_damping_are_means_by_what_was_flown():
    vehicle = x500_with(("force_x", "u", -0.3), ("force_y", "v", -0.1), *TURNS)
    exported = export_vehicle(vehicle, "px4-sih")
    values = autopilots.sih_values(exported.text)
    # Ranges to 1.5, 3 m/s and none along z; to 3, 3 and 1 rad/s.
    assert values["SIH_KDV"] == pytest.approx((0.3 * 1.5**2 + 0.1 * 3**2) / (1.5**2 + 3**2))
    j = vehicle.inertia_kg_m2.matrix().diagonal()
    weights = np.array([3, 3, 1]) ** 2 / j**2
    assert values["SIH_KDW"] == pytest.approx(weights @ [0.01, 0.01, 0.02] / weights.sum())
    assert sum(s.startswith("derivatives") for s in exported.left_out) == 1
    both = vehicle.model_copy(update={"effects": (DRAG,)})
    plain = autopilots.sih_values(export_vehicle(both.model_copy(update={"derivatives": ()}), "px4-sih").text)
    added = autopilots.sih_values(export_vehicle(both, "px4-sih").text)
    assert added["SIH_KDV"] == pytest.approx(plain["SIH_KDV"] + values["SIH_KDV"])
    frame = autopilots.ardupilot_values(export_vehicle(vehicle, "ardupilot-json").text)
    rate = np.average([0.01, 0.01, 0.02] / j, weights=[9, 9, 1])
    assert np.radians(400) / frame["refRotRate"] == pytest.approx(rate)


def test_what_drives_a_vehicle_on_makes_no_negative_drag():
    vehicle = x500_with(*[(c, q, -v) for c, q, v in (*ALIKE, *TURNS)])
    values = autopilots.sih_values(export_vehicle(vehicle, "px4-sih").text)
    assert values["SIH_KDV"] == 0 and values["SIH_KDW"] == 0
    frame = autopilots.ardupilot_values(export_vehicle(vehicle, "ardupilot-json").text)
    assert frame["mdrag_coef"] == 0 and frame["refRotRate"] == 0


@pytest.mark.parametrize("form", names_of_forms())
def test_every_form_names_what_it_has_no_place_for(form):
    exported = export_vehicle(stated(templates.read("x500"), at_random(QUANTITIES)), form)
    said = [s for s in exported.left_out if s.startswith("derivatives")]
    assert 1 <= len(said) <= 2 and all(len(s) < 220 for s in said)
    assert f"Not expressed: {said[-1]}" in exported.text and ("smaller)" in said[-1] or exported.companions)
    plain = export_vehicle(templates.read("x500"), form)
    assert plain.companions == {} and not any("derivatives" in s for s in plain.left_out)


def test_the_command_writes_the_companion_next_to_the_file(tmp_path):
    write_vehicle(stated(templates.read("thesis")), tmp_path / "v.yaml")
    for form, file in (("rotorpy", ROTORPY_FILE), ("mjcf", MUJOCO_FILE)):
        folder = tmp_path / form
        said = answer("export", tmp_path / "v.yaml", "--to", form, "-o", folder / "made")
        assert {p.name for p in folder.iterdir()} == {"made", file} and file in said


@pytest.mark.parametrize("name", ["x500", "neurobem"])
def test_a_control_asks_for_what_the_rotors_make(name):
    vehicle = templates.read(name)
    rng, hub = np.random.default_rng(3), vehicle.rotor_positions_m()
    square = (vehicle.mass_kg * 9.81 / vehicle.thrust_coefficients_n_s2().sum()) * rng.uniform(0.5, 1.5, len(hub))
    thrust = vehicle.thrust_coefficients_n_s2() * square
    made = {
        "force_z": -thrust.sum(),
        "moment_x": -(thrust * hub[:, 1]).sum(),
        "moment_y": (thrust * hub[:, 0]).sum(),
        "moment_z": (vehicle.yaw_signs() * vehicle.torque_coefficients_n_m_s2() * square).sum(),
    }
    x = quantities(Motion(time_s=np.zeros(1), rotor_speed=np.sqrt(square)[None]), vehicle)[0]
    for channel, (quantity, unit) in own_controls(vehicle).items():
        hovering = unit if quantity == "thrust" else 0.0
        assert hovering + unit * x[QUANTITIES.index(quantity)] == pytest.approx(made[channel], rel=2e-3)


def test_quantities_of_another_hover():
    vehicle = templates.read("x500")
    other = vehicle.model_copy(update={"mass_kg": 1.3 * vehicle.mass_kg})
    turning = Motion(time_s=np.zeros(1), rotor_speed=np.array([[500.0, 600.0, 550.0, 450.0]]))
    assert about_hover_of(quantities(turning, vehicle), vehicle, other)[:, 7:] == pytest.approx(
        quantities(turning, other)[:, 7:]
    )
