"""Reading and writing recording sets: `vehicle.yaml`, runs (CSV, CSV.gz, Parquet), `split.yaml` and `manifest.json`.

The last is the list of a set's runs with their SHA-256, which `rotorid import` leaves in the set. A set without it is
what its files are. Where there is one, a run that is missing, changed or not listed is said, so that half an import is
not taken for a whole one.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import yaml
from pydantic import ValidationError

from rotorid.errors import InputError
from rotorid.io.text.files import MOST_CELLS, MOST_RUNS, check_file, read_text, read_yaml, with_exponents
from rotorid.io.text.wording import explain, hint, listed, neighbour, printable
from rotorid.io.text.writing import only_writer, staging, take_name, take_place, write_texts
from rotorid.recordings import columns as c
from rotorid.recordings.run import Doubt, RecordingSet, Run
from rotorid.recordings.tables import (
    UnusableRun,
    check_table,
    numbers,
    parquet_is_here,
    read_cells,
    write_table,
)
from rotorid.recordings.vehicle import Vehicle

FILE_NAME = "manifest.json"
_TRUSTED = (
    "mass_kg",
    "thrust_coefficient_n_s2",
    "torque_coefficient_n_m_s2",
    "inertia_kg_m2",
    *(f"inertia_{axis}{unit}" for axis in ("xx", "yy", "zz") for unit in ("_kg_m2", "")),
    "arm_scale",
    "rotor_speed_limits_rad_s",
    "reading_gain",
    *(f"reading_gain_{axis}" for axis in "xyz"),
)
"""Names that `trust` may give a one-sigma of."""
NO_BODY = 1.25
"""A principal moment is at most the sum of the others; an inertia believed may be wrong by this factor."""
_LINE = re.compile(r"^(?P<key>\w+):.*?#\s*PROPOSED:?\s*(?P<why>.*)$")
RUN_SUFFIXES = (".csv", ".csv.gz", ".parquet")
VEHICLE, _SPLIT = "vehicle.yaml", "split.yaml"


def read_vehicle(path: Path) -> Vehicle:
    """Read `vehicle.yaml`; InputError in one sentence if it does not fit the contract."""
    path = Path(path)
    if not path.exists() and not path.is_symlink() and path.parent.is_dir():
        near = _misnamed(path)
        if near:
            raise InputError(f"{path}: file is missing; did you mean {printable(near)}?")
    return vehicle_of(read_yaml(path), str(path))


def vehicle_of(content: dict, where: str) -> Vehicle:
    """The vehicle that the keys of a `vehicle.yaml` state; InputError names the key that is wrong."""
    content = {k: v if k in ("name", "kind") else with_exponents(_plain(v)) for k, v in content.items()}
    if isinstance(content.get("name"), (int, float)) and not isinstance(content["name"], bool):
        content["name"] = str(content["name"])
    try:
        return Vehicle.model_validate({str(key): value for key, value in content.items()})
    except ValidationError as error:
        raise InputError(f"{where}: {explain(error, Vehicle)}") from None


def _misnamed(path: Path) -> str | None:
    """A file next to this one whose name differs in its case or in `.yml`."""
    wanted = (path.name.lower(), path.with_suffix(".yml").name.lower())
    there = sorted(p.name for p in path.parent.iterdir() if p.name != path.name)
    return next((name for name in there if name.lower() in wanted), None)


def _plain(value):
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    return value.item() if isinstance(value, np.generic) else value


def write_vehicle(vehicle: Vehicle, path: Path) -> None:
    """Write `vehicle.yaml`, leaving out what the vehicle does not state."""
    content = _plain(vehicle.model_dump(exclude_defaults=True))
    text = yaml.safe_dump(content, sort_keys=False, allow_unicode=True, default_flow_style=None)
    path.write_text(text, encoding="utf-8")


def run_name(path: Path) -> str | None:
    """Name of the run that a file holds, None if the file is no run."""
    return next((path.name.removesuffix(end) for end in RUN_SUFFIXES if path.name.endswith(end)), None)


def read_run(path: Path) -> Run:
    """Read one run; InputError names file, line and column of a fault."""
    path = Path(path)
    name = run_name(path)
    if name is None:
        raise InputError(f"{path}: expected one of {', '.join(RUN_SUFFIXES)}")
    check_file(path)
    return Run(name, check_table(numbers(read_cells(path), path), str(path)), str(path))


def run_paths(folder: Path) -> list[Path]:
    """Files of the runs of a set, in the order of their names; InputError where there is none, or as `run_files`."""
    paths = run_files(folder)
    if not paths:
        raise InputError(f"{folder}: no run found, expected files ending in {', '.join(RUN_SUFFIXES)}")
    return paths


def run_files(folder: Path) -> list[Path]:
    """The same of a folder that may have none; InputError for a name that cannot be a run's, and for too many runs."""
    paths = []
    for path in sorted(folder.iterdir()):
        if path.name.startswith("."):  # what systems and editors leave behind
            continue
        if not path.name.isprintable():
            raise InputError(
                f"{folder}: the name of file {printable(path.name)} holds a line break or control character"
            )
        if run_name(path):
            paths.append(path)
        elif run_name(Path(path.name.lower())):
            raise InputError(f"{path}: expected its ending in small letters ({', '.join(RUN_SUFFIXES)})")
    if len(paths) > MOST_RUNS:
        raise InputError(f"{folder}: has {len(paths)} runs, expected at most {MOST_RUNS}; make several sets of them")
    paths.sort(key=lambda p: run_name(p))
    for first, second in zip(paths, paths[1:], strict=False):
        if run_name(first) == run_name(second):
            raise InputError(f"{folder}: run {run_name(first)} is there twice ({first.name}, {second.name})")
    return paths


def _read_split(path: Path, names: list[str]) -> tuple[str, ...]:
    """Runs that `split.yaml` holds out, each one of `names`."""
    content = read_yaml(path, as_written=True)
    for key in content:
        if key != "held_out":
            raise InputError(f"{path}: {printable(key)}: no such key is known{hint(str(key), ['held_out'])}")
    held_out = content.get("held_out")
    if not isinstance(held_out, list):
        what = printable(held_out) if isinstance(held_out, str) and held_out else "nothing" if not held_out else "keys"
        raise InputError(f"{path}: held_out: found {what}, expected a list of runs: [{names[-1]}]")
    if not held_out:
        raise InputError(f"{path}: held_out: names no run, expected at least one (or no {_SPLIT})")
    for number, name in enumerate(held_out):
        if not isinstance(name, str):
            raise InputError(f"{path}: held_out: found a list or keys, expected names of runs")
        if name not in names:
            near = hint(run_name(Path(name)) or name, names)
            raise InputError(f"{path}: held_out names run {printable(name)}, which is not in the set{near}")
        if name in held_out[:number]:
            raise InputError(f"{path}: held_out names run {name} twice")
    if len(held_out) == len(names):
        raise InputError(f"{path}: every run is held out, none is left to fit")
    return tuple(held_out)


def check_rotors(run: Run, vehicle: Vehicle) -> None:
    """InputError where a run has a column of a rotor that the vehicle does not list."""
    for column in run.table.columns:
        rotor = c.rotor_number(column)
        if not rotor or vehicle.kind == "bench" or 1 <= rotor[1] <= vehicle.rotor_count:
            continue
        if rotor[1] < 1:
            raise InputError(f"{run.path or run.name}, column {column}: rotors are numbered from 1")
        raise InputError(f"{run.path or run.name}, column {column}: {VEHICLE} lists {vehicle.rotor_count} rotors only")


def usable_runs(readers: Iterable[Callable[[], Run]], where: object) -> tuple[tuple[Run, ...], tuple[str, ...]]:
    """The runs that can be used, and one sentence for each that cannot; `where` names the set.

    InputError where a run is no table, none can be used, or together they are larger than any recording.
    """
    runs: list[Run] = []
    left_out: list[UnusableRun] = []
    for read in readers:
        try:
            runs.append(read())
        except UnusableRun as error:
            left_out.append(error)
        cells = sum(run.table.size for run in runs)
        if cells > MOST_CELLS:
            raise InputError(f"{where}: {len(runs)} of its runs have {cells} cells, expected at most {MOST_CELLS}")
    if not runs:
        raise left_out[-1]
    return tuple(runs), tuple(f"Left out: {error}." for error in left_out)


def read_set(folder: Path) -> RecordingSet:
    """Read a recording set; InputError in one sentence if anything in it does not fit the contract."""
    folder = Path(folder)
    if not folder.name.isprintable():
        raise InputError(f"{printable(folder)}: the folder's name holds a line break or control character")
    if not folder.is_dir():
        raise InputError(f"{folder}: no such recording set (folder){neighbour(folder)}")
    vehicle = read_vehicle(folder / VEHICLE)
    check_belief(vehicle, str(folder / VEHICLE))
    paths = run_paths(folder)
    check_manifest(folder, paths)
    runs, left_out = usable_runs((partial(read_run, path) for path in paths), folder)
    for run in runs:
        check_rotors(run, vehicle)
    held_out = None
    split = folder / _SPLIT
    if split.exists() or split.is_symlink():
        held_out = _read_split(split, [run_name(p) for p in paths])
    elif near := _misnamed(split):
        raise InputError(f"{folder / near}: expected the name {_SPLIT}")
    proposed = proposed_in(read_text(folder / VEHICLE))
    return RecordingSet(folder.name, vehicle, runs, held_out, str(folder), left_out, proposed)


def write_set(recordings: RecordingSet, parent: Path, suffix: str = "") -> Path:
    """Write a set below `parent`, all of it or nothing where its folder is new; returns the folder.

    `suffix` is one of RUN_SUFFIXES, by default .parquet, and .csv.gz where pyarrow is not installed.
    """
    folder = Path(parent) / recordings.name
    if folder.is_dir():
        with staging(folder / "set") as part, only_writer(folder):
            for path in _write_files(recordings, part, suffix):
                take_place(path, folder / path.name)
    else:
        with staging(folder) as part:
            _write_files(recordings, part, suffix)
            take_name(part, folder)
    return folder


def _write_files(recordings: RecordingSet, folder: Path, suffix: str) -> list[Path]:
    """Write the files of a set; returns them."""
    written = [folder / VEHICLE]
    write_vehicle(recordings.vehicle, written[0])
    written += write_runs({run.name: run.table for run in recordings.runs}, folder, suffix)
    if recordings.held_out is not None:
        written.append(folder / _SPLIT)
        written[-1].write_text(yaml.safe_dump({"held_out": list(recordings.held_out)}), encoding="utf-8")
    return written


def write_runs(tables: Mapping[str, pd.DataFrame], folder: Path, suffix: str = "") -> list[Path]:
    """Write the tables of runs by name, and return their files; `suffix` as in `write_set`."""
    suffix = suffix or (".parquet" if parquet_is_here() else ".csv.gz")
    paths = [folder / f"{name}{suffix}" for name in tables]
    for table, path in zip(tables.values(), paths, strict=True):
        write_table(table, path)
    return paths


def list_sets(parent: Path) -> list[str]:
    """Names of the recording sets below a folder, sorted; a hidden one is what a writer that was killed left behind."""
    parent = Path(parent)
    if not parent.is_dir():
        return []
    return sorted(p.name for p in parent.iterdir() if (p / VEHICLE).is_file() and not p.name.startswith("."))


def proposed_in(text: str) -> tuple[Doubt, ...]:
    """A doubt for each value that the text of a `vehicle.yaml` marks as proposed, in the order of the file."""
    found = (_LINE.match(line) for line in text.splitlines())
    whys = ((m["key"], m["why"].strip().rstrip(".")) for m in found if m)
    return tuple(Doubt(k, f"{k} is only proposed{f' ({why})' if why else ''}.") for k, why in whys)


def check_belief(vehicle: Vehicle, where: str) -> None:
    """InputError in one sentence for what no vehicle of a recording set can be; `where` names its file."""
    one_spot_m = 1e-4
    for key in ("effects", "derivatives", "reading_gain"):
        if getattr(vehicle, key):
            raise InputError(
                f"{where}: {key}: belongs in improved_vehicle.yaml, which the simulator runs; a recording is compared "
                f"with a believed vehicle without {key}"
            )
    for key in vehicle.trust:
        if key not in _TRUSTED:
            raise InputError(f"{where}: trust.{key}: no such value is known{hint(key, _TRUSTED)}")
    hubs, spins = vehicle.rotor_positions_m(), vehicle.yaw_signs()
    for first in range(len(hubs)):
        # Two that turn against each other are coaxial: autopilots leave the distance between them out.
        near = np.linalg.norm(hubs[first + 1 :] - hubs[first], axis=1) < one_spot_m
        near = np.flatnonzero(near & (spins[first + 1 :] == spins[first]))
        if len(near):
            spot = listed([f"{name} {value:g} m" for name, value in zip("xyz", hubs[first], strict=True)])
            raise InputError(
                f"{where}: rotors {first + 1} and {first + 2 + near[0]} are on one spot ({spot}) and turn the same way"
            )
    if vehicle.inertia_kg_m2 is not None:
        least, middle, largest = np.linalg.eigvalsh(vehicle.inertia_kg_m2.matrix())
        if largest > NO_BODY * (least + middle):
            raise InputError(
                f"{where}: inertia_kg_m2: found principal moments {least:.3g}, {middle:.3g} and {largest:.3g}; no body "
                "has one that is larger than the sum of the others"
            )


def sha256(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def write_manifest(folder: Path, paths: Iterable[Path]) -> None:
    """Write the list of a set's runs, whole or not at all; `paths` are their files."""
    runs = {path.name: sha256(path) for path in sorted(paths)}
    write_texts({folder / FILE_NAME: json.dumps({"runs": runs}, indent=1, ensure_ascii=False) + "\n"})


def listed_runs(folder: Path) -> Mapping[str, str] | None:
    """SHA-256 by the name of a run's file, None where the set has no list; InputError where it cannot be read."""
    path = folder / FILE_NAME
    if not path.exists() and not path.is_symlink():
        return None
    try:
        runs = json.loads(read_text(path))["runs"]
        if all(isinstance(digest, str) for digest in runs.values()):
            return runs
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
    raise InputError(f"{path}: is no list of runs{_renewed(folder)}")


def check_manifest(folder: Path, paths: Iterable[Path], ignored: Collection[str] = ()) -> None:
    """InputError where the set's runs are not those that its list holds; `ignored` files may be what they like."""
    listed = listed_runs(folder)
    if listed is None:
        return
    there = {path.name: path for path in paths if path.name not in ignored}
    faults = [f"run {name} is missing" for name in listed if name not in there and name not in ignored]
    faults += [f"run {name} is not listed" for name in there if name not in listed]
    faults += [f"run {name} was changed" for name in there if name in listed and sha256(there[name]) != listed[name]]
    if faults:
        more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
        raise InputError(
            f"{folder}: by {FILE_NAME}, {printable(faults[0])}{more}: an import that was stopped, or a change by hand"
            f"{_renewed(folder)}"
        )


def _renewed(folder: Path) -> str:
    """What to do about it, to end a sentence with."""
    return (
        f"; import again, or where the runs are as they should be, list them anew by `rotorid check {folder} --renew`"
    )


def is_bag(path: Path) -> bool:
    """Whether a path is the folder of a ROS 2 bag (`metadata.yaml` next to its .db3 or .mcap), and no recording set."""
    return (path / "metadata.yaml").is_file() and not (path / "vehicle.yaml").is_file()
