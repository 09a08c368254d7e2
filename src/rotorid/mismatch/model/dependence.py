"""Does a residual depend on the inputs? A test of independence, not of whiteness.

Residual and inputs are made from the same readings, so a sensor's noise stands in both: where a flight hardly changes
the thrust, the tachometers' noise alone makes the residual depend on it. What that noise adds to the cross moments is
learnt by adding the same noise once more, and taken away (Fuller, Measurement Error Models, 1987, ch. 2). A
tachometer's noise may be coloured, and stronger in the band of the rows than its white part: a residual that some
possible strength of it explains is no dependence.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import f as f_distribution

from rotorid.mismatch.model.prepare import assemble_rows
from rotorid.mismatch.plant.between_runs import compared
from rotorid.mismatch.plant.motion import Segment
from rotorid.mismatch.plant.regression import at_least, quadratic_form, spread_of
from rotorid.mismatch.plant.rows import CHANNELS
from rotorid.recordings.signal.kernels import causal

ALARM_P = 1e-5
"""A residual depends on the inputs where the p-value is below this."""
SMALLEST_SHARE_OF_NOISE = 0.3
"""A left-over dependence below this share of the noise is not worth a word."""
_BLOCK_S = 2.0


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
    # A tank that empties, an icing rotor: no other input follows them.
    add("time_s", motion.time_s - next(r.time_s[0] for r in prepared.recordings.runs if r.name == segment.run))
    return out


def standardised(prepared, segments, also=()):
    """Names of the inputs that vary, and per stretch their values (n, p), of mean 0 and deviation 1 over `segments`.

    Stretches of `also` follow on the same scale.
    """
    parts = [probes(s, prepared) for s in (*segments, *also)]
    names = [n for n in parts[0] if all(n in z for z in parts)]
    stacked = [np.stack([z[n] for n in names], axis=1) for z in parts]
    every = np.concatenate(stacked[: len(segments)])
    mean, spread = every.mean(axis=0), every.std(axis=0)
    keep = spread > 1e-9
    return [n for n, k in zip(names, keep, strict=True) if k], [
        ((z - mean) / np.where(spread > 0, spread, 1))[:, keep] for z in stacked
    ]


def added_noise(prepared, segments, noisy) -> list[np.ndarray]:
    """What the sensors' noise, added once more (`noisy`), changes in the channels of each stretch, (n, 12)."""
    clean_rows, noisy_rows = assemble_rows(prepared, [], segments), assemble_rows(prepared, [], noisy)
    return [b.y - a.y for a, b in zip(clean_rows, noisy_rows, strict=True)]


def most_noise(prepared, segments, noisy) -> float:
    """How many times the energy of the noise added can be in the rotors' readings, at least 1.

    Noise that is alike and independent in every rotor has no more energy than the combination of rotors that moves
    least (the smallest eigenvalue of their covariance).
    """
    if not noisy or segments[0].motion.rotor_speed is None:
        return 1.0
    read, added, count = 0.0, 0.0, 0
    for s, n in zip(segments, noisy, strict=True):
        speeds = prepared.thinner(s.motion.rotor_speed)
        noise = prepared.thinner(n.motion.rotor_speed) - speeds
        speeds = speeds - speeds.mean(axis=0)
        read, added, count = read + speeds.T @ speeds, added + float((noise**2).mean(axis=1).sum()), count + len(speeds)
    return max(1.0, float(np.linalg.eigvalsh(read)[0]) / added) if added > 0 else 1.0


def dependence(prepared, model, segments, noisy):
    """p-values per channel that the residual depends on no input and not on the run, before and after; and inputs.

    `noisy` are the segments with the sensors' noise added once more; empty where that is not known.
    """
    names, inputs = standardised(prepared, segments, noisy)
    inputs, again = inputs[: len(segments)], inputs[len(segments) :]
    noise = added_noise(prepared, segments, noisy) if noisy else []
    moved = [b - a for a, b in zip(inputs, again, strict=True)] if noisy else []
    most = most_noise(prepared, segments, noisy)
    full = model.full_fit()
    named = np.where(model.unnamed(full.columns), 0.0, full.beta)
    added = model.contributions.of(full.columns, named)
    before, after, depends = {}, {}, {}
    for c in range(6):
        if not np.isfinite(model.noise[c]):
            continue
        taps = model.regression.filters[c]
        raw = [r.y[:, c] for r in model.rows]
        left = left_by(model.rows, c, added)
        rate_hz = prepared.thinner.rate_hz
        runs = [r.run for r in model.rows]
        shared = [(d[:, c], z) for d, z in zip(noise, moved, strict=True)] or None
        p_before, _ = _wald(raw, inputs, taps, rate_hz, shared, most)
        p_after, t = _wald(left, inputs, taps, rate_hz, shared, most)
        # Neither on the inputs nor on the run: the smaller of two p-values, doubled.
        before[CHANNELS[c]] = min(1.0, 2 * min(p_before, compared(runs, raw, rate_hz)[1]))
        after[CHANNELS[c]] = min(1.0, 2 * min(p_after, compared(runs, left, rate_hz)[1]))
        if p_after < ALARM_P:
            for i in np.argsort(-np.abs(t))[:2]:
                depends.setdefault(names[i], 0)
    return before, after, list(depends)


def left_by(rows, channel: int, added) -> list[np.ndarray]:
    """What contributions `added` (n, 12) leave of a channel, (n,) per stretch; where it is more than there was, that.

    Where a flight hardly excites a value its column is mostly noise, and the correction for that noise can overshoot.
    """
    raw = [r.y[:, channel] for r in rows]
    left = [y - part[:, channel] for y, part in zip(raw, added, strict=True)]
    return left if sum(float(x @ x) for x in left) <= sum(float(y @ y) for y in raw) else raw


def _wald(parts, inputs, taps, rate_hz, shared=None, most=1.0, memory=0):
    """Block-robust Hotelling test of a regression of the whitened residual on the whitened inputs.

    `shared` holds per stretch what one more draw of the sensors' noise changes in residual (n,) and inputs (n, p);
    once to `most` times that is taken away, as much as explains most. Blocks up to `memory` apart may have noise alike.
    """
    size = inputs[0].shape[1]
    blocks, stretches, noise = [], [], np.zeros(size)
    per = max(2, int(_BLOCK_S * rate_hz))
    for k, (y, z) in enumerate(zip(parts, inputs, strict=True)):
        yw, zw = _whitened(y, taps), _whitened(z, taps)
        y_noise, z_noise = (0 * yw, 0 * zw) if shared is None else (_whitened(x, taps) for x in shared[k])
        for i in np.array_split(np.arange(len(yw)), max(1, len(yw) // per)):
            blocks.append((zw[i].T @ zw[i], zw[i].T @ yw[i], len(i)))
            stretches.append(k)
        noise = noise + z_noise.T @ y_noise
    gram = sum(b[0] for b in blocks)
    inverse = np.linalg.pinv(gram, rcond=1e-9, hermitian=True)
    cross = sum(b[1] for b in blocks)
    scale = float(noise @ inverse @ noise)
    noise = noise * float(np.clip(noise @ inverse @ cross / scale, 1.0, most)) if scale > 0 else noise
    beta = inverse @ (cross - noise)
    each = noise / sum(b[2] for b in blocks)
    scores = np.array([c - n * each - g @ beta for g, c, n in blocks])
    plain = inverse
    robust = inverse @ spread_of(scores, np.array(stretches), memory) @ inverse
    covariance = at_least(robust, plain)
    statistic = quadratic_form(beta, covariance)
    count = len(blocks)
    if count - size < 3:
        return 1.0, np.zeros(size)
    p = float(f_distribution.sf(statistic * (count - size) / (size * (count - 1)), size, count - size))
    return p, beta / np.sqrt(np.maximum(np.diag(covariance), 1e-300))


def _whitened(x: np.ndarray, taps: np.ndarray) -> np.ndarray:
    return causal(taps, x)[len(taps) - 1 :]
