"""A fleet of made-up recording sets, judged through the workflow: times, and whether it says what each set says alone.

    python benchmarks/fleet.py make DIR [--sets 1000]        flights of 40 vehicles, benches and stands, some broken
    snakemake --cores 1 fleet --config recordings=DIR        (or through a cluster's profile)
    python benchmarks/fleet.py check DIR [--sample 20]       every set there; a sample judged alone, byte by byte
        [--out benchmarks/fleet.md --measured "processor time, h: 0.9" ...]    its table, with what was measured

A vehicle hides what its number says: nothing, a drag that grows from flight to flight, a payload, a motor lag, drag and
lag, a centre of mass off the believed one. Every 25th set is a bench or a stand of `proof/rotorid_proof/concealed`,
one effect each or none. Every fiftieth flight is broken in one of four ways.
"""

from __future__ import annotations

import argparse
import datetime
import json
import random
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from rotorid.errors import InputError
from rotorid.recordings import read_set, write_set
from rotorid.recordings.templates import read
from rotorid.report.deliver import deliver
from rotorid.report.fleet import FAILED, FILES
from rotorid.vehicle.control import swings
from rotorid_proof.concealed import cases
from rotorid_proof.concealed.build import build

VEHICLES, EVERY_BROKEN, EVERY_INSTRUMENT = 40, 50, 25
FIRST_DAY = datetime.date(2026, 1, 5)
SECONDS, FLIGHTS, EVERY = 5.0, 2, 5
"""Two flights of 5 s, a sample every fifth step of 2 ms."""
INSTRUMENTS = "bench/single/*,stand/single/*,bench/clean/*,stand/clean/*"
VERDICTS = Path("results/fleet/verdicts")
HEADING = [
    "# A fleet",
    "",
    "`python benchmarks/fleet.py make DIR`, `snakemake --cores 1 fleet --config recordings=DIR`, "
    "`python benchmarks/fleet.py check DIR --out benchmarks/fleet.md`.",
    "",
]


def hidden(vehicle: int, day: int) -> list[dict]:
    """What a vehicle does on a day that its file does not say."""
    drag = {"id": "rotor_drag", "form": "at the hubs", "parameters": {"k_d": 6e-5 * (1.0 + 0.05 * day)}}
    payload = {"id": "payload", "form": "rigid", "parameters": {"m_p": 0.08, "m_p x": 0.002, "m_p y": 0.0}}
    lag = {"id": "motor_lag", "form": "one constant", "parameters": {"tau": 0.05}}
    off = {"id": "com_offset", "form": "moment", "parameters": {"r_x": 0.004, "r_y": -0.003}}
    return [[], [drag], [payload], [lag], [drag, lag], [off]][vehicle % 6]


def make(folder: Path, sets: int) -> None:
    """Write the sets, flights named by vehicle and day."""
    flights = sets - sets // EVERY_INSTRUMENT
    make_flights(folder, flights)
    offered = cases.matching(INSTRUMENTS)
    for k in range(sets - flights):
        case = offered[k * len(offered) // (sets - flights)]
        with tempfile.TemporaryDirectory() as answers:
            if not (folder / case.set_name / "vehicle.yaml").exists():
                build(case, folder, Path(answers))


def make_flights(folder: Path, sets: int) -> None:
    """Write the flights."""
    thesis = read("thesis")
    for number in range(sets):
        vehicle, day = number % VEHICLES, number // VEHICLES
        name = f"v{vehicle:02d}-{FIRST_DAY + datetime.timedelta(7 * day)}"
        if (folder / name / "vehicle.yaml").exists():
            continue
        flown = thesis.model_copy(update={"name": f"v{vehicle:02d}", "effects": tuple(hidden(vehicle, day))})
        recordings = swings(flown, name, SECONDS, FLIGHTS, seed=number, every=EVERY)
        write_set(recordings, folder)
        if number % EVERY_BROKEN == EVERY_BROKEN - 1:
            spoil(folder / name, number // EVERY_BROKEN % 4)


def spoil(folder: Path, way: int) -> None:
    """Break a set: a word for a number, a column too few, an empty run, a key that nobody knows."""
    vehicle = folder / "vehicle.yaml"
    run = sorted(p for p in folder.iterdir() if p != vehicle)[0]
    if way == 0:
        vehicle.write_text(vehicle.read_text().replace("mass_kg: 0.652", "mass_kg: heavy"))
    elif way == 1:
        vehicle.write_text(vehicle.read_text() + "colour: red\n")
    elif way == 2:
        run.write_bytes(b"")
    else:
        run.write_bytes(run.read_bytes()[: run.stat().st_size // 2])


def check(folder: Path, sample: int, verdicts: Path, out: Path | None, measured: list[str]) -> None:
    """Compare what the fleet says with what its sets say by themselves; exit code 1 where they differ."""
    names = sorted(p.parent.name for p in folder.glob("*/vehicle.yaml"))
    found = {p.name: p for p in verdicts.glob("*/*") if p.is_dir()}
    failed = {name for name, place in found.items() if (place / FAILED).is_file()}
    missing = [name for name in names if name not in found]
    print(f"{len(names)} sets, {len(found)} judged, {len(failed)} of them failed, {len(missing)} missing")
    wrong = list(missing)
    for name in random.Random(1).sample(names, min(sample, len(names))):
        with tempfile.TemporaryDirectory() as place:
            alone = Path(place)
            try:
                deliver(read_set(folder / name), alone)
            except InputError as error:
                same = json.loads((found[name] / FAILED).read_text())["reason"] == str(error)
            else:
                same = all((alone / n).read_bytes() == (found[name] / n).read_bytes() for n in FILES)
        wrong += [] if same else [name]
    alike = "all the same, byte by byte" if not wrong else "other than " + ", ".join(wrong)
    print(f"{sample} judged alone: {alike}")
    if out:
        rows = [("sets", len(names)), ("judged", len(found)), ("of them failed, as they should", len(failed))]
        rows += [(f"a sample of {sample} judged alone", alike), *(text.rsplit(": ", 1) for text in measured)]
        lines = [f"| {what} | {amount} |" for what, amount in rows]
        out.write_text("\n".join([*HEADING, "| what | measured |", "| --- | --- |", *lines, ""]))
    sys.exit(bool(wrong))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("make", "check"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--sets", type=int, default=1000)
    parser.add_argument("--sample", type=int, default=20)
    parser.add_argument("--verdicts", type=Path, default=VERDICTS)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--measured", nargs="*", default=[], help="further rows, 'what: amount'")
    given = parser.parse_args()
    if given.what == "make":
        make(given.folder, given.sets)
    else:
        check(given.folder, given.sample, given.verdicts, given.out, given.measured)
