"""What a vehicle file with its effects says an instrument reads: the simulator of kinds `stand` and `bench`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import Form
from rotorid.effects.loading import Instrument, Loading, forms_of
from rotorid.errors import InputError
from rotorid.mismatch.decision.findings import Analysis
from rotorid.mismatch.delivery.files import Instruments, instruments_of
from rotorid.mismatch.instrument.setup import full_voltage_of, loaded_by, with_speed
from rotorid.mismatch.plant.readings import form_reading
from rotorid.recordings import Vehicle
from rotorid.vehicle.improved import speeds_of_commands

SAME = 1e-5
"""Relative difference above which a vehicle read back is not the model written."""


def entries(vehicle: Vehicle, instrument: Instrument) -> tuple[list[tuple[Form, np.ndarray]], bool]:
    """Forms that act on load or reading with their values, and whether any acts between command and speed."""
    found, chain = [], False
    for number, entry in enumerate(vehicle.effects, 1):
        where = f"vehicle {vehicle.name}: effects entry {number}"
        effect = catalogue().get(entry.get("id"))
        if effect is None:
            raise InputError(f"{where} has id {entry.get('id')!r}, expected one of the catalogue")
        if is_chain(entry):
            chain = True
            continue
        forms = {f.name: f for f in forms_of(effect, instrument)}
        if entry.get("form") not in forms:
            raise InputError(
                f"{where} ({effect.id}) has form {entry.get('form')!r}, expected one of {', '.join(forms)}"
            )
        form, given = forms[entry["form"]], entry.get("parameters") or {}
        symbols = [p.symbol for p in form.parameters]
        if set(given) != set(symbols):
            raise InputError(
                f"{where} ({effect.id}) gives parameters {', '.join(given)}, expected {', '.join(symbols)}"
            )
        found.append((form, np.array([float(given[s]) for s in symbols])))
    return found, chain


def predicted(
    vehicle: Vehicle,
    instrument: Instrument,
    loading: Loading,
    full_voltage: float | None = None,
    errors: Instruments | None = None,
) -> np.ndarray:
    """Reading that the vehicle with its effects predicts for a stretch by an instrument with its errors, (n, 6)."""
    of_reading = [e.model_dump(include={"id", "form", "parameters"}) for e in (errors.instruments if errors else ())]
    both = vehicle.model_copy(update={"effects": (*vehicle.effects, *(e for e in of_reading if e["form"]))})
    forms, chain = entries(both, replace(instrument, vehicle=vehicle))
    if not loading.measured and loading.command is not None:
        speed = loading.command
        if chain:
            only = tuple(e for e in vehicle.effects if is_chain(e))
            bare = vehicle.model_copy(update={"effects": only})
            speed = speeds_of_commands(bare, speed, loading.time_s, loading.motion.voltage, full_voltage)
        loading = replace(loading, motion=with_speed(loading.motion, speed))
    loaded = loaded_by(loading, vehicle)
    out = loaded.load.copy()
    if vehicle.reading_gain is not None:
        out[:, :3] *= np.array(vehicle.reading_gain)
    for form, values in forms:
        out += form_reading(form, values, loaded, vehicle)
    return out


def is_chain(entry: dict) -> bool:
    """Whether an entry acts between command and rotor speed."""
    effect = catalogue().get(entry.get("id"))
    return effect is not None and any(f.name == entry.get("form") for f in effect.speed_forms)


def prove(analysis: Analysis, written: Vehicle, reloaded: Vehicle, errors: Instruments) -> None:
    """RuntimeError unless vehicle and instruments read back predict the readings that the model predicts."""
    ours_of = instruments_of(analysis)
    volts = full_voltage_of(analysis.loadings)
    for loading in analysis.loadings:
        ours = predicted(written, analysis.instrument, loading, volts, ours_of)
        theirs = predicted(reloaded, analysis.instrument, loading, volts, errors)
        scale = max(float(np.abs(ours).max()), 1e-12)
        if not np.allclose(ours, theirs, rtol=0, atol=SAME * scale):
            raise RuntimeError(f"improved_vehicle.yaml read back predicts another reading in {loading.run}")
