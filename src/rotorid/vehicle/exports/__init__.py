"""An identified vehicle in the forms that other tools know; what a form cannot express is named, not dropped.

Every form by its name: those of `forms`, and those of simulators that belong to an autopilot.
"""

from __future__ import annotations

from collections.abc import Callable
from difflib import get_close_matches

from rotorid.errors import InputError
from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle.exports import forms
from rotorid.vehicle.exports.autopilots import ardupilot_json, px4_sih
from rotorid.vehicle.exports.forms import Exported, check_exportable

_SIMULATORS: dict[str, Callable[[Vehicle], Exported]] = {"px4-sih": px4_sih, "ardupilot-json": ardupilot_json}
NAMES = (*forms.FORMS, *_SIMULATORS)
__all__ = ["Exported", "export_vehicle"]


def export_vehicle(vehicle: Vehicle, to: str) -> Exported:
    """The vehicle for another tool; InputError names the forms there are, or why the tool does not take it."""
    if to not in NAMES:
        near = get_close_matches(to, NAMES, 1)
        meant = f"; did you mean {near[0]}?" if near else f", expected one of {', '.join(NAMES)}"
        raise InputError(f"no form is called {to!r}{meant}")
    if to in forms.FORMS:
        return forms.export_vehicle(vehicle, to)
    check_exportable(vehicle)
    return _SIMULATORS[to](vehicle)
