"""A vehicle file as a controller can fly it: what the file leaves open is set, what nobody can fly is left out.

A vehicle of a recording may lack what its effects refer to (where the ground is, the rotor speed of the full command),
and a delay fitted to stamps may be negative. Such a vehicle is flown all the same, and a sentence says each difference.
"""

from __future__ import annotations

from rotorid.effects.contract import CURVE, DELAY, LIMIT, Form, SpeedForm
from rotorid.errors import InputError
from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle.improved import all_forms
from rotorid.vehicle.mixer import hover_speed_rad_s

_FULL_OVER_HOVER = 2.0
"""Rotor speed of the full command over that of hover where no limits are stated: a thrust of four times the weight."""


def flyable(vehicle: Vehicle) -> tuple[Vehicle, tuple[str, ...]]:
    """The vehicle as a controller can fly it, and a sentence for each thing that is other than its file says.

    InputError for a stand or bench, and for an effect that the catalogue does not have.
    """
    if vehicle.kind != "flight":
        raise InputError(f"{vehicle.name}: a {vehicle.kind} does not fly, so that there is no flight to simulate")
    forms = all_forms(vehicle)
    between = [(form, values) for form, values in forms if isinstance(form, SpeedForm)]
    changes: dict = {}
    said: list[str] = []
    early = [i for i, (form, values) in enumerate(forms) if _is_early(form, values)]
    if early:
        changes["effects"] = tuple(e for i, e in enumerate(vehicle.effects) if i not in early)
        said.append(
            f"The delay of the command of {forms[early[0]][1][0]:.3g} s is left out: "
            "rotors do not follow a command before it is given."
        )
    if any("voltage" in form.requires for form, _ in between):
        said.append("The battery stays at its full voltage.")
    if vehicle.rotor_speed_limits_rad_s is None and any(form.stage in (CURVE, LIMIT) for form, _ in between):
        full = _FULL_OVER_HOVER * hover_speed_rad_s(vehicle)
        changes["rotor_speed_limits_rad_s"] = (0.0, full)
        said.append(
            f"The file states no rotor_speed_limits_rad_s: the full command is taken as {full:.0f} rad/s, "
            f"{_FULL_OVER_HOVER:g} times the speed of hover."
        )
    if vehicle.ground_z_m is None and any("height" in f.requires for f, _ in forms if isinstance(f, Form)):
        changes["ground_z_m"] = 0.0
        said.append("The file states no ground_z_m: the ground is taken at z = 0.")
    return vehicle.model_copy(update=changes), tuple(said)


def _is_early(form, values) -> bool:
    """Whether a form is a negative delay of the command."""
    return isinstance(form, SpeedForm) and form.stage == DELAY and values[0] < 0
