"""Units of foreign tables: their factors to the contract's units, and how headings and names of columns write them."""

from __future__ import annotations

import re

import numpy as np

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
    "angle": {"rad": 1.0, "deg": np.pi / 180, "mrad": 1e-3, "cdeg": np.pi / 18000},
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
_ZEROS = {"degF": -32 * 5 / 9, "K": -273.15}
"""What a reading of 0 is in the contract's unit, where that is not 0."""
SPELLINGS: dict[str, dict[str, str]] = {
    "time": {"s": "sec secs second seconds", "ms": "msec millis millisecond milliseconds",
             "us": "usec micros microsecond microseconds", "ns": "nsec nanos nanosecond nanoseconds"},
    "length": {"m": "meter meters metre metres", "cm": "centimeter centimeters", "mm": "millimeter millimeters",
               "ft": "foot feet"},
    "velocity": {"m/s": "ms mps ms1", "cm/s": "cms cmps", "mm/s": "mms mmps"},
    "rate": {"rad/s": "rads radps rads1", "deg/s": "degs dps degps degrees/s degree/s degs1", "mrad/s": "mrads mradps"},
    "angle": {"rad": "radian radians", "deg": "degree degrees", "mrad": "", "cdeg": "centideg centidegrees"},
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
