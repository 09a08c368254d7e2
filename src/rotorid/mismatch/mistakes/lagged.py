"""Fits of what two sensors say of the same motion, with a free delay, in blocks of the frequency domain.

Y(f) = M X(f) e^(-i 2π f τ) + N Z(f): the matrices real, one delay τ for all; Z are nuisances on Y's own clock.
Every output is weighted by the spectrum of what the fit leaves, so that coloured residuals count for what they
are; covariances are sandwiches over blocks of time, so that they hold whatever the spectrum's model misses.

In each comparison X is the less noisy side, because noise in X would shrink the gain. Comparisons between
position, velocity, attitude, gyroscope and accelerometer hold for any body; those with the rotors use the
believed vehicle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal.windows import hann

from rotorid.mismatch.evidence.motion import rates_from_attitude, stretches
from rotorid.mismatch.mistakes.signals import Signals
from rotorid.recordings import Vehicle
from rotorid.recordings.signal import kernels

BANDS_HZ = {
    "turning": (0.3, 20.0),
    "accelerating": (0.3, 12.0),
    "sideways": (0.3, 6.0),
    "moving": (0.3, 12.0),
    "rolling": (2.0, 25.0),
    "yawing": (0.7, 15.0),
    "lifting": (1.5, 15.0),
    "following": (0.5, 15.0),
}
"""Of each comparison the frequencies that are looked at."""
BLOCK_S = 2.56
_SMOOTHED = 5
"""Neighbouring frequencies over which powers are averaged."""
OVERLAP = 1.94
"""Neighbouring frequencies of a Hann window are correlated: sums of squares vary by this more."""
FEWEST_BLOCKS = 4
LONGEST_LAG_S = 0.15
CAUSES_S = np.arange(0.0, LONGEST_LAG_S + 1e-9, 0.005)
"""How much later than its cause a motion may be."""
_MOTOR_LAGS_S = np.concatenate([[0.0], np.geomspace(0.004, 0.25, 24)])
_DEAD_TIMES_S = np.arange(-0.03, 0.061, 0.005)


@dataclass(frozen=True)
class Blocks:
    """Spectra of blocks of time."""

    frequency_hz: np.ndarray
    """(m,)."""
    y: np.ndarray
    """(b, m, q)."""
    x: np.ndarray
    """(b, m, p)."""
    z: np.ndarray
    """(b, m, r)."""
    run: np.ndarray
    """Run number of each block, (b,)."""
    time_s: np.ndarray
    """Centre of each block since the start of its run, (b,)."""

    @property
    def count(self) -> int:
        return len(self.y)

    def outputs(self, chosen) -> Blocks:
        """The same with some outputs only."""
        return replace(self, y=self.y[:, :, chosen])

    def delayed(self, lag_s) -> Blocks:
        """The same with X late by a time, or by one of each block (b,)."""
        return replace(self, x=self.x * delay(self.frequency_hz, lag_s)[:, :, None])

    def up_to(self, top_hz: float) -> Blocks:
        """The same at frequencies up to `top_hz` only."""
        kept = self.frequency_hz <= top_hz * (1.0 + 1e-9)
        y, x, z = (v[:, kept] for v in (self.y, self.x, self.z))
        return replace(self, frequency_hz=self.frequency_hz[kept], y=y, x=x, z=z)

    def part(self, chosen) -> Blocks:
        """Some of the blocks only."""
        own = (self.y, self.x, self.z, self.run, self.time_s)
        return Blocks(self.frequency_hz, *(v[chosen] for v in own))


def join(parts: list[Blocks | None]) -> Blocks | None:
    """Blocks of several runs as one, None for none."""
    parts = [p for p in parts if p is not None]
    if not parts:
        return None
    own = zip(*((p.y, p.x, p.z, p.run, p.time_s) for p in parts), strict=True)
    return Blocks(parts[0].frequency_hz, *map(np.concatenate, own))


def cut(
    sides: list[np.ndarray], changing: bool, rate_hz: float, band_hz: tuple[float, float], run: int
) -> Blocks | None:
    """Blocks of one run from evenly sampled Y, X and, where there are some, Z, (n, m) each.

    `changing`: Y's derivative is meant. All sides pass the same low-pass, missing samples are left out.
    """
    cutoff = band_hz[1]
    good = np.all([np.isfinite(values).all(axis=1) for values in sides], axis=0)
    oversampling = 5.0  # Rate of the thinned signals over the cutoff.
    # Analysis above the band is thinned away; all runs must share one grid of frequencies.
    step = max(1, int(rate_hz / (oversampling * cutoff)))
    length = int(round(BLOCK_S * rate_hz / step))
    frequency = np.arange(1, int(np.ceil(band_hz[1] * BLOCK_S)) + 1) / BLOCK_S
    used = np.flatnonzero((frequency >= band_hz[0]) & (frequency <= band_hz[1]))
    taper = hann(length, sym=False)[:, None] / np.sqrt(length)
    out = [[] for _ in sides]
    times = []
    flat, slope = kernels.low_pass(rate_hz, 1.2 * cutoff), kernels.derivative(rate_hz, 1.2 * cutoff)
    half = kernels.half_length(rate_hz, 1.2 * cutoff)
    for start, stop in stretches(good):
        if stop - start < 2 * half + length * step:
            continue
        filters = (slope if changing else flat, flat, flat)
        filtered = [kernels.apply(own, v[start:stop])[::step] for own, v in zip(filters, sides, strict=False)]
        for k in range(len(filtered[0]) // length):
            inside = slice(k * length, (k + 1) * length)
            for store, f in zip(out, filtered, strict=True):
                piece = f[inside] - f[inside].mean(axis=0)
                store.append(np.fft.rfft(piece * taper, axis=0)[used + 1])
            times.append((start + half + (k + 0.5) * length * step) / rate_hz)
    if not times:
        return None
    spectra = [np.array(s) for s in out]
    if len(sides) < 3:
        spectra.append(np.zeros((len(times), len(used), 0), complex))
    return Blocks(frequency[used], *spectra, np.full(len(times), run), np.array(times))


@dataclass(frozen=True)
class LaggedFit:
    """A fit with a free delay."""

    lag_s: float
    """How late Y shows what X shows (positive: Y is late, or X is early)."""
    lag_sd: float
    gain: np.ndarray
    """M, (q, p)."""
    gain_sd: np.ndarray
    explained: np.ndarray
    """Share of every output's weighted power that X explains beyond Z, (q,)."""
    weight: np.ndarray
    """1 / power of what is left, (q, m)."""
    nuisance: np.ndarray
    """N, (q, r)."""
    block_count: int


def _noise_weight(blocks: Blocks, left: np.ndarray) -> np.ndarray:
    """1 / power of a residual (b, m, q), with a floor, (q, m)."""
    # Share of an output's own power that is always taken as noise: files hold columns computed from each other.
    perfection = 1e-3
    power, own = (_smooth(np.mean(np.abs(v) ** 2, axis=0)).T for v in (left, blocks.y))
    return 1.0 / (power + perfection * own + 1e-30)


def _coherence(blocks: Blocks) -> np.ndarray:
    """Share of every output's power at each frequency that X explains with any gain and phase, (q, m).

    What chance would explain is taken off. Where only noise is left in X, its size must not shrink the gains.
    """
    x, y = blocks.x, blocks.y
    sxx = _smooth(np.einsum("bmk,bml->mkl", x.conj(), x))
    sxy = _smooth(np.einsum("bmk,bmj->mkj", x.conj(), y))
    syy = _smooth(np.sum(np.abs(y) ** 2, axis=0))
    size = np.sqrt(np.real(np.einsum("mkk->mk", sxx)) + 1e-300)
    scaled = sxx / size[:, :, None] / size[:, None, :] + 1e-9 * np.eye(x.shape[2])
    cross = sxy / size[:, :, None]
    share = np.real(np.einsum("mkj,mkj->mj", cross.conj(), np.linalg.solve(scaled, cross))) / (syy + 1e-300)
    rank = np.mean(np.sum(np.linalg.eigvalsh(scaled) > 1e-3, axis=1))
    chance = min(0.9, rank * OVERLAP / (_SMOOTHED * blocks.count))
    return np.clip((share - chance) / (1 - chance), 0.0, 1.0).T


def _smooth(values: np.ndarray) -> np.ndarray:
    """Running mean along axis 0, over neighbouring frequencies."""
    width = min(_SMOOTHED, len(values))
    pad = [(width // 2, width - 1 - width // 2)] + [(0, 0)] * (values.ndim - 1)
    padded = np.pad(values, pad, mode="edge")
    return sum(padded[k : k + len(values)] for k in range(width)) / width


def _moments(x: np.ndarray, y: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Normal equations of every block with columns x (b, m, K): (b, q, K, K), (b, q, K)."""
    weighted = x.conj()[:, None] * weight[None, :, :, None]
    gram = np.real(np.swapaxes(weighted, 2, 3) @ x[:, None])
    cross = np.real(np.swapaxes(weighted, 2, 3) @ np.swapaxes(y, 1, 2)[..., None])[..., 0]
    return gram, cross


def _by_frequency(blocks: Blocks) -> tuple[np.ndarray, np.ndarray]:
    """Products of X and Z with each other, (m, K, K), and with Y, (m, K, q), summed over the blocks."""
    columns = np.concatenate([blocks.x, blocks.z], axis=2).transpose(1, 0, 2)
    turned = columns.conj().swapaxes(1, 2)
    return turned @ columns, turned @ blocks.y.transpose(1, 0, 2)


def _explained_at(products: tuple[np.ndarray, np.ndarray], weight: np.ndarray, transfer: np.ndarray) -> np.ndarray:
    """Weighted squares that all columns explain together where they pass transfers (l, m, K), (l,)."""
    inside, with_y = products
    back = transfer.conj()
    gram = np.real(back[..., None] * transfer[..., None, :] * inside)
    gram = (weight @ gram.reshape(*gram.shape[:2], -1)).reshape(len(transfer), len(weight), *inside.shape[1:])
    cross = np.einsum("qm,lmkq->lqk", weight, np.real(back[..., None] * with_y))
    return np.sum(_solve(gram, cross) * cross, axis=(1, 2))


def _solve(gram: np.ndarray, cross: np.ndarray) -> np.ndarray:
    scale = 1.0 / np.sqrt(np.einsum("...kk->...k", gram) + 1e-300)
    scaled_gram = gram * scale[..., None] * scale[..., None, :] + 1e-9 * np.eye(gram.shape[-1])
    return scale * np.linalg.solve(scaled_gram, (cross * scale)[..., None])[..., 0]


def delay(frequency_hz: np.ndarray, lag_s) -> np.ndarray:
    """e^(-i 2π f τ), (1 or b, m)."""
    return np.exp(-2j * np.pi * np.atleast_1d(lag_s)[:, None] * frequency_hz[None, :])


def fit(blocks: Blocks | None, lags_s: np.ndarray | None = None) -> LaggedFit | None:
    """The best delay with free real gains; None where there are too few blocks.

    `lags_s` is the grid to search, `[0]` to hold it there; the delay stays between its ends.
    """
    if blocks is None or blocks.count < FEWEST_BLOCKS:
        return None
    frequency = blocks.frequency_hz
    if lags_s is None:
        step = 1.0 / (8 * frequency[-1])
        lags_s = np.arange(-LONGEST_LAG_S, LONGEST_LAG_S + step / 2, step)
    ends = lags_s[0], lags_s[-1]
    trusted = _coherence(blocks) + 1e-6
    weight = trusted * _noise_weight(blocks, blocks.y)
    products = _by_frequency(blocks)

    def explained_by(lags: np.ndarray) -> np.ndarray:
        late = np.repeat(delay(frequency, lags)[:, :, None], blocks.x.shape[2], axis=2)
        not_late = np.ones((*late.shape[:2], blocks.z.shape[2]))
        return _explained_at(products, weight, np.concatenate([late, not_late], axis=2))

    for _ in range(2):
        lag = _peak(lags_s, explained_by(lags_s))
        if len(lags_s) > 1:
            step = lags_s[1] - lags_s[0]
            fine = _within(lag + np.linspace(-1, 1, 5) * step / 4, ends)
            lag = _peak(fine, explained_by(fine))
            lags_s = _within(lag + np.linspace(-3, 3, 13) * step, ends)
        x = np.concatenate([blocks.delayed(lag).x, blocks.z], axis=2)
        gram_b, cross_b = _moments(x, blocks.y, weight)
        weight = trusted * _noise_weight(blocks, blocks.y - x @ _solve(gram_b.sum(axis=0), cross_b.sum(axis=0)).T)
    gram_b, cross_b = _moments(x, blocks.y, weight)
    gram, cross = gram_b.sum(axis=0), cross_b.sum(axis=0)
    beta = _solve(gram, cross)
    left = blocks.y - x @ beta.T
    q, p = len(beta), blocks.x.shape[2]
    count = blocks.count
    sd = np.zeros_like(beta)
    for j in range(q):
        inverse = np.linalg.pinv(gram[j], hermitian=True)
        score = cross_b[:, j] - gram_b[:, j] @ beta[j]
        spread = inverse @ (score.T @ score) @ inverse * count / (count - 1)
        sd[j] = np.sqrt(np.maximum(np.diag(spread), np.diag(inverse)))
    # The delay's derivative -i 2π f M X is orthogonal to every real multiple of X itself, but not to Z.
    model = x[:, :, :p] @ beta[:, :p].T
    turn = beyond_nuisances(-2j * np.pi * frequency[None, :, None] * model, blocks.z, weight)
    w = weight.T[None]
    score = np.real(np.sum(w * turn.conj() * left, axis=(1, 2)))
    curvature = float(np.sum(w * np.abs(turn) ** 2))
    lag_sd = float(np.sqrt(max(np.sum(score**2) * count / (count - 1), curvature))) / max(curvature, 1e-300)
    without = _solve(gram[:, p:, p:], cross[:, p:]) if blocks.z.shape[2] else np.zeros((q, 0))
    rest = blocks.y - blocks.z @ without.T
    explained = 1 - np.sum(w * np.abs(left) ** 2, axis=(0, 1)) / np.sum(w * np.abs(rest) ** 2, axis=(0, 1))
    return LaggedFit(float(lag), lag_sd, beta[:, :p], sd[:, :p], explained, weight, beta[:, p:], count)


def pieces(frequency_hz: np.ndarray) -> list[np.ndarray]:
    """Places of the frequencies that make a piece each."""
    # Frequencies of a block that count as one piece: with Hann's window only next neighbours are correlated, so that
    # the pieces of a block are nearly independent. Short flights have too few blocks to be judged by: what stands at
    # eight standard errors is no chance, and yet 1 in 20,000 by Student's t of eight blocks.
    piece_bins = 6
    return np.array_split(np.arange(frequency_hz.size), max(1, frequency_hz.size // piece_bins))


def beyond_nuisances(turn: np.ndarray, z: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """A delay's derivative (b, m, q) without what the nuisances Z could take over (damping looks like a lead)."""
    if not z.shape[2]:
        return turn
    out = np.empty_like(turn)
    for j in range(turn.shape[2]):
        w = weight[j][None, :, None]
        gram = np.real(np.einsum("bmk,bml->kl", z.conj() * w, z))
        cross = np.real(np.einsum("bmk,bm->k", z.conj() * w, turn[:, :, j]))
        out[:, :, j] = turn[:, :, j] - z @ (np.linalg.pinv(gram, hermitian=True) @ cross)
    return out


def _within(lags_s: np.ndarray, ends: tuple[float, float]) -> np.ndarray:
    """Those of some delays that are between two."""
    return lags_s[(lags_s > ends[0] - 1e-9) & (lags_s < ends[1] + 1e-9)]


def _peak(at: np.ndarray, score: np.ndarray) -> float:
    """Where a sampled curve peaks, by a parabola through its highest three samples."""
    k = int(np.argmax(score))
    if k == 0 or k == len(at) - 1:
        return float(at[k])
    a, b, c = score[k - 1 : k + 2]
    bend = a - 2 * b + c
    shift = 0.0 if bend >= 0 else 0.5 * (a - c) / bend
    return float(at[k] + shift * (at[1] - at[0]))


def through_motor(blocks: Blocks) -> tuple[float, Blocks]:
    """Commands replaced by what a first-order motor makes of them, its time constant fitted jointly with the delay."""
    base = fit(blocks)
    if base is None:
        return 0.0, blocks
    trials = {}

    def attempt(tau):
        through = 1.0 / (1.0 + 2j * np.pi * blocks.frequency_hz * tau)
        trial = replace(blocks, x=blocks.x * through[None, :, None])
        found = fit(trial, _DEAD_TIMES_S)
        left = trial.y - trial.delayed(found.lag_s).x @ found.gain.T - trial.z @ found.nuisance.T
        # By the weights of one fit, so that fits can be compared.
        squares = float(np.sum(np.sum(base.weight.T[None] * np.abs(left) ** 2, axis=1)))
        trials[float(tau)] = (squares, abs(found.lag_s), trial)

    for tau in _MOTOR_LAGS_S:
        attempt(tau)
    for width in (0.09, 0.03):
        best = min(trials, key=lambda tau: trials[tau][0])
        for factor in (1 - width, 1 - width / 2, 1 + width / 2, 1 + width):
            attempt(best * factor)
    best = min(trials, key=lambda tau: trials[tau][0])
    undecided = 12.0  # Motor lags within this log-likelihood are not distinguished.
    # Slow motion cannot distinguish a lag from a dead time: where it fits as well with hardly any, there is none.
    plausible = [tau for tau in trials if trials[tau][0] < trials[best][0] + undecided]
    least = min(plausible, key=lambda tau: trials[tau][1])
    chosen = least if trials[least][1] < 0.5 * trials[best][1] else best
    return chosen, trials[chosen][2]


def speeds_of(signals: Signals) -> str | None:
    """Which sensor gives the rotor speeds: measured, else commanded, else throttle."""
    return next((n for n in ("rotors", "commands", "throttle") if n in signals.values), None)


def squared_speeds(signals: Signals, vehicle: Vehicle, sensor: str) -> np.ndarray:
    """Believed thrust of every rotor, (n, k), N; of a throttle only up to its unknown scale."""
    values = signals.values[sensor]
    if sensor == "throttle" and vehicle.rotor_speed_limits_rad_s:
        values = values * vehicle.rotor_speed_limits_rad_s[1]
    return values**2 * vehicle.thrust_coefficients_n_s2()


def _band(all_signals: list[Signals], sensors: tuple[str, ...], wanted: tuple[float, float]) -> tuple[float, float]:
    """A band that the slowest of some sensors can follow in every run."""
    nyquist_share = 0.35  # Highest frequency used, as a share of the slower sensor's own rate.
    rates = [s.own_rate_hz[n] for s in all_signals for n in sensors if n in s.values and s.own_rate_hz[n] > 0]
    return wanted[0], min(wanted[1], nyquist_share * min(rates, default=0.0))


def gather(
    all_signals: list[Signals],
    sensors: tuple[str, ...],
    comparison: str,
    make: Callable[[Signals], tuple[np.ndarray, ...]],
    changing: bool = False,
) -> Blocks | None:
    """Blocks of all runs that have the sensors; `make` gives Y (or, `changing`, what changes by it), X and perhaps Z.

    `comparison` is a key of `BANDS_HZ`.
    """
    limits = _band([s for s in all_signals if set(sensors) <= set(s.values)], sensors, BANDS_HZ[comparison])
    if limits[1] < 2.5 * limits[0]:
        return None
    runs = ((k, s) for k, s in enumerate(all_signals) if set(sensors) <= set(s.values))
    return join([cut([*make(s)], changing, s.rate_hz, limits, k) for k, s in runs])


def turning(all_signals: list[Signals]) -> Blocks | None:
    """Y: body rates from the attitude; X: the gyroscope, rad/s."""

    def make(s: Signals):
        q = s.values["attitude"]
        return rates_from_attitude(q, np.gradient(q, 1.0 / s.rate_hz, axis=0)), s.values["gyroscope"]

    return gather(all_signals, ("attitude", "gyroscope"), "turning", make)


def accelerating(all_signals: list[Signals], vehicle: Vehicle, source: str) -> Blocks | None:
    """Y: derivative of the world velocity; X: specific force turned into the world, m/s².

    `source` is `accelerometer`, or the rotors' sensor, whose thrust over the mass then stands for it.
    """

    def make(s: Signals):
        if source == "accelerometer":
            body = s.values[source]
        else:
            lift = squared_speeds(s, vehicle, source).sum(axis=1) / vehicle.mass_kg
            body = np.stack([np.zeros_like(lift), np.zeros_like(lift), -lift], axis=1)
        return s.values["velocity"], np.einsum("nij,nj->ni", s.rotation(), body)

    return gather(all_signals, ("velocity", "attitude", source), "accelerating", make, changing=True)


def sideways(all_signals: list[Signals], gravity_m_s2: float) -> Blocks | None:
    """Y: specific force that velocity and attitude ask for; X: the accelerometer; body x and y, m/s²."""

    def make(s: Signals):
        slope = np.gradient(s.values["velocity"], 1.0 / s.rate_hz, axis=0)
        body = np.einsum("nji,nj->ni", s.rotation(), slope - np.array([0.0, 0.0, gravity_m_s2]))
        return body[:, :2], s.values["accelerometer"][:, :2]

    return gather(all_signals, ("velocity", "attitude", "accelerometer"), "sideways", make)


def moving(all_signals: list[Signals]) -> Blocks | None:
    """Y: derivative of the position; X: the velocity, m/s, world axes."""
    sensors = ("position", "velocity")
    return gather(all_signals, sensors, "moving", lambda s: tuple(s.values[n] for n in sensors), changing=True)


def rolling(all_signals: list[Signals], vehicle: Vehicle, sensor: str) -> Blocks | None:
    """Y: derivative of the roll and pitch rate; X: what the believed rotors give, rad/s²; Z: the body rates."""
    at, inertia = vehicle.rotor_positions_m(), vehicle.inertia_kg_m2

    def make(s: Signals):
        rate, thrust = s.values["gyroscope"], squared_speeds(s, vehicle, sensor)
        turning = np.stack([-(thrust @ at[:, 1]) / inertia.xx, (thrust @ at[:, 0]) / inertia.yy], axis=1)
        return rate[:, :2], turning, rate

    return gather(all_signals, ("gyroscope", sensor), "rolling", make, changing=True)


def lifting(all_signals: list[Signals], vehicle: Vehicle, sensor: str) -> Blocks | None:
    """Y: accelerometer z; X: minus the believed thrust over the mass, m/s²."""

    def make(s: Signals):
        lift = -squared_speeds(s, vehicle, sensor).sum(axis=1, keepdims=True) / vehicle.mass_kg
        return s.values["accelerometer"][:, 2:], lift

    return gather(all_signals, ("accelerometer", sensor), "lifting", make)


def following(all_signals: list[Signals], sensor: str) -> Blocks | None:
    """Y: one rotor's measured speed; X: its command (or throttle), all rotors stacked as blocks."""
    limits = _band(all_signals, ("rotors", sensor), BANDS_HZ["following"])
    if limits[1] < 2.5 * limits[0]:
        return None
    runs = ((k, s) for k, s in enumerate(all_signals) if {"rotors", sensor} <= set(s.values))
    pairs = ((k, s, [s.values[n][:, i : i + 1] for n in ("rotors", sensor)]) for k, s in runs
             for i in range(s.values["rotors"].shape[1]))  # fmt: skip
    return join([cut(pair, False, s.rate_hz, limits, k) for k, s, pair in pairs])
