"""What lies between command and rotor speed on a stand: lag, delay, throttle curve, sag, saturation.

Where speeds are measured in addition to the commands they are the response; where only commands or throttles are
recorded the response is the wrench, with a constant for each channel and the reading's effects found so far left
free. A chain of speed forms is grown one id at a time by nonlinear least squares on whitened residuals; tests and
intervals are block-robust.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import f as f_distribution

from rotorid.effects.catalogue import catalogue, ids_of
from rotorid.effects.contract import CURVE, DELAY, SUPPLY, Form, SpeedForm, SpeedPath
from rotorid.effects.loading import Loading, between_samples, forms_of, weights_of_four
from rotorid.mismatch.decide import rules
from rotorid.mismatch.decide.findings import ChannelTrace, Finding
from rotorid.mismatch.decide.status import Estimate
from rotorid.mismatch.evidence.regression import at_least, autoregression, quadratic_form
from rotorid.mismatch.evidence.rows import form_reading, forms_reading
from rotorid.mismatch.evidence.speedpath import COST_PER_PARAMETER, ENTER_P, SMALLEST_SIZE, Chain
from rotorid.mismatch.instrument.setup import (
    SHORT,
    PreparedInstrument,
    averaged,
    loaded_by,
    pieces_of,
    rotor_wrench,
    with_speed,
)
from rotorid.recordings.signal.kernels import causal

_MOST_SAMPLES = 12_000
_RATE_HZ = 30.0
"""Rate at which wrenches are compared where no speed is measured."""
_MOST_STEPS, _QUICK_FIT = 30, 6
"""Evaluations of the Jacobian at most: of a fit, and of one that is to say whether another is worth it."""
_MOST = 4
"""Forms of a chain, forms that are fitted to the end before the next one enters, and starts of each, at most."""
_SUB_SAMPLE = 1.2
"""Offsets in time up to so many samples are a nuisance."""
_BLOCK_S = 1.0
_LEAST_BLOCKS = 12
_MOST_BLOCKS = 400
_STEADY_BLOCKS = 40
_FINER = 4
"""Steps of a chain that takes time to one sample."""
_ALIKE = rules.ELSEWHERE["squares"]
"""Whitened squares within which another form explains as well."""


@dataclass(frozen=True)
class _ChainFit:
    """A fitted chain: full speed first where it is free, the parameters of every form, `unknown_courses` last."""

    chain: Chain
    theta: np.ndarray
    cost: float
    scaled: bool
    """Whether the full speed is free."""

    @property
    def full(self) -> np.ndarray:
        """The full speed where it is free, rad/s, else nothing."""
        return self.theta[: int(self.scaled)]

    @property
    def values(self) -> np.ndarray:
        """All but the full speed."""
        return self.theta[int(self.scaled) :]

    def place(self, key: str) -> slice:
        """Where the parameters of an id stand in theta."""
        at = int(self.scaled)
        for own, form in self.chain:
            if own == key:
                return slice(at, at + len(form.parameters))
            at += len(form.parameters)
        raise KeyError(key)

    def chain_without(self, key: str) -> Chain:
        """The chain without an id."""
        return tuple((k, f) for k, f in self.chain if k != key)


@dataclass
class ChainResult:
    """What was found between command and speed."""

    fit: _ChainFit
    full_speed: float
    full_speed_sd: float
    findings: list[Finding] = field(default_factory=list)
    noise_rad_s: float | None = None
    holds: bool = False
    """Whether commands stand until their next sample."""


def _takes_time(chain: Chain) -> bool:
    return any(form.excited_by == "change" for _, form in chain)


def unknown_courses(chain: Chain, dt_s: float) -> np.ndarray:
    """One-sigma of what a chain's command did between its samples, which nobody recorded: its first two moments.

    By how much it was late (s), and by which variance in time it was smoother or sharper than the curve through its
    samples (s²). A command that holds is late by half a sample and spread by dt²/12, a straight line across a kink is
    off by as much at most. A delay in the chain is the first moment already.
    """
    if not _takes_time(chain):
        return np.zeros(0)
    spread = dt_s**2 / 12.0
    late = any(form.stage == DELAY for _, form in chain)
    return np.array([spread]) if late else np.array([0.5 * dt_s, spread])


def moved_between_samples(speed: np.ndarray, moments: np.ndarray, dt_s: float, finer: int) -> np.ndarray:
    """Speeds (n, k) at samples from those on a clock `finer` times faster, with these moments between the samples.

    ω(t − δ) + ½ v (ω(t + dt) − 2 ω(t) + ω(t − dt))/dt²: rotors take a command that is late or spread as it comes.
    """
    out = speed[::finer]
    if len(moments) > 1:
        out = between_samples(speed, (np.arange(len(out)) - moments[0] / dt_s) * finer)
    if len(moments) and len(out) > 2:
        spread = np.diff(out, 2, axis=0)
        out = out.copy()
        out[1:-1] += 0.5 * moments[-1] / dt_s**2 * spread
    return out


@dataclass(frozen=True)
class _Commanded:
    """What a chain starts from, on the clock of the chain: a stretch's commands, voltage, V, and time.

    Rotors commanded alike turn alike: of each such command (n, u), rad/s, there is one, and of each rotor which.
    """

    command: np.ndarray
    which: np.ndarray
    time_s: np.ndarray
    voltage: np.ndarray | None


def _commanded(loading: Loading, finer: int, holds: bool) -> _Commanded:
    """A stretch's command on a clock `finer` times faster: between samples it is smooth, or `holds` until the next."""
    command, which = np.unique(loading.command, axis=1, return_inverse=True)
    command = held(command, finer) if holds else between(command, finer)
    voltage = None if loading.motion.voltage is None else between(loading.motion.voltage, finer)
    return _Commanded(command, which.ravel(), between(loading.time_s, finer), voltage)


def held(values: np.ndarray, finer: int) -> np.ndarray:
    """Samples (n, k) on a clock `finer` times faster, each of which stands until the next."""
    return np.repeat(values, finer, axis=0)[: (len(values) - 1) * finer + 1]


def between(values: np.ndarray, finer: int) -> np.ndarray:
    """Samples (n,) or (n, k) with `finer` − 1 more between any two."""
    if finer == 1 or len(values) < 4:
        return held(values, finer)
    out = np.empty(((len(values) - 1) * finer + 1, *values.shape[1:]))
    out[::finer] = values
    for k in range(1, finer):
        # As between_samples, with the same four weights in the whole interior.
        ends = between_samples(values.reshape(len(values), -1), np.array([0.0, len(values) - 2]) + k / finer)
        out[k], out[k - finer - 1] = ends[0].reshape(values.shape[1:]), ends[1].reshape(values.shape[1:])
        weights = weights_of_four(1.0 + k / finer)
        out[finer + k : -finer : finer] = sum(w * values[i : len(values) - 3 + i] for i, w in enumerate(weights))
    return out


class _ChainProblem:
    """Residuals of a chain on the stretches that are fitted."""

    def __init__(self, setup: PreparedInstrument, others: list | None = None, holds: bool = False):
        """`others` are (form, values) of effects of the reading found so far; their linear gains stay free.

        `holds` says that a command stands until its next sample; else it is smooth.
        """
        self.setup = setup
        self.holds = holds
        self.first_full = setup.full_speed or max(float(np.max(x.command)) for x in setup.loadings)
        self.scaled = setup.estimated_full_speed
        self.volts = setup.full_voltage
        self.measured = all(x.measured for x in setup.loadings)
        self.fitted = _thinned(list(setup.loadings))
        self.others = list(others or [])
        # A lag of some hundredths of a second must still show: few stretches at a fine rate rather than all coarse.
        finest = max(1, int(setup.instrument.rate_hz / _RATE_HZ))
        self.average = 1 if self.measured else min(setup.average, finest)
        self.channels = list(setup.instrument.channels)
        # Of steady points the colour is what the curve leaves, not noise: blocks alone allow for it.
        self.short = np.median([x.size for x in self.fitted]) < SHORT
        self.plain = self.short or (self.measured and setup.steady_points)
        self.taps: list[np.ndarray] = []
        if not self.measured:
            self.leave_to_rotors()
        self._starts: dict[tuple[int, int, bool], _Commanded] = {}
        self._made: dict[tuple, np.ndarray] = {}

    def start_of(self, loading: Loading, finer: int) -> _Commanded:
        """What a chain starts from on a stretch of the setup; remembered, for it is the same in every evaluation."""
        key = (id(loading), finer, self.holds)
        if key not in self._starts:
            self._starts[key] = _commanded(loading, finer, self.holds)
        return self._starts[key]

    def made(self, loading: Loading, chain: Chain, values: tuple[float, ...], finer: int) -> np.ndarray:
        """Speeds (n, u), rad/s, that a chain's forms make of a stretch's commands, on a clock `finer` times faster.

        Remembered for a while: a Jacobian moves one value after another, and what the forms before it make stays.
        """
        remembered = 24  # Speeds of each stretch that are remembered: those of one Jacobian.
        start = self.start_of(loading, finer)
        if not chain:
            return start.command
        key = (id(loading), finer, self.holds, values, *(id(form) for _, form in chain))
        if key not in self._made:
            form, own = chain[-1][1], len(values) - len(chain[-1][1].parameters)
            speed = self.made(loading, chain[:-1], values[:own], finer)
            path = SpeedPath(speed, start.time_s, self.first_full, start.voltage, self.volts, self.holds)
            # A curve may have no real value far from its truth; a rotor at rest is the honest limit.
            with np.errstate(invalid="ignore"):
                speed = form.apply(path, np.array(values[own:]))
            if len(self._made) > remembered * len(self.fitted):
                del self._made[next(iter(self._made))]
            self._made[key] = speed if np.isfinite(speed).all() else np.nan_to_num(speed)
        return self._made[key]

    def speed(self, loading: Loading, chain: Chain, values, full_speed: float) -> np.ndarray:
        """Rotor speeds (n, k), rad/s, that a chain makes of a stretch's commands; they scale with the full speed.

        `values` are those of the forms, then what `unknown_courses` names.
        """
        finer = _FINER if _takes_time(chain) else 1
        own = sum(len(form.parameters) for _, form in chain)
        speed = self.made(loading, chain, tuple(float(v) for v in values[:own]), finer)
        speed = moved_between_samples(speed, np.asarray(values[own:]), loading.dt_s, finer)
        return speed[:, self.start_of(loading, finer).which] * (full_speed / self.first_full)

    def leave_to_rotors(self) -> None:
        """Take off the readings that are fitted what effects add at any speed alike, and off the loads the rotors' own.

        What depends on no speed is so made once, and not in every evaluation.
        """
        vehicle, own, other = self.setup.vehicle, self.fitted, []
        for x in own:
            speed = 0.5 * x.command + 0.25 * self.first_full
            other.append(loaded_by(replace(x, motion=with_speed(x.motion, speed)), vehicle))
        acting = []
        for pair in self.others:
            added = [form_reading(*pair, x, vehicle) for x in own]
            if all(np.array_equal(a, form_reading(*pair, x, vehicle)) for a, x in zip(added, other, strict=True)):
                own = [replace(x, reading=x.reading - a) for a, x in zip(added, own, strict=True)]
            else:
                acting.append(pair)
        self.others = acting
        self.fitted = [replace(x, load=x.load - rotor_wrench(x.motion, vehicle)) for x in own]

    def raw(self, chain: Chain, theta, loadings=None) -> list[np.ndarray]:
        """Measured minus modelled response of every stretch, (rows, channels or rotors), not whitened."""
        full, values = (theta[0], theta[1:]) if self.scaled else (self.first_full, theta)
        accelerating = any("rotor_acceleration" in form.requires for form, _ in self.others)
        out = []
        for x in self.fitted if loadings is None else loadings:
            speed = self.speed(x, chain, values, full)
            if self.measured:
                read = x.motion.rotor_speed if x.speed_read is None else x.speed_read
                out.append(read - speed)
                continue
            motion = with_speed(x.motion, speed) if accelerating else replace(x.motion, rotor_speed=speed)
            moved = replace(x, motion=motion, load=x.load + rotor_wrench(motion, self.setup.vehicle))
            left = moved.reading - moved.load - forms_reading(self.others, moved, self.setup.vehicle)
            rows = averaged(left[:, self.channels], self.average)
            out += [rows[p] for p in pieces_of(moved, self.average)]
        return out

    def free(self, parts: list[np.ndarray]) -> list[np.ndarray]:
        """Residuals with a constant by channel taken off, where the wrench is the response."""
        if self.measured:
            return parts
        mean = np.concatenate(parts).mean(axis=0)
        return [p - mean for p in parts]

    def learn(self, chain: Chain, theta, coloured: bool = True) -> None:
        """Whitening filters of the residual of a chain; not `coloured`: its size alone counts."""
        parts = self.free(self.raw(chain, theta))
        width = parts[0].shape[1]
        self.taps = []
        for c in range(width):
            own = [p[:, c] for p in parts]
            sigma = max(float(np.sqrt(np.mean(np.concatenate(own) ** 2))), 1e-12)
            self.taps.append(np.array([1.0 / sigma]) if self.plain or not coloured else autoregression(own))
        self.noise = np.array([np.sqrt(np.mean(np.concatenate([p[:, c] for p in parts]) ** 2)) for c in range(width)])

    def white(self, chain: Chain, theta) -> np.ndarray:
        """Whitened residuals of all stretches in a row."""
        parts = self.free(self.raw(chain, theta))
        return np.concatenate(
            [np.stack([causal(t, p[:, c]) for c, t in enumerate(self.taps)], axis=1).ravel() for p in parts]
        )

    def neutral(self) -> np.ndarray:
        return np.array([self.first_full]) if self.scaled else np.zeros(0)

    def unknown(self, chain: Chain) -> np.ndarray:
        return unknown_courses(chain, 1.0 / self.setup.instrument.rate_hz)

    def bounds(self, chain: Chain) -> tuple[np.ndarray, np.ndarray]:
        most_doubt = 3.0  # Standard deviations by which a command may differ from the curve through its samples.
        low = [0.2 * self.first_full] if self.scaled else []
        high = [5.0 * self.first_full] if self.scaled else []
        for _, form in chain:
            # Rotors do not turn before their command: a wrench that is early beyond a sample is on another clock.
            delays = form.stage == DELAY and not self.measured
            early = -_SUB_SAMPLE / self.setup.instrument.rate_hz if delays else -np.inf
            low += [max(p.low, early) for p in form.parameters]
            high += [p.high for p in form.parameters]
        reach = most_doubt * self.unknown(chain)
        return np.array([*low, *-reach]), np.array([*high, *reach])

    def fit(self, chain: Chain, start: np.ndarray, most: int = _MOST_STEPS) -> _ChainFit:
        """Nonlinear least squares from a start, `most` evaluations of the Jacobian at most."""
        low, high = self.bounds(chain)
        if not len(start):
            w = self.white(chain, start)
            return _ChainFit(chain, start, float(w @ w), self.scaled)
        span = np.where(np.isfinite(high - low), high - low, np.maximum(np.abs(start), 1.0))
        start = np.clip(start, low + 1e-9 * span, high - 1e-9 * span)
        unknown = self.unknown(chain)
        known = len(start) - len(unknown)
        found = least_squares(
            # What is not known between samples joins the residuals in its one-sigmas.
            lambda theta: np.concatenate([self.white(chain, theta), theta[known:] / unknown]),
            start,
            bounds=(low, high),
            x_scale=np.maximum(np.abs(start), 0.02 * span),
            diff_step=1e-4,
            max_nfev=most,
        )
        return _ChainFit(chain, found.x, float(2 * found.cost), self.scaled)

    def fit_to(self, chain: Chain, start: np.ndarray, cost: float) -> _ChainFit:
        """As `fit`, but left where a cost is reached, or where it would not be at the pace of the last few steps."""
        # Share of a cost by which a fit is still above it after a few steps when it will not come down to it.
        far = 0.05
        fit = self.fit(chain, start, _QUICK_FIT)
        if fit.cost > (1 + far) * cost:
            return fit
        for more in reversed(range(_MOST_STEPS // _QUICK_FIT)):
            if fit.cost < cost:
                break
            before, fit = fit, self.fit(chain, fit.theta, _QUICK_FIT)
            if fit.cost - more * (before.cost - fit.cost) >= cost:
                break
        return fit

    def covariance(self, fit: _ChainFit) -> tuple[np.ndarray, int]:
        """Block-robust covariance of the parameters, and the number of blocks."""
        base = self.white(fit.chain, fit.theta)
        low, high = self.bounds(fit.chain)
        columns = []
        for i in range(len(fit.theta)):
            step = 1e-4 * max(abs(fit.theta[i]), 0.01 * min(high[i] - low[i], 1e3))
            moved = fit.theta.copy()
            moved[i] += step if moved[i] + step <= high[i] else -step
            columns.append((self.white(fit.chain, moved) - base) / (moved[i] - fit.theta[i]))
        jacobian = np.stack(columns, axis=1)
        unknown = self.unknown(fit.chain)
        known = np.concatenate([np.zeros(len(fit.theta) - len(unknown)), unknown**-2.0])
        unit = 1.0 / np.sqrt(np.maximum((jacobian**2).sum(axis=0) + known, 1e-300))
        gram = (jacobian * unit).T @ (jacobian * unit) + np.diag(known * unit**2)
        inverse = np.linalg.pinv(gram + 1e-9 * np.eye(len(gram)), hermitian=True)
        blocks = self.blocks(len(base))
        scores = np.array([(jacobian[b] * unit).T @ base[b] for b in blocks])
        count = len(blocks)
        robust = inverse @ (scores.T @ scores) @ inverse * count / max(count - len(fit.theta), 1)
        sigma2 = float(base @ base) / max(len(base) - len(fit.theta), 1)
        return at_least(robust, inverse * max(sigma2, 1.0)) * np.outer(unit, unit), count

    def blocks(self, size: int) -> list[np.ndarray]:
        width = len(self.taps)
        if self.short:
            return np.array_split(np.arange(size), max(size // width, 2))
        rate = self.setup.instrument.rate_hz / self.average
        per = max(int(_BLOCK_S * rate), 2) * width
        most = _STEADY_BLOCKS if self.plain else _MOST_BLOCKS
        count = max(min(size // per, most), min(_LEAST_BLOCKS, size // (2 * width)), 2)
        return [b for b in np.array_split(np.arange(size), count) if len(b)]


def supply_reason(setup: PreparedInstrument) -> str | None:
    """Why the sag of the battery cannot be tested on the runs that are fitted; None if it can."""
    least_span = 0.02  # Relative span of the voltage below which its effect cannot be tested.
    known = [x.motion.voltage for x in _thinned(list(setup.loadings)) if x.motion.voltage is not None]
    # The lowest and highest hundredth of the samples left out.
    volts = np.concatenate(known) if known else np.ones(1)
    volts = volts[(volts >= np.quantile(volts, 0.01)) & (volts <= np.quantile(volts, 0.99))]
    if not known or np.ptp(volts) >= least_span * volts.mean():
        return None
    return f"the supply voltage hardly varies in the runs that are fitted ({volts.min():.1f} to {volts.max():.1f} V)"


def _thinned(loadings: list[Loading]) -> list[Loading]:
    """Stretches spread over the runs with MOST_SAMPLES at most."""
    total = sum(x.size for x in loadings)
    step = max(1, int(np.ceil(total / _MOST_SAMPLES)))
    return loadings[::step] if len(loadings) >= 4 * step else loadings


def _candidates(setup: PreparedInstrument) -> list[tuple[str, SpeedForm]]:
    """Forms that these recordings can test."""
    out = []
    for key, effect in catalogue().items():
        for form in effect.speed_forms:
            if setup.steady_points and form.stage >= DELAY:
                continue
            if "voltage" in form.requires and any(x.motion.voltage is None for x in setup.loadings):
                continue
            if form.excited_by == "time" and all(x.motion.voltage is not None for x in setup.loadings):
                continue
            if setup.estimated_full_speed and form.own_scale:
                continue  # with the full speed free it would be there twice
            out.append((key, form))
    return out


def starts(form: SpeedForm) -> list[np.ndarray]:
    """Starting values of a form: its nonlinear parameters' own, a little off neutral for the others."""
    neutral = np.array(form.neutral, float)
    options = [neutral + 0.01 * np.array([min(p.high - p.low, 1.0) for p in form.parameters])]
    for values in zip(*[p.starts or (n,) for p, n in zip(form.parameters, neutral, strict=True)], strict=False):
        options.append(np.array(values, float))
    return options[:_MOST]


def _ordered(chain: Chain) -> Chain:
    return tuple(sorted(chain, key=lambda pair: pair[1].stage))


def _start_of(problem: _ChainProblem, chain: Chain, fit: _ChainFit, new: str = "", values=()) -> np.ndarray:
    """Start of a chain from the fit of another that may lack one form, nothing having happened between its samples."""
    known = {key: fit.theta[fit.place(key)] for key, _ in fit.chain}
    theta = [values if key == new else known.get(key, form.neutral) for key, form in chain]
    return np.concatenate([fit.full, *theta, np.zeros(len(problem.unknown(chain)))])


def _start_with(problem: _ChainProblem, chain: Chain, fit: _ChainFit, new: tuple[str, SpeedForm]) -> np.ndarray:
    """Start of a chain with a new form from what is known of the others: of the form's starts that explains most."""
    options = [_start_of(problem, chain, fit, new[0], v) for v in starts(new[1])]
    return min(options, key=lambda theta: float(np.sum(problem.white(chain, theta) ** 2)))


def find_chain(setup: PreparedInstrument, others: list | None = None) -> ChainResult | None:
    """The chain between command and speed; None where no command is recorded."""
    if not all(x.command is not None for x in setup.loadings):
        return None
    if not any(np.any(x.command > 0) for x in setup.loadings):
        return None
    problem = _ChainProblem(setup, others)
    forms = _candidates(setup)
    # What no form explains yet is no noise: whitened by it, slow steps of the command would leave their jumps alone.
    problem.learn((), problem.neutral(), coloured=False)
    best = problem.fit((), problem.neutral())
    dropped: dict[str, str] = {}
    best = _richer(problem, _holding_or_not(problem, _grown(problem, best, forms, dropped)))
    best = _pruned(problem, best, dropped)
    return _worded(problem, _without_mere_scale(problem, best, dropped), forms, dropped)


def _without_mere_scale(problem: _ChainProblem, best: _ChainFit, dropped: dict[str, str]) -> _ChainFit:
    """The chain without forms that only say what another thrust coefficient would.

    Where no speed is measured, speeds that are all a share higher than commanded are a thrust that is larger: a value
    that is wrong, and no curve of the throttle.
    """
    while not problem.measured and not problem.scaled:
        scaled = copy(problem)
        scaled.scaled = True
        found = None
        for key, form in best.chain:
            if form.stage not in (CURVE, SUPPLY):
                continue
            rest = best.chain_without(key)
            fit = scaled.fit(rest, np.concatenate([[problem.first_full], _start_of(problem, rest, best)]))
            if fit.cost < best.cost + COST_PER_PARAMETER * (len(form.parameters) - 1):
                found = key, _ChainFit(rest, fit.values, fit.cost, False)
        if found is None:
            return best
        dropped[found[0]] = "another thrust coefficient explains as much"
        best = found[1]
    return best


def _holding_or_not(problem: _ChainProblem, best: _ChainFit) -> _ChainFit:
    """The fit with commands that hold from sample to sample, or with smooth ones, whichever explains more.

    A chain that takes time sees the difference. Compared by sizes alone: whitened by its own residual, the poorer of
    the two would look as good. `problem` is left with the better one.
    """
    if not _takes_time(best.chain):
        return best
    problem.learn(best.chain, best.theta, coloured=False)
    own = problem.fit(best.chain, best.theta)
    problem.holds = not problem.holds
    other = problem.fit(best.chain, best.theta)
    if other.cost > own.cost - _ALIKE:
        problem.holds = not problem.holds
        other = own
    return _richer(problem, other)


def _grown(problem: _ChainProblem, best: _ChainFit, forms, dropped: dict[str, str]) -> _ChainFit:
    """The chain with forms added one by one as long as they explain more; why others did not enter in `dropped`."""
    for _ in range(_MOST):
        # Whitening by the residual of the richest chain seen: by a poor one's, everything would look like noise.
        problem.learn(best.chain, best.theta, coloured=bool(best.chain))
        best = problem.fit(best.chain, best.theta)
        tried = []
        for pair in forms:
            if pair[0] in {k for k, _ in best.chain} or pair[0] in dropped:
                continue
            chain = _ordered((*best.chain, pair))
            fit = problem.fit(chain, _start_with(problem, chain, best, pair), _QUICK_FIT)
            tried.append((best.cost - fit.cost - COST_PER_PARAMETER * len(pair[1].parameters), pair, fit))
        tried.sort(key=lambda t: -t[0])
        entered = False
        for score, pair, fit in tried[:_MOST]:
            if score <= 0:
                break
            fit = problem.fit(fit.chain, fit.theta)
            reason = _weakness(problem, fit, best, pair)
            if reason is None:
                best, entered = fit, True
                break
            dropped.setdefault(pair[0], reason)
        if not entered:
            break
    return best


def _weakness(problem: _ChainProblem, fit: _ChainFit, without: _ChainFit, pair) -> str | None:
    """Why a form does not enter; None if it does."""
    inner = _richer(problem, fit)
    where = inner.place(pair[0])
    covariance, count = problem.covariance(inner)
    p = p_value(inner.theta[where] - np.array(pair[1].neutral), covariance[where, where], count)
    if p > ENTER_P:
        return f"p = {p:.2g}"
    old, new = problem.raw(without.chain, without.theta), problem.raw(inner.chain, inner.theta)
    change = np.concatenate([a - b for a, b in zip(old, new, strict=True)])
    size = float((np.sqrt(np.quantile(change**2, 0.95, axis=0)) / np.maximum(problem.noise, 1e-12)).max())
    if size < SMALLEST_SIZE:
        return f"its size is {size:.2g} of the noise"
    return None


def _pruned(problem: _ChainProblem, best: _ChainFit, dropped: dict[str, str]) -> _ChainFit:
    """The chain without what is no longer significant given the forms that came after it."""
    while best.chain:
        covariance, count = problem.covariance(best)
        doubtful = {}
        for key, form in best.chain:
            where = best.place(key)
            p = p_value(best.theta[where] - np.array(form.neutral), covariance[where, where], count)
            if p > ENTER_P:
                doubtful[key] = p
        if not doubtful:
            return best
        worst = max(doubtful, key=doubtful.get)
        dropped.setdefault(worst, f"p = {doubtful[worst]:.2g} given the others")
        kept = best.chain_without(worst)
        best = _richer(problem, replace(best, chain=kept, theta=_start_of(problem, kept, best)))
    return best


def p_value(offset: np.ndarray, covariance: np.ndarray, count: int) -> float:
    """Hotelling's T² over blocks."""
    q = len(offset)
    if count - q < 2:
        return 1.0
    statistic = quadratic_form(offset, covariance)
    return float(f_distribution.sf(statistic * (count - q) / (q * (count - 1)), q, count - q))


def _richer(problem: _ChainProblem, fit: _ChainFit) -> _ChainFit:
    """The fit once more, whitened by its own residual."""
    problem.learn(fit.chain, fit.theta)
    return problem.fit(fit.chain, fit.theta)


def _worded(problem: _ChainProblem, best: _ChainFit, forms, dropped: dict[str, str]) -> ChainResult:
    """Findings of a chain with intervals, p-values and alternatives."""
    covariance, count = problem.covariance(best) if len(best.theta) else (np.zeros((0, 0)), 2)
    sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    setup, effects = problem.setup, catalogue()
    channels = (
        tuple(f"rotor_speed_{i + 1}" for i in range(setup.vehicle.rotor_count)) if problem.measured else ("force_z",)
    )
    findings = []
    dt_s = 1.0 / setup.instrument.rate_hz
    for key, form in best.chain:
        where = best.place(key)
        if form.stage == DELAY and abs(best.theta[where][0]) <= _SUB_SAMPLE * dt_s:
            continue  # less than a sample: no finding
        values, deviation = best.theta[where], sd[where]
        p = p_value(values - np.array(form.neutral), covariance[where, where], count)
        others = alternatives(problem, best, key, forms)
        findings.append(
            Finding(
                id=key,
                status="ambiguous" if others else "established",
                values=tuple(float(v) for v in values),
                equation=form.equation,
                sentence=effects[key].sentence,
                parameters=tuple(
                    Estimate(pr.symbol, float(v), pr.unit, float(v - 1.96 * s), float(v + 1.96 * s))
                    for pr, v, s in zip(form.parameters, values, deviation, strict=True)
                ),
                p_value=p,
                channels=channels,
                alternatives=tuple(sorted({key, *others})) if others else (),
            )
        )
    names = {f.id for f in findings}
    for key, reason in dropped.items():
        if key not in names:
            text = f"{effects[key].name} did not hold: {reason}"
            findings.append(Finding(id=key, status="not_established", sentence=text))
    full, doubt = (float(best.theta[0]), float(sd[0])) if problem.scaled else (problem.first_full, 0.0)
    noise = float(np.sqrt(np.mean(problem.noise**2))) if problem.measured else None
    return ChainResult(best, full, doubt, findings, noise, problem.holds)


def alternatives(problem: _ChainProblem, best: _ChainFit, key: str, forms) -> list[str]:
    """Ids that in a form's place explain as well."""
    out = []
    rest = best.chain_without(key)
    taken = {k for k, _ in rest}
    size = len(next(f for k, f in best.chain if k == key).parameters)
    for pair in forms:
        if pair[0] == key or pair[0] in taken or pair[0] in out or len(pair[1].parameters) > size + 1:
            continue
        chain = _ordered((*rest, pair))
        if problem.fit_to(chain, _start_with(problem, chain, best, pair), best.cost + _ALIKE).cost < best.cost + _ALIKE:
            out.append(pair[0])
    if not problem.measured:
        out += _reading_alternatives(problem, best, rest, key)
    return out


def _reading_alternatives(problem: _ChainProblem, best: _ChainFit, rest: Chain, key: str) -> list[str]:
    """Effects of the reading that explain as well in a form's place, where no speed is measured."""
    out = sorted(ids_of("same_on_commands", key))
    known, low, high = _start_of(problem, rest, best), *problem.bounds(rest)

    def explains(form: Form, value: float) -> bool:
        first, with_it = form.parameters[0], copy(problem)

        def white(theta):
            with_it.others = [*problem.others, (form, theta[:1])]
            return with_it.white(rest, theta[1:])

        start, bounds = np.append(value, known), (np.append(first.low, low), np.append(first.high, high))
        found = least_squares(
            white,
            np.clip(start, *bounds),
            bounds=bounds,
            x_scale=np.maximum(np.abs(start), 1e-3),
            diff_step=1e-4,
            max_nfev=15,
        )
        return 2 * found.cost < best.cost + _ALIKE

    for name in catalogue()[key].like_of_reading:
        forms = forms_of(catalogue()[name], problem.setup.instrument)
        if name not in out and any(explains(f, value) for f in forms for value in f.parameters[0].starts):
            out.append(name)
    return out


def moved(setup: PreparedInstrument, result: ChainResult) -> tuple[Loading, ...]:
    """Loadings with the speeds that the chain makes of the commands (where none are measured)."""
    problem, fit = _ChainProblem(setup, holds=result.holds), result.fit
    out = []
    for x in setup.loadings:
        speed = problem.speed(x, fit.chain, fit.values, result.full_speed)
        command = x.command * (result.full_speed / problem.first_full)
        out.append(loaded_by(replace(x, command=command, motion=with_speed(x.motion, speed)), setup.vehicle))
    return tuple(out)


def without_id(result: ChainResult, key: str) -> ChainResult:
    """The result with one id less between command and speed, the numbers of the others as they are."""
    fit = result.fit
    known = int(fit.scaled) + sum(len(f.parameters) for _, f in fit.chain)
    theta = np.delete(fit.theta[:known], np.arange(known)[fit.place(key)])
    return replace(result, fit=replace(fit, chain=fit.chain_without(key), theta=theta))


def speed_traces(setup: PreparedInstrument, result: ChainResult) -> tuple[ChannelTrace, ...]:
    """Measured less commanded and less modelled speed of every rotor, where both are recorded."""
    problem = _ChainProblem(setup, holds=result.holds)
    start = problem.neutral()
    if problem.scaled:
        start = np.array([result.full_speed])
    believed = problem.raw((), start, setup.loadings)
    left = problem.raw(result.fit.chain, result.fit.theta, setup.loadings)
    out = []
    for x, a, b in zip(setup.loadings, believed, left, strict=True):
        times, a, b = averaged(x.time_s, setup.average), averaged(a, setup.average), averaged(b, setup.average)
        for i in range(a.shape[1]):
            out.append(ChannelTrace(x.run, f"rotor_speed_{i + 1}", "rad/s", times, a[:, i], a[:, i], b[:, i], b[:, i]))
    return tuple(out)
