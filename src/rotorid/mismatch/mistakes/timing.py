"""Sensors whose stamps are late against each other, by a constant or by a clock that runs at another rate.

Every comparison of two sensors gives one difference of lateness; all together give each sensor's. The largest
group of sensors that agree is taken as right. What is below one sample is a nuisance for the analysis to carry.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import combinations, permutations

import numpy as np
from scipy.stats import t as student

from rotorid.mismatch.decide.findings import in_interval
from rotorid.mismatch.decide.words import capital, listed
from rotorid.mismatch.mistakes import lagged
from rotorid.mismatch.mistakes.signals import (
    COMMANDED,
    SENSOR_WORDS,
    Corrected,
    ReadSet,
    Signals,
    established,
    on_grid,
    replace_columns,
    sensor_columns,
)
from rotorid.recordings import Run, Vehicle

_LEAST_SHARE = 0.1
"""A sensor that moves a comparison's lateness by less than this share of its own is not connected by it."""
_LEAST_EXPLAINED = 0.6
_P_LIMIT, _P_LATE = 1e-6, 1e-4
"""Chance of a growth of lateness, and of a constant one beyond a sample; both have to bring LEAST_LIKELIHOOD too."""
_LEAST_LIKELIHOOD = 60.0
"""Rise of the log-likelihood that a delay, or its growth, must bring."""
_SMALL_LAGS = {
    "gyroscope": "as its built-in filter makes it; shifted, not counted as a finding",
    "accelerometer": "as its built-in filter makes it; shifted, not counted as a finding",
    "commands": "as motor controllers take; left as part of the motors' lag",
    "throttle": "as motor controllers take; left as part of the motors' lag",
}
_LARGEST_SKEW = 1.2e-2
_COARSE_LAGS_S = np.arange(-0.12, 0.121, 0.01)
_LAG_STEP_S = 0.001


@dataclass(frozen=True)
class _SensorPair:
    """Two sensors that may show each other's time."""

    late: str
    """The later one."""
    over: str
    """The earlier one."""
    blocks: lagged.Blocks
    fit: lagged.LaggedFit
    motor_s: float
    """Motor lag taken out of the command first."""
    shares: tuple[tuple[str, float], ...]
    """Earlier sensors, and by which share of its own lateness each moves this one; the shares sum to one."""

    @property
    def sensors(self) -> tuple[str, ...]:
        """Every sensor of which the lateness counts."""
        return self.late, *(name for name, _ in self.shares)

    def part(self, sensors: Sequence[str]) -> float:
        """By which share of their own lateness some sensors, late together, move this one."""
        return float(self.late in sensors) - sum(share for name, share in self.shares if name in sensors)


@dataclass(frozen=True)
class _LatenessFound:
    """Lateness of one sensor over another at the start of a run, and how it grows."""

    of: _SensorPair
    start_s: float
    growth: float
    """s/s."""
    covariance: np.ndarray
    """(2, 2) of start and growth."""
    likelihood: float
    """Rise of the log-likelihood by start and growth over none."""
    pieces: int
    """Independent pieces of the spectra, from which the covariance is."""
    explained: float
    gained: float
    """Rise of the log-likelihood by the growth over the best constant."""
    bias_s: float
    """The most that disturbances, which the rotors answer in a closed loop, can feign of lateness."""

    def value(self, key: int) -> float:
        """Lateness (key 0), s, or growth (1)."""
        return self.growth if key else self.start_s

    def sd(self, key: int) -> float:
        """One sigma of lateness (key 0) or growth (1)."""
        return float(np.sqrt(max(self.covariance[key, key], 1e-16)))

    def bound(self, key: int) -> float:
        """The most that is feigned of lateness (key 0), or of growth from a run's start to its end (1).

        By disturbances, or by a motor that is not exactly first order, or gets slower as the battery empties. A growth
        must show in every run, and what other disturbances feign in each of them has a mean that is smaller by the root
        of their number.
        """
        # A dead time up to this share of a motor's lag is the lag's form (no motor is exactly first order).
        motor_form = 0.15
        # Share of itself by which a motor's lag grows in a second: no battery loses a tenth of its voltage within 30 s.
        motor_slows_per_s = 0.1 / 30.0
        if key == 0:
            return max(self.bias_s, motor_form * self.of.motor_s)
        blocks = self.of.blocks
        longest_s = float(blocks.time_s.max()) + lagged.BLOCK_S / 2
        disturbed = 2 * self.bias_s / np.sqrt(len(np.unique(blocks.run))) / longest_s
        return max(disturbed, motor_slows_per_s * self.of.motor_s)


def find(recordings: ReadSet) -> Corrected:
    """Clocks that drift first, then constant delays."""
    known = _sensor_pairs(recordings)
    result = _skew(recordings, known)
    return result.then(partial(_delay, known=_sensor_pairs(result.recordings) if result.findings else known))


def _sensor_pairs(recordings: ReadSet) -> list[_SensorPair]:
    """Every comparison of two sensors that may show time."""
    all_signals, vehicle = recordings.signals, recordings.vehicle
    have = set().union(*(s.values for s in all_signals))
    speeds = next((n for n in map(lagged.speeds_of, all_signals) if n), None)
    force = "accelerometer" if "accelerometer" in have else None
    source = force or speeds
    pairs: list[tuple[str, str, lagged.Blocks | None]] = []
    if {"attitude", "gyroscope"} <= have:
        pairs.append(("attitude", "gyroscope", lagged.turning(all_signals)))
    if {"velocity", "attitude"} <= have and (force or speeds in ("rotors", "commands")):
        world = lagged.accelerating(all_signals, vehicle, source)
        if world is not None:
            # Level motion follows the tilt, so it compares with the attitude; vertical motion with the force.
            pairs.append(("velocity", "attitude", world.outputs([0, 1])))
            pairs.append(("velocity", source, world.outputs([2])))
    if {"position", "velocity"} <= have:
        pairs.append(("position", "velocity", lagged.moving(all_signals)))
    if "gyroscope" in have and speeds:
        pairs.append(("gyroscope", speeds, lagged.rolling(all_signals, vehicle, speeds)))
    if force and speeds:
        pairs.append(("accelerometer", speeds, lagged.lifting(all_signals, vehicle, speeds)))
    if "rotors" in have and ("commands" in have or "throttle" in have):
        command = "commands" if "commands" in have else "throttle"
        pairs.append(("rotors", command, lagged.following(all_signals, command)))
    out = []
    for late, over, blocks in pairs:
        if blocks is None:
            continue
        shares, motor_s = ((over, 1.0),), 0.0
        if over in COMMANDED:
            motor_s, blocks = lagged.through_motor(blocks)
        if over == "gyroscope" or (late == "velocity" and source == "accelerometer"):
            blocks = one_quantity(blocks, [2] if (late, over) == ("velocity", source) else range(blocks.y.shape[2]))
            if blocks is None:
                continue
        found = lagged.fit(blocks)
        if late == "gyroscope" and found and np.any(np.diag(found.gain) < 0):
            # A torque that is against the motion is a controller's answer to it, not its cause.
            found = lagged.fit(blocks, lagged.CAUSES_S)
        if found is None or late == "gyroscope" and np.any(np.diag(found.gain) < 0):
            continue
        if late == "velocity":
            shares = _shares_of(all_signals, vehicle, source, [0, 1] if over == "attitude" else [2], found)
        out.append(_SensorPair(late, over, blocks, found, motor_s, shares))
    return out


def one_quantity(blocks: lagged.Blocks, own: Sequence[int]) -> lagged.Blocks | None:
    """The widest band, from the lowest frequency up, in which two sensors show one quantity; None for none.

    Two readings of one quantity have a gain of one, or of a sensor's scale, at every frequency. Where it falls, noise
    decides, and the lateness with it: a vibration seen through aliasing is in an autopilot's estimate of the velocity,
    too, with a phase of its own. `own` says which column of X is the same quantity as each output.
    """
    # Gain between two readings of one quantity, over that at the lowest frequencies, below which noise decides.
    least_gain = 0.97
    # Gain at the lowest frequencies that may be a sensor's scale (a filter's velocity of a fast flight: 1.15).
    scales = (0.85, 1.25)
    lowest, top = blocks.frequency_hz[0], blocks.frequency_hz[-1]
    band_step, least_band = 1.5, 5.0  # Ratio of the bands that are tried, and of the narrowest's ends (0.4 to 2 Hz).
    tops = top / band_step ** np.arange(1 + int(np.log(top / (least_band * lowest)) / np.log(band_step)))
    bands = [b for b in (blocks.up_to(f) for f in tops) if b.frequency_hz.size > 1]
    gains = []
    for band in bands:
        found = lagged.fit(band)
        if found is None:
            return blocks
        gains.append(float(np.mean(found.gain[range(len(own)), own])))
    if not gains or not scales[0] < gains[-1] < scales[1]:
        return None
    return next(b for b, gain in zip(bands, gains, strict=True) if gain > least_gain * gains[-1])


def _shares_of(
    all_signals: list[Signals], vehicle: Vehicle, source: str, outputs: list[int], found: lagged.LaggedFit
) -> tuple[tuple[str, float], ...]:
    """By how much the lateness of the velocity follows that of the attitude, and that of the force turned by it.

    In gentle flight level motion follows the tilt; in a fast one the force itself changes more. Both late together move
    the velocity's lateness by all of it, so that the shares sum to one.
    """
    share_step_s = 0.004  # By how much a sensor is made late to see how far a comparison's lateness follows.
    steps = max(1, round(share_step_s * all_signals[0].rate_hz))
    moved = [_late(s, "attitude", steps) for s in all_signals]
    blocks = lagged.accelerating(moved, vehicle, source)
    again = lagged.fit(blocks.outputs(outputs)) if blocks is not None else None
    if again is None:
        return (("attitude", 1.0),) if outputs == [0, 1] else ((source, 1.0),)
    attitude = float(np.clip((found.lag_s - again.lag_s) * all_signals[0].rate_hz / steps, 0.0, 1.0))
    if attitude < _LEAST_SHARE or attitude > 1.0 - _LEAST_SHARE:
        attitude = round(attitude)
    return tuple((n, x) for n, x in (("attitude", attitude), (source, 1.0 - attitude)) if x > 0)


def _late(signals: Signals, sensor: str, steps: int) -> Signals:
    """Signals with one sensor written some samples late."""
    if sensor not in signals.values:
        return signals
    return replace(signals, values={**signals.values, sensor: _moved(signals.values[sensor], -steps)})


def _difference(of: _SensorPair, drifting: bool, free: bool = True) -> _LatenessFound:
    """Lateness, and its growth if asked for, at the likelihood's peak.

    Where `free`, gains and weights are fitted again with the blocks put on one time, because a drifting clock blurs the
    first fit.
    """
    blocks, found = of.blocks, of.fit
    longest_drift_s = 0.4
    longest = longest_drift_s if drifting else lagged.LONGEST_LAG_S
    lags = np.arange(-longest, longest + 1e-9, _LAG_STEP_S)
    # Only the fast comparisons with the gyroscope blur beyond recognition.
    if free and drifting and np.min(found.explained) < _LEAST_EXPLAINED and "gyroscope" in (of.late, of.over):
        found = _unblurred(blocks, found)
    start, growth = found.lag_s, 0.0
    for _ in range(3 if drifting else 1):
        curves = _likelihood(blocks, found, lags)
        middle = start + growth * float(blocks.time_s.mean())
        start, growth = _peak(lags, curves, blocks.time_s, middle, drifting)
        aligned = blocks.delayed(start + growth * blocks.time_s)
        if free:
            found = lagged.fit(aligned, np.zeros(1))
    # Newton's steps to the peak itself, and the likelihood's shape there.
    model = aligned.x @ found.gain.T
    turn = -2j * np.pi * blocks.frequency_hz[None, :, None] * model
    turn = lagged.beyond_nuisances(turn, blocks.z, found.weight)
    left = blocks.y - model - blocks.z @ found.nuisance.T
    weight = found.weight.T[None]
    parts = lagged.pieces(blocks.frequency_hz)
    slope, bend = np.real(weight * turn.conj() * left), weight * np.abs(turn) ** 2
    slope, bend = (np.concatenate([v[:, m].sum(axis=(1, 2)) for m in parts]) for v in (slope, bend))
    time_s = np.tile(blocks.time_s, len(parts))
    design = np.stack([np.ones(len(time_s)), time_s], axis=1)[:, : 2 if drifting else 1]
    inverse = np.linalg.pinv(design.T @ (design * bend[:, None]), hermitian=True)
    step = inverse @ (design.T @ slope)
    start, growth = start + float(step[0]), growth + (float(step[1]) if drifting else 0.0)
    score = design * (slope - bend * (design @ step))[:, None]
    robust = inverse @ (score.T @ score) @ inverse * len(score) / max(len(score) - design.shape[1], 1)
    covariance = np.zeros((2, 2))
    size = design.shape[1]
    # The likelihood's own curvature counts as a floor.
    covariance[:size, :size] = robust if np.trace(robust) > np.trace(inverse) else inverse
    late_floor_s = 2e-5
    covariance[0, 0] += late_floor_s**2
    unmoved = blocks.y - blocks.x @ found.gain.T - blocks.z @ found.nuisance.T
    rise = float(np.sum(weight * (np.abs(unmoved) ** 2 - np.abs(left) ** 2)))
    gained = 0.0
    if drifting:
        # The aligned fit's likelihood at no further lag is that of the drift itself.
        drift = _likelihood(aligned, found, np.zeros(1)).sum()
        gained = float(drift - _likelihood(blocks, found, lags).sum(axis=0).max())
    explained = float(np.min(found.explained))
    answered = of.over == "rotors" or (of.over in COMMANDED and of.late != "rotors")
    bias_s = _disturbed_s(blocks, found) if answered else 0.0
    return _LatenessFound(of, start, growth, covariance, rise, len(time_s), explained, gained, bias_s)


def _disturbed_s(blocks: lagged.Blocks, found: lagged.LaggedFit) -> float:
    """The most lateness that disturbances can feign where the rotors explain a share E of the motion, s.

    What disturbs a vehicle makes its controller answer, so that what is left of the motion is not independent of the
    rotors. At worst all of it stands a quarter of a period off them: the phase between both is then off by
    arcsin √((1 − E)/E), and the lateness by that over the mean angular frequency, weighted as the fit weighs it.
    """
    share = np.clip(found.explained, 0.5, 1.0)
    phase = np.arcsin(np.sqrt((1.0 - share) / share))
    power = found.weight * np.mean(np.abs(blocks.x @ found.gain.T) ** 2, axis=0).T
    angular = 2 * np.pi * blocks.frequency_hz
    return float((phase[:, None] * power * angular).sum() / (power * angular**2).sum())


def _unblurred(blocks: lagged.Blocks, found: lagged.LaggedFit) -> lagged.LaggedFit:
    """The fit at the coarse growth that explains most, its delay that of the middle of the runs."""
    aside = blocks.time_s - blocks.time_s.mean()
    best = found
    coarse_skews = 6
    for rate in np.arange(-coarse_skews, coarse_skews + 1) * _LARGEST_SKEW / coarse_skews:
        trial = lagged.fit(blocks.delayed(rate * aside), _COARSE_LAGS_S)
        if np.min(trial.explained) > np.min(best.explained):
            best = trial
    return best


def _likelihood(blocks: lagged.Blocks, found: lagged.LaggedFit, lags: np.ndarray) -> np.ndarray:
    """Log-likelihood of every lag in every block, (b, lags), up to what no lag changes."""
    model = blocks.x @ found.gain.T
    rest = blocks.y - blocks.z @ found.nuisance.T
    cross = np.sum(found.weight.T[None] * rest.conj() * model, axis=2)
    cosine, sine = _waves(tuple(blocks.frequency_hz), float(lags[0]), len(lags))
    return 2 * (cross.real @ cosine + cross.imag @ sine)


@lru_cache(maxsize=16)
def _waves(frequency_hz: tuple[float, ...], first_s: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """cos and sin of 2π f τ on the grid of lags, (m, lags) each."""
    angle = 2 * np.pi * np.outer(frequency_hz, first_s + _LAG_STEP_S * np.arange(count))
    return np.cos(angle), np.sin(angle)


def differences(known: list[_SensorPair], drifting: bool) -> list[_LatenessFound]:
    """Every difference of lateness that a comparison is good enough to show."""
    # Share of the motion that commands must explain to show a constant lateness: below it the motors' lag, fitted
    # later, shows their dead time better. A growth of it is bounded by what disturbances can feign (`_disturbed_s`).
    least_alone = 0.9
    least = dict.fromkeys(COMMANDED, _LEAST_EXPLAINED if drifting else least_alone)
    found = [_difference(c, drifting) for c in known]
    return [d for d in found if d.explained > least.get(d.of.over, _LEAST_EXPLAINED)]


def _across(differences: Sequence[_LatenessFound], wrong: Sequence[str], key: int) -> tuple[float, float]:
    """Lateness (key 0) or growth (1) of some sensors over the rest, and one sigma, from comparisons between the two.

    What disturbances can feign counts as another one sigma: it is a bound, and seldom met.
    """
    values, weights = [], []
    for d in differences:
        part = d.of.part(wrong)
        if abs(part) > _LEAST_SHARE:
            values.append(d.value(key) / part)
            weights.append(part**2 / (d.sd(key) ** 2 + d.bound(key) ** 2))
    return float(np.average(values, weights=weights)), float(1.0 / np.sqrt(np.sum(weights)))


def _remeasured(
    recordings: ReadSet, wrong: Sequence[str], key: int, first: float, aside: Sequence[str] = ()
) -> tuple[float, float] | None:
    """What is left of the lateness (key 0) or growth (1) of some sensors of a set in which a `first` estimate of it is
    taken out, added to that; and its one sigma.

    From close by, where the blocks of two sensors hold the same motion. Comparisons with sensors `aside` do not count;
    None where none is left.
    """
    again = [d for d in differences(_sensor_pairs(recordings), drifting=bool(key)) if not {*aside} & {*d.of.sensors}]
    if not any(abs(d.of.part(wrong)) > _LEAST_SHARE for d in again):
        return None
    rest, sd = _across(again, wrong, key)
    return first + rest, sd


def _in_every_run(whole: _LatenessFound) -> bool:
    """Whether each run by itself shows the growth: what acts in part of a flight only must not pass for a clock."""
    blocks = whole.of.blocks
    agree, shown = [], []
    # Share of a drift, and one-sigmas of its own, that a run's drift may be off all runs'.
    run_agreement, run_sigmas = 0.1, 3.0
    for run in np.unique(blocks.run):
        own = blocks.part(blocks.run == run)
        if own.count < 2:
            continue
        # A run of a few blocks cannot determine gains of its own.
        d = _difference(replace(whole.of, blocks=own), drifting=True, free=own.count >= lagged.FEWEST_BLOCKS)
        sd = d.sd(1)
        agree.append(abs(d.growth - whole.growth) < run_sigmas * sd + run_agreement * abs(whole.growth))
        due = min(_LEAST_LIKELIHOOD, whole.gained * own.count / blocks.count) / 4
        shown.append(d.growth * whole.growth > 0 and abs(d.growth) > 2 * sd and d.gained > due)
    return bool(agree) and all(agree) and np.mean(shown) >= 0.6


def _peak(lags: np.ndarray, curves: np.ndarray, time_s: np.ndarray, guess: float, drifting: bool):
    """Start and growth of lateness at the highest summed likelihood (b, lags), by grids that close in.

    `guess` is the lateness in the middle of the runs.
    """
    rows = np.arange(len(time_s))[None, :]

    def best(starts, growths):
        """The pair with the highest sum, linear between the grid's lags."""
        at = np.clip(starts[:, None] + growths[:, None] * time_s, lags[0], lags[-1] - _LAG_STEP_S)
        low = np.minimum(((at - lags[0]) / _LAG_STEP_S).astype(int), len(lags) - 2)
        share = (at - lags[low]) / _LAG_STEP_S
        totals = (curves[rows, low] * (1 - share) + curves[rows, low + 1] * share).sum(axis=1)
        k = int(np.argmax(totals))
        return float(starts[k]), float(growths[k])

    start, growth, wide_start, wide_growth = guess, 0.0, 0.004, 0.0
    if drifting:
        grid = np.meshgrid(np.arange(-_LARGEST_SKEW, _LARGEST_SKEW + 1e-9, 2e-4), np.arange(-0.06, 0.061, 0.005))
        rates, asides = (g.ravel() for g in grid)
        start, growth = best(guess + asides - rates * float(time_s.mean()), rates)
        wide_start, wide_growth = 0.005, 2e-4
    steps = np.array([-1, -0.5, 0, 0.5, 1])
    for _ in range(7):
        a, b = (g.ravel() for g in np.meshgrid(steps, steps if drifting else np.zeros(1)))
        start, growth = best(start + a * wide_start, growth + b * wide_growth)
        wide_start, wide_growth = wide_start / 2, wide_growth / 2
    return start, growth


@dataclass(frozen=True)
class Lateness:
    """Lateness (or growth) of every sensor, up to what all sensors that are connected share."""

    names: list[str]
    values: np.ndarray
    """(n,)."""
    operator: np.ndarray
    """(n, comparisons): what each comparison adds to a value."""
    sd: np.ndarray
    """One sigma of each comparison, (comparisons,)."""
    bound: np.ndarray
    """The most that disturbances can feign in each, (comparisons,)."""
    groups: list[list[str]]
    """Sensors that comparisons connect."""

    def over(self, name: str, others: list[str]) -> tuple[float, float, float]:
        """A sensor's value over the mean of others: itself, one sigma, and the most that disturbances can feign."""
        rows = [self.names.index(n) for n in others]
        at = self.names.index(name)
        row = self.operator[at] - self.operator[rows].mean(axis=0)
        value = float(self.values[at] - self.values[rows].mean())
        return value, float(np.sqrt(np.sum((row * self.sd) ** 2))), float(np.abs(row) @ self.bound)


def _lateness(differences: list[_LatenessFound], key: int) -> Lateness:
    """Lateness (key 0) or growth (key 1) of every sensor by weighted least squares."""
    names = sorted({n for d in differences for n in d.of.sensors})
    rows = np.array([[d.of.part([n]) for n in names] for d in differences])
    target, sd, bound = np.array([(d.value(key), d.sd(key), d.bound(key)) for d in differences]).T
    scale = 1.0 / np.hypot(sd, bound)
    operator = np.linalg.pinv(rows * scale[:, None]) * scale
    return Lateness(names, operator @ target, operator, sd, bound, _connected(names, differences))


def _connected(names: list[str], differences: list[_LatenessFound]) -> list[list[str]]:
    groups = [{n} for n in names]
    for d in differences:
        for name, _ in d.of.shares:
            a = next(g for g in groups if d.of.late in g)
            b = next(g for g in groups if name in g)
            if a is not b:
                a |= b
                groups.remove(b)
    return [sorted(g) for g in groups]


def _trust(sensor: str) -> int:
    """The place of a sensor among those whose clocks are believed, the first before others."""
    order = ("gyroscope", "attitude", "accelerometer", "velocity", "rotors")
    return order.index(sensor) if sensor in order else len(order)


_INERTIAL = ("gyroscope", "accelerometer")


def in_agreement(solved: Lateness, group: list[str], least: dict[str, float], sigmas: float, filter_s: float):
    """The largest set of a group's sensors of which each two agree, without those of it that a filter of their own
    makes late.

    `least` is what each may be off in any case; an inertial sensor is late by its own filter's `filter_s` at most.
    """

    def near(n: str, c: str) -> bool:
        value, sd, _ = solved.over(n, [c])
        return abs(value) <= max(least[n], least[c], sigmas * sd)

    def filtered(n: str, c: str) -> bool:
        return n in _INERTIAL and c not in _INERTIAL and 0.0 < solved.over(n, [c])[0] < filter_s

    # Each two: one that is known badly is near to all, and would join sensors that surely part.
    alike = {pair for pair in combinations(group, 2) if near(*pair)}
    sets = [s for size in range(len(group), 0, -1) for s in combinations(group, size) if alike >= {*combinations(s, 2)}]
    best = None
    for candidate in group:
        own = list(next(s for s in sets if candidate in s))
        late = [n for n in group if n not in own and (filtered(n, candidate) or filtered(candidate, n))]
        rank = (len(own) + len(late), len(own), -min(map(_trust, own)))
        if best is None or rank > best[0]:
            kept = own
            if late and any(filtered(candidate, n) for n in late):
                kept = [n for n in late if filtered(candidate, n)]
            best = (rank, kept)
    return best[1]


def _relative_to_most(
    solved: Lateness, least: dict[str, float], sigmas: float, filter_s: float = 0.0
) -> dict[str, tuple[float, float, float]]:
    """Value of each sensor over the largest set of sensors that agree, its sigma, and what disturbances can feign.

    Over the one of the set against which it is known best. Every connected part has its own zero; of two that would
    blame a sensor each, late in one and early by as much in the other, the zeros are chosen so that one clock does.
    """
    zeros = [in_agreement(solved, group, least, sigmas, filter_s) for group in solved.groups]
    found = [_over_known(solved, group, right) for group, right in zip(solved.groups, zeros, strict=True)]
    off = [{n: v for n, v in part.items() if abs(v[0]) > max(least[n], sigmas * v[1], v[2])} for part in found]

    def opposite(one: tuple[float, float, float], other: tuple[float, float, float]) -> bool:
        """Whether two values differ in nothing but their sign."""
        slack = max(filter_s, sigmas * np.hypot(one[1], other[1]))
        return one[0] * other[0] < 0 and abs(one[0] + other[0]) < slack

    for a, b in permutations(range(len(off)), 2):
        same = [n for n, v in off[b].items() if any(opposite(v, w) for w in off[a].values())]
        if same and len(off[b]) == len(same) and len(off[a]) >= len(off[b]):
            found[b] = _over_known(solved, solved.groups[b], same)
            break
    return {n: v for part in found for n, v in part.items()}


def _over_known(solved: Lateness, group: list[str], right: list[str]) -> dict[str, tuple[float, float, float]]:
    """Each sensor over the one of `right` against which it is known best; those of `right` over their mean."""
    out = {}
    for n in group:
        against = [solved.over(n, [c]) for c in right if c != n]
        out[n] = solved.over(n, right) if n in right else min(against, key=lambda v: v[1] + v[2])
    return out


def _own_period_s(all_signals: list[Signals]) -> dict[str, float]:
    """Longest own period of every sensor over the runs."""
    out = {}
    for s in all_signals:
        for name, rate in s.own_rate_hz.items():
            if rate > 0:
                out[name] = max(out.get(name, 0.0), 1.0 / rate, 1.0 / s.rate_hz)
    return out


def _listed(sensors: Sequence[str]) -> str:
    return listed([SENSOR_WORDS[s] for s in sensors])


def _one_clock(differences: list[_LatenessFound], growing: list[_LatenessFound]) -> tuple[str, ...]:
    """The sensor whose clock alone explains all growths best, and others that do so as well; none for no candidate.

    Candidates are the two sides of the comparisons with a significant growth. Nothing but height rests on the
    position, so that it is none of them.
    """
    as_well = 9.0  # Squared standard errors within which two explanations of all growths are as good.
    names = {n for d in growing for n in d.of.sensors} - {"position"}
    left = {}
    for name in names:
        rate, _ = _across(differences, [name], 1)
        left[name] = sum(
            (d.growth - d.of.part([name]) * rate) ** 2 / (d.sd(1) ** 2 + d.bound(1) ** 2) for d in differences
        )
    alike = [n for n in names if left[n] < min(left.values()) + as_well]
    return tuple(sorted(alike, key=lambda n: (-_trust(n), n)))


def _skew(recordings: ReadSet, known: list[_SensorPair]) -> Corrected:
    """Sensors whose lateness grows."""
    signals = recordings.signals
    found = differences(known, drifting=True)
    longest = max((s.time_s[-1] - s.time_s[0] for s in signals), default=0.0)
    periods = _own_period_s(signals)
    growing = []
    for d in found:
        beyond = abs(d.growth) - d.bound(1)
        p = float(2 * student.sf(beyond / max(d.sd(1), 1e-12), max(d.pieces - 2, 1)))
        slowest = max(periods[n] for n in d.of.sensors)
        significant = p < _P_LIMIT and abs(d.growth) * longest > slowest and d.gained > _LEAST_LIKELIHOOD
        if significant and _in_every_run(d):
            growing.append((p, d))
    if not growing:
        return Corrected(recordings)
    solved = _lateness(found, 1)
    least = {n: 0.5 * max(periods[n], 2e-3) / longest for n in solved.names}
    drift = _relative_to_most(solved, least, 3.0)
    wrong = [
        n
        for n, (value, sd, bound) in drift.items()
        if abs(value) > least[n] + 3 * sd + bound and abs(value) * longest > periods[n]
    ]
    wrong = [n for n in wrong if n != "position" or {"velocity", "attitude"} & set(wrong)]
    other = ""
    if not wrong:
        # Two clocks surely part, and the rest cannot show which is right: the one that leaves least to explain.
        blamed = _one_clock(found, [d for _, d in growing])
        if not blamed:
            return Corrected(recordings)
        drift = {blamed[0]: (_across(found, [blamed[0]], 1)[0], 0.0, 0.0)}
        wrong = [blamed[0]]
        if len(blamed) > 1:
            other = f" (or that of {_listed(list(blamed[1:]))} the other way: nothing else recorded shows which)"
    # One clock at a time, the one most sensors go by first: what a second one did is measured anew.
    rates = {n: value for n, (value, _, _) in drift.items()}
    sides = [[n for n in wrong if rates[n] > 0], [n for n in wrong if rates[n] < 0]]
    wrong = max(sides, key=len)
    rate, sd = _across(found, wrong, 1)
    # Large drifts move the motion out of its block: measured once more with the first estimate taken out.
    rate, sd = _remeasured(_shifted(recordings, wrong, 0.0, rate), wrong, 1, rate) or (rate, sd)
    change = "fall behind by" if rate > 0 else "gain"
    sentence = (
        f"The clock of {_listed(wrong)} runs at another rate{other}: its stamps {change} {1e3 * abs(rate):.2f} ms "
        f"every second; put on the other sensors' time."
    )
    channels = [sensor_columns(recordings.vehicle)[n][0] for n in wrong]
    parameters = (in_interval("skew", rate, "1", sd),)
    finding = established("clock_skew", sentence, min(p for p, _ in growing), channels, parameters=parameters)
    return Corrected(_shifted(recordings, _with_position(wrong), 0.0, rate), (finding,))


def _with_position(sensors: list[str]) -> list[str]:
    """Sensors, with the position where velocity and attitude are both among them: one clock stamps the three."""
    return [*sensors, "position"] if {"velocity", "attitude"} <= {*sensors} and "position" not in sensors else sensors


def _delay(recordings: ReadSet, known: list[_SensorPair]) -> Corrected:
    """Sensors that are late by a constant of more than one sample."""
    signals = recordings.signals
    periods = _own_period_s(signals)
    found = differences(known, drifting=False)
    if not found:
        return Corrected(recordings)
    solved = _lateness(found, 0)
    sample = max(1.0 / s.rate_hz for s in signals)
    # One inertial sensor, or the commands, alone off by less than both is a filter or a controller, not a logger.
    filter_samples, filter_s = 2.6, 0.008
    small = min(filter_s, filter_samples * sample)
    relative = _relative_to_most(solved, periods, 2.0, small)
    late = {n: value for n, (value, _, _) in relative.items()}
    tolerance = {n: max(periods[n], 3 * sd) for n, (_, sd, _) in relative.items()}
    wrong, notes, limits = [], [], {}
    for n, (value, sd, bound) in relative.items():
        touching = [d for d in found if abs(d.of.part([n])) > _LEAST_SHARE]
        limit = limits[n] = max(periods[n], sample, bound)
        count = max(d.pieces for d in touching)
        p = float(student.sf((abs(value) - limit) / max(sd, 1e-9), max(count - 2, 1)))
        if p > _P_LATE or max(d.likelihood for d in touching) < _LEAST_LIKELIHOOD:
            continue
        if n == "position":
            notes.append(
                f"The position is {1e3 * abs(late[n]):.1f} ms {'behind' if late[n] > 0 else 'ahead of'} the velocity "
                f"(as a filtered velocity is); nothing but height rests on it."
            )
            continue
        wrong.append((n, p))
    fixed, findings, clusters = recordings, [], _clusters([n for n, _ in wrong], late, tolerance)
    own = [c[0] for c in clusters if len(c) == 1 and c[0] in _SMALL_LAGS and abs(late[c[0]]) < small]
    for sensor in own:
        notes.append(
            f"{capital(SENSOR_WORDS[sensor])}: {1e3 * late[sensor]:+.1f} ms against the rest, {_SMALL_LAGS[sensor]}."
        )
        if sensor in _INERTIAL:
            fixed = _shifted(fixed, [sensor], late[sensor])
    unfiltered = fixed
    # Standard errors that a constant lateness has when it is measured once more, the other sensors corrected.
    sure_sigmas = 3.0
    for cluster in clusters:
        if cluster[0] in own:
            continue
        others = [n for n, _ in wrong if n not in cluster and n not in own]
        amount, sd = float(np.mean([late[n] for n in cluster])), max(relative[n][1] for n in cluster)
        steps = round(amount / sample) * sample
        nearly = _shifted(unfiltered, _with_position(cluster), steps)
        amount, sd = _remeasured(nearly, cluster, 0, steps, others) or (amount, sd)
        # Measured once more it may be less sure: the status agrees with the stated interval.
        if abs(amount) < max(sure_sigmas * sd, min(limits[n] for n in cluster)):
            notes.append(
                f"{capital(_listed(cluster))}: {1e3 * amount:+.1f} ms against the rest, "
                f"give or take {1e3 * 1.96 * sd:.1f} ms: not surely a sample or more."
            )
            continue
        fixed = _shifted(fixed, _with_position(cluster), amount)
        how = f"{1e3 * abs(amount):.1f} ms {'late' if amount > 0 else 'early'}"
        sentence = f"The stamps of {_listed(cluster)} are {how} against the other sensors': shifted."
        # A sensor whose stamps are early is seen as all others' delay: the id's parameter is a length of time.
        parameters, p_value = (in_interval("T_d", abs(amount), "s", sd),), max(p for n, p in wrong if n in cluster)
        channels = [sensor_columns(recordings.vehicle)[n][0] for n in cluster]
        findings.append(established("delay", sentence, p_value, channels, late_s=amount, parameters=parameters))
    return Corrected(fixed, tuple(findings), tuple(notes))


def _clusters(names: list[str], values: dict[str, float], tolerance: dict[str, float]) -> list[list[str]]:
    out: list[list[str]] = []
    for n in sorted(names, key=lambda m: values[m]):
        if out and abs(values[n] - values[out[-1][-1]]) <= max(tolerance[n], tolerance[out[-1][-1]]):
            out[-1].append(n)
        else:
            out.append([n])
    return out


def _shifted(recordings: ReadSet, sensors: Sequence[str], late_s: float, growth: float = 0.0) -> ReadSet:
    """The set with some sensors' columns moved earlier by `late_s` + `growth` × time since the run's start.

    Evenly sampled columns move by whole samples, which leaves their noise as it is; the rest (below half a
    sample) stays for the analysis to carry. A growing shift is interpolated.
    """

    def change(run: Run) -> dict[str, np.ndarray]:
        t, columns = run.time_s, {}
        period = float(np.median(np.diff(t)))
        even = np.max(np.abs(np.diff(t) - period)) < 0.1 * period
        for sensor in sensors:
            present = tuple(n for n in sensor_columns(recordings.vehicle)[sensor] if run.has(n))
            if not present:
                continue
            values = run.array(present)
            if even and growth == 0.0:
                out = _moved(values, int(np.round(late_s / period)))
            else:
                out = on_grid(t, values, t + late_s + growth * (t - t[0]))
            columns |= dict(zip(present, out.T, strict=True))
        return columns

    return replace_columns(recordings, change)


def _moved(values: np.ndarray, steps: int) -> np.ndarray:
    """Readings (n, m) some samples earlier, NaN where there are none."""
    out = np.full_like(values, np.nan)
    out[max(-steps, 0) : len(out) - max(steps, 0)] = values[max(steps, 0) : len(out) - max(-steps, 0)]
    return out
