"""What the names of a table's columns say: families (`ang_vel_x`, `_y`, `_z`), the quantity, units, axes.

A name is cut into words (`gyroADC[0]` is gyro, adc, 0), a unit at its end is set aside (`_deg_s`), then words that only
qualify it (`body`, `raw`); what ends in an axis or a number is a member of a family, and the rest is its stem.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

_UNIT_WORDS: dict[str, str] = {
    "m_s_s": "m/s2",
    "m_s2": "m/s2", "m_s_2": "m/s2", "m_s^2": "m/s2", "ms2": "m/s2", "mps2": "m/s2", "mg": "mg", "g": "g",
    "cm_s2": "cm/s2", "cm_s^2": "cm/s2", "mm_s2": "mm/s2", "mm_s^2": "mm/s2", "ft_s2": "ft/s2", "ft_s^2": "ft/s2",
    "m_s": "m/s", "mps": "m/s", "cm_s": "cm/s", "mm_s": "mm/s",
    "rad_s": "rad/s", "rads": "rad/s", "radps": "rad/s", "deg_s": "deg/s", "dps": "deg/s", "degps": "deg/s",
    "mrad_s": "mrad/s", "mrad": "mrad", "cdeg": "cdeg", "ddeg": "ddeg",
    "rad": "rad", "deg": "deg", "m": "m", "cm": "cm", "mm": "mm", "ft": "ft", "rpm": "rpm", "krpm": "krpm", "hz": "hz",
    "erpm": "erpm", "kgf": "kgf", "gf": "gf", "lbf": "lbf", "n_m": "N.m", "nm": "N.m", "m_nm": "mN.m", "mn_m": "mN.m",
}  # fmt: skip
"""Words of a unit at the end of a name to the mapping's unit."""
_SIGNS = str.maketrans({"°": "deg", "º": "deg", "²": "2"})
"""Signs of units as the letters that `_UNIT_WORDS` has: `m/s²` without its last one is a velocity's."""
_QUALIFIERS = frozenset(
    "adc b body bodyframe w world i inertial n frd flu ned enu nwu imu raw smooth smoothed filt filtered est estimate "
    "lin linear meas measured 0".split()
)
"""Words at the end of a stem that do not change what it is."""
_AFTER_NUMBERS = frozenset("us usec pwm dshot pct percent raw".split())
"""Words that may stand behind the number of a rotor (`m1_us`, `servo1_raw`)."""
_IN_BODY = frozenset(("b", "body", "bodyframe", "frd", "flu"))
_SOURCES = frozenset("state estimate est ekf odom odometry vicon mocap imu drone quad uav vehicle px4 mavros".split())
"""Words at the beginning of a stem that say where a value comes from."""
OTHER_THINGS = frozenset(
    "bias offset std sigma var variance cov covariance err error innov innovation sp setpoint ref reference des "
    "desired cmd command target mag magnetometer thrust torque moment wind jerk alpha dot residual".split()
)
"""Words in a name of three columns that make it no measurement of motion."""
_WISHED = frozenset("sp setpoint ref reference des desired cmd command commanded target".split())

TRIPLES: dict[str, tuple[frozenset[str], frozenset[str]]] = {
    "specific_force": (
        frozenset("acc accel acceleration accelerometer specific_force lin_acc linear_acceleration".split()),
        frozenset("a f".split()),
    ),
    "angular_velocity": (
        frozenset(
            "gyro gyr gyroscope omega angular_velocity ang_vel angvel angular_rate rate rates body_rates".split()
        ),
        frozenset("w".split()),
    ),
    "position": (frozenset("pos position".split()), frozenset(("p", ""))),
    "velocity": (frozenset("vel velocity".split()), frozenset("v".split())),
    "force": (frozenset(("force",)), frozenset(("f",))),
    "moment": (frozenset("moment torque".split()), frozenset("m t tau".split())),
}
"""To a quantity the words that a stem may end in, and those that must be the whole of it."""
_ROTORS: dict[str, frozenset[str]] = {
    "rotor_speed": frozenset(
        "rpm krpm erpm omega w rotor_speed rotor_speeds motor_speed motor_speeds mot_speed prop_speed rotor_vel "
        "motor_vel rotor_velocity motor_velocity".split()
    ),
    "rotor_command": frozenset("rotor_command rotor_commands".split()),
    "throttle": frozenset(
        "motor motors throttle throttles pwm m mot output outputs thr control u act actuator actuators servo "
        "rcou_c".split()
    ),
}  # fmt: skip
_QUATERNION = frozenset("q quat quaternion att_q attitude_q orientation rotation".split())
_ANGLES = ({"roll", "phi"}, {"pitch", "theta"}, {"yaw", "psi", "heading"})
_THREE_ANGLES = frozenset("attitude att euler angle angles rpy attitude_angles euler_angles".split())
"""Stems of roll, pitch and yaw that are numbered in this order."""
_TURNING = frozenset("rate rates speed vel gyro gyr omega".split())
"""Words that make a name of an angle one of a body rate."""
_SCALARS: dict[str, tuple[str, ...]] = {
    "time": (
        r"%?t([ _(\[]*([munµ]?s)[)\]]?)?", r"[%_]*time(stamp)?([ _(\[].*)?", r"time_.*", r".*timestamp.*", r"elapsed.*",
        r"(date|utc)[ _]?time.*", r"(.*[._/])?stamp(\b.*)?", r"sec(ond)?s?", r".*time([um]s)?([ _(\[].*)?",
    ),
    "battery_voltage": (r"v_?bat(t|tery)?.*", r"batt?(ery)?_?v(olt(age)?)?.*", r"volt(age)?.*", r"u_?bat.*"),
    "battery_current": (
        r"amperage.*", r"curr(ent)?\b.*", r"current.*", r"i_?bat.*", r"battery_?current.*", r"amps?\b.*",
    ),
    "height": (r"height.*", r"agl.*", r"range.*"),
    "temperature": (r"temp(erature)?.*",),
    "thrust": (r"thrust([ _(\[,/].*)?", r".*[ _]thrust([ _(\[,/].*)?", r"load( cell)?([ _(\[,/].*)?"),
    "torque": (r"torque([ _(\[,/].*)?", r".*[ _]torque([ _(\[,/].*)?"),
    "rotor_speed": (
        r"(rotor|motor|prop\w*)?[ _]?(speed|e?rpm|omega)([ _(\[,/].*)?",
        r".*[ _(\[]e?rpm.*",
        r".*rotation.*speed.*",
    ),
    "throttle": (r"(throttle|esc|pwm|motor command)([ _(\[,/].*)?",),
}  # fmt: skip
_MAVLINK = "xyz of MAVLink"
_VICON_PLACE = "t"
AXES = ("xyz", "012", "123", "ned", "enu")
FOURS = ("wxyz", "0123", "1234")


@dataclass(frozen=True)
class Family:
    """Columns of one stem, in the order of their axes."""

    stem: str
    columns: tuple[str, ...]
    axes: str
    """`xyz`, `ned`, `wxyz`, … or the numbers of the members."""
    unit: str
    """The mapping's unit that the names state, empty where they state none."""
    words: frozenset[str]

    @classmethod
    def of(cls, stem: str, members: Iterable[tuple[str, str]], axes: str, words: Iterable[str]) -> Family:
        """Of columns with the unit that each states: the family states a unit where all state the same."""
        columns, units = zip(*members, strict=True)
        return cls(stem, columns, axes, units[0] if len(set(units)) == 1 else "", frozenset(words))

    @property
    def in_body(self) -> bool:
        """Whether a word of the names says body axes."""
        return bool(self.words & _IN_BODY)


def words_of(name: str) -> list[str]:
    """The words of a name in small letters."""
    parted = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", str(name).replace("eRPM", "erpm"))
    return [w for w in re.split(r"[^a-z0-9^µ]+", parted.translate(_SIGNS).lower()) if w]


def _without_unit(words: list[str]) -> tuple[list[str], str]:
    for count in (3, 2, 1):
        ending = "_".join(words[-count:])
        if len(words) > count and ending in _UNIT_WORDS:
            return words[:-count], _UNIT_WORDS[ending]
    return words, ""


def unit_of(name: str) -> str:
    """The mapping's unit that the end of a name states; empty where it states none."""
    return _without_unit(words_of(name))[1]


def _member(name: str, axes: str) -> tuple[str, str, str, frozenset[str]] | None:
    """Stem, axis, stated unit and words of a name as a member of a family with `axes`; None where it is none."""
    words, unit = _without_unit(words_of(name))
    ends = words
    while axes.isalpha() and len(ends) > 1 and ends[-1] in _QUALIFIERS and ends[-1] not in axes:
        ends = ends[:-1]
    if not ends or ends[-1][-1] not in axes:
        return None
    last_word, axis = ends[-1][:-1], ends[-1][-1]
    last_word = "" if axis.isdigit() and last_word == "0" else last_word  # `gyro.02`
    if axis.isdigit() and last_word[-1:].isdigit():
        return None  # of a longer number
    stem = [*ends[:-1], *([last_word] if last_word else [])]
    stem, more = _without_unit(stem) if len(stem) > 1 else (stem, "")
    kept = stem
    while len(kept) > 1 and kept[-1] in _QUALIFIERS:
        kept = kept[:-1]
    while kept and kept[0] in _SOURCES:
        kept = kept[1:]
    return "_".join(kept), axis, unit or more, frozenset(words) | frozenset(stem)


def families(names: Iterable[str], axes: str) -> list[Family]:
    """Every family of the names whose members end in the axes, one each."""
    names = list(names)
    found: dict[tuple[str, frozenset[str]], dict[str, tuple[str, str]]] = {}
    for name in names:
        if (member := _member(name, axes)) is None:
            continue
        stem, axis, unit, words = member
        key = stem, frozenset(w for w in words if w in _QUALIFIERS and w not in axes and not w.isdigit())
        found.setdefault(key, {}).setdefault(axis, (name, unit))
    result = []
    for (stem, qualifiers), members in found.items():
        if set(members) == set(axes):
            result.append(Family.of(stem, (members[a] for a in axes), axes, {*stem.split("_"), *qualifiers}))
    return sorted(result, key=lambda f: names.index(f.columns[0]))


def numbered(names: Iterable[str]) -> list[Family]:
    """Families of three to sixteen columns numbered in one go from 0 or 1 (`u0`, `motor[1]`, `rotor_1_speed`)."""
    found: dict[str, dict[int, tuple[str, str]]] = {}
    for name in names:
        words, unit = _without_unit(words_of(name.replace("(/100)", "")))
        unit = "100erpm" if "(/100)" in name else unit
        if words and words[-1] in _AFTER_NUMBERS and len(words) > 1 and re.search(r"\d$", words[-2]):
            words = words[:-1]
        match = re.fullmatch(r"(.*?)(?:_m)?_?(\d{1,2})(_[a-z]+)?", "_".join(words))
        if match:
            stem = (match[1] + (match[3] or "")).strip("_") or "m"
            found.setdefault(stem, {}).setdefault(int(match.group(2)), (name, unit))
    result = []
    for stem, members in found.items():
        count, order = len(members), sorted(members)
        if 3 <= count <= 16 and order in (list(range(count)), list(range(1, count + 1))):
            result.append(Family.of(stem, (members[k] for k in order), "number", stem.split("_")))
    return result


def of_mavlink(names: Iterable[str]) -> list[Family]:
    """Accelerometers and gyroscopes as MAVLink's messages name them: `RAW_IMU.xacc`, `SCALED_IMU2.ygyro`."""
    found: dict[tuple[str, ...], dict[str, str]] = {}
    for name in names:
        *before, last = words_of(name) or [""]
        if last[:1] in ("x", "y", "z") and last[1:] in ("acc", "gyro"):
            found.setdefault((*before, last[1:]), {})[last[0]] = name
    return [
        Family(words[-1], tuple(members[a] for a in "xyz"), _MAVLINK, "", frozenset(words))
        for words, members in found.items()
        if set(members) == set("xyz")
    ]


def body_rates(names: Iterable[str]) -> list[Family]:
    """Body rates named by letters or by angles: `p`, `q`, `r`; `rollspeed` of MAVLink's `ATTITUDE`; `roll_rate_dps`."""
    found: dict[int, tuple[str, str]] = {}
    for name in names:
        words, unit = _without_unit(words_of(name))
        last = "_".join(words[-2:])
        for axis, (letter, meant) in enumerate(zip("pqr", _ANGLES, strict=True)):
            called = {letter, *(f"{m}{sign}{w}" for m in meant for w in _TURNING for sign in ("", "_"))}
            called |= {f"{w}_{m}" for m in meant for w in _TURNING}
            if {last, *words[-1:]} & called and not {*words} & OTHER_THINGS:
                unit = "rad/s" if last.endswith("speed") else {"rad": "rad/s", "deg": "deg/s"}.get(unit, unit)
                found.setdefault(axis, (name, unit))
    if len(found) < 3:
        return []
    return [Family.of("omega", (found[axis] for axis in range(3)), "xyz", ["omega"])]


def _ends_in(stem: str, words: frozenset[str]) -> bool:
    return any(stem == w or stem.endswith(f"_{w}") for w in words)


def is_named(family: Family, quantity: str) -> bool:
    """Whether three columns are named as a quantity of motion; `ang_vel` is no velocity, `acc_bias` no acceleration."""
    if family.stem == _VICON_PLACE and family.unit in ("m", "cm", "mm"):
        return quantity == "position"
    endings, whole = TRIPLES[quantity]
    if family.words & OTHER_THINGS - endings or family.axes in ("012", "123") and family.stem == "":
        return False
    if quantity != "angular_velocity" and family.words & {"ang", "angular", "rot", "rotational"}:
        return False
    return _ends_in(family.stem, endings) or family.stem in whole


def is_rotor(family: Family, quantity: str) -> bool:
    """Whether numbered columns are named as speeds, commanded speeds or throttles of rotors."""
    stem, wished = family.stem, bool(family.words & _WISHED)
    rest = "_".join(w for w in stem.split("_") if w not in _WISHED)
    if quantity == "rotor_command":
        return _ends_in(stem, _ROTORS[quantity]) or wished and _ends_in(rest, _ROTORS["rotor_speed"])
    if quantity == "rotor_speed":
        if wished or family.unit in ("rpm", "krpm", "erpm", "100erpm"):
            return not wished
        if family.unit in ("rad/s", "hz"):
            return _ends_in(stem, _ROTORS[quantity] | _ROTORS["throttle"])
    return _ends_in(rest, _ROTORS[quantity])


def is_quaternion(family: Family) -> bool:
    return not family.words & OTHER_THINGS and _ends_in(family.stem, _QUATERNION)


def angles(names: Sequence[str]) -> tuple[tuple[str, str, str], str] | None:
    """Roll, pitch and yaw by their names or numbers, and the unit that these state."""
    names = list(names)
    for family in (f for axes in ("012", "123") for f in families(names, axes)):
        longer = any(family.stem == f.stem and len(f.columns) > 3 for f in numbered(names))
        if family.stem in _THREE_ANGLES and not longer and not family.words & (OTHER_THINGS | _TURNING):
            return family.columns, family.unit
    found = []
    for meant in _ANGLES:
        for name in names:
            words, unit = _without_unit(words_of(name))
            other = frozenset(words) & (OTHER_THINGS | _TURNING) or unit.endswith("/s")
            if words and words[-1] in meant and not other:
                found.append((name, unit))
                break
        else:
            return None
    family = Family.of("", found, "xyz", [])
    return family.columns, family.unit


def rotation_vector(names: Sequence[str]) -> tuple[tuple[str, ...], str] | None:
    """Vicon's `RX`, `RY`, `RZ` next to a place `TX`, `TY`, `TZ`, and the unit that they state."""
    by_stem = {family.stem: family for family in families(names, "xyz")}
    turn = by_stem.get("r") if _VICON_PLACE in by_stem else None
    return turn and (turn.columns, turn.unit)


def scalar(names: Iterable[str], quantity: str) -> str | None:
    """The first column whose name is that of a scalar quantity, by the pattern that is most its own.

    Of a battery the name of its message may stand before a point (`pm.vbat`, `BAT.Volt`).
    """
    for pattern in _SCALARS[quantity]:
        for name in names:
            plain = str(name).lower()
            if re.fullmatch(pattern, plain.rsplit(".", 1)[-1] if quantity.startswith("battery") else plain):
                return name
    return None


def time_unit(name: str) -> str:
    """The unit of a clock that its name states; empty where it states none."""
    for unit, meant in (("ns", ("ns",)), ("us", ("us", "µs", "micro")), ("ms", ("ms", "milli")), ("s", ("s", "sec"))):
        if any(re.search(rf"(^|[_( \[]){w}([\W_]|$)", str(name).lower()) for w in meant):
            return unit
    return ""
