"""What no named effect explains: in which channels, what it depends on, and a plain description.

Slow changes of a residual that the sensors cannot have made: a mass that slides, a tank that slops.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import welch

from rotorid.mismatch.decision.words import WRENCH_WORDS, listed
from rotorid.mismatch.model.dependence import ALARM_P, SMALLEST_SHARE_OF_NOISE, added_noise, left_by, standardised
from rotorid.mismatch.model.wrench import WORTH_STATING, channel_floor
from rotorid.mismatch.plant.between_runs import DifferingMeans, apart
from rotorid.mismatch.plant.rows import CHANNELS
from rotorid.mismatch.plant.unknowns import DEPENDS_ON, UNKNOWNS

_SLOW_BANDS_HZ = ((0.15, 0.7), (0.7, 2.5))
_FAST_BAND = (0.3, 0.75)
"""Band, as shares of the cutoff, that shows by how much the sensors' noise is more than its white part."""
_SLOW_EXCESS = 16.0
"""Times more power than the sensors' noise, relative to the fast band, that slow changes must have to be noise no
more: coloured noise of the sensors stays below four, see benchmarks/mismatch.md."""
_WELCH_S = 8.0
_ACROSS = (0, 1)
"""Channels of the force across the rotors' axis: what rotors make of their commands is not known well enough for the
others."""
_UNCLAIMED = 3.0
"""Energy relative to the noise's from which what only free values explain counts by itself, without any claim."""
_LEAST_NOISE = 0.1
"""Share of what a flexible regression leaves that is noise, whatever else moves in it."""


@dataclass(frozen=True)
class _ChannelLeftover:
    """What one channel holds on the stretches judged, as energies: sums of squares, N² or N² m²."""

    name: str
    count: int
    noise: float
    """What is left when everything that could be explained is taken away."""
    empirical: float
    """Of the empirical terms that won against the catalogue."""
    diffuse: float
    """What a flexible regression on all inputs still explains."""
    slow: float
    """Slow changes that no sensor makes."""
    between: DifferingMeans | None
    """Means that differ between runs."""
    shifted: float
    """Energy of those means."""
    by_values: float
    """What is delivered keeps because no believed value by itself could be called wrong."""

    @property
    def unexplained(self) -> float:
        """Energy whose cause no named effect and no believed value holds."""
        return max(self.empirical + self.diffuse, self.slow + self.shifted)

    @property
    def counts(self) -> bool:
        """Whether anything is left over here."""
        return self.unexplained > 0 or self.by_values > 0


@dataclass(frozen=True)
class _Leftover:
    """What stays unexplained: channels, inputs and a description."""

    channels: tuple[str, ...] = ()
    depends_on: tuple[str, ...] = ()
    description: str = ""


def leftover(prepared, model, segments, noisy, p_after, depends, delivered=None, claimed=True) -> _Leftover:
    """What no named effect explains of the force and moment channels.

    Five things count: empirical terms that won against the catalogue, what a ridge regression on all inputs and
    their products ("whatever could be explained") still finds, fitted on the training runs and judged held out,
    slow changes that no sensor's noise can have made, means that differ between runs, and what the residuals
    `delivered` ((n, 12) per stretch; None where values stay within their trust) keep because no believed value by
    itself could be called wrong (where nothing is `claimed` only as much as makes the error twice the noise's).
    `p_after` and `depends` are those of `dependence`.
    """
    full = model.full_fit()
    added = model.contributions.of(full.columns, full.beta)
    slow = slow_excess(prepared, model, segments, noisy, added)
    channels = _channels_of(
        prepared, model, segments, full, added, slow, p_after, delivered, 1.0 if claimed else _UNCLAIMED
    )
    left = [c for c in channels if c.counts]
    if not left:
        return _Leftover()
    unknown = [UNKNOWNS[e] for e in (model.search.terms[k].effect for k in model.selection.active) if e in UNKNOWNS]
    on = [v for e in unknown for v in DEPENDS_ON[e.id]] + ([] if unknown else list(depends))
    on += ["time_s"] if slow else []
    on += ["run"] if any(c.between for c in left) else []
    return _Leftover(
        tuple(c.name for c in left),
        tuple(dict.fromkeys(on)),
        description(left, [e.sentence for e in unknown], slow, list(depends)),
    )


def _channels_of(prepared, model, segments, full, added, slow, p_after, delivered, least) -> list[_ChannelLeftover]:
    """Every channel that has a p-value, taken apart; judged on the runs held out, fitted on the others.

    `full` is the fit of the whole model, `added` (n, 12) of each stretch what it makes of the channels; `least` is how
    much of the noise's energy must be kept by values to count.
    """
    _, inputs = standardised(prepared, segments)
    unnamed = model.unnamed(full.columns)
    training = [r.run in prepared.split.training for r in model.rows]
    if prepared.split.training == prepared.split.held_out:
        training = [True] * len(training)
    judged = [i for i, t in enumerate(training) if not t] or list(range(len(training)))
    features = [_features(z) for z in inputs]
    size = features[0].shape[1]
    gram = sum(f.T @ f for f, t in zip(features, training, strict=True) if t)
    weights = gram + 1e-2 * np.trace(gram) / size * np.eye(size)
    runs = [r.run for r in model.rows]
    least_noise = WORTH_STATING * channel_floor(segments, prepared.vehicle)
    out = []
    for c, name in enumerate(CHANNELS[:6]):
        if name not in p_after:
            continue
        left = left_by(model.rows, c, added)
        empirical = [r.x[:, c][:, full.columns[unnamed]] @ full.beta[unnamed] for r in model.rows]
        cross = sum(f.T @ e for f, e, t in zip(features, left, training, strict=True) if t)
        beta = np.linalg.solve(weights, cross)
        count = sum(len(left[i]) for i in judged)
        energy = _energy(left[i] for i in judged)
        outside = _energy(empirical[i] for i in judged)
        flexible = min(_energy(left[i] - features[i] @ beta for i in judged), energy)
        # A simulator without noise leaves nothing, and any share of nothing is large.
        flexible = max(flexible, count * least_noise[c] ** 2)
        diffuse = p_after[name] < ALARM_P and energy - flexible > SMALLEST_SHARE_OF_NOISE**2 * flexible
        between = apart(runs, left, prepared.thinner.rate_hz, float(model.noise[c]))
        # The runs held out may be like each other: all runs are judged by their means.
        shifted = 0.0 if between is None else count * between.mean_square(runs, [len(x) for x in left])
        moving = count * slow[name][0] ** 2 if name in slow else 0.0
        delivered_energy = energy if delivered is None else _energy(delivered[i][:, c] for i in judged)
        # What moves slowly, or between runs, is no noise.
        noise = max(flexible - moving - shifted, _LEAST_NOISE * flexible, 1e-300)
        out.append(
            _ChannelLeftover(
                name,
                count,
                noise,
                empirical=outside if outside > SMALLEST_SHARE_OF_NOISE**2 * flexible else 0.0,
                diffuse=energy - flexible if diffuse else 0.0,
                slow=moving,
                between=between,
                shifted=shifted,
                by_values=kept_by_values(delivered_energy, energy + outside, flexible, least),
            )
        )
    return out


def description(
    channels: Sequence[_ChannelLeftover],
    sentences: Sequence[str],
    slow: Mapping[str, tuple[float, float]],
    depends: Sequence[str],
) -> str:
    """Causes, as far as they can be identified."""
    causes = list(sentences)
    if slow:
        peaks = [
            f"{WRENCH_WORDS[name][0]} around {hz:.1f} Hz, {rms:.2g} {_unit(name)} rms"
            for name, (rms, hz) in slow.items()
        ]
        causes.append(f"it changes slowly in a way that no column follows ({'; '.join(peaks)})")
    causes += [_differing(c.name, c.between) for c in channels if c.between]
    diffuse = [f"the {WRENCH_WORDS[c.name][0]}" for c in channels if c.diffuse > 0]
    if not causes and diffuse:
        still = "still depends" if len(diffuse) == 1 else "still depend"
        causes.append(f"{listed(diffuse)} {still} on {' and '.join(depends) or 'the inputs'}")
    parts = [" and ".join(causes) + "; the cause is not in the catalogue"] if causes else []
    unsettled = [WRENCH_WORDS[c.name][0] for c in channels if c.by_values > 0]
    if unsettled:
        parts.append(
            f"what is left of {listed([f'the {w}' for w in unsettled])} cannot be put down to any one believed value"
        )
    return "; ".join(parts)


def kept_by_values(delivered: float, fitted: float, noise: float, least: float = 1.0) -> float:
    """Energy that what is delivered leaves beyond the model with every value free (`fitted`).

    Nothing below `least` times the noise's: in a calm flight free values make up for much of the noise.
    """
    kept = delivered - fitted
    return kept if kept > least * noise else 0.0


def _differing(channel: str, between: DifferingMeans) -> str:
    """The runs with the lowest and the highest mean, in words."""
    low, high = (pick(between.means, key=between.means.get) for pick in (min, max))
    values = " and ".join(f"{between.means[run]:.2g} {_unit(channel)} in {run}" for run in (low, high))
    name = WRENCH_WORDS[channel][0]
    return f"the {name} is off by another amount in each run ({values}), as if something were changed between flights"


def _energy(parts: Iterable[np.ndarray]) -> float:
    return sum(float(x @ x) for x in parts)


def _unit(channel: str) -> str:
    return "N m" if channel.startswith("moment") else "N"


def _features(z: np.ndarray) -> np.ndarray:
    """Inputs and their pairwise products, (n, p + p(p+1)/2)."""
    i, j = np.triu_indices(z.shape[1])
    return np.concatenate([z, z[:, i] * z[:, j]], axis=1)


def slow_excess(prepared, model, segments, noisy, contributions) -> dict[str, tuple[float, float]]:
    """Slow changes of the residual that the sensors cannot have made: channel to (rms in its unit, frequency in Hz).

    A regression on known inputs cannot see a mass that slides or a tank that slops; the noise can: it is known what
    the sensors' own noise does to each channel (`noisy` are the same segments with that noise added once more).
    `contributions` (n, 12) of each stretch are the whole model's.
    """
    if not noisy:
        return {}
    rate = prepared.thinner.rate_hz
    fast = tuple(share * prepared.thinner.cutoff_hz for share in _FAST_BAND)
    noise = added_noise(prepared, segments, noisy)
    out = {}
    for c in range(6) if all(s.measured_speed for s in segments) else _ACROSS:
        if not np.isfinite(model.noise[c]):
            continue
        left = left_by(model.rows, c, contributions)
        added = [x[:, c] for x in noise]
        frequency, found = _spectrum(left, rate)
        if frequency is None:
            continue
        _, expected = _spectrum(added, rate)
        at = (frequency >= fast[0]) & (frequency <= fast[1])
        level = max(1.0, float(found[at].mean() / max(expected[at].mean(), 1e-300)))
        found = np.minimum(found, _moving(prepared, model, contributions, c, left, rate))
        for low, high in _SLOW_BANDS_HZ:
            band = (frequency >= low) & (frequency < high)
            if not band.any() or found[band].mean() < _SLOW_EXCESS * level * expected[band].mean():
                continue
            excess = float(np.sum((found - level * expected)[band]) * (frequency[1] - frequency[0]))
            if np.sqrt(max(excess, 0.0)) < SMALLEST_SHARE_OF_NOISE * model.noise[c]:
                continue
            before = out.get(CHANNELS[c], (0.0, 0.0))[0]
            peak = float(frequency[band][np.argmax(found[band])])
            out[CHANNELS[c]] = (float(np.hypot(before, np.sqrt(excess))), peak)
    return out


def _moving(prepared, model, contributions, channel: int, left, rate_hz: float) -> np.ndarray | float:
    """Spectrum of a force's residual as the velocity shows it, infinite where no accelerometer is compared with one.

    What the accelerometer alone reads moves nothing: a vibration seen through a low sampling rate is slow.
    """
    compared = len(model.noise) // 2 + channel
    if channel > 2 or not np.isfinite(model.noise[compared]):
        return np.inf
    alone = left_by(model.rows, compared, contributions)
    moving = [own - prepared.vehicle.mass_kg * part for own, part in zip(left, alone, strict=True)]
    return _spectrum(moving, rate_hz)[1]


def _spectrum(parts, rate_hz: float):
    """Mean power spectrum of stretches of at least WELCH_S: frequency in Hz and density; (None, None) without any."""
    size = int(_WELCH_S * rate_hz)
    long = [p for p in parts if len(p) >= size]
    if not long:
        return None, None
    total = sum(len(p) for p in long)
    spectra = [welch(p, fs=rate_hz, nperseg=size) for p in long]
    return spectra[0][0], sum(s[1] * len(p) for s, p in zip(spectra, long, strict=True)) / total
