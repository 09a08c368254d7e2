"""The independent simulator, held to numbers worked out by hand; and the sets it writes, held to the contract."""

import ast
import json
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rotorid.recordings import read_set
from rotorid_proof import concealed
from rotorid_proof.concealed import build, cases, rotorpy_cases
from rotorid_proof.concealed.richsim import flight, manoeuvres, physics, scene
from rotorid_proof.concealed.richsim.hidden import CAUSES, Hidden, World
from rotorid_proof.concealed.richsim.scene import Plan, Run
from rotorid_proof.concealed.richsim.vehicles import AIRFRAMES

THESIS = AIRFRAMES["thesis"]
G = 9.81
CF, CQ, MASS, ARM = 1.3877e-6, 1.8558e-8, 0.652, 0.0884
JXX, JYY, JZZ = 2.489e-3, 2.5743e-3, 4.6838e-3


def rates_at(changes, speeds=(1000.0,) * 4, v=(0.0, 0.0, 0.0), omega=(0.0, 0.0, 0.0), height=50.0, **inputs):
    """(force N, moment N m, state derivative, aux) of the thesis's vehicle, level, at a given motion."""
    values = physics.clean_physics(THESIS) | changes
    n = 4
    y = np.zeros(physics.state_size(n))
    y[2] = -height
    y[3:6] = v
    y[6] = 1.0
    y[10:13] = omega
    y[13 + 2 * n : 13 + 3 * n] = speeds
    y[13 + 3 * n : 13 + 4 * n] = inputs.get("speed_slope", (0.0,) * n)
    y[13 + 4 * n : 13 + 5 * n] = inputs.get("motor", speeds)
    y[13 + 5 * n] = 0.9
    y[13 + 5 * n + 1] = inputs.get("voltage", values["voltage_reference_v"])
    dy, aux = np.zeros_like(y), np.zeros(10 + 2 * n)
    w = np.array(speeds, float)
    p = physics.to_record(values)
    wind = np.array(inputs.get("wind", (0.0, 0.0, 0.0)), float)
    physics._rates(y, w, w, wind, np.zeros(n), 0.0, np.zeros(n), p, dy, aux)
    omega = np.array(omega, float)
    moment = values["inertia"] @ aux[3:6] + np.cross(omega, values["inertia"] @ omega)
    return values["mass"] * aux[0:3], moment, dy, aux


def added(changes, **state):
    """What a change adds to force and moment of the clean vehicle in the same state."""
    force, moment, _, _ = rates_at(changes, **state)
    clean_force, clean_moment, _, _ = rates_at({}, **state)
    return force - clean_force, moment - clean_moment


def test_clean_thrust_and_moments_are_those_of_the_contract():
    speeds = np.array([1100.0, 1000.0, 900.0, 1050.0])
    force, moment, _, _ = rates_at({}, speeds=speeds)
    f = CF * speeds**2
    q = CQ * speeds**2
    assert force == pytest.approx([0, 0, -f.sum()], abs=1e-12)
    expected = [(-f[0] + f[1] + f[2] - f[3]) * ARM, (f[0] + f[1] - f[2] - f[3]) * ARM, q[0] - q[1] + q[2] - q[3]]
    assert moment == pytest.approx(expected, abs=1e-12)


def test_hover_speed_carries_the_weight():
    w = THESIS.hover_speed_rad_s
    assert w == pytest.approx(1073.4, abs=0.1)  # thesis-map: 1073.4 rad/s
    _, _, dy, _ = rates_at({}, speeds=(w,) * 4)
    assert dy[3:6] == pytest.approx([0, 0, 0], abs=1e-12)


def test_free_fall_feels_nothing_and_gains_g():
    _, _, dy, aux = rates_at({}, speeds=(0.0,) * 4)
    assert aux[0:3] == pytest.approx([0, 0, 0], abs=1e-15)
    assert dy[3:6] == pytest.approx([0, 0, G])


def _tumble(step_s, duration_s=2.0):
    p = physics.to_record(physics.clean_physics(THESIS))
    n, size = 4, physics.state_size(4)
    y = np.zeros(size)
    y[6] = 1.0
    y[10:13] = (5.0, 0.4, -7.0)
    zero = np.zeros(n)
    k = [np.zeros(size) for _ in range(4)]
    aux = np.zeros(10 + 2 * n)
    for _ in range(int(round(duration_s / step_s))):
        physics._rates(y, zero, zero, np.zeros(3), zero, 0.0, zero, p, k[0], aux)
        physics._rk4(y, step_s, zero, zero, np.zeros(3), zero, 0.0, zero, p, *k, aux)
    return y


def test_torque_free_tumbling_keeps_energy_and_angular_momentum():
    inertia = np.diag([JXX, JYY, JZZ])
    start = np.array([5.0, 0.4, -7.0])
    y = _tumble(1e-3)
    assert y[10:13] @ inertia @ y[10:13] == pytest.approx(start @ inertia @ start, rel=1e-10)
    assert physics.rotation(y[6:10]) @ inertia @ y[10:13] == pytest.approx(inertia @ start, rel=1e-8)


def test_integrator_is_of_fourth_order():
    fine = _tumble(2.5e-4)[6:13]
    coarse = [np.abs(_tumble(h)[6:13] - fine).max() for h in (8e-3, 4e-3)]
    assert 12 < coarse[0] / coarse[1] < 20  # 2^4


AREA = np.array([0.01, 0.01, 0.02])
LIFT = 4 * CF * 1e6
SHARE = 0.1 * np.sqrt(0.5) * 6 / (6 + THESIS.hover_inflow_m_s)
"""What the two rear rotors lose to the front ones in forward flight: eps sin 45° v/(v + v_h)."""
FORWARD, CLIMB, ROLL, YAW = {"v": (3.0, -2.0, 0.0)}, {"v": (0, 0, -2.0)}, {"omega": (1.5, 0, 0)}, {"omega": (0, 0, 2.0)}
DOWN_AT_INFLOW = {"v": (0, 0, THESIS.hover_inflow_m_s)}
ADDED = {
    "rotor drag opposes airspeed at each hub": ({"drag_w": 5e-5}, FORWARD, [-0.6, 0.4, 0], [0, 0, 0]),
    # Every hub moves at r ARM √2, its drag brakes the turn at the same arm.
    "rotor drag brakes a turn in yaw": ({"drag_w": 5e-5}, YAW, None, [0, 0, -4 * 0.05 * 2.0 * 2 * ARM**2]),
    "wind is felt as airspeed": ({"drag_w": 5e-5}, {"wind": (4.0, 0, 0)}, [4 * 0.05 * 4, 0, 0], None),
    "inflow takes thrust from a climb": ({"inflow": 8e-5}, CLIMB, [0, 0, 4 * 0.08 * 2], None),
    "inflow damps rolling": ({"inflow": 8e-5}, ROLL, None, [-4 * 0.08 * 1.5 * ARM**2, 0, 0]),
    "lift with the square of edgewise speed": ({"lift": 0.0015}, {"v": (3.0, 4.0, 0)}, [0, 0, -4 * 0.0015 * 25], None),
    "frame drag is quadratic": (
        {"frame_area_m2": AREA}, {"v": (3.0, 0, 4.0)}, -0.5 * 1.225 * 5.0 * AREA * [3.0, 0, 4.0], None
    ),
    "frame drag of each axis by itself": (
        {"frame_area_m2": AREA, "frame_per_axis": 1.0}, {"v": (3.0, 0, 4.0)}, -0.5 * 1.225 * AREA * [9.0, 0, 16.0], None
    ),
    "flapping lifts the nose in forward flight": ({"flap": 2e-7}, {"v": (5.0, 0, 0)}, None, [0, 4 * 2e-4 * 5, 0]),
    # Counter-clockwise rotors faster: spin momentum points up, h_z = -J_r (2 · 1100 - 2 · 900).
    "gyroscopic moment of unequal spins": (
        {"gyroscopic": 1.0}, {"speeds": (1100.0, 900.0) * 2, "omega": (1.0, 0, 0)}, None, [0, -8.5e-6 * 400.0, 0]
    ),
    "speeding up a counter-clockwise rotor turns the vehicle clockwise": (
        {"acceleration": 1.0}, {"speed_slope": (2000.0, 0, 0, 0)}, None, [0, 0, 8.5e-6 * 2000.0]
    ),
    "a centre of mass forward of the rotors drops the nose": (
        {"centre_m": np.array([0.002, 0, 0])}, {}, None, [0, -0.002 * LIFT, 0]
    ),
    # At one radius above ground: 1/(1 - 1/16).
    "ground effect is Cheeseman and Bennett's": (
        {"ground": 1.0}, {"height": 0.0635}, [0, 0, -LIFT * (1 / (1 - 1 / 16) - 1)], None
    ),
    "damping": ({"damping": np.array([1e-3, 0, 0])}, {"omega": (2.0, 0, 0)}, [0, 0, 0], [-2e-3, 0, 0]),
    "rear rotors in the wake lose lift: nose up": (
        {"interference": 0.1}, {"v": (6.0, 0, 0)}, [0, 0, LIFT / 2 * SHARE], [0, LIFT / 2 * SHARE * ARM, 0]
    ),
    "a vortex ring takes thrust": ({"ring_mean": 0.1}, DOWN_AT_INFLOW, [0, 0, LIFT * 0.1], None),
}  # fmt: skip
"""What a change adds to force, N, and moment, N m, in a state of motion, by hand; None is not worked out."""


@pytest.mark.parametrize("what", ADDED)
def test_an_effect_adds_what_was_worked_out_by_hand(what):
    changes, state, *wanted = ADDED[what]
    for found, by_hand in zip(added(changes, **state), wanted, strict=True):
        if by_hand is not None:
            assert found == pytest.approx(by_hand, abs=1e-12)


def test_tilted_thrust_pushes_sideways():
    axis = np.tile([0.01, 0.0, -1.0], (4, 1)) / np.hypot(1, 0.01)
    force, _ = added({"axis": axis})
    assert force[0] == pytest.approx(0.01 * 4 * CF * 1e6, rel=1e-3)


def test_motor_lag_rises_with_its_time_constant():
    values = {"tau_up": np.full(4, 0.03), "tau_down": np.full(4, 0.06)}
    _, _, dy, _ = rates_at(values, speeds=(1100.0,) * 4, motor=(1000.0,) * 4)
    assert dy[13 + 16 : 13 + 20] == pytest.approx(100 / 0.03)
    _, _, dy, _ = rates_at(values, speeds=(900.0,) * 4, motor=(1000.0,) * 4)
    assert dy[13 + 16 : 13 + 20] == pytest.approx(-100 / 0.06)


def test_command_becomes_speed_through_throttle_curve_battery_and_limit():
    def speed(changes, **inputs):
        return rates_at(changes, speeds=(1200.0,) * 4, **inputs)[3][6]

    assert speed({}) == 1200.0
    # u = 0.5: T / T_max = 0.7 * 0.5 + 0.3 * 0.25
    assert speed({"throttle_blend": 0.3}) == pytest.approx(2400 * np.sqrt(0.7 * 0.5 + 0.3 * 0.25))
    assert speed({"throttle_dead": 0.1}) == pytest.approx(2400 * (0.5 - 0.1) / 0.9)
    assert speed({"sag": 1.0, "voltage_reference_v": 12.0}, voltage=10.8) == pytest.approx(1200 * 0.9)
    assert speed({"speed_high": 1150.0}) == 1150.0


@pytest.mark.parametrize("vehicle", sorted(AIRFRAMES))
def test_blade_elements_carry_the_vehicle_and_behave_like_a_rotor(vehicle):
    a = AIRFRAMES[vehicle]
    w = World.clean(a)
    CAUSES["rotor_drag"].apply(w, 1.0, Hidden("rotor_drag", form="blade"), np.random.default_rng(0))
    p, s = physics.to_record(w.values), a.hover_speed_rad_s
    still, drag = physics.blade_forces(s, 0.0, 0.0, p)
    assert still == pytest.approx(a.mass_kg * G / a.n, rel=1e-6)
    assert drag == pytest.approx(0.0, abs=1e-9 * still)
    assert physics.blade_forces(1.3 * s, 0.0, 0.0, p)[0] == pytest.approx(1.69 * still, rel=1e-6)
    assert physics.blade_forces(s, -2.0, 0.0, p)[0] < still < physics.blade_forces(s, 2.0, 0.0, p)[0]
    moving, drag = physics.blade_forces(s, 0.0, 5.0, p)
    assert moving > still and drag > 0


@pytest.mark.parametrize("vehicle", sorted(AIRFRAMES))
@pytest.mark.parametrize("rate_hz", [100.0, 500.0])
def test_nothing_hidden_leaves_nothing_but_noise(vehicle, rate_hz):
    groups = (*cases.BOTH, "height")
    _, truth, _ = scene.make(Plan(vehicle=vehicle, rate_hz=rate_hz, groups=groups, runs=(Run("rich", 12.0),)), 1)
    for channel, numbers in truth["oracle"]["runs"]["run01"].items():
        assert numbers["mismatch_rms"] < 0.01 * numbers["noise_rms"], channel
    assert truth["verdict"] == ["no_mismatch"] and not truth["effects"]


@pytest.mark.parametrize("effect", ["rotor_drag", "axial_inflow", "com_offset", "accelerometer_error"])
def test_effects_stand_at_the_wanted_size_over_the_noise(effect):
    _, truth, _ = scene.make(Plan(runs=(Run("rich", 12.0),), hidden=(Hidden(effect, size=1.5),)), 2)
    numbers = truth["oracle"]["runs"]["run01"][truth["effects"][0]["main_channel"]]
    assert numbers["mismatch_rms"] / numbers["noise_rms"] == pytest.approx(1.5, rel=0.2)


def test_step_response_of_a_lagging_motor_in_flight():
    a = THESIS
    values = physics.clean_physics(a) | {"tau_up": np.full(4, 0.05), "tau_down": np.full(4, 0.05)}
    segments = [manoeuvres.Segment("pulses", 8.0, 0.06), manoeuvres.Segment("hover", 2.0)]
    reference = manoeuvres.build(segments, 5.0, a.step_s, 4, np.random.default_rng(0))
    f = flight.fly(a, flight.tuned(values, 250.0), reference)
    lagged = f.speed_rad_s + 0.05 * np.gradient(f.speed_rad_s, a.step_s, axis=0)
    assert np.abs(lagged - f.command_rad_s)[5:-5].max() < 1.0


def _small(name):
    case = next(c for c in cases.all_cases() if c.name == name)
    runs = tuple(Run(r.purpose, 7.0) for r in case.settings.runs[:2])
    return replace(case, settings=replace(case.settings, runs=runs))


@pytest.mark.parametrize(
    "name",
    [
        *("single/rotor_drag/moderate/0", "single/throttle_curve/moderate/1", "mistake/unit_error/rpm/8"),
        *("wrong/mass_kg/1", "confusable/3/thrust_tilt/without/0", "outside/tether/1", "clean/000"),
    ],
)
def test_sets_follow_the_contract_and_tell_nothing(name, tmp_path):
    case = _small(name)
    build.build(case, tmp_path / "sets", tmp_path / "answers")
    folder = tmp_path / "sets" / case.set_name
    recordings = read_set(folder)
    assert len(recordings.runs) == len(case.settings.runs)
    for run in recordings.runs:
        assert not run.unknown_columns
        assert np.all(np.diff(run.time_s) > 0)
    answer = json.loads((tmp_path / "answers" / f"{case.set_name}.json").read_text())
    told = " ".join([case.set_name, (folder / "vehicle.yaml").read_text()])
    assert not [word for word in (*CAUSES, "clean", "wrong") if word in told]
    assert answer["case"] == name and set(case.truth) <= set(answer["expected"])


@pytest.mark.slow
def test_same_seed_same_bytes(tmp_path):
    case = _small("mixture/01/0")
    for where in ("a", "b"):
        build.build(case, tmp_path / where / "sets", tmp_path / where / "answers")
    files = sorted(p.relative_to(tmp_path / "a") for p in (tmp_path / "a").rglob("*.*") if p.is_file())
    assert len(files) >= 4
    for f in files:
        assert (tmp_path / "a" / f).read_bytes() == (tmp_path / "b" / f).read_bytes(), f


def test_answers_cannot_lie_among_the_sets(tmp_path):
    with pytest.raises(SystemExit):
        build.main(["--cases", "clean/000", "--out", str(tmp_path), "--answers", str(tmp_path / "in")])


def test_generators_share_nothing_with_the_library():
    folder = Path(concealed.__file__).parent
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not [n for n in names if n.split(".")[0] in ("rotorid", "acquire", "workflow")], path


@pytest.mark.parametrize("simulator", ["multibody", "continuous", "rig"])
def test_simulators_of_drawn_cases_share_nothing_with_each_other(simulator):
    """Only the form of a set and the yardstick for the noise are common."""
    for path in (Path(concealed.__file__).parent / simulator).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.level > 1:
                assert node.module in ("residuals", "write"), path


def test_every_class_of_case_is_there():
    found = cases.all_cases()
    by_class = Counter(c.name.split("/")[0] for c in found)
    assert by_class["clean"] >= 200 and by_class["mixture"] >= 20
    assert len({c.set_name for c in found}) == len(found)
    singles = {c.name.split("/")[1] for c in found if c.name.startswith("single/")}
    assert singles == set(cases.RECIPES)


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", ["hummingbird", "crazyflie"])
def test_rotorpy_with_everything_off_is_the_contracts_rigid_body(vehicle):

    plan = rotorpy_cases.RotorpyPlan(vehicle=vehicle, runs=(Run("calm", 4.0),))
    recording, truth, ideal = rotorpy_cases.make(plan, 1)
    for channel, numbers in truth["oracle"]["runs"]["run01"].items():
        assert numbers["mismatch_rms"] < 0.1 * numbers["noise_rms"], channel
    w = ideal["run01"]["rotor_speed_1_rad_s"].to_numpy()
    v = recording.vehicle
    hover = np.sqrt(v["mass_kg"] * G / 4 / v["thrust_coefficient_n_s2"])
    assert np.median(w) == pytest.approx(hover, rel=0.05)
