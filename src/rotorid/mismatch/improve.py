"""The improved vehicle: values refitted and the effects found, as a vehicle file that the simulator runs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import Form, SpeedForm
from rotorid.errors import InputError
from rotorid.mismatch.findings import Analysis, Finding, one_per_class, with_status
from rotorid.recordings import Vehicle
from rotorid.vehicle.improved import ActiveForm, active_forms


@dataclass(frozen=True)
class Model:
    """A vehicle with its effects, ready to be simulated."""

    vehicle: Vehicle
    forms: tuple[ActiveForm, ...] = ()
    """Forms that add a wrench, with their values."""
    chain: tuple[tuple[str, SpeedForm], ...] = ()
    """Forms between command and rotor speed, with their ids."""
    chain_values: tuple[float, ...] = ()
    """Parameters of the chain, form after form."""


def modelled(analysis: Analysis) -> list[Finding]:
    """Findings that the improved model holds: the established ones, one of each class of alternatives, and what was
    chosen with them and is only suggested by the runs held out, which change no model.

    A force in windows of one run (a gust) is no property of the vehicle: it would blow in every flight simulated.
    """
    found = with_status(analysis, "established") + one_per_class(with_status(analysis, "ambiguous"))
    found += [f for f in with_status(analysis, "suggested") if f.id in analysis.without]
    chosen = {id(f) for f in found if form_of(f) is not None and not (f.windows and isinstance(form_of(f), Form))}
    return [f for f in analysis.findings if id(f) in chosen]


def form_of(finding: Finding) -> Form | SpeedForm | None:
    """The form of a finding; one between command and rotor speed is known by its equation."""
    if finding.form is not None or not finding.values or finding.id not in catalogue():
        return finding.form
    speed_forms = catalogue()[finding.id].speed_forms
    return next((f for f in speed_forms if f.equation == finding.equation), None)


def improved_vehicle(analysis: Analysis) -> Vehicle:
    """The vehicle with values re-estimated and an entry under `effects` for each finding of the model."""
    entries = []
    for finding in modelled(analysis):
        form = form_of(finding)
        symbols = [p.symbol for p in form.parameters]
        values = dict(zip(symbols, map(float, finding.values), strict=True))
        entries.append({"id": finding.id, "form": form.name, "parameters": values})
    return analysis.improved.model_copy(update={"effects": tuple(entries)})


def model_of(vehicle: Vehicle) -> Model:
    """What a vehicle file with effects says, as forms with values; InputError names a faulty entry."""
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
    return Model(vehicle, tuple((f, np.asarray(v, float)) for f, v in forms), tuple(chain), tuple(values))
