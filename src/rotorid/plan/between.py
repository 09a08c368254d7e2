"""Open questions between command and rotor speed: how far apart two chains are on a flight not made yet.

A chain (lag, delay, throttle curve, sag, limit) is no linear term, so its rival is fitted: to what the set's columns
would hold if the other were true, by least squares over the rival's parameters with the shared linear terms free, in
whitened squares as the engine has them. What the best rival leaves more than the true chain is λ of
`rotorid.plan.separation`. Fitted to each manoeuvre apart the rival is freer than over all of them: the sum is a
lower bound.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import SpeedForm
from rotorid.mismatch.decision.findings import Finding
from rotorid.mismatch.model.fitted import Fitted
from rotorid.mismatch.model.prepare import assemble_rows
from rotorid.mismatch.model.wrench import chosen, path_segments
from rotorid.mismatch.plant.motion import Segment
from rotorid.mismatch.plant.regression import autoregression
from rotorid.mismatch.plant.rows import residual
from rotorid.mismatch.plant.speedpath import commanded_path, starts_of
from rotorid.recordings.signal.kernels import causal

_MOST_EVALUATIONS = 40
_EDGE_S = 0.5
"""Left out at both ends of a flight: a command that leads has nothing to lead from there."""


@dataclass(frozen=True)
class _ChainModel:
    """A chain that may be the true one, with its parameters on the set at hand."""

    id: str
    chain: tuple[tuple[str, SpeedForm], ...]
    values: np.ndarray
    doubt: float
    """Relative one-sigma of the id's own parameters."""


@dataclass(frozen=True)
class ChainQuestion:
    """Ids of which one lies between command and rotor speed."""

    ids: tuple[str, ...]
    models: tuple[_ChainModel, ...]

    @property
    def pairs(self) -> tuple[tuple[_ChainModel, _ChainModel], ...]:
        """Every model with every rival."""
        return tuple((a, b) for a in self.models for b in self.models if a.id != b.id)


class _ChainLeftover:
    """What a chain leaves of a set's recordings in whitened squares, the shared linear terms free."""

    def __init__(self, found: Fitted):
        self.found, self.prepared = found, found.prepared
        self.result, self.full, self.volt = found.chain
        self.keys = [*found.model.search.always, *found.model.selection.active]
        self.filters = found.model.search.regression.filters
        if found.measured:
            raws = [self._speeds(s, self.result.fit.chain, self.result.fit.values) for s in self.prepared.segments]
            self.speed_filters = [autoregression([r[:, j] for r in raws]) for j in range(raws[0].shape[1])]

    def path(self, segment: Segment, chain, values) -> np.ndarray:
        """Rotor speeds (n, k), rad/s, that a chain makes of the segment's commands."""
        return commanded_path(
            segment, chain, values, self.result.fit.shift_s, self.full, self.volt, self.result.fit.holds
        )

    def _speeds(self, segment, chain, values) -> np.ndarray:
        return segment.motion.rotor_speed - self.path(segment, chain, values)

    def of(self, segments: Sequence[Segment]):
        """A function of chain and values that gives the whitened residual (m,) of segments."""
        if self.found.measured:
            return lambda chain, values: np.concatenate([self._white_speeds(s, chain, values) for s in segments])
        turned = path_segments(list(segments), self.result, self.full, self.volt, self.prepared.thinner.cutoff_hz)
        terms = [self.found.model.search.terms[k] for k in self.keys]
        rows = assemble_rows(self.prepared, terms, turned, chosen(self.found.model))
        channels = [c for c in self.filters if c < 6 and np.isfinite(rows[0].y[:, c]).all()]
        columns = np.concatenate([self._white(r.x, channels) for r in rows])
        precision = self.found.model.search.regression.precision[self.found.model.search.regression.columns(self.keys)]
        stacked = np.concatenate([columns, np.diag(np.sqrt(precision))])
        unit = np.sqrt((stacked**2).sum(axis=0)) + 1e-30
        basis = np.linalg.qr(stacked / unit)[0]
        effects = chosen(self.found.model)

        def left(chain, values):
            parts = []
            for segment in segments:
                moved = replace(segment, motion=replace(segment.motion, rotor_speed=self.path(segment, chain, values)))
                own = residual(moved, self.prepared.vehicle)
                for form, at in effects:
                    extra = form.contribution(moved.motion, self.prepared.vehicle, at)
                    for name in ("force", "moment"):
                        if name in own and getattr(extra, name) is not None:
                            own[name] = own[name] - getattr(extra, name)
                groups = [self.prepared.thinner(own[g]) if g in own else None for g in ("force", "moment")]
                size = next(len(g) for g in groups if g is not None)
                y = np.concatenate([np.zeros((size, 3)) if g is None else g for g in groups], axis=1)
                parts.append(self._white(y[:, :, None], channels)[:, 0])
            y = np.concatenate([*parts, np.zeros(len(unit))])
            return y - basis @ (basis.T @ y)

        return left

    def _white(self, values: np.ndarray, channels: Sequence[int]) -> np.ndarray:
        """Channels (n, c, k) whitened and stacked, (m, k)."""
        longest = max(len(self.filters[c]) for c in channels)
        edge = max(longest, int(_EDGE_S * self.prepared.thinner.rate_hz))
        return np.concatenate([causal(self.filters[c], values[:, c])[edge : len(values) - edge] for c in channels])

    def _white_speeds(self, segment, chain, values) -> np.ndarray:
        raw = self._speeds(segment, chain, values)
        edge = max(max(len(f) for f in self.speed_filters), int(_EDGE_S * segment.rate_hz))
        parts = [causal(f, raw[:, j])[edge : len(raw) - edge] for j, f in enumerate(self.speed_filters)]
        return np.concatenate(parts)


def _fitted_values(left, chain, starts: Sequence[np.ndarray]) -> tuple[np.ndarray, float]:
    """Parameters of a chain that leave least, from the best of several starts, and the whitened squares left."""
    low = np.concatenate([[p.low for p in form.parameters] for _, form in chain])
    high = np.concatenate([[p.high for p in form.parameters] for _, form in chain])
    best = min(starts, key=lambda s: float((left(chain, s) ** 2).sum()))
    inside = np.clip(best, low + 1e-9, high - 1e-9)
    scale = np.maximum(np.abs(inside), 1e-3)
    done = least_squares(
        lambda v: left(chain, v), inside, bounds=(low, high), x_scale=scale, max_nfev=_MOST_EVALUATIONS
    )
    return done.x, float(2 * done.cost)


def chain_question(found: Fitted, finding: Finding, ids: Sequence[str]) -> ChainQuestion | None:
    """The competing chains of a class; None where fewer than two can be fitted to the set."""
    result = found.chain[0]
    own, rest = finding.id, [(k, f) for k, f in result.fit.chain if k != finding.id]
    where = result.fit.slice_of(own)
    kept = np.delete(result.fit.values, np.arange(where.start, where.stop))
    spread = np.sqrt(np.diag(result.fit.covariance)[where]) / np.maximum(np.abs(result.fit.values[where]), 1e-12)
    models = [_ChainModel(own, result.fit.chain, result.fit.values, float(spread.min()))]
    left = _ChainLeftover(found).of([s for s in found.prepared.segments if s.run in found.prepared.split.training])
    for other in ids:
        forms = catalogue()[other].speed_forms if other in catalogue() else ()
        volts = all(s.motion.voltage is not None for s in found.prepared.segments)
        tries = []
        for form in forms:
            if other == own or ("voltage" in form.requires and not volts):
                continue
            chain = (*rest, (other, form))
            values, square = _fitted_values(left, chain, [np.append(kept, s) for s in starts_of(form)])
            tries.append((square, _ChainModel(other, chain, values, models[0].doubt)))
        if tries:
            models.append(min(tries, key=lambda t: t[0])[1])
    return ChainQuestion(tuple(m.id for m in models), tuple(models)) if len(models) > 1 else None


def squares(found: Fitted, segments: Sequence[Segment], true: _ChainModel, rival: _ChainModel) -> float:
    """λ of a true chain against its rival on segments that the true one made."""
    left = _ChainLeftover(found).of(segments)
    own = float((left(true.chain, true.values) ** 2).sum())
    _, other = _fitted_values(left, rival.chain, [rival.values])
    return max(other - own, 0.0)


def interval(sigma: float, doubt: float) -> tuple[float, float]:
    """95 % interval of a separation: the noise of the flight, and the doubt about the size of what is true."""
    reach = 1.96 * float(np.hypot(1.0, sigma * doubt))
    return max(sigma - reach, 0.0), sigma + reach
