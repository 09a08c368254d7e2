"""A plan as a mission for PX4 (a file of QGroundControl), where it is one: places to go to, one after the other.

A mission holds waypoints; how fast the vehicle goes between them PX4 shapes itself. Passes to and fro, climbs, held
heights and turns on the spot are waypoints. Curves and quick motions are not, and the trajectory flown offboard is what
the separations are predicted for. Format: https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rotorid.plan.candidates import Reference
from rotorid.plan.plan import Plan

EARTH_M = 6378137.0
_STRAIGHT = ("hover", "ladder", "pass", "climb", "face")
"""First words of the manoeuvres that are waypoints."""
_STILL = 0.03
"""Share of the largest speed below which the vehicle turns round or waits."""
_HELD_S = 0.5
"""Shorter rests are turns, not waits."""
TAKE_OFF, WAYPOINT, SPEED, RETURN = 22, 16, 178, 20
_RELATIVE = 3
"""MAVLink frame: latitude, longitude, height above home."""


@dataclass(frozen=True)
class _Stop:
    """A place to go to (north, east, down from the volume's middle), how long to stay, how fast to get there."""

    place_m: np.ndarray
    yaw_rad: float
    wait_s: float
    speed_m_s: float


def not_a_mission(plan: Plan) -> str:
    """Why a plan is no mission; empty where it is one."""
    others = [p.name for p in plan.pieces if p.name.split()[0] not in _STRAIGHT]
    if others:
        return f"no mission: {', '.join(dict.fromkeys(others))} cannot be given as waypoints; fly px4_offboard.csv"
    if plan.limits.home_deg is None:
        return "no mission: limits state no home_deg (latitude and longitude of the start)"
    return ""


def stops(reference: Reference) -> list[_Stop]:
    """Where a reference turns round or rests, in order."""
    t = reference.time_s
    speed = np.linalg.norm(np.gradient(reference.position_m, t, axis=0), axis=1)
    turning = np.abs(np.gradient(reference.yaw_rad, t))
    still = (speed <= _STILL * max(speed.max(), 1e-9)) & (turning <= _STILL * max(turning.max(), 1e-9))
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(int), [0]]))).reshape(-1, 2)
    out, last = [], 0
    for start, stop in edges:
        middle, wait = (start + stop - 1) // 2, float(t[stop - 1] - t[start])
        way = float(speed[last : start + 1].max())
        out.append(
            _Stop(reference.position_m[middle], float(reference.yaw_rad[middle]), wait if wait > _HELD_S else 0.0, way)
        )
        last = stop
    return out


def mission(plan: Plan) -> dict:
    """The plan in the format of a QGroundControl plan file: take-off, waypoints with their speeds, return."""
    home, middle = plan.limits.home_deg, plan.limits.middle_m
    items: list[dict] = []

    def add(command: int, params: list, frame: int = _RELATIVE) -> None:
        height = {"Altitude": params[6], "AltitudeMode": 1, "AMSLAltAboveTerrain": None} if command == WAYPOINT else {}
        items.append(
            {
                "type": "SimpleItem",
                "autoContinue": True,
                "command": command,
                "doJumpId": len(items) + 1,
                "frame": frame,
                "params": params,
            }
            | height
        )

    def place(at: np.ndarray) -> list[float]:
        north, east, height = at[0] + middle[0], at[1] + middle[1], middle[2] - at[2]
        latitude = home[0] + np.degrees(north / EARTH_M)
        longitude = home[1] + np.degrees(east / (EARTH_M * np.cos(np.radians(home[0]))))
        return [round(float(latitude), 8), round(float(longitude), 8), round(float(height), 2)]

    add(TAKE_OFF, [0, 0, 0, 0, *place(np.zeros(3))])
    fastest = 0.0
    for stop in stops(plan.reference):
        if stop.speed_m_s > 0.1 and abs(stop.speed_m_s - fastest) > 0.05:
            fastest = stop.speed_m_s
            add(SPEED, [1, round(fastest, 2), -1, 0, 0, 0, 0], frame=2)
        add(
            WAYPOINT,
            [round(stop.wait_s, 1), 0, 0, round(float(np.degrees(stop.yaw_rad)) % 360, 1), *place(stop.place_m)],
        )
    add(RETURN, [0, 0, 0, 0, 0, 0, 0], frame=2)
    return {
        "fileType": "Plan",
        "groundStation": "QGroundControl",
        "version": 1,
        "geoFence": {"circles": [], "polygons": [], "version": 2},
        "rallyPoints": {"points": [], "version": 2},
        "mission": {
            "version": 2,
            "firmwareType": 12,
            "vehicleType": 2,
            "cruiseSpeed": plan.limits.speed_m_s,
            "hoverSpeed": plan.limits.speed_m_s,
            "globalPlanAltitudeMode": 1,
            "plannedHomePosition": [*home, 0.0],
            "items": items,
        },
    }
