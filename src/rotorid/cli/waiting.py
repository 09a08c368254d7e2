"""How long is left: from the steps measured in this run, and from the last runs of the command on this machine.

Each earlier run that had the step says what is left if the rest goes as it went then, as much slower or faster as the
steps were so far. A number is shown only where these runs agree; a first run has none.
"""

from __future__ import annotations

import json
import os
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from statistics import mean

from rotorid.steps import Path as Steps

Run = list[tuple[str, float]]
"""Steps one after the other, and the seconds of each."""
KEPT_RUNS, ALIKE, LEAST_RUNS = 24, 5, 3
"""Runs in the record of a command, those asked (the most alike in their steps so far), and asked at least."""
AGREE, SOON_S = 2.0, 5.0
"""Factor within which all of them but the shortest must agree; shorter times than `SOON_S` count as that."""
UNMET, LONGER = 0.3, 0.3
"""Power of the slowness so far by which a step not yet met is slower (some take as long whatever the recording), and
share of its time that a step lasts on when it is longer than it should be."""


def left(runs: Sequence[Run], done: Run, name: str, spent_s: float) -> float | None:
    """Seconds left in the step `name`, `spent_s` seconds after it began; None where the runs do not say it."""
    met = {step for step, _ in done} | {name}
    alike = sorted(runs, key=lambda run: len(met - {step for step, _ in run}))[:ALIKE]
    if len(alike) < LEAST_RUNS:
        return None
    found = sorted(max(as_then(run, done, name, spent_s), SOON_S) for run in alike)
    low, middle, high = (found[int(share * len(found))] for share in (0.2, 0.5, 0.8))
    return middle if high <= AGREE * low else None


def as_then(run: Run, done: Run, name: str, spent_s: float) -> float:
    """Seconds left if the rest goes as in an earlier run: as many of each step, by the time that it takes now.

    Counted from where the newest step that both have was met first.
    """
    now, then = times_of(done), times_of(run)
    own = [step for step, _ in done] + [name]
    newest = max(then.keys() & set(own), key=own.index, default=None)
    if newest is None:
        return sum(seconds for _, seconds in run)
    rest = Counter(step for step, _ in run[[step for step, _ in run].index(newest) :])
    rest.subtract(own[own.index(newest) :])
    usual = mean(then.get(name, [0.0]))
    both = [(len(now[s]) * mean(then[s]), sum(now[s])) for s in now if s in then]
    took_then, takes = (0.3 + sum(times) for times in zip((0.0, 0.0), *both, strict=True))
    if spent_s * took_then > usual * takes:
        took_then, takes = took_then + usual, takes + spent_s

    def again(step: str) -> float:
        return mean(now[step]) if step in now else mean(then[step]) * (takes / took_then) ** UNMET

    current = again(name) if name in then else 0.0
    going = current - spent_s if current > spent_s else LONGER * spent_s
    return going + sum(count * again(step) for step, count in rest.items() if count > 0)


def times_of(run: Run) -> dict[str, list[float]]:
    """Seconds of each step, every time that it was met."""
    out: dict[str, list[float]] = {}
    for step, seconds in run:
        out.setdefault(step, []).append(seconds)
    return out


def words(seconds: float | None) -> str:
    """`about 40 s left` or `about 3 min left`, nothing where it is not known."""
    if seconds is None:
        return ""
    if seconds < 2 * SOON_S:
        return "a few seconds left"
    return f"about {round(seconds, -1):.0f} s left" if seconds < 95 else f"about {seconds / 60:.0f} min left"


class Waiting:
    """Hears of the steps of a command, and says at which it is, since when and how long is left."""

    def __init__(self, runs: Sequence[Run], clock: Callable[[], float] = time.monotonic):
        self.runs, self.clock, self.began = runs, clock, clock()
        self.done: Run = []
        self.path: Steps = ()
        self.since = self.began

    def heard(self, path: Steps) -> None:
        """A step began or ended."""
        now = self.clock()
        self.done.append(("/".join(self.path), now - self.since))
        self.path, self.since = path, now

    def elapsed(self) -> float:
        """Seconds since the command began."""
        return self.clock() - self.began

    def left(self) -> float | None:
        """Seconds left, where it is known."""
        return left(self.runs, self.done, "/".join(self.path), self.clock() - self.since)


def record_file() -> Path:
    """Where the times of earlier runs are kept: names of steps and seconds, nothing of the recordings."""
    home = os.environ.get("LOCALAPPDATA") or os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(home) / "rotorid" / "waiting.json"


def read_record(version: str) -> dict[str, list[Run]]:
    """The last runs by command; none where the file is missing, broken or of another version."""
    with suppress(OSError, ValueError, TypeError, KeyError, RuntimeError):
        content = json.loads(record_file().read_text(encoding="utf-8"))
        if content["version"] == version:
            return {
                str(command): [[(str(step), float(s)) for step, s in run] for run in runs]
                for command, runs in content["runs"].items()
            }
    return {}


def keep(version: str, command: str, run: Run) -> None:
    """Add a run to the record, as far as it can be written."""
    record = read_record(version)
    record[command] = [*record.get(command, []), [(step, round(s, 2)) for step, s in run]][-KEPT_RUNS:]
    with suppress(OSError, RuntimeError):
        record_file().parent.mkdir(parents=True, exist_ok=True)
        part = record_file().with_suffix(f".{os.getpid()}")
        part.write_text(json.dumps({"version": version, "runs": record}), encoding="utf-8")
        part.replace(record_file())
