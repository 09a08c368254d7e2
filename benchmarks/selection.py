"""Selection of effects compared with PySINDy on the same columns: processor time and what is found.

Run: python benchmarks/selection.py [--out benchmarks/selection.md]

The columns of the catalogue's forms, as the regression has them, go to both: to PySINDy's STLSQ as
`rotorid_proof.peers.sindy` uses it, and to our search (`rotorid.mismatch.decide.select.Search`), timed inside the
whole analysis, which makes columns, searches and judges. Simulated vehicles, two flights each.
"""

from __future__ import annotations

import argparse
import platform
import sys
import time
from importlib.metadata import version
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from rotorid.mismatch.analyse import analyse
from rotorid.mismatch.decide.select import Search
from rotorid.mismatch.decide.status import CLAIMED
from rotorid.recordings.templates import read
from rotorid.vehicle.control import swings
from rotorid_proof.peers import sindy
from rotorid_proof.peers.problem import problem_of

DRAG = {"id": "rotor_drag", "form": "at the hubs", "parameters": {"k_d": 8e-5}}
OFFSET = {"id": "com_offset", "form": "moment", "parameters": {"r_x": 0.004, "r_y": -0.003}}
LAG = {"id": "motor_lag", "form": "one constant", "parameters": {"tau": 0.05}}
HIDDEN = {"nothing": (), "drag": (DRAG,), "drag, offset": (DRAG, OFFSET), "drag, lag": (DRAG, LAG)}
NOTES = (
    "- PySINDy's time is that of six thresholds and of choosing a form for each effect, both on all columns.",
    "- The whole analysis also looks for mistakes in the set, holds runs out, gives intervals and identifies the chain",
    "  from command to rotor speed: where rotor speeds are measured the motor lag is in no column of the regression.",
    "- One draw of the noise a line: how often each peer is right stands in `docs/proof/README.md`.",
    "",
)
LENGTHS_S = (10.0,)
REPEATS = 2


def main(out: Path | None) -> None:
    analyse(swings(read("thesis"), "first", 3.0, 2, 1, every=5))  # compile what numba compiles
    rows = [row(name, seconds) for seconds in LENGTHS_S for name in HIDDEN]
    versions = ", ".join(f"{p} {version(p)}" for p in ("numpy", "pysindy", "scikit-learn"))
    text = "\n".join(
        [
            "# Selection compared with PySINDy",
            "",
            f"`python benchmarks/selection.py`: Python {platform.python_version()}, {versions}; flights at 100 Hz, "
            "processor time of one core in seconds.",
            "",
            "| hidden | flights | columns | making columns | PySINDy | our search | whole analysis | PySINDy finds "
            "| rotorid finds |",
            "| --- | --- | ---: | ---: | ---: | ---: | ---: | --- | --- |",
            *rows,
            "",
            *NOTES,
        ]
    )
    print(text)
    if out:
        out.write_text(text, encoding="utf-8")


def row(name: str, seconds: float) -> str:
    """One line of the table."""
    vehicle = read("thesis").model_copy(update={"effects": HIDDEN[name]})
    recordings = swings(vehicle, "set", seconds, 2, seed=3, every=5)
    columns_s, problem = timed(lambda: problem_of(recordings))
    peer_s, answer = min((timed(lambda: sindy.ask(problem)) for _ in range(REPEATS)), key=lambda pair: pair[0])
    searched = [0.0]
    plain = Search.run
    try:
        Search.run = lambda self, *args: charged(searched, plain, self, *args)
        whole_s, analysis = timed(lambda: analyse(recordings))
    finally:
        Search.run = plain
    ours = sorted({f.id for f in analysis.findings if f.status in CLAIMED} | set(analysis.values))
    theirs = sorted({*answer.found, *(term.split(":")[-1] for term in answer.values)})
    return (
        f"| {name} | 2 × {seconds:g} s | {problem.x.shape[2]} | {columns_s:.2f} | {peer_s:.2f} | {searched[0]:.2f} "
        f"| {whole_s:.2f} | {', '.join(theirs) or 'nothing'} | {', '.join(ours) or 'nothing'} |"
    )


def charged(spent: list[float], function, *arguments):
    """The function's answer, its processor time added to `spent`."""
    seconds, answer = timed(lambda: function(*arguments))
    spent[0] += seconds
    return answer


def timed(function):
    """Processor time in s, and what the function gives."""
    begin = time.process_time()
    answer = function()
    return time.process_time() - begin, answer


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path)
    main(parser.parse_args().out)
