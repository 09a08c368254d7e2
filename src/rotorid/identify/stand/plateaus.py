"""Plateaus and ramps of a programme, from the throttles alone: rest, ramp, plateau, rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rotorid.errors import InputError

_REST, _RAMP, PLATEAU = "rest", "ramp", "plateau"
_SLOPE_1_S = 0.004
"""A throttle that changes by less than this per second is constant (the slowest ramp of table A.1: 0.0167)."""
WINDOW_S = 0.1
_SHORTEST_S = 0.5
"""A plateau is at least that long; a sine's turning points are not."""


@dataclass(frozen=True)
class StandStretch:
    """A stretch of one kind, from `start_s` to `stop_s`."""

    kind: str
    start_s: float
    stop_s: float

    @property
    def length_s(self) -> float:
        return self.stop_s - self.start_s


def segments(time_s: np.ndarray, throttle: np.ndarray) -> list[StandStretch]:
    """Stretches of a programme in the order of time.

    Parameters
    ----------
    time_s
        Shape (n,), increasing.
    throttle
        Fractions 0 to 1, shape (n, motors).

    Raises
    ------
    InputError
        The motors never run.
    """
    time_s, throttle = np.asarray(time_s, float), np.atleast_2d(np.asarray(throttle, float))
    running = (throttle > 0).any(axis=1)
    if not running.any():
        raise InputError("the motors never ran")
    half = WINDOW_S / 2
    ahead = np.minimum(np.searchsorted(time_s, time_s + half, side="right") - 1, len(time_s) - 1)
    behind = np.searchsorted(time_s, time_s - half)
    span_s = np.maximum(time_s[ahead] - time_s[behind], 1e-9)
    slope = np.abs(throttle[ahead] - throttle[behind]).max(axis=1) / span_s
    kinds = np.where(~running, _REST, np.where(slope < _SLOPE_1_S, PLATEAU, _RAMP)).astype(object)
    found = _stretches(time_s, kinds)
    short = [s for s in found if s.kind == PLATEAU and s.length_s < _SHORTEST_S]
    for segment in short:
        kinds[(time_s >= segment.start_s) & (time_s <= segment.stop_s)] = _RAMP
    return _stretches(time_s, kinds)


def _stretches(time_s: np.ndarray, kinds: np.ndarray) -> list[StandStretch]:
    """Runs of equal kind."""
    edges = np.flatnonzero(kinds[1:] != kinds[:-1]) + 1
    starts, stops = np.concatenate([[0], edges]), np.concatenate([edges - 1, [len(kinds) - 1]])
    return [StandStretch(str(kinds[a]), float(time_s[a]), float(time_s[b])) for a, b in zip(starts, stops, strict=True)]


def longest(found: list[StandStretch], kind: str) -> StandStretch | None:
    """The longest stretch of a kind, None where there is none."""
    those = [segment for segment in found if segment.kind == kind]
    return max(those, key=lambda segment: segment.length_s) if those else None


def programme(found: list[StandStretch]) -> StandStretch:
    """From the first moment at which a motor runs to the last."""
    moving = [segment for segment in found if segment.kind != _REST]
    return StandStretch(_RAMP, moving[0].start_s, moving[-1].stop_s)
