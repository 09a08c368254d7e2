"""Evidence of sets of which none is kept yet: each is made, judged once by the engine, and only its evidence kept.

What is in the folder stays there. A collection may be stopped at any time and goes on where it stopped.
"""

from __future__ import annotations

import json
import time
import traceback
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rotorid.mismatch.decide.findings import Finding
from rotorid.mismatch.evidence.gram import Evidence
from rotorid.mismatch.flight.absent import evidence_of
from rotorid.mismatch.flight.fitted import Decided
from rotorid.mismatch.tell.verdict import WrongValue, effect_verdict
from rotorid.recordings import RecordingSet
from rotorid.report.deliver import analysis_of, verdict_of
from rotorid_proof.decisions.plan import Item
from rotorid_proof.decisions.store import Kept, key_of, stem_of, write


@dataclass(frozen=True)
class Made:
    """A set that was made to be judged, and what is true of it."""

    recordings: RecordingSet
    truth: Mapping[str, Any]


Make = Callable[[Item], Made]
"""Makes the set of an item."""


def collect(
    items: Iterable[Item],
    folder: Path,
    make: Make,
    source_of: Callable[[Item], str],
    engine: str,
    progress: Callable[[str], None],
) -> list[str]:
    """Keep the evidence of every item in `folder`; names of the files of all of them, made now or before.

    Parameters
    ----------
    items
        Sets in the order in which they are judged.
    folder
        Where evidence is kept.
    make
        Makes a set.
    source_of
        Hash of what a set is made from: another hash is another set.
    engine
        Hash of the code that judges.
    progress
        Called with one line a set judged.
    """
    stems = []
    for item in items:
        name, source = item.label.name, source_of(item)
        key = key_of(name, source, engine)
        stems.append(stem_of(name, key))
        if (folder / f"{stems[-1]}.json").is_file():
            continue
        try:
            made = make(item)
        except Exception:  # one set that cannot be made must not end the collection; without a file it is tried again
            traceback.print_exc()
            progress(f"{name}: could not be made")
            continue
        start = time.perf_counter()
        verdict, decided = judged(made.recordings)
        kept = Kept(
            label=item.label,
            key=key,
            source=source,
            engine=engine,
            seconds=round(time.perf_counter() - start, 2),
            flown_s=round(sum(float(run.time_s[-1] - run.time_s[0]) for run in made.recordings.runs), 2),
            verdict=verdict,
            selection=None if decided is None else selection_of(decided),
        )
        evidence: Evidence | None = None if decided is None else evidence_of(decided.found.model)
        write(folder, kept, evidence, made.truth)
        progress(f"{name}: {kept.seconds:.0f} s")
    return stems


def judged(recordings: RecordingSet) -> tuple[dict[str, Any], Decided | None]:
    """The verdict on a set, and what the fitted runs decided before its last word (None of an instrument)."""
    seen: list[Decided] = []
    try:
        verdict = json.loads(verdict_of(analysis_of(recordings, watch=seen.append)).text())
    except Exception as error:  # any fault of the stage is a result here
        traceback.print_exc()
        verdict = {"failed": f"{type(error).__name__}: {error}"}
    return verdict, seen[-1] if seen else None


def selection_of(decided: Decided) -> dict[str, Any]:
    """What the fitted runs decide, as `verdict.json` states effects and values; `outside` the regression apart."""

    def stated(findings: Iterable[Finding]) -> list[dict[str, Any]]:
        return [effect_verdict(f, None).model_dump(mode="json") for f in findings]

    values = {
        name: WrongValue(believed=believed, refitted=found, interval_95=(low, high)).model_dump(mode="json")
        for name, (believed, found, low, high) in decided.values.items()
    }
    return {
        "effects": stated(decided.findings),
        "outside": stated(decided.outside),
        "parameters": values,
        "commanded": decided.found.commanded,
    }
