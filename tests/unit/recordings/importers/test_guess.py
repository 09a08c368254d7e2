"""Guessing what columns are: by names and numbers, with evidence, and open where neither decides."""

import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from scipy.spatial.transform import Rotation

from rotorid.cli.modelling import fly
from rotorid.recordings import columns as c
from rotorid.recordings import read_set, templates
from rotorid.recordings.importers.faults import join_rows
from rotorid.recordings.importers.guessing import as_text, guess
from rotorid.recordings.importers.guessing import names as column_names
from rotorid.recordings.importers.mapping import (
    BODY,
    TRAVEL,
    UNITS,
    WORLD,
    Mapping,
    convert,
    read_columns,
    read_mapping,
)
from tests.command_line import refusal
from tests.public_logs import public
from tests.refusals import refused

NAMES = {
    "angular_velocity": ("gyro_{}", "omega_{}", "ang_vel_{}", "w{}", "imu.gyro.{}", "angularVelocity.{}", "Gyr{}"),
    "specific_force": ("acc_{}", "a{}", "acc_b_{}", "imu.acc.{}", "linear_acceleration.{}", "Acc{}"),
    "velocity": ("v{}", "vel_{}", "velocity.{}", "state.vel.{}", "V{}", "lin_vel_{}"),
    "position": ("{}", "pos_{}", "p{}", "position.{}"),
}


@pytest.fixture(scope="module")
def flown(tmp_path_factory) -> pd.DataFrame:
    """A flight that turns about the vertical and moves, in contract columns."""
    folder = fly(templates.read("thesis"), tmp_path_factory.mktemp("sets") / "flights", 12.0, 1, 3)
    return read_set(folder).runs[0].table


def disguised(flown: pd.DataFrame, rng: np.random.Generator) -> tuple[pd.DataFrame, dict[str, str]]:
    """The flight in random names, units, axes and order of the quaternion, and what is true of them."""
    body, world = [("frd", "ned"), ("flu", "enu")][rng.integers(2)]
    true = {"body": body, "world": world}

    def unit(name: str, kind: str, among: tuple[str, ...]) -> float:
        true[name] = str(rng.choice(among))
        return UNITS[kind][true[name]]

    def names(name: str) -> list[str]:
        chosen = str(rng.choice(NAMES[name]))
        return [chosen.format(a if chosen[0].islower() or chosen[0] == "{" else a.upper()) for a in "xyz"]

    table = {"timestamp": 1e3 + flown[c.TIME] / unit("time", "time", ("s", "ms", "us", "ns"))}
    turn = Rotation.from_quat(flown[list(c.QUATERNION)].to_numpy()[:, [1, 2, 3, 0]])
    own = Rotation.from_matrix(WORLD[world]).inv() * turn * Rotation.from_matrix(BODY[body])
    true["attitude"] = str(rng.choice(("wxyz", "xyzw", "euler")))
    if true["attitude"] == "euler":
        table |= dict(zip(("roll", "pitch", "yaw"), own.as_euler("ZYX", degrees=True).T[::-1], strict=True))
    else:
        order = [3, 0, 1, 2] if true["attitude"] == "wxyz" else [0, 1, 2, 3]
        table |= dict(zip((f"q[{i}]" for i in range(4)), own.as_quat()[:, order].T, strict=True))
    rates = flown[list(c.ANGULAR_VELOCITY)].to_numpy() @ BODY[body]
    force = flown[list(c.SPECIFIC_FORCE)].to_numpy() @ BODY[body]
    rates /= unit("angular_velocity", "rate", ("rad/s", "deg/s"))
    force /= unit("specific_force", "acceleration", ("m/s2", "g", "mg"))
    velocity = flown[list(c.VELOCITY)].to_numpy().copy()
    true["velocity"] = str(rng.choice(("world", "body")))
    velocity = velocity @ WORLD[world] if true["velocity"] == "world" else turn.inv().apply(velocity) @ BODY[body]
    place = flown[list(c.POSITION)].to_numpy() @ WORLD[world] / unit("position", "length", ("m", "cm", "mm"))
    for name, values in (("angular_velocity", rates), ("specific_force", force), ("velocity", velocity)):
        table |= dict(zip(names(name), values.T, strict=True))
    table |= dict(zip(names("position"), place.T, strict=True))
    return pd.DataFrame(table), true


@pytest.mark.parametrize("seed", range(24))
def test_units_axes_and_orders_are_found_by_numbers(flown: pd.DataFrame, seed: int) -> None:
    table, true = disguised(flown, np.random.default_rng(seed))
    found = guess(table)
    channels = found.mapping.channels
    said = {name: channel.unit for name, channel in channels.items()}
    said |= {"body": found.mapping.body, "world": found.mapping.world}
    said |= {"velocity": channels["velocity"].axes, "attitude": channels["attitude"].form}
    assert said == true and not found.open, (found.evidence, found.open, list(table))
    assert set(found.evidence) == set(true)
    made, _ = convert(table, found.mapping, "own.csv")
    for names in (c.ANGULAR_VELOCITY, c.SPECIFIC_FORCE, c.VELOCITY, c.POSITION):
        np.testing.assert_allclose(made[list(names)], flown[list(names)], atol=1e-5)


def test_names_that_end_as_others_do_are_told_apart_in_a_public_table() -> None:
    """`ang_vel_x` was taken for a velocity, `acc_b_x` for a position, and `vx` was left out."""
    found = guess(pd.read_csv(public("logs/csv-ddd/quadrotor_model.csv")))
    columns = {name: channel.columns for name, channel in found.mapping.channels.items()}
    assert columns == {
        "time": ("timestamp",), "angular_velocity": ("ang_vel_x", "ang_vel_y", "ang_vel_z"),
        "attitude": ("q0", "q1", "q2", "q3"), "specific_force": ("acc_b_x", "acc_b_y", "acc_b_z"),
        "velocity": ("vx", "vy", "vz"), "throttle": ("u0", "u1", "u2", "u3"),
    }  # fmt: skip
    assert not found.open and (found.mapping.body, found.mapping.world) == ("frd", "ned")
    assert found.mapping.channels["velocity"].axes == "world" and found.mapping.channels["attitude"].form == "wxyz"


def plain(flown: pd.DataFrame) -> pd.DataFrame:
    """The flight in plain names, contract units and axes."""
    short = {n: f"{s}{a}" for s, names in (("gyro_", c.ANGULAR_VELOCITY), ("acc_", c.SPECIFIC_FORCE), ("v", c.VELOCITY))
             for a, n in zip("xyz", names, strict=True)}  # fmt: skip
    short |= dict(zip(c.QUATERNION, ("qw", "qx", "qy", "qz"), strict=True)) | {c.TIME: "t_s"}
    return flown[list(short)].rename(columns=short)


@pytest.mark.parametrize(
    ("change", "open_at", "said"),
    [
        (lambda t: t.rename(columns={f"acc_{a}": f"v{a}" for a in "xyz"} | {f"v{a}": f"acc_{a}" for a in "xyz"}),
         "specific_force", "1 g in no unit"),
        (lambda t: t.assign(vx=t["acc_x"], vy=t["acc_y"], vz=t["acc_z"]), "velocity", "is it a velocity?"),
        (lambda t: t.assign(gyro_y=-t["gyro_y"], gyro_z=-t["gyro_z"]), "angular_velocity", "different body axes"),
        (lambda t: t.assign(qx=-t["qx"], qy=-t["qy"], qz=-t["qz"]), "attitude", "turns the world into the body"),
        (lambda t: t.drop(columns=["qw", "qx", "qy", "qz"]), "angular_velocity", "rad/s or deg/s"),
        (lambda t: t.drop(columns=["qw", "qx", "qy", "qz"]), "velocity", "world or body axes"),
        (lambda t: t.drop(columns=["t_s"]), "time", "no column is named as a time"),
        (lambda t: t.assign(t_s=t["t_s"] * 1e6), "time", "its name says s, its step us"),
        (lambda t: t.assign(**{f"rotor_speed_m{i}": 1800.0 for i in range(1, 5)}), "rotor_speed", "rad/s or rpm"),
    ],
)  # fmt: skip
def test_what_is_not_sure_is_left_open_and_import_waits_for_the_answer(
    flown: pd.DataFrame, change, open_at: str, said: str, tmp_path: Path
) -> None:
    table = change(plain(flown))
    found = guess(table)
    assert said in found.open[open_at], (found.open, found.evidence)
    path, own = tmp_path / "mapping.yaml", tmp_path / "own.csv"
    path.write_text(as_text(found, "own.csv"))
    table.to_csv(own, index=False)
    assert f"# OPEN: {found.open[open_at]}" in path.read_text() and yaml.safe_load(path.read_text())["channels"]
    refused(rf"{path}: still open \(\?\): .*{open_at}", read_mapping, path)
    said = refusal("import", own, "--mapping", path, "--like", "thesis", "-o", tmp_path / "set")
    assert "still open" in said and not (tmp_path / "set").exists()


def test_columns_of_no_known_name_are_taken_by_what_they_integrate_to(flown: pd.DataFrame) -> None:
    table = plain(flown).rename(columns=lambda n: n.replace("gyro_", "k_").replace("acc_", "h_").replace("v", "g_"))
    found = guess(table.assign(sun_x=1.0, sun_y=2.0, sun_z=3.0))
    assert found.mapping.channels["angular_velocity"].columns == ("k_x", "k_y", "k_z")
    assert found.mapping.channels["specific_force"].columns == ("h_x", "h_y", "h_z")
    assert found.mapping.channels["velocity"].columns == ("g_x", "g_y", "g_z")
    assert "no name says it" in found.evidence["angular_velocity"] and "sun_x" in found.mapping.keep


@pytest.mark.parametrize(
    ("names", "quantity"),
    [
        ("ang_vel_{}", "angular_velocity"), ("gyro_bias_{}", None), ("acc_sp_{}", None), ("ang_acc_b_{}", None),
        ("vel_ref_{}", None), ("magnetometer_{}", None), ("estimate.v{}", "velocity"),
        ("gyro_{}_deg_s", "angular_velocity"), ("{}", "position"), ("pos_{}[mm]", "position"),
    ],
)  # fmt: skip
def test_names(names: str, quantity: str | None) -> None:
    (family,) = column_names.families([names.format(a) for a in "xyz"], "xyz")
    named = [q for q in column_names.TRIPLES if column_names.is_named(family, q)]
    assert named == ([quantity] if quantity else [])


# Throttles and electrical speeds ------------------------------------------------------------------

SHARES = 0.45 + 0.12 * np.sin(np.outer(np.arange(900) * 0.01, [2.1, 3.3, 4.7, 5.9]))
SPOOLED = np.vstack([np.zeros((100, 4)), np.full((100, 4), 0.05), SHARES])
BETAFLIGHT = {"loopIteration": 1.0, **{f"gyroADC[{k}]": 3.0 for k in range(3)}}


def throttles_of(names: str, values: np.ndarray, **more):
    table = {"t_s": 0.01 * np.arange(len(values)), **more}
    table |= {names.format(k): column for k, column in enumerate(values.T)}
    return guess(pd.DataFrame(table))


@pytest.mark.parametrize(
    ("names", "values", "more", "ends"),
    [
        ("motor[{}]", 158 + 1889 * SPOOLED, BETAFLIGHT, [48, 2047]),  # in the air at 1008, on the ground at 252
        ("motor[{}]", 158 + 0 * SPOOLED, BETAFLIGHT, [48, 2047]),  # nothing but idle
        ("motor[{}]", 158 + 1889 * SHARES / 1.3, BETAFLIGHT, [48, 2047]),
        ("motor[{}]", 1000 + 1000 * SHARES, BETAFLIGHT, "?"),
        ("m{}", 48 + 1999 * SPOOLED, {}, [48, 2047]),
        ("m{}", 1000 + 1000 * SHARES, {}, [1000, 2000]),
        ("m{}", np.maximum(1000 + 1000 * SPOOLED, 900), {}, [1000, 2000]),
        ("m{}_us", 1000 + 500 * SHARES, {}, [1000, 2000]),
        ("m{}_dshot", 1000 + 500 * SHARES, {}, [48, 2047]),
        ("m{}", 1000 + 500 * SHARES, {}, "?"),
        ("m{}", SPOOLED, {}, None),
        ("m{}", 0.1 * SPOOLED, {}, None),
        ("m{}", -1 + 2 * SHARES, {}, [-1, 1]),
        ("m{}", 100 * SPOOLED, {}, "?"),  # of 100, or of 255 (8 bits)
        ("m{}_pct", 100 * SPOOLED, {}, [0, 100]),
        ("m{}", np.minimum(180 * SPOOLED, 100), {}, [0, 100]),
        ("m{}", 255 * SPOOLED, {}, [0, 255]),
        ("m{}", np.minimum(1800 * SPOOLED, 1000), {}, [0, 1000]),
        ("m{}", np.minimum(1800 * SPOOLED, 1023), {}, [0, 1023]),
        ("m{}", 1000 * SPOOLED, {}, "?"),
        ("m{}", 32767 * SPOOLED, {}, "?"),
        ("m{}", np.minimum(60000 * SPOOLED, 32767), {}, [0, 32767]),
        ("m{}", 65535 * SPOOLED * 1.5, {}, [0, 65535]),
        ("m{}", 600 + 900 * SHARES, {}, "?"),  # DShot's, or speeds in rad/s
        ("RCOU.C{}", 1000 + 600 * SHARES, {}, [1000, 2000]),
        ("m{}_throttle", 600 + 900 * SHARES, {}, [48, 2047]),
    ],
)  # fmt: skip
def test_the_range_of_throttles_is_found_or_asked(names: str, values: np.ndarray, more: dict, ends) -> None:
    """By smallest and largest, by where a vehicle hovers, and by the other columns; asked where two ranges fit."""
    found = throttles_of(names, values, **more)
    channel = found.mapping.channels["throttle"]
    assert (channel.unit == "1") == (ends is None), found.evidence
    assert channel.range == (tuple(ends) if isinstance(ends, list) else ends), (found.evidence, found.open)
    assert ("throttle" in found.open) == (ends == "?")


def test_motors_of_thousands_are_asked_whether_they_are_speeds() -> None:
    """Before: 15 bits without a question, of rpm and of ten thousandths."""
    found = throttles_of("motor{}", 1500 + 5000 * SHARES)
    assert found.mapping.channels["throttle"].range == "?"
    assert "per ten thousand" in found.open["throttle"] and "are they speeds" in found.open["throttle"]


ELECTRICAL = 60 / (2 * np.pi) * 7 * (900 + 100 * SHARES)  # of seven pairs of poles, turns a minute


@pytest.mark.parametrize(
    ("names", "values", "more", "unit"),
    [
        ("eRPM[{}]", ELECTRICAL / 100, BETAFLIGHT, "100erpm"), ("eRPM(/100)[{}]", ELECTRICAL / 100, {}, "100erpm"),
        ("eRPM[{}]", ELECTRICAL / 100, {}, "100erpm"), ("erpm_{}", ELECTRICAL, {}, "erpm"),
        ("motor_{}_erpm", ELECTRICAL, {}, "erpm"), ("erpm_{}", ELECTRICAL / 12, {}, "?"),
    ],
)  # fmt: skip
def test_electrical_speeds_are_no_speeds_of_rotors(names: str, values: np.ndarray, more: dict, unit: str) -> None:
    found = throttles_of(names, values, **more)
    channel = found.mapping.channels["rotor_speed"]
    assert (channel.unit, channel.poles) == (unit, "?") and "poles" in found.open["rotor_speed"]
    if unit != "?":
        answered = channel.model_copy(update={"poles": 14})
        alone = {"time": found.mapping.channels["time"], "rotor_speed": answered}
        mapping = found.mapping.model_copy(update={"body": "frd", "channels": alone, "keep": ()})
        table = {"t_s": 0.01 * np.arange(len(values)), **more} | {names.format(k): v for k, v in enumerate(values.T)}
        made, _ = convert(pd.DataFrame(table), mapping, "own.csv")
        np.testing.assert_allclose(made["rotor_speed_1_rad_s"], 900 + 100 * SHARES[:, 0])


@pytest.mark.parametrize(
    ("names", "values", "unit"),
    [
        *[(name, 700 + 600 * SHARES, "rad/s") for name in (
            "omega{}", "w{}", "rotor_{}_speed", "motor{}_vel", "rotor_velocity_{}", "w_m{}"
        )],
        *[(name, 9000 + 900 * SHARES, "rpm") for name in ("ESC{} rpm", "prop{}_rpm", "M{} (RPM)", "esc_{}.rpm")],
        *[(name, 9 + SHARES, "krpm") for name in ("rotor{}_krpm", "krpm{}", "M{} [krpm]")],
        ("motor_{}_hz", 150 + 100 * SHARES, "hz"),
    ],
)  # fmt: skip
def test_speeds_of_rotors_however_they_are_called(names: str, values: np.ndarray, unit: str) -> None:
    found = throttles_of(names, values)
    assert found.mapping.channels["rotor_speed"].unit == unit and "throttle" not in found.mapping.channels
    assert "rotor_speed" not in found.open


def test_columns_that_follow_the_thrust_and_are_called_nothing_are_asked(flown: pd.DataFrame) -> None:
    """The current of each motor follows it too, but is called so."""
    pull = -flown[c.SPECIFIC_FORCE[2]].to_numpy()
    table = plain(flown).assign(**{f"k{i}": 100 * np.sqrt(pull) + i for i in range(4)})
    question = guess(table).open["throttle"]
    assert "which readings are no and full throttle" in question and "Or are they speeds?" in question
    table = plain(flown).assign(**{f"motor_{i}_current": pull + i for i in range(4)})
    assert "throttle" not in guess(table).mapping.channels


def test_slow_turns_are_asked_although_the_names_say_rpm() -> None:
    assert throttles_of("rpm_{}", 1000 * SHARES).mapping.channels["rotor_speed"].unit == "?"


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("throttle: {columns: [m], range: [2000, 1000]}", r"range \[2000, 1000\], expected no throttle below"),
        ("rotor_speed: {columns: [m], unit: erpm}", "needs poles"),
        ("rotor_speed: {columns: [m], unit: 100erpm, poles: 0}", "needs poles"),
        ("height: {columns: [m], scale: 0}", "scale 0"),
        ("position: {columns: [m, m, m], unit: m, world: '?'}", "position.world"),
        ("height: {columns: [m], scale: '?'}", "height.scale"),
        ("rotor_speed: {columns: [m], unit: erpm, poles: '?'}", "rotor_speed.poles"),
        ("throttle: {columns: [m], unit: raw, range: '?'}", "throttle.range"),
    ],
)
def test_what_a_mapping_lacks_is_named(line: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "mapping.yaml"
    path.write_text(f"channels:\n  time: {{columns: [t], unit: s}}\n  {line}\n")
    refused(said, read_mapping, path)


# Axes, orders and units that differ between channels -----------------------------------------------


def in_axes(
    flown: pd.DataFrame, body: str = "frd", world: str = "ned", travel: str = "", place: str = ""
) -> pd.DataFrame:
    """The flight in plain names, sensors and attitude in `body` and `world`, velocity and position in other axes."""
    table = plain(flown)
    turn = Rotation.from_quat(flown[list(c.QUATERNION)].to_numpy()[:, [1, 2, 3, 0]])
    own = Rotation.from_matrix(WORLD[world]).inv() * turn * Rotation.from_matrix(BODY[body])
    table[["qw", "qx", "qy", "qz"]] = own.as_quat()[:, [3, 0, 1, 2]]
    for short, names in (("gyro_", c.ANGULAR_VELOCITY), ("acc_", c.SPECIFIC_FORCE)):
        table[[f"{short}{a}" for a in "xyz"]] = flown[list(names)].to_numpy() @ BODY[body]
    table[["vx", "vy", "vz"]] = flown[list(c.VELOCITY)].to_numpy() @ TRAVEL[travel or world]
    table[["pos_x", "pos_y", "pos_z"]] = flown[list(c.POSITION)].to_numpy() @ TRAVEL[place or travel or world]
    return table


def check_converted(flown: pd.DataFrame, table: pd.DataFrame, mapping, north: bool = True) -> None:
    """The mapping brings a table back to the flight; where nothing shows north, up to a turn about the vertical."""
    made, _ = convert(table, mapping, "own.csv")
    for names in (c.ANGULAR_VELOCITY, c.SPECIFIC_FORCE):
        np.testing.assert_allclose(made[list(names)], flown[list(names)], atol=1e-5)
    for names in (c.VELOCITY, c.POSITION):
        found, true = made[list(names)].to_numpy(), flown[list(names)].to_numpy()
        np.testing.assert_allclose(found[:, 2], true[:, 2], atol=1e-5)
        np.testing.assert_allclose(np.linalg.norm(found, axis=1), np.linalg.norm(true, axis=1), atol=1e-5)
        if north:
            np.testing.assert_allclose(found, true, atol=1e-5)


@pytest.mark.parametrize(
    ("body", "world"), [("frd", "ned"), ("flu", "enu"), ("fur", "nue"), ("flu", "nue"), ("frd", "enu")]
)
@pytest.mark.parametrize("travel", ["ned", "enu", "nwu", "nue", "neu"])
@pytest.mark.parametrize("place", ["", "neu", "ned"])
def test_velocity_and_position_in_other_axes_than_the_attitude(
    flown: pd.DataFrame, body: str, world: str, travel: str, place: str
) -> None:
    table = in_axes(flown, body, world, travel, place)
    found = guess(table)
    assert found.mapping.body == body and not found.open, (found.open, found.evidence)
    assert found.mapping.world == world or {found.mapping.world, world} == {"enu", "nwu"}
    check_converted(flown, table, found.mapping, north=found.mapping.world == world)


def test_y_up_is_never_taken_for_z_up(flown: pd.DataFrame) -> None:
    """As motion captures write it: attitude and position alone, nothing else in the table."""
    table = in_axes(flown, "fur", "nue")[["t_s", "qw", "qx", "qy", "qz", "pos_x", "pos_y", "pos_z"]]
    found = guess(table)
    assert (found.mapping.body, found.mapping.world) in (("fur", "nue"), ("?", "?")), found.evidence


def test_a_height_that_only_rises_is_asked_for_its_direction(flown: pd.DataFrame) -> None:
    table = in_axes(flown)[["t_s", "qw", "qx", "qy", "qz", "acc_x", "acc_y", "acc_z", "pos_x", "pos_y", "pos_z"]]
    climbed = table.assign(pos_z=np.linspace(0, 5, len(table)))
    assert guess(climbed).mapping.channels["position"].world == "?"
    assert guess(climbed.assign(pos_z=-climbed["pos_z"])).mapping.channels["position"].world is None


@pytest.mark.parametrize("form", ["euler", "euler_xyz"])
@pytest.mark.parametrize("unit", ["rad", "deg"])
@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_the_order_of_roll_pitch_and_yaw_is_decided_by_the_gyroscope(
    flown: pd.DataFrame, form: str, unit: str, noise: float
) -> None:
    table = plain(flown)
    turn = Rotation.from_quat(table[["qx", "qy", "qz", "qw"]].to_numpy()) * Rotation.from_euler("z", 0.7)
    angles = turn.as_euler("ZYX")[:, ::-1] if form == "euler" else turn.as_euler("XYZ")
    back = Rotation.from_euler("z", -0.7).as_matrix()
    rates = table[["gyro_x", "gyro_y", "gyro_z"]].to_numpy() @ back.T
    rates = rates + noise * np.random.default_rng(0).standard_normal(rates.shape)
    force = table[["acc_x", "acc_y", "acc_z"]].to_numpy() @ back.T
    table = table.drop(columns=["qw", "qx", "qy", "qz"]).assign(
        **dict(zip(("roll", "pitch", "yaw"), np.unwrap(angles, axis=0).T / UNITS["angle"][unit], strict=True)),
        **dict(zip(("gyro_x", "gyro_y", "gyro_z"), rates.T, strict=True)),
        **dict(zip(("acc_x", "acc_y", "acc_z"), force.T, strict=True)),
    )
    found = guess(table)
    channel = found.mapping.channels["attitude"]
    assert (channel.form, channel.unit) == (form, unit), (found.evidence, found.open)
    made, _ = convert(table, found.mapping, "own.csv")
    read = Rotation.from_quat(made[list(c.QUATERNION)].to_numpy()[:, [1, 2, 3, 0]])
    assert (read.inv() * turn).magnitude().max() < 1e-6


@pytest.mark.parametrize("unit", ["rad", "deg"])
@pytest.mark.parametrize("gyroscope", [True, False])
def test_vicons_rotation_vector(flown: pd.DataFrame, unit: str, gyroscope: bool) -> None:
    """RX, RY, RZ next to a place in mm: a gyroscope shows that they are one turn about an axis, else it is asked."""
    table = plain(flown)
    turn = Rotation.from_quat(table[["qx", "qy", "qz", "qw"]].to_numpy())
    place = {f"T{a} mm": 1000 * flown[name] for a, name in zip("XYZ", c.POSITION, strict=True)}
    angles = dict(zip((f"R{a} {unit}" for a in "XYZ"), turn.as_rotvec().T / UNITS["angle"][unit], strict=True))
    own = table[["t_s", *(n for n in table if n.startswith(("gyro", "acc")) and gyroscope)]].assign(**angles, **place)
    found = guess(own)
    attitude, position = (found.mapping.channels[name] for name in ("attitude", "position"))
    assert (attitude.columns, attitude.unit, position.unit) == (tuple(angles), unit, "mm"), found.open
    assert attitude.form == ("rotvec" if gyroscope else "?")
    answers = {
        "attitude": attitude.model_copy(update={"form": "rotvec"}),
        "position": position.model_copy(update={"world": None}),
    }
    channels = dict(found.mapping.channels) | answers
    sure = found.mapping.model_copy(update={"channels": channels, "body": "frd", "world": "ned"})
    made, _ = convert(own, sure, "own.csv")
    read = Rotation.from_quat(made[list(c.QUATERNION)].to_numpy()[:, [1, 2, 3, 0]])
    assert (read.inv() * turn).magnitude().max() < 1e-6


@pytest.mark.parametrize(("names", "unit"), [(("roll", "pitch", "heading"), "deg"), (("attitude[{}]",) * 3, "ddeg")])
@pytest.mark.parametrize(("body", "signs"), [("frd", (1, -1, 1)), ("flu", (1, 1, -1))])
def test_angles_have_the_signs_that_the_gyroscope_shows(flown, names, unit: str, body: str, signs) -> None:
    """A pitch that is positive nose down and a compass heading, 0 to 360 degrees, in whatever axes of the sensors."""
    turn = Rotation.from_quat(flown[list(c.QUATERNION)].to_numpy()[:, [1, 2, 3, 0]])
    angles = np.degrees(turn.as_euler("ZYX")[:, ::-1]) * [1, -1, 1]
    angles[:, 2] %= 360
    named = [name.format(k) for k, name in enumerate(names)]
    table = plain(flown).drop(columns=["qw", "qx", "qy", "qz", "vx", "vy", "vz"])
    if body == "flu":
        table[["gyro_y", "gyro_z", "acc_y", "acc_z"]] *= -1
    table = table.assign(**dict(zip(named, angles.T * (10 if unit == "ddeg" else 1), strict=True)))
    found = guess(table)
    channel = found.mapping.channels["attitude"]
    assert (channel.columns, channel.unit, channel.signs) == (tuple(named), unit, signs), found.open
    made, _ = convert(table, Mapping.model_validate(yaml.safe_load(as_text(found, "own.csv"))), "own.csv")
    read = Rotation.from_quat(made[list(c.QUATERNION)].to_numpy()[:, [1, 2, 3, 0]])
    assert (read.inv() * turn).magnitude().max() < 1e-6


def test_an_order_that_nothing_shows_is_asked_where_it_matters(flown: pd.DataFrame) -> None:
    angles = 0.4 * np.sin(np.outer(flown[c.TIME], [1.0, 1.3, 0.7]))
    table = flown[[c.TIME]].rename(columns={c.TIME: "t_s"})
    table[["roll_deg", "pitch_deg", "yaw_deg"]] = np.degrees(angles)
    assert guess(table).mapping.channels["attitude"].form == "?"
    table[["roll_deg", "pitch_deg", "yaw_deg"]] *= 0.05
    assert guess(table).mapping.channels["attitude"].form == "euler"


@pytest.mark.parametrize(
    ("factor", "unit"), [(1.0, "rad/s"), (np.pi / 180, "deg/s"), (1e-3, "mrad/s"), (0.00106526, "?"), (0.1, "?")]
)
def test_the_unit_of_a_gyroscope_follows_from_the_attitude(flown: pd.DataFrame, factor: float, unit: str) -> None:
    """Counts of a sensor have no unit: the question says the scale that the attitude asks for."""
    table = plain(flown)
    table[["gyro_x", "gyro_y", "gyro_z"]] /= factor
    found = guess(table)
    assert found.mapping.channels["angular_velocity"].unit == unit
    if unit == "?":
        scale = float(found.open["angular_velocity"].split("scale: ")[1].rstrip(")"))
        assert scale == pytest.approx(factor, rel=0.01)


@pytest.mark.parametrize("factor", [np.pi / 180, 1e-3, 0.00106526])
def test_a_gyroscope_without_an_attitude_is_asked_for_its_unit(flown: pd.DataFrame, factor: float) -> None:
    table = plain(flown).drop(columns=["qw", "qx", "qy", "qz"])
    table[["gyro_x", "gyro_y", "gyro_z"]] /= factor / 5
    found = guess(table)
    assert found.mapping.channels["angular_velocity"].unit == "?" and "counts" in found.open["angular_velocity"]
    named = table.rename(columns={f"gyro_{a}": f"gyro_{a}_mrad_s" for a in "xyz"})
    assert guess(named).mapping.channels["angular_velocity"].unit == "mrad/s"


@pytest.mark.parametrize("counts", [512, 2048, 8192, 16384])
def test_an_accelerometer_in_counts_is_asked_for_its_scale(flown: pd.DataFrame, counts: int) -> None:
    table = plain(flown)
    table[["acc_x", "acc_y", "acc_z"]] *= counts / 9.80665
    found = guess(table)
    assert found.mapping.channels["specific_force"].unit == "?"
    assert f"1/{counts}" in found.open["specific_force"]
    answered = found.mapping.channels["specific_force"].model_copy(update={"unit": "g", "scale": 1 / counts})
    channels = {"time": found.mapping.channels["time"], "specific_force": answered}
    made, _ = convert(table, found.mapping.model_copy(update={"channels": channels, "world": "ned", "keep": ()}), "own")
    np.testing.assert_allclose(made[list(c.SPECIFIC_FORCE)], flown[list(c.SPECIFIC_FORCE)], atol=1e-9)


@pytest.mark.parametrize(
    ("message", "force", "rate"),
    [("RAW_IMU", "mg", "mrad/s"), ("SCALED_IMU2", "mg", "mrad/s"), ("HIGHRES_IMU", "m/s2", "rad/s")],
)
@pytest.mark.parametrize("attitude", [True, False])
def test_the_names_of_mavlink(flown: pd.DataFrame, message: str, force: str, rate: str, attitude: bool) -> None:
    table = plain(flown)
    own = {f"{message}.{a}acc": table[f"acc_{a}"] / UNITS["acceleration"][force] for a in "xyz"}
    own |= {f"{message}.{a}gyro": table[f"gyro_{a}"] / UNITS["rate"][rate] for a in "xyz"}
    own |= {f"{message}.{a}mag": 0.0 for a in "xyz"}
    own |= {
        f"SERVO_OUTPUT_RAW.servo{k}_raw": np.where(k < 5, 1500 + 100 * np.sin(k * table["t_s"]), 0)
        for k in range(1, 17)
    }
    found = guess(table[["t_s", *(["qw", "qx", "qy", "qz"] if attitude else [])]].assign(**own))
    channels = found.mapping.channels
    assert channels["specific_force"].unit == force and channels["angular_velocity"].unit == rate, found.open
    assert channels["angular_velocity"].columns == tuple(f"{message}.{a}gyro" for a in "xyz")
    assert channels["throttle"].columns == tuple(f"SERVO_OUTPUT_RAW.servo{k}_raw" for k in range(1, 5))
    assert channels["throttle"].range == (1000.0, 2000.0)


@pytest.mark.parametrize(
    ("name", "value", "unit"),
    [
        ("battery_current_mA", 15000.0, "mA"), ("battery_current_A", 15.0, "A"), ("current", 15.0, "A"),
        ("current", 1500.0, "?"), ("battery_current_cA", 1500.0, "cA"), ("current [mA]", 1500.0, "mA"),
        ("battery_current_mA", 0.02, "?"), ("battery_voltage", 16.0, "V"), ("battery_voltage_cV", 1600.0, "cV"),
        ("battery_voltage_mV", 16000.0, "mV"), ("vbat", 16000.0, "mV"), ("vbat", 168.0, "dV"), ("vbat", 1680.0, "cV"),
        ("pm.vbat", 3.9, "V"), ("BAT.Volt", 16.0, "V"), ("batt_volt_mV", 16000.0, "mV"),
        ("BAT.Curr (mA)", 9000.0, "mA"), ("vbat", 380.0, "?"), ("battery_voltage_mV", 16.0, "?"),
        ("Voltage (V)", 16.0, "V"),
        ("temperature_K", 300.0, "K"), ("temperature", 300.0, "K"), ("temperature_c", 35.0, "degC"),
        ("temperature", 35.0, "degC"), ("temperature", 95.0, "?"), ("temp_degF", 95.0, "degF"),
        ("Temperature (°F)", 95.0, "degF"),
    ],
)  # fmt: skip
def test_units_of_battery_and_temperature_by_name_and_size(name: str, value: float, unit: str) -> None:
    table = pd.DataFrame({"t_s": 0.01 * np.arange(200), name: value * (1 + 0.01 * np.sin(np.arange(200)))})
    found = guess(table)
    (channel,) = (v for k, v in found.mapping.channels.items() if k != "time")
    assert channel.unit == unit, (found.evidence, found.open)
    assert bool(found.open) == (unit == "?")


def test_messages_that_have_a_row_each_are_joined(flown: pd.DataFrame) -> None:
    """As `mavlogdump.py --format csv` writes a telemetry log: rows of one instant, each with its own cells."""
    sensors = [f"{kind}_{a}" for kind in ("gyro", "acc") for a in "xyz"]
    groups = (["qw", "qx", "qy", "qz"], sensors, ["vx", "vy", "vz"])
    table = in_axes(flown)[["t_s", *(n for g in groups for n in g)]]
    rows = pd.concat([table[["t_s", *g]] for g in groups]).sort_values("t_s", kind="stable").reset_index(drop=True)
    found = guess(rows[list(table)])
    whole = guess(table)
    assert found.mapping == whole.mapping
    mapping = whole.mapping.model_copy(update={"body": "frd", "world": "ned"})
    made, faults = convert(rows, mapping, "own.csv")
    pd.testing.assert_frame_equal(made, convert(table, mapping, "own.csv")[0])
    assert not any("clock" in f.sentence for f in faults)


def test_rows_of_one_instant_that_hold_the_same_cells_are_no_messages() -> None:
    table = pd.DataFrame({"t": [0.0, 0.0, 1.0, 1.0, 2.0], "a": [1.0, 2.0, 3.0, np.nan, 5.0], "b": [1, 1, np.nan, 4, 5]})
    joined = join_rows(table, "t")
    assert joined["t"].tolist() == [0.0, 0.0, 1.0, 2.0] and joined["a"].tolist() == [1.0, 2.0, 3.0, 5.0]
    assert joined["b"].tolist() == [1, 1, 4, 5]


def test_the_body_rates_of_mavlinks_attitude(flown: pd.DataFrame) -> None:
    names = {f"gyro_{a}": f"ATTITUDE.{n}speed" for a, n in zip("xyz", ("roll", "pitch", "yaw"), strict=True)}
    found = guess(plain(flown).drop(columns=["qw", "qx", "qy", "qz"]).rename(columns=names))
    assert found.mapping.channels["angular_velocity"].columns == tuple(names.values())
    assert found.mapping.channels["angular_velocity"].unit == "rad/s"


def test_columns_that_hold_nothing_are_no_channels() -> None:
    """A telemetry log names every message that it could have: columns without a cell raise nothing and mean nothing."""
    names = [f"RAW_IMU.{a}{kind}" for kind in ("acc", "gyro") for a in "xyz"]
    names += ["thrust", "torque", "rpm", "roll", "pitch", "yaw"]
    names += [*(f"servo{k}_raw" for k in range(1, 5)), *(f"eRPM[{k}]" for k in range(4))]
    empty = pd.DataFrame({"t_s": 0.01 * np.arange(100)} | {n: np.nan for n in names})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert set(guess(empty).mapping.channels) == {"time"}


# Clocks, rates and accelerations under more names -------------------------------------------------


@pytest.mark.parametrize(
    ("name", "written", "unit"),
    [
        ("timestamp", lambda t: [f"2024-05-01 10:00:{x:09.6f}" for x in t], "s"),
        ("time", lambda t: [f"2024-05-01T10:00:{x:09.6f}Z" for x in t], "s"),
        ("utc_time", lambda t: pd.Timestamp("2024-05-01") + pd.to_timedelta(t, "s"), "s"),
        ("time", lambda t: [f"9:59:{x:09.6f}" for x in t], "s"),
        ("time", lambda t: [f"9:59:{x:09.6f}".replace(".", ",") for x in t], "s"),
        ("time", lambda t: [f"2024-05-01 10:00:{x:09.6f}".replace(".", ",") for x in t], "s"),
        ("time", lambda t: [f"1.5.2024 10:00:{x:09.6f}" for x in t], "s"),
        ("time", lambda t: [f"05/13/2024 10:00:{x:09.6f}" for x in t], "s"),
        ("time", lambda t: (pd.Timestamp("23:59:55") + pd.to_timedelta(t, "s")).strftime("%H:%M:%S.%f"), "s"),
        ("IMU.TimeUS", lambda t: np.round(t * 1e6 + 2**32 - 5e6) % 2**32, "us"),
        ("time_ms", lambda t: (t * 1e3 + 60_000) % 65_536, "ms"),
        ("%time", lambda t: 1.7e18 + np.round(t * 1e9), "ns"),
        ("field.header.stamp", lambda t: 1.7e18 + np.round(t * 1e9), "ns"),
        ("elapsed (ms)", lambda t: t * 1000, "ms"),
        ("Seconds", lambda t: t, "s"),
        ("__time", lambda t: 1.7e9 + t, "s"),
        ("OSD.flyTime [s]", lambda t: t, "s"),
        ("IMU.TimeUS", lambda t: np.round(t * 1e6), "us"),
    ],
)  # fmt: skip
def test_clocks_however_they_are_written(flown: pd.DataFrame, name: str, written, unit: str, tmp_path: Path) -> None:
    table, path = plain(flown), tmp_path / "own.parquet"
    table = table.assign(t_s=written(table["t_s"].to_numpy())).rename(columns={"t_s": name})
    table.to_parquet(path)
    read = read_columns(path)
    mapping = guess(read).mapping
    assert mapping.channels["time"].columns == (name,) and mapping.channels["time"].unit == unit
    made, _ = convert(read, mapping, "own.csv")
    np.testing.assert_allclose(made[c.TIME], flown[c.TIME] - flown[c.TIME].iloc[0], atol=1e-6)


def test_a_clock_that_counts_whole_seconds_is_asked_for_its_fraction(flown: pd.DataFrame) -> None:
    table = plain(flown)
    table = table.assign(nsecs=table["t_s"] % 1 * 1e9, t_s=table["t_s"] // 1).rename(columns={"t_s": "stamp.secs"})
    assert "is its fraction in another column?" in guess(table).open["time"]


@pytest.mark.parametrize(
    ("names", "factor", "unit"),
    [
        (("p", "q", "r"), 1.0, "rad/s"), (("P (deg/s)", "Q (deg/s)", "R (deg/s)"), 180 / np.pi, "deg/s"),
        (("rollRate", "pitchRate", "yawRate"), 180 / np.pi, "deg/s"),
        (("imu.roll_rate", "imu.pitch_rate", "imu.yaw_rate"), 1.0, "rad/s"),
        (("gyro_roll_dps", "gyro_pitch_dps", "gyro_yaw_dps"), 180 / np.pi, "deg/s"),
        (("roll_rate_deg", "pitch_rate_deg", "yaw_rate_deg"), 180 / np.pi, "deg/s"),
        (("ATTITUDE.rollspeed", "ATTITUDE.pitchspeed", "ATTITUDE.yawspeed"), 1.0, "rad/s"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("attitude", [True, False])
def test_body_rates_named_by_letters_or_angles(flown: pd.DataFrame, names, factor: float, unit: str, attitude) -> None:
    """Without an attitude the unit is that of the names, or asked; a rate that is asked for is none."""
    table = plain(flown)
    rates = {n: table[f"gyro_{a}"] * factor for n, a in zip(names, "xyz", strict=True)}
    table = table.drop(columns=[f"gyro_{a}" for a in "xyz"]).assign(**rates, roll_rate_sp=0, pitch_rate_sp=0)
    if not attitude:
        table = table.drop(columns=["qw", "qx", "qy", "qz"])
    channel = guess(table).mapping.channels["angular_velocity"]
    stated = attitude or any(word in names[0] for word in ("dps", "deg", "speed"))
    assert channel.columns == tuple(names) and channel.unit == (unit if stated else "?")


@pytest.mark.parametrize(
    ("name", "factor", "unit"),
    [
        ("acc_{}_mg", 1000 / 9.80665, "mg"), ("acc_{}_cm_s2", 100.0, "cm/s2"), ("acc_{} [mm/s^2]", 1000.0, "mm/s2"),
        ("acc_{}_ft_s2", 1 / 0.3048, "ft/s2"), ("acc_{}", 1 / 0.3048, "?"), ("acc_{}", 1000.0, "?"),
        ("acc_{}_g", 100.0, "?"),
    ],
)  # fmt: skip
def test_units_of_an_accelerometer_by_its_names(flown: pd.DataFrame, name: str, factor: float, unit: str) -> None:
    table = plain(flown)
    force = {name.format(a): table[f"acc_{a}"] * factor for a in "xyz"}
    table = table.drop(columns=[f"acc_{a}" for a in "xyz"]).assign(**force)
    assert guess(table).mapping.channels["specific_force"].unit == unit


def test_the_names_of_plotjugglers_tables(flown: pd.DataFrame) -> None:
    """Members of an array have numbers of two digits."""
    table = plain(flown).rename(columns={"t_s": "__time"})
    new = {f"gyro_{a}": f"/fmu/sensor_combined/gyro_rad.{i:02d}" for i, a in enumerate("xyz")}
    new |= {f"acc_{a}": f"/fmu/sensor_combined/accelerometer_m_s2.{i:02d}" for i, a in enumerate("xyz")}
    new |= {f"q{a}": f"/fmu/vehicle_attitude/q.{i:02d}" for i, a in enumerate("wxyz")}
    channels = guess(table.rename(columns=new)).mapping.channels
    for name, form in (("angular_velocity", "gyro_"), ("specific_force", "acc_"), ("attitude", "q")):
        assert channels[name].columns == tuple(new[f"{form}{a}"] for a in ("wxyz" if name == "attitude" else "xyz"))
    assert channels["attitude"].form == "wxyz"


def test_nine_columns_are_a_matrix_and_no_quaternion(flown: pd.DataFrame) -> None:
    table = plain(flown).drop(columns=["qw", "qx", "qy", "qz"])
    turn = Rotation.from_quat(flown[list(c.QUATERNION)].to_numpy()[:, [1, 2, 3, 0]]).as_matrix().reshape(-1, 9)
    assert "attitude" not in guess(table.assign(**{f"rotation[{k}]": turn[:, k] for k in range(9)})).mapping.channels


def test_angles_above_a_full_turn_are_hundredths_of_a_degree(flown: pd.DataFrame) -> None:
    table = plain(flown).drop(columns=["qw", "qx", "qy", "qz"])
    turn = Rotation.from_quat(flown[list(c.QUATERNION)].to_numpy()[:, [1, 2, 3, 0]])
    angles = dict(zip(("yaw", "pitch", "roll"), turn.as_euler("ZYX", degrees=True).T * 100, strict=True))
    channel = guess(table.assign(**angles)).mapping.channels["attitude"]
    assert (channel.unit, channel.form) == ("cdeg", "euler")
