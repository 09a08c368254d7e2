"""What no named effect explains: in which channels, what it depends on (a test of independence, not of whiteness), and
a plain description.

Slow changes of a residual that the sensors cannot have made: a mass that slides, a tank that slops.

Does a residual depend on the inputs? A test of independence, not of whiteness.

Residual and inputs are made from the same readings, so a sensor's noise stands in both: where a flight hardly changes
the thrust, the tachometers' noise alone makes the residual depend on it. What that noise adds to the cross moments is
learnt by adding the same noise once more, and taken away (Fuller, Measurement Error Models, 1987, ch. 2). A
tachometer's noise may be coloured, and stronger in the band of the rows than its white part: a residual that some
possible strength of it explains is no dependence.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import welch

from rotorid.mismatch.decide.dependence import (
    ALARM_P,
    SMALLEST_SHARE_OF_NOISE,
    Flexible,
    energy_of,
    standardised,
    wald,
    with_products,
)
from rotorid.mismatch.decide.words import WRENCH_WORDS, listed
from rotorid.mismatch.evidence.comparison import DifferingMeans, apart, compared
from rotorid.mismatch.evidence.motion import Segment
from rotorid.mismatch.evidence.rows import CHANNELS
from rotorid.mismatch.evidence.unknowns import DEPENDS_ON, UNKNOWNS
from rotorid.mismatch.flight.prepare import assemble_rows
from rotorid.mismatch.flight.wrench import WORTH_STATING, channel_floor

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


def leftover(
    prepared, model, segments, noisy, p_after, depends, delivered=None, claimed=True
) -> tuple[tuple[str, ...], tuple[str, ...], str]:
    """What no named effect explains of the force and moment channels: channels, inputs and a description.

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
    # Energy relative to the noise's from which what only free values explain counts by itself, without any claim.
    unclaimed = 3.0
    channels = _channels_of(
        prepared, model, segments, full, added, slow, p_after, delivered, 1.0 if claimed else unclaimed
    )
    left = [c for c in channels if c.counts]
    if not left:
        return (), (), ""
    unknown = [UNKNOWNS[e] for e in (model.search.terms[k].effect for k in model.selection.active) if e in UNKNOWNS]
    on = [v for e in unknown for v in DEPENDS_ON[e.id]] + ([] if unknown else list(depends))
    on += ["time_s"] if slow else []
    on += ["run"] if any(c.between for c in left) else []
    text = _description(left, [e.sentence for e in unknown], slow, list(depends))
    return tuple(c.name for c in left), tuple(dict.fromkeys(on)), text


def _channels_of(prepared, model, segments, full, added, slow, p_after, delivered, least) -> list[_ChannelLeftover]:
    """Every channel that has a p-value, taken apart; judged on the runs held out, fitted on the others.

    `full` is the fit of the whole model, `added` (n, 12) of each stretch what it makes of the channels; `least` is how
    much of the noise's energy must be kept by values to count.
    """
    inputs = standardised([probes(s, prepared) for s in segments])[1]
    unnamed = model.unnamed(full.columns)
    runs = [r.run for r in model.rows]
    flexible_of = Flexible([with_products(z) for z in inputs], runs, prepared.split)
    judged = flexible_of.judged
    least_noise = WORTH_STATING * channel_floor(segments, prepared.vehicle)
    out = []
    for c, name in enumerate(CHANNELS[:6]):
        if name not in p_after:
            continue
        left = left_by(model.rows, c, added)
        empirical = [r.x[:, c][:, full.columns[unnamed]] @ full.beta[unnamed] for r in model.rows]
        count = sum(len(left[i]) for i in judged)
        energy, flexible = flexible_of.energies(left)
        outside = energy_of(empirical[i] for i in judged)
        # A simulator without noise leaves nothing, and any share of nothing is large.
        flexible = max(flexible, count * least_noise[c] ** 2)
        diffuse = p_after[name] < ALARM_P and energy - flexible > SMALLEST_SHARE_OF_NOISE**2 * flexible
        between = apart(runs, left, prepared.thinner.rate_hz, float(model.noise[c]))
        # The runs held out may be like each other: all runs are judged by their means.
        shifted = 0.0 if between is None else count * between.mean_square(runs, [len(x) for x in left])
        moving = count * slow[name][0] ** 2 if name in slow else 0.0
        delivered_energy = energy if delivered is None else energy_of(delivered[i][:, c] for i in judged)
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


def _description(
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


def _unit(channel: str) -> str:
    return "N m" if channel.startswith("moment") else "N"


def slow_excess(prepared, model, segments, noisy, contributions) -> dict[str, tuple[float, float]]:
    """Slow changes of the residual that the sensors cannot have made: channel to (rms in its unit, frequency in Hz).

    A regression on known inputs cannot see a mass that slides or a tank that slops; the noise can: it is known what
    the sensors' own noise does to each channel (`noisy` are the same segments with that noise added once more).
    `contributions` (n, 12) of each stretch are the whole model's.
    """
    if not noisy:
        return {}
    rate = prepared.thinner.rate_hz
    # Band, as shares of the cutoff, that shows by how much the sensors' noise is more than its white part.
    fast_band = (0.3, 0.75)
    fast = tuple(share * prepared.thinner.cutoff_hz for share in fast_band)
    noise = _added_noise(prepared, segments, noisy)
    out = {}
    slow_bands_hz = ((0.15, 0.7), (0.7, 2.5))
    # Times more power than the sensors' noise, relative to the fast band, that slow changes must have to be noise no
    # more: coloured noise of the sensors stays below four, see benchmarks/mismatch.md.
    least_excess = 16.0
    # Channels of the force across the rotors' axis: what rotors make of their commands is not known well enough for the
    # others.
    across = (0, 1)
    for c in range(6) if all(s.measured_speed for s in segments) else across:
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
        for low, high in slow_bands_hz:
            band = (frequency >= low) & (frequency < high)
            if not band.any() or found[band].mean() < least_excess * level * expected[band].mean():
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
    """Mean power spectrum of stretches of at least `welch_s`: frequency in Hz and density; (None, None) without any."""
    welch_s = 8.0
    size = int(welch_s * rate_hz)
    long = [p for p in parts if len(p) >= size]
    if not long:
        return None, None
    total = sum(len(p) for p in long)
    spectra = [welch(p, fs=rate_hz, nperseg=size) for p in long]
    return spectra[0][0], sum(s[1] * len(p) for s, p in zip(spectra, long, strict=True)) / total


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


def _added_noise(prepared, segments, noisy) -> list[np.ndarray]:
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
    names, inputs = standardised([probes(s, prepared) for s in (*segments, *noisy)], len(segments))
    inputs, again = inputs[: len(segments)], inputs[len(segments) :]
    noise = _added_noise(prepared, segments, noisy) if noisy else []
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
        p_before, _ = wald(raw, inputs, taps, rate_hz, shared, most)
        p_after, t = wald(left, inputs, taps, rate_hz, shared, most)
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
