"""A vehicle with its effects, ready to be simulated, and what belongs to the run and to the readings beside it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import Form, SpeedForm
from rotorid.errors import InputError
from rotorid.mismatch.delivery.files import Condition, Conditions, Entry, Instruments
from rotorid.recordings import Vehicle
from rotorid.vehicle.improved import ActiveForm, active_forms


@dataclass(frozen=True)
class Model:
    """A vehicle with its effects, and the conditions and instruments of the recordings that it is compared with."""

    vehicle: Vehicle
    forms: tuple[ActiveForm, ...] = ()
    """Forms that add a wrench, with their values."""
    chain: tuple[tuple[str, SpeedForm], ...] = ()
    """Forms between command and rotor speed, with their ids."""
    chain_values: tuple[float, ...] = ()
    """Parameters of the chain, form after form."""
    conditions: Conditions | None = None
    loads: tuple[tuple[Condition, Form, np.ndarray], ...] = ()
    """Conditions with a form (a payload for a time), and their values."""
    readings: tuple[ActiveForm, ...] = ()
    """Errors of sensors, with their values."""


def model_of(vehicle: Vehicle, conditions: Conditions | None = None, instruments: Instruments | None = None) -> Model:
    """What the three files say, as forms with values; InputError names a faulty entry."""
    chain, values, wrench = [], [], []
    for number, entry in enumerate(vehicle.effects, 1):
        effect = catalogue().get(entry.get("id"))
        speed = {f.name: f for f in effect.speed_forms} if effect else {}
        form = speed.get(entry.get("form"))
        if form is None:
            wrench.append(entry)
            continue
        given = entry.get("parameters") or {}
        symbols = [p.symbol for p in form.parameters]
        if set(given) != set(symbols):
            raise InputError(
                f"vehicle {vehicle.name}: effects entry {number} ({effect.id}, {form.name}) gives parameters "
                f"{', '.join(given) or 'none'}, expected {', '.join(symbols)}"
            )
        chain.append((effect.id, form))
        values += [float(given[s]) for s in symbols]
    forms = active_forms(vehicle.model_copy(update={"effects": tuple(wrench)}))
    loads = tuple(
        (condition, *form)
        for condition in (conditions.conditions if conditions else ())
        for form in _forms(vehicle, condition)
    )
    readings = tuple(
        form for entry in (instruments.instruments if instruments else ()) for form in _forms(vehicle, entry)
    )
    return Model(
        vehicle,
        tuple((f, np.asarray(v, float)) for f, v in forms),
        tuple(chain),
        tuple(values),
        conditions,
        loads,
        readings,
    )


def _forms(vehicle: Vehicle, entry: Entry) -> list[ActiveForm]:
    """The form of an entry with its values; none where the parameters themselves describe it."""
    if not entry.form:
        return []
    effects = ({"id": entry.id, "form": entry.form, "parameters": entry.parameters},)
    return active_forms(vehicle.model_copy(update={"effects": effects}))
