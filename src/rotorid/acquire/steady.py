"""The recorder's own filter and its idea of steady (thesis 2.7.3, fig. 2.35)."""

from __future__ import annotations

import math
from collections import deque


class LowPass:
    """First-order low-pass y += α (x − y) with α = 1 − exp(−2π f_c Δt), for tuples of channels."""

    def __init__(self, cutoff_hz: float, interval_s: float) -> None:
        self._alpha = 1 - math.exp(-2 * math.pi * cutoff_hz * interval_s)
        self._state: list[float] | None = None

    def update(self, values: tuple[float, ...]) -> list[float]:
        """The filtered values; the first sample passes unchanged."""
        if self._state is None:
            self._state = list(values)
        else:
            self._state = [y + self._alpha * (x - y) for y, x in zip(self._state, values, strict=True)]
        return self._state


class Steadiness:
    """Steady: over the last `window` samples no channel's filtered value spans more than `tolerance`."""

    def __init__(self, window: int, tolerance: tuple[float, ...]) -> None:
        self._last: deque[list[float]] = deque(maxlen=window)
        self._tolerance = tolerance

    def update(self, filtered: list[float]) -> bool:
        """Take one more filtered sample; True once the window is full and steady."""
        self._last.append(filtered)
        if len(self._last) < self._last.maxlen:
            return False
        return all(span <= t for span, t in zip(self.spans(), self._tolerance, strict=True))

    def spans(self) -> list[float]:
        """What each channel spans over the window so far."""
        return [max(channel) - min(channel) for channel in zip(*self._last, strict=True)]
