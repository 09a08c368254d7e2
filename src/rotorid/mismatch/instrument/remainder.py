"""Does what is left of a reading depend on load, attitude, time or any other column, and how much of it?"""

from __future__ import annotations

import numpy as np

from rotorid.effects.loading import CHANNELS, Loading
from rotorid.mismatch.dependence import ALARM_P, SMALLEST_SHARE_OF_NOISE, _wald
from rotorid.mismatch.instrument.model import ReadingModel
from rotorid.mismatch.instrument.setup import averaged, pieces_of


def probes(loading: Loading, model: ReadingModel) -> dict[str, np.ndarray]:
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


def on_rows(model: ReadingModel) -> list[dict[str, np.ndarray]]:
    """Probes of every part that has rows, and the mean rotor speed, in the order of the rows."""
    out = []
    for loading in model.loadings:
        whole = probes(loading, model)
        if loading.motion.rotor_speed is not None:
            whole["rotor_speed_rad_s"] = averaged(loading.motion.rotor_speed.mean(axis=1), model.setup.average)
        out += [{k: v[p] for k, v in whole.items()} for p in pieces_of(loading, model.setup.average)]
    return out


def regimes(model: ReadingModel) -> dict[str, dict[str, np.ndarray]]:
    """Run to regime variable on the instants of the rows (runs' stretches one after the other)."""
    out: dict[str, dict[str, np.ndarray]] = {}
    for whole, rows in zip(on_rows(model), model.rows, strict=True):
        own = {k: v for k, v in whole.items() if not k.endswith("_squared")} | {"time_s": rows.time_s}
        if rows.run in out:
            own = {k: np.concatenate([out[rows.run][k], own[k]]) for k in own if k in out[rows.run]}
        out[rows.run] = own
    return out


def _inputs(model: ReadingModel) -> tuple[list[str], list[np.ndarray]]:
    parts = on_rows(model)
    names = [n for n in parts[0] if all(n in p for p in parts) and n != "rotor_speed_rad_s"]
    stacked = [np.stack([np.nan_to_num(p[n]) for n in names], axis=1) for p in parts]
    every = np.concatenate(stacked)
    mean, spread = every.mean(axis=0), every.std(axis=0)
    keep = spread > 1e-9
    return [n for n, k in zip(names, keep, strict=True) if k], [
        ((z - mean) / np.where(keep, spread, 1))[:, keep] for z in stacked
    ]


def dependence(model: ReadingModel, before: list[np.ndarray], after: list[np.ndarray]):
    """p-values by channel that residuals (n, 6) do not depend on the inputs, before and after, and on what they do."""
    names, inputs = _inputs(model)
    first, last, depends = {}, {}, {}
    for c in model.setup.instrument.channels:
        taps = model.regression.filters[c]
        first[CHANNELS[c]], _ = _wald([b[:, c] for b in before], inputs, taps, model.setup.rate_hz)
        last[CHANNELS[c]], t = _wald([a[:, c] for a in after], inputs, taps, model.setup.rate_hz)
        if last[CHANNELS[c]] < ALARM_P:
            for i in np.argsort(-np.abs(t))[:2]:
                depends.setdefault(names[i].removesuffix("_squared"), 0)
    return first, last, list(depends)


def leftover(model: ReadingModel, before, after, p_after, depends, approximate=()):
    """Share of the mismatch that stays unexplained, its channels, and a plain description.

    A ridge regression on all inputs and their products stands for "whatever could be explained"; it is fitted on the
    training runs and judged on the held-out ones. `approximate` names effects whose form is known to leave something.
    """
    _, inputs = _inputs(model)
    split = model.setup.split
    training = [r.run in split.training for r in model.rows]
    if split.training == split.held_out:
        training = [True] * len(training)
    judged = [i for i, t in enumerate(training) if not t] or list(range(len(training)))
    channels, left_over, total = [], 0.0, 0.0
    for c in model.setup.instrument.channels:
        features = [_features(z) for z in inputs]
        gram = sum(f.T @ f for f, t in zip(features, training, strict=True) if t)
        cross = sum(f.T @ a[:, c] for f, a, t in zip(features, after, training, strict=True) if t)
        beta = np.linalg.solve(gram + 1e-2 * np.trace(gram) / len(gram) * np.eye(len(gram)), cross)
        count = sum(len(after[i]) for i in judged)
        energy = sum(float(after[i][:, c] @ after[i][:, c]) for i in judged)
        flexible = min(sum(float(np.sum((after[i][:, c] - features[i] @ beta) ** 2)) for i in judged), energy)
        start = sum(float(before[i][:, c] @ before[i][:, c]) for i in judged)
        gained = np.sqrt(max(energy - flexible, 0.0) / count)
        if p_after[CHANNELS[c]] < ALARM_P and gained > SMALLEST_SHARE_OF_NOISE * np.sqrt(flexible / count):
            channels.append(CHANNELS[c])
            left_over += (energy - flexible) / max(flexible, 1e-300)
        total += max(start - flexible, 0.0) / max(flexible, 1e-300)
    if not channels or total <= 0:
        return 0.0, (), ""
    named = " and ".join(d.replace("_", " ") for d in depends) or "the load"
    cause = "the cause is not in the catalogue"
    if approximate:
        cause = f"the form of {' and of '.join(approximate)} is only approximate"
    text = f"{', '.join(channels)} still depend on {named}; {cause}"
    return float(min(1.0, left_over / total)), tuple(channels), text


def _features(z: np.ndarray) -> np.ndarray:
    """A constant, inputs and their pairwise products."""
    i, j = np.triu_indices(z.shape[1])
    return np.concatenate([np.ones((len(z), 1)), z, z[:, i] * z[:, j]], axis=1)
