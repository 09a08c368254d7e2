"""Effects switched on in a vehicle file: `effects` of `vehicle.yaml` as catalogue forms with their values."""

from __future__ import annotations

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import Form
from rotorid.errors import InputError
from rotorid.recordings.vehicle import Vehicle

ActiveForm = tuple[Form, np.ndarray]
"""A form of an effect and the values of its parameters, in order."""


def active_forms(vehicle: Vehicle, ignore: frozenset[str] = frozenset()) -> list[ActiveForm]:
    """Forms and values of every entry of `vehicle.effects`, in the order of the file.

    An entry is `{id, form, parameters: {symbol: value}}`; `form` may be left out where the effect has one
    form. Ids in `ignore` (those that act on rotor speeds or logging, handled elsewhere) are passed over.
    InputError names the entry and what was expected.
    """
    return [
        _active(entry, number, vehicle)
        for number, entry in enumerate(vehicle.effects, 1)
        if entry.get("id") not in ignore
    ]


def _active(entry: dict, number: int, vehicle: Vehicle) -> ActiveForm:
    where = f"vehicle {vehicle.name}: effects entry {number}"
    name = entry.get("id")
    effects = catalogue()
    if name not in effects:
        raise InputError(f"{where} has id {name!r}, expected one of {', '.join(effects)}")
    forms = {form.name: form for form in effects[name].forms(vehicle)}
    wanted = entry.get("form", next(iter(forms)) if len(forms) == 1 else None)
    if wanted not in forms:
        raise InputError(f"{where} ({name}) has form {wanted!r}, expected one of {', '.join(forms)}")
    form = forms[wanted]
    given = dict(entry.get("parameters") or {})
    symbols = [p.symbol for p in form.parameters]
    if set(given) != set(symbols):
        raise InputError(
            f"{where} ({name}, {wanted}) gives parameters {', '.join(given) or 'none'}, "
            f"expected {', '.join(symbols)}"
        )
    values = np.array([float(given[s]) for s in symbols])
    if not np.all(np.isfinite(values)):
        raise InputError(f"{where} ({name}, {wanted}) has a parameter that is not a finite number")
    return form, values
