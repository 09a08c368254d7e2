"""Does what is left of a reading depend on load, attitude, time or any other column, and how much of it?

What a vehicle file with its effects says an instrument reads: the simulator of kinds `stand` and `bench`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import Form
from rotorid.effects.loading import CHANNELS, InstrumentFacts, Loading, forms_of
from rotorid.errors import InputError
from rotorid.mismatch.decide.dependence import (
    ALARM_P,
    SMALLEST_SHARE_OF_NOISE,
    Flexible,
    standardised,
    wald,
    with_products,
)
from rotorid.mismatch.decide.findings import Analysis
from rotorid.mismatch.deliver.files import Instruments, instruments_of
from rotorid.mismatch.evidence.rows import form_reading
from rotorid.mismatch.instrument.model import MEMORY, ReadingModel
from rotorid.mismatch.instrument.setup import averaged, full_voltage_of, loaded_by, pieces_of, with_speed
from rotorid.recordings import Vehicle
from rotorid.vehicle.improved import speeds_of_commands


def _probes(loading: Loading, model: ReadingModel) -> dict[str, np.ndarray]:
    """Generic inputs on the rows of a stretch, by the names that a person knows."""
    setup, out = model.setup, {}
    for k in setup.instrument.loaded:
        name = CHANNELS[k]
        out[f"load_{name}"] = loading.load[:, k]
        out[f"load_{name}_squared"] = loading.load[:, k] * np.abs(loading.load[:, k])
    if loading.attitude is not None and setup.instrument.tilts:
        out["roll_rad"], out["pitch_rad"] = loading.attitude
    if loading.motion is not None and loading.motion.voltage is not None:
        out["battery_voltage_v"] = loading.motion.voltage
    if loading.motion is not None and loading.motion.height is not None:
        out["height_m"] = loading.motion.height
    if loading.temperature is not None:
        out["temperature_c"] = loading.temperature
    out["time_s"] = loading.run_time_s
    for name, values in loading.extra.items():
        out[name] = values
    return {k: averaged(v, setup.average) for k, v in out.items()}


def _on_rows(model: ReadingModel) -> list[dict[str, np.ndarray]]:
    """Probes of every part that has rows, and the mean rotor speed, in the order of the rows."""
    out = []
    for loading in model.loadings:
        whole = _probes(loading, model)
        if loading.motion.rotor_speed is not None:
            whole["rotor_speed_rad_s"] = averaged(loading.motion.rotor_speed.mean(axis=1), model.setup.average)
        out += [{k: v[p] for k, v in whole.items()} for p in pieces_of(loading, model.setup.average)]
    return out


def regimes(model: ReadingModel) -> dict[str, dict[str, np.ndarray]]:
    """Run to regime variable on the instants of the rows (runs' stretches one after the other)."""
    out: dict[str, dict[str, np.ndarray]] = {}
    for whole, rows in zip(_on_rows(model), model.rows, strict=True):
        own = {k: v for k, v in whole.items() if not k.endswith("_squared")} | {"time_s": rows.time_s}
        if rows.run in out:
            own = {k: np.concatenate([out[rows.run][k], own[k]]) for k in own if k in out[rows.run]}
        out[rows.run] = own
    return out


def _inputs(model: ReadingModel) -> tuple[list[str], list[np.ndarray]]:
    """Inputs that vary, on the rows of every part."""
    unlike = "rotor_speed_rad_s"
    return standardised([{n: np.nan_to_num(v) for n, v in p.items() if n != unlike} for p in _on_rows(model)])


def _changing(model: ReadingModel, names: list[str], inputs: list[np.ndarray]) -> tuple[list[str], list[np.ndarray]]:
    """The inputs with, on a bench, every load times what a gain may change with: time and temperature."""
    if not model.setup.instrument.bench:
        return names, inputs
    loads = [n for n in names if n.startswith("load_") and not n.endswith("_squared")]
    pairs = [(load, other) for load in loads for other in ("time_s", "temperature_c") if other in names]
    first, second = ([names.index(pair[i]) for pair in pairs] for i in (0, 1))
    return names + [b for _, b in pairs], [np.hstack([z, z[:, first] * z[:, second]]) for z in inputs]


def dependence(model: ReadingModel, before: list[np.ndarray], after: list[np.ndarray]):
    """p-values by channel that residuals (n, 6) do not depend on the inputs, before and after, and on what they do.

    Neither on the inputs over all runs nor on the loads in any one run: the smaller p-value times the tests made.
    """
    names, inputs = _changing(model, *_inputs(model))
    first, last, depends = {}, {}, {}
    for c in model.setup.instrument.channels:
        taps, rate_hz = model.regression.filters[c], model.setup.rate_hz
        p_first, _ = wald([b[:, c] for b in before], inputs, taps, rate_hz, memory=MEMORY)
        p_last, t = wald([a[:, c] for a in after], inputs, taps, rate_hz, memory=MEMORY)
        first[CHANNELS[c]] = min(1.0, 2 * min(p_first, _in_a_run(model, before, c)))
        p_run = _in_a_run(model, after, c)
        last[CHANNELS[c]] = min(1.0, 2 * min(p_last, p_run))
        if p_last < ALARM_P:
            for i in np.argsort(-np.abs(t))[:2]:
                depends.setdefault(names[i].removesuffix("_squared"), 0)
        if p_run < ALARM_P:
            depends.setdefault("run", 0)
    return first, last, list(depends)


def _runs(model: ReadingModel) -> list[tuple[list[int], list[np.ndarray]]]:
    """Of every run the numbers of its rows and the loads that change in it, (n, k) each; a bench alone knows them."""
    # Spread of a load in one run, by its spread over all, from which the run says what depends on it.
    least_change = 0.02
    if not model.setup.instrument.bench:
        return []
    names, inputs = _inputs(model)
    columns = [i for i, n in enumerate(names) if n.startswith("load_") and not n.endswith("_squared")]
    out = []
    for run in dict.fromkeys(r.run for r in model.rows):
        numbers = [k for k, r in enumerate(model.rows) if r.run == run]
        loads = [inputs[k][:, columns] for k in numbers]
        keep = np.concatenate(loads).std(axis=0) > least_change
        out.append((numbers, [z[:, keep] for z in loads]))
    return out


def _in_a_run(model: ReadingModel, residuals: list[np.ndarray], channel: int) -> float:
    """p-value that residuals (n, 6) depend on the loads in no run, of the run where it is smallest times their number.

    What changes from run to run (a clamp that slips, a gain that is set anew) cancels over all of them.
    """
    taps, rate_hz = model.regression.filters[channel], model.setup.rate_hz
    found = [
        wald([residuals[k][:, channel] for k in numbers], z, taps, rate_hz, memory=MEMORY)[0]
        for numbers, z in _runs(model)
        if z[0].shape[1]
    ]
    return min(1.0, len(found) * min(found)) if found else 1.0


def _explained_in_runs(model: ReadingModel, after: list[np.ndarray], channel: int) -> np.ndarray:
    """Energy of residuals (n, 6) that each run's own dependence on the loads explains, by part of the rows, (k,)."""
    out = np.zeros(len(after))
    for numbers, loads in _runs(model):
        z = [np.hstack([np.ones((len(x), 1)), x]) for x in loads]
        y = [after[k][:, channel] for k in numbers]
        beta = np.linalg.lstsq(np.concatenate(z), np.concatenate(y), rcond=1e-6)[0]
        out[numbers] = [part @ part - (part - x @ beta) @ (part - x @ beta) for part, x in zip(y, z, strict=True)]
    return out


def leftover(model: ReadingModel, after, p_after, depends):
    """Channels of which something stays unexplained, and a plain description.

    A ridge regression on all inputs and their products stands for "whatever could be explained"; it is fitted on the
    training runs and judged on the held-out ones. What differs from run to run is fitted and judged within each.
    """
    features = [np.hstack([np.ones((len(z), 1)), with_products(z)]) for z in _inputs(model)[1]]
    flexible_of = Flexible(features, [r.run for r in model.rows], model.setup.split)
    judged, channels = flexible_of.judged, []
    for c in model.setup.instrument.channels:
        count = sum(len(after[i]) for i in judged)
        energy, flexible = flexible_of.energies([a[:, c] for a in after])
        flexible = min(flexible, energy - float(_explained_in_runs(model, after, c)[judged].sum()))
        gained = np.sqrt(max(energy - flexible, 0.0) / count)
        if p_after[CHANNELS[c]] < ALARM_P and gained > SMALLEST_SHARE_OF_NOISE * np.sqrt(flexible / count):
            channels.append(CHANNELS[c])
    if not channels:
        return (), ""
    named = " and ".join(d.replace("_", " ") for d in depends) or "the load"
    text = f"{', '.join(channels)} still depend on {named}; the cause is not in the catalogue"
    return tuple(channels), text


def _entries(vehicle: Vehicle, instrument: InstrumentFacts) -> tuple[list[tuple[Form, np.ndarray]], bool]:
    """Forms that act on load or reading with their values, and whether any acts between command and speed."""
    found, chain = [], False
    for number, entry in enumerate(vehicle.effects, 1):
        where = f"vehicle {vehicle.name}: effects entry {number}"
        effect = catalogue().get(entry.get("id"))
        if effect is None:
            raise InputError(f"{where} has id {entry.get('id')!r}, expected one of the catalogue")
        if _is_chain(entry):
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


def _predicted(
    vehicle: Vehicle,
    instrument: InstrumentFacts,
    loading: Loading,
    full_voltage: float | None = None,
    errors: Instruments | None = None,
) -> np.ndarray:
    """Reading that the vehicle with its effects predicts for a stretch by an instrument with its errors, (n, 6)."""
    of_reading = [e.model_dump(include={"id", "form", "parameters"}) for e in (errors.instruments if errors else ())]
    both = vehicle.model_copy(update={"effects": (*vehicle.effects, *(e for e in of_reading if e["form"]))})
    forms, chain = _entries(both, replace(instrument, vehicle=vehicle))
    if not loading.measured and loading.command is not None:
        speed = loading.command
        if chain:
            only = tuple(e for e in vehicle.effects if _is_chain(e))
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


def _is_chain(entry: dict) -> bool:
    """Whether an entry acts between command and rotor speed."""
    effect = catalogue().get(entry.get("id"))
    return effect is not None and any(f.name == entry.get("form") for f in effect.speed_forms)


def prove(analysis: Analysis, written: Vehicle, reloaded: Vehicle, errors: Instruments) -> None:
    """RuntimeError unless vehicle and instruments read back predict the readings that the model predicts."""
    same = 1e-5  # Relative difference above which a vehicle read back is not the model written.
    ours_of = instruments_of(analysis)
    volts = full_voltage_of(analysis.loadings)
    for loading in analysis.loadings:
        ours = _predicted(written, analysis.instrument, loading, volts, ours_of)
        theirs = _predicted(reloaded, analysis.instrument, loading, volts, errors)
        scale = max(float(np.abs(ours).max()), 1e-12)
        if not np.allclose(ours, theirs, rtol=0, atol=same * scale):
            raise RuntimeError(f"improved_vehicle.yaml read back predicts another reading in {loading.run}")
