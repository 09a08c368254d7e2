"""ArduPilot logs of older firmware: tables made here, and two public logs compared with a plain reading of their
messages."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rotorid.recordings import columns as c
from rotorid.recordings.importers import ardupilot
from rotorid.recordings.importers.faults import airborne
from tests import public_logs
from tests.refusals import refused
from tests.unit.recordings.importers.test_log_formats import PARAMETERS, dataflash, flown

THROTTLES = list(c.rotor_columns("throttle", 4))
LIMITS = {"MOT_PWM_MIN": 0.0, "MOT_PWM_MAX": 0.0, "RC3_MIN": 1070.0, "RC3_MAX": 1989.0}


def tables(values: dict[str, float], **more: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Messages of two seconds at 50 Hz, pulses of 1070 to 1989 µs, by kind."""
    time_s = np.arange(100) / 50
    still = {name: np.zeros(100) for name in ("GyrX", "GyrY", "GyrZ", "AccX", "AccY")}
    pulses = {f"C{n}": np.linspace(1070, 1989, 100).round() for n in range(1, 5)}
    log = {
        "IMU": pd.DataFrame({c.TIME: time_s, **still, "AccZ": -9.81}),
        "RCOU": pd.DataFrame({c.TIME: time_s, **pulses}),
        "PARM": pd.DataFrame({"Name": list(values), "Value": list(values.values())}),
    }
    return log | {kind: table.assign(**{c.TIME: time_s}) for kind, table in more.items()}


def public(name: str) -> Path:
    return public_logs.public(Path("logs") / "ardupilot" / name)


@pytest.mark.parametrize(
    ("values", "channel"),
    [
        (LIMITS, "RC3"),
        ({"RC3_MIN": 1070.0, "RC3_MAX": 1989.0}, "RC3"),
        (LIMITS | {"RC3_MIN": 900.0, "RCMAP_THROTTLE": 2.0, "RC2_MIN": 1070.0, "RC2_MAX": 1989.0}, "RC2"),
    ],
)
def test_limits_of_zero_are_those_of_the_throttle_channel(values: dict[str, float], channel: str) -> None:
    table, faults, _ = ardupilot.convert(tables(values), "log")
    assert table[THROTTLES].iloc[[0, -1]].to_numpy() == pytest.approx(np.repeat([[0.0], [1.0]], 4, axis=1))
    (said,) = [f.sentence for f in faults if f.kind == "unit"]
    assert f"{channel}_MIN and {channel}_MAX" in said and "1070 and 1989 µs" in said


def test_limits_that_are_stated_nowhere_are_said_to_be_taken() -> None:
    _, faults, _ = ardupilot.convert(tables({"MOT_PWM_MIN": 0.0, "MOT_PWM_MAX": 0.0}), "log")
    assert any(f.kind == "unit" and "1000 and 2000 µs" in f.action for f in faults)


@pytest.mark.parametrize(
    ("volts", "amperes"), [(np.linspace(16.8, 15, 100), np.full(100, 12.5)), (np.arange(1680, 1580, -1), [1250] * 100)]
)
def test_curr_is_the_battery_where_there_is_no_bat(volts, amperes) -> None:
    """Firmware up to 3.3 writes whole hundredths, later firmware volts and amperes."""
    current = pd.DataFrame({"Volt": volts, "Curr": amperes})
    table, _, _ = ardupilot.convert(tables(LIMITS, CURR=current), "log")
    scale = 0.01 if np.asarray(volts).dtype.kind == "i" else 1.0
    assert table[c.BATTERY_VOLTAGE].to_numpy() == pytest.approx(np.asarray(volts) * scale)
    assert table[c.BATTERY_CURRENT].to_numpy() == pytest.approx(12.5)
    of_bat = pd.DataFrame({"Volt": np.full(100, 11.1), "Curr": np.full(100, 3.0)})
    table, _, _ = ardupilot.convert(tables(LIMITS, CURR=current, BAT=of_bat), "log")
    assert table[c.BATTERY_VOLTAGE].to_numpy() == pytest.approx(11.1)


def test_a_battery_of_zero_throughout_is_not_measured() -> None:
    table, faults, _ = ardupilot.convert(tables(LIMITS, CURR=pd.DataFrame({"Volt": [0] * 100, "Curr": 0})), "log")
    assert not {c.BATTERY_VOLTAGE, c.BATTERY_CURRENT} & set(table)
    assert [f.column for f in faults if f.kind == "stuck"] == [c.BATTERY_VOLTAGE, c.BATTERY_CURRENT]


def plain(path: Path, *kinds: str) -> dict[str, pd.DataFrame]:
    """Rows of a log by pymavlink alone."""
    mavutil = pytest.importorskip("pymavlink.mavutil")

    log, rows = mavutil.mavlink_connection(str(path)), {kind: [] for kind in kinds}
    while (message := log.recv_match(type=list(kinds))) is not None:
        rows[message.get_type()].append(message.to_dict())
    return {kind: pd.DataFrame(found) for kind, found in rows.items()}


def test_copter_3_4_has_the_battery_and_the_limits_of_its_throttle_channel() -> None:
    path = public("copter-3.4_22.BIN")
    table, _, _ = ardupilot.convert(ardupilot.read_messages(path), path)
    own = plain(path, "CURR", "RCOU")
    assert table[c.BATTERY_VOLTAGE].dropna().median() == pytest.approx(own["CURR"]["Volt"].median(), abs=1e-3)
    expected = (own["RCOU"][["C1", "C2", "C3", "C4"]].to_numpy(float) - 1070) / (1989 - 1070)
    found = table[THROTTLES].dropna().to_numpy()
    assert len(found) > 0.99 * len(expected)
    assert found.mean(axis=0) == pytest.approx(expected.mean(axis=0), abs=2e-3)
    assert c.BATTERY_CURRENT not in table


def test_copter_3_3_is_read_by_its_clock_in_milliseconds() -> None:
    path = public("copter-3.3-dev_31.BIN")
    log = ardupilot.read_messages(path)
    own = plain(path, "IMU", "RCOU", "ATT")
    assert len(log["IMU"]) == len(own["IMU"]) == 21322
    assert log["IMU"][c.TIME].to_numpy() == pytest.approx(own["IMU"]["TimeMS"].to_numpy() * 1e-3)
    found = ardupilot.IMPORTER.read(path)
    runs, faults, order = found.runs, found.faults, found.known.autopilot
    assert order == "ardupilot"
    start = own["IMU"]["TimeMS"].iloc[0] * 1e-3
    assert any("EKF1" in f.found and "AHRS_EKF_USE" in f.found for f in faults)
    for run in runs.values():
        assert {*c.ANGULAR_VELOCITY, *c.SPECIFIC_FORCE, *c.QUATERNION, *THROTTLES} <= set(run)
        assert not {*c.VELOCITY, *c.POSITION, c.BATTERY_VOLTAGE} & set(run)
    # the longest run against the same seconds of the plain reading
    cut = next(f for f in faults if f.kind == "cut" and f.run == max(runs, key=lambda name: len(runs[name])))
    first, last = (float(part) for part in cut.action.removesuffix(" s kept").split(" to "))
    imu = own["IMU"][(own["IMU"]["TimeMS"] * 1e-3 - start).between(first - 0.006, last + 0.006)]
    run = runs[cut.run]
    assert abs(len(run) - len(imu)) <= 2
    assert run[list(c.SPECIFIC_FORCE)].mean().to_numpy() == pytest.approx(
        imu[["AccX", "AccY", "AccZ"]].mean().to_numpy(), abs=0.01
    )
    outputs = own["RCOU"][(own["RCOU"]["TimeMS"] * 1e-3 - start).between(first, last)]
    expected = (outputs[["Ch1", "Ch2", "Ch3", "Ch4"]].mean().to_numpy() - 991) / (2016 - 991)
    assert run[THROTTLES].mean().to_numpy() == pytest.approx(expected, abs=2e-3)


@pytest.mark.parametrize(("used", "read"), [(1.0, True), (0.0, False)])
def test_the_first_ekf_is_read_where_it_flew_the_vehicle(used: float, read: bool) -> None:
    estimate = pd.DataFrame({name: np.linspace(0, 1, 100) for name in ("VN", "VE", "VD", "PN", "PE", "PD")})
    table, faults, _ = ardupilot.convert(tables(LIMITS | {"AHRS_EKF_USE": used}, EKF1=estimate), "log")
    assert (set(c.VELOCITY) <= set(table)) == read
    assert any(f.kind == "estimate" for f in faults) != read


@pytest.mark.parametrize(("form", "order"), [(1.0, "ardupilot"), (0.0, "")])
def test_the_order_of_older_firmware_goes_by_frame(form: float, order: str) -> None:
    assert ardupilot.order_of({"FRAME": form})[0] == order


def trusted() -> tuple[dict[str, pd.DataFrame], np.ndarray]:
    """A log whose event calls all but a second flight: idle and spool-up to 12 s, flight to 32 s, idle to 40 s.

    From 20 to 22 s the throttle is shut and the vehicle falls. Returned with the rows in the air, (n,).
    """
    time_s = np.arange(2000) / 50
    throttle = np.interp(time_s, [0, 2, 10, 12, 12.2, 20, 20.1, 22, 22.1, 32, 32.4, 40], [0, 0.2, 0.2, 0.3] + [0.5] * 8)
    falls = (time_s > 20) & (time_s < 22)
    throttle[falls], throttle[time_s > 32.2] = 0.1, 0.15
    rng = np.random.default_rng(1)
    noise = {name: rng.normal(0, 0.1, 2000) for name in ("GyrX", "GyrY", "GyrZ", "AccX", "AccY")}
    pulses = {f"C{n}": 1070 + 919 * throttle for n in range(1, 5)}
    log = tables(LIMITS)
    log["IMU"] = pd.DataFrame({c.TIME: time_s, **noise, "AccZ": np.where(falls, -2.0, -9.81)})
    log["RCOU"] = pd.DataFrame({c.TIME: time_s, **pulses}).iloc[::5]
    log["EV"] = pd.DataFrame({c.TIME: [1.0, 39.5], "Id": [28, 18]})
    return log, (time_s > 12) & (time_s < 32.2)


def test_ground_is_no_flight_although_the_event_says_so() -> None:
    log, air = trusted()
    _, faults, flying = ardupilot.convert(log, "log")
    assert (flying != air).sum() <= 50, "within a second in all"
    assert not flying[:570].any() and flying[610:1600].all() and not flying[1650:].any()
    (said,) = [f for f in faults if f.kind == "on_ground"]
    assert said.samples == pytest.approx(1925 - air.sum(), abs=50)
    assert "of 38 s that the log calls flight" in said.found


def test_without_accelerometer_or_outputs_the_event_holds() -> None:
    for kind in ("RCOU", "IMU"):
        log, _ = trusted()
        if kind == "IMU":
            log["IMU"] = log["IMU"].drop(columns=["AccX", "AccY", "AccZ"])
        else:
            del log[kind]
        _, faults, flying = ardupilot.convert(log, "log")
        assert flying.sum() == 1925
        assert not any(f.kind == "on_ground" for f in faults)


def test_the_public_logs_keep_what_is_in_the_air() -> None:
    """Rows that are kept have the throttle of flight; idle, spool-up and the wait after a crash are gone."""
    kept = {}
    for name in ("copter-3.4_22.BIN", "copter-3.3-dev_31.BIN"):
        found = ardupilot.IMPORTER.read(public(name))
        runs, faults = found.runs, found.faults
        assert any(f.kind == "on_ground" for f in faults)
        for run in runs.values():
            mean = run[THROTTLES].mean(axis=1).dropna()
            assert mean.quantile(0.05) > 0.7 * mean.median()
        kept[name] = [run[c.TIME].iloc[-1] for run in runs.values()]
    # by eye on throttle, specific force and height: 98 to 121, 134 to 191 and 202 to 220 s of the log
    assert kept["copter-3.4_22.BIN"] == pytest.approx([22 - 1.5, 56 - 1.5, 17 - 1.5], abs=2)
    assert sum(kept["copter-3.3-dev_31.BIN"]) == pytest.approx(132 + 64 + 33 + 11 + 83 + 24, abs=15)


@pytest.mark.parametrize(("amplitude", "period_s"), [(0.1, 3.0), (0.4, 2.0), (0.4, 6.0), (0.8, 8.0)])
@pytest.mark.parametrize("exponent", [0.5, 1.0])
def test_a_flight_of_climbs_and_falls_is_kept_whole(amplitude: float, period_s: float, exponent: float) -> None:
    time_s = np.arange(3000) / 50
    thrust = 1 + amplitude * np.sin(2 * np.pi * time_s / period_s)  # over the weight
    throttle = np.tile(0.5 * thrust[:, None] ** exponent, (1, 4))
    force = np.random.default_rng(0).normal(0, 0.3, (3000, 3))
    force[:, 2] -= 9.81 * thrust
    columns = dict(zip((*THROTTLES, *c.SPECIFIC_FORCE), np.hstack([throttle, force]).T, strict=True))
    air, _ = airborne(pd.DataFrame({c.TIME: time_s} | columns))
    inside = (time_s > period_s) & (time_s < time_s[-1] - period_s)  # a low throttle at either end is cut as spool-up
    assert air[inside].all()


def test_damaged_events_and_batteries_are_passed_over() -> None:
    log, _ = trusted()
    log["EV"] = log["EV"].rename(columns={"Id": "I|"})
    log["CURR"] = pd.DataFrame({c.TIME: [1.0, 2.0], "Volt": ["a", "b"], "Curr": ["c", "d"]})
    table, _, flying = ardupilot.convert(log, "log")
    assert c.BATTERY_VOLTAGE not in table
    assert flying[700:900].all()


# Which output is a rotor --------------------------------------------------------------------------

FUNCTIONS = [*range(33, 41), *range(82, 86)]
"""Output functions of motors 1 to 12."""
FOUR = dict(zip(range(1, 5), FUNCTIONS, strict=False))


def framed(values: dict[str, float], outputs: dict[int, int], **more: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """A log whose outputs (from 1) have functions, output n at n hundredths of full throttle."""
    functions = {f"SERVO{n}_FUNCTION": float(function) for n, function in outputs.items()}
    log = tables({"MOT_PWM_MIN": 1000.0, "MOT_PWM_MAX": 2000.0, **values, **functions}, **more)
    pulses = {f"C{n}": np.full(100, 1000.0 + 10 * n) for n in range(1, 15)}
    return log | {"RCOU": pd.DataFrame({c.TIME: log["IMU"][c.TIME], **pulses})}


def throttles_of(log: dict[str, pd.DataFrame]) -> dict[str, float]:
    table, _, _ = ardupilot.convert(log, "log")
    return {name: table[name].iloc[50] for name in table if name.startswith("throttle_")}


@pytest.mark.parametrize(("frame", "motors"), [(1, 4), (2, 6), (3, 8), (4, 8), (5, 6), (12, 12), (14, 10)])
def test_the_frame_class_says_how_many_outputs_are_rotors(frame: int, motors: int) -> None:
    """Outputs in reverse, a servo of a gimbal between them, and a motor function that the frame does not drive."""
    outputs = {14 - i: FUNCTIONS[i] for i in range(motors)} | {1: 6}
    if motors < 12:
        outputs[2] = FUNCTIONS[motors]
    log = framed({"FRAME_CLASS": frame}, outputs)
    assert throttles_of(log) == pytest.approx({f"throttle_{i + 1}": (14 - i) / 100 for i in range(motors)})
    _, faults, _ = ardupilot.convert(log, "log")
    assert any("outputs 2 have the functions of motors beyond" in f.found for f in faults) == (motors < 12)


@pytest.mark.parametrize("frame", [0, 15, 17])
def test_a_frame_of_a_script_has_the_motors_that_its_functions_name(frame: int) -> None:
    log = framed({"FRAME_CLASS": frame}, {n: FUNCTIONS[n - 1] for n in range(1, 6)})
    assert throttles_of(log) == pytest.approx({f"throttle_{n}": n / 100 for n in range(1, 6)})


OTHER_FRAMES = {
    6: "a helicopter, ", 7: "a tricopter", 8: "a singlecopter", 9: "a coaxial copter", 10: "a tailsitter",
    11: "a helicopter of two rotors", 13: "a helicopter of four rotors", 16: "point in several directions",
    99: "not known here",
}  # fmt: skip


@pytest.mark.parametrize(
    ("values", "said", "name"),
    [
        *(({"FRAME_CLASS": kind}, "", f"{name}.*FRAME_CLASS {kind}") for kind, name in OTHER_FRAMES.items()),
        ({"Q_ENABLE": 1, "Q_FRAME_CLASS": 1}, "ArduPlane V4.5.7 (2a3dc4b7)", "quadplane"),
        ({"Q_ENABLE": 0}, "ArduPlane V4.5.7 (2a3dc4b7)", "a plane"),
        ({"FRAME_CLASS": 1}, "ArduRover V4.5.7 (2a3dc4b7)", "a rover"),
        ({"FRAME_CLASS": 1}, "ArduSub V4.5.7 (2a3dc4b7)", "a submarine"),
        ({}, "Blimp V4.5.7", "a blimp"),
        ({"H_SWASH_TYPE": 0}, "", "a helicopter"),
        ({"FRAME": 1}, "Frame: TRI", "a tricopter"),
        ({"FRAME": 1}, "Frame: HELI", "a helicopter"),
    ],
)
def test_what_is_no_multirotor_of_fixed_rotors_is_refused_by_its_name(values, said: str, name: str) -> None:
    log = framed(values, FOUR) | {"MSG": pd.DataFrame({"Message": [said, "Low battery"]})}
    refused(f"{name}.*only multirotors", ardupilot.convert, log, "log")


@pytest.mark.parametrize("build", ardupilot.OTHER_BUILDS)
def test_the_build_of_another_vehicle_is_refused(build: int) -> None:
    log = framed({"FRAME_CLASS": 1}, FOUR)
    refused(f"VER.BU {build}", ardupilot.convert, log | {"VER": pd.DataFrame({"BU": [build]})}, "log")
    assert len(throttles_of(log | {"VER": pd.DataFrame({"BU": [2]})})) == 4


def test_a_motor_without_an_output_leaves_its_own_column_out() -> None:
    log = framed({"FRAME_CLASS": 1}, {1: 33, 2: 34, 4: 36})
    assert throttles_of(log) == pytest.approx({"throttle_1": 0.01, "throttle_2": 0.02, "throttle_4": 0.04})
    assert [f.column for f in ardupilot.convert(log, "log")[1] if f.kind == "no_command"] == ["throttle_3"]


def test_outputs_beyond_the_fourteenth_are_in_messages_of_their_own() -> None:
    log = framed({"FRAME_CLASS": 1}, {1: 33, 2: 34, 15: 35, 19: 36})
    clock = {c.TIME: log["IMU"][c.TIME]}
    more = {"RCO2": pd.DataFrame({**clock, "C15": 1150}), "RCO3": pd.DataFrame({**clock, "C19": 1190})}
    assert throttles_of(log | more)["throttle_4"] == pytest.approx(0.19)
    assert throttles_of(log | more)["throttle_3"] == pytest.approx(0.15)


@pytest.mark.parametrize(("form", "name"), ardupilot.TILTED_TYPES.items())
def test_rotors_that_lean_by_the_frame_type_are_named(form: int, name: str) -> None:
    _, faults = ardupilot.order_of({"FRAME_CLASS": 1, "FRAME_TYPE": form})
    assert any(f.kind == "tilted_rotor" and name in f.found for f in faults)


# Parameters that change ---------------------------------------------------------------------------


def set_later(log: dict[str, pd.DataFrame], changes: list[tuple[float, str, float]]) -> dict[str, pd.DataFrame]:
    """The log with parameters that are stated again at later times."""
    start = log["PARM"].assign(**{c.TIME: 0.0})
    return log | {"PARM": pd.concat([start, pd.DataFrame(changes, columns=[c.TIME, "Name", "Value"])])}


@pytest.mark.parametrize(
    ("change", "before", "after"),
    [
        (("MOT_PWM_MIN", 900.0), 0.5, 0.6 / 1.1),
        (("MOT_PWM_MAX", 3000.0), 0.5, 0.25),
        (("SERVO1_FUNCTION", 0.0), 0.5, 0.9),  # output 5 has the same function
    ],
)
def test_a_pulse_is_read_by_the_parameters_that_held_then(change, before: float, after: float) -> None:
    log = framed({"FRAME_CLASS": 1}, {1: 33, 2: 34, 3: 35, 4: 36, 5: 33})
    log["RCOU"] = log["RCOU"].assign(C1=1500.0, C5=1900.0)
    table, faults, _ = ardupilot.convert(set_later(log, [(1.0, "MOT_PWM_MIN", 1000.0), (1.01, *change)]), "log")
    found = table["throttle_1"].to_numpy()
    assert found[:50] == pytest.approx(before) and found[52:] == pytest.approx(after)
    (said,) = [f.sentence for f in faults if f.kind == "parameter_changed"]
    assert f"{change[0]} was set from" in said and f"to {change[1]:g} at 1.01 s" in said


@pytest.mark.parametrize("name", ["MOT_THST_EXPO", "MOT_SPIN_MIN", "MOT_SPIN_MAX", "FRAME_TYPE"])
def test_a_change_of_what_else_is_compared_is_stated(name: str) -> None:
    log = framed({"FRAME_CLASS": 1, name: 1.0}, FOUR)
    _, faults, _ = ardupilot.convert(set_later(log, [(1.0, name, 0.0), (1.0, "ATC_RAT_RLL_P", 0.2)]), "log")
    assert [f.found.split()[0] for f in faults if f.kind == "parameter_changed"] == [name]


def test_the_frame_is_the_one_that_flew() -> None:
    """Set up on the bench: a hexarotor for 0.2 s of two."""
    log = framed({"FRAME_CLASS": 2}, {n: 32 + n for n in range(1, 7)})
    assert len(throttles_of(set_later(log, [(0.2, "FRAME_CLASS", 1.0)]))) == 4
    assert len(throttles_of(set_later(log, [(1.8, "FRAME_CLASS", 1.0)]))) == 6


def test_a_log_cut_off_anywhere_keeps_every_whole_message(tmp_path: Path) -> None:
    data, path = dataflash(flown().iloc[:40], PARAMETERS), tmp_path / "log.bin"
    whole = sum(map(len, (plain := ardupilot.read_messages(written(path, data))).values()))
    assert ardupilot.END not in plain
    # the last message of each row is BAT, before it are four of ESC
    for lost in range(1, 4 * 16 + 20):
        log = ardupilot.read_messages(written(path, data[: len(data) - lost]))
        messages = 1 + max(0, lost - 20) // 16 + (lost > 20 and (lost - 20) % 16 > 0)
        left = (20 - lost) if lost <= 20 else -(lost - 20) % 16
        assert sum(len(t) for kind, t in log.items() if kind != ardupilot.END) == whole - messages, lost
        _, faults, _ = ardupilot.convert(log, path)
        assert any(f.kind == "cut_off" for f in faults) == (left > 1), lost


def written(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


# Which sensor, and which core of the estimator ---------------------------------------------------


@pytest.mark.parametrize(("kind", "letters"), [("IMU", "GyrAcc"), ("GYR", "Gyr"), ("ACC", "Acc")])
@pytest.mark.parametrize(
    ("first", "taken"), [("goes on", 0.0), ("comes at half the rate", 0.0), ("stands still", 1.0), ("ends", 1.0)]
)
def test_of_several_sensors_the_first_that_goes_on_is_read(kind: str, letters: str, first: str, taken: float) -> None:
    """The second sensor reads 1 more than the first."""
    time_s = np.arange(100) / 50
    names = [f"{letters[k : k + 3]}{axis}" for k in range(0, len(letters), 3) for axis in "XYZ"]
    reading = np.sin(time_s)
    own = np.where(time_s < 1, reading, reading[50]) if first == "stands still" else reading
    sensors = [
        pd.DataFrame({c.TIME: time_s, "TimeUS": time_s * 1e6, "I": i, **dict.fromkeys(names, values + i)})
        for i, values in enumerate((own, reading))
    ]
    if first == "ends":
        sensors[0] = sensors[0][:50]
    if first == "comes at half the rate":
        reading, sensors[0] = reading[::2], sensors[0][::2]
    log = tables(LIMITS) | {kind: pd.concat(sensors).sort_values([c.TIME, "I"], ignore_index=True)}
    if kind != "IMU":
        del log["IMU"]
    table, faults, _ = ardupilot.convert(log, "log")
    column = c.SPECIFIC_FORCE[1] if kind == "ACC" else c.ANGULAR_VELOCITY[1]
    assert table[column].to_numpy() == pytest.approx(reading + taken)
    assert any(f"{kind} 0 stands still or ends early" in f.found for f in faults) == bool(taken)


@pytest.mark.parametrize("estimator", ["XK", "NK"])
@pytest.mark.parametrize("both", [False, True])
@pytest.mark.parametrize(("switch_s", "back_s"), [(None, 9), (0.5, 9), (1.5, 9), (0.5, 1.5)])
def test_the_estimate_is_that_of_the_core_that_flew(estimator: str, both: bool, switch_s, back_s: float) -> None:
    """Core 1 states a velocity of 1, core 0 of 0, another estimator that did not fly of 9 m/s. A core that took over
    and was not left is read throughout."""
    time_s = np.repeat(np.arange(100) / 50, 2)
    core = np.tile([0, 1], 100)
    primary = np.zeros(200) if switch_s is None else ((time_s >= switch_s) & (time_s < back_s)).astype(float)
    names = ("VN", "VE", "VD", "PN", "PE", "PD")
    estimate = pd.DataFrame({c.TIME: time_s, "C": core, **dict.fromkeys(names, core)})
    log = tables(LIMITS | {"AHRS_EKF_TYPE": 2.0 if estimator == "NK" else 3.0})
    if both:
        log |= {f"{other}F1": estimate.assign(VN=9) for other in ("XK", "NK")}
    log |= {f"{estimator}F1": estimate, f"{estimator}F4": pd.DataFrame({c.TIME: time_s, "C": core, "PI": primary})}
    table, _, _ = ardupilot.convert(log, "log")
    assert table[c.VELOCITY[0]].to_numpy() == pytest.approx(primary[::2] if back_s < 2 else np.full(100, primary[-1]))


def test_the_imu_is_that_of_the_core_that_flew() -> None:
    time_s = np.repeat(np.arange(100) / 50, 2)
    names = [f"{kind}{axis}" for kind in ("Gyr", "Acc") for axis in "XYZ"]
    reading = np.sin(time_s) + np.tile([0, 1], 100)
    log = tables(LIMITS | {"EK3_IMU_MASK": 3.0})
    log["IMU"] = pd.DataFrame({c.TIME: time_s, "I": np.tile([0, 1], 100), **dict.fromkeys(names, reading)})
    log["XKF4"] = pd.DataFrame({c.TIME: time_s, "C": 0, "PI": 1})
    table, faults, _ = ardupilot.convert(log, "log")
    assert table[c.ANGULAR_VELOCITY[0]].to_numpy() == pytest.approx(reading[1::2])
    assert [f.action for f in faults if f.column == "inertial sensor"] == ["IMU 1 taken"]


RESETS = {
    "another core of the estimator took over": {"XKF4": {"C": 0, "PI": lambda t: ((t >= 8) & (t < 9)) * 1}},
    "the estimator set the heading anew": {"EV": {"Id": lambda t: np.where(np.abs(t - 8) < 0.01, 62, 0)}},
    "the estimator set the height anew": {"EV": {"Id": lambda t: np.where(np.abs(t - 8) < 0.01, 60, 0)}},
    "the estimator set the position anew": {"NKF4": {"C": 0, "OFN": lambda t: (t >= 8) * 0.5, "OFE": 0.0}},
    "the heading was aligned anew": {
        "MSG": {"Message": lambda t: np.where(np.abs(t - 8) < 0.01, "EKF3 IMU0 in-flight yaw alignment complete", "")}
    },
}


@pytest.mark.parametrize("what", RESETS)
def test_a_run_ends_where_an_estimate_is_set_anew(tmp_path: Path, monkeypatch, what: str) -> None:
    time_s = np.arange(1000) / 50
    more = {kind: pd.DataFrame({c.TIME: time_s} | {n: v(time_s) if callable(v) else v for n, v in fields.items()})
            for kind, fields in RESETS[what].items()}  # fmt: skip
    log, table = tables(LIMITS) | more, pd.DataFrame({c.TIME: time_s})
    monkeypatch.setattr(ardupilot, "read_messages", lambda path: log)
    monkeypatch.setattr(ardupilot, "_stated_parameters", lambda path: {})
    monkeypatch.setattr(ardupilot, "convert", lambda log, path: (table, [], np.ones(1000, bool)))
    found = ardupilot.IMPORTER.read(tmp_path / "log.bin")
    runs, faults = found.runs, found.faults
    assert [run[c.TIME].iloc[-1] for run in runs.values()] == pytest.approx([7.28, 9.8], abs=1.2)
    assert any(f"{what}" in f.found and "first at 8.00 s" in f.found for f in faults)


# How an output becomes a pulse --------------------------------------------------------------------

OWN = {"SERVO1_MIN": 1100.0, "SERVO1_TRIM": 1400.0, "SERVO1_MAX": 1900.0}


@pytest.mark.parametrize(
    ("values", "pulses", "shares"),
    [
        (OWN | {"MOT_PWM_TYPE": 8.0}, (1100, 1500, 1900), (0, 0.5, 1)),
        (OWN | {"MOT_PWM_TYPE": 8.0, "SERVO1_REVERSED": 1.0}, (1100, 1300, 1900), (1, 0.75, 0)),
        (OWN | {"MOT_PWM_TYPE": 9.0}, (1100, 1400, 1650), (0, 0.5, 0.75)),
        (OWN | {"MOT_PWM_TYPE": 0.0, "SERVO1_REVERSED": 1.0}, (1000, 1500, 2000), (0, 0.5, 1)),
        ({"MOT_PWM_TYPE": 2.0}, (125, 200, 250), (0, 0.6, 1)),
        ({"MOT_PWM_TYPE": 6.0}, (900, 1500, 2000), (0, 0.5, 1)),
        ({}, (0, 1500, 2000), (0, 0.5, 1)),
    ],
)
def test_a_pulse_is_a_share_by_the_type_of_the_outputs(values, pulses, shares) -> None:
    log = tables({"MOT_PWM_MIN": 1000.0, "MOT_PWM_MAX": 2000.0, "SERVO1_FUNCTION": 33.0, "FRAME_CLASS": 15.0} | values)
    log["RCOU"] = log["RCOU"].assign(C1=np.array(pulses, float)[np.arange(100) % 3])
    table, faults, _ = ardupilot.convert(log, "log")
    assert table["throttle_1"].iloc[:3].to_numpy() == pytest.approx(shares)
    assert any(f.kind == "range" for f in faults) == (min(pulses) == 900)


def test_several_outputs_of_one_motor_and_several_batteries_are_named() -> None:
    time_s = np.arange(100) / 50
    own = [pd.DataFrame({c.TIME: time_s, "Inst": k, "Volt": volts, "Curr": 1.0 + time_s})
           for k, volts in enumerate((0.0, 16.0, 12.0))]  # fmt: skip
    log = tables(LIMITS | {"SERVO1_FUNCTION": 33.0, "SERVO2_FUNCTION": 33.0, "FRAME_CLASS": 15.0})
    table, faults, _ = ardupilot.convert(log | {"BAT": pd.concat(own, ignore_index=True)}, "log")
    assert table[c.BATTERY_VOLTAGE].iloc[0] == 16 and table["battery_2_voltage_v"].iloc[0] == 12
    assert any(f.found == "outputs 1 and 2 are both motor 1" for f in faults)


def test_no_voltage_and_a_second_range_finder_are_not_read() -> None:
    time_s = np.arange(100) / 50
    log = tables(LIMITS) | {"BAT": pd.DataFrame({c.TIME: time_s, "Inst": 0, "Volt": 16.0 * (np.arange(100) % 5 > 0)})}
    below = [pd.DataFrame({c.TIME: time_s, "Instance": k, "Dist": 2.0 + k, "Stat": 4, "Orient": 25}) for k in (0, 1)]
    table, *_ = ardupilot.convert(log | {"RFND": pd.concat(below, ignore_index=True)}, "log")
    assert table[c.BATTERY_VOLTAGE].isna().sum() == 20 and set(table[c.BATTERY_VOLTAGE].dropna()) == {16.0}
    assert set(table[c.HEIGHT]) == {2.0}


@pytest.mark.parametrize(("every", "taken"), [(1, "ATT"), (10, "ANG")])
def test_of_several_attitudes_one_that_comes_often_enough_is_read(every: int, taken: str) -> None:
    time_s = np.arange(100) / 50
    angles = {"Pitch": 0.0, "Yaw": 0.0}
    log = tables(LIMITS) | {"ANG": pd.DataFrame({c.TIME: time_s, "Roll": 2.0, **angles})}
    log["ATT"] = pd.DataFrame({c.TIME: time_s, "Roll": 1.0, **angles})[::every]
    table, faults, _ = ardupilot.convert(log, "log")
    assert np.degrees(2 * table["quaternion_x"].iloc[0]) == pytest.approx(1 if taken == "ATT" else 2, abs=1e-3)
    assert any("ATT at" in f.found and "ANG at" in f.found for f in faults) == (taken == "ANG")


# Speeds -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("outputs", "instances", "taken"),
    [
        ((1, 2, 3, 4), (0, 1, 2, 3), (1, 2, 3, 4)),
        ((4, 3, 2, 1), (0, 1, 2, 3), (4, 3, 2, 1)),
        ((9, 10, 11, 12), (0, 1, 2, 3), (1, 2, 3, 4)),
        ((12, 9, 10, 11), (4, 5, 6, 7), (4, 1, 2, 3)),
        ((9, 10, 11, 12), (0, 1, 2), ()),
    ],
)
def test_speeds_are_those_of_the_motors_outputs(outputs, instances, taken) -> None:
    """The k-th controller turns at k rounds a second."""
    log = framed({"FRAME_CLASS": 1}, {n: FUNCTIONS[i] for i, n in enumerate(outputs)})
    own = [pd.DataFrame({c.TIME: log["IMU"][c.TIME], "Instance": i, "RPM": 60.0 * k})
           for k, i in enumerate(instances, 1)]  # fmt: skip
    log["ESC"] = pd.concat(own, ignore_index=True)
    table, faults, _ = ardupilot.convert(log, "log")
    speeds = [table[name].iloc[50] / (2 * np.pi) for name in table if name.startswith("rotor_speed")]
    assert speeds == pytest.approx(list(taken))
    assert any("taken in their order" in f.action for f in faults) == (bool(taken) and outputs[0] > 8)
