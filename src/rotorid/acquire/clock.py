"""The host's clock, real or virtual. Recorders take one, so that a test or a campaign never waits."""

from __future__ import annotations

import time
from datetime import datetime, timedelta
from typing import Protocol


class Clock(Protocol):
    """Monotonic time, date, and waiting."""

    def now_ns(self) -> int: ...

    def date(self) -> datetime: ...

    def wait(self, seconds: float) -> None: ...


class SystemClock:
    """The computer's own clock."""

    def now_ns(self) -> int:
        return time.monotonic_ns()

    def date(self) -> datetime:
        return datetime.now().astimezone()

    def wait(self, seconds: float) -> None:
        time.sleep(seconds)


class VirtualClock:
    """A clock that stands still unless it is advanced; the world's emulators follow it."""

    def __init__(self, start: datetime) -> None:
        self._start = start
        self._now_ns = 0
        self._followers = []

    def follow(self, run_until) -> None:
        """Call `run_until(seconds)` whenever the time has advanced."""
        self._followers.append(run_until)

    def now_ns(self) -> int:
        return self._now_ns

    def date(self) -> datetime:
        return self._start + timedelta(microseconds=self._now_ns // 1000)

    def wait(self, seconds: float) -> None:
        self._now_ns += round(seconds * 1e9)
        for run_until in self._followers:
            run_until(self._now_ns / 1e9)
