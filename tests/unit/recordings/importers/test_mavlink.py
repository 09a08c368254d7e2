"""Telemetry logs, written here by pymavlink, which shares nothing with the reader."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rotorid.recordings import columns as c
from rotorid.recordings.importers.logfile import importer_of, read_log
from tests.refusals import refused
from tests.unit.recordings.importers.test_log_formats import PARAMETERS, SPEEDS, STATE, THROTTLES, check_against, flown

GROUND_US = 1_700_000_000_000_000
ARDUPILOT, PX4, QUADROTOR, PLANE = 3, 12, 2, 1


def telemetry(
    truth: pd.DataFrame, version: str = "v20", autopilot: int = ARDUPILOT, kind: int = QUADROTOR, broken: bool = False
) -> bytes:
    """A log of a ground station that speaks, too; `broken`: stray bytes, and messages of which one byte is another."""
    from scipy.spatial.transform import Rotation

    dialect = pytest.importorskip(f"pymavlink.dialects.{version}.ardupilotmega")
    vehicle, station = dialect.MAVLink(None, srcSystem=1), dialect.MAVLink(None, srcSystem=255)
    out = bytearray()

    def put(at_s: float, message, sender=vehicle) -> None:
        stamp, packed = (GROUND_US + int(1e6 * at_s)).to_bytes(8, "big"), message.pack(sender)
        out.extend(stamp + packed)
        if broken and len(out) % 17 == 0:
            out.extend(stamp + packed[:12] + bytes([packed[12] ^ 1]) + packed[13:])

    def of(name: str, *values):
        return getattr(dialect, f"MAVLink_{name}_message")(*values)

    put(0.0, of("heartbeat", 6, 8, 0, 0, 0, 3), station)
    put(0.0, of("heartbeat", kind, autopilot, 0, 0, 0, 3))
    out.extend(b"\0\xfd\0" * broken)
    for name, value in PARAMETERS.items():
        put(0.1, of("param_value", name.encode(), value, 9, len(PARAMETERS), 0))
    angles = Rotation.from_quat(truth[list(c.QUATERNION)].to_numpy()[:, [1, 2, 3, 0]]).as_euler("ZYX")[:, ::-1]
    for k, row in enumerate(truth.to_dict("records")):
        at_s = 2.0 + row[c.TIME]
        ms, us = round(1000 * at_s), round(1e6 * at_s)
        rates, force = ([row[n] for n in names] for names in (c.ANGULAR_VELOCITY, c.SPECIFIC_FORCE))
        put(at_s, of("attitude", ms, *angles[k], *rates))
        thousandths = [round(v / 9.80665 * 1000) for v in force] + [round(1000 * v) for v in rates]
        put(at_s, of("raw_imu", us, *thousandths, 0, 0, 0))
        put(at_s, of("local_position_ned", ms, *(row[n] for n in (*c.POSITION, *c.VELOCITY))))
        pulses = [round(1100 + 800 * row[n]) for n in THROTTLES]
        put(at_s, of("servo_output_raw", us, 0, 1500, 1500, 1500, 1500, *pulses))
        put(at_s, of("sys_status", 0, 0, 0, 0, round(1000 * row["battery_voltage_v"]), 1200, 50, 0, 0, 0, 0, 0, 0))
        turns, none = [round(row[n] * 30 / np.pi) for n in SPEEDS], [0] * 4
        if version != "v10":  # has no such message
            put(at_s, of("esc_telemetry_5_to_8", none, none, none, none, turns, none))
        put(at_s, of("vfr_hud", 0, 0, 0, 0, 0, 0))
    return bytes(out)


@pytest.mark.parametrize(("version", "broken"), [("v10", False), ("v20", False), ("v20", True)])
def test_telemetry_of_an_ardupilot(tmp_path: Path, version: str, broken: bool) -> None:
    path, truth = tmp_path / "flight.tlog", flown()
    path.write_bytes(telemetry(truth, version, broken=broken))
    found = read_log(path)
    assert (found.format, found.known.autopilot, found.settings["MOT_PWM_MAX"]) == ("mavlink", "ardupilot", 1900)
    (run,) = found.runs.values()
    check_against(run, truth, (*c.ANGULAR_VELOCITY, *STATE, *THROTTLES, c.BATTERY_VOLTAGE), 2e-3)
    check_against(run, truth, (c.ANGULAR_VELOCITY[0], *c.SPECIFIC_FORCE), 2e-3, half_step=0.5e-3 * 9.81)
    if version != "v10":
        check_against(run, truth, (c.ANGULAR_VELOCITY[0], *SPEEDS), 2e-3, half_step=0.5 * np.pi / 30)


def test_another_vehicles_telemetry_is_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "flight.tlog"
    path.write_bytes(telemetry(flown().head(20), autopilot=PX4))
    refused("without the heartbeat of an ArduPilot.*take the autopilot's own log", read_log, path)
    path.write_bytes(telemetry(flown().head(20), kind=PLANE))
    refused("the telemetry is of no multirotor \\(MAV_TYPE 1\\)", read_log, path)
    path.write_bytes(telemetry(flown().head(20))[:400])
    assert importer_of(path).name == "mavlink"
    refused("holds no ATTITUDE", read_log, path)
