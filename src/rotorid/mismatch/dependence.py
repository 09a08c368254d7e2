"""Does a residual depend on the inputs? A test of independence, not of whiteness, and what is left to explain."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter
from scipy.stats import f as f_distribution

from rotorid.mismatch.motion import Segment
from rotorid.mismatch.regression import at_least, quadratic_form
from rotorid.mismatch.rows import CHANNELS

ALARM_P = 1e-5
SMALLEST_SHARE_OF_NOISE = 0.3
"""A left-over dependence below this share of the noise is not worth a word."""
BLOCK_S = 2.0


def probes(segment: Segment, prepared) -> dict[str, np.ndarray]:
    """Generic inputs on the thinned instants: what a residual must not depend on."""
    motion, thin = segment.motion, prepared.thinner
    out: dict[str, np.ndarray] = {}

    def add(name, values):
        out[name] = thin(np.ascontiguousarray(values))

    if motion.velocity is not None:
        for i, a in enumerate("xyz"):
            v = motion.velocity[:, i]
            add(f"velocity_{a}", v)
            add(f"velocity_{a}_abs", np.abs(v) * v)
        add("airspeed_squared", (motion.velocity[:, :2] ** 2).sum(axis=1))
    if motion.rotation is not None:
        add("north", motion.rotation[:, 0, 0])
        add("east", motion.rotation[:, 1, 0])
    if motion.rotor_speed is not None:
        total = motion.rotor_speed.mean(axis=1)
        add("rotor_speed", total)
        add("thrust", total**2)
    if motion.angular_velocity is not None:
        for i, a in enumerate("xyz"):
            add(f"rate_{a}", motion.angular_velocity[:, i])
    if motion.height is not None and prepared.vehicle.rotor_radius_m:
        add("height", 1.0 / (1.0 + (motion.height / prepared.vehicle.rotor_radius_m) ** 2))
    return out


def _stack(prepared, segments):
    names = None
    parts = []
    for s in segments:
        z = probes(s, prepared)
        names = list(z) if names is None else [n for n in names if n in z]
        parts.append(z)
    stacked = [np.stack([z[n] for n in names], axis=1) for z in parts]
    mean = np.concatenate(stacked).mean(axis=0)
    spread = np.concatenate(stacked).std(axis=0)
    keep = spread > 1e-9
    return [n for n, k in zip(names, keep, strict=True) if k], [
        ((z - mean) / np.where(spread > 0, spread, 1))[:, keep] for z in stacked
    ]


def dependence(prepared, model, segments):
    """p-values per channel that the residual is independent of the inputs, before and after, and on what it depends."""
    names, inputs = _stack(prepared, segments)
    full = model.regression.fit(model.search.always + model.selection.active)
    before, after, depends = {}, {}, {}
    for c in range(6):
        if not np.isfinite(model.noise[c]):
            continue
        taps = model.regression.filters[c]
        raw = [r.y[:, c] for r in model.rows]
        left = [r.y[:, c] - r.x[:, c][:, full.columns] @ full.beta for r in model.rows]
        before[CHANNELS[c]], _ = _wald(raw, inputs, taps, prepared.thinner.rate_hz)
        after[CHANNELS[c]], t = _wald(left, inputs, taps, prepared.thinner.rate_hz)
        if after[CHANNELS[c]] < ALARM_P:
            for i in np.argsort(-np.abs(t))[:2]:
                depends.setdefault(names[i], 0)
    return before, after, list(depends)


def _wald(parts, inputs, taps, rate_hz):
    """Block-robust Hotelling test of a regression of the whitened residual on the whitened inputs."""
    size = inputs[0].shape[1]
    gram, scores, blocks = np.zeros((size, size)), [], []
    per = max(2, int(BLOCK_S * rate_hz))
    skip = len(taps) - 1
    for y, z in zip(parts, inputs, strict=True):
        yw, zw = lfilter(taps, [1.0], y)[skip:], lfilter(taps, [1.0], z, axis=0)[skip:]
        for index in np.array_split(np.arange(len(yw)), max(1, len(yw) // per)):
            blocks.append((zw[index].T @ zw[index], zw[index].T @ yw[index]))
    gram = sum(b[0] for b in blocks)
    cross = sum(b[1] for b in blocks)
    inverse = np.linalg.pinv(gram, rcond=1e-9, hermitian=True)
    beta = inverse @ cross
    scores = np.array([b[1] - b[0] @ beta for b in blocks])
    plain = inverse
    robust = inverse @ (scores.T @ scores) @ inverse
    covariance = at_least(robust, plain)
    statistic = quadratic_form(beta, covariance)
    count = len(blocks)
    if count - size < 3:
        return 1.0, np.zeros(size)
    p = float(f_distribution.sf(statistic * (count - size) / (size * (count - 1)), size, count - size))
    return p, beta / np.sqrt(np.maximum(np.diag(covariance), 1e-300))


def leftover(prepared, model, segments, before, after, depends):
    """Share of the mismatch that stays unexplained, its channels, and a plain description.

    A ridge regression on all inputs and their products stands for "whatever could be explained"; it is fitted on
    the training runs and judged on the held-out ones.
    """
    names, inputs = _stack(prepared, segments)
    full = model.regression.fit(model.search.always + model.selection.active)
    training = [r.run in prepared.split.training for r in model.rows]
    if prepared.split.training == prepared.split.held_out:
        training = [True] * len(training)
    total_before = total_after = total_flexible = 0.0
    channels = []
    for c in range(6):
        name = CHANNELS[c]
        if name not in after:
            continue
        left = [r.y[:, c] - r.x[:, c][:, full.columns] @ full.beta for r in model.rows]
        raw = [r.y[:, c] for r in model.rows]
        features = [_features(z) for z in inputs]
        size = features[0].shape[1]
        gram = sum(f.T @ f for f, t in zip(features, training, strict=True) if t)
        cross = sum(f.T @ e for f, e, t in zip(features, left, training, strict=True) if t)
        beta = np.linalg.solve(gram + 1e-2 * np.trace(gram) / size * np.eye(size), cross)
        judged = [i for i, t in enumerate(training) if not t] or list(range(len(left)))
        energy = sum(float(left[i] @ left[i]) for i in judged)
        flexible = sum(float(np.sum((left[i] - features[i] @ beta) ** 2)) for i in judged)
        start = sum(float(raw[i] @ raw[i]) for i in judged)
        count = sum(len(left[i]) for i in judged)
        flexible = min(flexible, energy)
        gained = np.sqrt(max(energy - flexible, 0.0) / count)
        if after[name] < ALARM_P and gained > SMALLEST_SHARE_OF_NOISE * np.sqrt(flexible / count):
            channels.append(name)
            total_after += (energy - flexible) / flexible
        total_before += max(start - flexible, 0.0) / flexible
        total_flexible += 1.0
    if not channels or total_before <= 0:
        return 0.0, (), ""
    share = float(min(1.0, total_after / max(total_before, 1e-9)))
    inputs_named = " and ".join(depends) if depends else "the inputs"
    text = f"{', '.join(channels)} still depend on {inputs_named}; the cause is not in the catalogue"
    return share, tuple(channels), text


def _features(z: np.ndarray) -> np.ndarray:
    """Inputs and their pairwise products, (n, p + p(p+1)/2)."""
    i, j = np.triu_indices(z.shape[1])
    return np.concatenate([z, z[:, i] * z[:, j]], axis=1)
