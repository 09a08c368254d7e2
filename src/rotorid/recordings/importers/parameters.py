"""Parameters of an autopilot over a log: they are tuned in the air, and each value belongs to those that held then."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rotorid.recordings.importers.report import ImportFault

Values = Mapping[str, float]
_MOST_LISTED = 4
"""Changes of one parameter that a sentence lists."""


@dataclass(frozen=True)
class Parameters:
    """Values at the start of a log, and what was set to another value since: (time, name, value) by time.

    Times are on a clock of the log, in its own unit.
    """

    start: Values
    changes: tuple[tuple[float, str, float], ...] = ()

    @classmethod
    def of(cls, stated: Iterable[tuple[float, str, float]], start: Values | None = None) -> Parameters:
        """From all that a log states, in order: what it states first of a parameter is its value at the start."""
        first, latest, changes = dict(start or {}), dict(start or {}), []
        for time, name, value in stated:
            if latest.get(name, value) != value:
                changes.append((float(time), name, value))
            first.setdefault(name, value)
            latest[name] = value
        return cls(first, tuple(sorted(changes, key=lambda change: change[0])))

    def spans(self, names: str) -> list[tuple[float, float, Values]]:
        """Spans of the log [from, to) in which no parameter whose whole name matches `names` changes, with the values
        that hold in each; the first begins and the last ends at infinity."""
        cuts = sorted({time for time, name, _ in self.changes if re.fullmatch(names, name)})
        return [(a, b, self.at(a)) for a, b in pairwise([-np.inf, *cuts, np.inf])]

    def at(self, time: float) -> Values:
        """What holds at an instant."""
        return {**self.start, **{name: value for t, name, value in self.changes if t <= time}}

    def mostly(self, times: np.ndarray) -> Values:
        """What holds at most of some instants, each parameter by itself."""
        values = dict(self.start)
        for name in {name for _, name, _ in self.changes}:
            own = [(t, v) for t, n, v in self.changes if n == name]
            held = [self.start[name], *(v for _, v in own)]
            index = np.searchsorted([t for t, _ in own], times, side="right")
            counts = {v: sum(int((index == k).sum()) for k, w in enumerate(held) if w == v) for v in held}
            values[name] = max(counts, key=counts.get)
        return values

    def faults(
        self, actions: Sequence[tuple[str, str, str]], zero: float = 0.0, unit_s: float = 1.0
    ) -> list[ImportFault]:
        """One fault for each parameter that changes and matters.

        `actions` hold a pattern of names, the column and what is done about a change; `zero` is the time, in the
        log's clock, from which seconds are counted, `unit_s` what that clock counts in.
        """
        found = []
        for name in dict.fromkeys(name for _, name, _ in self.changes):
            known = next(((column, action) for names, column, action in actions if re.fullmatch(names, name)), None)
            if known is None:
                continue
            own = [(t, v) for t, n, v in self.changes if n == name]
            steps = ", ".join(f"to {v:g} at {(t - zero) * unit_s:.2f} s" for t, v in own[:_MOST_LISTED])
            more = f" and {len(own) - _MOST_LISTED} times more" if len(own) > _MOST_LISTED else ""
            seen = f"{name} was set from {self.start[name]:g} {steps}{more} of the log"
            found.append(ImportFault("parameter_changed", known[0], seen, known[1], len(own)))
        return found
