"""Any table (CSV or Parquet) as a run, by a mapping file that says what its columns are.

A mapping names columns, units and frames::

    body: flu              # frd | flu | fur      axes of accelerometer, gyroscope and attitude
    world: enu             # ned | enu | nwu | nue  axes of position and velocity, and what the attitude refers to
    channels:
      time: {columns: [t], unit: us}
      specific_force: {columns: [ax, ay, az], unit: g}
      attitude: {columns: [qx, qy, qz, qw], form: xyzw}       # wxyz | xyzw | euler | euler_xyz (roll, pitch, yaw)
      attitude: {columns: [RX, RY, RZ], form: rotvec, unit: deg}          # one turn about an axis, as Vicon writes it
      attitude: {columns: [roll, pitch, heading], form: euler, unit: ddeg, signs: [1, -1, 1]}   # of any channel
      velocity: {columns: [vx, vy, vz], unit: m/s, axes: body}  # world (default) | body
      position: {columns: [x, y, z], unit: m, world: neu}       # where its axes are not those of the attitude
      throttle: {columns: [m1, m2, m3, m4], unit: us, range: [1000, 2000]}
      rotor_speed: {columns: [e1, e2, e3, e4], unit: 100erpm, poles: 14}   # electrical turns: poles of a motor
      angular_velocity: {columns: [gx, gy, gz], unit: deg/s, scale: 0.061}  # counts: what one is in the unit
      thrust: {columns: [load], unit: kgf}     # of a stand: along -z; torque likewise; or force and moment, of three
    keep: [wind_sensor]    # other columns, kept under their own names

`euler` turns by yaw about z, then pitch about the new y, then roll about the new x (z-y'-x''); `euler_xyz` by roll
first (x-y'-z'', as motion captures write it). Axes are named in their order, x first: forward, right, left, up, down;
north, east, west, up, down.

A value that is `?` is a question left open: nothing is imported until it is answered.
`rotorid.recordings.importers.guessing` proposes such a mapping from the names of the columns and from what stands in
them.

Most laboratories log body axes forward-left-up (FLU) and a world with z up. Half a turn about the x axis gives
forward-right-down (FRD) and a world with z down: y and z change sign, of a quaternion as well.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd
import scipy
from pydantic import ValidationError

from rotorid.errors import InputError
from rotorid.io.models import KnownKeys
from rotorid.io.text.files import read_yaml
from rotorid.io.text.wording import explain
from rotorid.recordings import columns as c
from rotorid.recordings.importers.contract import Imported, Importer
from rotorid.recordings.importers.faults import (
    LATE_STEPS,
    SET_BACK,
    ImportFault,
    airborne,
    drop_repeated_times,
    flights,
    in_order,
    join_rows,
    one_sense,
    report_gaps,
    within,
)
from rotorid.recordings.tables import MANY_ROWS, clock_jump, numbers, read_cells

G = 9.80665
"""Standard gravity, m/s²."""
RPM = np.pi / 30
"""One turn a minute, rad/s."""
PULSE_US = (1000.0, 2000.0)
"""Pulse widths of no and full throttle where nothing states them."""
_POUND_N, _OUNCE_N = 4.4482216152605, 0.27801385095378
_INCH_M, _FOOT_M = 0.0254, 0.3048

UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "ft": _FOOT_M},
    "velocity": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3},
    "rate": {"rad/s": 1.0, "deg/s": np.pi / 180, "mrad/s": 1e-3},
    "angle": {"rad": 1.0, "deg": np.pi / 180, "mrad": 1e-3, "cdeg": np.pi / 18000, "ddeg": np.pi / 1800},
    "acceleration": {"m/s2": 1.0, "g": G, "mg": G / 1000, "cm/s2": 1e-2, "mm/s2": 1e-3, "ft/s2": _FOOT_M},
    "rotor": {"rad/s": 1.0, "rpm": RPM, "hz": 2 * np.pi},
    "turns": {
        "rad/s": 1.0, "rpm": RPM, "hz": 2 * np.pi, "krpm": 1000 * RPM, "erpm": RPM, "100erpm": 100 * np.pi / 30
    },
    "share": {"1": 1.0, "%": 0.01, "us": 1.0, "raw": 1.0},
    "voltage": {"V": 1.0, "mV": 1e-3, "cV": 1e-2, "dV": 0.1},
    "current": {"A": 1.0, "mA": 1e-3, "cA": 1e-2, "dA": 0.1},
    "temperature": {"degC": 1.0, "degF": 5 / 9, "K": 1.0},
    "force": {"N": 1.0, "mN": 1e-3, "kN": 1e3, "kgf": G, "gf": 9.80665e-3, "lbf": _POUND_N, "ozf": _OUNCE_N},
    "torque": {
        "N.m": 1.0, "N.cm": 1e-2, "N.mm": 1e-3, "mN.m": 1e-3, "kgf.m": G, "kgf.cm": G / 100, "gf.cm": G / 1e5,
        "lbf.ft": _POUND_N * _FOOT_M, "lbf.in": _POUND_N * _INCH_M, "ozf.in": _OUNCE_N * _INCH_M,
    },
}  # fmt: skip
"""To each kind of quantity its units, and the factor to the contract's (`turns`: electrical ones per pair of poles)."""
_LEAST_LENGTH = 0.5
"""Length of a quaternion below which it is none."""
_ZEROS = {"degF": -32 * 5 / 9, "K": -273.15}
"""What a reading of 0 is in the contract's unit, where that is not 0."""
SPELLINGS: dict[str, dict[str, str]] = {
    "time": {"s": "sec secs second seconds", "ms": "msec millis millisecond milliseconds",
             "us": "usec micros microsecond microseconds", "ns": "nsec nanos nanosecond nanoseconds"},
    "length": {"m": "meter meters metre metres", "cm": "centimeter centimeters", "mm": "millimeter millimeters",
               "ft": "foot feet"},
    "velocity": {"m/s": "ms mps ms1", "cm/s": "cms cmps", "mm/s": "mms mmps"},
    "rate": {"rad/s": "rads radps rads1", "deg/s": "degs dps degps degrees/s degree/s degs1", "mrad/s": "mrads mradps"},
    "angle": {"rad": "radian radians", "deg": "degree degrees", "mrad": "", "cdeg": "centideg centidegrees",
              "ddeg": "decideg decidegrees"},
    "acceleration": {"m/s2": "ms2 mps2 m/s/s m/ss", "g": "gs g0 gn", "mg": "milligee",
                     "cm/s2": "cms2 cm/s/s gal", "mm/s2": "mms2 mm/s/s", "ft/s2": "fts2 ft/s/s"},
    "rotor": {"rad/s": "rads radps rads1", "rpm": "r/min rev/min revs/min 1/min u/min min1 revolutions/min rpms",
              "hz": "1/s r/s rev/s revs/s rps s1 revolutions/s"},
    "turns": {"rad/s": "rads radps rads1", "rpm": "r/min rev/min revs/min 1/min u/min min1 rpms",
              "krpm": "1000rpm rpmx1000 kr/min krev/min",
              "hz": "1/s r/s rev/s revs/s rps s1", "erpm": "", "100erpm": "erpm/100"},
    "share": {"1": "ratio fraction norm normalized normalised 01", "%": "percent pct prc", "us": "usec", "raw": ""},
    "voltage": {"V": "volt volts", "mV": "millivolt millivolts", "cV": "", "dV": ""},
    "current": {"A": "amp amps ampere amperes", "mA": "milliamp milliamps", "cA": "", "dA": ""},
    "temperature": {"degC": "c celsius", "degF": "f fahrenheit", "K": "kelvin degk"},
    "force": {"N": "newton newtons", "mN": "millinewton", "kN": "kilonewton", "kgf": "kg kp kgs kilogram kilograms",
              "gf": "g gr gram grams gramforce p pond", "lbf": "lb lbs pound pounds", "ozf": "oz ounce ounces"},
    "torque": {"N.m": "newtonmeter newtonmeters newtonmetre", "N.cm": "", "N.mm": "", "mN.m": "", "kgf.m": "kgm kpm",
               "kgf.cm": "kgcm", "gf.cm": "gcm", "lbf.ft": "lbft ftlb ftlbf ftlbs lbsft", "lbf.in": "lbin inlb inlbf",
               "ozf.in": "ozin inoz inozf"},
}  # fmt: skip
"""Other ways to write a unit, in small letters without blanks and signs of multiplication."""
_SIGNS = str.maketrans(
    {"µ": "u", "μ": "u", "²": "2", "⁻": "", "¹": "1", "°": "deg", "º": "deg", "Â": "", "\ufffd": "u"}
)
"""Signs of units as letters; the last two are what a wrong encoding makes of `µ`."""
_HALF_TURN_ABOUT_X = np.array([1.0, -1.0, -1.0])
CHANNELS: dict[str, tuple[str, tuple[str, ...]]] = {
    "time": ("time", (c.TIME,)),
    "position": ("length", c.POSITION),
    "velocity": ("velocity", c.VELOCITY),
    "attitude": ("angle", c.QUATERNION),
    "angular_velocity": ("rate", c.ANGULAR_VELOCITY),
    "specific_force": ("acceleration", c.SPECIFIC_FORCE),
    "rotor_speed": ("turns", ()),
    "rotor_command": ("turns", ()),
    "throttle": ("share", ()),
    "height": ("length", (c.HEIGHT,)),
    "battery_voltage": ("voltage", (c.BATTERY_VOLTAGE,)),
    "battery_current": ("current", (c.BATTERY_CURRENT,)),
    "temperature": ("temperature", (c.TEMPERATURE,)),
    "thrust": ("force", (c.FORCE[2],)),
    "torque": ("torque", (c.MOMENT[2],)),
    "force": ("force", c.FORCE),
    "moment": ("torque", c.MOMENT),
}
"""Channels of a mapping: kind of unit and columns of the contract (none: one a rotor)."""
_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
BODY = {"frd": np.eye(3), "flu": np.diag([1.0, -1.0, -1.0]), "fur": _Y_UP}
"""Body axes as columns in forward-right-down."""
WORLD = {
    "ned": np.eye(3),
    "nwu": np.diag([1.0, -1.0, -1.0]),
    "enu": np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]),
    "nue": _Y_UP,
}
"""World axes as columns in north-east-down."""
TRAVEL = WORLD | {"neu": np.diag([1.0, 1.0, -1.0])}
"""Axes that position and velocity may have, too: a left-handed system has no attitude."""
ELECTRICAL = ("erpm", "100erpm")
_DATE, _TIME_OF_DAY = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d"), re.compile(r"\d{1,2}:\d\d(:\d\d)?([.,]\d+)?")
_DAY_FIRST = re.compile(r"(\d{1,2})([./])(\d{1,2})\2(\d{4})[T ]+(?=\d)")
"""A date that begins with its day or, with slashes, its month."""


class MappedChannel(KnownKeys, frozen=True):
    """Columns that make one channel."""

    columns: tuple[str, ...]
    unit: str = ""
    scale: float | Literal["?"] = 1.0
    """What one count is in the unit."""
    signs: tuple[Literal[1, -1], ...] | Literal["?"] | None = None
    """By which each column is multiplied: 1 or -1 (an angle that is positive nose down, where the axes want it up)."""
    form: Literal["wxyz", "xyzw", "euler", "euler_xyz", "rotvec", "?"] = "wxyz"
    """Attitude only."""
    axes: Literal["world", "body", "?"] = "world"
    """Velocity only."""
    world: Literal["ned", "enu", "nwu", "nue", "neu", "?"] | None = None
    """Position and velocity only: their axes where they are not those of the attitude."""
    range: tuple[float, float] | Literal["?"] | None = None
    """Throttle only: readings of no and of full throttle."""
    poles: int | Literal["?"] | None = None
    """Speeds in electrical turns only: magnetic poles of a motor."""


class Mapping(KnownKeys, frozen=True):
    """What the columns of a table are."""

    body: Literal["frd", "flu", "fur", "?"] = "frd"
    world: Literal["ned", "enu", "nwu", "nue", "?"] = "ned"
    channels: dict[str, MappedChannel]
    keep: tuple[str, ...] = ()


EULER = {"euler": "ZYX", "euler_xyz": "XYZ"}
"""Orders of the turns about the axes of the body as they come."""
THREE = (*EULER, "rotvec")
"""Forms of an attitude that have three angles."""
OPEN = "?"
"""What stands for an answer that only a person can give."""


def _check_answered(mapping: Mapping, where: object) -> None:
    """InputError where a mapping still holds a question (`?`), each with what is expected there."""
    found = [f"{key} ({' or '.join(known)})" for key, known in (("body", BODY), ("world", WORLD))
             if getattr(mapping, key) == OPEN]  # fmt: skip
    for name, channel in mapping.channels.items():
        units = UNITS[CHANNELS[name][0]] if name in CHANNELS else ()
        expected = {
            "columns": "a column's name",
            "unit": " or ".join(units),
            "form": "wxyz, xyzw, euler, euler_xyz or rotvec",
            "axes": "world or body",
            "world": " or ".join(TRAVEL),
            "scale": "what one count is in the unit",
            "signs": "1 or -1 for each column",
            "range": "[reading of no throttle, of full throttle]",
            "poles": "magnetic poles of a motor",
        }
        for key, words in expected.items():
            if getattr(channel, key) == OPEN or key == "columns" and OPEN in channel.columns:
                found.append(f"channels.{name}.{key} ({words})")
    if found:
        raise InputError(
            f"{where}: still open ({OPEN}): {'; '.join(found)}; write the answer in its place, or remove the channel"
        )


def read_mapping(path: Path) -> Mapping:
    """A mapping file; InputError names what does not fit, and what is still open."""
    try:
        mapping = Mapping.model_validate(read_yaml(Path(path)))
    except ValidationError as error:
        raise InputError(f"{path}: {explain(error, Mapping)}") from None
    _check_answered(mapping, path)
    for name, channel in mapping.channels.items():
        if name not in CHANNELS:
            raise InputError(f"{path}: channels: {name}: no such channel{_near(name, CHANNELS)}")
        known = UNITS[CHANNELS[name][0]]
        if channel.unit and channel.unit not in known:
            raise InputError(f"{path}: {name}: unit {channel.unit!r}, expected one of {', '.join(known)}")
        wanted = len(CHANNELS[name][1])
        if name == "attitude":
            wanted = 3 if channel.form in THREE else 4
        if channel.range is not None and not channel.range[1] > channel.range[0]:
            low, high = channel.range
            raise InputError(f"{path}: {name}: range [{low:g}, {high:g}], expected no throttle below full throttle")
        if channel.unit in ELECTRICAL and not (channel.poles or 0) > 0:
            raise InputError(f"{path}: {name}: unit {channel.unit} needs poles, the magnetic poles of a motor")
        if channel.signs is not None and len(channel.signs) != len(channel.columns):
            raise InputError(f"{path}: {name}: {len(channel.signs)} signs for {len(channel.columns)} columns")
        if channel.scale == 0:
            raise InputError(f"{path}: {name}: scale 0, expected what one count is in the unit")
        if wanted and len(channel.columns) != wanted:
            raise InputError(f"{path}: {name}: {len(channel.columns)} columns, expected {wanted}")
    if "time" not in mapping.channels:
        raise InputError(f"{path}: channels: time is missing")
    return mapping


def _near(name: str, names) -> str:
    near = get_close_matches(name, list(names), 1, 0.5)
    return f"; did you mean {near[0]}?" if near else f"; there are: {', '.join(names)}"


def read_columns(path: Path, used: Collection[str] | None = None) -> pd.DataFrame:
    """The cells of a CSV or Parquet file, numbers or text; InputError where it is no table.

    `used` names the columns that are wanted of a CSV file, None all of them.
    """
    path = Path(path)
    table = read_cells(path, True, used)
    count = len(_there(table))
    if count < 2 or len(table) < 2:
        raise InputError(
            f"{path}: expected a table of numbers with a heading, found {count} columns and {len(table)} rows"
        )
    return _clocks_as_seconds(table)


def _there(table: pd.DataFrame) -> list[str]:
    """Names of the columns of a table's file, those that were not read, too."""
    return table.attrs["layout"].names if "layout" in table.attrs else list(table.columns)


def _clocks_as_seconds(table: pd.DataFrame) -> pd.DataFrame:
    """The table with columns of dates or times of day, each cell one, as seconds; their fractions may have commas."""
    for name in table.columns:
        column = table[name]
        if pd.api.types.is_numeric_dtype(column.dtype) or not (known := column.notna()).any():
            continue
        first = str(column[known].iloc[0]).strip()
        if _DATE.match(first) or _DAY_FIRST.match(first):
            since = _seconds_of_dates(column)
        elif _TIME_OF_DAY.fullmatch(first):
            text = column.astype("string").str.strip().str.replace(",", ".")
            whole = text.where(text.str.count(":") == 2, "0:" + text)  # minutes and seconds
            since = pd.to_timedelta(whole, errors="coerce").dt.total_seconds()
        else:
            continue
        if since.notna().equals(known):
            table[name] = since
    return table


def _seconds_of_dates(column: pd.Series) -> pd.Series:
    """Dates and times as seconds. Of a day and a month in either order those are meant in which less time goes by."""
    text, read = column.astype("string").str.strip().str.replace(",", "."), []
    for order in (r"\4-\3-\1 ", r"\4-\1-\3 "):
        # With two digits of each: a day or a month of one digit is none of ISO 8601.
        iso = text.str.replace(
            _DAY_FIRST, lambda m, o=order: re.sub(r"-(\d)(?=[- ])", r"-0\1", m.expand(o)), regex=True
        )
        since = pd.to_datetime(iso, format="ISO8601", utc=True, errors="coerce") - pd.Timestamp(0, tz="UTC")
        read.append(since.dt.total_seconds())
    return min(read, key=lambda s: (int(s.isna().sum()), float(s.max() - s.min())))


def read_by_mapping(path: Path, mapping: Mapping | None) -> tuple[pd.DataFrame, list[ImportFault], str]:
    """A table in contract columns, its faults and its axes in words.

    Without a mapping the columns must have the contract's names; InputError says how to get a mapping.
    """
    wanted = None if mapping is None else {n for of in mapping.channels.values() for n in of.columns} | {*mapping.keep}
    raw = read_columns(path, wanted)
    layout, lost = raw.attrs.get("layout"), []
    if layout and layout.encoding != "utf-8":
        lost.append(ImportFault("encoding", "", "file is not UTF-8", "read as Latin-1"))
    if layout and layout.above:
        found = f"{len(layout.above)} lines above the heading in line {layout.heading_line}"
        lost.append(ImportFault("above", "", found, "left out"))
    if layout and layout.cut_off:
        lost.append(ImportFault("cut_off", c.TIME, "the last line is cut off", "left out", 1))
    if mapping is None:
        if c.TIME in raw.columns and sum(c.is_known(n) for n in raw.columns) > 1:
            table, late = in_order(numbers(raw, path), c.TIME)
            table, faults = _clocked(table, path)
            return table, lost + late + faults, "the contract's: the columns have its names"
        raise InputError(
            f"{path}: the columns ({', '.join(raw.columns[:6])}, …) are not named as the recording contract has them; "
            f"`rotorid import {path.name} --write-mapping mapping.yaml` proposes what each one is"
        )
    table, faults = convert(raw, mapping, str(path))
    return table, lost + faults, f"body {mapping.body.upper()}, world {mapping.world.upper()}, turned into FRD and NED"


def convert(raw: pd.DataFrame, mapping: Mapping, where: str) -> tuple[pd.DataFrame, list[ImportFault]]:
    """Contract columns of a table by a mapping; InputError names a column that is not there or no numbers.

    `raw` is emptied on the way, so that a large table is in the memory once.
    """
    _check_answered(mapping, f"the mapping of {where}")
    body, world = BODY[mapping.body], WORLD[mapping.world]
    wanted = [(name, channel.columns) for name, channel in mapping.channels.items()] + [("keep", mapping.keep)]
    parts = [_numbers(raw, columns, name, where) for name, columns in wanted if columns]
    table = pd.DataFrame({name: part[name] for part in parts for name in part.columns}, copy=False)
    del parts
    for name in list(raw.columns):
        del raw[name]
    clock = mapping.channels["time"].columns[0]
    table, late = in_order(table, clock)
    table = join_rows(table, clock)
    out: dict[str, np.ndarray] = {}
    faults: list[ImportFault] = []
    rotation = None
    order = sorted(mapping.channels, key=lambda n: n != "attitude")
    for name in order:
        channel = mapping.channels[name]
        values = table[list(channel.columns)].to_numpy(float)
        later = {n for of in order[order.index(name) + 1 :] for n in mapping.channels[of].columns} | {*mapping.keep}
        table = table.drop(columns=[n for n in dict.fromkeys(channel.columns) if n not in later])
        kind, columns = CHANNELS[name]
        if channel.scale != 1.0:
            values = values * channel.scale
        if channel.signs is not None:
            values = values * channel.signs
        if name == "throttle" and channel.range is not None:
            low, high = channel.range
            values = (values - low) / (high - low)
        elif name != "attitude" or channel.form in THREE:
            values = converted(values, kind, channel.unit)
        if channel.unit in ELECTRICAL:
            values = values / (channel.poles / 2)
        if name == "attitude":
            rotation = values = _attitude(values, channel.form, body, world)
        elif name in ("angular_velocity", "specific_force", "force", "moment"):
            values = values @ body.T
        elif name == "thrust":
            values = -values
        elif name == "torque":  # the vehicle's file gives it the sign of its rotor
            values = values * (-1.0 if np.nansum(values) < 0 else 1.0)
        elif name == "position" or (name == "velocity" and channel.axes == "world"):
            values = values @ TRAVEL[channel.world or mapping.world].T
        elif name == "velocity":
            if rotation is None:
                raise InputError(f"{where}: velocity in body axes needs an attitude to be turned into the world")
            known = np.isfinite(values).all(axis=1) & np.isfinite(rotation).all(axis=1)
            turned = np.full_like(values, np.nan)
            turn = scipy.spatial.transform.Rotation.from_quat(rotation[known][:, [1, 2, 3, 0]])
            turned[known] = turn.apply(values[known] @ body.T)
            values = turned
        if not columns:
            columns = c.rotor_columns(name, len(channel.columns))
            both = name != "throttle" or channel.range is None or channel.range[0] == 0  # below it is backwards
            values, more = one_sense(values, columns, None if name != "throttle" else 1.0) if both else (values, [])
            faults += more
            if name == "throttle":
                values, more = within(values, columns)
                faults += more
        out.update(zip(columns, values.T, strict=True))
    for name in mapping.keep:
        out[name] = table[name].to_numpy(float)
    out[c.TIME] = out[c.TIME] - np.nanmin(out[c.TIME])
    out = {c.TIME: out.pop(c.TIME), **out}
    table, more = _clocked(pd.DataFrame(out, copy=len(out[c.TIME]) < MANY_ROWS), where)
    return table, late + faults + more


def _clocked(table: pd.DataFrame, where: object) -> tuple[pd.DataFrame, list[ImportFault]]:
    """The rows that move the clock on, and what is wrong with the others; InputError where the clock was set."""
    known = table[c.TIME].notna().to_numpy()
    whole = table[c.TIME].to_numpy(float)
    table, faults = drop_repeated_times(table)
    if any(fault.kind == "apart" for fault in faults):
        table = table.assign(**{c.TIME: table[c.TIME] - table[c.TIME].iloc[0]})
        whole = table[c.TIME].to_numpy(float)
    if known.all() and (jumped := clock_jump(whole, str(where))):
        raise InputError(jumped)
    if len(table) < 2:
        raise InputError(f"{where}: {c.TIME} moves on in {len(table)} of {len(known)} rows, expected at least two")
    return table, faults + report_gaps(table)


def _numbers(raw: pd.DataFrame, columns, channel: str, where: str) -> pd.DataFrame:
    for name in columns:
        if name not in raw.columns:
            raise InputError(f"{where}: {channel} wants column {name!r}, which is not there{_near(name, _there(raw))}")
    return numbers(raw[list(dict.fromkeys(columns))], where)


def from_angles(angles: np.ndarray, form: str) -> scipy.spatial.transform.Rotation:
    """Rotations by angles (n, 3), rad: roll, pitch and yaw in one of the orders of `EULER`, or a rotation vector."""
    if form == "rotvec":
        return scipy.spatial.transform.Rotation.from_rotvec(angles)
    return scipy.spatial.transform.Rotation.from_euler(EULER[form], angles if form == "euler_xyz" else angles[:, ::-1])


def _attitude(values: np.ndarray, form: str, body: np.ndarray, world: np.ndarray) -> np.ndarray:
    """Quaternions (n, 4), scalar first, FRD to NED; NaN where a value is missing."""
    out = np.full((len(values), 4), np.nan)
    known = np.isfinite(values).all(axis=1)
    if form not in THREE:
        known &= np.linalg.norm(values, axis=1) > 0
    # In pieces: turns take some times the memory of what they are made of.
    for rows in np.array_split(np.flatnonzero(known), known.sum() // MANY_ROWS + 1):
        if form in THREE:
            turn = from_angles(values[rows], form)
        else:
            xyzw = values[rows] if form == "xyzw" else values[rows][:, [1, 2, 3, 0]]
            turn = scipy.spatial.transform.Rotation.from_quat(xyzw)
        to_world, to_body = (scipy.spatial.transform.Rotation.from_matrix(axes) for axes in (world, body))
        turn = to_world * turn * to_body.inv()
        out[rows] = turn.as_quat()[:, [3, 0, 1, 2]]
    out[known] = continuous(out[known])
    return out


def half_turn_about_x(vectors: np.ndarray) -> np.ndarray:
    """Vectors shape (n, 3) from FLU to FRD (or from z up to z down); its own inverse."""
    return np.asarray(vectors, float) * _HALF_TURN_ABOUT_X


def quaternion_to_frd_ned(wxyz: np.ndarray) -> np.ndarray:
    """Quaternions (n, 4), scalar first, FLU body to z-up world, as FRD body to z-down world; unit length."""
    wxyz = np.asarray(wxyz, float) * np.array([1.0, 1.0, -1.0, -1.0])
    return continuous(wxyz / np.linalg.norm(wxyz, axis=1, keepdims=True))


def continuous(wxyz: np.ndarray) -> np.ndarray:
    """The same attitudes with signs chosen so that neighbours are close (q and -q are one attitude), NaN where a
    quaternion has no length: it states none."""
    stated = np.linalg.norm(wxyz, axis=1) > _LEAST_LENGTH
    out, own = np.full(wxyz.shape, np.nan), wxyz[stated]
    signs = np.where(np.sum(own[1:] * own[:-1], axis=1) < 0, -1.0, 1.0)
    out[stated] = own * np.cumprod(np.append(1.0, signs))[: len(own), None]
    return out


def quaternion_from_euler_frd(roll: np.ndarray, pitch: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """Quaternions (n, 4), scalar first, from FRD roll, pitch, yaw in rad (aerospace order z-y'-x'')."""
    return continuous(from_angles(np.column_stack([roll, pitch, yaw]), "euler").as_quat()[:, [3, 0, 1, 2]])


def _plainly(text: str) -> str:
    """A unit in small letters, without blanks, powers' signs and signs of multiplication, seconds as `s`."""
    plain = re.sub(r"[\s.·⋅∙•*×^_-]", "", str(text).translate(_SIGNS).lower())
    return re.sub(r"(?<=/)(sec|second)s?$", "s", re.sub(r"(?<=/)minute$", "min", plain))


_WRITTEN: dict[str, dict[str, str]] = {
    kind: {word: unit for unit, others in units.items() for word in (_plainly(unit), *others.split())}
    for kind, units in SPELLINGS.items()
}


def unit_of(text: str, kind: str) -> str:
    """The unit of a kind that a text writes (`N·m`, `kg`, `°C`); empty where it writes none."""
    return _WRITTEN[kind].get(_plainly(text), "")


def bracketed(heading: str) -> tuple[str, str]:
    """A heading without the brackets at its end, and what stands in them: `Thrust` and `kgf` of `Thrust (kgf)`.

    A number in brackets belongs to the name (`motor[0]`).
    """
    found = re.fullmatch(r"(.*\S)\s*[(\[{<]\s*([^()\[\]{}<>]*?)\s*[)\]}>]\s*", heading)
    if found is None or found[2].isdigit():
        return heading.strip(), ""
    return found[1].strip(), found[2]


def stated(name: str, kind: str) -> str:
    """The unit of a kind that the name of a column states in brackets, or in its last words; empty where none.

    `Voltage [mV]`, `battery_current_mA`, `temperature K`, `rpm`.
    """
    plain, unit = bracketed(name)
    if unit:
        return unit_of(unit, kind)
    words = [w for w in re.split(r"[^A-Za-z0-9%µμ°²/]+", plain) if w]
    for count in (3, 2, 1):
        if len(words) > count and (found := unit_of("".join(words[-count:]), kind)):
            return found
    last = re.fullmatch(r".*[a-z0-9]([munckd]?[A-Z])", words[-1]) if words else None
    return unit_of(last[1], kind) if last else ""


def converted(values: np.ndarray, kind: str, unit: str) -> np.ndarray:
    """Values of a kind in the contract's unit; without a unit as they are."""
    return values * UNITS[kind].get(unit, 1.0) + _ZEROS.get(unit, 0.0)


def read_table(path: Path, mapping: Mapping | None = None) -> Imported:
    """Every flight in a table, or the run of a stand; see `read_by_mapping`."""
    table, faults, axes = read_by_mapping(path, mapping)
    name = path.name.removesuffix(".gz").rsplit(".", 1)[0]
    stand, runs, cuts = bool(set(table) & {*c.FORCE, *c.MOMENT}), {name: table}, []
    if not stand:
        flying, apart = airborne(table)[0], _apart(table, faults)
        if apart.any() or not flying.all():
            runs, cuts = flights(table, flying, name, path, apart)
    channels = {} if mapping is None else mapping.channels
    speeds = channels.get("rotor_speed") or channels.get("rotor_command")
    unit = (speeds.unit if speeds else "") or "rad/s"
    return Imported(
        runs,
        (*faults, *cuts),
        axes,
        kind="stand" if stand else "flight",
        speed_unit="rpm" if unit in ELECTRICAL else unit,  # they are turns of the rotor by now
        unsigned_torque="torque" in channels,
    )


def _apart(table: pd.DataFrame, faults: Sequence[ImportFault]) -> np.ndarray:
    """Rows, (n,), that begin anew after a clock that was set back: no run goes on over them."""
    steps_s = np.diff(table[c.TIME].to_numpy(float), prepend=table[c.TIME].iloc[0])
    set_back = any(fault.kind == SET_BACK for fault in faults)
    return set_back & (steps_s > 0.5 * LATE_STEPS * np.median(steps_s[1:]))


IMPORTER = Importer(
    "table",
    "any table (CSV, Parquet)",
    read_table,
    "by a mapping file; lines above the heading (Motive, QTM), a heading of several lines, and a last line that is cut "
    "off are left out and named",
    starts=(b"\x1f\x8b", b"PAR1"),
    known_by="text that is no other format's, or first bytes",
    by_mapping=True,
)
"""A text that no other importer knows is read by it, too."""
