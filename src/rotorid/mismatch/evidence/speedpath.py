"""What lies between command and rotor speed: lag, delay, throttle curve, sag, saturation.

A chain of speed forms is fitted by nonlinear least squares on whitened residuals, grown one id at a time: the same
search for the measured speeds of flights, and for stands (`rotorid.mismatch.instrument.chain`), whose response may be
the wrench. Of flights with commands (or throttle) alone `evidence.lift` reads the path.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from rotorid.effects.catalogue import before_the_rotors, catalogue
from rotorid.effects.contract import CURVE, DELAY, LAG, LIMIT, SpeedForm, SpeedPath
from rotorid.effects.delay import shifted
from rotorid.effects.loading import weights_of_four
from rotorid.mismatch.evidence.motion import Segment
from rotorid.mismatch.evidence.regression import at_least, autoregression, hotelling, quadratic_form
from rotorid.recordings.signal import kernels
from rotorid.recordings.signal.kernels import causal
from rotorid.steps import step

ENTER_P = 1e-5
"""A form between command and speed enters below this."""
COST_PER_PARAMETER = 10.0
SMALLEST_SIZE = 0.15
_HARDLY_FOLLOWS = "rotors would hardly follow their commands with it"


Chain = tuple[tuple[str, SpeedForm], ...]
LastSteps = dict[int, list[tuple[np.ndarray, tuple, np.ndarray]]]
"""By place in a chain: speeds that a step was given, the step with its values, and what it made."""


def steps_of(chain: Chain, values: Sequence) -> list[tuple[str, SpeedForm, Any]]:
    """Ids of a chain with their forms and their own of its values."""
    out, at = [], 0
    for key, form in chain:
        out.append((key, form, values[at : at + len(form.parameters)]))
        at += len(form.parameters)
    return out


@dataclass(frozen=True)
class SpeedFit:
    """A fitted chain."""

    chain: Chain
    values: np.ndarray
    """Parameters of every form, in order."""
    nuisances: Mapping[str, float]
    """What the recording leaves unknown of the path itself (`PathProblem.unknown`); of flights a shift in time, s."""
    cost: float
    covariance: np.ndarray | None = None
    inflation: float = 1.0
    holds: bool = True
    """Whether commands hold from sample to sample; else they are smooth, and recorded now and then."""
    nuisance_sd: Mapping[str, float] = field(default_factory=dict)
    blocks: int = 2
    """Blocks that the covariance is made of."""

    def slice_of(self, effect_id: str) -> slice:
        """Where the id's parameters stand in `values`."""
        own = {key: places for key, _, places in steps_of(self.chain, range(len(self.values)))}[effect_id]
        return slice(own.start, own.stop)

    def of(self, effect_id: str) -> tuple[SpeedForm, np.ndarray]:
        """Form and values of one id."""
        return dict(self.chain)[effect_id], self.values[self.slice_of(effect_id)]

    def without(self, effect_id: str) -> SpeedFit:
        """The same chain with one id less, the numbers of the others as they are."""
        where = self.slice_of(effect_id)
        chain = tuple((k, f) for k, f in self.chain if k != effect_id)
        values = np.delete(self.values, np.arange(where.start, where.stop))
        return replace(self, chain=chain, values=values, covariance=None)


@dataclass(frozen=True)
class SpeedResult:
    """What the search found."""

    fit: SpeedFit
    p_values: dict[str, float]
    alternatives: dict[str, tuple[str, ...]]
    dropped: dict[str, str] = field(default_factory=dict)
    noise: np.ndarray | None = None
    """One-sigma of the residual of each rotor's speed, rad/s, or of each channel of the wrench, N or N m."""
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

    def less(self, ids: Sequence[str]) -> SpeedResult:
        """The result with fewer ids at work: fitted anew where one goes, of more the others' numbers stay."""
        fit = self.without[ids[0]] if len(ids) == 1 and ids[0] in self.without else self.fit
        for key in ids:
            fit = fit.without(key) if key in dict(fit.chain) else fit
        return replace(self, fit=fit)


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
        return self.scale * commanded_path(segment, chain, values, fit.nuisances["late"], *full, fit.holds)


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
    steps = [(form.stage, form.apply, own) for _, form, own in steps_of(chain, values)]
    steps.append((DELAY, shifted if holds else moved, np.array([shift_s])))
    # What a step of a chain made last that is kept: slopes move one parameter at a time, and a step has up to two.
    steps_kept = 3
    for place, (_, apply, own) in enumerate(sorted(steps, key=lambda s: s[0])):
        known = [] if last is None else last.setdefault(place, [])
        asked = apply, tuple(own)
        speed = next((made for of, how, made in known if of is path.speed and how == asked), None)
        if speed is None:
            speed = apply(path, own)
            known[:] = [(path.speed, asked, speed), *known[: steps_kept - 1]]
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


class PathProblem(ABC):
    """Residuals of a chain on what is fitted, whitened. A kind of recording says what the response is.

    Next to the forms' parameters stands what nobody recorded of the path itself.
    """

    coloured = True
    """Whether residuals are whitened by their colour; else by their size alone: what they have in common is what the
    chain lacks, no noise, and it takes nothing off what a form gains."""

    rich = True
    """Whether noise is learnt at once from a rich chain, one form of every id, and with it whether commands hold. Else
    it is learnt from the best chain so far, as smooth commands make it: those that hold make no lateness finer than
    their samples, in which a fit finds no slope."""

    def __init__(
        self, commands: list[tuple[np.ndarray, np.ndarray]], rate_hz: float, full_speed: float, scale: np.ndarray
    ) -> None:
        """`commands` of every stretch, (n, rotors), rad/s, with their instants (n,), s; `scale` of the channels of the
        response until their noise is known."""
        self.commands, self.rate_hz, self.full_speed = commands, rate_hz, full_speed
        self.filters = [np.array([1.0 / s]) for s in scale]
        self.holds = True

    @abstractmethod
    def unknown(self, chain: Chain) -> Mapping[str, tuple[float, float, float]]:
        """To each such number its one-sigma, lower and upper bound; at nothing the path is as it was recorded."""

    @abstractmethod
    def raw(self, chain: Chain, values, nuisances) -> list[np.ndarray]:
        """Residual of every stretch, (n, channels), unwhitened; `nuisances` are the numbers of `unknown`."""

    @abstractmethod
    def blocks(self, sizes: Sequence[int]) -> list[list[np.ndarray]]:
        """Rows of each block of residuals that stand one after the other, by what is compared as one.

        `sizes` are the rows of every stretch.
        """

    def nuisances(self, chain: Chain, like: SpeedFit | None = None) -> np.ndarray:
        """What is unknown of a chain's path as a fit has it, nothing where that does not say."""
        known = {} if like is None else like.nuisances
        return np.array([known.get(name, 0.0) for name in self.unknown(chain)])

    def doubts(self, chain: Chain) -> np.ndarray:
        """One-sigma of each nuisance, (k,)."""
        return np.array([sd for sd, *_ in self.unknown(chain).values()])

    def noticed_s(self, form: SpeedForm) -> float:
        """Time by which rotors must be late by a form to be called so: between two samples nobody recorded anything."""
        return 0.5 / self.rate_hz if form.stage >= DELAY else 0.0

    def low_of(self, form: SpeedForm) -> list[float]:
        """Lower bounds of a form's parameters."""
        return [p.low for p in form.parameters]

    def bounds(self, chain: Chain) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bounds of a chain's values and nuisances, (k,) each."""
        ends = self.unknown(chain).values()
        low = [*(x for _, f in chain for x in self.low_of(f)), *(low for _, low, _ in ends)]
        high = [*(p.high for _, f in chain for p in f.parameters), *(high for *_, high in ends)]
        return np.array(low), np.array(high)

    def whitened(self, chain: Chain, values, nuisances) -> list[np.ndarray]:
        """Residual of every stretch, (n, channels), whitened by the noise learnt."""
        longest = max(len(f) for f in self.filters) - 1
        parts = self.raw(chain, values, nuisances)
        return [np.stack([causal(f, p[:, j]) for j, f in enumerate(self.filters)], axis=1)[longest:] for p in parts]

    def left_by(self, fit: SpeedFit) -> list[np.ndarray]:
        """Residual of every stretch that a fit leaves, (n, channels), unwhitened."""
        return self.raw(fit.chain, fit.values, self.nuisances(fit.chain, fit))

    def left(self, chain: Chain, values, nuisances) -> float:
        """Whitened squares that a chain leaves."""
        return sum(float((w**2).sum()) for w in self.whitened(chain, values, nuisances))

    def learn_noise(self, fit: SpeedFit) -> None:
        """Take the residual of a rich chain as the noise."""
        parts = self.left_by(fit)
        if self.coloured and (self.rich or fit.chain):  # what no form explains yet is no noise
            self.filters = [autoregression([p[:, j] for p in parts]) for j in range(parts[0].shape[1])]
        else:
            self.filters = [np.array([1.0 / s]) for s in self.noise_of(parts)]

    @staticmethod
    def noise_of(parts: Sequence[np.ndarray]) -> np.ndarray:
        """Root mean square of residuals by channel, (channels,)."""
        return np.maximum(np.sqrt(np.mean(np.concatenate(parts) ** 2, axis=0)), 1e-12)

    def nothing(self) -> SpeedFit:
        """The fit of rotors that follow at once."""
        return self.fit((), np.zeros(0))

    def fit(self, chain: Chain, start: np.ndarray, like: SpeedFit | None = None) -> SpeedFit:
        """Nonlinear least squares of a chain from a start; bounded by the forms' physical bounds.

        What is unknown of the path starts as another fit has it.
        """
        own, (low, high) = len(start), self.bounds(chain)
        sd = self.doubts(chain)
        x0 = np.append(start, self.nuisances(chain, like))
        if not len(x0):
            return SpeedFit(chain, x0, {}, self.left(chain, x0, x0), holds=self.holds)
        x0 = np.clip(x0, low + 1e-9, high - 1e-9)
        scale = np.where(np.abs(x0) > 1e-3, np.abs(x0), 0.02)
        scale[own:] = np.where(np.isfinite(sd), sd, 0.1)

        def function(x):
            rows = [w.ravel() for w in self.whitened(chain, x[:own], x[own:])]
            return np.concatenate([*rows, x[own:] / sd])

        found = least_squares(
            function, x0, bounds=(low, high), x_scale=scale, diff_step=1e-4, max_nfev=25, ftol=1e-5, xtol=1e-5
        )
        nuisances = dict(zip(self.unknown(chain), map(float, found.x[own:]), strict=True))
        return SpeedFit(chain, found.x[:own], nuisances, 2 * found.cost, holds=self.holds)

    def with_covariance(self, fit: SpeedFit) -> SpeedFit:
        """The fit with a covariance that is robust against what whitening left, and allows for few blocks."""
        x, own = np.append(fit.values, self.nuisances(fit.chain, fit)), len(fit.values)
        sd = self.doubts(fit.chain)
        base = self.whitened(fit.chain, x[:own], x[own:])
        least = np.append(np.full(own, 1e-2), np.where(np.isfinite(sd), sd, 1e-2))
        columns = []
        for j in range(len(x)):
            step = 1e-4 * max(abs(x[j]), least[j])
            up = x.copy()
            up[j] += step
            moved = self.whitened(fit.chain, up[:own], up[own:])
            columns.append(np.concatenate([(b - a) / step for a, b in zip(base, moved, strict=True)]))
        if not columns:
            return replace(fit, covariance=np.zeros((0, 0)))
        jacobian, left = np.stack(columns, axis=-1), np.concatenate(base)
        gram, scores = np.zeros((len(x), len(x))), []
        for block in (b for group in self.blocks([len(w) for w in base]) for b in group):
            flat = jacobian[block].reshape(-1, len(x))
            gram += flat.T @ flat
            scores.append(flat.T @ left[block].ravel())
        gram += np.diag(np.append(np.zeros(own), sd**-2.0))
        least_information = 1e-30  # Inverse variance of a parameter that changes nothing.
        # A limit that is never reached changes nothing: its variance is large, and finite.
        gram += np.diag(np.where(np.diag(gram) < least_information, least_information, 0.0))
        unit = 1.0 / np.sqrt(np.diag(gram))
        inverse = np.linalg.pinv(gram * np.outer(unit, unit), hermitian=True) * np.outer(unit, unit)
        count, scores = len(scores), np.array(scores)
        robust = inverse @ (scores.T @ scores) @ inverse * count / max(count - len(x), 1)
        covariance = at_least(robust, inverse)
        ratio = np.diag(covariance)[:own] / np.maximum(np.diag(inverse)[:own], 1e-300)
        return replace(
            fit,
            covariance=covariance[:own, :own],
            inflation=max(1.0, float(np.median(ratio))) if own and self.coloured else 1.0,
            nuisance_sd=dict(zip(fit.nuisances, map(float, np.sqrt(np.diag(covariance)[own:])), strict=True)),
            blocks=count,
        )


class MeasuredSpeed(PathProblem):
    """The measured rotor speeds of a flight are the response; unknown is a shift in time within a sample."""

    def __init__(self, segments: list[Segment], full_speed: float, full_voltage: float | None):
        spread = np.concatenate([(s.motion.rotor_speed - s.command).ravel() for s in segments]).std()
        rotors = segments[0].command.shape[1]
        super().__init__(
            [(s.command, s.motion.time_s) for s in segments],
            segments[0].rate_hz,
            full_speed,
            np.full(rotors, max(float(spread), 1e-9)),
        )
        self.segments, self.full_voltage = segments, full_voltage
        self._last: dict[int, LastSteps] = {id(s): {} for s in segments}

    def raw(self, chain: Chain, values, nuisances) -> list[np.ndarray]:
        """Measured less modelled speeds of every segment, (n, rotors), rad/s."""
        full = self.full_speed, self.full_voltage, self.holds
        return [
            s.motion.rotor_speed - commanded_path(s, chain, values, float(nuisances[0]), *full, self._last[id(s)])
            for s in self.segments
        ]

    def unknown(self, chain: Chain) -> Mapping[str, tuple[float, float, float]]:
        """A shift in time, s."""
        half = 0.5 / self.rate_hz
        return {"late": (half, -2.0 * half, 2.0 * half)}

    def blocks(self, sizes: Sequence[int]) -> list[list[np.ndarray]]:
        """Seconds of each stretch."""
        starts = np.cumsum([0, *sizes])
        per = max(2, int(round(self.rate_hz)))
        return [
            np.array_split(np.arange(start, start + size), max(1, size // per))
            for start, size in zip(starts, sizes, strict=False)
        ]


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

    def __init__(self, problem: PathProblem, forms: list[tuple[str, SpeedForm]]):
        self.problem, self.forms = problem, forms

    def best_fit(self, chain: Chain, base: SpeedFit, added: SpeedForm) -> SpeedFit:
        """The chain of `base` plus one form, from the one of the form's starts that leaves least."""
        nuisances, starts = self.problem.nuisances(chain, base), [np.append(base.values, s) for s in self.starts(added)]
        return self.problem.fit(chain, min(starts, key=lambda start: self.problem.left(chain, start, nuisances)), base)

    def starts(self, form: SpeedForm) -> list[np.ndarray]:
        """Starting values of a form: of a limit on the way from the usual command to the outermost (nothing acts beyond
        it, and nothing says there which way to go), and such as hold a share of the commands."""
        if form.stage != LIMIT:
            return starts_of(form)
        shares = np.concatenate([c.ravel() for c, _ in self.problem.commands]) / self.problem.full_speed
        middle = float(np.median(shares))
        outermost = float(self.neutral(form)[0])
        # Starts of a limit: of the way from the usual command to the outermost, which may be that of a single jerk, and
        # of the commands that it holds.
        limit_ways, limit_shares = (0.97, 0.9, 0.8, 0.65, 0.5), (0.02, 0.05, 0.1, 0.2, 0.3, 0.4)
        held = np.array(limit_shares) if outermost < middle else 1.0 - np.array(limit_shares)
        on_the_way = middle + np.array(limit_ways) * (outermost - middle)
        return list(np.concatenate([on_the_way, np.quantile(shares, held)])[:, None])

    @step("how large the noise is")
    def rich_noise(self) -> None:
        """Learn the noise from the richest chain: one form of every id, of commands that hold or of smooth ones.

        The two are compared by sizes alone: whitened by its own residual, the poorer would look as good.
        """
        rich = {}
        for key, form in self.forms:
            if key in before_the_rotors() and form.stage != LIMIT and key not in rich:
                rich[key] = form
        fit = self.problem.nothing()
        for key, form in rich.items():
            richer = self.best_fit((*fit.chain, (key, form)), fit, form)
            fit = richer if richer.cost < fit.cost else fit  # a start may be far from all that is there
        better = self.held_or_smooth(fit)
        self.problem.holds = better.holds
        self.problem.learn_noise(better)

    def relearnt(self, fit: SpeedFit) -> SpeedFit:
        """The fit once more, whitened by its own residual, where no rich chain says what noise is."""
        if self.problem.rich:
            return fit
        self.problem.learn_noise(fit)
        return self.problem.fit(fit.chain, fit.values, fit)

    def p_of(self, fit: SpeedFit, key: str, p: float) -> float:
        """p-value `p` of an id in a fit; where no rich chain says what noise is, by the fit's own residual."""
        if self.problem.rich:
            return p
        before = self.problem.filters
        own = self.problem.with_covariance(self.relearnt(fit))
        self.problem.filters = before
        where = own.slice_of(key)
        away = own.values[where] - self.neutral(own.of(key)[0])
        return hotelling(quadratic_form(away, own.covariance[where, where]), len(away), own.blocks)

    def held_or_smooth(self, fit: SpeedFit) -> SpeedFit:
        """The fit with commands as they are taken, or as the other kind where that leaves plainly less."""
        self.problem.holds = not fit.holds
        other = self.problem.fit(fit.chain, fit.values, fit)
        self.problem.holds = fit.holds
        # Share of the squares that commands leave as they are first taken, which hold or are smooth, below which they
        # are the other: a lag imitates either.
        plainly_less = 0.98
        return other if other.cost <= plainly_less * fit.cost else fit

    def size(self, fit: SpeedFit, key: str) -> float:
        """Change that an id makes in units of the residual's own noise, strongest tenth of the seconds.

        Of a limit, which acts where it is reached alone, the strongest second.
        """
        less = fit.without(key)
        with_it, without = self.problem.left_by(fit), self.problem.left_by(less)
        change = np.concatenate(without) - np.concatenate(with_it)
        noise = np.maximum(self.problem.noise_of(with_it), 1e-12)
        quantile = 1.0 if fit.of(key)[0].stage == LIMIT else 0.9
        groups = self.problem.blocks([len(p) for p in with_it])
        local = ([np.sqrt((change[b] ** 2).mean(axis=0)) for b in group] for group in groups)
        return max(float(np.quantile(np.array(own) / noise, quantile, axis=0).max()) for own in local)

    def judge(self, base: SpeedFit, fit: SpeedFit, key: str) -> tuple[float, float, float]:
        """p-value, score and inflation of an id that `fit` has and `base` has not."""
        own = fit.slice_of(key)
        count = own.stop - own.start
        inflation = fit.inflation
        gain = (base.cost - fit.cost) / inflation
        # What the fit gains and what its parameters are sure of must agree: the shift in time bends the first.
        away = fit.values[own] - self.neutral(fit.of(key)[0])
        sure = gain if fit.covariance is None else quadratic_form(away, fit.covariance[own, own])
        return hotelling(min(gain, sure), count, fit.blocks), gain - COST_PER_PARAMETER * count, inflation

    def neutral(self, form: SpeedForm) -> np.ndarray:
        """Parameter values that change nothing; of a limit, the outermost command."""
        if form.stage != LIMIT:
            return np.array(form.neutral)
        shares = [c / self.problem.full_speed for c, _ in self.problem.commands]
        return np.clip(form.neutral, min(float(s.min()) for s in shares), max(float(s.max()) for s in shares))

    def run(self) -> SpeedResult:
        """The whole search."""
        if self.problem.rich:
            self.rich_noise()
        current = self.problem.nothing()
        dropped: dict[str, str] = {}
        for _ in range(5):
            current = self.relearnt(current)
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
            # What makes rotors hardly follow may do with other forms of what is there, but only after all else.
            options.sort(key=lambda o: (self.responds(o[3]), o[0]), reverse=True)
            grown = False
            for score, p, key, fit in options:
                if score <= 0:
                    continue
                if self.p_of(fit, key, p) > ENTER_P or self.negligible(fit, key):
                    continue
                size = self.size(fit, key)
                if size < SMALLEST_SIZE:
                    dropped[key] = f"its size is {size:.2g} of the noise"
                    continue
                refitted = self._better_forms(fit, key, current, others)
                if self.responds(refitted):
                    grown = True
                    current = refitted if refitted.covariance is not None else self.problem.with_covariance(refitted)
                    break
            if not grown:
                break
        current, bases = self._pruned(current, dropped)
        if not self.problem.rich and (other := self.held_or_smooth(current)) is not current:
            self.problem.holds = other.holds
            current, bases = self._pruned(other, dropped)
        p_values, alternatives, fewer = {}, {}, {}
        for key, _ in current.chain:
            base = bases[key]
            fewer[key] = self.problem.with_covariance(base) if base.chain else base
            p_values[key] = self.judge(base, current, key)[0]
            alternatives[key] = self._alternatives(current, base, key)
        noise = self.problem.noise_of(self.problem.left_by(current))
        return SpeedResult(current, p_values, alternatives, dropped, noise, self._lag_alone(current), fewer)

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
        low = min(float(c.min()) for c, _ in self.problem.commands)
        high = max(float(c.max()) for c, _ in self.problem.commands)
        grid = np.linspace(low, high, 9)[:, None]
        path = SpeedPath(grid, 0.01 * np.arange(9.0), self.problem.full_speed)
        # Least slope of a throttle curve in units of its mean: thrust proportional to throttle has a half.
        least_response = 0.25
        for key, form in fit.chain:
            if form.stage == LIMIT and self._always_limited(form, fit.values[fit.slice_of(key)]):
                return False
            if form.stage == CURVE:
                speed = form.apply(path, fit.values[fit.slice_of(key)])
                slope = np.diff(speed, axis=0) / np.maximum(np.diff(grid, axis=0), 1e-9)
                if (slope < least_response * (speed / np.maximum(grid, 1e-9))[1:]).any():
                    return False
        return True

    def _always_limited(self, form: SpeedForm, values: np.ndarray) -> bool:
        """Whether a limit holds some rotor most of the time: nobody flies so, but in a hover of hardly any commands it
        makes up for whatever keeps the rotors apart."""
        paths = [SpeedPath(*own, self.problem.full_speed) for own in self.problem.commands]
        held = np.concatenate([form.apply(p, values) != p.speed for p in paths])
        most_limited = 0.5  # Share of the time that a limit may hold a rotor.
        return bool(held.mean(axis=0).max() > most_limited)

    def negligible(self, fit: SpeedFit, key: str) -> bool:
        """Whether an id's parameters are all closer to changing nothing than their own limits.

        Of a lag or a delay, than half a sample: from one command to the next nobody recorded what happened. What is
        unknown of when a command arrives is a delay, too: what one takes back of the other is none.
        """
        form, values = fit.of(key)
        delays = form.stage == DELAY
        least = self.problem.noticed_s(form)
        away = values + fit.nuisances.get("late", 0.0) if delays else values
        limits = [max(p.negligible, least) for p in form.parameters]
        return all(abs(v - n) < limit for v, n, limit in zip(away, form.neutral, limits, strict=True))

    def _without(self, fit: SpeedFit, key: str) -> SpeedFit:
        less = fit.without(key)
        return self.problem.fit(less.chain, less.values, fit)

    @step("other forms")
    def _better_forms(self, fit: SpeedFit, new: str = "", current: SpeedFit | None = None, others=None) -> SpeedFit:
        """Try the other forms of each id in the chain; of those with which rotors follow commands the cheapest for
        its parameters stays.

        `others` are fits of `current` plus a form, of which that of the id `new`, if any, is `fit`.
        """
        for key in [k for k, _ in fit.chain]:
            known = key == new and fit.chain[:-1] == current.chain
            base = current if known else self._without(fit, key)
            best = fit if fit.covariance is not None else self.problem.with_covariance(fit)
            for other, form in self.forms:
                if other != key or form is fit.of(key)[0]:
                    continue
                chain = (*base.chain, (key, form))
                tried = others[key, form] if known else self.problem.with_covariance(self.best_fit(chain, base, form))
                # By one inflation for both: its own would charge a form for what it alone explains.
                saved = (best.cost - tried.cost) / max(best.inflation, tried.inflation)
                more = len(tried.values) - len(best.values)
                if self.responds(tried) and (saved > COST_PER_PARAMETER * more or not self.responds(best)):
                    best = tried
            fit = best
        return fit

    @step("less what does not hold")
    def _pruned(self, fit: SpeedFit, dropped: dict[str, str]) -> tuple[SpeedFit, dict[str, SpeedFit]]:
        """The chain less what does not hold, and to each id that stays the chain fitted without it."""
        while True:
            fit = self.relearnt(fit)
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
            fit = self._better_forms(bases[worst])

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
    at_bound = 1e-3  # Share of a parameter's range from its bound within which the bound holds it.
    for value, own, neutral in zip(values, form.parameters, form.neutral, strict=True):
        reach = at_bound * (own.high - own.low)
        if any(abs(value - edge) < reach < abs(neutral - edge) for edge in (own.low, own.high)):
            return True
    return False


def smoothed_acceleration(speed: np.ndarray, rate_hz: float, cutoff_hz: float) -> np.ndarray:
    """Derivative of rotor speeds (n, k) at full length, rad/s2; the ends repeat the nearest full value."""
    kernel = kernels.derivative(rate_hz, min(0.45 * rate_hz, 1.6 * cutoff_hz))
    half = (len(kernel) - 1) // 2
    inner = kernels.apply(kernel, speed)
    return np.concatenate([np.repeat(inner[:1], half, axis=0), inner, np.repeat(inner[-1:], half, axis=0)])
