"""The sealed answers' parameters in the catalogue's own symbols: two authors named them apart.

Only what is the same quantity is translated; a truth without a counterpart is not held against an interval.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

AIR_DENSITY_KG_M3 = 1.225
"""Of the air that the concealed recordings were flown in."""
RENAMED = {
    ("flapping_moment", "k_f"): "k_flap",
    ("motor_lag", "up"): "tau_up",
    ("motor_lag", "down"): "tau_down",
    ("payload", "mass"): "m_p",
    ("payload", "length"): "L",
    ("accelerometer_error", "S_xx"): "s_x",
    ("accelerometer_error", "S_yy"): "s_y",
    ("accelerometer_error", "S_zz"): "s_z",
}


def translated(effect: str, parameters: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """`symbol`, `value`, `unit` of every parameter, in the catalogue's spelling where it has one."""
    values = {p["symbol"]: p["value"] for p in parameters}
    out = [{**p, "symbol": RENAMED.get((effect, p["symbol"]), p["symbol"])} for p in parameters]
    if effect == "motor_lag" and values.get("tau_up") is not None and values["tau_up"] == values.get("tau_down"):
        out.append({"symbol": "tau", "value": values["tau_up"], "unit": "s"})
    if effect == "frame_drag":
        areas = [values.get(f"CdA_{axis}") for axis in "xyz"]
        if all(isinstance(a, (int, float)) for a in areas):
            half = 0.5 * AIR_DENSITY_KG_M3
            unit = "N s2/m2"
            for axis, area in zip("xyz", areas, strict=True):
                out.append({"symbol": f"c_{axis}", "value": half * area, "unit": unit})
            if areas[0] == areas[1] == areas[2]:
                out.append({"symbol": "c", "value": half * areas[0], "unit": unit})
    if effect == "payload" and isinstance(values.get("mass"), (int, float)):
        out += [
            {"symbol": f"m_p {axis}", "value": values["mass"] * values[f"r_{axis}"], "unit": "kg m"}
            for axis in "xy"
            if isinstance(values.get(f"r_{axis}"), (int, float))
        ]
    return out
