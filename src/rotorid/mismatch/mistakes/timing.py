"""Sensors whose stamps are late against each other, by a constant or by a clock that runs at another rate.

Every comparison of two sensors gives one difference of lateness; all together give each sensor's. The largest
group of sensors that agree is taken as right. What is below one sample is a nuisance for the analysis to carry.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.stats import t as student

from rotorid.mismatch.findings import Estimate, Finding
from rotorid.mismatch.mistakes import comparisons as compare
from rotorid.mismatch.mistakes import lagged
from rotorid.mismatch.mistakes.axes import Result, signals_of
from rotorid.mismatch.mistakes.lagged import Blocks, LaggedFit
from rotorid.mismatch.mistakes.signals import Signals, replace_columns, sensor_columns
from rotorid.mismatch.motion import fresh_samples
from rotorid.recordings import RecordingSet, Run, Vehicle

THROUGH_AIR = ("rotors", "commands", "throttle")
LEAST_ALONE = 0.9
TELLS_A_DRIFT = 0.95
"""Share of the motion the rotors must explain to tell a drift: disturbances come and go, and so does their lateness."""
LEAST_EXPLAINED = 0.6
P_LIMIT = 1e-6
LEAST_LIKELIHOOD = 60.0
"""Rise of the log-likelihood that a delay, or its growth, must bring."""
MOTOR_FORM = 0.15
"""A dead time up to this share of a motor's lag is the lag's form (no motor is exactly first order)."""
FILTER_SAMPLES, FILTER_S = 2.6, 0.008
"""One inertial sensor, or the commands, alone off by less than both is a filter or a controller, not a logger."""
SMALL_LAGS = {
    "gyroscope": "as its built-in filter makes it; shifted, not counted as a finding",
    "accelerometer": "as its built-in filter makes it; shifted, not counted as a finding",
    "commands": "as motor controllers take; left as part of the motors' lag",
    "throttle": "as motor controllers take; left as part of the motors' lag",
}
RUN_AGREEMENT, RUN_SIGMAS = 0.1, 3.0
"""Share of a drift, and one-sigmas of its own, that a run's drift may be off all runs'."""
LARGEST_SKEW = 1.2e-2
LONGEST_DRIFT_S = 0.4
COARSE_SKEWS = 6
COARSE_LAGS_S = np.arange(-0.12, 0.121, 0.01)
MOTOR_LAGS_S = np.concatenate([[0.0], np.geomspace(0.004, 0.25, 24)])
LAG_STEP_S = 0.001
DEAD_TIMES_S = np.arange(-0.03, 0.061, 0.005)
UNDECIDED = 12.0
"""Motor lags within this log-likelihood are not told apart."""
LATE_FLOOR_S = 2e-5


@dataclass(frozen=True)
class Difference:
    """Lateness of one sensor over another at the start of a run, and how it grows."""

    late: str
    over: str
    start_s: float
    growth: float
    """s/s."""
    covariance: np.ndarray
    """(2, 2) of start and growth."""
    likelihood: float
    """Rise of the log-likelihood by start and growth over none."""
    blocks: int
    explained: float
    motor_s: float
    """Motor lag taken out of the command first."""
    gained: float
    """Rise of the log-likelihood by the growth over the best constant."""


def find(recordings: RecordingSet) -> Result:
    """Clocks that drift first, then constant delays."""
    if recordings.vehicle.kind != "flight":
        return Result(recordings)
    known = comparisons(signals_of(recordings), recordings.vehicle)
    result = _skew(recordings, known)
    if result.findings:
        known = comparisons(signals_of(result.recordings), recordings.vehicle)
    found = _delay(result.recordings, known)
    return Result(found.recordings, result.findings + found.findings, result.notes + found.notes)


def comparisons(all_signals: list[Signals], vehicle: Vehicle) -> list[tuple[str, str, Blocks, LaggedFit, float]]:
    """Every comparison that may tell time: later sensor, earlier sensor, spectra, fit, motor lag taken out (s)."""
    have = set().union(*(s.values for s in all_signals))
    speeds = next((n for n in map(compare.speeds_of, all_signals) if n), None)
    force = "accelerometer" if "accelerometer" in have else None
    pairs: list[tuple[str, str, Blocks | None]] = []
    if {"attitude", "gyroscope"} <= have:
        pairs.append(("attitude", "gyroscope", compare.turning(all_signals)))
    if {"velocity", "attitude"} <= have and (force or speeds in ("rotors", "commands")):
        world = compare.accelerating(all_signals, vehicle, force or speeds)
        if world is not None:
            # Level motion follows the tilt, so it compares with the attitude; vertical motion with the force.
            pairs.append(("velocity", "attitude", world.outputs([0, 1])))
            pairs.append(("velocity", force or speeds, world.outputs([2])))
    if {"position", "velocity"} <= have:
        pairs.append(("position", "velocity", compare.moving(all_signals)))
    if "gyroscope" in have and speeds:
        pairs.append(("gyroscope", speeds, compare.rolling(all_signals, vehicle, speeds)))
    if force and speeds:
        pairs.append(("accelerometer", speeds, compare.lifting(all_signals, vehicle, speeds)))
    if "rotors" in have and ("commands" in have or "throttle" in have):
        command = "commands" if "commands" in have else "throttle"
        pairs.append(("rotors", command, compare.following(all_signals, command)))
    out = []
    for late, over, blocks in pairs:
        if blocks is None:
            continue
        motor_s = 0.0
        if over in ("commands", "throttle"):
            motor_s, blocks = _through_motor(blocks)
        found = lagged.fit(blocks)
        if found is None:
            continue
        out.append((late, over, blocks, found, motor_s))
    return out


def _through_motor(blocks: Blocks) -> tuple[float, Blocks]:
    """Commands replaced by what a first-order motor makes of them, its time constant fitted beside the delay."""
    base = lagged.fit(blocks)
    if base is None:
        return 0.0, blocks
    trials = {}

    def attempt(tau):
        through = 1.0 / (1.0 + 2j * np.pi * blocks.frequency_hz * tau)
        trial = replace(blocks, x=blocks.x * through[None, :, None])
        found = lagged.fit(trial, DEAD_TIMES_S)
        left = float(np.sum(lagged.loss_by_block(trial, _weighted(found, base), found.gain, found.lag_s)))
        trials[float(tau)] = (left, abs(found.lag_s), trial)

    for tau in MOTOR_LAGS_S:
        attempt(tau)
    for width in (0.09, 0.03):
        best = min(trials, key=lambda tau: trials[tau][0])
        for factor in (1 - width, 1 - width / 2, 1 + width / 2, 1 + width):
            attempt(best * factor)
    best = min(trials, key=lambda tau: trials[tau][0])
    # Slow motion cannot tell a lag from a dead time: where it fits as well with hardly any, there is none.
    plausible = [tau for tau in trials if trials[tau][0] < trials[best][0] + UNDECIDED]
    least = min(plausible, key=lambda tau: trials[tau][1])
    chosen = least if trials[least][1] < 0.5 * trials[best][1] else best
    return chosen, trials[chosen][2]


def _weighted(found: LaggedFit, base: LaggedFit) -> LaggedFit:
    """A fit's numbers under another fit's weights, so that fits can be compared."""
    return LaggedFit(
        found.lag_s,
        found.lag_sd,
        found.gain,
        found.gain_sd,
        found.explained,
        base.weight,
        found.nuisance,
        found.block_count,
    )


def difference(late: str, over: str, blocks: Blocks, found: LaggedFit, motor_s: float, drifting: bool) -> Difference:
    """Lateness, and its growth if asked for, at the likelihood's peak.

    Gains and weights are fitted again with the blocks put on one time, because a drifting clock blurs the first fit.
    """
    longest = LONGEST_DRIFT_S if drifting else lagged.LONGEST_LAG_S
    lags = np.arange(-longest, longest + 1e-9, LAG_STEP_S)
    # Only the fast comparisons with the gyroscope blur beyond recognition.
    if drifting and np.min(found.explained) < LEAST_EXPLAINED and "gyroscope" in (late, over):
        found = unblurred(blocks, found)
    start, growth = found.lag_s, 0.0
    for _ in range(3 if drifting else 1):
        curves = likelihood(blocks, found, lags)
        middle = start + growth * float(blocks.time_s.mean())
        start, growth = _peak(lags, curves, blocks.time_s, middle, drifting)
        phase = lagged.delay(blocks.frequency_hz, start + growth * blocks.time_s)
        found = lagged.fit(replace(blocks, x=blocks.x * phase[:, :, None]), np.zeros(1))
    # Newton's steps to the peak itself, and the likelihood's shape there.
    model = (blocks.x * phase[:, :, None]) @ found.gain.T
    turn = -2j * np.pi * blocks.frequency_hz[None, :, None] * model
    turn = lagged.beyond_nuisances(turn, blocks.z, found.weight)
    left = blocks.y - model - blocks.z @ found.nuisance.T
    weight = found.weight.T[None]
    slope = np.real(np.sum(weight * turn.conj() * left, axis=(1, 2)))
    bend = np.sum(weight * np.abs(turn) ** 2, axis=(1, 2))
    design = np.stack([np.ones(blocks.count), blocks.time_s], axis=1)[:, : 2 if drifting else 1]
    inverse = np.linalg.pinv(design.T @ (design * bend[:, None]), hermitian=True)
    step = inverse @ (design.T @ slope)
    start, growth = start + float(step[0]), growth + (float(step[1]) if drifting else 0.0)
    score = design * (slope - bend * (design @ step))[:, None]
    robust = inverse @ (score.T @ score) @ inverse * blocks.count / max(blocks.count - design.shape[1], 1)
    covariance = np.zeros((2, 2))
    size = design.shape[1]
    # The likelihood's own curvature counts as a floor.
    covariance[:size, :size] = robust if np.trace(robust) > np.trace(inverse) else inverse
    covariance[0, 0] += LATE_FLOOR_S**2
    unmoved = blocks.y - blocks.x @ found.gain.T - blocks.z @ found.nuisance.T
    rise = float(np.sum(weight * (np.abs(unmoved) ** 2 - np.abs(left) ** 2)))
    gained = 0.0
    if drifting:
        # The aligned fit's likelihood at no further lag is that of the drift itself.
        drift = likelihood(replace(blocks, x=blocks.x * phase[:, :, None]), found, np.zeros(1)).sum()
        gained = float(drift - likelihood(blocks, found, lags).sum(axis=0).max())
    explained = float(np.min(found.explained))
    return Difference(late, over, start, growth, covariance, rise, blocks.count, explained, motor_s, gained)


def unblurred(blocks: Blocks, found: LaggedFit) -> LaggedFit:
    """The fit at the coarse growth that explains most, its delay that of the middle of the runs."""
    aside = blocks.time_s - blocks.time_s.mean()
    best = found
    for rate in np.arange(-COARSE_SKEWS, COARSE_SKEWS + 1) * LARGEST_SKEW / COARSE_SKEWS:
        phase = lagged.delay(blocks.frequency_hz, rate * aside)
        trial = lagged.fit(replace(blocks, x=blocks.x * phase[:, :, None]), COARSE_LAGS_S)
        if np.min(trial.explained) > np.min(best.explained):
            best = trial
    return best


def likelihood(blocks: Blocks, found: LaggedFit, lags: np.ndarray) -> np.ndarray:
    """Log-likelihood of every lag in every block, (b, lags), up to what no lag changes."""
    model = blocks.x @ found.gain.T
    rest = blocks.y - blocks.z @ found.nuisance.T
    cross = np.sum(found.weight.T[None] * rest.conj() * model, axis=2)
    cosine, sine = _waves(tuple(blocks.frequency_hz), float(lags[0]), len(lags))
    return 2 * (cross.real @ cosine + cross.imag @ sine)


@lru_cache(maxsize=16)
def _waves(frequency_hz: tuple[float, ...], first_s: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """cos and sin of 2π f τ on the grid of lags, (m, lags) each."""
    angle = 2 * np.pi * np.outer(frequency_hz, first_s + LAG_STEP_S * np.arange(count))
    return np.cos(angle), np.sin(angle)


def differences(known: list, drifting: bool) -> list[Difference]:
    """Every difference of lateness that a comparison is good enough to tell."""
    found = [difference(*c, drifting=drifting) for c in known]
    # What disturbs the vehicle makes its rotors answer late, which is no clock: there the rotors must explain all.
    return [d for d in found if d.explained > (LEAST_ALONE if d.over in THROUGH_AIR else LEAST_EXPLAINED)]


def across(differences: list[Difference], wrong: list[str], key: int) -> tuple[float, float]:
    """Lateness (key 0) or growth (1) of some sensors over the rest, and one sigma, from comparisons between the two."""
    values, weights = [], []
    for d in differences:
        if (d.late in wrong) != (d.over in wrong):
            sign = 1.0 if d.late in wrong else -1.0
            values.append(sign * (d.growth if key else d.start_s))
            weights.append(1.0 / max(d.covariance[key, key], 1e-18))
    return float(np.average(values, weights=weights)), float(1.0 / np.sqrt(np.sum(weights)))


def in_every_run(whole: Difference, comparison: tuple) -> bool:
    """Whether each run by itself shows the growth: what acts in part of a flight only must not pass for a clock."""
    late, over, blocks, found, motor_s = comparison
    agree, shown = [], []
    for run in np.unique(blocks.run):
        own = blocks.part(blocks.run == run)
        if own.count < 2 * lagged.FEWEST_BLOCKS:
            continue
        d = difference(late, over, own, found, motor_s, drifting=True)
        sd = float(np.sqrt(d.covariance[1, 1]))
        agree.append(abs(d.growth - whole.growth) < RUN_SIGMAS * sd + RUN_AGREEMENT * abs(whole.growth))
        shown.append(d.growth * whole.growth > 0 and abs(d.growth) > 3 * sd and d.gained > LEAST_LIKELIHOOD / 4)
    return bool(agree) and all(agree) and np.mean(shown) >= 0.6


def _peak(lags: np.ndarray, curves: np.ndarray, time_s: np.ndarray, guess: float, drifting: bool):
    """Start and growth of lateness at the highest summed likelihood (b, lags), by grids that close in.

    `guess` is the lateness in the middle of the runs.
    """
    rows = np.arange(len(time_s))[None, :]

    def best(starts, growths):
        """The pair with the highest sum, linear between the grid's lags."""
        at = np.clip(starts[:, None] + growths[:, None] * time_s, lags[0], lags[-1] - LAG_STEP_S)
        low = ((at - lags[0]) / LAG_STEP_S).astype(int)
        low = np.minimum(low, len(lags) - 2)
        share = (at - lags[low]) / LAG_STEP_S
        totals = (curves[rows, low] * (1 - share) + curves[rows, low + 1] * share).sum(axis=1)
        k = int(np.argmax(totals))
        return float(starts[k]), float(growths[k])

    start, growth, wide_start, wide_growth = guess, 0.0, 0.004, 0.0
    if drifting:
        rates, asides = np.meshgrid(np.arange(-LARGEST_SKEW, LARGEST_SKEW + 1e-9, 2e-4), np.arange(-0.06, 0.061, 0.005))
        rates, asides = rates.ravel(), asides.ravel()
        start, growth = best(guess + asides - rates * float(time_s.mean()), rates)
        wide_start, wide_growth = 0.005, 2e-4
    steps = np.array([-1, -0.5, 0, 0.5, 1])
    for _ in range(7):
        a, b = (g.ravel() for g in np.meshgrid(steps, steps if drifting else np.zeros(1)))
        start, growth = best(start + a * wide_start, growth + b * wide_growth)
        wide_start, wide_growth = wide_start / 2, wide_growth / 2
    return start, growth


def lateness(differences: list[Difference], key: int) -> tuple[dict[str, float], dict[str, float]]:
    """Lateness (key 0) or growth (key 1) of every sensor, and one sigma, the largest agreeing group at zero."""
    names = sorted({d.late for d in differences} | {d.over for d in differences})
    values, sds = {}, {}
    for group in _connected(names, differences):
        inside = [d for d in differences if d.late in group]
        rows = np.zeros((len(inside), len(group)))
        target, sd = np.zeros(len(inside)), np.zeros(len(inside))
        for k, d in enumerate(inside):
            rows[k, group.index(d.late)], rows[k, group.index(d.over)] = 1.0, -1.0
            target[k] = d.start_s if key == 0 else d.growth
            sd[k] = np.sqrt(max(d.covariance[key, key], 1e-16))
        scaled_rows = rows / sd[:, None]
        solution = np.linalg.pinv(scaled_rows) @ (target / sd)
        covariance = np.linalg.pinv(scaled_rows.T @ scaled_rows)
        for name, value, variance in zip(group, solution, np.diag(covariance), strict=True):
            values[name], sds[name] = float(value), float(np.sqrt(variance))
    return values, sds


def _connected(names: list[str], differences: list[Difference]) -> list[list[str]]:
    groups = [{n} for n in names]
    for d in differences:
        a = next(g for g in groups if d.late in g)
        b = next(g for g in groups if d.over in g)
        if a is not b:
            a |= b
            groups.remove(b)
    return [sorted(g) for g in groups]


PREFERRED = ("gyroscope", "attitude", "accelerometer", "velocity", "rotors")


def relative_to_most(
    values: dict[str, float], groups: list[list[str]], tolerance: dict[str, float]
) -> dict[str, float]:
    """Values with the largest group of agreeing sensors of every connected part at zero."""
    out = {}
    for group in groups:
        best = None
        for candidate in group:
            near = [n for n in group if abs(values[n] - values[candidate]) <= max(tolerance[n], tolerance[candidate])]
            preferred = -min((PREFERRED.index(n) for n in near if n in PREFERRED), default=len(PREFERRED))
            rank = (len(near), preferred)
            if best is None or rank > best[0]:
                best = (rank, near)
        zero = float(np.mean([values[n] for n in best[1]]))
        for n in group:
            out[n] = values[n] - zero
    return out


def own_period_s(all_signals: list[Signals]) -> dict[str, float]:
    """Longest own period of every sensor over the runs."""
    out = {}
    for s in all_signals:
        for name, rate in s.own_rate_hz.items():
            if rate > 0:
                out[name] = max(out.get(name, 0.0), 1.0 / rate, 1.0 / s.rate_hz)
    return out


WORDS = {
    "rotors": "the rotor speeds",
    "commands": "the commands",
    "throttle": "the throttle",
    "gyroscope": "the gyroscope",
    "accelerometer": "the accelerometer",
    "attitude": "the attitude",
    "velocity": "the velocity",
    "position": "the position",
}


def _listed(sensors: list[str]) -> str:
    words = [WORDS[s] for s in sensors]
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def _skew(recordings: RecordingSet, known: list) -> Result:
    """Sensors whose lateness grows."""
    signals = signals_of(recordings)
    found = differences(known, drifting=True)
    sources = {(late, over): (late, over, *rest) for late, over, *rest in known}
    longest = max((s.time_s[-1] - s.time_s[0] for s in signals), default=0.0)
    periods = own_period_s(signals)
    telling = []
    for d in found:
        if d.over in THROUGH_AIR and d.explained < TELLS_A_DRIFT:
            continue
        sd = float(np.sqrt(d.covariance[1, 1]))
        p = float(2 * student.sf(abs(d.growth) / max(sd, 1e-12), max(d.blocks - 2, 1)))
        drift = abs(d.growth) * longest
        if p < P_LIMIT and drift > max(periods[d.late], periods[d.over]) and d.gained > LEAST_LIKELIHOOD:
            if not in_every_run(d, sources[d.late, d.over]):
                continue
            telling.append((p, d))
    if not telling:
        return Result(recordings)
    names = sorted({d.late for d in found} | {d.over for d in found})
    values, sds = lateness(found, 1)
    groups = _connected(names, found)
    tolerance = {n: 0.5 * max(periods[n], 2e-3) / longest + 3 * sds[n] for n in names}
    drift = relative_to_most(values, groups, tolerance)
    wrong = [n for n in names if abs(drift[n]) > tolerance[n] and abs(drift[n]) * longest > periods[n]]
    wrong = [n for n in wrong if n != "position" or {"velocity", "attitude"} & set(wrong)]
    if not wrong:
        return Result(recordings)
    rate, sd = across(found, wrong, 1)
    # Large drifts move the motion out of its block: measured once more with the first estimate taken out.
    nearly = recordings
    for sensor in wrong:
        nearly = shifted(nearly, sensor, 0.0, rate)
    again = differences(comparisons(signals_of(nearly), recordings.vehicle), drifting=True)
    if any((d.late in wrong) != (d.over in wrong) for d in again):
        rest, sd = across(again, wrong, 1)
        rate += rest
    everywhere = wrong + (["position"] if {"velocity", "attitude"} <= set(wrong) and "position" not in wrong else [])
    fixed = recordings
    for sensor in everywhere:
        fixed = shifted(fixed, sensor, 0.0, rate)
    columns = [sensor_columns(recordings.vehicle)[n][0] for n in wrong]
    finding = Finding(
        id="clock_skew",
        status="established",
        sentence=(
            f"The clock of {_listed(wrong)} runs at another rate: its stamps fall behind by {1e3 * rate:.2f} ms "
            f"every second; put on the other sensors' time."
            if rate > 0
            else f"The clock of {_listed(wrong)} runs at another rate: its stamps gain {-1e3 * rate:.2f} ms "
            f"every second; put on the other sensors' time."
        ),
        parameters=(Estimate("skew", rate, "1", rate - 1.96 * sd, rate + 1.96 * sd),),
        p_value=max(min(p for p, _ in telling), 0.0),
        channels=tuple(columns),
    )
    return Result(fixed, (finding,))


def _delay(recordings: RecordingSet, known: list) -> Result:
    """Sensors that are late by a constant of more than one sample."""
    signals = signals_of(recordings)
    periods = own_period_s(signals)
    found = differences(known, drifting=False)
    if not found:
        return Result(recordings)
    names = sorted({d.late for d in found} | {d.over for d in found})
    values, sds = lateness(found, 0)
    groups = _connected(names, found)
    sample = max(1.0 / s.rate_hz for s in signals)
    tolerance = {n: max(periods[n], 2 * sds[n]) for n in names}
    late = relative_to_most(values, groups, tolerance)
    wrong, notes, limits = [], [], {}
    for n in names:
        touching = [d for d in found if n in (d.late, d.over)]
        limit = limits[n] = max(periods[n], sample, *(MOTOR_FORM * d.motor_s for d in touching))
        blocks = max(d.blocks for d in touching)
        p = float(student.sf((abs(late[n]) - limit) / sds[n], max(blocks - 2, 1)))
        if p > P_LIMIT or max(d.likelihood for d in touching) < LEAST_LIKELIHOOD:
            continue
        if n == "position":
            notes.append(
                f"The position is {1e3 * abs(late[n]):.1f} ms {'behind' if late[n] > 0 else 'ahead of'} the velocity "
                f"(as a filtered velocity is); nothing but height rests on it."
            )
            continue
        wrong.append((n, p))
    fixed = recordings
    if (
        len(wrong) == 1
        and wrong[0][0] in SMALL_LAGS
        and abs(late[wrong[0][0]]) < min(FILTER_S, FILTER_SAMPLES * sample)
    ):
        sensor = wrong[0][0]
        wrong = []
        notes.append(
            f"{WORDS[sensor].capitalize()}: {1e3 * late[sensor]:+.1f} ms against the rest, {SMALL_LAGS[sensor]}."
        )
        if sensor in ("gyroscope", "accelerometer"):
            fixed = shifted(fixed, sensor, late[sensor], 0.0)
    if not wrong:
        return Result(fixed, (), tuple(notes))
    findings = []
    for cluster in _clusters([n for n, _ in wrong], late, tolerance):
        right = [d for d in found if not ({d.late, d.over} & ({n for n, _ in wrong} - set(cluster)))]
        amount, sd = across(right or found, cluster, 0)
        everywhere = cluster + (["position"] if {"velocity", "attitude"} <= set(cluster) else [])
        nearly, steps = recordings, round(amount / sample) * sample
        for sensor in everywhere:
            nearly = shifted(nearly, sensor, steps, 0.0)
        again = differences(comparisons(signals_of(nearly), recordings.vehicle), drifting=False)
        again = [d for d in again if not ({d.late, d.over} & ({n for n, _ in wrong} - set(cluster)))]
        if any((d.late in cluster) != (d.over in cluster) for d in again):
            # Measured once more from close by, where the blocks of the two sensors hold the same motion.
            rest, sd = across(again, cluster, 0)
            amount = steps + rest
        if abs(amount) < min(limits[n] for n in cluster):
            notes.append(f"{_listed(cluster).capitalize()}: {1e3 * amount:+.1f} ms against the rest, below a sample.")
            continue
        for sensor in everywhere:
            fixed = shifted(fixed, sensor, amount, 0.0)
        word = "late" if amount > 0 else "early"
        findings.append(
            Finding(
                id="delay",
                status="established",
                sentence=(
                    f"The stamps of {_listed(cluster)} are {1e3 * abs(amount):.1f} ms {word} against the other "
                    f"sensors': shifted."
                ),
                # A sensor whose stamps are early is seen as all others' delay: the id's parameter is a length of time.
                parameters=(Estimate("T_d", abs(amount), "s", abs(amount) - 1.96 * sd, abs(amount) + 1.96 * sd),),
                p_value=max(p for n, p in wrong if n in cluster),
                channels=tuple(sensor_columns(recordings.vehicle)[n][0] for n in cluster),
            )
        )
    return Result(fixed, tuple(findings), tuple(notes))


def _clusters(names: list[str], values: dict[str, float], tolerance: dict[str, float]) -> list[list[str]]:
    out: list[list[str]] = []
    for n in sorted(names, key=lambda m: values[m]):
        if out and abs(values[n] - values[out[-1][-1]]) <= max(tolerance[n], tolerance[out[-1][-1]]):
            out[-1].append(n)
        else:
            out.append([n])
    return out


def shifted(recordings: RecordingSet, sensor: str, late_s: float, growth: float) -> RecordingSet:
    """The set with a sensor's columns moved earlier by `late_s` + `growth` × time since the run's start.

    Evenly sampled columns move by whole samples, which leaves their noise as it is; the rest (below half a
    sample) stays for the analysis to carry. A growing shift is interpolated.
    """
    names = [n for n in sensor_columns(recordings.vehicle)[sensor]]

    def change(run: Run):
        present = [n for n in names if run.has(n)]
        if not present:
            return None
        t, values = run.time_s, run.array(tuple(present))
        period = float(np.median(np.diff(t)))
        even = np.max(np.abs(np.diff(t) - period)) < 0.1 * period
        if even and growth == 0.0:
            steps = int(np.round(late_s / period))
            out = np.full_like(values, np.nan)
            if steps >= 0:
                out[: len(out) - steps] = values[steps:]
            else:
                out[-steps:] = values[:steps]
        else:
            asked = t + late_s + growth * (t - t[0])
            out = _read_at(t, values, asked)
        return {n: out[:, k] for k, n in enumerate(present)}

    return replace_columns(recordings, change)


def _read_at(t: np.ndarray, values: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """Readings (n, m) at other instants, cubic between fresh samples, NaN where the recording has none."""
    keep = fresh_samples(values)
    if keep.sum() < 4:
        return values
    out = CubicSpline(t[keep], values[keep], axis=0, extrapolate=False)(asked)
    gap = np.diff(t[keep])
    longest = 6 * float(np.median(gap))
    left = np.clip(np.searchsorted(t[keep], asked) - 1, 0, len(gap) - 1)
    out[gap[left] > longest] = np.nan
    return out
