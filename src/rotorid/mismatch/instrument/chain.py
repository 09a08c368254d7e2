"""What lies between command and rotor speed on a stand: lag, delay, throttle curve, sag, saturation.

Where speeds are measured in addition to the commands they are the response; where only commands or throttles are
recorded the response is the wrench, with a constant for each channel and the reading's effects found so far taken off.
The search is that of flights (`rotorid.mismatch.evidence.speedpath`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from rotorid.effects.catalogue import catalogue, ids_of
from rotorid.effects.contract import CURVE, DELAY, SUPPLY, Form, SpeedForm, SpeedPath
from rotorid.effects.loading import Loading, between_samples, forms_of, weights_of_four
from rotorid.mismatch.decide import rules
from rotorid.mismatch.decide.findings import ChannelTrace, Finding
from rotorid.mismatch.decide.selected import path_findings
from rotorid.mismatch.evidence.rows import form_reading, forms_reading
from rotorid.mismatch.evidence.speedpath import (
    COST_PER_PARAMETER,
    Chain,
    PathProblem,
    SpeedResult,
    SpeedSearch,
    steps_of,
)
from rotorid.mismatch.instrument.setup import (
    SHORT,
    PreparedInstrument,
    averaged,
    loaded_by,
    pieces_of,
    rotor_wrench,
    with_speed,
    with_unseen,
)
from rotorid.recordings import RecordingSet

_RATE_HZ = 30.0
"""Rate at which wrenches are compared where no speed is measured."""
_SUB_SAMPLE = 1.2
"""Samples by which the clocks of a command and a wrench may lie apart: no delay."""
_FREE_SPEED = (np.inf, -0.8, 4.0)
"""One-sigma and bounds of a full speed that nobody states, as a share of the one that it is taken for."""
_FINER = 4
"""Steps of a chain that takes time to one sample."""


@dataclass(frozen=True)
class ChainResult:
    """What was found between command and speed."""

    result: SpeedResult
    full_speed: float
    full_speed_sd: float
    findings: tuple[Finding, ...] = ()

    def less(self, ids: Sequence[str]) -> ChainResult:
        """The result with fewer ids between command and speed."""
        return replace(self, result=self.result.less(ids))


def _takes_time(chain: Chain) -> bool:
    return any(form.excited_by == "change" for _, form in chain)


def unknown_courses(dt_s: float) -> np.ndarray:
    """One-sigma of what a command did between its samples, which nobody recorded: its first two moments, (2,).

    By how much it was late (s), and by which variance in time it was smoother or sharper than the curve through its
    samples (s²). A command that holds is late by half a sample and spread by dt²/12, a straight line across a kink is
    off by as much at most.
    """
    return np.array([0.5 * dt_s, dt_s**2 / 12.0])


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


class StandPath(PathProblem):
    """Residuals of a chain on the stretches of a stand that are fitted.

    Unknown are the full speed where nobody states it, as a share of the one that it is taken for, and what a chain that
    takes time sees of a command between its samples (`unknown_courses`).
    """

    rich = False

    def __init__(self, setup: PreparedInstrument, others: list | None = None, holds: bool = False):
        """`others` are (form, values) of effects of the reading found so far.

        `holds` says that a command stands until its next sample; else it is smooth.
        """
        self.setup = setup
        self.scaled = setup.estimated_full_speed
        self.measured = all(x.measured for x in setup.loadings)
        self.fitted = _thinned(list(setup.loadings))
        self.others = list(others or [])
        # A lag of some hundredths of a second must still show: few stretches at a fine rate rather than all coarse.
        finest = max(1, int(setup.instrument.rate_hz / _RATE_HZ))
        self.average = 1 if self.measured else min(setup.average, finest)
        self.channels = list(setup.instrument.channels)
        # Of steady points the colour is what the curve leaves, not noise: blocks alone allow for it.
        self.short = np.median([x.size for x in self.fitted]) < SHORT
        self.coloured = not (self.short or (self.measured and setup.steady_points))
        self._starts: dict[tuple[int, int, bool], _Commanded] = {}
        self._made: dict[tuple, np.ndarray] = {}
        rate_hz = setup.instrument.rate_hz
        super().__init__(
            [(x.command, x.time_s) for x in self.fitted],
            rate_hz,
            setup.full_speed or max(float(np.max(x.command)) for x in setup.loadings),
            np.ones(setup.vehicle.rotor_count if self.measured else len(self.channels)),
        )
        self.holds = holds
        if not self.measured:
            self.leave_to_rotors()

    def unknown(self, chain: Chain) -> Mapping[str, tuple[float, float, float]]:
        """Share that the full speed is larger, then moments of the course between samples: late (s), spread (s²).

        A delay in the chain is the first moment already.
        """
        most_doubt = 3.0  # Standard deviations by which a command may differ from the curve through its samples.
        moments = dict(zip(("late", "spread"), unknown_courses(1.0 / self.rate_hz), strict=True))
        if any(form.stage == DELAY for _, form in chain):
            del moments["late"]
        courses = {name: (sd, -most_doubt * sd, most_doubt * sd) for name, sd in moments.items()}
        return {**({"full": _FREE_SPEED} if self.scaled else {}), **(courses if _takes_time(chain) else {})}

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
            voltage, full = start.voltage, self.setup.full_voltage
            path = SpeedPath(speed, start.time_s, self.full_speed, voltage, full, self.holds)
            # A curve may have no real value far from its truth; a rotor at rest is the honest limit.
            with np.errstate(invalid="ignore"):
                speed = form.apply(path, np.array(values[own:]))
            if len(self._made) > remembered * len(self.fitted):
                del self._made[next(iter(self._made))]
            self._made[key] = speed if np.isfinite(speed).all() else np.nan_to_num(speed)
        return self._made[key]

    def speed(self, loading: Loading, chain: Chain, values, nuisances) -> np.ndarray:
        """Rotor speeds (n, k), rad/s, that a chain makes of a stretch's commands; they scale with the full speed."""
        steps = sorted(steps_of(chain, values), key=lambda step: step[1].stage)
        path, finer = tuple((key, form) for key, form, _ in steps), _FINER if _takes_time(chain) else 1
        speed = self.made(loading, path, tuple(float(v) for *_, own in steps for v in own), finer)
        speed = moved_between_samples(speed, np.asarray(nuisances)[int(self.scaled) :], loading.dt_s, finer)
        return speed[:, self.start_of(loading, finer).which] * (1.0 + (nuisances[0] if self.scaled else 0.0))

    def leave_to_rotors(self) -> None:
        """Take off the readings that are fitted what effects add at any speed alike, and off the loads the rotors' own.

        What depends on no speed is so made once, and not in every evaluation.
        """
        vehicle, own, other = self.setup.vehicle, self.fitted, []
        for x in own:
            speed = 0.5 * x.command + 0.25 * self.full_speed
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

    def raw(self, chain: Chain, values, nuisances, loadings=None) -> list[np.ndarray]:
        """Measured less modelled response of every stretch, (rows, rotors), or of every piece, (rows, channels), less
        its mean over all."""
        accelerating = any("rotor_acceleration" in form.requires for form, _ in self.others)
        out = []
        for x in self.fitted if loadings is None else loadings:
            speed = self.speed(x, chain, values, nuisances)
            if self.measured:
                out.append((x.motion.rotor_speed if x.speed_read is None else x.speed_read) - speed)
                continue
            motion = with_speed(x.motion, speed) if accelerating else replace(x.motion, rotor_speed=speed)
            moved = replace(x, motion=motion, load=x.load + rotor_wrench(motion, self.setup.vehicle))
            left = moved.reading - moved.load - forms_reading(self.others, moved, self.setup.vehicle)
            rows = averaged(left[:, self.channels], self.average)
            out += [rows[p] for p in pieces_of(moved, self.average)]
        mean = 0.0 if self.measured else np.concatenate(out).mean(axis=0)
        return [p - mean for p in out]

    def noticed_s(self, form: SpeedForm) -> float:
        """Half a sample; of a delay between a command and a wrench a little more than one."""
        delayed = form.stage == DELAY and not self.measured
        return _SUB_SAMPLE / self.rate_hz if delayed else super().noticed_s(form)

    def low_of(self, form: SpeedForm) -> list[float]:
        """Rotors do not turn before their command: a wrench that is early beyond a sample is on another clock."""
        early = -_SUB_SAMPLE / self.rate_hz if form.stage == DELAY and not self.measured else -np.inf
        return [max(p.low, early) for p in form.parameters]

    def blocks(self, sizes: Sequence[int]) -> list[list[np.ndarray]]:
        """About a second each of all stretches together, within bounds on their number; of steady points each row."""
        rows = sum(sizes)
        per = max(int(self.rate_hz / self.average), 2)
        least_blocks, most_blocks, steady_blocks = 12, 400, 40
        most = most_blocks if self.coloured else steady_blocks
        count = rows if self.short else min(max(rows // per, 1), most)
        count = max(count, min(least_blocks, rows // 2), 2)
        return [[b for b in np.array_split(np.arange(rows), count) if len(b)]]


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
    """Stretches spread over the runs with `most_samples` at most."""
    total = sum(x.size for x in loadings)
    most_samples = 12_000
    step = max(1, int(np.ceil(total / most_samples)))
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


def find_chain(setup: PreparedInstrument, others: list | None = None) -> ChainResult | None:
    """The chain between command and speed; None where no command is recorded."""
    if not all(x.command is not None for x in setup.loadings):
        return None
    if not any(np.any(x.command > 0) for x in setup.loadings):
        return None
    problem = StandPath(setup, others)
    search = SpeedSearch(problem, _candidates(setup))
    result = search.run()
    if not problem.measured:
        result = _without_mere_scale(problem, result)
        more = {key: _reading_alternatives(problem, result, key) for key, _ in result.fit.chain}
        result = replace(result, alternatives={k: (*result.alternatives[k], *own) for k, own in more.items()})
    rotors = range(setup.vehicle.rotor_count)
    channels = tuple(f"rotor_speed_{i + 1}" for i in rotors) if problem.measured else ("force_z",)
    share, doubt = (of["full"] if problem.scaled else 0.0 for of in (result.fit.nuisances, result.fit.nuisance_sd))
    findings = tuple(path_findings(result, channels))
    return ChainResult(result, problem.full_speed * (1.0 + share), problem.full_speed * doubt, findings)


def _without_mere_scale(problem: StandPath, result: SpeedResult) -> SpeedResult:
    """The result without forms that only say what another thrust coefficient would, the others as that leaves them.

    Where no speed is measured, speeds that are all a share higher than commanded are a thrust that is larger: a value
    that is wrong, and no curve of the throttle.
    """
    if problem.scaled:
        return result
    scaled = copy(problem)
    scaled.scaled = True
    for key, form in result.fit.chain:
        if form.stage in (CURVE, SUPPLY):
            rest = result.without[key]
            fit = scaled.fit(rest.chain, rest.values, rest)
            if fit.cost < result.fit.cost + COST_PER_PARAMETER * (len(form.parameters) - 1):
                fit = scaled.with_covariance(fit)
                dropped = {**result.dropped, key: "another thrust coefficient explains as much"}
                fewer = {other: fit.without(other) for other, _ in fit.chain}
                return _without_mere_scale(problem, replace(result, fit=fit, without=fewer, dropped=dropped))
    return result


def _reading_alternatives(problem: StandPath, result: SpeedResult, key: str) -> list[str]:
    """Effects of the reading that explain as well in a form's place, where no speed is measured."""
    out = sorted(ids_of("same_on_commands", key))
    rest, most = result.without[key], result.fit.cost + rules.ELSEWHERE["squares"]
    known, own = np.append(rest.values, problem.nuisances(rest.chain, rest)), len(rest.values)
    low, high = problem.bounds(rest.chain)

    def explains(form: Form, value: float) -> bool:
        first, with_it = form.parameters[0], copy(problem)

        def white(theta):
            with_it.others = [*problem.others, (form, theta[:1])]
            parts = with_it.whitened(rest.chain, theta[1 : 1 + own], theta[1 + own :])
            return np.concatenate([w.ravel() for w in parts])

        start, bounds = np.append(value, known), (np.append(first.low, low), np.append(first.high, high))
        found = least_squares(
            white,
            np.clip(start, *bounds),
            bounds=bounds,
            x_scale=np.maximum(np.abs(start), 1e-3),
            diff_step=1e-4,
            max_nfev=15,
        )
        return 2 * found.cost < most

    for name in catalogue()[key].like_of_reading:
        forms = forms_of(catalogue()[name], problem.setup.instrument)
        if name not in out and any(explains(f, value) for f in forms for value in f.parameters[0].starts):
            out.append(name)
    return out


def moved(setup: PreparedInstrument, found: ChainResult) -> tuple[Loading, ...]:
    """Loadings with the speeds that the chain makes of the commands (where none are measured)."""
    fit = found.result.fit
    problem = StandPath(setup, holds=fit.holds)
    out = []
    for x in setup.loadings:
        speed = problem.speed(x, fit.chain, fit.values, problem.nuisances(fit.chain, fit))
        command = x.command * (found.full_speed / problem.full_speed)
        out.append(loaded_by(replace(x, command=command, motion=with_speed(x.motion, speed)), setup.vehicle))
    return tuple(out)


def unseen_loadings(
    setup: PreparedInstrument, unseen: RecordingSet, found: ChainResult | None
) -> tuple[PreparedInstrument, tuple[Loading, ...]]:
    """The setup with the stretches of other runs behind its own, and those: their rotors turn as the chain makes of
    their commands where only these are known."""
    both = with_unseen(setup, unseen)
    own = both.loadings[len(setup.loadings) :]
    if found is not None and not all(x.measured for x in both.loadings):
        own = moved(replace(both, loadings=own), found)
    return both, own


def speed_traces(setup: PreparedInstrument, found: ChainResult) -> tuple[ChannelTrace, ...]:
    """Measured less commanded and less modelled speed of every rotor, where both are recorded."""
    fit = found.result.fit
    problem = StandPath(setup, holds=fit.holds)
    believed = problem.raw((), np.zeros(0), problem.nuisances((), fit), setup.loadings)
    left = problem.raw(fit.chain, fit.values, problem.nuisances(fit.chain, fit), setup.loadings)
    out = []
    for x, a, b in zip(setup.loadings, believed, left, strict=True):
        times, a, b = averaged(x.time_s, setup.average), averaged(a, setup.average), averaged(b, setup.average)
        for i in range(a.shape[1]):
            out.append(ChannelTrace(x.run, f"rotor_speed_{i + 1}", "rad/s", times, a[:, i], a[:, i], b[:, i], b[:, i]))
    return tuple(out)
