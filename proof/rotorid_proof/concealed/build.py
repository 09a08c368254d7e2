"""Build concealed sets.

    python -m rotorid_proof.concealed.build --cases 'single/*/moderate/0' --out DIR --answers DIR2

Sets go to DIR/<set>/ under names that say nothing; the truth goes to DIR2/<set>.json, which the stage under
test must never read. What is already built is left alone: an interrupted build goes on where it stopped.
"""

import argparse
import json
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from . import cases, drawn, ground, rotorpy_cases
from .richsim import scene
from .write import write_set


def build(case: cases.Case, out: Path, answers: Path, signals: bool = False) -> Path:
    """Write one set and its answer; with `signals` also the noise-free tables next to the answer."""
    make = {
        "richsim": scene.make,
        "rotorpy": rotorpy_cases.make,
        "ground": ground.make,
        "drawn": drawn.make,
    }[case.generator]
    recording, truth, ideals = make(case.settings, case.seed)
    write_set(recording, out / case.set_name)
    answers.mkdir(parents=True, exist_ok=True)
    if signals:
        for run, table in ideals.items():
            (answers / case.set_name).mkdir(exist_ok=True)
            table.to_parquet(answers / case.set_name / f"{run}.parquet", index=False)
    # what a hidden cause needs to show (a wind needs drag) is to be found as well; what is far below the noise is not
    hidden = [] if truth.get("need_not_be_found") else [e["id"] for e in truth["effects"]]
    wrong = truth["wrong_parameters"] if case.generator == "drawn" else ()
    expected = sorted({*case.truth, *hidden, *wrong})
    answer = {"set": case.set_name, "case": case.name, "generator": case.generator, "expected": expected, **truth}
    path = answers / f"{case.set_name}.json"
    path.write_text(json.dumps(answer, indent=1))
    return path


def write_index() -> Path:
    """Write the list of all cases, which the proof's rules read without importing any of this."""
    path = Path(__file__).with_name("cases.tsv")
    path.write_text(index_text(), encoding="utf-8")
    return path


def index_text() -> str:
    """The list of all cases: `case`, `set`."""
    return "case\tset\n" + "".join(f"{c.name}\t{c.set_name}\n" for c in cases.all_cases())


def _one(job):
    case, out, answers, signals = job
    start = time.monotonic()
    try:
        build(case, out, answers, signals)
    except RuntimeError as error:  # a vehicle that no controller held
        return f"FAILED {case.name}: {error}"
    return f"{case.set_name} {time.monotonic() - start:.1f} s"


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", default="*", help="shell patterns on case names, comma-separated")
    parser.add_argument("--out", type=Path, help="folder for recording sets")
    parser.add_argument("--answers", type=Path, help="another folder, for the truth")
    parser.add_argument(
        "--release", metavar="DATE", help="cases drawn for this date (2026-11-30) instead of the listed ones"
    )
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--signals", action="store_true", help="keep the noise-free tables next to the answers")
    parser.add_argument("--list", action="store_true", help="only list the cases")
    parser.add_argument("--write-index", action="store_true", help="only write cases.tsv, after a change of the cases")
    args = parser.parse_args(argv)
    if args.write_index:
        print(f"written: {write_index().name}")
        return 0
    chosen = cases.matching(args.cases, cases.drawn(args.release) if args.release else None)
    if args.list:
        print("\n".join(f"{c.set_name}  {c.name}" for c in chosen))
        return 0
    if args.out is None or args.answers is None:
        parser.error("--out and --answers are needed")
    if args.answers.resolve().is_relative_to(args.out.resolve()):
        parser.error("--answers must lie outside --out")
    todo = [
        (c, args.out, args.answers, args.signals) for c in chosen if not (args.answers / f"{c.set_name}.json").exists()
    ]
    print(f"{len(chosen)} cases, {len(chosen) - len(todo)} already built", file=sys.stderr)
    failed = 0
    with ProcessPoolExecutor(args.jobs) as pool:
        for k, line in enumerate(pool.map(_one, todo)):
            failed += line.startswith("FAILED")
            print(f"[{k + 1}/{len(todo)}] {line}", file=sys.stderr, flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
