"""Worked examples for the mismatch chapter, judged in this run.

- Recorded by simulators that share no code with the library: a bench, a flight with nothing wrong and a flight with a
  cause outside the catalogue.
- What the verdicts say, and the error over time that each leaves on a run held out.
"""

import json
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rotorid.recordings import RecordingSet, read_set
from rotorid.report.deliver import analysis_of, write_files
from rotorid_lab import log
from rotorid_proof import quoted

SHOWN_HZ = 50.0
INSTRUMENT = ("force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z")


def recorded(wanted: Mapping[str, str]) -> dict[str, RecordingSet]:
    """Sets recorded by the simulators of `proof/rotorid_proof/concealed`, cases by name; answers are thrown away."""
    from rotorid_proof.concealed import build, cases

    known = {case.name: case for case in cases.all_cases()}
    sets = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, case in wanted.items():
            answer = build.build(known[case], Path(folder) / "sets", Path(folder) / "answers")
            sets[name] = read_set(Path(folder) / "sets" / answer.stem)
    return sets


def rows_of(example: str, verdict: Mapping[str, Any]) -> tuple[list[dict], list[dict], list[dict]]:
    """Channels, effects and locations of a verdict as rows of tables."""
    effects = []
    for effect in verdict["effects"]:
        common = {"example": example, "effect": effect["id"], "status": effect["status"]}
        common["alternatives"] = " or ".join(effect["alternatives"])
        for parameter in effect["parameters"] or [
            {"symbol": "", "value": None, "unit": "", "interval_95": [None, None]}
        ]:
            low, high = parameter["interval_95"] or (None, None)
            figures = {"symbol": parameter["symbol"], "value": parameter["value"], "unit": parameter["unit"]}
            effects.append(common | figures | {"low_95": low, "high_95": high})
    locations = [
        {"example": example, **{name: place[name] for name in ("run", "channel", "start_s", "stop_s")}}
        for place in verdict["locations"]
    ]
    return quoted.channels(example, verdict), effects, locations


def main(cases: Mapping[str, str], out: Mapping[str, str], folder: str) -> None:
    """Judge the examples and write their state (JSON) and tables (CSV); each verdict's own files go to `folder`."""
    state: dict[str, Any] = {"examples": {}}
    channels, effects, locations, traces = [], [], [], []
    for name, recordings in recorded(cases).items():
        analysis = analysis_of(recordings)
        verdict = json.loads(write_files(analysis, Path(folder) / name).text())
        state["examples"][name] = {
            **quoted.said(verdict),
            "runs": len(recordings.runs),
            "seconds": float(sum(run.time_s[-1] - run.time_s[0] for run in recordings.runs)),
            "unexplained_share": (verdict.get("unexplained") or {}).get("share"),
        }
        for whole, part in zip((channels, effects, locations), rows_of(name, verdict), strict=True):
            whole += part
        held_out = verdict["runs"]["held_out"]
        for trace in analysis.traces:
            if trace.run in held_out[:1] and trace.channel in INSTRUMENT:
                step = max(round(1 / SHOWN_HZ / float(np.median(np.diff(trace.time_s)))), 1)
                shown = {"time_s": trace.time_s, "before": trace.before, "after": trace.after}
                frame = pd.DataFrame(shown).iloc[::step]
                traces.append(frame.assign(example=name, run=trace.run, channel=trace.channel))
    Path(out["state"]).write_text(json.dumps(state, indent=1) + "\n", encoding="utf-8")
    for name, rows in (("channels", channels), ("effects", effects), ("locations", locations)):
        pd.DataFrame(rows).to_csv(out[name], index=False, float_format="%.6g")
    pd.concat(traces).to_csv(out["traces"], index=False, float_format="%.5g")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            cases=dict(snakemake.params.cases),
            out=dict(snakemake.output.items()),
            folder=snakemake.params.folder,
        )
