"""Does a residual depend on the inputs? A test of independence, not of whiteness."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter
from scipy.stats import f as f_distribution

from rotorid.mismatch.between_runs import compared
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


def standardised(prepared, segments):
    """Names of the inputs that vary, and per stretch their values (n, p), of mean 0 and deviation 1 over the set."""
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
    """p-values per channel that the residual depends on no input and not on the run, before and after; and inputs."""
    names, inputs = standardised(prepared, segments)
    full = model.full_fit()
    named = np.where(model.unnamed(full.columns), 0.0, full.beta)
    before, after, depends = {}, {}, {}
    for c in range(6):
        if not np.isfinite(model.noise[c]):
            continue
        taps = model.regression.filters[c]
        raw = [r.y[:, c] for r in model.rows]
        left = left_by(model.rows, c, full.columns, named)
        rate_hz = prepared.thinner.rate_hz
        runs = [r.run for r in model.rows]
        p_before, _ = _wald(raw, inputs, taps, rate_hz)
        p_after, t = _wald(left, inputs, taps, rate_hz)
        # Neither on the inputs nor on the run: the smaller of two p-values, doubled.
        before[CHANNELS[c]] = min(1.0, 2 * min(p_before, compared(runs, raw, rate_hz)[1]))
        after[CHANNELS[c]] = min(1.0, 2 * min(p_after, compared(runs, left, rate_hz)[1]))
        if p_after < ALARM_P:
            for i in np.argsort(-np.abs(t))[:2]:
                depends.setdefault(names[i], 0)
    return before, after, list(depends)


def left_by(rows, channel: int, columns, beta) -> list[np.ndarray]:
    """What coefficients leave of a channel, (n,) per stretch; where they leave more than there was, what there was.

    Where a flight hardly excites a value its column is mostly noise, and the correction for that noise can overshoot.
    """
    raw = [r.y[:, channel] for r in rows]
    left = [y - r.x[:, channel][:, columns] @ beta for y, r in zip(raw, rows, strict=True)]
    return left if sum(float(x @ x) for x in left) <= sum(float(y @ y) for y in raw) else raw


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
