"""Bags of strangers: what messages state, which clock they have, which topic is taken, and files that end early.

Written by rosbags' own writers from one known flight.
"""

import struct
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.command_line import invoke
from tests.refusals import refused

pytest.importorskip("rosbags")
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation

from rotorid.errors import InputError
from rotorid.recordings import columns as c
from rotorid.recordings.importers import bag_records, ros
from rotorid.recordings.importers.bag_records import Records
from tests.unit.recordings.importers.test_log_formats import FLU, check_against, flown

EPOCH_S = 1_700_000_000.0
MINUS = np.full(9, 0.0)
MINUS[0] = -1.0
MORE = {
    "mav_msgs/msg/MotorSpeed": "std_msgs/Header header\nfloat32[] motor_speed\n",
    "mav_msgs/msg/CommandMotorSpeed": "std_msgs/Header header\nfloat32[] motor_speed\n",
    "mav_msgs/msg/Actuators": "std_msgs/Header header\nfloat64[] angles\nfloat64[] angular_velocities\n"
    "float64[] normalized\n",
    "actuator_msgs/msg/Actuators": "std_msgs/Header header\nfloat64[] position\nfloat64[] velocity\n"
    "float64[] normalized\n",
    "mavros_msgs/msg/RCOut": "std_msgs/Header header\nuint16[] channels\n",
    "mavros_msgs/msg/ESCStatusItem": "std_msgs/Header header\nint32 rpm\n",
    "mavros_msgs/msg/ESCStatus": "std_msgs/Header header\nmavros_msgs/ESCStatusItem[] esc_status\n",
    "mavros_msgs/msg/ESCTelemetryItem": "std_msgs/Header header\nint32 rpm\n",
    "mavros_msgs/msg/ESCTelemetry": "std_msgs/Header header\nmavros_msgs/ESCTelemetryItem[] esc_telemetry\n",
    "px4_msgs/msg/SensorCombined": "uint64 timestamp\nfloat32[3] gyro_rad\nfloat32[3] accelerometer_m_s2\n",
    "px4_msgs/msg/VehicleAngularVelocity": "uint64 timestamp\nfloat32[3] xyz\n",
    "px4_msgs/msg/VehicleAcceleration": "uint64 timestamp\nfloat32[3] xyz\n",
    "px4_msgs/msg/VehicleAttitude": "uint64 timestamp\nfloat32[4] q\nuint8 quat_reset_counter\n",
    "px4_msgs/msg/VehicleLandDetected": "uint64 timestamp\nbool landed\n",
    "px4_msgs/msg/VehicleLocalPosition": "uint64 timestamp\n"
    + "".join(f"float32 {name}\n" for name in ("x", "y", "z", "vx", "vy", "vz"))
    + "".join(f"bool {name}\n" for name in ("xy_valid", "z_valid", "v_xy_valid", "v_z_valid")),
    "px4_msgs/msg/ActuatorMotors": "uint64 timestamp\nfloat32[12] control\n",
    "px4_msgs/msg/EscReport": "int32 esc_rpm\nuint8 actuator_function\n",
    "px4_msgs/msg/EscStatus": "uint64 timestamp\nuint8 esc_count\nuint8 esc_online_flags\npx4_msgs/EscReport[8] esc\n",
    "mystery_msgs/msg/Turns": "std_msgs/Header header\nfloat32[] turns\n",
}
SPEEDS, THROTTLES = c.rotor_columns("rotor_speed", 4), c.rotor_columns("throttle", 4)


@cache
def store(two: bool):
    """Types of ROS 1 or 2, and those above."""
    made = get_typestore(Stores.LATEST if two else Stores.ROS1_NOETIC)
    for name, text in MORE.items():
        made.register(get_types_from_msg(text, name))
    return made


class Flight:
    """The known flight as messages: of each kind `make(k, stamp_s)` for row k."""

    def __init__(self, two: bool = True) -> None:
        self.two, self.types, self.table = two, store(two).types, flown()
        t = self.table
        self.quaternion = t[list(c.QUATERNION)].to_numpy()  # FRD to NED
        self.turn = FLU @ Rotation.from_quat(self.quaternion[:, [1, 2, 3, 0]]).as_matrix() @ FLU
        self.place, self.moves, self.rates, self.force = (
            t[list(names)].to_numpy() @ FLU for names in (c.POSITION, c.VELOCITY, c.ANGULAR_VELOCITY, c.SPECIFIC_FORCE)
        )
        self.speeds, self.throttles = t[list(SPEEDS)].to_numpy(), t[list(THROTTLES)].to_numpy()

    def __call__(self, kind: str, **fields):
        return self.types[kind](**fields)

    def header(self, stamp_s: float, frame: str = "base_link"):
        ns = round(stamp_s * 1e9)
        stamp = self("builtin_interfaces/msg/Time", sec=ns // 10**9, nanosec=ns % 10**9)
        return self("std_msgs/msg/Header", **({} if self.two else {"seq": 0}), stamp=stamp, frame_id=frame)

    def vector(self, xyz, kind: str = "Vector3"):
        return self(f"geometry_msgs/msg/{kind}", **dict(zip("xyz", map(float, xyz), strict=True)))

    def turned(self, k: int):
        w, x, y, z = self.quaternion[k] * [1, 1, -1, -1]
        return self("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)

    def no_turn(self, w: float = 0.0):
        return self("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=w)

    def imu(self, k: int, stamp_s: float, rates=None, force=None, turn=None, covariances=(None, None, None)):
        turn_cov, rates_cov, force_cov = (np.zeros(9) if v is None else v for v in covariances)
        return self(
            "sensor_msgs/msg/Imu", header=self.header(stamp_s), orientation=self.turned(k) if turn is None else turn,
            orientation_covariance=turn_cov,
            angular_velocity=self.vector(self.rates[k] if rates is None else rates),
            angular_velocity_covariance=rates_cov,
            linear_acceleration=self.vector(self.force[k] if force is None else force),
            linear_acceleration_covariance=force_cov,
        )  # fmt: skip

    def pose(self, k: int, turn=None):
        turn = self.turned(k) if turn is None else turn
        return self("geometry_msgs/msg/Pose", position=self.vector(self.place[k], "Point"), orientation=turn)

    def odometry(self, k: int, stamp_s: float, turn=None, covariance: float = 0.0, moves=None):
        every = np.full(36, covariance)
        pose = self("geometry_msgs/msg/PoseWithCovariance", pose=self.pose(k, turn), covariance=every)
        own = self.turn[k].T @ self.moves[k] if moves is None else moves
        twist = self("geometry_msgs/msg/Twist", linear=self.vector(own), angular=self.vector(self.rates[k]))
        twist = self("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=every)
        header = self.header(stamp_s, "odom")
        return self("nav_msgs/msg/Odometry", header=header, child_frame_id="base_link", pose=pose, twist=twist)

    def motors(self, k: int, stamp_s: float):
        empty = np.zeros(0)
        return self(
            "actuator_msgs/msg/Actuators", header=self.header(stamp_s), position=empty, velocity=self.speeds[k].copy(),
            normalized=empty,
        )  # fmt: skip


def written(path: Path, flight: Flight, topics: dict[str, tuple[Callable, Callable, int]], **how) -> Path:
    """A bag. Topics: to a name (k -> message, k -> time of recording in s, every so many rows). Returns its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    own = store(flight.two)
    rows = []
    for topic, (make, recorded, every) in topics.items():
        for k in range(0, len(flight.table), every):
            rows.append((round(recorded(k) * 1e9), topic, make(k)))
    rows.sort(key=lambda row: row[0])
    if flight.two:
        writer = Writer2(path, version=9, storage_plugin=how.get("plugin", StoragePlugin.MCAP))
        if how.get("zstd"):
            writer.set_compression(CompressionMode[how["zstd"]], CompressionFormat.ZSTD)
    else:
        writer = Writer1(path)
        if how.get("compression"):
            writer.set_compression(how["compression"])
    with writer:
        connections = {}
        for ns, topic, message in rows:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=own)
            raw = own.serialize_cdr(message, kind) if flight.two else own.serialize_ros1(message, kind)
            writer.write(connections[topic], ns, raw)
    if how.get("zstd") in ("FILE", "MESSAGE"):  # what the folder says is needed to read it
        return path
    files = [*path.glob("*.mcap"), *path.glob("*.db3")] if path.is_dir() else [path]
    return files[0]


def usual(flight: Flight, *names: str) -> dict[str, tuple[Callable, Callable, int]]:
    """Topics of a flight stamped at the time of recording."""
    _, at = stamped(flight)
    every = {
        "/imu": (lambda k: flight.imu(k, at(k)), at, 1),
        "/odom": (lambda k: flight.odometry(k, at(k)), at, 1),
        "/motors": (lambda k: flight.motors(k, at(k)), at, 1),
    }
    return {name: every[name] for name in names or every}


def stamped(flight: Flight) -> tuple[Flight, Callable[[int], float]]:
    """The flight, and when its rows are recorded, s."""
    return flight, lambda k: EPOCH_S + float(flight.table[c.TIME].iloc[k])


def read_back(
    path: Path, flight: Flight, topics: dict[str, tuple[Callable, Callable, int]]
) -> tuple[pd.DataFrame, list]:
    """The one run of a bag of these topics, and its faults."""
    found = ros.IMPORTER.read(written(path, flight, topics))
    runs, faults = found.runs, found.faults
    (run,) = runs.values()
    return run, faults


def kinds(faults) -> list[str]:
    return [fault.kind for fault in faults]


ATTITUDE, RATES, FORCE = 0, 1, 2
COLUMNS = {ATTITUDE: c.QUATERNION, RATES: c.ANGULAR_VELOCITY, FORCE: c.SPECIFIC_FORCE}


# What a message states ----------------------------------------------------------------------------


@pytest.mark.parametrize("two", [True, False], ids=["ROS 2", "ROS 1"])
@pytest.mark.parametrize("which", [ATTITUDE, RATES, FORCE])
def test_a_covariance_of_minus_one_states_nothing_and_another_topic_is_taken(tmp_path: Path, two, which: int) -> None:
    """The first topic has most messages, and a value that means nothing."""
    (flight, at), off = stamped(Flight(two)), [None, None, None]
    off[which] = MINUS
    nothing = {"turn": flight.no_turn(1.0)} if which == ATTITUDE else {("", "rates", "force")[which]: (99, 98, 97)}
    topics = {
        "/data_raw": (lambda k: flight.imu(k, at(k), covariances=off, **nothing), at, 1),
        "/data": (lambda k: flight.imu(k, at(k)), at, 2),
        **usual(flight, "/motors"),
    }
    run, faults = read_back(tmp_path / "a.bag", flight, topics)
    names = COLUMNS[which]
    assert run[list(names)].notna().mean().min() == pytest.approx(0.5, abs=0.02)
    if which == ATTITUDE:
        check_against(run.dropna().reset_index(drop=True), flight.table.iloc[::2].reset_index(drop=True), names, 1e-4)
    else:
        assert run[list(names)].abs().max().max() < 50
    # alone, the quantity is not there, and nothing is made up
    del topics["/data"]
    topics |= usual(flight, "/odom") if which == RATES else {}
    run, _ = read_back(tmp_path / "b.bag", flight, topics)
    assert not set(names) & set(run)


@pytest.mark.parametrize("which", [RATES, FORCE])
def test_what_nobody_has_set_states_nothing(tmp_path: Path, which: int) -> None:
    (flight, at), zero = stamped(Flight()), {("", "rates", "force")[which]: (0.0, 0.0, 0.0)}
    topics = usual(flight, "/odom", "/motors") | {"/imu": (lambda k: flight.imu(k, at(k), **zero), at, 1)}
    run, faults = read_back(tmp_path / "a", flight, topics)
    assert not set(COLUMNS[which]) & set(run)
    assert any(f.kind == "stuck" and "/imu" in f.found for f in faults)


@pytest.mark.parametrize("w", [0.0, 1.0])
def test_an_odometry_without_attitude_leaves_it_to_the_imu(tmp_path: Path, w: float) -> None:
    """A quaternion of zeros, or ROS 2's default of no turn; the velocity in body axes is turned by the IMU's."""
    flight, at = stamped(Flight())
    topics = usual(flight, "/imu", "/motors")
    topics["/odom"] = (lambda k: flight.odometry(k, at(k), turn=flight.no_turn(w)), at, 1)
    run, _ = read_back(tmp_path / "a", flight, topics)
    check_against(run, flight.table, (*c.QUATERNION, *c.VELOCITY, *c.POSITION), 1e-4)


def test_a_velocity_in_body_axes_without_any_attitude_is_left_out(tmp_path: Path) -> None:
    (flight, at), none = stamped(Flight()), (MINUS, None, None)
    topics = usual(flight, "/motors") | {
        "/imu": (lambda k: flight.imu(k, at(k), covariances=none), at, 1),
        "/odom": (lambda k: flight.odometry(k, at(k), turn=flight.no_turn()), at, 1),
    }
    run, faults = read_back(tmp_path / "a", flight, topics)
    assert not {*c.VELOCITY, *c.QUATERNION} & set(run) and set(c.POSITION) <= set(run)
    assert "no_attitude" in kinds(faults)


def test_a_bag_without_a_pose_is_read(tmp_path: Path) -> None:
    flight = Flight()
    run, _ = read_back(tmp_path / "a", flight, usual(flight, "/imu", "/motors"))
    check_against(run, flight.table, (*c.ANGULAR_VELOCITY, *c.SPECIFIC_FORCE, *c.QUATERNION, *SPEEDS), 1e-4)
    assert not {*c.POSITION, *c.VELOCITY} & set(run)


def test_a_twist_that_nobody_fills_is_no_velocity(tmp_path: Path) -> None:
    """As motion capture's odometry has it."""
    flight, at = stamped(Flight())
    topics = usual(flight, "/imu", "/motors")
    topics["/odom"] = (lambda k: flight.odometry(k, at(k), moves=(0.0, 0.0, 0.0)), at, 1)
    run, _ = read_back(tmp_path / "a", flight, topics)
    assert not set(c.VELOCITY) & set(run)


POSES = {
    "PoseStamped": lambda f, k, at: f("geometry_msgs/msg/PoseStamped", header=f.header(at), pose=f.pose(k)),
    "PoseWithCovarianceStamped": lambda f, k, at: f(
        "geometry_msgs/msg/PoseWithCovarianceStamped", header=f.header(at),
        pose=f("geometry_msgs/msg/PoseWithCovariance", pose=f.pose(k), covariance=np.full(36, -1.0)),
    ),
    "TransformStamped": lambda f, k, at: f(
        "geometry_msgs/msg/TransformStamped", header=f.header(at), child_frame_id="",
        transform=f("geometry_msgs/msg/Transform", translation=f.vector(f.place[k]), rotation=f.turned(k)),
    ),
    "Odometry": lambda f, k, at: f.odometry(k, at, covariance=-1.0),
    "VehicleAttitude": lambda f, k, at: f(
        "px4_msgs/msg/VehicleAttitude", timestamp=round(at * 1e6), q=f.quaternion[k].astype(np.float32),
        quat_reset_counter=0,
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", POSES)
def test_each_message_with_an_attitude_is_read_whatever_its_covariance(tmp_path: Path, kind: str) -> None:
    """A covariance of -1 states nothing in an Imu message alone."""
    (flight, at), none = stamped(Flight()), (MINUS, None, None)
    topics = usual(flight, "/motors") | {
        "/imu": (lambda k: flight.imu(k, at(k), turn=flight.no_turn(1.0), covariances=none), at, 1),
        "/pose": (lambda k: POSES[kind](flight, k, at(k)), at, 1),
    }
    run, _ = read_back(tmp_path / "a", flight, topics)
    names = c.QUATERNION if kind == "VehicleAttitude" else (*c.QUATERNION, *c.POSITION)
    check_against(run, flight.table, names, 1e-4)


@pytest.mark.parametrize("frame", ["base_link", "map"])
def test_a_twist_is_in_the_axes_that_its_frame_names(tmp_path: Path, frame: str) -> None:
    flight, at = stamped(Flight())

    def twist(k: int):
        own = flight.turn[k].T @ flight.moves[k] if frame == "base_link" else flight.moves[k]
        whole = flight("geometry_msgs/msg/Twist", linear=flight.vector(own), angular=flight.vector((0, 0, 0)))
        return flight("geometry_msgs/msg/TwistStamped", header=flight.header(at(k), frame), twist=whole)

    topics = usual(flight, "/imu", "/motors") | {"/velocity": (twist, at, 1)}
    run, _ = read_back(tmp_path / "a", flight, topics)
    check_against(run, flight.table, c.VELOCITY, 1e-4)


@pytest.mark.parametrize("order", [(0, 1, 2, 3), (2, 0, 3, 1)])
def test_px4s_own_messages_mean_what_its_logs_mean(tmp_path: Path, order: tuple[int, ...]) -> None:
    """The k-th controller drives motor `order[k]`; controller 0 is not heard in one message of twenty, motor 3 is
    stopped for a time, the vehicle takes off late, and the attitude is set anew in the air."""
    flight, at = stamped(Flight())
    t, n = flight.table, len(flight.table)
    silent, stopped, anew = (lambda k: k % 20 == 3), (lambda k: 500 < k < 550), 960

    def of(kind: str, **fields: Callable):
        return lambda k: flight(
            f"px4_msgs/msg/{kind}", timestamp=round(at(k) * 1e6), **{n: v(k) for n, v in fields.items()}
        )

    def columns(names) -> Callable:
        return lambda k: t[list(names)].iloc[k].to_numpy(np.float32)

    def control(k: int) -> np.ndarray:
        own = [np.nan if stopped(k) and i == 2 else v for i, v in enumerate(flight.throttles[k])]
        return np.array([*own, *[np.nan] * 8], np.float32)

    def reports(k: int) -> list:
        heard = [0 if silent(k) and i == 0 else flight.speeds[k][m] * 60 / (2 * np.pi) for i, m in enumerate(order)]
        functions = [101 + m for m in order] if order[0] else [0] * 4
        return [
            flight("px4_msgs/msg/EscReport", esc_rpm=round(v), actuator_function=f)
            for v, f in zip([*heard, 0, 0, 0, 0], [*functions, 0, 0, 0, 0], strict=True)
        ]

    place = {n: (lambda k, m=m: float(t[m].iloc[k])) for n, m in zip(
        ("x", "y", "z", "vx", "vy", "vz"), (*c.POSITION, *c.VELOCITY), strict=True
    )}  # fmt: skip
    place |= dict.fromkeys(("xy_valid", "z_valid", "v_xy_valid", "v_z_valid"), lambda _: True)
    both = {"gyro_rad": columns(c.ANGULAR_VELOCITY), "accelerometer_m_s2": columns(c.SPECIFIC_FORCE)}
    turned = {"q": columns(c.QUATERNION), "quat_reset_counter": lambda k: int(k >= anew)}
    escs = {"esc_count": lambda _: 4, "esc_online_flags": lambda k: 14 if silent(k) else 15, "esc": reports}
    topics = {
        "/fmu/out/sensor_combined": (of("SensorCombined", **both), at, 1),
        "/fmu/out/vehicle_attitude": (of("VehicleAttitude", **turned), at, 1),
        "/fmu/out/vehicle_local_position": (of("VehicleLocalPosition", **place), at, 1),
        "/fmu/out/actuator_motors": (of("ActuatorMotors", control=control), at, 1),
        "/fmu/out/esc_status": (of("EscStatus", **escs), at, 1),
        "/fmu/out/vehicle_land_detected": (of("VehicleLandDetected", landed=lambda k: k < 320), at, 1),
    }
    found = ros.IMPORTER.read(written(tmp_path / "a", flight, topics))
    runs, faults, unit = found.runs, found.faults, found.speed_unit
    found = {f.kind for f in faults}
    assert {"estimator_reset", "speed_missing", "stopped"} <= found and unit == "rpm"
    (run,) = runs.values()
    every = (*c.ANGULAR_VELOCITY, *c.SPECIFIC_FORCE, *c.QUATERNION, *c.POSITION, *c.VELOCITY, *SPEEDS, *THROTTLES)
    true = t.copy()
    true.loc[[stopped(k) for k in range(n)], "throttle_3"] = 0.0
    check_against(run, true, every, 1e-3)
    assert [run[name].isna().mean() > 0.04 for name in SPEEDS] == [m == order[0] for m in range(4)]
    assert run[c.TIME].iloc[-1] == pytest.approx(9.6 - 0.2 - 0.5 - 4.2, abs=0.1)
    assert unit == "rpm" and c.rotor_columns("throttle", 5)[4] not in run
    apart = {
        "/w": (of("VehicleAngularVelocity", xyz=columns(c.ANGULAR_VELOCITY)), at, 1),
        "/f": (of("VehicleAcceleration", xyz=columns(c.SPECIFIC_FORCE)), at, 1),
    }
    run, _ = read_back(tmp_path / "b", flight, {**apart, "/m": topics["/fmu/out/actuator_motors"]})
    check_against(run, flight.table, (*c.ANGULAR_VELOCITY, *c.SPECIFIC_FORCE), 1e-4)


# Rotors -------------------------------------------------------------------------------------------

EMPTY = np.zeros(0)
ROTORS = {
    "mav_msgs/msg/MotorSpeed": (lambda f, v: {"motor_speed": v.astype(np.float32)}, "rotor_speed"),
    "mav_msgs/msg/CommandMotorSpeed": (lambda f, v: {"motor_speed": v.astype(np.float32)}, "rotor_command"),
    "mav_msgs/msg/Actuators": (
        lambda f, v: {"angles": EMPTY, "angular_velocities": v, "normalized": EMPTY}, "rotor_speed",
    ),
    "actuator_msgs/msg/Actuators": (
        lambda f, v: {"position": EMPTY, "velocity": v, "normalized": EMPTY}, "rotor_speed",
    ),
    "mavros_msgs/msg/ESCStatus": (lambda f, v: {"esc_status": items(f, v, "ESCStatusItem")}, "rotor_speed"),
    "mavros_msgs/msg/ESCTelemetry": (lambda f, v: {"esc_telemetry": items(f, v, "ESCTelemetryItem")}, "rotor_speed"),
}  # fmt: skip


def items(flight: Flight, values: np.ndarray, kind: str) -> list:
    rpm = np.round(values * 60 / (2 * np.pi)).astype(int)
    return [flight(f"mavros_msgs/msg/{kind}", header=flight.header(0.0), rpm=int(v)) for v in rpm]


@pytest.mark.parametrize("two", [True, False], ids=["ROS 2", "ROS 1"])
@pytest.mark.parametrize("kind", ROTORS)
def test_each_type_that_carries_rotors_is_read_with_a_turning_sense_as_its_sign(tmp_path: Path, kind: str, two) -> None:
    (flight, at), sense, (made, column) = stamped(Flight(two)), np.array([-1.0, 1.0, 1.0, -1.0]), ROTORS[kind]

    def message(k: int):
        speeds = sense * flight.speeds[k] if k else flight.speeds[k][:0]  # an empty one first
        return flight(kind, header=flight.header(at(k)), **made(flight, speeds))

    run, faults = read_back(tmp_path / "a.bag", flight, usual(flight, "/imu") | {"/m": (message, at, 1)})
    names = c.rotor_columns(column, 4)
    truth = flight.table.rename(columns=dict(zip(SPEEDS, names, strict=True)))
    check_against(run, truth, names, 2e-3)
    assert "shape" in kinds(faults) and "reversed" not in kinds(faults)


def test_a_rotor_that_turns_back_for_a_time_has_empty_cells_there(tmp_path: Path) -> None:
    flight = Flight()
    flight.speeds = flight.speeds * np.where((np.arange(1200) // 100 == 5)[:, None], [1, -1, 1, 1], 1.0)
    run, faults = read_back(tmp_path / "a", flight, usual(flight))
    assert run[SPEEDS[1]].isna().sum() == 100 and run[SPEEDS[0]].notna().all()
    assert [f.column for f in faults if f.kind == "reversed"] == [SPEEDS[1]]


def test_a_topic_called_command_holds_commands_next_to_measured_speeds(tmp_path: Path) -> None:
    flight, at = stamped(Flight())

    def asked(k: int):
        message = flight.motors(k, at(k))
        return flight("actuator_msgs/msg/Actuators", header=message.header, position=EMPTY,
                      velocity=message.velocity + 10, normalized=EMPTY)  # fmt: skip

    topics = usual(flight, "/imu", "/motors") | {"/command/motor_speed": (asked, at, 1)}
    run, _ = read_back(tmp_path / "a", flight, topics)
    difference = run[list(c.rotor_columns("rotor_command", 4))].to_numpy() - run[list(SPEEDS)].to_numpy()
    np.testing.assert_allclose(difference, 10, atol=1e-6)
    del topics["/motors"]
    run, _ = read_back(tmp_path / "b", flight, topics)
    assert set(SPEEDS) <= set(run)


@pytest.mark.parametrize("motors", [4, 6, 8, 12])
def test_an_array_of_all_outputs_gives_every_motor_and_no_servo(tmp_path: Path, motors: int) -> None:
    """Next to a gimbal and a switch; a template of four rotors is refused for more."""
    (flight, at), rng = stamped(Flight()), np.random.default_rng(0)
    throttle = flight.throttles @ np.vstack([np.eye(4), rng.dirichlet(np.ones(4), motors - 4)]).T
    gimbal = 1500 + 100 * np.sin(2.3 * flight.table[c.TIME].to_numpy())
    switch = np.where(flight.table[c.TIME] > 6, 1900, 1100)
    still = np.full(len(gimbal), 1500)
    pulses = np.round(np.column_stack([1000 + 1000 * throttle, gimbal, still, switch])).astype(np.uint16)

    def out(k: int):
        return flight("mavros_msgs/msg/RCOut", header=flight.header(at(k)), channels=pulses[k].copy())

    path = written(tmp_path / "a", flight, usual(flight, "/imu", "/odom") | {"/mavros/rc/out": (out, at, 1)})
    found = ros.IMPORTER.read(path)
    runs, faults = found.runs, found.faults
    (run,) = runs.values()
    names = c.rotor_columns("throttle", motors)
    truth = flight.table.assign(**dict(zip(names, throttle.T, strict=True)))
    check_against(run, truth, names, 1e-3)
    assert [n for n in run if n.startswith("throttle")] == list(names)
    (said,) = [f.found for f in faults if f.kind == "servo"]
    assert f"channels {motors + 1}, {motors + 3} of" in said
    done = invoke("import", path, "--like", "x500", "--mass-kg", "2", "-o", tmp_path / "set")
    assert (done.exit_code == 0) == (motors == 4), done.output
    assert motors == 4 or f"drives {motors} rotors, the vehicle has 4" in done.output


def test_what_is_not_read_is_listed_where_something_is_missing(tmp_path: Path) -> None:
    flight, at = stamped(Flight())

    def turns(k: int):
        return flight("mystery_msgs/msg/Turns", header=flight.header(at(k)), turns=flight.speeds[k].astype(np.float32))

    topics = usual(flight) | {"/esc/turns": (turns, at, 2)}
    _, faults = read_back(tmp_path / "a", flight, topics)
    assert "unread" not in kinds(faults)
    del topics["/motors"]
    _, faults = read_back(tmp_path / "b", flight, topics)
    (said,) = [f.sentence for f in faults if f.kind == "unread"]
    assert "rotors" in said and "/esc/turns (mystery_msgs/msg/Turns, 50 Hz)" in said


# Clocks -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("two", [True, False], ids=["ROS 2", "ROS 1"])
@pytest.mark.parametrize("stamps", ["from zero", "of the wall", "none", "some topics have none", "two clocks", "mixed"])
def test_a_topic_has_one_clock(tmp_path: Path, stamps: str, two: bool) -> None:
    """Recorded 0.8 times as fast as the flight, or at its rate; whatever the stamps say, the flight is the same."""
    flight = Flight(two)
    slow = stamps in ("from zero", "some topics have none")
    t = flight.table[c.TIME].to_numpy()
    recorded = lambda k: EPOCH_S + 3 + t[k] / (0.8 if slow else 1.0)  # noqa: E731
    zero = lambda k: 0.0  # noqa: E731
    own = {
        "from zero": (lambda k: t[k],) * 3,
        "of the wall": (lambda k: EPOCH_S + t[k],) * 3,
        "none": (zero,) * 3,
        "some topics have none": (lambda k: t[k], lambda k: t[k], zero),
        "two clocks": (lambda k: t[k], lambda k: EPOCH_S + t[k] + 3, lambda k: 50 + t[k]),
        "mixed": (lambda k: EPOCH_S + t[k] if k > 150 else t[k],) * 3,  # the clock is set in flight
    }[stamps]
    topics = {
        "/imu": (lambda k: flight.imu(k, own[0](k)), recorded, 1),
        "/odom": (lambda k: flight.odometry(k, own[1](k)), recorded, 1),
        "/motors": (lambda k: flight.motors(k, own[2](k)), recorded, 1),
    }
    run, faults = read_back(tmp_path / "a.bag", flight, topics)
    within = 0.02 if stamps == "some topics have none" else 1e-3
    check_against(run, flight.table, (*c.ANGULAR_VELOCITY, *c.VELOCITY, *c.QUATERNION, *SPEEDS), within)
    assert np.diff(run[c.TIME]) == pytest.approx(0.01, abs=1e-5)
    named = {f.found.split(":")[0] for f in faults if f.kind == "two_clocks"}
    assert named == {"two clocks": {"/odom", "/motors"}, "mixed": {"/imu", "/odom", "/motors"}}.get(stamps, set())


# Files that end early, and what is not ROS's --------------------------------------------------------

FORMS = {
    "bag": (False, {}), "bag bz2": (False, {"compression": Writer1.CompressionFormat.BZ2}),
    "bag lz4": (False, {"compression": Writer1.CompressionFormat.LZ4}),
    "mcap": (True, {}), "mcap zstd": (True, {"zstd": "STORAGE"}), "db3": (True, {"plugin": StoragePlugin.SQLITE3}),
}  # fmt: skip


@pytest.fixture(scope="module")
def form(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    @cache
    def path_of(name: str) -> Path:
        two, how = FORMS[name]
        flight = Flight(two)
        return written(tmp_path_factory.mktemp("bags") / "flight.bag", flight, usual(flight), **how)

    return path_of


def cut(path: Path, folder: Path, share: float) -> Path:
    data = path.read_bytes()
    copy = folder / f"cut{path.suffix}"
    copy.write_bytes(data[: int(len(data) * share)])
    return copy


@pytest.mark.parametrize("share", [0.6, 0.8, 0.97])
@pytest.mark.parametrize("name", FORMS)
def test_a_bag_that_ends_early_keeps_what_came(form, tmp_path: Path, name: str, share: float) -> None:
    path = cut(form(name), tmp_path, share)
    found = ros._found(path)
    times = [row[1] for row in found.rows["rates", "/imu"]]
    assert found.cut and len(times) > 0.6 * share * 1200, len(times)
    found = ros.IMPORTER.read(path)
    runs, faults = found.runs, found.faults
    assert "cut_off" in kinds(faults)
    check_against(next(iter(runs.values())), flown(), (*c.ANGULAR_VELOCITY, *c.VELOCITY, *SPEEDS), 1e-4)


@pytest.mark.parametrize("name", ["bag", "mcap"])
def test_a_bag_cut_anywhere_gives_whole_messages_or_one_sentence(form, tmp_path: Path, name: str) -> None:
    size = len(form(name).read_bytes())
    counts = []
    for lost in (*range(0, 100, 9), *range(400, size, size // 8)):
        path = cut(form(name), tmp_path, 1 - (lost + 0.5) / size)
        try:
            counts.append(sum(map(len, ros._found(path).rows.values())))
        except InputError as error:
            assert str(error).startswith(f"{path}: ")
            counts.append(0)
    assert counts == sorted(counts, reverse=True) and counts[0] == 8 * 1200  # quantities and rows


@pytest.mark.parametrize("name", ["bag bz2", "mcap zstd"])
def test_a_chunk_that_cannot_be_unpacked_is_named(form, tmp_path: Path, name: str) -> None:
    data = bytearray(form(name).read_bytes())
    middle = len(data) // 5
    data[middle : middle + 200] = bytes(200)
    path = tmp_path / f"log{form(name).suffix}"
    path.write_bytes(data)
    records = Records(path)
    kept = len(list(records.messages()))
    assert records.lost_chunks >= 1 and kept < 3 * 1200


PACKED = {name: FORMS[name] for name in ("bag bz2", "bag lz4", "mcap zstd")}
PACKED |= {mode: (True, {"plugin": StoragePlugin.SQLITE3, "zstd": mode}) for mode in ("FILE", "MESSAGE")}


@pytest.mark.parametrize("name", PACKED)
def test_a_packed_bag_unpacks_to_no_more_than_other_packed_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    two, how = PACKED[name]
    flight = Flight(two)
    path = written(tmp_path / ("flight" if two else "flight.bag"), flight, usual(flight), **how)
    assert len(ros._found(path).rows["rates", "/imu"]) == 1200
    monkeypatch.setattr(bag_records, "LEAST_UNPACKED", 100)
    monkeypatch.setattr(bag_records, "MOST_UNPACKED", 0)
    for read in (ros._found, *([ros._by_records] if path.is_file() else [])):
        with pytest.raises(InputError, match="unpacks to more than"):
            read(path)


@pytest.mark.parametrize("name", FORMS)
def test_records_read_one_by_one_are_those_of_rosbags(form, name: str) -> None:
    own, theirs = ros._by_records(form(name)), ros._by_rosbags(form(name))
    assert not own.cut and own.rows.keys() == theirs.rows.keys()
    for key, rows in own.rows.items():
        assert sorted(row[:2] for row in rows) == sorted(row[:2] for row in theirs.rows[key])


def record(code: int, body: bytes) -> bytes:
    return bytes([code]) + struct.pack("<Q", len(body)) + body


def text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


FOREIGN = [("jsonschema", "json"), ("protobuf", "protobuf"), ("flatbuffer", "flatbuffer"), ("", "json")]


@pytest.mark.parametrize(("schema", "encoding"), FOREIGN)
@pytest.mark.parametrize("profile", ["ros2", ""])
def test_a_channel_that_is_not_of_ros_is_named_and_the_rest_is_read(
    form, tmp_path: Path, schema: str, encoding: str, profile: str
) -> None:
    """Records of a real file, with a channel, its schema and messages of another kind between them."""
    data = form("mcap").read_bytes()
    head = data[:8] + record(1, text(profile) + text("test"))
    channels = record(3, struct.pack("<H", 900) + text("State") + text(schema) + text("{}")) if schema else b""
    channels += record(4, struct.pack("<HH", 900, 900 if schema else 0) + text("/state") + text(encoding) + text(""))
    message = record(5, struct.pack("<HIQQ", 900, 0, 10**9, 10**9) + b"{}")
    first = 8 + 9 + struct.unpack_from("<Q", data, 9)[0]
    path = tmp_path / "log.mcap"
    whole = _without_summary(data[first:])
    path.write_bytes(head + channels + message + whole + message + record(2, bytes(20)) + data[:8])
    found = ros.IMPORTER.read(path)
    runs, faults = found.runs, found.faults
    check_against(next(iter(runs.values())), flown(), (*c.ANGULAR_VELOCITY, *SPEEDS), 1e-4)
    (said,) = [f.sentence for f in faults if f.kind == "unread"]
    assert f"/state ({encoding})" in said and "cut_off" not in kinds(faults)


def _without_summary(records: bytes) -> bytes:
    """Chunks alone."""
    out, at = b"", 0
    while at + 9 <= len(records):
        stop = at + 9 + struct.unpack_from("<Q", records, at + 1)[0]
        if records[at] == 6:
            out += records[at:stop]
        at = stop
    return out


def test_a_file_of_nothing_but_foreign_channels_names_them(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    body = record(1, text("") + text("test"))
    body += record(3, struct.pack("<H", 1) + text("S") + text("jsonschema") + text("{}"))
    body += record(4, struct.pack("<HH", 1, 1) + text("/state") + text("json") + text(""))
    path.write_bytes(b"\x89MCAP0\r\n" + body + record(2, bytes(20)) + b"\x89MCAP0\r\n")
    refused(r"no topic of a type that is known; found /state \(json\)", ros.IMPORTER.read, path)


# Which topic, and which axes ----------------------------------------------------------------------


def moving(two: bool = True) -> Flight:
    """The known flight with rates that integrate to its attitude, and a velocity that integrates to its position."""
    flight = Flight(two)
    flight.place = np.cumsum(flight.moves, axis=0) / 100
    turn = Rotation.from_matrix(flight.turn)
    flight.rates = np.vstack([(turn[:-1].inv() * turn[1:]).as_rotvec() * 100, np.zeros(3)])
    flight.table = flight.table.assign(**dict(zip(c.ANGULAR_VELOCITY, (flight.rates @ FLU).T, strict=True)))
    return flight


OTHERS = {"/mavros/setpoint_position/local": 1, "/vehicle/reference/pose": 1, "/vicon/cart/pose": 1, "/another/pose": 2}
"""Topics with a pose that is not that of the vehicle, and how often they come."""


@pytest.mark.parametrize("topic", OTHERS)
@pytest.mark.parametrize("every", [1, 2])
def test_the_pose_is_that_of_the_body_that_turns_as_measured(tmp_path: Path, topic: str, every: int) -> None:
    """Another body, or one that is asked for, moves too, as often or more often."""
    flight, at = stamped(moving())
    other = moving()
    other.place, other.quaternion = flight.place[::-1] * 1.5, flight.quaternion[::-1]
    topics = usual(flight, "/imu", "/motors") | {
        "/robot/pose": (lambda k: POSES["PoseStamped"](flight, k, at(k)), at, every),
        topic: (lambda k: POSES["PoseStamped"](other, k, at(k)), at, OTHERS[topic]),
    }
    del topics["/imu"]  # an inertial sensor is none that is asked for, whatever its vehicle is called
    topics["/target_1/imu"] = (lambda k: flight.imu(k, at(k), covariances=(MINUS, None, None)), at, 1)
    run, faults = read_back(tmp_path / "a", flight, topics)
    place = run[list(c.POSITION)].dropna().to_numpy() @ FLU
    first = np.linalg.norm(flight.place - place[0], axis=1).argmin()
    np.testing.assert_allclose(place, flight.place[first::every][: len(place)], atol=1e-6)
    assert any(topic in f.found and f.kind in ("command", "instances") for f in faults)


@pytest.mark.parametrize("stated", ["base_link", "map"])
@pytest.mark.parametrize("true", ["body", "world"])
@pytest.mark.parametrize("message", ["Odometry", "TwistStamped"])
def test_the_axes_of_a_velocity_by_what_it_integrates_to(tmp_path: Path, stated: str, true: str, message: str) -> None:
    """An odometry is in body axes by its definition, whatever its frames are called."""
    flight, at = stamped(moving())
    own = [flight.turn[k].T @ flight.moves[k] if true == "body" else flight.moves[k] for k in range(len(flight.moves))]

    def twist(k: int):
        whole = flight("geometry_msgs/msg/Twist", linear=flight.vector(own[k]), angular=flight.vector((0, 0, 0)))
        return flight("geometry_msgs/msg/TwistStamped", header=flight.header(at(k), stated), twist=whole)

    topics = usual(flight, "/imu", "/motors")
    if message == "Odometry":
        topics["/odom"] = (lambda k: flight.odometry(k, at(k), moves=own[k]), at, 1)
    else:
        topics |= {"/pose": (lambda k: POSES["PoseStamped"](flight, k, at(k)), at, 1), "/velocity": (twist, at, 1)}
    run, faults = read_back(tmp_path / "a", flight, topics)
    check_against(run, flight.table, c.VELOCITY, 1e-4)
    said = "body" if message == "Odometry" or stated == "base_link" else "world"
    assert any(f.kind == "axes" for f in faults) == (said != true)


@pytest.mark.parametrize("turn", [[[0, -1, 0], [0, 0, -1], [1, 0, 0]], [[1, 0, 0], [0, -1, 0], [0, 0, -1]]])
def test_an_inertial_sensor_whose_axes_are_not_the_vehicles(tmp_path: Path, turn) -> None:
    """A camera's that comes more often, or one in forward-right-down: passed over, refused where it is the only one."""
    (flight, at), turn = stamped(moving()), np.array(turn)
    camera = (lambda k: flight.imu(k, at(k), rates=turn @ flight.rates[k], force=turn @ flight.force[k]), at, 1)
    topics = usual(flight, "/odom", "/motors") | {"/camera/imu": camera}
    topics["/imu"] = (lambda k: flight.imu(k, at(k)), at, 2)
    run, _ = read_back(tmp_path / "a", flight, topics)
    read = run[[*c.ANGULAR_VELOCITY, *c.SPECIFIC_FORCE]].dropna().reset_index(drop=True)
    check_against(read, flight.table[::2].reset_index(drop=True), c.SPECIFIC_FORCE, 1e-4)
    del topics["/imu"]
    with pytest.raises(InputError, match=r"/camera/imu reads .* m/s² along [yz] in the median, expected 9.8 along z"):
        ros.IMPORTER.read(written(tmp_path / "b", flight, topics))


def test_numbers_that_mean_nothing_are_empty_cells(tmp_path: Path) -> None:
    """65535 in place of a pulse, a range beyond its sensor's."""
    flight, at = stamped(Flight())
    pulses = np.round(1000 + 1000 * flight.throttles).astype(np.uint16)
    pulses[::5, 1] = 65535

    def out(k: int):
        return flight("mavros_msgs/msg/RCOut", header=flight.header(at(k)), channels=pulses[k].copy())

    def below(k: int):
        metres = (2.0, np.inf, -np.inf, 30.0)[k // 10 % 4]
        return flight("sensor_msgs/msg/Range", header=flight.header(at(k)), radiation_type=0, field_of_view=0.1,
                      min_range=0.1, max_range=20.0, range=metres, variance=0.0)  # fmt: skip

    topics = usual(flight, "/imu", "/odom") | {"/mavros/rc/out": (out, at, 1), "/range": (below, at, 10)}
    run, _ = read_back(tmp_path / "a", flight, topics)
    assert run["throttle_2"].isna().mean() == pytest.approx(0.2, abs=0.01) and run["throttle_2"].max() < 1
    assert set(run[c.HEIGHT].dropna()) == {2.0}


def test_an_inertial_sensor_that_stands_still_is_not_read_however_fast_it_is(tmp_path: Path) -> None:
    """And the rotors are those of its vehicle, though another's change more often."""
    (flight, at), half = stamped(Flight()), len(flown()) // 2
    still = lambda k: flight.imu(k, at(k), rates=flight.rates[min(k, half)], force=flight.force[min(k, half)])  # noqa: E731
    topics = usual(flight, "/odom") | {
        "/a/fast": (still, at, 1), "/a/imu": (lambda k: flight.imu(k, at(k)), at, 3),
        "/b/motors": (lambda k: flight.motors(k, at(k)), at, 1), "/a/motors": usual(flight, "/motors")["/motors"],
    }  # fmt: skip
    topics["/a/motors"] = (*topics["/a/motors"][:2], 2)
    _, faults = read_back(tmp_path / "a", flight, topics)
    taken = {f.column: f.action for f in faults if f.kind == "instances"}
    assert taken["rates"] == taken["force"] == "/a/imu taken" and taken["speeds"] == "/a/motors taken"


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_battery_that_is_discharged_has_a_positive_current(tmp_path: Path, sign: int) -> None:
    """Negative by the message's definition; many drivers state it as positive."""
    flight, at = stamped(Flight())
    kind, zeros = "sensor_msgs/msg/BatteryState", np.zeros(0, np.float32)
    plain = dict.fromkeys(("temperature", "charge", "capacity", "design_capacity", "percentage"), 0.0)
    plain |= dict.fromkeys([f"power_supply_{n}" for n in ("status", "health", "technology")], 0)
    plain |= {"present": True, "cell_voltage": zeros, "cell_temperature": zeros, "location": "", "serial_number": ""}
    make = lambda k: flight(kind, header=flight.header(at(k)), voltage=15.0, current=sign * 12.0, **plain)  # noqa: E731
    run, _ = read_back(tmp_path / "a", flight, usual(flight) | {"/battery": (make, at, 10)})
    assert set(run[c.BATTERY_CURRENT].dropna()) == {12.0}
