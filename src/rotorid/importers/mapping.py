"""Any table (CSV or Parquet) as a run, by a mapping file that says what its columns are.

A mapping names columns, units and frames::

    body: flu              # frd | flu            axes of accelerometer, gyroscope and attitude
    world: enu             # ned | enu | nwu      axes of position and velocity, and what the attitude refers to
    channels:
      time: {columns: [t], unit: us}
      specific_force: {columns: [ax, ay, az], unit: g}
      attitude: {columns: [qx, qy, qz, qw], form: xyzw}       # wxyz | xyzw | euler (roll, pitch, yaw)
      velocity: {columns: [vx, vy, vz], unit: m/s, axes: body}  # world (default) | body
      throttle: {columns: [m1, m2, m3, m4], unit: us, range: [1000, 2000]}
    keep: [wind_sensor]    # other columns, kept under their own names

`guess` proposes such a mapping from the names of the columns and from what stands in them.
"""

from __future__ import annotations

import re
from difflib import get_close_matches
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd
import yaml
from pydantic import BaseModel, ConfigDict, ValidationError
from scipy.spatial.transform import Rotation

from rotorid.errors import InputError
from rotorid.importers.clean import drop_repeated_times, report_gaps
from rotorid.importers.frames import continuous
from rotorid.importers.report import Fault
from rotorid.recordings import columns as c
from rotorid.recordings.tables import clock_jump, numbers, read_cells, read_parquet_cells
from rotorid.text_files import read_yaml
from rotorid.wording import explain

G = 9.80665
UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "ft": 0.3048},
    "velocity": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3},
    "rate": {"rad/s": 1.0, "deg/s": np.pi / 180},
    "angle": {"rad": 1.0, "deg": np.pi / 180},
    "acceleration": {"m/s2": 1.0, "g": G, "mg": G / 1000},
    "rotor": {"rad/s": 1.0, "rpm": np.pi / 30, "hz": 2 * np.pi},
    "share": {"1": 1.0, "%": 0.01, "us": 1.0, "raw": 1.0},
    "voltage": {"V": 1.0, "mV": 1e-3, "cV": 1e-2, "dV": 0.1},
    "current": {"A": 1.0, "mA": 1e-3, "cA": 1e-2},
    "temperature": {"degC": 1.0},
}
CHANNELS: dict[str, tuple[str, tuple[str, ...]]] = {
    "time": ("time", (c.TIME,)),
    "position": ("length", c.POSITION),
    "velocity": ("velocity", c.VELOCITY),
    "attitude": ("angle", c.QUATERNION),
    "angular_velocity": ("rate", c.ANGULAR_VELOCITY),
    "specific_force": ("acceleration", c.SPECIFIC_FORCE),
    "rotor_speed": ("rotor", ()),
    "rotor_command": ("rotor", ()),
    "throttle": ("share", ()),
    "height": ("length", (c.HEIGHT,)),
    "battery_voltage": ("voltage", (c.BATTERY_VOLTAGE,)),
    "battery_current": ("current", (c.BATTERY_CURRENT,)),
    "temperature": ("temperature", (c.TEMPERATURE,)),
}
"""Channels of a mapping: kind of unit and columns of the contract (none: one a rotor)."""
BODY = {"frd": np.eye(3), "flu": np.diag([1.0, -1.0, -1.0])}
"""Body axes as columns in forward-right-down."""
WORLD = {
    "ned": np.eye(3),
    "nwu": np.diag([1.0, -1.0, -1.0]),
    "enu": np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]),
}
"""World axes as columns in north-east-down."""


class Channel(BaseModel):
    """Columns that make one channel."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    columns: tuple[str, ...]
    unit: str = ""
    form: Literal["wxyz", "xyzw", "euler"] = "wxyz"
    """Attitude only."""
    axes: Literal["world", "body"] = "world"
    """Velocity only."""
    range: tuple[float, float] | None = None
    """Throttle only: readings of no and of full throttle."""


class Mapping(BaseModel):
    """What the columns of a table are."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    body: Literal["frd", "flu"] = "frd"
    world: Literal["ned", "enu", "nwu"] = "ned"
    channels: dict[str, Channel]
    keep: tuple[str, ...] = ()


def read_mapping(path: Path) -> Mapping:
    """A mapping file; InputError names what does not fit."""
    try:
        mapping = Mapping.model_validate(read_yaml(Path(path)))
    except ValidationError as error:
        raise InputError(f"{path}: {explain(error, Mapping)}") from None
    for name, channel in mapping.channels.items():
        if name not in CHANNELS:
            raise InputError(f"{path}: channels: {name}: no such channel{_near(name, CHANNELS)}")
        known = UNITS[CHANNELS[name][0]]
        if channel.unit and channel.unit not in known:
            raise InputError(f"{path}: {name}: unit {channel.unit!r}, expected one of {', '.join(known)}")
        wanted = len(CHANNELS[name][1])
        if name == "attitude":
            wanted = 3 if channel.form == "euler" else 4
        if wanted and len(channel.columns) != wanted:
            raise InputError(f"{path}: {name}: {len(channel.columns)} columns, expected {wanted}")
    if "time" not in mapping.channels:
        raise InputError(f"{path}: channels: time is missing")
    return mapping


def _near(name: str, names) -> str:
    near = get_close_matches(name, list(names), 1, 0.5)
    return f"; did you mean {near[0]}?" if near else f"; there are: {', '.join(names)}"


def read_columns(path: Path) -> pd.DataFrame:
    """The cells of a CSV or Parquet file, numbers or text; InputError where it is no table."""
    path = Path(path)
    table = read_parquet_cells(path) if path.name.endswith(".parquet") else read_cells(path, foreign=True)
    if len(table.columns) < 2 or len(table) < 2:
        raise InputError(
            f"{path}: expected a table of numbers with a heading, found {len(table.columns)} columns and "
            f"{len(table)} rows"
        )
    return table


def read_by_mapping(path: Path, mapping: Mapping | None) -> tuple[pd.DataFrame, list[Fault], str]:
    """A table in contract columns, its faults and its axes in words.

    Without a mapping the columns must have the contract's names; InputError says how to get a mapping.
    """
    raw = read_columns(path)
    if mapping is None:
        if c.TIME in raw.columns and sum(c.is_known(n) for n in raw.columns) > 1:
            return *_clocked(numbers(raw, path), path), "the contract's: the columns have its names"
        raise InputError(
            f"{path}: the columns ({', '.join(raw.columns[:6])}, …) are not named as the recording contract has them; "
            f"`rotorid import {path.name} --write-mapping mapping.yaml` proposes what each one is"
        )
    table, faults = convert(raw, mapping, str(path))
    return table, faults, f"body {mapping.body.upper()}, world {mapping.world.upper()}, turned into FRD and NED"


def convert(raw: pd.DataFrame, mapping: Mapping, where: str) -> tuple[pd.DataFrame, list[Fault]]:
    """Contract columns of a table by a mapping; InputError names a column that is not there or no numbers."""
    body, world = BODY[mapping.body], WORLD[mapping.world]
    out: dict[str, np.ndarray] = {}
    rotation = None
    order = sorted(mapping.channels, key=lambda n: n != "attitude")
    for name in order:
        channel = mapping.channels[name]
        values = _numbers(raw, channel.columns, name, where)
        kind, columns = CHANNELS[name]
        if name == "throttle" and channel.range is not None:
            low, high = channel.range
            values = np.clip((values - low) / (high - low), 0, 1)
        elif not (name == "attitude" and channel.form != "euler"):
            values = values * UNITS[kind].get(channel.unit, 1.0)
        if name == "attitude":
            rotation, values = _attitude(values, channel.form, body, world)
        elif name in ("angular_velocity", "specific_force"):
            values = values @ body.T
        elif name == "position":
            values = values @ world.T
        elif name == "velocity" and channel.axes == "world":
            values = values @ world.T
        elif name == "velocity":
            if rotation is None:
                raise InputError(f"{where}: velocity in body axes needs an attitude to be turned into the world")
            known = np.isfinite(values).all(axis=1) & np.isfinite(rotation).all(axis=1)
            turned = np.full_like(values, np.nan)
            turn = Rotation.from_quat(rotation[known][:, [1, 2, 3, 0]])
            turned[known] = turn.apply(values[known] @ body.T)
            values = turned
        if not columns:
            columns = c.rotor_columns(name, len(channel.columns))
        out.update(zip(columns, values.T, strict=True))
    for name in mapping.keep:
        out[name] = _numbers(raw, (name,), "keep", where)[:, 0]
    out[c.TIME] = out[c.TIME] - np.nanmin(out[c.TIME])
    return _clocked(pd.DataFrame({c.TIME: out.pop(c.TIME), **out}), where)


def _clocked(table: pd.DataFrame, where: object) -> tuple[pd.DataFrame, list[Fault]]:
    """The rows that move the clock on, and what is wrong with the others; InputError where the clock was set."""
    known = table[c.TIME].notna().to_numpy()
    if known.all() and (jumped := clock_jump(table[c.TIME].to_numpy(float), str(where))):
        raise InputError(jumped)
    table, faults = drop_repeated_times(table)
    if len(table) < 2:
        raise InputError(f"{where}: {c.TIME} moves on in {len(table)} of {len(known)} rows, expected at least two")
    return table, faults + report_gaps(table)


def _numbers(raw: pd.DataFrame, columns, channel: str, where: str) -> np.ndarray:
    for name in columns:
        if name not in raw.columns:
            raise InputError(f"{where}: {channel} wants column {name!r}, which is not there{_near(name, raw.columns)}")
    return numbers(raw[list(dict.fromkeys(columns))], where)[list(columns)].to_numpy(float)


def _attitude(values: np.ndarray, form: str, body: np.ndarray, world: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Quaternions (n, 4), scalar first, FRD to NED; NaN where a value is missing. Twice, as `convert` takes it."""
    out = np.full((len(values), 4), np.nan)
    known = np.isfinite(values).all(axis=1)
    if form == "euler":
        turn = Rotation.from_euler("ZYX", values[known][:, [2, 1, 0]])
    else:
        known &= np.linalg.norm(np.nan_to_num(values), axis=1) > 0
        turn = Rotation.from_quat(values[known] if form == "xyzw" else values[known][:, [1, 2, 3, 0]])
    turn = Rotation.from_matrix(world) * turn * Rotation.from_matrix(body).inv()
    out[known] = continuous(turn.as_quat()[:, [3, 0, 1, 2]])
    return out, out


# Guessing -----------------------------------------------------------------------------------------

WISHED = r"(?:cmd|command(?:ed)?|ref(?:erence)?|desired|setpoint|target)"
TURNING = r"(?:rpm|mot(?:or)?_?speeds?|rotor_?speeds?)"
AXES3 = (("x", "y", "z"), ("0", "1", "2"), ("1", "2", "3"))
PATTERNS: dict[str, tuple[str, ...]] = {
    "specific_force": (r"acc(el(eration|erometer)?)?(smooth|_m_s2|_ms2)?", r"a", r"imu_acc.*", r"specific_force.*"),
    "angular_velocity": (r"gyro(adc|scope|_rad)?", r"omega", r"w", r"angular_velocity.*", r"rates?", r"body_rates?"),
    "position": (r"pos(ition)?", r"p", r""),
    "velocity": (r"vel(ocity)?", r"v"),
    "rotor_command": (
        rf"{WISHED}_?{TURNING}",
        rf"{TURNING}_?{WISHED}",
        r"rotor_?commands?",
    ),
    "rotor_speed": (r"rpm", r"erpm", r"motor_?rpm", r"rotor_?speeds?", r"mot(or)?_?speeds?"),
    "throttle": (r"motors?", r"throttles?", r"pwm", r"m", r"mot", r"outputs?", r"thr", r"control"),
}
SCALARS: dict[str, tuple[str, ...]] = {
    "time": (r"t([ _(\[]*([munµ]?s)[)\]]?)?", r"time(stamp)?([ _(\[].*)?", r"time_.*", r".*timestamp.*"),
    "battery_voltage": (r"v_?bat(t|tery)?.*", r"battery_?v(olt(age)?)?.*", r"volt(age)?.*", r"u_?bat.*"),
    "battery_current": (r"amperage.*", r"current.*", r"i_?bat.*", r"battery_?current.*"),
    "height": (r"height.*", r"agl.*", r"range.*"),
    "temperature": (r"temp(erature)?.*",),
}


def guess(table: pd.DataFrame) -> tuple[Mapping, list[str]]:
    """A mapping proposed from names and values, and a sentence for each choice that a person must look at.

    A column with a cell that is no number takes no part; the sentence names the cell.
    """
    table, doubts = _of_numbers(table)
    names = list(table.columns)
    channels: dict[str, Channel] = {}
    taken: set[str] = set()

    def add(channel: str, columns: list[str], **more) -> None:
        channels[channel] = Channel(columns=tuple(columns), **more)
        taken.update(columns)

    for channel, patterns in SCALARS.items():
        for pattern in patterns:
            found = next((n for n in names if n not in taken and re.fullmatch(pattern, n.lower())), None)
            if found:
                values = table[found].to_numpy(float)
                add(channel, [found], unit=_scalar_unit(channel, found, values))
                break
    quaternion = _family(names, taken, (r"q(uat(ernion)?)?",), ("w", "x", "y", "z"))
    counted = _family(names, taken, (r"q(uat(ernion)?)?",), ("0", "1", "2", "3"))
    euler = [_named(names, taken, words) for words in (("roll", "phi"), ("pitch", "theta"), ("yaw", "psi", "heading"))]
    if quaternion:
        add("attitude", quaternion, form="wxyz")
    elif counted:
        add("attitude", counted, form="wxyz")
        doubts.append("attitude: numbered quaternion taken as scalar first; write form: xyzw if it is last")
    elif all(euler):
        degrees = any(np.nanmax(np.abs(table[n])) > 7 for n in euler)
        add("attitude", euler, form="euler", unit="deg" if degrees else "rad")
    for channel in ("angular_velocity", "specific_force", "velocity", "position"):
        # Bare x, y, z are a position; whatever ends in 1, 2, 3 is not.
        stems = {axes: tuple(p for p in PATTERNS[channel] if p or axes[0] == "x") for axes in AXES3}
        found = next((f for axes in AXES3 if (f := _family(names, taken, stems[axes], axes))), None)
        if found:
            values = table[found].to_numpy(float)
            add(channel, found, unit=_vector_unit(channel, found, values, doubts))
    for channel in ("rotor_command", "rotor_speed", "throttle"):
        found = _rotors(names, taken, PATTERNS[channel])
        if found:
            values = table[found].to_numpy(float)
            add(channel, found, **_rotor_unit(channel, values, doubts))
    if "time" not in channels:
        doubts.insert(0, "time: no column recognised, and without one nothing can be imported; add it under channels")
    body, world = _frames(table, channels, doubts)
    rest = [n for n in names if n not in taken]
    return Mapping(body=body, world=world, channels=channels, keep=tuple(rest)), doubts


def _of_numbers(table: pd.DataFrame) -> tuple[pd.DataFrame, list[str]]:
    """The columns that hold numbers alone, and a sentence for each other one."""
    kept, doubts = {}, []
    for name in table.columns:
        try:
            kept[name] = numbers(table[[name]], "left out")[name]
        except InputError as error:
            doubts.append(str(error))
    return pd.DataFrame(kept), doubts


def _plain(name: str) -> str:
    return re.sub(r"[\s\[\]().]+", "_", name.lower()).strip("_")


def _family(names, taken, patterns, axes) -> list[str] | None:
    """Columns whose names are one stem with each of the axes at its end (or after a unit at its end)."""
    for pattern in patterns:
        found: dict[str, str] = {}
        for name in names:
            if name in taken:
                continue
            bare = re.sub(r"_(m_s2|m_s|rad_s|deg_s|m|g|rad|deg|mps|dps)$", "", _plain(name))
            match = re.fullmatch(rf"(?:.*_)?(?:{pattern})_?({'|'.join(axes)})", bare)
            if match:
                found.setdefault(match.group(match.lastindex), name)
        if set(found) == set(axes):
            return [found[a] for a in axes]
    return None


def _named(names, taken, words) -> str | None:
    return next((n for n in names if n not in taken and re.sub(r"_(rad|deg)$", "", _plain(n)) in words), None)


def _rotors(names, taken, patterns) -> list[str] | None:
    for pattern in patterns:
        found = {}
        for name in names:
            match = (
                re.fullmatch(rf"(?:{pattern})_?m?(\d)(?:_(?:rpm|us|rad_s))?", _plain(name)) if name not in taken else 0
            )
            if match:
                found.setdefault(int(match.group(match.lastindex)), name)
        numbers = sorted(found)
        if len(numbers) >= 3 and numbers == list(range(numbers[0], numbers[0] + len(numbers))) and numbers[0] in (0, 1):
            return [found[n] for n in numbers]
    return None


def _scalar_unit(channel: str, name: str, values: np.ndarray) -> str:
    middle = float(np.nanmedian(np.abs(values))) if np.isfinite(values).any() else 0.0
    if channel == "time":
        lower = name.lower()
        for unit, words in (("ns", ("ns",)), ("us", ("us", "micro")), ("ms", ("ms", "milli"))):
            if any(re.search(rf"(^|[_( \[]){w}", lower) for w in words):
                return unit
        step = float(np.nanmedian(np.diff(values)))
        return "s" if step < 0.5 else "ms" if step < 100 else "us" if step < 1e5 else "ns"
    if channel == "battery_voltage":
        return "V" if middle < 60 else "dV" if middle < 600 else "cV" if middle < 3000 else "mV"
    if channel == "battery_current":
        return "A" if middle < 200 else "cA" if middle < 2e4 else "mA"
    return {"height": "m", "temperature": "degC"}[channel]


def _vector_unit(channel: str, names, values: np.ndarray, doubts: list[str]) -> str:
    size = np.linalg.norm(values, axis=1)
    middle = float(np.nanmedian(size)) if np.isfinite(size).any() else 0.0
    if channel == "specific_force":
        if middle < 3:
            return "g"
        if middle < 50:
            return "m/s2"
        doubts.append(f"specific_force: a median of {middle:.4g} fits no unit known; taken as mg")
        return "mg"
    if channel == "angular_velocity":
        top = float(np.nanquantile(size, 0.99))
        doubts.append(f"angular_velocity: 99 % of the rates are below {top:.3g}")
        return "deg/s" if "deg" in " ".join(names).lower() or top > 25 else "rad/s"
    return "m" if channel == "position" else "m/s"


def _rotor_unit(channel: str, values: np.ndarray, doubts: list[str]) -> dict:
    top = float(np.nanquantile(values, 0.99)) if np.isfinite(values).any() else 0.0
    if channel in ("rotor_speed", "rotor_command"):
        unit = "rpm" if top > 3500 else "rad/s"
        doubts.append(f"{channel}: up to {top:.4g}, taken as {unit}")
        return {"unit": unit}
    if top <= 1.05:
        return {"unit": "1"}
    low, high = (0, 100) if top <= 105 else (1000, 2000) if top <= 2100 else (0, 65535)
    doubts.append(f"throttle: up to {top:.5g}, so no throttle is taken as {low} and full throttle as {high}")
    return {"unit": "raw", "range": (float(low), float(high))}


def _frames(table: pd.DataFrame, channels: dict[str, Channel], doubts: list[str]) -> tuple[str, str]:
    """Frames by the sign of the accelerometer's z in flight; a world that is most used with each."""
    if "specific_force" not in channels:
        doubts.append("body and world axes: without an accelerometer nothing tells them; taken as FRD and NED")
        return "frd", "ned"
    z = table[channels["specific_force"].columns[2]].median()
    body = "frd" if z < 0 else "flu"
    world = "ned" if body == "frd" else "enu"
    sign = "negative" if z < 0 else "positive"
    doubts.append(
        f"body axes: the accelerometer's z is {sign} in flight, so {body.upper()}; world axes taken as {world.upper()} "
        "(ned, enu or nwu): look at which column grows when flying north and when climbing"
    )
    return body, world


def as_text(mapping: Mapping, doubts: list[str], source: str) -> str:
    """A mapping file with the doubts as comments."""
    lines = [f"# What the columns of {source} are, proposed by rotorid. Look through it, then:"]
    lines += [f"#   rotorid import {source} --mapping THIS_FILE --mass-kg … --like …"]
    lines += ["# To look at:"] + [f"#  - {d}" for d in doubts] if doubts else []
    lines += [f"body: {mapping.body}   # frd | flu", f"world: {mapping.world}   # ned | enu | nwu", "channels:"]
    for name, channel in mapping.channels.items():
        content = {k: v for k, v in channel.model_dump(exclude_defaults=True).items()}
        if name == "attitude":
            content["form"] = channel.form
        content = {k: list(v) if isinstance(v, tuple) else v for k, v in content.items()}
        lines.append(
            f"  {name}: {yaml.safe_dump(content, default_flow_style=True, width=10**6, sort_keys=False).strip()}"
        )
    kept = yaml.safe_dump(list(mapping.keep), default_flow_style=True, width=10**6).strip()
    lines.append(f"keep: {kept}   # other columns, kept as candidates for what an error depends on")
    return "\n".join(lines) + "\n"
