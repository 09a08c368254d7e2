"""A vehicle as a section of crazyflow's `params.toml`: its first-principles dynamics in JAX.

Body forward-left-up, rotor speeds in turns a minute. Thrust and torque of each rotor are polynomials of its speed, its
place and sense are columns of a mixing matrix, drag is one matrix for the velocity in body axes, and rotors follow
with a rate up and down. Source: crazyflow 0.4.0, `dynamics/first_principles`.
"""

from __future__ import annotations

import numpy as np

from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle.exports.forms import FLU, KNOWS, Exported, left_of_the_lowest_speed, not_expressed, parts_of
from rotorid.vehicle.mixer import hover_speed_rad_s

SECTION = "rotorid"
"""Name of the section: crazyflow's list of drones has names alone that Python takes for one."""
_PER_RPM = 2 * np.pi / 60
_SHORTEST_LAG_S = 0.004
"""Twice the step of crazyflow's simulator (500 Hz): with a shorter lag its Euler steps do not end at the command."""


def crazyflow(vehicle: Vehicle) -> Exported:
    """The section of `crazyflow/dynamics/first_principles/params.toml`."""
    parts = parts_of(vehicle, KNOWS["crazyflow"])
    left = [*parts.left_out, *left_of_the_lowest_speed(parts)]
    places, hover = parts.places * FLU, hover_speed_rad_s(vehicle)
    arm = float(np.abs(places[:, :2]).mean())
    lags = [max(tau, _SHORTEST_LAG_S) for tau in parts.tau_s]
    if tuple(lags) != parts.tau_s:
        known = " and ".join(f"{tau:g}" for tau in dict.fromkeys(parts.tau_s))
        left.append(f"lag of the rotors of {known} s: {_SHORTEST_LAG_S:g} s is taken, at 500 Hz it follows no faster")
    drag = parts.drag[0] * hover * len(places)
    if drag:
        left.append(
            "rotor drag with the speed of each rotor and at its hub: it acts at the centre of mass there, with that "
            f"of hover, {drag:.4g} N s/m"
        )
    if vehicle.gravity_m_s2 != 9.81:
        left.append(f"gravity of {vehicle.gravity_m_s2:g} m/s²: it has 9.81, in dynamics/params.toml")
    left.append("its list of drones: a new one needs a name in drones/__init__.py and an MJCF file next to it")
    low, high = parts.limits_rad_s or (0.0, 2 * hover)
    mean = float(parts.thrust.mean())
    mixing = np.vstack([places[:, 1] / arm, -places[:, 0] / arm, -vehicle.yaw_signs()])
    curves = [[[0.0, 0.0, c * _PER_RPM**2] for c in own] for own in (parts.thrust, parts.torque)]
    rows = {
        "mass": parts.mass_kg,
        "J": (parts.inertia * np.outer(FLU, FLU)).tolist(),
        "thrust_min": mean * low**2,
        "thrust_max": mean * high**2,
        "L": arm,
        "prop_inertia": 0.0,
        "rpm2thrust": curves[0],
        "rpm2torque": curves[1],
        "rotor_dyn_coef": [1 / lags[0], 0.0, 1 / lags[1], 0.0],
        "mixing_matrix": mixing.tolist(),
        "drag_matrix": np.diag([-drag, -drag, 0.0]).tolist(),
    }
    lines = [
        f"# {vehicle.name}: a section of crazyflow/dynamics/first_principles/params.toml (crazyflow 0.4).",
        "# Either rename it to a drone of crazyflow's list and put it in place of that one's,",
        "# or give its values to `dynamics` of crazyflow.dynamics.first_principles.",
        *not_expressed(left), "", f"[{SECTION}]", *(f"{name} = {_toml(value)}" for name, value in rows.items()), "",
    ]  # fmt: skip
    return Exported("\n".join(lines), "params.toml", tuple(left))


def _toml(value: float | list) -> str:
    """A number, or a list of lists of numbers, as TOML."""
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return f"{float(value):.12g}" if not float(value).is_integer() else f"{float(value):.1f}"
