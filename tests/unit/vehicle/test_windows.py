import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rotorid.effects.catalogue import catalogue
from rotorid.vehicle.attitude import quaternion_from_euler, rotation_from_quaternion
from rotorid.vehicle.improved import active_forms
from rotorid.vehicle.windows import Inputs, States, plan_windows, simulate_windows
from tests.unit.vehicle.thesis import thesis_vehicle

HOVER = np.sqrt(0.652 * 9.81 / (4 * 1.3877e-6))


def rest(n, **changes):
    values = dict(
        angular_velocity=np.zeros((n, 3)),
        quaternion=np.tile([1.0, 0, 0, 0], (n, 1)),
        velocity=np.zeros((n, 3)),
        position=np.zeros((n, 3)),
    )
    return States(**(values | changes))


def form(effect, name, vehicle):
    return {f.name: f for f in catalogue()[effect].forms(vehicle)}[name]


def test_free_fall_is_exact():
    time = np.arange(101) / 100
    found = simulate_windows(thesis_vehicle(), [], time, Inputs(np.zeros((101, 4))), rest(101))
    assert found.sample.shape == (2, 51)
    since = time[found.sample] - time[found.sample[:, :1]]
    np.testing.assert_allclose(found.predicted.velocity[..., 2], 9.81 * since, atol=1e-12)
    np.testing.assert_allclose(found.predicted.position[..., 2], 0.5 * 9.81 * since**2, atol=1e-12)


def test_hover_speed_of_the_thesis_holds_still():
    time = np.arange(101) / 100
    found = simulate_windows(thesis_vehicle(), [], time, Inputs(np.full((101, 4), HOVER)), rest(101))
    assert HOVER == pytest.approx(1073.4, abs=0.1)
    np.testing.assert_allclose(found.predicted.velocity, 0, atol=1e-12)
    np.testing.assert_allclose(found.predicted.angular_velocity, 0, atol=1e-12)


def test_a_faster_left_pair_rolls_right_by_the_hand_computed_rate():
    vehicle = thesis_vehicle()
    speeds = np.tile([1000.0, 1010.0, 1010.0, 1000.0], (51, 1))
    found = simulate_windows(vehicle, [], np.arange(51) / 100, Inputs(speeds), rest(51))
    # tau = 2 C_F d (1010² - 1000²) = 2 * 1.3877e-6 * 0.0884 * 20100 = 4.93146e-3 N m; p' = tau / 2.489e-3.
    np.testing.assert_allclose(found.predicted.angular_velocity[0, -1, 0], 1.98131 * 0.5, rtol=1e-4)


def reference(vehicle, speed_of, start, time, force_of):
    """The same flight by scipy, coded apart: states (n, 13) rates, quaternion, velocity, position."""
    J = vehicle.inertia_kg_m2.matrix()
    cf, cq, d = 1.3877e-6, 1.8558e-8, 0.0884

    def derivative(t, y):
        W, q, v = y[:3], y[3:7], y[7:10]
        F = cf * speed_of(t) ** 2
        Q = cq * speed_of(t) ** 2
        tau = np.array([(-F[0] + F[1] + F[2] - F[3]) * d, (F[0] + F[1] - F[2] - F[3]) * d, Q[0] - Q[1] + Q[2] - Q[3]])
        R = rotation_from_quaternion(q / np.linalg.norm(q))
        body = np.array([0, 0, -F.sum()]) + force_of(t, R, v, W)
        o = np.array([[0, -W[0], -W[1], -W[2]], [W[0], 0, W[2], -W[1]], [W[1], -W[2], 0, W[0]], [W[2], W[1], -W[0], 0]])
        return np.concatenate(
            [np.linalg.solve(J, tau - np.cross(W, J @ W)), 0.5 * o @ q, R @ body / 0.652 + [0, 0, 9.81], v]
        )

    return solve_ivp(derivative, (time[0], time[-1]), start, t_eval=time, rtol=1e-10, atol=1e-10).y.T


def manoeuvre(n=501, rate=500.0):
    time = np.arange(n) / rate
    phase = np.array([0.0, 1.0, 2.0, 3.0])

    def speed_of(t):
        return HOVER * (1 + 0.05 * np.sin(2 * np.pi * 2 * t + phase))

    start = np.concatenate([[0.3, -0.2, 0.5], quaternion_from_euler([0.2, -0.1, 1.0]), [4.0, -2.0, 0.5], [1.0, 2, -5]])
    return time, speed_of, start


def test_matches_an_independent_integration_with_drag():
    vehicle = thesis_vehicle()
    time, speed_of, start = manoeuvre()
    drag = form("frame_drag", catalogue()["frame_drag"].forms(vehicle)[0].name, vehicle)
    values = np.full(len(drag.parameters), 0.05)
    force = drag.contribution

    def force_of(t, R, v, W):
        from rotorid.effects.contract import Motion

        motion = Motion(np.array([t]), speed_of(t)[None], velocity=(R.T @ v)[None], rotation=R[None])
        return force(motion, vehicle, values).force[0]

    truth = reference(vehicle, speed_of, start, time, force_of)
    recorded = States(truth[:, :3], truth[:, 3:7], truth[:, 7:10], truth[:, 10:])
    speeds = np.array([speed_of(t) for t in time])
    found = simulate_windows(vehicle, [(drag, values)], time, Inputs(speeds), recorded, step_s=0.002)
    for name, columns in (("angular_velocity", slice(0, 3)), ("velocity", slice(7, 10)), ("position", slice(10, 13))):
        np.testing.assert_allclose(getattr(found.predicted, name), truth[found.sample][..., columns], atol=3e-6)
    plain = simulate_windows(vehicle, [], time, Inputs(speeds), recorded, step_s=0.002)
    assert np.abs(plain.predicted.velocity[:, -1] - truth[found.sample[:, -1], 7:10]).max() > 0.05


def test_added_mass_converges_through_the_fixed_point():
    """A rigid payload of 0.1 kg in free fall with thrust: a = T / (m + m_p) in the body, by hand."""
    vehicle = thesis_vehicle()
    payload = form("payload", "rigid", vehicle)
    found = simulate_windows(
        vehicle, [(payload, [0.1, 0, 0, 0])], np.arange(51) / 100, Inputs(np.full((51, 4), HOVER)), rest(51)
    )
    expected = (9.81 - 0.652 * 9.81 / 0.752) * 0.5
    np.testing.assert_allclose(found.predicted.velocity[0, -1, 2], expected, rtol=1e-3)


def test_what_is_missing_limits_what_is_simulated():
    vehicle = thesis_vehicle()
    time, speeds = np.arange(60) / 100, np.full((60, 4), HOVER)
    only_rates = simulate_windows(vehicle, [], time, Inputs(speeds), States(np.zeros((60, 3))))
    assert only_rates.predicted.velocity is None and only_rates.predicted.quaternion is None
    no_position = simulate_windows(vehicle, [], time, Inputs(speeds), rest(60, position=None))
    assert no_position.predicted.position is None and no_position.predicted.velocity is not None
    drag = catalogue()["frame_drag"].forms(vehicle)[0]
    with pytest.raises(ValueError, match="no velocity or position recorded"):
        simulate_windows(
            vehicle, [(drag, np.zeros(len(drag.parameters)))], time, Inputs(speeds), States(np.zeros((60, 3)))
        )


def test_windows_avoid_gaps_and_missing_samples():
    time = np.concatenate([np.arange(120), np.arange(120) + 150]) / 100
    sample = plan_windows(time, 0.5)
    assert sample.shape[1] == 51
    assert [int(s) for s in sample[:, 0]] == [0, 50, 150]  # 100 would run over the hole at 120
    usable = np.ones(240, bool)
    usable[60] = False
    assert [int(s) for s in plan_windows(time, 0.5, usable=usable)[:, 0]] == [0, 150]


def test_long_steps_pass_over_samples():
    sample = plan_windows(np.arange(1001) / 1000, 0.5, step_s=0.01)
    assert sample.shape == (2, 51) and list(sample[0, :3]) == [0, 10, 20]


@pytest.mark.parametrize("spins, count", [(("ccw",), 1), (("ccw", "cw") * 3, 6)])
def test_any_number_of_rotors(spins, count):
    angle = 2 * np.pi * np.arange(count) / count
    rotors = [dict(x_m=0.2 * np.cos(a), y_m=0.2 * np.sin(a), spin=s) for a, s in zip(angle, spins, strict=True)]
    vehicle = thesis_vehicle(rotors=rotors)
    found = simulate_windows(vehicle, [], np.arange(51) / 100, Inputs(np.full((51, count), 500.0)), rest(51))
    expected = (9.81 - count * 1.3877e-6 * 500.0**2 / 0.652) * 0.5
    if count == 6:
        np.testing.assert_allclose(found.predicted.velocity[0, -1, 2], expected, rtol=1e-12)
    assert np.isfinite(found.predicted.velocity).all()


def test_every_wrench_form_of_the_catalogue_can_be_simulated():
    vehicle = thesis_vehicle(rotor_radius_m=0.0635, rotor_inertia_kg_m2=8.5e-6, ground_z_m=0.0)
    time, speed_of, start = manoeuvre(201)
    truth = reference(vehicle, speed_of, start, time, lambda t, R, v, W: np.zeros(3))
    recorded = States(truth[:, :3], truth[:, 3:7], truth[:, 7:10], truth[:, 10:])
    inputs = Inputs(np.array([speed_of(t) for t in time]), voltage=np.full(201, 11.0))
    tried = 0
    for effect in catalogue().values():
        if effect.kind != "physics":
            continue
        for one in effect.forms(vehicle):
            if one.memory:
                continue  # needs the past: its wrench is given as an input
            values = [p.starts[0] if p.starts else np.clip(1e-6, p.low, p.high) for p in one.parameters]
            found = simulate_windows(vehicle, [(one, values)], time, inputs, recorded, window_s=0.2)
            assert np.isfinite(found.predicted.velocity).all(), (effect.id, one.name)
            tried += 1
    assert tried > 20


def test_effects_of_a_vehicle_file():
    vehicle = thesis_vehicle(effects=[dict(id="translational_lift", form="at the hubs", parameters={"k_h": 0.003})])
    ((found, values),) = active_forms(vehicle)
    assert found.name == "at the hubs" and values == [0.003]
    for entry, message in (
        (dict(id="magic"), "entry 1 has id 'magic', expected one of"),
        (dict(id="translational_lift", parameters={"k_h": 1}), "has form None, expected one of at the hubs"),
        (dict(id="translational_lift", form="at the hubs", parameters={"k": 1}), "gives parameters k, expected k_h"),
    ):
        with pytest.raises(ValueError, match=message):
            active_forms(thesis_vehicle(effects=[entry]))


def test_speed_effects_of_a_vehicle_file():
    """A lag of 50 ms on a step: 1 - exp(-t/τ) by hand; the wrench effects are not touched."""
    from rotorid.vehicle.improved import speeds_of_commands

    vehicle = thesis_vehicle(
        effects=[
            dict(id="motor_lag", form="one constant", parameters={"tau": 0.05}),
            dict(id="translational_lift", form="at the hubs", parameters={"k_h": 0.003}),
        ]
    )
    time = np.arange(101) / 100
    command = np.full((101, 4), 1000.0)
    command[0] = 0.0
    speed = speeds_of_commands(vehicle, command, time)
    np.testing.assert_allclose(speed[1:, 0], 1000 * (1 - np.exp(-(time[1:] - 0.01) / 0.05)), atol=1e-9)
    assert [f.name for f, _ in active_forms(vehicle)] == ["at the hubs"]
