"""A vehicle with its effects, ready to be simulated, and what belongs to the run and to the readings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rotorid.effects.contract import Form, SpeedForm
from rotorid.mismatch.delivery.files import Condition, Conditions, Entry, Instruments
from rotorid.recordings import Vehicle
from rotorid.vehicle.improved import ActiveForm, active_forms, all_forms


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
    stated = [(entry["id"], *form) for entry, form in zip(vehicle.effects, all_forms(vehicle), strict=True)]
    chain = [(effect_id, form, values) for effect_id, form, values in stated if isinstance(form, SpeedForm)]
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
        tuple(active_forms(vehicle)),
        tuple((effect_id, form) for effect_id, form, _ in chain),
        tuple(float(v) for _, _, values in chain for v in values),
        conditions,
        loads,
        readings,
    )


def _forms(vehicle: Vehicle, entry: Entry) -> list[ActiveForm]:
    """The form of an entry with its values; none where the parameters themselves describe it."""
    if not entry.form:
        return []
    effects = ({"id": entry.id, "form": entry.form, "parameters": entry.parameters},)
    return active_forms(vehicle.model_copy(update={"effects": effects, "derivatives": ()}))
