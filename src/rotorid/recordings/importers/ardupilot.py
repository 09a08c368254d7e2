"""ArduPilot DataFlash logs (`.bin`) through pymavlink.

ArduPilot's frames are the contract's: body forward-right-down, world north-east-down. Read are `IMU` (or `ACC` and
`GYR`), `XKQ`/`NKQ` or `ATT` for the attitude, `XKF1`/`NKF1` for velocity and position, `RCOU` with the motors' channels
by `SERVOn_FUNCTION` and their range by `MOT_PWM_MIN` and `MOT_PWM_MAX` (the throttle channel's where these are 0),
`ESC` for rotor speeds, `BAT` (`CURR` where it is absent), and a range finder that looks down. Attitude, velocity and
position are the estimator's. Older firmware (3.3-dev) counts time in `TimeMS` and numbers outputs as `Ch1`. Its events
have no clock and take the time of the message before them. Its estimate `EKF1` is read where `AHRS_EKF_USE` is 1.

The land detector calls idle, spool-up and the wait after landing flight: what is on the ground by the detector of all
importers (`in_the_air.airborne`) is left out.

Sources: ArduPilot, Onboard Message Log Messages; Motor order diagrams; parameters `SERVOn_FUNCTION`, `FRAME_TYPE`,
`MOT_PWM_MIN`; `AP_MotorsMulticopter::get_pwm_output_min` for limits of 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.io.text.wording import printable
from rotorid.recordings import columns as c
from rotorid.recordings.importers import in_the_air
from rotorid.recordings.importers.clean import report_gaps
from rotorid.recordings.importers.frames import continuous, quaternion_from_euler_frd
from rotorid.recordings.importers.optional import needs
from rotorid.recordings.importers.report import Fault

KINDS = (
    "IMU", "ACC", "GYR", "XKQ", "NKQ", "ATT", "XKF1", "NKF1", "EKF1", "RCOU", "ESC", "BAT", "CURR", "BARO", "RFND",
    "EV", "PARM", "MSG",
)  # fmt: skip
MOTORS = {33 + i: i for i in range(8)} | {82 + i: 8 + i for i in range(4)}
"""`SERVOn_FUNCTION` to the number of the motor, from 0."""
ORDER_OF_FRAME = {1: "ardupilot", 12: "betaflight"}
"""`FRAME_TYPE` of a quadrotor to the key of `known.ORDERS`: X, and X with Betaflight's order."""
LANDED, FLYING = 18, 28
"""Events LAND_COMPLETE and NOT_LANDED."""
GOOD, DOWN = 4, 25
"""Status of a range finder that reads, and the orientation of one that looks down."""
PULSE_US = (1000.0, 2000.0)
RPM = 2 * np.pi / 60
CLOCKS = {"TimeUS": 1e-6, "TimeMS": 1e-3}
"""Fields of a message's clock, to the seconds that they count in."""

Log = Mapping[str, pd.DataFrame]


def read_messages(path: Path) -> dict[str, pd.DataFrame]:
    """Tables of the messages that are needed by kind, with `time_s`; InputError where the file is no DataFlash log."""
    reader = needs("pymavlink.DFReader", "ardupilot", path)
    rows: dict[str, list[dict]] = {}
    latest_s = 0.0
    try:
        log = reader.DFReader_binary(str(path), zero_time_base=True)
        while (message := log.recv_match(type=list(KINDS))) is not None:
            kind, row = message.get_type(), message.to_dict()
            stamp = next((row[name] * unit for name, unit in CLOCKS.items() if name in row), None)
            if stamp is not None or kind == "EV":
                latest_s = row[c.TIME] = latest_s if stamp is None else float(stamp)
            rows.setdefault(kind, []).append(row)
    except MemoryError:
        raise
    except Exception as error:  # pymavlink lets whatever a broken file raises through
        raise InputError(f"{path}: not a DataFlash log that can be read ({printable(error)[:150]})") from None
    if not rows:
        raise InputError(f"{path}: a DataFlash log with no message that is needed (IMU, ATT, RCOU)")
    tables = {}
    for kind, found in rows.items():
        table = pd.DataFrame(found)
        if c.TIME not in table and kind not in ("PARM", "MSG"):
            continue  # damaged: a message without its clock has no place
        if kind == "RCOU":
            table = table.rename(columns={f"Ch{n}": f"C{n}" for n in range(1, 17)})
        tables[kind] = table
    return tables


def parameters(log: Log) -> dict[str, float]:
    """The vehicle's parameters as the log states them last."""
    table = log.get("PARM")
    if table is None or not {"Name", "Value"} <= set(table):
        return {}
    stated = zip(table["Name"], table["Value"], strict=True)
    return {name: float(value) for name, value in stated if isinstance(value, int | float) and np.isfinite(value)}


def order_of(values: Mapping[str, float]) -> tuple[str, list[Fault]]:
    """Key of the rotors' order by frame class and type, empty where it is not known."""
    kind, form = int(values.get("FRAME_CLASS", 1)), int(values.get("FRAME_TYPE", values.get("FRAME", 1)))
    if kind == 1 and form in ORDER_OF_FRAME:
        return ORDER_OF_FRAME[form], []
    found = f"FRAME_CLASS {kind}, FRAME_TYPE {form}: the order of its rotors is not known here"
    return "", [Fault("order", "vehicle.yaml", found, "taken from the template: check it", 0)]


def _of_first(table: pd.DataFrame | None, key: str = "I") -> pd.DataFrame | None:
    """The rows of the first instance of a sensor or estimator."""
    if table is None:
        return None
    for name in (key, "I", "C", "Inst", "Instance"):
        if name in table:
            return table[table[name] == table[name].min()]
    return table


def convert(log: Log, where: object) -> tuple[pd.DataFrame, list[Fault], np.ndarray]:
    """Contract columns of a whole log, its faults, and where it flies (mask of rows)."""
    imu = _of_first(log.get("IMU"))
    accelerometer, gyroscope = (imu, imu) if imu is not None else (_of_first(log.get("ACC")), _of_first(log.get("GYR")))
    clock = next(
        (t for t in (gyroscope, accelerometer, _of_first(log.get("ATT"))) if t is not None and len(t) > 1), None
    )
    if clock is None:
        raise InputError(f"{where}: no message IMU, GYR or ATT to take the clock from")
    faults: list[Fault] = []
    grid = clock[c.TIME].to_numpy(float)
    keep = in_the_air.increasing(grid)
    if not keep.all():
        found = f"{int((~keep).sum())} messages do not move the clock on"
        faults.append(Fault("repeated_time", c.TIME, found, "left out", int((~keep).sum())))
    grid = grid[keep]
    parts: list[tuple] = []

    def put(names, table: pd.DataFrame | None, fields) -> bool:
        if table is None or not set(fields) <= set(table) or not len(table):
            return False
        parts.append((tuple(names), table[c.TIME].to_numpy(float), table[list(fields)].to_numpy(float)))
        return True

    put(c.ANGULAR_VELOCITY, gyroscope, ("GyrX", "GyrY", "GyrZ"))
    put(c.SPECIFIC_FORCE, accelerometer, ("AccX", "AccY", "AccZ"))
    quaternion = next((t for k in ("XKQ", "NKQ") if (t := _of_first(log.get(k), "C")) is not None), None)
    attitude = _of_first(log.get("ATT"))
    if quaternion is not None and {"Q1", "Q2", "Q3", "Q4"} <= set(quaternion):
        turns = continuous(quaternion[["Q1", "Q2", "Q3", "Q4"]].to_numpy(float))
        parts.append((c.QUATERNION, quaternion[c.TIME].to_numpy(float), turns))
    elif attitude is not None and {"Roll", "Pitch", "Yaw"} <= set(attitude):
        angles = np.radians(attitude[["Roll", "Pitch", "Yaw"]].to_numpy(float))
        parts.append((c.QUATERNION, attitude[c.TIME].to_numpy(float), quaternion_from_euler_frd(*angles.T)))
    estimate = next((t for k in ("XKF1", "NKF1") if (t := _of_first(log.get(k), "C")) is not None), None)
    if estimate is None and (estimate := log.get("EKF1")) is not None and parameters(log).get("AHRS_EKF_USE") != 1:
        found = "EKF1 did not fly the vehicle (AHRS_EKF_USE is not 1)"
        faults.append(Fault("estimate", "velocity, position", found, "columns left out", len(estimate)))
        estimate = None
    put(c.VELOCITY, estimate, ("VN", "VE", "VD"))
    put(c.POSITION, estimate, ("PN", "PE", "PD"))
    parts += _battery(log, faults)
    below = log.get("RFND")
    if below is not None and {"Dist", "Stat", "Orient"} <= set(below):
        put((c.HEIGHT,), below[(below["Stat"] == GOOD) & (below["Orient"] == DOWN)], ("Dist",))
    throttles, channels, more = _throttles(log, parameters(log))
    faults += more
    if throttles is not None:
        parts.append((c.rotor_columns("throttle", len(channels)), *throttles))
        parts += _speeds(log.get("ESC"), channels, grid, faults)
    table = in_the_air.table_on(grid, parts)
    flying, ground = in_the_air.airborne(table, _flying(log, grid))
    return table, [*faults, *ground, *report_gaps(table)], flying


def _throttles(log: Log, values: Mapping[str, float]):
    """Times and throttles (n, k), the motors' channels (from 1), and faults."""
    outputs = _of_first(log.get("RCOU"))
    if outputs is None:
        return None, (), [Fault("no_command", "", "RCOU is not logged", "no throttle columns", 0)]
    by_motor = {}
    for number in range(1, 17):
        motor = MOTORS.get(int(values.get(f"SERVO{number}_FUNCTION", -1)))
        if motor is not None and f"C{number}" in outputs:
            by_motor.setdefault(motor, number)
    faults = []
    if not by_motor:
        by_motor = {i: i + 1 for i in range(4) if f"C{i + 1}" in outputs}
        found = "no SERVOn_FUNCTION is a motor"
        faults.append(Fault("order", "throttle", found, "channels 1 to 4 taken for motors 1 to 4", 0))
    channels = tuple(by_motor[m] for m in sorted(by_motor))
    low, high, more = _limits(values, len(outputs))
    faults += more
    pulses = outputs[[f"C{n}" for n in channels]].to_numpy(float)
    throttle = np.where(pulses > 0, np.clip((pulses - low) / (high - low), 0, 1), np.nan)
    return (outputs[c.TIME].to_numpy(float), throttle), channels, faults


def _limits(values: Mapping[str, float], pulses: int) -> tuple[float, float, list[Fault]]:
    """Pulses (µs) of no and of full throttle, and a fault where the motors' own limits do not state them."""

    def stated(low: str, high: str) -> bool:
        return 0 < values.get(low, 0.0) < values.get(high, 0.0)

    if stated("MOT_PWM_MIN", "MOT_PWM_MAX"):
        return values["MOT_PWM_MIN"], values["MOT_PWM_MAX"], []
    channel = int(values.get("RCMAP_THROTTLE", 3))
    names = f"RC{channel}_MIN", f"RC{channel}_MAX"
    found = "MOT_PWM_MIN and MOT_PWM_MAX are 0 or not stated"
    if stated(*names):
        low, high = (values[name] for name in names)
        action = f"{' and '.join(names)} of the throttle channel hold, {low:g} and {high:g} µs"
    else:
        low, high = PULSE_US
        action = f"taken as {low:g} and {high:g} µs"
    return low, high, [Fault("unit", "throttle", found, action, pulses)]


def _battery(log: Log, faults: list[Fault]) -> list[tuple]:
    """Voltage (V) and current (A) of `BAT`, of `CURR` where there is none; what is 0 throughout is not measured.

    `CURR` counts in hundredths where its format holds whole numbers (Copter 3.3 and before).
    """
    kind = "BAT" if log.get("BAT") is not None else "CURR"
    table, parts = _of_first(log.get(kind)), []
    for column, name in ((c.BATTERY_VOLTAGE, "Volt"), (c.BATTERY_CURRENT, "Curr")):
        if table is None or name not in table:
            continue
        values = table[[name]].to_numpy()
        if values.dtype.kind not in "iuf":
            continue  # damaged: no numbers
        values = values.astype(float) * (0.01 if kind == "CURR" and values.dtype.kind in "iu" else 1.0)
        if (values == 0).all():
            faults.append(Fault("stuck", column, f"{kind}.{name} is 0 throughout", "column left out", len(values)))
            continue
        parts.append(((column,), table[c.TIME].to_numpy(float), values))
    return parts


def _speeds(esc: pd.DataFrame | None, channels: tuple[int, ...], grid: np.ndarray, faults: list[Fault]) -> list[tuple]:
    """Rotor speeds of `ESC` messages, whose instance is the output's number from 0."""
    if esc is None or not {"Instance", "RPM"} <= set(esc):
        return []
    found = []
    for rotor, channel in enumerate(channels, 1):
        own = esc[esc["Instance"] == channel - 1]
        if not len(own) or not own["RPM"].max() > 0:
            seen = f"ESC holds no speed of output {channel}"
            faults.append(Fault("speed_missing", f"rotor_speed_{rotor}_rad_s", seen, "column left out", 0))
            continue
        found.append(((f"rotor_speed_{rotor}_rad_s",), own[c.TIME].to_numpy(float), own[["RPM"]].to_numpy(float) * RPM))
    return found


def _flying(log: Log, grid: np.ndarray) -> np.ndarray | None:
    """Rows in the air by the land detector's events; None where there are none."""
    events = log.get("EV")
    if events is not None and "Id" in events:
        events = events[events["Id"].isin((LANDED, FLYING))]
        if (events["Id"] == FLYING).any():
            times, ups = events[c.TIME].to_numpy(float), (events["Id"] == FLYING).to_numpy()
            index = np.searchsorted(times, grid, side="right") - 1
            return np.where(index >= 0, ups[np.maximum(index, 0)], False)
    return None


def read_ardupilot(path: Path) -> tuple[dict[str, pd.DataFrame], list[Fault], str]:
    """Every flight of a DataFlash log by name, what was found, and the key of the rotors' order."""
    log = read_messages(path)
    table, faults, flying = convert(log, path)
    order, more = order_of(parameters(log))
    runs, cuts = in_the_air.flights(table, flying, path.name.split(".")[0], path)
    return runs, [*faults, *more, *cuts], order
