"""Flights on the multibody engine against closed results: hover, pendulums, terminal speed, energy, a motor's lag."""

import mujoco
import numpy as np
import pytest

from rotorid_proof.concealed.multibody import course
from rotorid_proof.concealed.multibody.cases import FAMILIES, bodies, drafted, make
from rotorid_proof.concealed.multibody.engine import STEP, Lost, World, airload, cushion, fly, machine, mjcf
from rotorid_proof.concealed.multibody.vehicle import GRAVITY, RHO, drawn

QUAD = drawn(np.random.default_rng(4))
SEED = 20


def resting(seconds):
    """A reference that stays where it is, 12 m above the ground."""
    path = np.zeros((int(seconds / STEP), 13))
    path[:, 2] = -12.0
    return path


def test_hover_holds_the_weight_and_the_accelerometer_reads_it():
    path = resting(2.0)
    flight = fly(QUAD, World(), path, np.zeros((len(path), 3)), 12.0)
    assert flight["speed"] == pytest.approx(QUAD.hover, rel=1e-6)
    assert flight["f"][-1] == pytest.approx([0, 0, -GRAVITY], abs=1e-6)
    assert np.abs(flight["p"] - path[:, :3]).max() < 1e-6


def test_inertia_mass_and_centre_of_a_body_with_a_tank_at_rest_are_the_believed_ones():
    draft, _, _ = drafted("sloshing", SEED)
    model = mujoco.MjModel.from_xml_string(mjcf(draft.quad, draft.world))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    total = model.body_subtreemass[0]
    assert total == pytest.approx(draft.quad.mass, rel=1e-9)
    assert data.subtree_com[1] == pytest.approx([0, 0, 0], abs=2e-3 * draft.quad.arm)
    inertia = np.zeros((3, 3))
    for b in range(1, model.nbody):
        turn = data.ximat[b].reshape(3, 3)
        r = data.xipos[b]
        inertia += turn @ np.diag(model.body_inertia[b]) @ turn.T
        inertia += model.body_mass[b] * (r @ r * np.eye(3) - np.outer(r, r))
    assert inertia == pytest.approx(draft.quad.inertia, abs=0.02 * draft.quad.inertia[0, 0])


def test_a_load_on_a_cable_swings_with_the_period_of_a_pendulum():
    """From a held hook: T = 2π √(L/g) (1 + θ²/16) for a small ball on a light rod."""
    length, angle = 0.8, 0.2
    text = f"""<mujoco><option timestep="{STEP}" integrator="RK4" gravity="0 0 {GRAVITY}"/>
    <compiler boundmass="0" boundinertia="0"/><worldbody>{bodies((0, 0, 0), length, 0.1, 1, 1e-5, 0.0)}
    </worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:] = [np.cos(angle / 2), np.sin(angle / 2), 0, 0]
    side = []
    for _ in range(int(6 / STEP)):
        mujoco.mj_step(model, data)
        side.append(data.body("load").xpos[1])
    falls = np.flatnonzero((np.array(side[:-1]) < 0) & (np.array(side[1:]) >= 0))
    period = np.diff(falls).mean() * STEP
    expected = 2 * np.pi * np.sqrt(length / GRAVITY) * (1 + angle**2 / 16)
    assert period == pytest.approx(expected, rel=2e-3)


def test_a_tumbling_vehicle_without_forces_keeps_energy_and_angular_momentum():
    model = mujoco.MjModel.from_xml_string(mjcf(QUAD, World()).replace(f'gravity="0 0 {GRAVITY}"', 'gravity="0 0 0"'))
    data = mujoco.MjData(model)
    data.qvel[3:6] = (6.0, 0.5, -4.0)

    def state():
        turn = np.empty(9)
        mujoco.mju_quat2Mat(turn, data.qpos[3:7])
        momentum = QUAD.inertia @ data.qvel[3:6]
        return 0.5 * data.qvel[3:6] @ momentum, turn.reshape(3, 3) @ momentum

    energy, momentum = state()
    for _ in range(2000):
        mujoco.mj_step(model, data)
    assert state()[0] == pytest.approx(energy, rel=1e-8)
    assert state()[1] == pytest.approx(momentum, rel=1e-6)


def test_a_falling_frame_reaches_its_terminal_speed():
    """m g = ρ/2 C_d A v² with the frame alone: what `airload` takes at that speed is the weight."""
    area = np.array([0.02, 0.02, 0.03])
    speed = np.sqrt(2 * QUAD.mass * GRAVITY / (RHO * area[2]))
    none = np.zeros(4)
    force, moment = airload(np.eye(3), np.array([0, 0, speed]), np.zeros(3), np.zeros(3), none, none, QUAD.hubs, 0.0,
                            0.0, area)  # fmt: skip
    assert force == pytest.approx([0, 0, -QUAD.mass * GRAVITY])
    assert moment == pytest.approx([0, 0, 0])


def test_a_wind_against_a_drag_that_is_known_tilts_the_hover():
    """The hubs' drag balances the weight's part in their plane: Σ k ω v cos θ = m g sin θ, nose up in a wind ahead."""
    k, wind = 0.3 * QUAD.mass / (4 * QUAD.hover), 3.0
    path = resting(8.0)
    blow = np.tile([wind, 0.0, 0.0], (len(path), 1))
    flight = fly(QUAD, World(drag_speed=k, wind=blow), path, np.zeros((len(path), 3)), 12.0)
    q = flight["q"][-1]
    pitch = 2 * np.arctan2(q[2], q[0])
    drag = 4 * k * flight["speed"][-1].mean() * wind
    assert QUAD.mass * GRAVITY * np.tan(pitch) == pytest.approx(drag, rel=0.02)


def test_the_motor_lags_as_its_linear_equation_says_and_the_ground_lifts_at_one_radius():
    m = {"k": 0.006, "r": 0.1, "j": 2e-5}
    w, torque, voltage = 900.0, 2e-8, 11.0
    duty = (m["k"] * w + m["r"] * torque * w**2 / m["k"]) / voltage
    assert machine(w, duty, voltage, m, torque)[0] == pytest.approx(0, abs=1e-9)
    step = (machine(w + 1, duty, voltage, m, torque)[0] - machine(w - 1, duty, voltage, m, torque)[0]) / 2
    tau = m["j"] / (m["k"] ** 2 / m["r"] + 2 * torque * w)
    assert step == pytest.approx(-1 / tau, rel=1e-6)
    near, far = cushion(np.array([0.1, 3.0]), 0.1, 0.3)
    assert near > 1 / (1 - 1 / 16) and far == pytest.approx(1.0, abs=2e-3)


def test_rotors_of_much_inertia_that_follow_at_once_make_yaw_swing_and_are_refused():
    path = np.zeros((1000, 13))
    path[:, 2] = -2.0
    noise = 0.01 * np.random.default_rng(1).standard_normal((len(path), 3))
    assert len(fly(QUAD, World(rotor_inertia=2e-6), path, noise, 12.0)["w"]) == len(path)
    with pytest.raises(Lost, match="yaw swings"):
        fly(QUAD, World(rotor_inertia=3e-3), path, noise, 12.0)


@pytest.mark.slow
def test_a_clean_flight_leaves_noise_alone_and_a_seed_gives_the_same_set(monkeypatch):
    short = course.reference
    monkeypatch.setattr(course, "reference", lambda seconds, *a, **k: short(7.0, *a, **k))
    recording, truth, _ = make("clean", SEED)
    again, _, _ = make("clean", SEED)
    assert all(recording.runs[r].equals(again.runs[r]) for r in recording.runs)
    assert truth["effects"] == [] and truth["verdict"][0] == "no_mismatch"
    for channel, found in truth["oracle"]["runs"]["run01"].items():
        assert found["mismatch_rms"] < 0.5 * found["noise_rms"], channel


@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_every_family_is_drawn_with_an_answer(family):
    draft, _, runs = drafted(family, SEED)
    mujoco.MjModel.from_xml_string(mjcf(draft.quad, draft.world))
    assert bool(draft.effects or draft.outside or draft.wrong) == (family != "clean")
    assert len(runs) >= 3
