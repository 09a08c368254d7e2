"""Every peer asked about every flight of a folder; of stands and benches they have no columns."""

from __future__ import annotations

import json
import traceback
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

from rotorid.recordings import read_set
from rotorid_proof.peers import boosting, refit_only, sample_split, sindy, stepwise
from rotorid_proof.peers.problem import as_verdict, problem_of

PEERS = {
    "refit_only": refit_only.ask,
    "stepwise_pse": stepwise.ask,
    "boosting": boosting.ask,
    "sample_split": sample_split.ask,
}
if find_spec("pysindy"):  # a development dependency: where it is missing this peer is left out
    PEERS["pysindy"] = sindy.ask


def ask_folder(sets: Path, out: Path, progress: Callable[[str], None]) -> None:
    """Write `out/<set>.json` of each flight: peer to its verdict, or to the reason why it stopped."""
    out.mkdir(parents=True, exist_ok=True)
    for folder in sorted(path for path in sets.iterdir() if path.is_dir()):
        said = {}
        try:
            recordings = read_set(folder)
            if recordings.vehicle.kind != "flight":
                continue
            problem, stopped = problem_of(recordings), ""
        except Exception as error:  # a set that no peer can read is a result
            traceback.print_exc()
            problem, stopped = None, f"{type(error).__name__}: {error}"
        for name, ask in PEERS.items():
            try:
                said[name] = {"failed": stopped} if problem is None else as_verdict(folder.name, problem, ask(problem))
            except Exception as error:  # a peer that stops is a result
                traceback.print_exc()
                said[name] = {"failed": f"{type(error).__name__}: {error}"}
        (out / f"{folder.name}.json").write_text(json.dumps(said, indent=1) + "\n", encoding="utf-8")
        progress(f"{folder.name}: {len(said)} peers asked")
