"""Names of the columns of a run, as the recording contract fixes them."""

from __future__ import annotations

import re

TIME = "time_s"
POSITION = tuple(f"position_{a}_m" for a in "xyz")
VELOCITY = tuple(f"velocity_{a}_m_s" for a in "xyz")
QUATERNION = tuple(f"quaternion_{a}" for a in "wxyz")
ANGULAR_VELOCITY = tuple(f"angular_velocity_{a}_rad_s" for a in "xyz")
SPECIFIC_FORCE = tuple(f"specific_force_{a}_m_s2" for a in "xyz")
FORCE = tuple(f"force_{a}_n" for a in "xyz")
MOMENT = tuple(f"moment_{a}_n_m" for a in "xyz")
REFERENCE_FORCE = tuple(f"reference_force_{a}_n" for a in "xyz")
HEIGHT = "height_m"
BATTERY_VOLTAGE = "battery_voltage_v"
BATTERY_CURRENT = "battery_current_a"
TEMPERATURE = "temperature_c"
MOUNT = ("roll_rad", "pitch_rad")
REFERENCE_OF = dict(zip(FORCE, REFERENCE_FORCE, strict=True))
"""To a force that a bench reads the known one."""

PER_ROTOR = {
    "rotor_speed": re.compile(r"rotor_speed_(0|[1-9]\d*)_rad_s"),
    "rotor_command": re.compile(r"rotor_command_(0|[1-9]\d*)_rad_s"),
    "throttle": re.compile(r"throttle_(0|[1-9]\d*)"),
}
_SEVERAL = (POSITION, VELOCITY, QUATERNION, ANGULAR_VELOCITY, SPECIFIC_FORCE, FORCE, MOMENT, REFERENCE_FORCE, MOUNT)
FIXED = frozenset((TIME, HEIGHT, BATTERY_VOLTAGE, BATTERY_CURRENT, TEMPERATURE)).union(*_SEVERAL)


def rotor_columns(kind: str, count: int) -> tuple[str, ...]:
    """Columns of `rotor_speed`, `rotor_command` or `throttle` for rotors 1 to `count`."""
    suffix = "" if kind == "throttle" else "_rad_s"
    return tuple(f"{kind}_{i}{suffix}" for i in range(1, count + 1))


def rotor_number(column: str) -> tuple[str, int] | None:
    """Kind and rotor number of a per-rotor column, None for any other column."""
    for kind, pattern in PER_ROTOR.items():
        match = pattern.fullmatch(column)
        if match:
            return kind, int(match.group(1))
    return None


def is_known(column: str) -> bool:
    """Whether the contract gives this column a meaning; any other is kept as a regime variable."""
    return column in FIXED or rotor_number(column) is not None


_UNIT_SUFFIXES = {
    "_rad_s2": "rad/s²",
    "_rad_s": "rad/s",
    "_m_s2": "m/s²",
    "_m_s": "m/s",
    "_n_m": "N m",
    "_rad": "rad",
    "_hz": "Hz",
    "_n": "N",
    "_m": "m",
    "_s": "s",
    "_v": "V",
    "_a": "A",
    "_c": "°C",
}
"""How a column's name ends, and its unit for people; of two that fit the first is meant."""


def unit_suffix(column: str) -> str:
    """The unit as a column's name writes it, `_m_s2`; empty for pure numbers."""
    return next((suffix for suffix in _UNIT_SUFFIXES if column.endswith(suffix)), "")


def unit_of(column: str) -> str:
    """Unit written in the column's name, for people; empty for pure numbers."""
    return _UNIT_SUFFIXES.get(unit_suffix(column), "")
