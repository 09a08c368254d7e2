"""Verdicts on concealed sets: the mismatch stage, which gets no answer."""

from __future__ import annotations

import json
import time
import traceback
from collections.abc import Callable
from pathlib import Path

from rotorid.recordings import read_set
from rotorid.report.deliver import analysis_of, verdict_of


def judge_folder(sets: Path, out: Path, progress: Callable[[str], None], code: str = "") -> None:
    """Judge every set below `sets`: `out/<set>.json` each, and `out/seconds.json` with the time each took, how many
    samples a row of its errors is the mean of, and the hash of the code that judged it (`code`).

    A set on which the stage stops gets `{"failed": reason}`: that counts against it, and the others go on.
    """
    out.mkdir(parents=True, exist_ok=True)
    seconds = {}
    for folder in sorted(path for path in sets.iterdir() if path.is_dir()):
        start = time.perf_counter()
        try:
            recordings = read_set(folder)
            flown_s = sum(float(run.time_s[-1] - run.time_s[0]) for run in recordings.runs)
            analysis = analysis_of(recordings)
            averaged, text = analysis.samples_per_row, verdict_of(analysis).text()
        except Exception as error:  # any fault of the stage is a result here
            traceback.print_exc()
            flown_s, averaged, text = None, 1, json.dumps({"failed": f"{type(error).__name__}: {error}"}) + "\n"
        (out / f"{folder.name}.json").write_text(text, encoding="utf-8")
        seconds[folder.name] = {
            "seconds": round(time.perf_counter() - start, 3),
            "flown_s": flown_s,
            "samples_per_row": averaged,
            "code": code,
        }
        progress(f"{folder.name}: {seconds[folder.name]['seconds']:.1f} s")
    (out / "seconds.json").write_text(json.dumps(seconds, indent=1) + "\n", encoding="utf-8")
