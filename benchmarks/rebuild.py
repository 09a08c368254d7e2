"""What a rebuild costs, by rule: from nothing and with nothing to do, at a commit before and now.

Run: python benchmarks/rebuild.py BEFORE [--out benchmarks/rebuild.md] [--cores 2] [--configfile FILE]

Both commits are cloned to a temporary folder, each with an environment of its own, and built one after the other:
without public recordings, and then with them where `ROTORID_PUBLIC_DATA` names them. Each process of a build writes the
processor time of itself and of what it started when it ends; a job's process says of which rule it is. Commit first,
and leave the machine alone: not part of `python -m benchmarks`, since it takes an hour.
"""

from __future__ import annotations

import argparse
import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pandas as pd

ROOT = Path(__file__).resolve().parents[1]
SNAKEMAKE = "Snakemake itself"
ALL = "sum"
NOTHING = "nothing to do"
SHOWN = 20
"""Rules in the table, the ones that took most before; all others are one row."""
CASES = {"without": "without public recordings", "with": "with public recordings"}

HOOK = f"""
import atexit, os, sys

def write():
    job = getattr(sys.modules["__main__"], "snakemake", None)
    rule, used = getattr(job, "rule", None), os.times()
    seconds = used.user + used.system
    if rule:
        seconds += used.children_user + used.children_system
    elif not sys.argv[0].endswith("snakemake"):
        return
    with open(os.environ["REBUILD_TIMES"], "a") as file:
        file.write(f"{{rule or {SNAKEMAKE!r}}},{{seconds}}\\n")

if "REBUILD_TIMES" in os.environ:
    atexit.register(write)
"""
"""Runs in every Python of a clone's environment. A job counts what it started (kernels, typesetters) too."""


def cloned(commit: str, folder: Path) -> Path:
    """The commit in a folder of its own, with its environment."""
    subprocess.run(["git", "clone", "--quiet", ROOT, folder], check=True)
    subprocess.run(["git", "checkout", "--quiet", commit], cwd=folder, check=True)
    subprocess.run(["make", "environment"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    packages = next(folder.glob(".venv/lib/python*/site-packages"))
    (packages / "rebuild_times.py").write_text(HOOK)
    (packages / "rebuild_times.pth").write_text("import rebuild_times\n")
    return folder


def built(folder: Path, options: list[str], surroundings: dict[str, str]) -> tuple[pd.Series, float, float]:
    """Processor time by rule, processor time of all, and wall time, s, of a build."""
    times = folder / "times.csv"
    times.write_text("")
    used, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    command = [str(folder / ".venv/bin/snakemake"), *options]
    environment = surroundings | {"REBUILD_TIMES": str(times)}
    subprocess.run(command, cwd=folder, env=environment, check=True, capture_output=True)
    now, wall = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter() - begin
    table = pd.read_csv(times, names=["rule", "seconds"])
    total = now.ru_utime + now.ru_stime - used.ru_utime - used.ru_stime
    return table.groupby("rule")["seconds"].sum(), total, wall


def measured(folder: Path, options: list[str], case: str) -> tuple[pd.Series, pd.DataFrame]:
    """Of a clone in one case: processor time by rule, and processor and wall time of all and with nothing to do."""
    # As `make` does: without compiled modules every job would compile what it imports.
    left_out = {"ROTORID_PUBLIC_DATA"} if case == "without" else set()
    surroundings = {k: v for k, v in os.environ.items() if k not in left_out | {"PYTHONDONTWRITEBYTECODE"}}
    subprocess.run(["git", "clean", "-fdxq", "-e", ".venv"], cwd=folder, check=True)
    rules, total, wall = built(folder, options, surroundings)
    _, again, again_wall = built(folder, options, surroundings)
    rules[ALL] = total
    return rules, pd.DataFrame({"processor": [total, again], "wall": [wall, again_wall]}, index=["report", NOTHING])


def table_of(rows: pd.DataFrame, what: str) -> list[str]:
    """Rows of figures as a table in markdown; a rule that there was not is a dash."""
    head = [f"| {what} | " + " | ".join(rows) + " |", "| --- |" + " ---: |" * len(rows.columns)]
    cells = rows.map(lambda x: "–" if pd.isna(x) else f"{x:.3g}")
    return head + [f"| {name} | " + " | ".join(row) + " |" for name, row in zip(cells.index, cells.values, strict=True)]


def largest(rules: pd.DataFrame) -> pd.DataFrame:
    """The rules that took most, the rest as one row, and the sum."""
    alone = rules.drop(index=ALL).sort_values(list(rules), ascending=False)
    rest = alone.iloc[SHOWN:].sum().to_frame("all others").T
    return pd.concat([alone.iloc[:SHOWN], rest, rules.loc[[ALL]]])


def main(before: str, out: Path | None, cores: int, configfile: str | None) -> None:
    options = ["--cores", str(cores), *(["--configfile", configfile] if configfile else [])]
    cases = [case for case in CASES if case == "without" or os.environ.get("ROTORID_PUBLIC_DATA")]
    with tempfile.TemporaryDirectory() as place:
        names = [
            subprocess.run(["git", "rev-parse", "--short", c], cwd=ROOT, check=True, capture_output=True, text=True)
            for c in (before, "HEAD")
        ]
        commits = [done.stdout.strip() for done in names]
        clones = dict(zip(("before", "now"), (cloned(c, Path(place) / c) for c in commits), strict=True))
        rules, wholes = {}, []
        for case in cases:
            whole = {}
            for name, folder in clones.items():
                rules[f"{case}, {name}"], whole[name] = measured(folder, options, case)
                print(case, name, whole[name].to_string(), sep="\n", file=sys.stderr)
            both = pd.DataFrame(
                {f"{kind}, {name}": whole[name][kind] for kind in ("processor", "wall") for name in whole}
            )
            wholes.append(both.set_axis([f"{row}, {CASES[case]}" for row in both.index]))
    text = "\n".join(
        [
            "# Rebuild",
            "",
            f"`python benchmarks/rebuild.py {commits[0]}`: Python {platform.python_version()}, {cores} cores; "
            f'"before" is {commits[0]}, "now" {commits[1]}; from nothing, seconds.',
            "",
            *table_of(pd.concat(wholes), "what"),
            "",
            "Processor time by rule, s; a job counts what it starts:",
            "",
            *table_of(largest(pd.DataFrame(rules)), "rule"),
            "",
        ]
    )
    out.write_text(text, encoding="utf-8") if out else print(text)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--cores", type=int, default=2)
    parser.add_argument("--configfile")
    given = parser.parse_args()
    main(given.before, given.out, given.cores, given.configfile)
