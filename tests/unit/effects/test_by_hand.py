"""Each effect at one plain state, against numbers worked out by hand (z down, thrust along −z).

The thesis's quadrotor with every rotor at 1000 rad/s: T = 1.3877 N and Q = 0.018558 N m a rotor, hubs at ±d.
"""

import numpy as np
import pytest

from rotorid.effects.catalogue import catalogue
from rotorid.effects.pendulum import likely_lengths
from rotorid.effects.scale import hover_inflow_m_s, scale
from tests.unit.mismatch.evidence.test_rows import still
from tests.unit.vehicle.thesis import thesis_vehicle

T, Q, D, G = 1.3877, 0.018558, 0.0884, 9.81
NORTH, EAST = np.eye(3), np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
"""Attitudes: level with the nose to the north or to the east."""


def row(x, y, z) -> np.ndarray:
    return np.array([[x, y, z]], float)


def contribution(effect_id: str, form: str, values, vehicle=None, **state):
    vehicle = vehicle or thesis_vehicle(rotor_radius_m=0.0635)
    found = {f.name: f for f in catalogue()[effect_id].forms(vehicle)}[form]
    if "specific_force" in state:
        state["accelerometer"] = state["specific_force"]
    return found.contribution(still(**state), vehicle, np.array(values, float))


FORCE_AND_MOMENT = [
    # climbing at 2 m/s: each rotor loses 8e-5 · 1000 · 2 = 0.16 N
    ("axial_inflow", "at the hubs", [8e-5], dict(velocity=row(0, 0, -2)), (0, 0, 0.64), (0, 0, 0)),
    ("axial_inflow", "independent of rotor speed", [0.3], dict(velocity=row(0, 0, -2)), (0, 0, 0.6), None),
    # 1 cm forward: the nose drops
    ("com_offset", "moment", [0.01, 0.0], {}, None, (0, -0.04 * T, 0)),
    ("com_offset", "moment", [0.0, 0.01], {}, None, (0.04 * T, 0, 0)),
    # pulled down as if it weighed 7 m/s2 times its mass, whatever the rotors do
    (
        *("com_offset", "moment of all forces", [0.01, 0.0], dict(specific_force=row(2, 0, -7))),
        *(None, (0, -0.01 * 7 * thesis_vehicle().mass_kg, 0)),
    ),
    # the nose rises in forward flight: 1e-6 · 4000 · 5
    ("flapping_moment", "at the hubs", [1e-6], dict(velocity=row(5, 0, 0)), None, (0, 0.02, 0)),
    ("flapping_moment", "independent of rotor speed", [0.01], dict(velocity=row(0, 5, 0)), None, (-0.05, 0, 0)),
    # |v| = 5
    ("frame_drag", "isotropic", [0.01], dict(velocity=row(3, 4, 0)), (-0.15, -0.2, 0), None),
    ("frame_drag", "per axis", [0.01, 0.02, 0.0], dict(velocity=row(3, 4, 0)), (-0.15, -0.4, 0), None),
    ("frame_drag", "per component", [0.01, 0.02, 0.0], dict(velocity=row(3, -4, 0)), (-0.09, 0.32, 0), None),
    ("inertia_products", "products", [0, 1e-4, 0], dict(angular_acceleration=row(10, 0, 0)), None, (0, 0, -1e-3)),
    # a pitch rate of 2 and J_xz: −Ω × E Ω = 0; with roll 2: E Ω = (0, 0, 2e-4), −Ω × … = (0, 4e-4, 0)
    ("inertia_products", "products", [0, 1e-4, 0], dict(angular_velocity=row(2, 0, 0)), None, (0, 4e-4, 0)),
    # 0.1 kg, 5 cm forward, at rest: pulls down, the nose with it
    (
        *("payload", "rigid", [0.1, 0.005, 0.0, 0.0], dict(specific_force=row(0, 0, -G))),
        *((0, 0, 0.1 * G), (0, -0.005 * G, 0)),
    ),
    # 0.1 kg 10 cm below: rolled at 20 rad/s2 it is thrown to the left and holds back; at 3 rad/s it pulls away from
    # the axis. Pushed forward at 2 m/s2 it stays behind, and the nose drops.
    (
        *(
            "payload",
            "rigid",
            [0.1, 0.0, 0.0, 0.01],
            dict(specific_force=row(0, 0, 0), angular_acceleration=row(20, 0, 0)),
        ),
        *((0, 0.2, 0), None),
    ),
    (
        *("payload", "rigid", [0.1, 0.0, 0.0, 0.01], dict(specific_force=row(0, 0, 0), angular_velocity=row(3, 0, 0))),
        *((0, 0, 0.09), None),
    ),
    ("payload", "rigid", [0.1, 0.0, 0.0, 0.01], dict(specific_force=row(2, 0, 0)), (-0.2, 0, 0), (0, -0.02, 0)),
    ("payload", "slung", [0.1, 0.01, 0.5, 0.05], dict(specific_force=row(0, 0, -G)), (0, 0, 0.1 * G), None),
    # Hung along what holds it, (1, 0, G) here: on a hook 10 cm below it turns the nose up, ẑ × F = (−F_y, F_x, 0).
    (
        *("payload", "slung", [0.1, 0.01, 0.5, 0.05], dict(specific_force=row(-1, 0, -G))),
        *((0.1, 0, 0.1 * G), (0, 0.01, 0)),
    ),
    # Flown at 2 m/s north through the air it trails by 2 ζ ω v, ω = √(g/L): 0.1 · 4.4294 · 2 m/s2.
    (
        *("payload", "slung, slowed by the air", [0.1, 0.0, 0.5, 0.05]),
        *(
            dict(specific_force=row(0, 0, -G), velocity=row(2, 0, 0)),
            (-0.1 * 0.1 * np.sqrt(G / 0.5) * 2, 0, 0.1 * G),
            None,
        ),
    ),
    ("rotational_damping", "linear", [1e-3, 2e-3, 0], dict(angular_velocity=row(3, -1, 5)), None, (-3e-3, 2e-3, 0)),
    ("rotational_damping", "quadratic", [1e-3, 1e-3, 0], dict(angular_velocity=row(3, -2, 5)), None, (-9e-3, 4e-3, 0)),
    # rotor 1 (ccw) speeds up by 1000 rad/s²: the airframe turns clockwise
    (
        *("rotor_acceleration_torque", "reaction", [1e-5], dict(rotor_acceleration=np.array([[1e3, 0, 0, 0]]))),
        *(None, (0, 0, 0.01)),
    ),
    ("rotor_drag", "per axis", [1e-4, 2e-4], dict(velocity=row(1, 1, 1)), (-0.4, -0.8, 0), None),
    ("rotor_drag", "independent of rotor speed", [0.3], dict(velocity=row(1, -2, 1)), (-0.3, 0.6, 0), None),
    # the cw pair faster by 200: momentum 400 · 1e-5 along +z; rolling right lifts the nose
    (
        *("rotor_gyroscopic", "gyroscopic", [1e-5]),
        dict(angular_velocity=row(2, 0, 0), rotor_speed=np.array([[1000.0, 1200, 1000, 1200]])),
        *(None, (0, 0.008, 0)),
    ),
    # forward at 5 m/s: each rear rotor (weight √½) loses 0.1 · 0.7071 T, and the nose rises
    (
        *("rotor_interference", "growing with airspeed", [0.02], dict(velocity=row(5, 0, 0))),
        *((0, 0, 0.2 * np.sqrt(0.5) * T), (0, 0.2 * np.sqrt(0.5) * T * D, 0)),
    ),
    # nose to the east: a push to the north comes from the right side, to the left
    ("steady_wind", "on the airframe", [0.5, 0.0], dict(rotation=EAST[None]), (0, -0.5, 0), None),
    ("steady_wind", "on the rotors", [0.0, 1e-4], dict(rotation=EAST[None]), (0.4, 0, 0), (0, 0, 0)),
    ("thrust_curve", "linear term", [1e-4], {}, (0, 0, -0.4), (0, 0, 0)),
    ("thrust_curve", "linear and constant", [0.02, 1e-4], {}, (0, 0, -0.48), (0, 0, 0)),
    ("thrust_curve", "cubic term", [1e-10], {}, (0, 0, -0.4), (0, 0, 0)),
    ("thrust_tilt", "all rotors, at the hubs", [0.01, 0.02], {}, (0.04 * T, 0.08 * T, 0), (0, 0, 0)),
    # rotor 1 (front right, ccw) tilted forward: it yaws left, and its torque leans
    ("thrust_tilt", "rotor 1", [0.01, 0.0], {}, (0.01 * T, 0, 0), (-0.01 * Q, 0, -0.01 * T * D)),
    ("translational_lift", "at the hubs", [0.003], dict(velocity=row(3, 4, 9)), (0, 0, -0.3), (0, 0, 0)),
    ("unequal_rotors", "rotor 1", [0.1], {}, (0, 0, -0.1 * T), (-0.1 * T * D, 0.1 * T * D, 0.1 * Q)),
    # the last rotor (4, rear right, cw) balances: −0.1, so the roll adds up and the pitch adds up
    ("unequal_rotors", "thrust", [0.1, 0, 0], {}, (0, 0, 0), (0, 0.2 * T * D, 0)),
    ("unequal_rotors", "torque", [0.1, 0, 0], {}, None, (0, 0, 0.2 * Q)),
]


@pytest.mark.parametrize(
    ("effect_id", "form", "values", "state", "force", "moment"),
    FORCE_AND_MOMENT,
    ids=[f"{c[0]}/{c[1]}/{k}" for k, c in enumerate(FORCE_AND_MOMENT)],
)
def test_force_and_moment(effect_id, form, values, state, force, moment):
    added = contribution(effect_id, form, values, **state)
    for found, expected in ((added.force, force), (added.moment, moment)):
        if expected is None:
            assert found is None or not found.any()
        else:
            np.testing.assert_allclose(found, [expected], atol=1e-12)


def test_readings():
    reading = dict(specific_force=row(1, 2, -9))
    scaled = contribution("accelerometer_error", "scale", [0.1, 0, 0.01], **reading)
    np.testing.assert_allclose(scaled.specific_force, [[0.1, 0, -0.09]])
    # θ × a with θ = (0, 0.01, 0): (0.01 · −9, 0, −0.01 · 1)
    turned = contribution("accelerometer_error", "misalignment", [0, 0.01, 0], **reading)
    np.testing.assert_allclose(turned.specific_force, [[-0.09, 0, -0.01]])
    arm = dict(angular_velocity=row(0, 0, 3), angular_acceleration=row(0, 0, 20))
    shifted = contribution("imu_lever_arm", "lever arm", [0.1, 0, 0], **arm)
    np.testing.assert_allclose(shifted.specific_force, [[-0.9, 2.0, 0]])
    # The centre of mass 0.1 m behind belief: what is recorded is the motion of a point 0.1 m in front of it.
    offset = contribution("com_offset", "moment and lever arm", [-0.1, 0], specific_force=row(0, 0, -9), **arm)
    np.testing.assert_allclose(offset.force, thesis_vehicle().mass_kg * np.array([[-0.9, 2.0, 0]]))
    gyro = contribution("gyro_error", "misalignment", [0.01, 0, 0], **arm)
    np.testing.assert_allclose(gyro.angular_velocity, [[0, -0.03, 0]])
    np.testing.assert_allclose(gyro.angular_acceleration, [[0, -0.2, 0]])


def test_ground_effect_by_height_of_the_hubs():
    """Hubs 5 cm above a centre that is 10 cm above ground: z = 0.15; (R / 4z)² = (0.0635 / 0.6)² = 0.0112."""
    ratio = (0.0635 / 0.6) ** 2
    hubs = [dict(x_m=r.x_m, y_m=r.y_m, z_m=-0.05, spin=r.spin) for r in thesis_vehicle().rotors]
    vehicle = thesis_vehicle(rotor_radius_m=0.0635, rotors=hubs)
    for attitude in (None, NORTH[None]):
        state = dict(height=np.array([0.1]), rotation=attitude)
        flat = contribution("ground_effect", "inverse square", [4.0], vehicle, **state)
        np.testing.assert_allclose(flat.force, [[0, 0, -4 * ratio * 4 * T]], rtol=1e-9)
        image = contribution("ground_effect", "image rotor", [4.0], vehicle, **state)
        np.testing.assert_allclose(image.force, [[0, 0, -(1 / (1 - 4 * ratio) - 1) * 4 * T]], rtol=1e-9)
        far = contribution("ground_effect", "exponential", [0.1, 10.0], vehicle, **state)
        np.testing.assert_allclose(far.force, [[0, 0, -0.1 * np.exp(-1.5) * 4 * T]], rtol=1e-9)


def test_a_banked_vehicle_is_pushed_upright_by_the_ground():
    """Rolled to the right, the right hubs are lower: more thrust there, a roll to the left."""
    angle = 0.3
    rolled = np.array([[[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]]])
    added = contribution("ground_effect", "inverse square", [4.0], height=np.array([0.1]), rotation=rolled)
    low, high = 0.1 - D * np.sin(angle), 0.1 + D * np.sin(angle)
    gain = [4 * (0.0635 / (4 * z)) ** 2 for z in (low, high)]
    np.testing.assert_allclose(added.moment, [[-2 * T * D * (gain[0] - gain[1]), 0, 0]], atol=1e-9)


def test_a_vortex_ring_takes_most_at_the_hover_inflow():
    """v_h = √(mg/4 / (2 ρ π R²)) = √(1.599 / (2 · 1.2 · 0.012668)) = 7.25 m/s; half of k at 0.495 away (x = 1.495)."""
    inflow = hover_inflow_m_s(thesis_vehicle(rotor_radius_m=0.0635))
    assert inflow == pytest.approx(7.2526, abs=1e-3)
    for share, left in ((1.0, 1.0), (1 + 0.7 * np.sqrt(0.5), 0.5), (0.2, 0.0), (-1.0, 0.0)):
        added = contribution("vortex_ring", "mean loss", [0.3], velocity=row(0, 0, share * inflow))
        np.testing.assert_allclose(added.force, [[0, 0, 0.3 * left * 4 * T]], atol=1e-9)


def slung_pull(world, values=(0.1, 0.0, 1.0, 0.05)):
    """Force (n, 3), N, of 0.1 kg on 1 m below a level vehicle with specific force `world` (n, 3), at 200 Hz."""
    size = len(world)
    level = np.tile(NORTH, (size, 1, 1))
    motion = still(
        size, time_s=np.arange(size) / 200.0, angular_velocity=np.zeros((size, 3)), specific_force=world, rotation=level
    )
    slung = {f.name: f for f in catalogue()["payload"].forms(thesis_vehicle())}["slung"]
    return slung.contribution(motion, thesis_vehicle(), np.array(values)).force


def test_a_slung_load_swings_at_its_own_frequency():
    """A jump of 1 m/s² to the north after 3 s: the load swings about a slope of −1/g.

    What hangs it is √(g² + 1) = 9.8606 m/s² then: 2π √(L/9.8606) (1 + 0.1016²/16) = 2.0022 s for 1 m.
    """
    world = np.tile([0.0, 0, -G], (2600, 1))
    world[600:, 0] = 1.0
    t, pull = np.arange(2600) / 200.0, slung_pull(world)[:, 0]
    assert pull[:600] == pytest.approx(0.0, abs=1e-12)
    peaks = [k for k in range(601, 2599) if pull[k] < pull[k - 1] and pull[k] <= pull[k + 1]]
    assert np.diff(t[peaks]).mean() == pytest.approx(2.0022, rel=0.005)
    # Undamped it would swing from 0 to −2 m_p; ζ = 0.05 leaves 1 + exp(−π ζ) of it, and −m_p in the end.
    assert pull.min() == pytest.approx(-0.1 * (1 + np.exp(-0.05 * np.pi)), rel=0.01)


def test_the_length_of_a_cable_shows_in_a_force_and_in_the_moment_on_its_hook():
    """A minute below a vehicle that is shaken about the level: 1.4 m is found among 15 cm to 6 m, to a hundredth."""
    rng = np.random.default_rng(3)
    world = np.tile([0.0, 0.0, -G], (12_000, 1))
    world[:, :2] += 0.3 * np.repeat(rng.standard_normal((120, 2)), 100, axis=0)
    force = slung_pull(world, [0.1, 0.0, 1.4, 0.02])[:, :2] + 0.1 * rng.standard_normal((12_000, 2))
    parts = (np.arange(12_000) / 200.0, -world, np.zeros((12_000, 2)))
    noise = 0.1 * rng.standard_normal((12_000, 2))
    for pulls in ([force], [noise, force]):
        found = likely_lengths([(*parts, pulls)], (0.15, 6.0), 0.03, G)
        assert found[0][0] == pytest.approx(1.4, rel=0.02)
    short = [x[:200] for x in parts]
    assert likely_lengths([(*short, [force[:200]])], (0.15, 6.0), 0.03, G) == ()


def test_a_slung_load_swings_far_and_pulls_with_its_turning():
    """Its pivot falls sideways at g: what hangs it jumps from (g, 0, 0) to (0, 0, g), and it swings through 90°.

    At the bottom |n'|² = 2 g (1 − cos 90°)/L of a free swing: three times its weight, less what damping takes.
    """
    world = np.tile([-G, 0.0, 0.0], (1000, 1))
    world[600:] = [0.0, 0.0, -G]
    force = slung_pull(world)
    assert force[590] == pytest.approx([0.1 * G, 0, 0], abs=1e-9)
    # A quarter of a swing from 90° takes 1.854 √(L/g) = 0.592 s.
    lowest = 600 + int(np.argmax(force[600:800, 2]))
    assert (lowest - 600) / 200.0 == pytest.approx(0.592, abs=0.02)
    # ζ = 0.05 takes 4 ζ ω ∫ |n'|² dt ≈ 4 ζ ∫ √(2 cos θ) dθ = 4 ζ · 1.6944 · ω² from |n'|² = 2 ω² by then.
    assert force[lowest, 2] == pytest.approx(0.1 * G * (3 - 4 * 0.05 * 1.6944), rel=0.02)


def test_a_cable_does_not_push():
    """Falling faster than free leaves the cable slack: no force, though a rod would push 0.1 g up."""
    world = np.tile([0.0, 0, -G], (1000, 1))
    world[600:] = [0.0, 0.0, G]
    assert slung_pull(world)[605:] == pytest.approx(0.0, abs=1e-12)


def test_bounds_follow_the_vehicle():
    """Hover of the thesis's quadrotor: √(6.396 / (4 · 1.3877e-6)) = 1073.4 rad/s."""
    size = scale(thesis_vehicle())
    assert size.hover_speed_rad_s == pytest.approx(1073.4, abs=0.1)
    assert size.drag_per_rotor_speed == pytest.approx(5 * 0.652 / (4 * 1073.4), rel=1e-4)
    assert size.arm_m == pytest.approx(np.sqrt(2) * D)


def test_a_scale_fitted_to_the_reading_itself_is_stated_of_what_it_should_have_read():
    """Ω_m = 1.08 Ω + 0.02: of the reading 0.08 / 1.08 and 0.02 / 1.08 are error."""
    forms = {f.name: f for f in catalogue()["gyro_error"].forms(thesis_vehicle())}
    assert forms["scale"].stated(np.full(3, 0.08 / 1.08)) == pytest.approx([0.08] * 3)
    both = forms["bias and scale"].stated(np.array([*[0.02 / 1.08] * 3, *[0.08 / 1.08] * 3]))
    assert both == pytest.approx([0.02] * 3 + [0.08] * 3)
    assert forms["bias"].stated(np.array([0.08, 0, 0])) == pytest.approx([0.08, 0, 0])
