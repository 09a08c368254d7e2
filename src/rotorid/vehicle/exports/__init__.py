"""An identified vehicle in the forms that other tools know; what a form cannot express is named, not dropped.

Every form by its name: those of `forms`, those of simulators that belong to an autopilot, and the entry points
`rotorid.exports` of installed packages: functions of a vehicle that give an `Exported`.
"""

from __future__ import annotations

from collections.abc import Callable
from difflib import get_close_matches
from functools import cache
from importlib.metadata import entry_points

from rotorid.errors import InputError
from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle.exports.autopilots import ardupilot_json, px4_sih
from rotorid.vehicle.exports.crazyflow import crazyflow
from rotorid.vehicle.exports.forms import FORMS, KNOWS, Exported, named_in_one_line, parts_of, refusal
from rotorid.vehicle.improved import all_forms

_WRITERS: dict[str, Callable[[Vehicle], Exported]] = {
    **FORMS,
    "px4-sih": px4_sih,
    "ardupilot-json": ardupilot_json,
    "crazyflow": crazyflow,
}
_GROUP = "rotorid.exports"
__all__ = ["Exported", "export_vehicle", "names"]


@cache
def _of_packages() -> dict[str, Callable[[Vehicle], Exported]]:
    """Forms of installed packages by their names; a name of rotorid's own stays rotorid's."""
    return {point.name: point.load() for point in entry_points(group=_GROUP) if point.name not in _WRITERS}


def names() -> tuple[str, ...]:
    """Names of all forms."""
    return (*_WRITERS, *_of_packages())


def export_vehicle(vehicle: Vehicle, to: str) -> Exported:
    """The vehicle for another tool; InputError names the forms there are, or why the tool does not take it."""
    if to not in names():
        near = get_close_matches(to, names(), 1)
        meant = f"; did you mean {near[0]}?" if near else f", expected one of {', '.join(names())}"
        raise InputError(f"no form is called {to!r}{meant}")
    if vehicle.kind == "bench" or vehicle.mass_kg is None or vehicle.inertia_kg_m2 is None:
        raise InputError(f"vehicle {vehicle.name}: only a vehicle with mass, inertia and rotors can be exported")
    all_forms(vehicle)  # an effect that is none of the catalogue's is refused
    vehicle = named_in_one_line(vehicle)
    if to in _of_packages():
        return _of_packages()[to](vehicle)
    if why := refusal(to, vehicle.rotor_count, parts_of(vehicle, KNOWS[to]).inertia):
        raise InputError(f"{vehicle.name}: {why}")
    return _WRITERS[to](vehicle)
