"""Verdicts on planted sets, and what the search for mistakes alone makes of them."""

from __future__ import annotations

import json
import time
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rotorid.mismatch.decide.findings import Finding
from rotorid.mismatch.mistakes import find_mistakes
from rotorid.recordings import RecordingSet, read_set
from rotorid.report.deliver import judge
from rotorid_proof.plantings.flights import flight, taken
from rotorid_proof.plantings.plan import Planting
from rotorid_proof.plantings.sow import plant


def cut(folder: Path, name: str) -> RecordingSet:
    """The set of a flight, cut as its entry says; `folder` holds the imported public set."""
    return taken(read_set(folder), flight(name))


def judged(recordings: RecordingSet) -> dict[str, Any]:
    """The verdict on a set with its cost; `{"failed": reason}` in its place where the stage stops."""
    start = time.perf_counter()
    flown = sum(float(run.time_s[-1] - run.time_s[0]) for run in recordings.runs)
    try:
        verdict = json.loads(judge(recordings).text())
    except Exception as error:  # any fault of the stage is a result here
        traceback.print_exc()
        verdict = {"failed": f"{type(error).__name__}: {error}"}
    return {"verdict": verdict, "seconds": round(time.perf_counter() - start, 2), "flown_s": round(flown, 2)}


def judge_plantings(
    folder: Path,
    plantings: Sequence[Planting],
    code: str,
    out: Path,
    memory: Path,
    progress: Callable[[str], None],
) -> None:
    """Judge plantings of one flight: `out/<planting>.json` each, with the hash of the code that judged it.

    Parameters
    ----------
    folder
        The imported public set.
    plantings
        What is planted in it, one set each.
    code
        Hash of the code that judges.
    out
        Folder of the results.
    memory
        Folder that remembers results by code, so that a batch that was stopped, or is cut anew, judges nothing twice.
    progress
        Called with one line a set.
    """
    out.mkdir(parents=True, exist_ok=True)
    recordings = cut(folder, plantings[0].flight)
    for planting in plantings:
        known = memory / code / f"{planting.file}.json"
        if not known.is_file():
            changed, _ = plant(recordings, planting)
            write_result({"planting": planting.name, "code": code, **judged(changed)}, known)
        (out / known.name).write_bytes(known.read_bytes())
        progress(f"{planting.name}: {json.loads(known.read_text(encoding='utf-8'))['seconds']:.0f} s")


def judge_untouched(folder: Path, name: str, code: str, out: Path, memory: Path) -> None:
    """The verdict on a flight with nothing planted into the file `out`."""
    known = memory / code / f"{name}.json"
    if not known.is_file():
        recordings = cut(folder, name)
        write_result({"flight": name, "code": code, **judged(recordings)}, known)
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_bytes(known.read_bytes())


def write_result(result: dict[str, Any], path: Path) -> None:
    """A result as JSON, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_suffix(".new")
    new.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    new.replace(path)


def of_mistakes(recordings: RecordingSet) -> dict[str, Any]:
    """What the search for mistakes alone says of a set, in the form of a verdict's effects."""
    try:
        _, findings, _ = find_mistakes(recordings)
    except Exception as error:
        traceback.print_exc()
        return {"failed": f"{type(error).__name__}: {error}"}
    return {"effects": [_effect(f) for f in findings], "parameters": {}, "verdict": ""}


def _effect(finding: Finding) -> dict[str, Any]:
    return {
        "id": finding.id,
        "status": finding.status,
        "alternatives": list(finding.alternatives),
        "parameters": [
            {"symbol": p.symbol, "value": p.value, "unit": p.unit, "interval_95": [p.low, p.high]}
            for p in finding.parameters
        ],
        "p_value": finding.p_value,
        "sentence": finding.sentence,
    }
