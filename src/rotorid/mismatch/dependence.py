"""Does a residual depend on the inputs? A test of independence, not of whiteness, and what is left to explain."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter, welch
from scipy.stats import f as f_distribution

from rotorid.mismatch.motion import Segment
from rotorid.mismatch.prepare import assemble_rows
from rotorid.mismatch.regression import at_least, quadratic_form
from rotorid.mismatch.rows import CHANNELS
from rotorid.mismatch.unknowns import DEPENDS_ON, UNKNOWNS

ALARM_P = 1e-5
SMALLEST_SHARE_OF_NOISE = 0.3
"""A left-over dependence below this share of the noise is not worth a word."""
MOST_BY_VALUES = 0.8
"""Share up to which mismatch that some believed value would explain counts as left over: its kind is known."""
BLOCK_S = 2.0
SLOW_BANDS_HZ = ((0.15, 0.7), (0.7, 2.5))
FAST_BAND = (0.3, 0.75)
"""Band, as shares of the cutoff, that tells by how much the sensors' noise is more than its white part."""
SLOW_EXCESS = 16.0
"""Times more power than the sensors' noise, relative to the fast band, that slow changes must have to be noise no
more: coloured noise of the sensors stays below four, see benchmarks/mismatch.md."""
WELCH_S = 8.0


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
    named = np.where(model.unnamed(full.columns), 0.0, full.beta)
    before, after, depends = {}, {}, {}
    for c in range(6):
        if not np.isfinite(model.noise[c]):
            continue
        taps = model.regression.filters[c]
        raw = [r.y[:, c] for r in model.rows]
        left = left_by(model.rows, c, full.columns, named)
        before[CHANNELS[c]], _ = _wald(raw, inputs, taps, prepared.thinner.rate_hz)
        after[CHANNELS[c]], t = _wald(left, inputs, taps, prepared.thinner.rate_hz)
        if after[CHANNELS[c]] < ALARM_P:
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


def slow_excess(prepared, model, segments, noisy) -> dict[str, tuple[float, float]]:
    """Slow changes of the residual that the sensors cannot have made: channel to (rms in its unit, frequency in Hz).

    A regression on known inputs cannot see a mass that slides or a tank that slops; the noise can: it is known what
    the sensors' own noise does to each channel (`noisy` are the same segments with that noise added once more).
    """
    if not noisy or not all(s.measured_speed for s in segments):
        return {}  # what rotors make of their commands is not known well enough
    rate = prepared.thinner.rate_hz
    fast = tuple(share * prepared.thinner.cutoff_hz for share in FAST_BAND)
    full = model.regression.fit(model.search.always + model.selection.active)
    clean_rows, noisy_rows = assemble_rows(prepared, [], segments), assemble_rows(prepared, [], noisy)
    out = {}
    for c in range(6):
        if not np.isfinite(model.noise[c]):
            continue
        left = left_by(model.rows, c, full.columns, full.beta)
        added = [b.y[:, c] - a.y[:, c] for a, b in zip(clean_rows, noisy_rows, strict=True)]
        frequency, found = _spectrum(left, rate)
        if frequency is None:
            continue
        _, expected = _spectrum(added, rate)
        at = (frequency >= fast[0]) & (frequency <= fast[1])
        level = max(1.0, float(found[at].mean() / max(expected[at].mean(), 1e-300)))
        for low, high in SLOW_BANDS_HZ:
            band = (frequency >= low) & (frequency < high)
            if not band.any() or found[band].mean() < SLOW_EXCESS * level * expected[band].mean():
                continue
            excess = float(np.sum((found - level * expected)[band]) * (frequency[1] - frequency[0]))
            if np.sqrt(max(excess, 0.0)) < SMALLEST_SHARE_OF_NOISE * model.noise[c]:
                continue
            before = out.get(CHANNELS[c], (0.0, 0.0))[0]
            peak = float(frequency[band][np.argmax(found[band])])
            out[CHANNELS[c]] = (float(np.hypot(before, np.sqrt(excess))), peak)
    return out


def _spectrum(parts, rate_hz: float):
    """Mean power spectrum of stretches of at least WELCH_S: frequency in Hz and density; (None, None) without any."""
    size = int(WELCH_S * rate_hz)
    long = [p for p in parts if len(p) >= size]
    if not long:
        return None, None
    total = sum(len(p) for p in long)
    spectra = [welch(p, fs=rate_hz, nperseg=size) for p in long]
    return spectra[0][0], sum(s[1] * len(p) for s, p in zip(spectra, long, strict=True)) / total


def leftover(prepared, model, segments, noisy, before, after, depends, delivered=None):
    """Share of the mismatch that no named effect explains, its channels, on what it depends, and a plain description.

    Four things count: empirical terms that won against the catalogue, what a ridge regression on all inputs and
    their products ("whatever could be explained") still finds, fitted on the training runs and judged held out,
    slow changes that no sensor's noise can have made, and what the residuals `delivered` ((n, 12) per stretch; None
    where nothing is claimed) keep because no believed value by itself could be called wrong.
    """
    slow = slow_excess(prepared, model, segments, noisy)
    names, inputs = _stack(prepared, segments)
    full = model.regression.fit(model.search.always + model.selection.active)
    unnamed = model.unnamed(full.columns)
    training = [r.run in prepared.split.training for r in model.rows]
    if prepared.split.training == prepared.split.held_out:
        training = [True] * len(training)
    judged = [i for i, t in enumerate(training) if not t] or list(range(len(training)))
    features = [_features(z) for z in inputs]
    size = features[0].shape[1]
    gram = sum(f.T @ f for f, t in zip(features, training, strict=True) if t)
    weights = gram + 1e-2 * np.trace(gram) / size * np.eye(size)
    total_before = total_after = by_values = 0.0
    channels, gains, unsettled = [], [], []
    for c in range(6):
        name = CHANNELS[c]
        if name not in after:
            continue
        left = left_by(model.rows, c, full.columns, full.beta)
        empirical = [r.x[:, c][:, full.columns[unnamed]] @ full.beta[unnamed] for r in model.rows]
        cross = sum(f.T @ e for f, e, t in zip(features, left, training, strict=True) if t)
        beta = np.linalg.solve(weights, cross)
        energy = sum(float(left[i] @ left[i]) for i in judged)
        flexible = sum(float(np.sum((left[i] - features[i] @ beta) ** 2)) for i in judged)
        start = sum(float(model.rows[i].y[:, c] @ model.rows[i].y[:, c]) for i in judged)
        outside = sum(float(empirical[i] @ empirical[i]) for i in judged)
        count = sum(len(left[i]) for i in judged)
        flexible = min(flexible, energy)
        noise = flexible / count
        seen = np.sqrt(outside / count) > SMALLEST_SHARE_OF_NOISE * np.sqrt(noise)
        diffuse = after[name] < ALARM_P and energy - flexible > SMALLEST_SHARE_OF_NOISE**2 * flexible
        moving = count * slow[name][0] ** 2 if name in slow else 0.0
        # What moves slowly is no noise: shares are of what the named effects could have explained.
        flexible = max(flexible - moving, 0.1 * flexible)
        total_before += max(start - flexible, 0.0) / flexible
        told = energy if delivered is None else sum(float(delivered[i][:, c] @ delivered[i][:, c]) for i in judged)
        kept = kept_by_values(told, energy + outside, count * noise)
        if not (seen or diffuse or moving or kept):
            continue
        channels.append(name)
        gone = (outside if seen else 0.0) + (energy - flexible if diffuse else 0.0)
        gone = max(gone, moving)
        total_after += gone / flexible
        by_values += kept / flexible
        gone += kept
        unsettled += [name] if kept else []
        gains.append(
            f"{name} from {np.sqrt((flexible + gone) / count):.3g} to {np.sqrt(flexible / count):.3g} {_unit(name)}"
        )
    if not channels or total_before <= 0:
        return 0.0, (), (), ""
    unknown = [model.search.terms[k].effect for k in model.selection.active]
    unknown = [UNKNOWNS[e] for e in unknown if e in UNKNOWNS]
    depends = list(dict.fromkeys([v for e in unknown for v in DEPENDS_ON[e.id]] + (depends if not unknown else [])))
    causes = " and ".join(e.sentence for e in unknown)
    if slow:
        depends = list(dict.fromkeys([*depends, "time_s"]))
        peaks = [f"{name} around {hz:.1f} Hz, {rms:.2g} {_unit(name)} rms" for name, (rms, hz) in slow.items()]
        moving = f"it changes slowly in a way that no column follows ({'; '.join(peaks)})"
        causes = f"{causes} and {moving}" if causes else moving
    if causes or not unsettled:
        causes = causes or f"{', '.join(channels)} still depend on {' and '.join(depends) or 'the inputs'}"
        causes += "; the cause is not in the catalogue"
    if unsettled:
        values = f"what is left of {', '.join(unsettled)} cannot be put down to any one believed value"
        causes = f"{causes}; {values}" if causes else values
    text = f"{causes} (a plain empirical term would lower {', '.join(gains)})"
    share = total_after / total_before
    share = max(share, min(share + by_values / total_before, MOST_BY_VALUES))
    return float(min(1.0, share)), tuple(channels), tuple(depends), text


def kept_by_values(delivered: float, fitted: float, noise: float) -> float:
    """Energy that what is delivered leaves beyond the model with every value free (`fitted`); 0 below the noise's."""
    kept = delivered - fitted
    return kept if kept > noise else 0.0


def _unit(channel: str) -> str:
    return "N m" if channel.startswith("moment") else "N"


def _features(z: np.ndarray) -> np.ndarray:
    """Inputs and their pairwise products, (n, p + p(p+1)/2)."""
    i, j = np.triu_indices(z.shape[1])
    return np.concatenate([z, z[:, i] * z[:, j]], axis=1)
