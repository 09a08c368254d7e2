"""Logs of Betaflight, ArduPilot, ROS and MCAP: small files of one known flight, written here byte by byte or by the
formats' own writers, come back in the contract's axes and units."""

import json
import shutil
import struct
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from rotorid.errors import InputError
from rotorid.recordings import columns as c
from rotorid.recordings import read_set
from rotorid.recordings.importers.known import ORDERS, quad_x
from rotorid.recordings.importers.logfile import importer_of, read_log, set_of_logs
from tests.command_line import answer, invoke, refusal
from tests.public_logs import public
from tests.refusals import refused

RATE_HZ, SECONDS, REST_S = 100.0, 12.0, 2.0
FLU = np.diag([1.0, -1.0, -1.0])
"""Forward-right-down from forward-left-up, and its own inverse."""


def flown() -> pd.DataFrame:
    """A flight in contract columns with two seconds of rest before and after it."""
    time_s = np.arange(int(SECONDS * RATE_HZ)) / RATE_HZ
    air = (time_s > REST_S) & (time_s < SECONDS - REST_S)
    waves = np.sin(2 * np.pi * np.outer(time_s, [0.7, 1.1, 0.4, 0.9, 1.3, 0.3])) * air[:, None]
    quaternion = Rotation.from_euler("ZYX", 0.4 * waves[:, 2::-1]).as_quat()[:, [3, 0, 1, 2]]
    speeds = np.where(air[:, None], 700 + 60 * np.sin(np.outer(time_s, [3.0, 4.0, 5.0, 6.0])), 0.0)
    groups = (
        (c.POSITION, waves[:, :3] * 2), (c.VELOCITY, waves[:, 3:] * 3), (c.QUATERNION, quaternion),
        (c.ANGULAR_VELOCITY, waves[:, ::-1][:, :3] * np.array([1.0, 2.0, 0.5])),
        (c.SPECIFIC_FORCE, waves[:, :3] * np.array([0.5, 1.0, 2.0]) - np.array([0.0, 0.0, 9.81])),
        (c.rotor_columns("rotor_speed", 4), speeds), (c.rotor_columns("throttle", 4), speeds / 1400),
    )  # fmt: skip
    columns = {c.TIME: time_s} | {n: v for names, values in groups for n, v in zip(names, values.T, strict=True)}
    return pd.DataFrame(columns).assign(battery_voltage_v=16.0 - 0.05 * time_s)


def check_against(run: pd.DataFrame, truth: pd.DataFrame, names, within: float, half_step: float = 0.0) -> None:
    """A run holds columns of the true flight, from some instant on, each within a share of what it spans.

    Nothing is closer than `half_step`, half of what the log counts in, own unit.
    """
    found = run[c.ANGULAR_VELOCITY[0]].to_numpy()
    candidates = range(len(truth) - len(run) + 1)
    true = truth[c.ANGULAR_VELOCITY[0]].to_numpy()
    start = min(candidates, key=lambda k: np.nanmean((true[k : k + len(found)] - found) ** 2))
    part = truth.iloc[start : start + len(run)]
    for name in names:
        values, expected = run[name].to_numpy(), part[name].to_numpy()
        if name in c.QUATERNION:
            values = values * np.sign(np.nansum(run[c.QUATERNION[0]] * part[c.QUATERNION[0]].to_numpy()))
        known = np.isfinite(values)
        assert known.mean() > 0.9, name
        np.testing.assert_allclose(
            values[known], expected[known], atol=max(within * np.ptp(expected), within, half_step), err_msg=name
        )


BODY = (*c.ANGULAR_VELOCITY, *c.SPECIFIC_FORCE)
STATE = (*c.POSITION, *c.VELOCITY, *c.QUATERNION)
SPEEDS, THROTTLES = c.rotor_columns("rotor_speed", 4), c.rotor_columns("throttle", 4)


# Betaflight ---------------------------------------------------------------------------------------


def signed_vb(value: int) -> bytes:
    """A whole number as blackbox writes it: zigzag, seven bits a byte."""
    rest, out = (value << 1) ^ (value >> 31), bytearray()
    rest &= 0xFFFFFFFF
    while rest > 127:
        out.append(rest & 127 | 128)
        rest >>= 7
    return bytes([*out, rest])


def blackbox(
    truth: pd.DataFrame, firmware: str = "Betaflight 4.4.2 (abc) STM32F7X2", stated: tuple[str, ...] = (), **fields
) -> bytes:
    """A blackbox log of key frames alone: forward-left-up, deg/s, 2048 to 1 g, DShot, eRPM in hundreds.

    `stated` are more lines of its header, `fields` more fields, or others in place of these (None: without).
    """
    names = ["loopIteration", "time", *(f"gyroADC[{i}]" for i in range(3)), *(f"accSmooth[{i}]" for i in range(3)),
             *(f"motor[{i}]" for i in range(4)), *(f"eRPM[{i}]" for i in range(4)), "vbatLatest"]  # fmt: skip
    rates = np.degrees(truth[list(c.ANGULAR_VELOCITY)].to_numpy() @ FLU) * 10  # gyro_scale 0.1
    force = truth[list(c.SPECIFIC_FORCE)].to_numpy() @ FLU / 9.80665 * 2048
    motors = 158 + truth[list(THROTTLES)].to_numpy() * (2047 - 158)
    turns = truth[list(SPEEDS)].to_numpy() * 60 / (2 * np.pi) * 7 / 100
    count = np.arange(len(truth))
    columns = [
        count, truth[c.TIME] * 1e6 + 5e6, *rates.T, *force.T, *motors.T, *turns.T, truth["battery_voltage_v"] * 100,
    ]  # fmt: skip
    written = dict(zip(names, columns, strict=True)) | fields
    names, columns = zip(*((n, column) for n, column in written.items() if column is not None), strict=True)
    scale = struct.unpack("<I", struct.pack("<f", 0.1))[0]
    zeros, ones = ",".join("0" * len(names)), ",".join("1" * len(names))
    lines = [
        "Product:Blackbox flight data recorder by Nicholas Sherlock", "Data version:2", "I interval:1",
        f"Field I name:{','.join(names)}", f"Field I signed:{ones}", f"Field I predictor:{zeros}",
        f"Field I encoding:{zeros}", f"Field P predictor:{zeros}", f"Field P encoding:{zeros}",
        f"Firmware revision:{firmware}", "minthrottle:1070", "maxthrottle:2000", "vbatref:1600",
        f"gyro_scale:0x{scale:08x}", "acc_1G:2048", "motorOutput:158,2047", "motor_poles:14",
        *stated,
    ]  # fmt: skip
    head = "".join(f"H {line}\n" for line in lines).encode()
    table = np.rint(np.column_stack(columns)).astype(int)
    body = b"".join(b"I" + b"".join(signed_vb(int(v)) for v in row) for row in table)
    return head + body + b"E\xffEnd of log\0"


def test_betaflight(tmp_path: Path) -> None:
    path, truth = tmp_path / "LOG00001.BFL", flown()
    path.write_bytes(blackbox(truth))
    found = read_log(path)
    assert (found.format, found.known.autopilot) == ("betaflight", "betaflight")
    (run,) = found.runs.values()
    check_against(run, truth, (*BODY, *THROTTLES), 2.5e-3)  # half a step of 1/2048 g
    check_against(run, truth, (c.ANGULAR_VELOCITY[0], c.BATTERY_VOLTAGE), 1e-3, half_step=0.5 * 0.01)
    # Speeds are counted in hundreds of electrical turns a minute, of seven pole pairs.
    check_against(run, truth, (c.ANGULAR_VELOCITY[0], *SPEEDS), 1e-3, half_step=0.5 * 100 / 7 * 2 * np.pi / 60)
    # Rest, take-off and landing are cut out.
    assert run[c.TIME].iloc[-1] == pytest.approx(SECONDS - 2 * REST_S - 1.5, abs=0.1)
    assert run[c.SPECIFIC_FORCE[2]].mean() == pytest.approx(-9.81, abs=0.3)


def inav(truth: pd.DataFrame, trusted: np.ndarray | int = 5) -> dict[str, np.ndarray]:
    """Fields of iNAV: tenths of a degree, the nose lowered by a positive pitch; cm and cm/s, north-east-up; 0.01 V."""
    yaw, pitch, roll = Rotation.from_quat(truth[list(c.QUATERNION)].to_numpy()[:, [1, 2, 3, 0]]).as_euler("ZYX").T
    attitude = np.degrees([roll, -pitch, yaw % (2 * np.pi)]) * 10
    fields = {f"attitude[{k}]": attitude[k] for k in range(3)}
    for field, names in (("navPos", c.POSITION), ("navVel", c.VELOCITY)):
        fields |= {f"{field}[{k}]": (100, 100, -100)[k] * truth[name] for k, name in enumerate(names)}
    none = {f"eRPM[{k}]": None for k in range(4)} | {"vbatLatest": None}
    return none | fields | {"vbat": truth["battery_voltage_v"] * 100, "navFlags": trusted + np.zeros(len(truth))}


def test_blackbox_of_inav(tmp_path: Path) -> None:
    path, truth = tmp_path / "LOG00001.TXT", flown()
    path.write_bytes(blackbox(truth, "INAV 7.1.2 (abc) MATEKF405", **inav(truth)))
    (run,) = read_log(path).runs.values()
    check_against(run, truth, (*BODY, *THROTTLES), 2.5e-3)
    check_against(run, truth, (*STATE, c.BATTERY_VOLTAGE), 1e-3, half_step=5e-3)


def test_places_that_inav_does_not_trust_are_empty(tmp_path: Path) -> None:
    path, truth = tmp_path / "LOG00001.TXT", flown()
    trusted = np.where(np.arange(len(truth)) < len(truth) // 2, 5, 1)
    path.write_bytes(blackbox(truth, "INAV 7.1.2 (abc) MATEKF405", **inav(truth, trusted)))
    (run,) = read_log(path).runs.values()
    assert run[c.POSITION[2]].notna().all() and 0.3 < run[c.VELOCITY[0]].notna().mean() < 0.7
    path.write_bytes(blackbox(truth, "INAV 1.7.2 (abc) MATEKF405", **inav(truth, 0)))
    found = read_log(path)
    (run,) = found.runs.values()
    assert not {*c.POSITION, *c.VELOCITY, c.BATTERY_VOLTAGE} & set(run) and c.QUATERNION[0] in run
    assert "vbatLatest: the header does not state" in " ".join(f.sentence for f in found.faults)


@pytest.mark.parametrize(("cells", "volts"), [("33,35,43", 10), ("330,350,430", 100)])
def test_blackbox_of_emuflight(tmp_path: Path, cells: str, volts: int) -> None:
    path, truth = tmp_path / "LOG00001.BBL", flown()
    counts = truth["battery_voltage_v"] * volts
    stated = (f"vbatcellvoltage:{cells}",)
    path.write_bytes(blackbox(truth, "EmuFlight 3.7.0 (abc) HELIOSPRING", stated, vbatLatest=counts))
    (run,) = read_log(path).runs.values()
    check_against(run, truth, (*BODY, *THROTTLES, c.BATTERY_VOLTAGE), 2.5e-3, half_step=0.5 / volts)


@pytest.mark.parametrize(
    ("firmware", "why"),
    [
        ("Rotorflight 4.3.0 (abc) STM32F7", "of a helicopter"),
        ("Baseflight 1.0", "only the axes and units of Betaflight"),
    ],
)
def test_blackbox_of_another_firmware_is_refused(tmp_path: Path, firmware: str, why: str) -> None:
    path = tmp_path / "LOG.TXT"
    path.write_bytes(blackbox(flown(), firmware))
    refused(f"{firmware.split()[0]}.*{why}|{why}.*{firmware.split()[0]}", read_log, path)


# ArduPilot ----------------------------------------------------------------------------------------

FORMATS = {  # kind: number, format, labels
    "PARM": (64, "QNf", "TimeUS,Name,Value"),
    "IMU": (65, "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
    "XKQ": (66, "QBffff", "TimeUS,C,Q1,Q2,Q3,Q4"),
    "XKF1": (67, "QBffffff", "TimeUS,C,VN,VE,VD,PN,PE,PD"),
    "RCOU": (68, "QHHHHHHHH", "TimeUS,C1,C2,C3,C4,C5,C6,C7,C8"),
    "ESC": (69, "QBf", "TimeUS,Instance,RPM"),
    "BAT": (70, "QBff", "TimeUS,Inst,Volt,Curr"),
    "EV": (71, "QB", "TimeUS,Id"),
}
LETTERS = {"Q": "Q", "B": "B", "f": "f", "H": "H", "N": "16s"}


def dataflash(truth: pd.DataFrame, parameters: dict[str, float], before_4_1: bool = False) -> bytes:
    """A DataFlash log: every kind's format, then messages; motors 1 to 4 on channels 5 to 8, 1100 to 1900 µs.

    `before_4_1`: each speed controller has a message of its own, ESC5 to ESC8.
    """
    out = bytearray()
    each = {f"ESC{n}": (200 + n, "Qf", "TimeUS,RPM") for n in range(5, 9)} if before_4_1 else {}
    formats = FORMATS | each
    table = {"FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns"), **formats}

    def message(kind: str, *values) -> None:
        number, form, _ = formats[kind]
        packed = struct.pack("<" + "".join(LETTERS[x] for x in form), *values)
        out.extend(b"\xa3\x95" + bytes([number]) + packed)

    for kind, (number, form, labels) in table.items():
        letters = LETTERS | {"n": "4s", "Z": "64s"}
        size = 3 + struct.calcsize("<" + "".join(letters[x] for x in form))
        out.extend(
            b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", number, size, kind.encode(), form.encode(), labels.encode())
        )
    for name, value in parameters.items():
        message("PARM", 1000, name.encode(), value)
    for k, row in enumerate(truth.itertuples(index=False)):
        at = int(row.time_s * 1e6) + 2_000_000
        values = row._asdict()
        if k == int(REST_S * RATE_HZ) + 1:
            message("EV", at, 28)
        if k == int((SECONDS - REST_S) * RATE_HZ) - 1:
            message("EV", at, 18)
        message("IMU", at, 0, *(values[n] for n in BODY))
        message("IMU", at, 1, *(0.0,) * 6)
        message("XKQ", at, 0, *(values[n] for n in c.QUATERNION))
        message("XKF1", at, 0, *(values[n] for n in (*c.VELOCITY, *c.POSITION)))
        message("RCOU", at, 1500, 1500, 1500, 1500, *(round(1100 + 800 * values[n]) for n in THROTTLES))
        for i, name in enumerate(SPEEDS):
            message(*(("ESC", at, 4 + i) if not each else (f"ESC{5 + i}", at)), values[name] * 60 / (2 * np.pi))
        message("BAT", at, 0, values["battery_voltage_v"], 12.0)
    return bytes(out)


PARAMETERS = {"FRAME_CLASS": 1, "FRAME_TYPE": 1, "MOT_PWM_MIN": 1100, "MOT_PWM_MAX": 1900}
PARAMETERS |= {f"SERVO{n}_FUNCTION": 28 + n for n in range(5, 9)}


@pytest.mark.parametrize("before_4_1", [False, True])
def test_ardupilot(before_4_1: bool, tmp_path: Path) -> None:
    path, truth = tmp_path / "00000001.BIN", flown()
    path.write_bytes(dataflash(truth, PARAMETERS, before_4_1))
    found = read_log(path)
    assert (found.format, found.known.autopilot) == ("ardupilot", "ardupilot")
    (run,) = found.runs.values()
    check_against(run, truth, (*BODY, *STATE, *SPEEDS, *THROTTLES, c.BATTERY_VOLTAGE), 2e-3)
    assert run[c.TIME].iloc[-1] == pytest.approx(SECONDS - 2 * REST_S - 1.5, abs=0.1)


@pytest.mark.parametrize(("form", "order"), [(1, "ardupilot"), (12, "betaflight"), (0, "")])
def test_the_frame_type_says_the_order_of_the_rotors(tmp_path: Path, form: int, order: str) -> None:
    path = tmp_path / "log.bin"
    path.write_bytes(dataflash(flown(), PARAMETERS | {"FRAME_TYPE": form}))
    found = read_log(path)
    assert found.known.autopilot == order
    assert any(f.kind == "order" for f in found.faults) == (not order)


# ROS ----------------------------------------------------------------------------------------------


def ros_messages(truth: pd.DataFrame, types, two: bool):
    """(topic, type, time in ns, message) of a flight as REP 103 has it: forward-left-up, z up; twist in body axes."""
    made = types

    def header(ns: int):
        stamp = made["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
        return made["std_msgs/msg/Header"](**({} if two else {"seq": 0}), stamp=stamp, frame_id="base_link")

    def vector(kind: str, xyz):
        return made[f"geometry_msgs/msg/{kind}"](x=float(xyz[0]), y=float(xyz[1]), z=float(xyz[2]))

    # FRD to NED into FLU to z up
    turns = FLU @ Rotation.from_quat(truth[list(c.QUATERNION)].to_numpy()[:, [1, 2, 3, 0]]).as_matrix() @ FLU
    quaternions = Rotation.from_matrix(turns).as_quat()
    places, moving, rates, forces = (
        truth[list(names)].to_numpy() @ FLU for names in (c.POSITION, c.VELOCITY, c.ANGULAR_VELOCITY, c.SPECIFIC_FORCE)
    )
    own = np.einsum("nji,nj->ni", turns, moving)
    speeds = np.ascontiguousarray(truth[list(SPEEDS)])
    nine, thirty_six = np.zeros(9), np.zeros(36)
    for k, time_s in enumerate(truth[c.TIME]):
        ns = int(round((time_s + 1_700_000_000) * 1e9))
        x, y, z, w = (float(v) for v in quaternions[k])
        turn = made["geometry_msgs/msg/Quaternion"](x=x, y=y, z=z, w=w)
        yield "/imu", "sensor_msgs/msg/Imu", ns, made["sensor_msgs/msg/Imu"](
            header=header(ns), orientation=turn, orientation_covariance=nine,
            angular_velocity=vector("Vector3", rates[k]),
            angular_velocity_covariance=nine, linear_acceleration=vector("Vector3", forces[k]),
            linear_acceleration_covariance=nine,
        )  # fmt: skip
        pose = made["geometry_msgs/msg/PoseWithCovariance"](
            pose=made["geometry_msgs/msg/Pose"](position=vector("Point", places[k]), orientation=turn),
            covariance=thirty_six,
        )
        twist = made["geometry_msgs/msg/TwistWithCovariance"](
            twist=made["geometry_msgs/msg/Twist"](
                linear=vector("Vector3", own[k]), angular=vector("Vector3", rates[k])
            ),
            covariance=thirty_six,
        )
        yield (
            "/odom",
            "nav_msgs/msg/Odometry",
            ns,
            made["nav_msgs/msg/Odometry"](header=header(ns), child_frame_id="base_link", pose=pose, twist=twist),
        )
        yield (
            "/motors",
            "actuator_msgs/msg/Actuators",
            ns,
            made["actuator_msgs/msg/Actuators"](
                header=header(ns), position=np.zeros(0), velocity=speeds[k], normalized=np.zeros(0)
            ),
        )


ACTUATORS = "std_msgs/Header header\nfloat64[] position\nfloat64[] velocity\nfloat64[] normalized\n"


def write_bag(path: Path, kind: str, truth: pd.DataFrame) -> Path:
    """A bag of a flight by rosbags' own writers; returns the path to import."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    two = kind != "bag"
    store = get_typestore(Stores.LATEST if two else Stores.ROS1_NOETIC)
    store.register(get_types_from_msg(ACTUATORS, "actuator_msgs/msg/Actuators"))
    if two:
        writer = Writer2(
            path, version=9, storage_plugin=StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        )
    else:
        writer = Writer1(path)
    with writer:
        connections = {}
        for topic, name, ns, message in ros_messages(truth, store.types, two):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, name, typestore=store)
            raw = store.serialize_cdr(message, name) if two else store.serialize_ros1(message, name)
            writer.write(connections[topic], ns, raw)
    return next(path.glob("*.mcap")) if kind == "mcap" else path


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The bag of the flight in each of its forms, written once."""
    pytest.importorskip("rosbags")

    @cache
    def written(kind: str) -> Path:
        return write_bag(tmp_path_factory.mktemp(kind) / ("flight.bag" if kind == "bag" else "flight"), kind, flown())

    return written


@pytest.mark.parametrize("kind", ["bag", "mcap", "folder"])
def test_ros(bag, kind: str) -> None:
    found = read_log(bag(kind))
    assert found.format == "ros"
    (run,) = found.runs.values()
    check_against(run, flown(), (*BODY, *STATE, *SPEEDS), 1e-4)


def copied(path: Path, folder: Path) -> None:
    """A bag's folder once more; of MCAP the file inside is what is imported."""
    shutil.copytree(path.parent if path.suffix == ".mcap" else path, folder)


@pytest.mark.parametrize("kind", ["mcap", "folder"])
def test_the_folder_of_a_bag_becomes_a_set(bag, tmp_path: Path, monkeypatch, kind: str) -> None:
    """Of MCAP and SQLite alike; by default the set does not land among the bag's files."""
    from rotorid.recordings import read_set

    copied(bag(kind), tmp_path / "flight")
    before = sorted((tmp_path / "flight").iterdir())
    monkeypatch.chdir(tmp_path)
    answer("import", "flight", "--like", "five-inch", "--mass-kg", "0.7")
    assert sorted((tmp_path / "flight").iterdir()) == before
    (run,) = read_set(tmp_path / "flight-set").runs
    check_against(run.table, flown(), (*BODY, *STATE, *SPEEDS), 1e-4)
    listed = json.loads((tmp_path / "flight-set" / "import_report.json").read_text())["files"]
    assert sorted(listed) == [f"flight/{p.name}" for p in before]


def test_verdict_takes_the_folder_of_a_bag_for_a_log(bag, tmp_path: Path, monkeypatch) -> None:
    copied(bag("folder"), tmp_path / "flight")
    made = tmp_path / "answer" / "flight" / "vehicle.yaml"
    words = ["verdict", "flight", "--like", "five-inch", "--mass-kg", "0.7", "-o", "answer"]
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("rotorid.cli.verdicts.write_verdict", lambda *_: (_ for _ in ()).throw(InputError("made")))
    assert invoke(*words).output.endswith("rotorid: made\n") and made.is_file()


# All of them --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "head", [b"H Product:Blackbox flight", b"\xa3\x95\x80", b"#ROSBAG V2.0\n", b"\x89MCAP0\r\n", b"SQLite format 3\0"]
)
def test_a_file_that_is_cut_off_or_broken_gets_one_sentence(tmp_path: Path, head: bytes) -> None:
    path = tmp_path / "log.db3"
    path.write_bytes(head + bytes(range(256)) * 3)
    refusal("import", path, "-o", tmp_path / "set", "--like", "five-inch")
    assert not (tmp_path / "set").exists()


def test_a_missing_package_is_named_with_how_to_get_it(tmp_path: Path, monkeypatch) -> None:
    import sys

    path = tmp_path / "log.bag"
    path.write_bytes(b"#ROSBAG V2.0\n" + bytes(64))
    for module in [m for m in sys.modules if m.split(".")[0] == "rosbags"] + ["rosbags"]:
        monkeypatch.setitem(sys.modules, module, None)
    refused(r"pip install 'rotorid\[ros\]'", read_log, path)


def test_dataflash_needs_no_package_of_others(tmp_path: Path, monkeypatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "pymavlink", None)
    path = tmp_path / "log.bin"
    path.write_bytes(dataflash(flown(), PARAMETERS))
    assert list(read_log(path).runs) == ["log"]


@pytest.mark.parametrize(
    ("start", "name"),
    [
        (b"\xff" * 40 + b"H Product:Blackbox flight data recorder\n", "betaflight"),
        (bytes(7) + b"\xa3\x95\x80\x80\x59FMT\0", "ardupilot"),
        (b"\0" + b"ULog\x01\x12\x35\x01", "px4"),
        (b"\xbc\x02\x00\x01\x00\x07\x00fixedFrequency\0", "crazyflie"),
        (b"\xbc\xff\xff\xff\xff\x07\x00\x01", None),
        ((1_700_000_000_000_000).to_bytes(8, "big") + b"\xfd" + bytes(40), "mavlink"),
    ],
)
def test_a_format_is_recognised_by_more_than_its_first_byte(tmp_path: Path, start: bytes, name: str | None) -> None:
    (tmp_path / "log.dat").write_bytes(start + bytes(60))
    if name is None:
        refused("not a log that rotorid knows", importer_of, tmp_path / "log.dat")
    else:
        assert importer_of(tmp_path / "log.dat").name == name


@pytest.mark.slow
@pytest.mark.parametrize(
    "log",
    ["px4-flight-review/motor_failure.ulg", "logs/ardupilot/copter-3.4_22.BIN", "logs/betaflight/shortLog.BFL"],
)
def test_stray_bytes_before_the_first_header_cost_nothing(tmp_path: Path, log: str) -> None:
    whole = public(log)
    damaged = tmp_path / whole.name
    damaged.write_bytes(b"\0\xff\x17" + whole.read_bytes())
    plain, found = read_log(whole), read_log(damaged)
    assert list(found.runs) == list(plain.runs)
    for name, table in plain.runs.items():
        pd.testing.assert_frame_equal(found.runs[name], table)
    if found.format == "px4":
        assert any("3 bytes stand in front of the header" in fault.sentence for fault in found.faults)


def test_a_folder_is_a_bag_only_with_its_metadata(tmp_path: Path) -> None:
    refused("expected a log, found a folder", importer_of, tmp_path)


def test_a_betaflight_log_becomes_a_set_with_betaflights_order_of_rotors(tmp_path: Path) -> None:
    from rotorid.recordings import read_set

    path = tmp_path / "LOG00001.BFL"
    path.write_bytes(blackbox(flown()))
    answer("import", path, "-o", tmp_path / "set", "--mass-kg", "0.7")
    vehicle = read_set(tmp_path / "set").vehicle
    expected = quad_x("betaflight", abs(vehicle.rotors[0].x_m), abs(vehicle.rotors[0].y_m))
    assert vehicle.rotors == expected and ORDERS["betaflight"][0] == ("rear right", "cw")


@pytest.mark.parametrize(("clock", "factor"), [("Timestamp", 1e3), ("time_us", 1e6), ("t", 1.0)])
@pytest.mark.parametrize("sign", [",", ";"])
def test_a_table_with_the_names_of_the_crazyflies_firmware(
    clock: str, factor: float, sign: str, tmp_path: Path
) -> None:
    """As its client writes it: angles of the old body frame, deg/s, multiples of g, 16 bits; a row late."""
    path, truth = tmp_path / "flight.csv", flown()
    turn = Rotation.from_quat(truth[list(c.QUATERNION)].to_numpy()[:, [1, 2, 3, 0]])
    yaw, pitch, roll = turn.as_euler("ZYX", degrees=True).T
    table = {clock: truth[c.TIME] * factor, "stateEstimate.roll": roll, "stateEstimate.pitch": pitch}
    table |= {"stateEstimate.yaw": -yaw, "mode": "hover"}
    for group, values in (
        ("gyro.{}", np.degrees(truth[list(c.ANGULAR_VELOCITY)].to_numpy()) @ FLU),
        ("acc.{}", truth[list(c.SPECIFIC_FORCE)].to_numpy() / 9.81 @ FLU),
        ("stateEstimate.v{}", truth[list(c.VELOCITY)].to_numpy() @ FLU),
    ):
        table |= {group.format(a): column for a, column in zip("xyz", values.T, strict=True)}
    table |= {f"motor.m{i + 1}": truth[name] * 65536 for i, name in enumerate(THROTTLES)}
    table = pd.DataFrame(table)
    table = pd.concat([table[:600], table[601:602], table[600:601], table[602:]])
    table.to_csv(path, index=False, sep=sign)
    found = read_log(path)
    (run,) = found.runs.values()
    assert (found.format, [f.kind for f in found.faults if f.kind == "order"]) == ("crazyflie", ["order"])
    check_against(run, truth, (*BODY, *c.QUATERNION, *c.VELOCITY, *THROTTLES), 1e-6)
    table.drop(columns=clock).to_csv(path, index=False)
    refused("the clock: no column is named as a time", read_log, path)


def test_a_set_in_memory_is_the_one_that_its_files_give(tmp_path: Path) -> None:
    path = tmp_path / "LOG00001.BFL"
    path.write_bytes(blackbox(flown()))
    made = set_of_logs([path], "own", mass_kg=0.6)
    made.write(tmp_path / "own")
    one, other = made.recordings(), read_set(tmp_path / "own")
    assert (one.name, one.vehicle, one.proposed, one.left_out) == (
        other.name, other.vehicle, other.proposed, other.left_out
    )  # fmt: skip
    assert [run.name for run in one.runs] == [run.name for run in other.runs]
    for mine, theirs in zip(one.runs, other.runs, strict=True):
        pd.testing.assert_frame_equal(mine.table, theirs.table)
