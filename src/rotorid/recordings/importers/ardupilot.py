"""ArduPilot DataFlash logs (`.bin`).

ArduPilot's frames are the contract's: body forward-right-down, world north-east-down. Read are `IMU` (or `ACC` and
`GYR`), `XKQ`/`NKQ`, `ATT` or `ANG` for the attitude, `XKF1`/`NKF1` for velocity and position, `RCOU` with the motors'
channels by `SERVOn_FUNCTION` and their range by `MOT_PWM_TYPE`: `MOT_PWM_MIN` and `MOT_PWM_MAX` (the throttle channel's
where these are 0), or each channel's own; `ESC` (`ESC1` to `ESC8` before 4.1) for rotor speeds, `BAT` (`CURR` where it
is absent), and a range finder that looks down. Attitude, velocity and position are those of the estimator's core that
flew the vehicle (`PI` of `XKF4`), or throughout those of the one that took over and was never left; where a core is
left for another, or is set anew, a run ends. Of several inertial sensors that of this core is read, else the first one,
if it goes on changing. Older firmware
(3.3-dev) counts time in `TimeMS` and numbers outputs as `Ch1`. Its events have no clock and take the time of the
message before them. Its estimate `EKF1` is read where `AHRS_EKF_USE` is 1.

The land detector calls idle, spool-up and the wait after landing flight: what is on the ground by the detector of all
importers (`faults.airborne`) is left out.

Outputs are motors only where the frame class says so: helicopters use motor functions for their servos, tricopters one
for the servo of the tail. Those, and whatever is no multirotor of fixed rotors, are refused by name. Parameters may
change within a log; each pulse is read by those that held then.

Sources: ArduPilot, Onboard Message Log Messages; Motor order diagrams; parameters `SERVOn_FUNCTION`, `FRAME_CLASS`,
`FRAME_TYPE`, `MOT_PWM_MIN`, `MOT_PWM_TYPE`; `AP_MotorsMulticopter::get_pwm_output_min` for limits of 0;
`AP_Motors::rc_write`, `SRV_Channel::pwm_from_angle` for channels of their own range; `AP_Motors::motor_frame_class`;
`LogEvent` for the resets of estimators;
`SRV_Channel.h`; `APM_BUILD_*` for the builds of `VER`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.recordings import columns as c
from rotorid.recordings.importers.contract import Imported, Importer
from rotorid.recordings.importers.dataflash import HEAD, read_dataflash
from rotorid.recordings.importers.faults import (
    GOES_ON,
    ImportFault,
    airborne,
    alive_s,
    cut_off,
    flights,
    goes_on,
    held_on,
    jumps_at,
    moving_on,
    one_sense,
    report_gaps,
    stops,
    table_on,
    within,
)
from rotorid.recordings.importers.known import Known, Parameters, Values
from rotorid.recordings.importers.mapping import PULSE_US, RPM, continuous, quaternion_from_euler_frd

_KINDS = (
    "IMU", "ACC", "GYR", "XKQ", "NKQ", "ATT", "XKF1", "NKF1", "ANG", "XKF4", "NKF4", "EKF1", "RCOU", "RCO2", "RCO3",
    "ESC", *(f"ESC{n}" for n in range(1, 9)), "BAT", "CURR", "BARO", "RFND", "EV", "PARM", "MSG", "VER",
)  # fmt: skip
_MOTORS = {33 + i: i for i in range(8)} | {82 + i: 8 + i for i in range(4)} | {160 + i: 12 + i for i in range(20)}
"""`SERVOn_FUNCTION` to the number of the motor, from 0."""
_OUTPUTS = range(1, 33)
_MULTIROTORS = {1: 4, 2: 6, 3: 8, 4: 8, 5: 6, 12: 12, 14: 10}
"""`FRAME_CLASS` of multirotors of fixed rotors to their number of motors."""
_OTHER_CLASSES = {
    6: "a helicopter, whose motor functions are the servos of its swash plate",
    7: "a tricopter, whose tail rotor a servo tilts",
    8: "a singlecopter, steered by vanes",
    9: "a coaxial copter, steered by vanes",
    10: "a tailsitter",
    11: "a helicopter of two rotors, whose motor functions are the servos of its swash plates",
    13: "a helicopter of four rotors, whose motor functions are the servos of their pitch",
    16: "a vehicle whose rotors point in several directions",
}
"""`FRAME_CLASS` of what no vehicle.yaml can describe."""
OTHER_BUILDS = {1: "a rover", 3: "a plane", 4: "an antenna tracker", 7: "a submarine", 12: "a blimp"}
"""Build of the firmware (`VER.BU`) for what is no copter; 2 is Copter, 13 its helicopters."""
_OTHER_FIRMWARE = {
    r"(ArduPlane|APM:Plane)\b": "a plane",
    r"(ArduRover|APM:Rover|Rover)\b": "a rover",
    r"ArduSub\b": "a submarine",
    r"Blimp\b": "a blimp",
    r"AntennaTracker\b": "an antenna tracker",
    r".*\bFrame: HELI": _OTHER_CLASSES[6],
    r".*\bFrame: TRI": _OTHER_CLASSES[7],
    r".*\bFrame: SINGLE": _OTHER_CLASSES[8],
    r".*\bFrame: COAX": _OTHER_CLASSES[9],
}
"""What a message of the start says where neither a parameter nor `VER` does (Copter 3.4 and before)."""
TILTED_TYPES = {4: "V-tail", 5: "A-tail"}
"""`FRAME_TYPE` of quadrotors whose rear rotors lean outwards."""
_CHANGED = (
    (
        r"MOT_PWM_(MIN|MAX|TYPE)|SERVO\d+_(FUNCTION|MIN|MAX|TRIM|REVERSED)|RCMAP_THROTTLE|RC\d+_(MIN|MAX)",
        "throttle",
        "each pulse is read by the value that held then",
    ),
    (
        r"(Q_)?FRAME(_CLASS|_TYPE)?|AHRS_EKF_(USE|TYPE)",
        "vehicle.yaml",
        "the value that held for most of the flight is taken",
    ),
    (r"MOT_(THST_EXPO|SPIN_(MIN|MAX|ARM)|THST_HOVER|BAT_VOLT_(MIN|MAX))", "", "no column depends on it"),
)
"""Parameters on which a value depends, or that `rotorid parameters` states: names, column, what a change means."""
_ORDER_OF_FRAME = {1: "ardupilot", 12: "betaflight"}
"""`FRAME_TYPE` of a quadrotor to the key of `known.ORDERS`: X, and X with Betaflight's order."""
_LANDED, _FLYING = 18, 28
"""Events LAND_COMPLETE and NOT_LANDED."""
END = "END"
"""The key under which stands how many bytes of the last message came."""
_CLOCKS = {"TimeUS": 1e-6, "TimeMS": 1e-3}
"""Fields of a message's clock, to the seconds that they count in."""
_BY_CHANNEL = {8: "PWMRange", 9: "PWMAngle"}
"""`MOT_PWM_TYPE` with which each output has its own range."""
_SHORT, _TIMES_SHORTER, _LONGEST_SHORT_US = (1, 2), 8, 300.0
"""`MOT_PWM_TYPE` of OneShot, by how much OneShot125 is shorter than a usual pulse, and the longest such pulse."""
_RESET_EVENTS = {60: "the estimator set the height anew", 62: "the estimator set the heading anew"}
"""Events EKF_ALT_RESET and EKF_YAW_RESET."""
_REALIGNED = re.compile(r"(?!.*initial).*\byaw\b.*\b(re-?)?align|.*\byaw reset\b", re.IGNORECASE)
_LEAST_RESET_M = 0.02
_LATE_CORE_S = 1.0
"""A core whose estimate begins so much later than that of others is not read throughout."""

Log = Mapping[str, pd.DataFrame]


def read_messages(path: Path) -> dict[str, pd.DataFrame]:
    """Tables of the messages that are needed by kind, with `time_s`, and `END` where the file ends inside a message.

    InputError where the file holds none of them.
    """
    found, came = read_dataflash(path, _KINDS)
    if not found:
        raise InputError(f"{path}: a DataFlash log with no message that is needed (IMU, ATT, RCOU)")
    clocks = {kind: _stamps(messages.columns) for kind, messages in found.items()}
    stamped = [(found[kind].offsets, times) for kind, times in clocks.items() if times is not None]
    offsets, times = (np.concatenate(part) for part in zip(*stamped, strict=True)) if stamped else (np.zeros(0),) * 2
    order = np.argsort(offsets, kind="stable")
    offsets, times = offsets[order], times[order]
    tables: dict[str, pd.DataFrame] = {}
    for kind in sorted(found, key=lambda kind: found[kind].offsets[0]):
        own_s, table = clocks[kind], pd.DataFrame(found[kind].columns)
        if own_s is None and kind in ("EV", "PARM"):  # without a clock: that of the message before
            before = np.searchsorted(offsets, found[kind].offsets) - 1
            own_s = np.where(before >= 0, times[np.maximum(before, 0)], 0.0) if len(times) else np.zeros(len(table))
        if own_s is not None:
            table[c.TIME] = own_s
        elif kind not in ("PARM", "MSG"):
            continue  # damaged: a message without its clock has no place
        if kind == "RCOU":
            table = table.rename(columns={f"Ch{n}": f"C{n}" for n in range(1, 17)})
        if number := re.fullmatch(r"ESC(\d)", kind):  # before 4.1 each controller has a message of its own
            kind, table = "ESC", pd.concat([tables.get("ESC"), table.assign(Instance=int(number[1]) - 1)])
        tables[kind] = table
    if came:
        tables[END] = pd.DataFrame({c.TIME: [times[-1] if len(times) else 0.0], "bytes": [came]})
    return tables


def _stamps(columns: Mapping[str, np.ndarray]) -> np.ndarray | None:
    """Times of messages by their own clock, s; None where they have none."""
    name = next((name for name in _CLOCKS if name in columns and columns[name].dtype.kind in "if"), None)
    return None if name is None else columns[name] * _CLOCKS[name]


def parameters(log: Log) -> Parameters:
    """The vehicle's parameters over the log."""
    table = log.get("PARM")
    if table is None or not {"Name", "Value"} <= set(table):
        return Parameters({})
    times = table[c.TIME] if c.TIME in table else np.zeros(len(table))
    rows = zip(times, table["Name"], table["Value"], strict=True)
    return Parameters.of((t, n, float(v)) for t, n, v in rows if isinstance(v, int | float) and np.isfinite(v))


def _check_frame(log: Log, values: Values, where: object) -> None:
    """InputError that names the vehicle where it is no multirotor of fixed rotors."""
    # Frame classes whose motors are those that the output functions name: none chosen, a matrix of a script.
    scripted = (0, 15, 17)
    kind = int(values.get("FRAME_CLASS", 0))
    builds = log.get("VER", pd.DataFrame()).get("BU", [])
    said = [str(line) for line in log.get("MSG", pd.DataFrame()).get("Message", [])]
    build = next((int(b) for b in builds if b in OTHER_BUILDS), None)
    other = next((name for text, name in _OTHER_FIRMWARE.items() if any(re.match(text, line) for line in said)), None)
    if values.get("Q_ENABLE", 0) > 0:
        by, what = "Q_ENABLE 1", "a plane with rotors that lift it (a quadplane)"
    elif build is not None:
        by, what = f"VER.BU {build}", OTHER_BUILDS[build]
    elif kind in _OTHER_CLASSES:
        by, what = f"FRAME_CLASS {kind}", _OTHER_CLASSES[kind]
    elif other is not None:
        by, what = "its messages", other
    elif "FRAME_CLASS" not in values and any(name.startswith(("H_SW", "H_RSC")) for name in values):
        by, what = "parameters H_*", _OTHER_CLASSES[6]
    elif kind not in _MULTIROTORS and kind not in scripted:
        by, what = f"FRAME_CLASS {kind}", "of a frame that is not known here"
    else:
        return
    raise InputError(f"{where}: the log is of {what} ({by}); only multirotors of fixed rotors can be imported")


def order_of(values: Values) -> tuple[str, list[ImportFault]]:
    """Key of the rotors' order by frame class and type, empty where it is not known."""
    kind, form = int(values.get("FRAME_CLASS", 1)), int(values.get("FRAME_TYPE", values.get("FRAME", 1)))
    if kind == 1 and form in _ORDER_OF_FRAME:
        return _ORDER_OF_FRAME[form], []
    found = f"FRAME_CLASS {kind}, FRAME_TYPE {form}: the order of its rotors is not known here"
    faults = [ImportFault("order", "vehicle.yaml", found, "taken from the template: check it")]
    if kind == 1 and form in TILTED_TYPES:
        found = f"FRAME_TYPE {form} is a {TILTED_TYPES[form]}, whose rear rotors lean outwards"
        faults.append(ImportFault("tilted_rotor", "vehicle.yaml", found, "their thrust is taken along -z"))
    return "", faults


def _of_first(table: pd.DataFrame | None, key: str = "I") -> pd.DataFrame | None:
    """The rows of the first instance of a sensor or estimator."""
    if table is None:
        return None
    for name in (key, "I", "C", "Inst", "Instance"):
        if name in table:
            return table[table[name] == table[name].min()]
    return table


def _of_sensor(log: Log, kind: str, wished: float | None = None) -> tuple[pd.DataFrame | None, list[ImportFault]]:
    """The rows of an inertial sensor that goes on changing: the wished one, else the first; and a fault where that is
    not the first of all."""
    table = log.get(kind)
    if table is None or "I" not in table or not len(table):
        return table, []
    alive = {
        number: alive_s(own[c.TIME].to_numpy(float), own.filter(regex="^(Gyr|Acc)").to_numpy(float))
        for number, own in table.groupby("I")
    }
    taken, faults = goes_on(alive, kind)
    if wished in alive and wished != taken and alive[wished] >= GOES_ON * max(alive.values()):
        taken = wished
        found = f"the vehicle flew by {kind} {wished:g}, that of its estimator"
        faults = [ImportFault("instances", "", found, f"{kind} {wished:g} taken")]
    return table[table["I"] == taken], [replace(fault, column="inertial sensor") for fault in faults]


@dataclass(frozen=True)
class _Flown:
    """By which core of the estimator the vehicle flew: one throughout, else (None) the primary one of each time."""

    core: float | None = None
    sensor: float | None = None
    """The inertial sensor of that core."""
    switches_s: tuple[float, ...] = ()
    """When a core was left for another, where none is read throughout."""
    faults: tuple[ImportFault, ...] = ()


def _flown_by(log: Log) -> _Flown:
    """By `PI` of `XKF4` or `NKF4`. A core that took over and was never left was right before, too."""
    values = parameters(log).start
    kind = next((k for k in _estimators(values) if f"{k}F4" in log), "XK")
    primary = log.get(f"{kind}F4")
    if primary is None or not {"PI", c.TIME} <= set(primary) or not (primary["PI"] >= 0).any():
        return _Flown()
    primary = primary[primary["PI"] >= 0].sort_values(c.TIME, kind="stable")
    times, cores = (primary[name].to_numpy(float) for name in (c.TIME, "PI"))
    changed = np.flatnonzero(np.diff(cores) != 0)
    last, switches = cores[-1], tuple(times[changed + 1])
    estimates = [log[k] for k in (f"{kind}F1", f"{kind}Q") if "C" in log.get(k, ())]
    late = any(not (t.loc[t["C"] == last, c.TIME].min() <= t[c.TIME].min() + _LATE_CORE_S) for t in estimates)
    if len(changed) and (last in cores[changed] or late):
        return _Flown(None, None, switches)
    mask = int(values.get(f"E{kind[0].replace('X', 'K3').replace('N', 'K2')}_IMU_MASK", 0))
    sensor = next((float(n) for k, n in enumerate(n for n in range(8) if mask >> n & 1) if k == last), None)
    if len(changed):
        found = f"core {last:g} of the estimator took over for good"
        return _Flown(last, sensor, (), (ImportFault("estimate", "", found, "its estimate is taken throughout"),))
    if any(t["C"].min() < last for t in estimates):
        found = f"the vehicle flew by core {last:g} of the estimator"
        return _Flown(last, sensor, (), (ImportFault("instances", "", found, "that one taken"),))
    return _Flown(last, sensor)


def _of_primary(log: Log, kinds: tuple[str, ...], core: float | None) -> pd.DataFrame | None:
    """The rows, of the first kind that is logged, of a core of the estimator, or (None) of the one that flew the
    vehicle then.

    Of the first core where no message says which.
    """
    kind = next((k for k in kinds if k in log), "")
    table, primary = log.get(kind), log.get(f"{kind[:1]}KF4")
    if table is None or primary is None or not {"PI", c.TIME} <= set(primary) or "C" not in table:
        return _of_first(table, "C")
    if core is not None:
        return table[table["C"] == core] if (table["C"] == core).any() else _of_first(table, "C")
    held = np.searchsorted(primary[c.TIME], table[c.TIME], side="right") - 1
    return table[table["C"].to_numpy() == primary["PI"].to_numpy()[np.maximum(held, 0)]]


def _estimators(values: Values) -> tuple[str, str]:
    """How the kinds of the estimators' messages begin, of the one that flew the vehicle first."""
    return ("NK", "XK") if values.get("AHRS_EKF_TYPE") == 2 else ("XK", "NK")


def _clock(log: Log, where: object) -> tuple[np.ndarray, list[ImportFault]]:
    """Times of the inertial sensor's messages, else of the attitude's, s, and what was wrong with them; InputError
    where there are none."""
    wished = _flown_by(log).sensor
    offered = (*(_of_sensor(log, kind, wished)[0] for kind in ("IMU", "GYR", "ACC")), _of_first(log.get("ATT")))
    clock = next((t for t in offered if t is not None and len(t) > 1), None)
    if clock is None:
        raise InputError(f"{where}: no message IMU, GYR or ATT to take the clock from")
    times = clock[c.TIME].to_numpy(float)
    keep, faults = moving_on(times)
    return times[keep], faults


def _in_flight(log: Log, where: object) -> Values:
    """The parameters as they held for most of the flight."""
    grid, _ = _clock(log, where)
    return parameters(log).mostly(grid, _flying(log, grid))


def convert(log: Log, where: object) -> tuple[pd.DataFrame, list[ImportFault], np.ndarray]:
    """Contract columns of a whole log, its faults, and where it flies (mask of rows)."""
    good, down = 4, 25  # Status of a range finder that reads, and the orientation of one that looks down.
    grid, faults = _clock(log, where)
    stated, values, flown = parameters(log), _in_flight(log, where), _flown_by(log)
    _check_frame(log, values, where)
    faults += [*stated.faults(_CHANGED, grid[0]), *flown.faults]
    if END in log:
        faults.append(cut_off(f"the file ends inside a message, after {int(log[END]['bytes'].iloc[0])} bytes of it"))
    parts: list[tuple] = []

    def put(names, table: pd.DataFrame | None, fields) -> bool:
        if table is None or not set(fields) <= set(table) or not len(table):
            return False
        parts.append((tuple(names), table[c.TIME].to_numpy(float), table[list(fields)].to_numpy(float)))
        return True

    for names, kind, letters in ((c.ANGULAR_VELOCITY, "GYR", "Gyr"), (c.SPECIFIC_FORCE, "ACC", "Acc")):
        sensor, more = _of_sensor(log, "IMU" if "IMU" in log else kind, flown.sensor)
        put(names, sensor, [f"{letters}{axis}" for axis in "XYZ"])
        faults += [fault for fault in more if fault not in faults]
    cores = _estimators(values)
    parts += _attitude(log, cores, flown, faults)
    estimate = _of_primary(log, tuple(f"{core}F1" for core in cores), flown.core)
    if estimate is None and (estimate := log.get("EKF1")) is not None and values.get("AHRS_EKF_USE") != 1:
        found = "EKF1 did not fly the vehicle (AHRS_EKF_USE is not 1)"
        faults.append(ImportFault("estimate", "velocity, position", found, "columns left out", len(estimate)))
        estimate = None
    put(c.VELOCITY, estimate, ("VN", "VE", "VD"))
    put(c.POSITION, estimate, ("PN", "PE", "PD"))
    parts += _battery(log, faults)
    below = log.get("RFND")
    if below is not None and {"Dist", "Stat", "Orient"} <= set(below):
        put((c.HEIGHT,), _of_first(below[(below["Stat"] == good) & (below["Orient"] == down)], "Instance"), ("Dist",))
    outputs = _outputs(log)
    if outputs is None:
        faults.append(ImportFault("no_command", "", "RCOU is not logged", "no throttle columns"))
    else:
        channels, more = _channels(values, outputs)
        faults += more
        parts += _throttles(outputs, stated, values.get("FRAME_CLASS", 0.0), faults)
        parts += _speeds(log.get("ESC"), channels, faults)
    table = table_on(grid, parts)
    flying, ground = airborne(table, _flying(log, grid))
    return table, [*faults, *ground, *report_gaps(table)], flying


def _attitude(log: Log, cores: tuple[str, str], flown: _Flown, faults: list[ImportFault]) -> list[tuple]:
    """The attitude of the estimator, of `ATT` or of `ANG`: of several the first that comes often enough, else that
    which comes most often; the others are named."""
    enough_hz = 50.0  # Rate from which an attitude is followed well: none is preferred for a higher one.
    offered = {}
    quaternion = _of_primary(log, tuple(f"{core}Q" for core in cores), flown.core)
    if quaternion is not None and {"Q1", "Q2", "Q3", "Q4"} <= set(quaternion):
        turns = continuous(quaternion[["Q1", "Q2", "Q3", "Q4"]].to_numpy(float))
        offered["the estimator's quaternion"] = quaternion[c.TIME].to_numpy(float), turns
    for kind in ("ATT", "ANG"):
        table = _of_first(log.get(kind))
        if table is not None and {"Roll", "Pitch", "Yaw"} <= set(table):
            angles = np.radians(table[["Roll", "Pitch", "Yaw"]].to_numpy(float))
            offered[kind] = table[c.TIME].to_numpy(float), quaternion_from_euler_frd(*angles.T)
    if not offered:
        return []
    rates = {name: (len(t) - 1) / max(np.ptp(t), 1e-9) if len(t) > 1 else 0.0 for name, (t, _) in offered.items()}
    taken = max(rates, key=lambda name: round(min(rates[name], enough_hz)))
    if taken != next(iter(offered)):
        seen = ", ".join(f"{name} at {rate:.3g} Hz" for name, rate in rates.items())
        faults.append(ImportFault("instances", "attitude", f"several state it: {seen}", f"{taken} taken"))
    return [(c.QUATERNION, *offered[taken])]


def _outputs(log: Log) -> pd.DataFrame | None:
    """Pulses of all outputs: `RCOU`, and `RCO2` and `RCO3`, which are written with it; None where none is logged."""
    outputs = _of_first(log.get("RCOU"))
    for kind in ("RCO2", "RCO3"):
        more = log.get(kind)
        if outputs is not None and more is not None:
            own = [c.TIME, *(name for name in more if re.fullmatch(r"C\d+", name) and name not in outputs)]
            outputs = outputs.merge(more[own].drop_duplicates(c.TIME), on=c.TIME, how="left")
    return outputs


def _channels(values: Values, outputs: pd.DataFrame) -> tuple[dict[int, int], list[ImportFault]]:
    """To each motor (from 0) its output (from 1) by frame class and output functions, and what of it is doubtful."""
    count = _MULTIROTORS.get(int(values.get("FRAME_CLASS", 0)), 0)
    by_motor: dict[int, int] = {}
    faults = []
    for number in _OUTPUTS:
        motor = _MOTORS.get(int(values.get(f"SERVO{number}_FUNCTION", -1)))
        if motor is not None and by_motor.setdefault(motor, number) != number:
            found = f"outputs {by_motor[motor]} and {number} are both motor {motor + 1}"
            faults.append(ImportFault("instances", f"throttle_{motor + 1}", found, f"output {by_motor[motor]} taken"))
    if not by_motor:
        count = count or 4
        found = "no SERVOn_FUNCTION is a motor"
        action = f"channels 1 to {count} taken for motors 1 to {count}"
        logged = {i: i + 1 for i in range(count) if f"C{i + 1}" in outputs}
        return logged, [ImportFault("order", "throttle", found, action)]
    count = count or max(by_motor) + 1
    unused = [number for motor, number in sorted(by_motor.items()) if motor >= count]
    if unused:
        found = f"outputs {', '.join(map(str, unused))} have the functions of motors beyond the {count} of the frame"
        faults.append(ImportFault("order", "throttle", found, "left out"))
    for motor in range(count):
        if (number := by_motor.get(motor)) is None:
            found = f"no SERVOn_FUNCTION is motor {motor + 1} of {count}"
        elif f"C{number}" not in outputs:
            found = f"output {number} is not logged"
        else:
            continue
        faults.append(ImportFault("no_command", f"throttle_{motor + 1}", found, "column left out"))
    return {m: n for m, n in sorted(by_motor.items()) if m < count and f"C{n}" in outputs}, faults


def _throttles(outputs: pd.DataFrame, stated: Parameters, frame: float, faults: list[ImportFault]) -> list[tuple]:
    """Throttles with their times, each pulse by the parameters that held then; no pulse stops a motor."""
    times, throttles = outputs[c.TIME].to_numpy(float), {}
    for inside, values in stated.spans(_CHANGED[0][0], times):
        channels, kind = _channels({**values, "FRAME_CLASS": frame}, outputs)[0], int(values.get("MOT_PWM_TYPE", 0))
        every = outputs.loc[inside, [f"C{number}" for number in channels.values()]].to_numpy(float)
        short = kind in _SHORT and 0 < np.nanmax(every, initial=0.0) <= _LONGEST_SHORT_US
        if kind in _BY_CHANNEL:
            found = f"MOT_PWM_TYPE is {kind} ({_BY_CHANNEL[kind]})"
            action = "each output is read by its own SERVOn_MIN, _MAX, _TRIM and _REVERSED"
            faults.append(ImportFault("unit", "throttle", found, action, int(inside.sum())))
        else:
            low, high, more = _limits(values, int(inside.sum()))
            faults += more
        if short:
            found = f"MOT_PWM_TYPE is {kind} and no pulse is longer than {np.nanmax(every):g} µs (OneShot125)"
            faults.append(ImportFault("unit", "throttle", found, f"taken {_TIMES_SHORTER} times as long", len(every)))
        for (motor, number), pulses in zip(channels.items(), every.T, strict=True):
            pulses = pulses * (_TIMES_SHORTER if short else 1)
            name, given = f"throttle_{motor + 1}", pulses > 0
            share = (
                _of_own_range(pulses, values, number, kind) if kind in _BY_CHANNEL else (pulses - low) / (high - low)
            )
            own = throttles.setdefault(name, np.full(len(times), np.nan))
            own[inside] = np.where(given, share, np.nan)
    if not throttles:
        return []
    names = sorted(throttles)
    shares = np.column_stack([throttles[name] for name in names])
    shares, stopped = stops(shares, names, "no pulse (0)")
    shares, outside = within(shares, names)
    faults += [*stopped, *outside]
    return [(names, times, shares)]


def _of_own_range(pulses: np.ndarray, values: Values, number: int, kind: int) -> np.ndarray:
    """Shares of a channel's own range, of an angle's two halves on either side of its trim, from the other end where it
    is reversed."""
    defaults = {"MIN": 1100.0, "TRIM": 1500.0, "MAX": 1900.0}
    low, trim, high = (values.get(f"SERVO{number}_{word}", default) for word, default in defaults.items())
    share = (pulses - low) / max(high - low, 1.0)
    if kind == 9 and low < trim < high:
        share = 0.5 + 0.5 * np.where(pulses > trim, (pulses - trim) / (high - trim), (pulses - trim) / (trim - low))
    return 1 - share if values.get(f"SERVO{number}_REVERSED", 0) > 0 else share


def _limits(values: Values, pulses: int) -> tuple[float, float, list[ImportFault]]:
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
    return low, high, [ImportFault("unit", "throttle", found, action, pulses)]


def _battery(log: Log, faults: list[ImportFault]) -> list[tuple]:
    """Voltage (V) and current (A) of `BAT`, of `CURR` where there is none; what is 0 throughout is not measured, and
    batteries after the first have names of their own.

    `CURR` counts in hundredths where its format holds whole numbers (Copter 3.3 and before).
    """
    kind = "BAT" if log.get("BAT") is not None else "CURR"
    table, parts = log.get(kind), []
    if table is None:
        return []
    key = next((name for name in ("Inst", "Instance", "I") if name in table), None)
    every = [(f" of battery {k}", own) for k, own in table.groupby(key)] if key else [("", table)]
    every.sort(key=lambda battery: "Volt" not in table or not np.any(battery[1]["Volt"]))  # first one with a voltage
    for number, (which, own) in enumerate(every, 1):
        for column, name in ((c.BATTERY_VOLTAGE, "Volt"), (c.BATTERY_CURRENT, "Curr")):
            if name not in table or table[name].dtype.kind not in "iuf":
                continue  # not there, or damaged: no numbers
            values = own[[name]].to_numpy()
            values = values.astype(float) * (0.01 if kind == "CURR" and values.dtype.kind in "iu" else 1.0)
            column = column if number == 1 else f"battery_{number}_{column.removeprefix('battery_')}"
            seen = f"{kind}.{name}{which if len(every) > 1 else ''}"
            if (values == 0).all():
                faults.append(ImportFault("stuck", column, f"{seen} is 0 throughout", "column left out", len(values)))
                continue
            if number > 1:
                action = "kept under a name of its own"
                faults.append(ImportFault("instances", column, f"{seen} is logged, too", action, len(values)))
            values = np.where(values > 0, values, np.nan) if name == "Volt" else values
            parts.append(((column,), own[c.TIME].to_numpy(float), values))
    return parts


def _speeds(esc: pd.DataFrame | None, channels: Mapping[int, int], faults: list[ImportFault]) -> list[tuple]:
    """Rotor speeds of `ESC` messages, whose instance is the output's number from 0.

    Some drivers count their controllers instead: where no output has such a number, in the order of the outputs.
    """
    if esc is None or not {"Instance", "RPM"} <= set(esc):
        return []
    found, outputs = [], sorted(channels.values())
    if not {number - 1 for number in outputs} & set(esc["Instance"]) and esc["Instance"].nunique() == len(outputs):
        order = dict(zip(sorted(set(esc["Instance"])), outputs, strict=True))
        seen = f"ESC counts {', '.join(f'{i:g}' for i in order)} for outputs {', '.join(map(str, outputs))}"
        faults.append(ImportFault("order", "rotor_speed", seen, "taken in their order"))
        esc = esc.assign(Instance=esc["Instance"].map(order) - 1)
    for motor, channel in channels.items():
        name = f"rotor_speed_{motor + 1}_rad_s"
        own = esc[esc["Instance"] == channel - 1]
        if not len(own) or not own["RPM"].abs().max() > 0:
            seen = f"ESC holds no speed of output {channel}"
            faults.append(ImportFault("speed_missing", name, seen, "column left out"))
            continue
        speeds, more = one_sense(own[["RPM"]].to_numpy(float) * RPM, (name,))
        faults += more
        found.append(((name,), own[c.TIME].to_numpy(float), speeds))
    return found


def _flying(log: Log, grid: np.ndarray) -> np.ndarray | None:
    """Rows in the air by the land detector's events; None where there are none."""
    events = log.get("EV")
    if events is not None and "Id" in events:
        events = events[events["Id"].isin((_LANDED, _FLYING))]
        if (events["Id"] == _FLYING).any():
            return held_on(grid, events[c.TIME].to_numpy(float), events["Id"] == _FLYING) > 0.5
    return None


def _resets(log: Log) -> list[tuple[np.ndarray, str]]:
    """Times of all that sets an estimate anew, s, and what it is in words."""
    found = [(np.array(_flown_by(log).switches_s), "another core of the estimator took over")]
    events, said = log.get("EV"), log.get("MSG")
    for event, words in _RESET_EVENTS.items():
        if events is not None and {"Id", c.TIME} <= set(events):
            found.append((events.loc[events["Id"] == event, c.TIME].to_numpy(float), words))
    if said is not None and {"Message", c.TIME} <= set(said):
        again = said["Message"].astype(str).str.match(_REALIGNED)
        found.append((said.loc[again, c.TIME].to_numpy(float), "the heading was aligned anew"))
    for kind in ("XKF4", "NKF4"):
        table = _of_first(log.get(kind), "C")
        if table is not None and {"OFN", "OFE", c.TIME} <= set(table) and len(table) > 1:
            moved = np.linalg.norm(np.diff(table[["OFN", "OFE"]].to_numpy(float), axis=0), axis=1) > _LEAST_RESET_M
            found.append((table[c.TIME].to_numpy(float)[1:][moved], "the estimator set the position anew"))
    return [(times, words) for times, words in found if len(times)]


def read(path: Path, log: Log | None = None) -> Imported:
    """Every flight of a DataFlash log, or of tables like its own (`log`)."""
    settings = _stated_parameters(path) if log is None else parameters(log).start
    log = read_messages(path) if log is None else log
    table, faults, flying = convert(log, path)
    order, more = order_of(_in_flight(log, path))
    grid, jumps = table[c.TIME].to_numpy(), np.zeros(len(table), bool)
    for times, words in _resets(log):
        own, found = jumps_at(grid, times - _clock(log, path)[0][0], words)
        jumps, more = jumps | own, more + found
    runs, cuts = flights(table, flying, path.name.split(".")[0], path, jumps)
    axes = "ArduPilot's: body forward-right-down, world north-east-down, as the contract's"
    return Imported(runs, [*faults, *more, *cuts], axes, Known(order), speed_unit="rpm", settings=settings)


def _stated_parameters(path: Path) -> dict[str, float]:
    """The parameters that a DataFlash log states, each as it states it first."""
    found, _ = read_dataflash(path, ("PARM",))
    columns = found["PARM"].columns if "PARM" in found else {}
    if not {"Name", "Value"} <= set(columns) or columns["Value"].dtype.kind not in "if":
        return {}
    pairs = zip(columns["Name"].tolist(), columns["Value"].tolist(), strict=True)
    return dict(reversed([(str(name), float(value)) for name, value in pairs if np.isfinite(value)]))


IMPORTER = Importer(
    "ardupilot",
    "ArduPilot DataFlash",
    read,
    "frame by `FRAME_CLASS`; `IMU`, `XKQ` or `ATT`, `XKF1`, `RCOU` by `SERVOn_FUNCTION` and the parameters that held "
    "then, `ESC`, `BAT` or `CURR`, `RFND`; clocks `TimeUS` or `TimeMS`; the part in the air by its event, throttle and "
    "specific force",
    starts=(HEAD,),
    inside=(HEAD + b"\x80\x80\x59FMT",),
)
