"""Numbers and names as a pilot reads them: the words of the verdict and of its page."""

from __future__ import annotations

import math

from rotorid.effects.catalogue import catalogue
from rotorid.recordings.columns import unit_of, unit_suffix

WRENCH_WORDS = {
    "force_x": ("forward force", "force along x"),
    "force_y": ("sideways force", "force along y"),
    "force_z": ("vertical force", "force along z"),
    "moment_x": ("roll moment", "moment about x"),
    "moment_y": ("pitch moment", "moment about y"),
    "moment_z": ("yaw moment", "moment about z"),
}
"""Channels of force and moment in words: of a flight, and of a stand or bench."""
_SENSOR_WORDS = {
    "accelerometer": "accelerometer against the velocity along",
    "gyroscope": "gyroscope against the attitude about",
}
FORWARD_WORDS = {
    "position": "position after half a second",
    "velocity": "velocity after half a second",
    "attitude": "attitude after half a second",
    "angular_velocity": "body rates after half a second",
}
_REGIME_WORDS = {
    "vertical_speed_over_hover_inflow": ("speed of descent over hover inflow", ""),
    "rotor_speed_rad_s": ("mean rotor speed", "rad/s"),
    "rotor_acceleration_rad_s2": ("rate of the rotor speed", "rad/s²"),
    "voltage_v": ("battery voltage", "V"),
    "run": ("the run", ""),
    **{f"load_force_{axis}": (f"load along {axis}", "N") for axis in "xyz"},
    **{f"load_moment_{axis}": (f"moment of the load about {axis}", "N m") for axis in "xyz"},
    "roll_rad": ("roll of the mount", "rad"),
    "pitch_rad": ("pitch of the mount", "rad"),
}
"""Regime variables in words, with their unit; any other is named from its column."""
_MAGNITUDE_WORDS = {
    "forward_speed_m_s": "speed forwards or backwards",
    "sideward_speed_m_s": "speed to either side",
    "vertical_speed_over_hover_inflow": "speed of climb or descent over hover inflow",
    "rotor_acceleration_rad_s2": "rate of the rotor speed, up or down",
}
"""Magnitudes of regime variables in words; of any other, either sign is said."""
_PARAMETER_WORDS = {
    "mass_kg": ("mass", "kg"),
    "thrust_coefficient_n_s2": ("thrust coefficient", "N s²"),
    "torque_coefficient_n_m_s2": ("torque coefficient", "N m s²"),
    "inertia_xx_kg_m2": ("roll inertia", "kg m²"),
    "inertia_yy_kg_m2": ("pitch inertia", "kg m²"),
    "inertia_zz_kg_m2": ("yaw inertia", "kg m²"),
    "reading_gain": ("gain of the reading", ""),
    **{f"reading_gain_{axis}": (f"gain of the reading along {axis}", "") for axis in "xyz"},
    "arm_scale": ("scale of the rotors' distances", ""),
    "rotor_speed_limits_rad_s": ("rotor speed at full throttle", "rad/s"),
}


def channel_words(channel: str) -> str:
    """A channel's name for a person: `force_y` is the sideways force."""
    if channel in WRENCH_WORDS:
        return WRENCH_WORDS[channel][0]
    if channel in FORWARD_WORDS:
        return FORWARD_WORDS[channel]
    group, _, last = channel.rpartition("_")
    if group == "rotor_speed":
        return f"speed of rotor {last}"
    if group in _SENSOR_WORDS:
        return f"{_SENSOR_WORDS[group]} {last}"
    return channel.replace("_", " ")


def regime_words(variable: str, either_sign: bool = False) -> tuple[str, str]:
    """Name and unit of a regime variable, or of its magnitude."""
    if either_sign:
        name, unit = regime_words(variable)
        return _MAGNITUDE_WORDS.get(variable, f"{name}, either sign"), unit
    if variable in _REGIME_WORDS:
        return _REGIME_WORDS[variable]
    return variable.removesuffix(unit_suffix(variable)).replace("_", " "), unit_of(variable)


def parameter_words(name: str) -> tuple[str, str]:
    """Name and unit of a value of vehicle.yaml."""
    return _PARAMETER_WORDS[name] if name in _PARAMETER_WORDS else regime_words(name)


def effect_words(effect_id: str) -> str:
    """What a pilot calls an id, fits before "was left out"."""
    effect = catalogue().get(effect_id)
    return effect.name if effect else effect_id.replace("_", " ")


def name_words(name: str) -> str:
    """An id, or a value by its contract name, in words."""
    return f"the {_PARAMETER_WORDS[name][0]}" if name in _PARAMETER_WORDS else effect_words(name)


def number(value: float | None, digits: int = 2) -> str:
    """A number to so many significant digits: plain from 0.0001 to 99 999, else with an exponent."""
    if value is None or not math.isfinite(value):
        return "unknown"
    if value == 0:
        return "0"
    value = float(f"{value:.{digits - 1}e}")
    exponent = math.floor(math.log10(abs(value)))
    if -4 <= exponent < 5:
        return f"{value:.{max(digits - 1 - exponent, 0)}f}"
    return f"{value / 10.0**exponent:.{digits - 1}f}e{exponent}"


def plus_minus(value: float, low: float | None, high: float | None) -> str:
    """`5.1e-5 ± 0.2e-5`: half the interval to one digit (two below a 3), the value to the same place.

    An interval many times the value says that the recordings do not determine it.
    """
    if low is None or high is None or not all(map(math.isfinite, (value, low, high))) or high <= low:
        return number(value, 3)
    half = (high - low) / 2
    if half > 5 * max(abs(value), abs(low + high) / 2):
        return "not determined"
    place = math.floor(math.log10(half))
    if half / 10.0**place < 3:
        place -= 1
    exponent = math.floor(math.log10(max(abs(value), half)))
    if -3 <= exponent < 5:
        exponent = 0
    decimals = max(exponent - place, 0)
    tail = f"e{exponent}" if exponent else ""
    scale = 10.0**exponent
    return f"{value / scale:.{decimals}f}{tail} ± {half / scale:.{decimals}f}{tail}"


def percent_words(share: float) -> str:
    """A share as a percentage of two digits: `0.84 %`, `520 %`; below a thousandth of a percent `less than 0.001 %`."""
    if share < 1e-5:
        return "less than 0.001 %"
    return f"{100 * share:.2g} %" if share < 0.995 else f"{float(f'{100 * share:.2g}'):.0f} %"


def percent(probability: float) -> str:
    """A probability as a percentage, 99.9 at most."""
    return f"{min(99.9, 100 * probability):.3g} %"


def sure(p_value: float) -> str:
    """How sure a p-value makes one: never more than 99.9 %, which no model of noise deserves."""
    if p_value < 1e-3:
        return "more than 99.9 % sure"
    return f"{100 * (1 - p_value):.{1 if p_value < 0.1 else 0}f} % sure"


def listed(names: list[str], last: str = "and") -> str:
    """`a, b and c`."""
    if len(names) < 2:
        return "".join(names)
    return f"{', '.join(names[:-1])} {last} {names[-1]}"


def capital(text: str) -> str:
    """The text with its first letter raised."""
    return text[:1].upper() + text[1:]


TAKEN_UP = "without recorded rotor speeds it is one with the curve between throttle and thrust"
"""Why an effect is not looked for that on commands alone is that curve."""
