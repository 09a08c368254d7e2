"""Verdicts on sets with rules of the decision left out, without knowing what is hidden in them."""

from __future__ import annotations

import json
import time
from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rotorid.recordings import read_set
from rotorid.report.deliver import analysis_of, verdict_of


@dataclass(frozen=True)
class Judged:
    """A verdict, and which rules fired on the way to it."""

    name: str
    """Name of the set."""
    verdict: Mapping[str, Any]
    """`verdict.json`, or `{"failed": reason}`."""
    fired: Mapping[str, int]
    """How often each rule's condition held."""
    samples_per_row: int
    seconds: float
    """Processor time."""


def judged(folder: Path, off: Collection[str] = ()) -> Judged:
    """The verdict on the set in a folder without the rules named in `off`; a stage that stops is a verdict, too."""
    start = time.process_time()
    try:
        analysis = analysis_of(read_set(folder), off)
        verdict, fired = json.loads(verdict_of(analysis).text()), analysis.fired
        averaged = analysis.samples_per_row
    except Exception as error:  # any fault of the stage is a result here
        verdict, fired, averaged = {"failed": f"{type(error).__name__}: {error}"}, {}, 1
    return Judged(folder.name, verdict, dict(fired), averaged, time.process_time() - start)


def fires_in(base: Iterable[Judged], rule: str, most: int) -> list[Judged]:
    """At most `most` of the sets in which a rule fired, spread evenly over all of them."""
    own = [j for j in base if j.fired.get(rule)]
    step = max(1.0, len(own) / most)
    return [own[int(k * step)] for k in range(min(most, len(own)))]


def stored(items: Iterable[Judged]) -> str:
    """Verdicts as JSON lines."""
    return "".join(json.dumps(asdict(j)) + "\n" for j in items)


def read_stored(path: Path) -> list[Judged]:
    """What `stored` wrote."""
    return [Judged(**json.loads(line)) for line in path.read_text(encoding="utf-8").splitlines()]
