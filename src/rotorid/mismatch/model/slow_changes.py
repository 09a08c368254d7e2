"""Slow changes of a residual that the sensors cannot have made: a mass that slides, a tank that slops."""

from __future__ import annotations

import numpy as np
from scipy.signal import welch

from rotorid.mismatch.model.dependence import SMALLEST_SHARE_OF_NOISE, added_noise, left_by
from rotorid.mismatch.plant.rows import CHANNELS

SLOW_BANDS_HZ = ((0.15, 0.7), (0.7, 2.5))
FAST_BAND = (0.3, 0.75)
"""Band, as shares of the cutoff, that shows by how much the sensors' noise is more than its white part."""
SLOW_EXCESS = 16.0
"""Times more power than the sensors' noise, relative to the fast band, that slow changes must have to be noise no
more: coloured noise of the sensors stays below four, see benchmarks/mismatch.md."""
WELCH_S = 8.0
ACROSS = (0, 1)
"""Channels of the force across the rotors' axis: what rotors make of their commands is not known well enough for the
others."""


def slow_excess(prepared, model, segments, noisy, contributions) -> dict[str, tuple[float, float]]:
    """Slow changes of the residual that the sensors cannot have made: channel to (rms in its unit, frequency in Hz).

    A regression on known inputs cannot see a mass that slides or a tank that slops; the noise can: it is known what
    the sensors' own noise does to each channel (`noisy` are the same segments with that noise added once more).
    `contributions` (n, 12) of each stretch are the whole model's.
    """
    if not noisy:
        return {}
    rate = prepared.thinner.rate_hz
    fast = tuple(share * prepared.thinner.cutoff_hz for share in FAST_BAND)
    noise = added_noise(prepared, segments, noisy)
    out = {}
    for c in range(6) if all(s.measured_speed for s in segments) else ACROSS:
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
    size = int(WELCH_S * rate_hz)
    long = [p for p in parts if len(p) >= size]
    if not long:
        return None, None
    total = sum(len(p) for p in long)
    spectra = [welch(p, fs=rate_hz, nperseg=size) for p in long]
    return spectra[0][0], sum(s[1] * len(p) for s, p in zip(spectra, long, strict=True)) / total
