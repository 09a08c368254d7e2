"""What lies between command and rotor speed: lag, delay, throttle curve, sag, saturation.

Where speeds are measured they are the response: a chain of speed forms is fitted by nonlinear least squares on whitened
residuals, grown one id at a time. Where only commands (or throttle) are recorded `evidence.lift` reads the path.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import chi2

from rotorid.effects.catalogue import before_the_rotors, catalogue
from rotorid.effects.contract import CURVE, DELAY, LAG, LIMIT, SpeedForm, SpeedPath
from rotorid.effects.delay import shifted
from rotorid.effects.loading import weights_of_four
from rotorid.mismatch.evidence.motion import Segment
from rotorid.mismatch.evidence.regression import at_least, autoregression, quadratic_form
from rotorid.recordings.signal import kernels
from rotorid.recordings.signal.kernels import causal
from rotorid.steps import step

ENTER_P = 1e-5
"""A form between command and speed enters below this."""
COST_PER_PARAMETER = 10.0
SMALLEST_SIZE = 0.15
_LEAST_RESPONSE = 0.25
"""Least slope of a throttle curve in units of its mean: thrust proportional to throttle has a half."""
_PLAINLY_LESS = 0.98
"""Share of the squares that commands which hold leave, below which commands are smooth: a lag imitates either."""
_HARDLY_FOLLOWS = "rotors would hardly follow their commands with it"
_LIMIT_WAYS = (0.97, 0.9, 0.8, 0.65, 0.5)
_MOST_LIMITED = 0.5
"""Share of the time that a limit may hold a rotor."""
_AT_BOUND = 1e-3
"""Share of a parameter's range from its bound within which the bound holds it."""
_LEAST_INFORMATION = 1e-30
"""Inverse variance of a parameter that changes nothing."""

_STEPS_KEPT = 3
"""What a step of a chain made last that is kept: slopes move one parameter at a time, and a step has up to two."""

Chain = tuple[tuple[str, SpeedForm], ...]
LastSteps = dict[int, list[tuple[np.ndarray, tuple, np.ndarray]]]
"""By place in a chain: speeds that a step was given, the step with its values, and what it made."""


@dataclass(frozen=True)
class SpeedFit:
    """A fitted chain. `values` holds the parameters of every form in order; `shift_s` is a nuisance."""

    chain: Chain
    values: np.ndarray
    shift_s: float
    cost: float
    covariance: np.ndarray | None = None
    inflation: float = 1.0
    holds: bool = True
    """Whether commands hold from sample to sample; else they are smooth, and recorded now and then."""

    def of(self, effect_id: str) -> tuple[SpeedForm, np.ndarray]:
        """Form and values of one id."""
        at = 0
        for key, form in self.chain:
            size = len(form.parameters)
            if key == effect_id:
                return form, self.values[at : at + size]
            at += size
        raise KeyError(effect_id)

    def slice_of(self, effect_id: str) -> slice:
        """Where the id's parameters stand in `values`."""
        at = 0
        for key, form in self.chain:
            if key == effect_id:
                return slice(at, at + len(form.parameters))
            at += len(form.parameters)
        raise KeyError(effect_id)


@dataclass(frozen=True)
class SpeedResult:
    """What the search found."""

    fit: SpeedFit
    p_values: dict[str, float]
    alternatives: dict[str, tuple[str, ...]]
    sizes: dict[str, float]
    dropped: dict[str, str] = field(default_factory=dict)
    noise_rad_s: float | None = None
    """One-sigma of the rotor speed residual, where speeds are measured."""
    lag_alone: SpeedFit | None = None
    """Where a lag shares its lateness with a delay or a curve: the lag as it would be without these."""
    without: dict[str, SpeedFit] = field(default_factory=dict)
    """The chain fitted with one id less."""
    silent: Mapping[str, str] = field(default_factory=dict)
    """Ids of which the recording says nothing, with the reason."""
    about_hover: Mapping[str, tuple[float, float, str]] = field(default_factory=dict)
    """Where commands alone are recorded: hover command `u_h`, what one percent more of it (`e_u`) and of the voltage
    (`e_V`) adds to the thrust in percent, and by how much rotors are late (`tau`), as far as the recording says it.
    Each with its one-sigma and unit."""
    lifted_by_commands: bool = True
    turned_by_commands: bool = True
    """Whether lift, and roll or pitch, follow the commands in some band; else commands follow them."""


class CommandChain(NamedTuple):
    """What lies between command and rotor speed, as fitted to a set."""

    result: SpeedResult
    full_speed: float
    """rad/s, at full throttle."""
    full_voltage: float | None
    """V, at which the full speed is reached; None where no voltage is recorded."""
    scale: float = 1.0
    """Rotor speed over the one that the chain makes: where no speed is recorded, what the believed C_F needs for
    the lift that was felt. Commands alone determine thrust; C_F and the full speed are one number with it."""

    def speeds(self, segment: Segment, chain: Chain | None = None, values: np.ndarray | None = None) -> np.ndarray:
        """Rotor speeds (n, k), rad/s, of the segment's commands; by another `chain` with `values` where given."""
        fit = self.result.fit
        if chain is None:
            chain, values = fit.chain, fit.values
        full = self.full_speed, self.full_voltage
        return self.scale * commanded_path(segment, chain, values, fit.shift_s, *full, fit.holds)


def commanded_path(
    segment: Segment,
    chain: Chain,
    values: np.ndarray,
    shift_s: float,
    full_speed: float,
    full_voltage: float | None,
    holds: bool = True,
    last: LastSteps | None = None,
) -> np.ndarray:
    """Rotor speeds (n, k), rad/s, that a chain makes of the segment's commands; `holds` as in SpeedFit.

    `last` holds what the steps of the chain made of this segment last, and is kept up to date.
    """
    motion = segment.motion
    path = SpeedPath(segment.command, motion.time_s, full_speed, motion.voltage, full_voltage)
    steps, at = [], 0
    for _, form in chain:
        steps.append((form.stage, form.apply, values[at : at + len(form.parameters)]))
        at += len(form.parameters)
    steps.append((DELAY, shifted if holds else moved, np.array([shift_s])))
    for place, (_, apply, own) in enumerate(sorted(steps, key=lambda s: s[0])):
        known = [] if last is None else last.setdefault(place, [])
        asked = apply, tuple(own)
        speed = next((made for of, how, made in known if of is path.speed and how == asked), None)
        if speed is None:
            speed = apply(path, own)
            known[:] = [(path.speed, asked, speed), *known[: _STEPS_KEPT - 1]]
        path = replace(path, speed=speed)
    return path.speed


def moved(path: SpeedPath, values: np.ndarray) -> np.ndarray:
    """Speeds (n, k) of a smooth command later by `values[0]`, s: cubic between samples, the ends held.

    The mean of two neighbours, as of a command that holds, would take 8 % of a fifth of the sampling rate away.
    """
    count = len(path.speed)
    steps = float(np.clip(values[0] / path.dt_s, -count, count))
    whole = int(np.floor(steps))
    weights = weights_of_four(2.0 - (steps - whole))
    ends = abs(whole) + 2
    held = np.pad(path.speed, ((ends, ends), (0, 0)), "edge")
    first = ends - whole - 2
    return sum(w * held[first + i : first + i + count] for i, w in enumerate(weights) if w)


class MeasuredSpeed:
    """Whitened residual of a chain over the training segments: the measured rotor speeds are the response."""

    def __init__(self, segments: list[Segment], full_speed: float, full_voltage: float | None):
        self.segments = segments
        self.rate_hz = segments[0].rate_hz
        spread = np.concatenate([(s.motion.rotor_speed - s.command).ravel() for s in segments]).std()
        self.scale = max(float(spread), 1e-9)
        self.full_speed = full_speed
        self.full_voltage = full_voltage
        self.filters: list[np.ndarray] | None = None
        self.shift_prior_s = 0.5 / segments[0].rate_hz
        self.holds = True
        self._last: dict[int, LastSteps] = {id(s): {} for s in segments}

    def path(self, segment: Segment, chain: Chain, values, shift_s: float) -> np.ndarray:
        full, last = (self.full_speed, self.full_voltage), self._last[id(segment)]
        return commanded_path(segment, chain, values, shift_s, *full, self.holds, last)

    def raw(self, chain: Chain, values, shift_s: float) -> list[np.ndarray]:
        """Residual of every segment, (n, rotors), unwhitened."""
        return [s.motion.rotor_speed - self.path(s, chain, values, shift_s) for s in self.segments]

    def whitened(self, chain: Chain, values, shift_s: float) -> list[np.ndarray]:
        """Residual of every segment, (n, rotors), whitened by the noise learnt."""
        out = []
        for part in self.raw(chain, values, shift_s):
            if self.filters is None:
                out.append(part / self.scale)
                continue
            longest = max(len(f) for f in self.filters) - 1
            white = np.stack([causal(f, part[:, j]) for j, f in enumerate(self.filters)], axis=1)
            out.append(white[longest:])
        return out

    def learn_noise(self, chain: Chain, values, shift_s: float) -> None:
        """Take the residual of a rich chain as the noise."""
        parts = self.raw(chain, values, shift_s)
        self.filters = [autoregression([p[:, j] for p in parts]) for j in range(parts[0].shape[1])]

    def fit(self, chain: Chain, start: np.ndarray, shift_s: float = 0.0) -> SpeedFit:
        """Nonlinear least squares of a chain from a start; bounded by the forms' physical bounds."""
        low = np.array([p.low for _, f in chain for p in f.parameters] + [-2 * self.shift_prior_s])
        high = np.array([p.high for _, f in chain for p in f.parameters] + [2 * self.shift_prior_s])
        x0 = np.clip(np.append(start, shift_s), low + 1e-9, high - 1e-9)
        scale = np.where(np.abs(x0) > 1e-3, np.abs(x0), 0.02)
        scale[-1] = self.shift_prior_s

        def function(x):
            rows = np.concatenate([w.ravel() for w in self.whitened(chain, x[:-1], x[-1])])
            return np.append(rows, x[-1] / self.shift_prior_s)

        found = least_squares(
            function, x0, bounds=(low, high), x_scale=scale, diff_step=1e-4, max_nfev=25, ftol=1e-5, xtol=1e-5
        )
        return SpeedFit(chain, found.x[:-1], float(found.x[-1]), 2 * found.cost, holds=self.holds)

    def with_covariance(self, fit: SpeedFit) -> SpeedFit:
        """The fit with a covariance that is robust against what whitening left (blocks of a second)."""
        x = np.append(fit.values, fit.shift_s)
        base = self.whitened(fit.chain, x[:-1], x[-1])
        columns = []
        for j in range(len(x)):
            step = 1e-4 * max(abs(x[j]), 1e-2 if j < len(x) - 1 else self.shift_prior_s)
            up = x.copy()
            up[j] += step
            moved = self.whitened(fit.chain, up[:-1], up[-1])
            columns.append([(b - a) / step for a, b in zip(base, moved, strict=True)])
        gram = np.zeros((len(x), len(x)))
        scores = []
        for k, residual in enumerate(base):
            jacobian = np.stack([c[k] for c in columns], axis=-1)
            for part in self.seconds(len(residual)):
                flat = jacobian[part].reshape(-1, len(x))
                gram += flat.T @ flat
                scores.append(flat.T @ residual[part].ravel())
        gram[-1, -1] += 1.0 / self.shift_prior_s**2
        # A limit that is never reached changes nothing: its variance is large, and finite.
        gram += np.diag(np.where(np.diag(gram) < _LEAST_INFORMATION, _LEAST_INFORMATION, 0.0))
        scale = 1.0 / np.sqrt(np.diag(gram))
        inverse = np.linalg.pinv(gram * np.outer(scale, scale), hermitian=True) * np.outer(scale, scale)
        scores = np.array(scores)
        robust = inverse @ (scores.T @ scores) @ inverse
        covariance = at_least(robust, inverse)
        ratio = np.diag(covariance)[:-1] / np.maximum(np.diag(inverse)[:-1], 1e-300)
        inflation = float(np.median(ratio)) if len(ratio) else 1.0
        return replace(fit, covariance=covariance[:-1, :-1], inflation=max(1.0, inflation))

    def seconds(self, rows: int) -> list[np.ndarray]:
        """Rows of each second of a stretch."""
        return np.array_split(np.arange(rows), max(1, rows // max(2, int(round(self.rate_hz)))))


def candidate_forms(segments: list[Segment], voltage: bool = True) -> list[tuple[str, SpeedForm]]:
    """Every speed form that this set can test; `voltage` says whether a voltage is known in every run."""
    voltage = voltage and all(s.motion.voltage is not None for s in segments)
    return [
        (effect.id, form)
        for effect in catalogue().values()
        for form in effect.speed_forms
        if voltage or "voltage" not in form.requires
    ]


def starts_of(form: SpeedForm) -> list[np.ndarray]:
    """Starting values: the grid of nonlinear parameters (kept equal where there are several), else neutral."""
    grids = [p.starts if p.nonlinear and p.starts else (n,) for p, n in zip(form.parameters, form.neutral, strict=True)]
    if sum(len(g) > 1 for g in grids) > 1:
        return [np.array(v) for v in zip(*grids, strict=True)]
    return [np.array(v) for v in product(*grids)]


class SpeedSearch:
    """Grow the chain one id at a time, replace forms, prune, and look for alternatives."""

    def __init__(self, problem: MeasuredSpeed, forms: list[tuple[str, SpeedForm]]):
        self.problem, self.forms = problem, forms

    def best_fit(self, chain: Chain, base: SpeedFit, added: SpeedForm) -> SpeedFit:
        """The chain of `base` plus one form, from the one of the form's starts that leaves least."""

        def left(start: np.ndarray) -> float:
            parts = self.problem.whitened(chain, np.append(base.values, start), base.shift_s)
            return sum(float((w**2).sum()) for w in parts)

        return self.problem.fit(chain, np.append(base.values, min(self.starts(added), key=left)), base.shift_s)

    def starts(self, form: SpeedForm) -> list[np.ndarray]:
        """Starting values of a form: of a limit shares of the way from the usual command to the outermost (nothing acts
        beyond it, and nothing says there which way to go)."""
        if form.stage != LIMIT:
            return starts_of(form)
        shares = np.concatenate([s.command.ravel() for s in self.problem.segments]) / self.problem.full_speed
        middle = float(np.median(shares))
        outermost = float(self.neutral(form)[0])
        return [np.array([middle + way * (outermost - middle)]) for way in _LIMIT_WAYS]

    @step("how large the noise is")
    def rich_noise(self) -> None:
        """Learn the noise from the richest chain: one form of every id, of commands that hold or of smooth ones.

        The two are compared by sizes alone: whitened by its own residual, the poorer would look as good.
        """
        rich = {}
        for key, form in self.forms:
            if key in before_the_rotors() and form.stage != LIMIT and key not in rich:
                rich[key] = form
        fit = self.problem.fit((), np.zeros(0))
        for key, form in rich.items():
            fit = self.best_fit((*fit.chain, (key, form)), fit, form)
        self.problem.holds = False
        smooth = self.problem.fit(fit.chain, fit.values, fit.shift_s)
        self.problem.holds = bool(smooth.cost > _PLAINLY_LESS * fit.cost)
        fit = fit if self.problem.holds else smooth
        self.problem.learn_noise(fit.chain, fit.values, fit.shift_s)

    def size(self, fit: SpeedFit, key: str) -> float:
        """Change that an id makes in units of the residual's own noise, strongest tenth of the seconds.

        Of a limit, which acts where it is reached alone, the strongest second.
        """
        kept = tuple((k, f) for k, f in fit.chain if k != key)
        where = fit.slice_of(key)
        values = np.delete(fit.values, np.arange(where.start, where.stop))
        with_it = self.problem.raw(fit.chain, fit.values, fit.shift_s)
        without = self.problem.raw(kept, values, fit.shift_s)
        noise = np.sqrt(np.mean([np.mean(w**2, axis=0) for w in with_it], axis=0))
        per = max(2, int(self.problem.rate_hz))
        quantile = 1.0 if fit.of(key)[0].stage == LIMIT else 0.9
        best = 0.0
        for a, b in zip(with_it, without, strict=True):
            count = len(a) // per
            if count:
                local = np.sqrt(((b - a)[: count * per].reshape(count, per, -1) ** 2).mean(axis=1))
                best = max(best, float(np.quantile(local / np.maximum(noise, 1e-12), quantile, axis=0).max()))
        return best

    def judge(self, base: SpeedFit, fit: SpeedFit, key: str) -> tuple[float, float, float]:
        """p-value, score and inflation of an id that `fit` has and `base` has not."""
        own = fit.slice_of(key)
        count = own.stop - own.start
        inflation = fit.inflation
        gain = (base.cost - fit.cost) / inflation
        # What the fit gains and what its parameters are sure of must agree: the shift in time bends the first.
        away = fit.values[own] - self.neutral(fit.of(key)[0])
        sure = gain if fit.covariance is None else quadratic_form(away, fit.covariance[own, own])
        return float(chi2.sf(max(min(gain, sure), 0.0), count)), gain - COST_PER_PARAMETER * count, inflation

    def neutral(self, form: SpeedForm) -> np.ndarray:
        """Parameter values that change nothing; of a limit, the outermost command."""
        if form.stage != LIMIT:
            return np.array(form.neutral)
        shares = [s.command / self.problem.full_speed for s in self.problem.segments]
        return np.clip(form.neutral, min(float(s.min()) for s in shares), max(float(s.max()) for s in shares))

    def run(self) -> SpeedResult:
        """The whole search."""
        self.rich_noise()
        current = self.problem.fit((), np.zeros(0))
        dropped: dict[str, str] = {}
        for _ in range(5):
            taken = {k for k, _ in current.chain} | set(dropped)
            others = {
                (key, form): self.problem.with_covariance(self.best_fit((*current.chain, (key, form)), current, form))
                for key, form in self.forms
                if key not in taken
            }
            options = []
            for (key, _), fit in others.items():
                p, score, _ = self.judge(current, fit, key)
                options.append((score, p, key, fit))
            options.sort(key=lambda o: -o[0])
            grown = False
            for score, p, key, fit in options:
                if score <= 0:
                    break
                if p > ENTER_P or self.negligible(fit, key) or not self.responds(fit):
                    continue
                size = self.size(fit, key)
                if size < SMALLEST_SIZE:
                    dropped[key] = f"its size is {size:.2g} of the noise"
                    continue
                grown = True
                refitted = self._better_forms(fit, key, current, others)
                refitted = refitted if refitted.covariance is not None else self.problem.with_covariance(refitted)
                if self.responds(refitted):
                    current = refitted
                else:
                    dropped[key] = _HARDLY_FOLLOWS
                break
            if not grown:
                break
        current, bases = self._pruned(current, dropped)
        p_values, alternatives, sizes, fewer = {}, {}, {}, {}
        for key, _ in current.chain:
            base = bases[key]
            fewer[key] = self.problem.with_covariance(base) if base.chain else base
            p_values[key] = self.judge(base, current, key)[0]
            sizes[key] = self.size(current, key)
            alternatives[key] = self._alternatives(current, base, key)
        parts = self.problem.raw(current.chain, current.values, current.shift_s)
        noise = float(np.sqrt(np.mean([np.mean(p**2) for p in parts])))
        lag = self._lag_alone(current)
        return SpeedResult(current, p_values, alternatives, sizes, dropped, noise, lag, fewer)

    def _lag_alone(self, fit: SpeedFit) -> SpeedFit | None:
        """A lag of one constant and nothing else: what most publications fit."""
        lag = next((k for k, f in fit.chain if f.stage == LAG), None)
        if lag is None or not any(f.stage in (CURVE, DELAY) for _, f in fit.chain):
            return None
        form = next(f for k, f in self.forms if k == lag)
        start = fit.of(lag)[1].mean()
        return self.problem.with_covariance(self.problem.fit(((lag, form),), np.array([start])))

    def responds(self, fit: SpeedFit) -> bool:
        """Whether rotors still follow their commands: a flat curve would explain any difference between them."""
        if any(at_its_bounds(form, fit.values[fit.slice_of(key)]) for key, form in fit.chain):
            return False
        low = min(float(s.command.min()) for s in self.problem.segments)
        high = max(float(s.command.max()) for s in self.problem.segments)
        grid = np.linspace(low, high, 9)[:, None]
        path = SpeedPath(grid, 0.01 * np.arange(9.0), self.problem.full_speed)
        for key, form in fit.chain:
            if form.stage == LIMIT and self._always_limited(form, fit.values[fit.slice_of(key)]):
                return False
            if form.stage == CURVE:
                speed = form.apply(path, fit.values[fit.slice_of(key)])
                slope = np.diff(speed, axis=0) / np.maximum(np.diff(grid, axis=0), 1e-9)
                if (slope < _LEAST_RESPONSE * (speed / np.maximum(grid, 1e-9))[1:]).any():
                    return False
        return True

    def _always_limited(self, form: SpeedForm, values: np.ndarray) -> bool:
        """Whether a limit holds some rotor most of the time: nobody flies so, but in a hover of hardly any commands it
        makes up for whatever keeps the rotors apart."""
        segments = self.problem.segments
        paths = [SpeedPath(s.command, s.motion.time_s, self.problem.full_speed) for s in segments]
        held = np.concatenate([form.apply(p, values) != p.speed for p in paths])
        return bool(held.mean(axis=0).max() > _MOST_LIMITED)

    def negligible(self, fit: SpeedFit, key: str) -> bool:
        """Whether an id's parameters are all closer to changing nothing than their own limits.

        Of a lag or a delay, than half a sample: from one command to the next nobody recorded what happened. The shift
        is a delay, too: what one takes back of the other is none.
        """
        form, values = fit.of(key)
        delays = form.stage == DELAY
        least = 0.5 / self.problem.segments[0].rate_hz if form.stage >= DELAY else 0.0
        away = values + fit.shift_s if delays else values
        limits = [max(p.negligible, least) for p in form.parameters]
        return all(abs(v - n) < limit for v, n, limit in zip(away, form.neutral, limits, strict=True))

    def _without(self, fit: SpeedFit, key: str) -> SpeedFit:
        where = fit.slice_of(key)
        chain = tuple((k, f) for k, f in fit.chain if k != key)
        values = np.delete(fit.values, np.arange(where.start, where.stop))
        return self.problem.fit(chain, values, fit.shift_s)

    @step("other forms")
    def _better_forms(self, fit: SpeedFit, new: str, current: SpeedFit, others) -> SpeedFit:
        """Try the other forms of each id in the chain; the cheapest for its parameters stays.

        `others` are fits of `current` plus a form, of which that of the id `new` is `fit`.
        """
        for key in [k for k, _ in fit.chain]:
            known = key == new and fit.chain[:-1] == current.chain
            base = current if known else self._without(fit, key)
            best = fit
            for other, form in self.forms:
                if other != key or form is fit.of(key)[0]:
                    continue
                chain = (*base.chain, (key, form))
                tried = others[key, form] if known else self.problem.with_covariance(self.best_fit(chain, base, form))
                # By one inflation for both: its own would charge a form for what it alone explains.
                saved = (best.cost - tried.cost) / max(best.inflation, tried.inflation)
                more = len(tried.values) - len(best.values)
                if saved > COST_PER_PARAMETER * more and self.responds(tried):
                    best = tried
            fit = best
        return fit

    @step("less what does not hold")
    def _pruned(self, fit: SpeedFit, dropped: dict[str, str]) -> tuple[SpeedFit, dict[str, SpeedFit]]:
        """The chain less what does not hold, and to each id that stays the chain fitted without it."""
        while True:
            fit = fit if fit.covariance is not None else self.problem.with_covariance(fit)
            bases = {key: self._without(fit, key) for key, _ in fit.chain}
            failing = {}
            for key, base in bases.items():
                p, score, _ = self.judge(base, fit, key)
                if p > ENTER_P or score <= 0 or self.negligible(fit, key):
                    failing[key] = p
            if not failing:
                return fit, bases
            # What is left must follow its commands: a flat curve would do without any lag.
            worst = max(bases, key=lambda key: (self.responds(bases[key]), failing.get(key, -1.0)))
            if worst not in failing:
                dropped[worst] = _HARDLY_FOLLOWS
            elif self.negligible(fit, worst):
                dropped[worst] = "it is too slight to matter"
            else:
                dropped[worst] = f"p = {failing[worst]:.2g} given the others"
            fit = bases[worst]

    @step("what else would do")
    def _alternatives(self, fit: SpeedFit, base: SpeedFit, key: str) -> tuple[str, ...]:
        """Ids that explain as much in the place of `key`: not worse by more than a coin's doubt."""
        own = base.cost - fit.cost
        taken = {k for k, _ in fit.chain}
        found = []
        for other, form in self.forms:
            if other in taken or other in found:
                continue
            tried = self.best_fit((*base.chain, (other, form)), base, form)
            if not self.responds(tried):
                continue
            lost = (own - (base.cost - tried.cost)) / fit.inflation
            if lost < 9.0 and base.cost - tried.cost > 0.5 * own:
                found.append(other)
        return tuple(found)


def at_its_bounds(form: SpeedForm, values: np.ndarray) -> bool:
    """Whether a parameter is at the edge of what is physical: that is no estimate, it would go on.

    An edge at which a parameter does nothing (a lag of no time) is none.
    """
    for value, own, neutral in zip(values, form.parameters, form.neutral, strict=True):
        reach = _AT_BOUND * (own.high - own.low)
        if any(abs(value - edge) < reach < abs(neutral - edge) for edge in (own.low, own.high)):
            return True
    return False


def smoothed_acceleration(speed: np.ndarray, rate_hz: float, cutoff_hz: float) -> np.ndarray:
    """Derivative of rotor speeds (n, k) at full length, rad/s2; the ends repeat the nearest full value."""
    kernel = kernels.derivative(rate_hz, min(0.45 * rate_hz, 1.6 * cutoff_hz))
    half = (len(kernel) - 1) // 2
    inner = kernels.apply(kernel, speed)
    return np.concatenate([np.repeat(inner[:1], half, axis=0), inner, np.repeat(inner[-1:], half, axis=0)])
