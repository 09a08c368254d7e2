"""Candidates, and a candidate flown: at rest where it joins the next, consistent in its forces, as files."""

from dataclasses import replace

import numpy as np
import pytest

from rotorid.cli.planning import SECTION, with_plan
from rotorid.effects.catalogue import catalogue
from rotorid.errors import InputError
from rotorid.mismatch.evidence.motion import build_segments
from rotorid.mismatch.evidence.rows import residual
from rotorid.plan import write
from rotorid.plan.candidates import Limits, Reference, candidates, joined, smaller, standard
from rotorid.plan.plan import NOTHING, SIZES, Plan, Tried, broken, yaw_acceleration
from rotorid.plan.simulate import CompetingModel, commands, fly, followed, low_pass, recorded
from rotorid.recordings import columns as c
from rotorid.recordings import templates
from tests.refusals import refused

LIMITS = Limits(x_m=(-8, 8), y_m=(-8, 8), height_m=(1, 8), speed_m_s=5, climb_m_s=2, tilt_deg=35)
VEHICLE = templates.read("thesis").model_copy(update={"ground_z_m": 0.0})
PIECES = candidates(LIMITS, yaw_acceleration(VEHICLE))
COLUMNS = (*c.rotor_columns("rotor_speed", 4), *c.SPECIFIC_FORCE, *c.ANGULAR_VELOCITY, *c.VELOCITY, *c.QUATERNION)


def flown(piece, world: CompetingModel | None = None):
    """The flight of a candidate in the middle of the room, by the loop of the limits."""
    world = world or CompetingModel(VEHICLE)
    return fly(world, joined([piece], 0.01), LIMITS.attitude_bandwidth_rad_s, LIMITS.middle_m)


@pytest.mark.parametrize("piece", PIECES, ids=lambda p: p.name)
def test_a_piece_starts_and_ends_at_rest_in_one_place(piece) -> None:
    reference = piece.reference(0.01)
    velocity = np.gradient(reference.position_m, reference.time_s, axis=0)
    for end in (0, -1):
        assert np.abs(reference.position_m[end]).max() < 1e-9 and np.abs(velocity[end]).max() < 0.02
    assert np.isfinite(reference.yaw_rad).all()


@pytest.mark.parametrize("piece", PIECES, ids=lambda p: p.name)
def test_a_candidate_keeps_the_limits_or_says_which_it_does_not(piece) -> None:
    try:
        flight = flown(piece)
    except InputError as error:
        assert "rotors" in str(error)
        return
    if broken(flight, LIMITS, VEHICLE):
        return
    assert flight.speed_m_s <= 1.03 * LIMITS.speed_m_s and np.degrees(flight.tilt_rad) <= 1.03 * LIMITS.tilt_deg
    assert flight.motion.height.min() >= LIMITS.height_m[0] - 0.1


def test_every_manoeuvre_can_be_flown_in_some_size() -> None:
    kept = set()
    for share in SIZES:
        for piece in candidates(smaller(LIMITS, share), share * yaw_acceleration(VEHICLE)):
            try:
                flight = flown(piece)
            except InputError:
                continue
            kept |= set() if broken(flight, LIMITS, VEHICLE) else {piece.name}
    assert kept == {p.name for p in PIECES}


@pytest.mark.parametrize("seconds", [10.0, 30.0, 75.0])
def test_the_standard_flight_is_as_long_as_asked_and_ends_where_it_starts(seconds: float) -> None:
    parts = {p.name: p for p in candidates(smaller(LIMITS, 0.5), 0.5 * yaw_acceleration(VEHICLE))}
    made = standard(parts, seconds)
    reference = made.reference(0.01)
    assert reference.duration_s == seconds
    velocity = np.gradient(reference.position_m, reference.time_s, axis=0)
    assert np.abs(reference.position_m[[0, -1]]).max() < 1e-9 and np.abs(velocity[[0, -1]]).max() < 0.02
    assert reference.yaw_rad[-1] == pytest.approx(0.0, abs=1e-9)
    assert broken(flown(made), LIMITS, VEHICLE) == ""


def test_without_a_manoeuvre_that_helps_the_plan_says_why() -> None:
    hover = Tried(piece("hover"), None, 11.0, "", 0.002)
    out = Tried(piece("eight"), None, 16.0, "tilt_deg would be 50")
    nothing = Plan("chosen", (), NOTHING, None, (), (), "set", LIMITS, tried=(hover, out))
    assert "1 of 2 keep them" in write.why_none(nothing) and "hover, brings 0.2 %" in write.why_none(nothing)
    assert "tilt_deg would be 50" in write.why_none(replace(nothing, tried=(out,)))


def test_smaller_limits_lie_within_the_others() -> None:
    half = smaller(LIMITS, 0.5)
    assert half.room_m == pytest.approx([0.5 * r for r in LIMITS.room_m])
    assert half.middle_m == pytest.approx(LIMITS.middle_m)
    assert (half.speed_m_s, half.tilt_deg) == (0.5 * LIMITS.speed_m_s, 0.5 * LIMITS.tilt_deg)


@pytest.mark.parametrize(("hz", "attitude", "position"), [(0.2, 9.0, 2.2), (0.8, 9.0, 2.2), (2.0, 23.3, 2.55)])
def test_a_cascade_follows_a_sine_as_its_equations_integrated_do(hz: float, attitude: float, position: float) -> None:
    step = 1e-3
    t = np.arange(0, 20, step)
    asked = np.sin(2 * np.pi * hz * t) * np.clip(t / 5, 0, 1)
    lag = np.polymul(low_pass(attitude), low_pass(5 * attitude))
    path = followed(asked[:, None], position, lag, step)[:, 0]
    # Step by step: a_asked = a_r + 2 ζ ω (v_r - v) + ω² (p_r - p), two second-order lags, two integrators.
    rates = np.gradient(asked, step)
    bends = np.gradient(rates, step)
    p = v = 0.0
    lags = np.zeros((2, 2))
    out = []
    for r, dr, ddr in zip(asked, rates, bends, strict=True):
        wanted = ddr + 1.6 * position * (dr - v) + position**2 * (r - p)
        for state, natural in zip(lags, (attitude, 5 * attitude), strict=True):
            state[1] += step * (natural**2 * (wanted - state[0]) - 1.6 * natural * state[1])
            state[0] += step * state[1]
            wanted = state[0]
        v += step * wanted
        p += step * v
        out.append(p)
    late = t > 12
    assert np.abs(path[late] - np.array(out)[late]).max() < 0.05 * np.abs(path[late]).max()


def piece(name: str):
    return next(p for p in PIECES if p.name == name)


def left_of(flight, world) -> dict[str, np.ndarray]:
    (segment,) = build_segments(recorded(flight, world, COLUMNS, 500.0, "flight"), VEHICLE, 500.0, 20.0)
    return residual(segment, VEHICLE)


def test_without_an_effect_nothing_is_left_of_the_rigid_body() -> None:
    world = CompetingModel(VEHICLE)
    left = left_of(fly(world, joined([piece("eight")], 0.002), 9.0, LIMITS.middle_m), world)
    assert np.abs(left["force"]).max() < 2e-3 * VEHICLE.mass_kg * 9.81
    assert np.sqrt((left["moment"] ** 2).mean()) < 1e-5


def test_an_effect_of_the_model_is_what_is_left() -> None:
    form = next(f for f in catalogue()["frame_drag"].forms(VEHICLE) if f.name == "isotropic")
    values = np.array([0.01])
    world = CompetingModel(VEHICLE, ((form, values),))
    flight = fly(world, joined([piece("pass 0 at 1")], 0.002), 9.0, LIMITS.middle_m)
    left = left_of(flight, world)["force"]
    wanted = form.contribution(flight.motion, VEHICLE, values).force
    assert np.abs(wanted).max() > 0.2
    middle = slice(len(wanted) // 4, -len(wanted) // 4)
    margin = (len(wanted) - len(left)) // 2
    assert np.allclose(left[middle], wanted[margin:][: len(left)][middle], atol=0.01 * np.abs(wanted).max())


def test_commands_lead_the_rotors_by_their_lag() -> None:
    form = next(f for f in catalogue()["motor_lag"].speed_forms if f.name == "one constant")
    world = CompetingModel(VEHICLE, chain=((form, np.array([0.05])),), full_speed_rad_s=2500.0)
    motion = fly(world, joined([piece("shake height to 1 Hz")], 0.002), 9.0, LIMITS.middle_m).motion
    lead = commands(world, motion) - motion.rotor_speed
    slope = np.gradient(motion.rotor_speed, motion.time_s, axis=0)
    inner = slice(500, -500)
    assert np.corrcoef(lead[inner, 0], slope[inner, 0])[0, 1] > 0.98
    assert (lead[inner] * slope[inner]).sum() / (slope[inner] ** 2).sum() == pytest.approx(0.05, rel=0.1)


def test_commands_are_those_of_the_chain_that_makes_the_thrust_felt() -> None:
    """Where no speed is recorded rotors turn so many times as fast as the chain has it."""
    motion = fly(CompetingModel(VEHICLE), joined([piece("shake height to 1 Hz")], 0.01), 9.0, LIMITS.middle_m).motion
    asked = commands(CompetingModel(VEHICLE, scale=0.8), motion)
    np.testing.assert_allclose(0.8 * asked, motion.rotor_speed)


def test_rotors_that_would_turn_backwards_are_refused() -> None:
    t = np.arange(0, 4, 0.01)
    falls = np.zeros((len(t), 3))
    falls[:, 2] = 20.0 * np.clip(t - 1, 0, None) ** 2
    refused("backwards", fly, CompetingModel(VEHICLE), Reference(t, falls, 2.0 * np.sin(30 * t)), 30.0, (0, 0, 100))


@pytest.fixture(scope="module")
def a_plan() -> Plan:
    pieces = (piece("drift"), piece("pass 45 at 1"))
    reference = joined(pieces, 0.004)
    flight = fly(CompetingModel(VEHICLE), reference, 9.0, LIMITS.middle_m)
    return Plan("chosen", pieces, reference, flight, (), (), "set", LIMITS)


def test_a_crazyflie_polynomial_goes_where_the_reference_goes_in_its_own_axes(a_plan: Plan) -> None:
    table, worst = write.crazyflie(a_plan)
    assert worst < 0.02
    assert table["duration"].sum() == pytest.approx(a_plan.duration_s, abs=1e-6)
    # In the middle of a piece, evaluated as the firmware does.
    at = table["duration"].cumsum() - table["duration"]
    row = len(table) // 2
    half = table["duration"][row] / 2
    x, y, z, yaw = (sum(table[f"{axis}^{p}"][row] * half**p for p in range(8)) for axis in ("x", "y", "z", "yaw"))
    wanted = write.sampled(a_plan, 250.0)
    now = at[row] + half
    ned = [np.interp(now, wanted["time_s"], wanted[f"position_{a}_m"]) for a in "xyz"]
    assert np.allclose([x, -y, -z], ned, atol=0.02)
    assert -yaw == pytest.approx(np.interp(now, wanted["time_s"], wanted["yaw_rad"]), abs=0.05)


def test_px4_setpoints_are_north_east_down_with_wrapped_yaw(a_plan: Plan) -> None:
    table = write.px4_offboard(a_plan)
    assert list(table.columns[:4]) == ["timestamp_s", "position[0]", "position[1]", "position[2]"]
    assert table["position[2]"].max() < 0 and table["yaw"].between(-np.pi, np.pi).all()


def test_a_plan_is_written_whole(a_plan: Plan, tmp_path) -> None:
    files = write.write(a_plan, tmp_path / "plan")
    assert {f.name for f in files} == {"plan.json", "trajectory.csv", "px4_offboard.csv", "crazyflie.csv", "plan.png"}
    assert all(f.stat().st_size > 200 for f in files)
    assert not list((tmp_path / "plan").glob(".*"))


def test_the_page_shows_the_last_plan_once(a_plan: Plan) -> None:
    bare = '<h1>x</h1><section><h2>What to fly next</h2>\n<p class="next">Fly.</p></section><section>rest</section>'
    said = write.text(a_plan)
    once = with_plan(bare, "set", said, b"png")
    assert once.count("<img") == 1 and once.count("waves") == 0
    assert "Fly." in once and once.endswith("<section>rest</section>")
    assert with_plan(once, "set", said) == with_plan(bare, "set", said)
    assert with_plan("<p>another page</p>", "set", said) == "<p>another page</p>"


def mission_of(names: tuple[str, ...], **limits) -> Plan:
    allowed = LIMITS.model_copy(update=limits)
    pieces = tuple(piece(n) for n in names)
    return Plan("chosen", pieces, joined(pieces, 0.01), None, (), (), "set", allowed)


def test_a_mission_goes_to_where_the_reference_turns_round() -> None:
    plan = mission_of(("pass 0 at 0.4", "ladder"), home_deg=(47.0, 8.0))
    assert write.not_a_mission(plan) == ""
    items = write.mission(plan)["mission"]["items"]
    assert items[0]["command"] == write.TAKE_OFF and items[-1]["command"] == write.RETURN
    assert [i["doJumpId"] for i in items] == list(range(1, len(items) + 1))
    places = np.array([i["params"][4:] for i in items if i["command"] == write.WAYPOINT])
    north, reference = np.radians(places[:, 0] - 47.0) * write.EARTH_M, plan.reference.position_m[:, 0]
    assert (north.min(), north.max()) == pytest.approx((reference.min(), reference.max()), abs=0.05)
    assert np.allclose(places[:, 1], 8.0)
    assert places[:, 2].max() == pytest.approx(LIMITS.height_m[1] - LIMITS.wall_margin_m, abs=0.05)
    speeds = [i["params"][1] for i in items if i["command"] == write.SPEED]
    assert max(speeds) == pytest.approx(0.4 * LIMITS.speed_m_s, rel=0.05)


def test_half_a_turn_is_two_waypoints_in_one_place() -> None:
    items = write.mission(mission_of(("face",), home_deg=(-30.0, 20.0)))["mission"]["items"]
    yaws = [i["params"][3] for i in items if i["command"] == write.WAYPOINT]
    assert 180.0 in yaws and yaws[-1] == 0.0


def test_what_is_no_mission_says_why() -> None:
    assert "shake" in write.not_a_mission(mission_of(("shake all to 2 Hz", "hover"), home_deg=(47.0, 8.0)))
    assert "home_deg" in write.not_a_mission(mission_of(("hover",)))


def test_the_page_that_is_written_has_the_section() -> None:
    from rotorid.report.page import page_file

    assert SECTION.search(page_file("page.html"))
