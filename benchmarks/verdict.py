"""What a verdict costs outside the analysis: processor time of each step of `rotorid verdict` on one set.

Run: python benchmarks/verdict.py [--out benchmarks/verdict.md] [--seconds 20]

The set is simulated (`rotorid simulate`, two flights of the thesis's quadrotor). Steps are timed where
`rotorid.report.deliver` calls them, in one process, each once, as a user has it.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

STEPS = {
    "analysis_of": "analysis",
    "locate": "locating",
    "forward_channels": "running the simulation forward",
    "prove": "simulating the file written, as proof",
    "make_verdict": "words of the verdict",
    "make_page": "drawing the page",
}


def main(out: Path | None, seconds: float) -> None:
    begin = time.process_time()
    from rotorid.recordings import read_set
    from rotorid.report import deliver as stage

    took = {"starting Python and imports": time.process_time()}
    print(f"imports alone {time.process_time() - begin:.2f} s", file=sys.stderr)
    for name, words in STEPS.items():
        setattr(stage, name, timed(getattr(stage, name), words, took))
    from rotorid.cli.simulating import fly
    from rotorid.recordings.templates import read

    with tempfile.TemporaryDirectory() as folder:
        place = fly(read("thesis"), Path(folder) / "set", seconds, 2, 1)
        begin = time.process_time()
        recordings = read_set(place)
        took["reading the set"] = time.process_time() - begin
        begin = time.process_time()
        names = ("verdict.json", "report.html", "improved_vehicle.yaml")
        stage.deliver(recordings, *(Path(folder) / "out" / name for name in names))
        whole = time.process_time() - begin
    took["writing, and what is not named"] = whole - sum(took.get(words, 0.0) for words in STEPS.values())
    total = whole + took["starting Python and imports"] + took["reading the set"]
    rows = sorted(took.items(), key=lambda pair: -pair[1])
    outside = total - took.get("analysis", 0.0)
    text = "\n".join(
        [
            "# A verdict, step by step",
            "",
            f"`python benchmarks/verdict.py --seconds {seconds:g}`: two flights of {seconds:g} s at 250 Hz, "
            "processor time of one core.",
            "",
            "| step | s | share |",
            "| --- | ---: | ---: |",
            *(f"| {name} | {value:.2f} | {value / total:.0%} |" for name, value in rows),
            f"| outside the analysis | {outside:.2f} | {outside / total:.0%} |",
            "",
        ]
    )
    print(text)
    if out:
        out.write_text(text, encoding="utf-8")


def timed(function, words: str, took: dict[str, float]):
    """The function, its processor time added under `words`."""

    def measured(*arguments, **named):
        begin = time.process_time()
        try:
            return function(*arguments, **named)
        finally:
            took[words] = took.get(words, 0.0) + time.process_time() - begin

    return measured


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--seconds", type=float, default=20.0)
    given = parser.parse_args()
    main(given.out, given.seconds)
