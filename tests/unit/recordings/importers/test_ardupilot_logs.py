"""ArduPilot logs of older firmware: tables made here, and two public logs compared with a plain reading of their
messages."""

import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rotorid.recordings import columns as c
from rotorid.recordings.importers import ardupilot
from rotorid.recordings.importers.in_the_air import off_the_ground

ROOT = Path(__file__).parents[4]
_named = os.environ.get("ROTORID_PUBLIC_DATA")
LOGS = ((ROOT / _named).resolve() if _named else ROOT / ".." / "shared" / "data") / "logs" / "ardupilot"
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
    pytest.importorskip("pymavlink")
    if not (LOGS / name).is_file():
        pytest.skip("the public logs are not on this machine")
    return LOGS / name


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
    from pymavlink import mavutil

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
    runs, faults, order = ardupilot.read_ardupilot(path)
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
        runs, faults, _ = ardupilot.read_ardupilot(public(name))
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
    air = off_the_ground(np.ones(3000, bool), throttle, force, time_s)
    inside = (time_s > period_s) & (time_s < time_s[-1] - period_s)  # a low throttle at either end is cut as spool-up
    assert air[inside].all()


def test_damaged_events_and_batteries_are_passed_over() -> None:
    log, _ = trusted()
    log["EV"] = log["EV"].rename(columns={"Id": "I|"})
    log["CURR"] = pd.DataFrame({c.TIME: [1.0, 2.0], "Volt": ["a", "b"], "Curr": ["c", "d"]})
    table, _, flying = ardupilot.convert(log, "log")
    assert c.BATTERY_VOLTAGE not in table
    assert flying[700:900].all()
