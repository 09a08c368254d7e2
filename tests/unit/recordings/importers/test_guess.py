"""Guessing what columns are: by names and numbers, with evidence, and open where neither decides."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from rotorid.cli import app
from rotorid.cli.simulating import fly
from rotorid.errors import InputError
from rotorid.recordings import columns as c
from rotorid.recordings import read_set, templates
from rotorid.recordings.importers.guessing import names as column_names
from rotorid.recordings.importers.guessing.guess import guess
from rotorid.recordings.importers.guessing.text import as_text
from rotorid.recordings.importers.mapping import BODY, UNITS, WORLD, convert, read_mapping
from tests.public_logs import LOGS, needs_logs

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


@needs_logs
def test_names_that_end_as_others_do_are_told_apart_in_a_public_table() -> None:
    """`ang_vel_x` was taken for a velocity, `acc_b_x` for a position, and `vx` was left out."""
    found = guess(pd.read_csv(LOGS / "csv-ddd/quadrotor_model.csv"))
    columns = {name: channel.columns for name, channel in found.mapping.channels.items()}
    assert columns == {
        "time": ("timestamp",),
        "angular_velocity": ("ang_vel_x", "ang_vel_y", "ang_vel_z"),
        "attitude": ("q0", "q1", "q2", "q3"),
        "specific_force": ("acc_b_x", "acc_b_y", "acc_b_z"),
        "velocity": ("vx", "vy", "vz"),
        "throttle": ("u0", "u1", "u2", "u3"),
    }
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
    with pytest.raises(InputError, match=rf"{path}: still open \(\?\): .*{open_at}"):
        read_mapping(path)
    words = ["import", str(own), "--mapping", str(path), "--like", "thesis", "-o", str(tmp_path / "set")]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 1 and "still open" in done.output and not (tmp_path / "set").exists()


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
        ("ang_vel_{}", "angular_velocity"),
        ("gyro_bias_{}", None),
        ("acc_sp_{}", None),
        ("ang_acc_b_{}", None),
        ("vel_ref_{}", None),
        ("magnetometer_{}", None),
        ("estimate.v{}", "velocity"),
        ("gyro_{}_deg_s", "angular_velocity"),
        ("{}", "position"),
        ("pos_{}[mm]", "position"),
    ],
)
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
    ],
)  # fmt: skip
def test_the_range_of_throttles_is_found_or_asked(names: str, values: np.ndarray, more: dict, ends) -> None:
    """By smallest and largest, by where a vehicle hovers, and by the other columns; asked where two ranges fit."""
    found = throttles_of(names, values, **more)
    channel = found.mapping.channels["throttle"]
    assert (channel.unit == "1") == (ends is None), found.evidence
    assert channel.range == (tuple(ends) if isinstance(ends, list) else ends), (found.evidence, found.open)
    assert ("throttle" in found.open) == (ends == "?")


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
    with pytest.raises(InputError, match=said):
        read_mapping(path)
