"""Logs of the formats that there are importers for, as flights in contract columns and as a recording set.

Other people's readers are at work: with a limit on their memory where the system can (Linux), so that a packed log made
to unpack to anything ends as one sentence and not with the machine, and without what they print, a line for each byte
that they stumble over. What is wrong with a log is said once, by the importer.

New runs into a set that is there change nothing of it, and half of them is not taken for all.

The unit of recorded rotor speeds is checked by physics: in hover the rotors carry the weight. Logs name a unit and
write another (Gazebo puts rad/s into PX4's `esc_rpm`). The speeds at which rotors hover follow from the mass within a
third for vehicles from 27 g to 2 kg, or from a known thrust coefficient, while units are 6 to 60 apart.
"""

from __future__ import annotations

import importlib
import io
import os
import pkgutil
import sys
from collections.abc import Iterator, Sequence
from collections.abc import Mapping as Names
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field, replace
from functools import cache, partial
from importlib.metadata import entry_points
from pathlib import Path

import numpy as np
import pandas as pd

import rotorid.recordings.importers
from rotorid.errors import InputError
from rotorid.io.text.files import (
    LARGEST_FILE,
    LEAST_MEMORY,
    MEMORY_TIMES_FILE,
    MOST_RUNS,
    check_file,
    parse_yaml,
)
from rotorid.io.text.wording import printable
from rotorid.io.text.writing import only_writer, staging, take_name, take_place
from rotorid.recordings import RecordingSet, Run, read_vehicle, templates
from rotorid.recordings import columns as c
from rotorid.recordings.files import (
    VEHICLE,
    check_manifest,
    listed_runs,
    proposed_in,
    run_files,
    run_name,
    sha256,
    usable_runs,
    vehicle_of,
    write_manifest,
    write_runs,
)
from rotorid.recordings.importers.contract import Imported, Importer, text_of
from rotorid.recordings.importers.faults import FILE_NAME as REPORT
from rotorid.recordings.importers.faults import ImportFault, ImportReport
from rotorid.recordings.importers.known import propose, thrust_coefficient
from rotorid.recordings.importers.mapping import IMPORTER as TABLE
from rotorid.recordings.importers.mapping import UNITS, Mapping, read_table
from rotorid.recordings.settings import Settings, write_settings
from rotorid.recordings.tables import check_table
from rotorid.recordings.vehicle import Vehicle

_USUAL_COEFFICIENT = 1.7e-5
"""C_F / (mass of the vehicle a rotor)^(4/3), N s² kg^(-4/3): thrust grows with the fourth power of the size, mass with
its third. The templates (Crazyflie to x500) have 1.4e-5 to 2.1e-5."""
_IMPOSSIBLE = 3.5
"""Speeds of hover so many times off, or more, are not in the unit that is stated."""
_GROUP = "rotorid.importers"


@cache
def importers() -> dict[str, Importer]:
    """Every importer by name: `IMPORTER` of each module here, and the entry points of installed packages.

    InputError where an entry point is no importer, or has the name of another one.
    """
    found = {}
    for module in pkgutil.iter_modules(rotorid.recordings.importers.__path__):
        importer = getattr(importlib.import_module(f"rotorid.recordings.importers.{module.name}"), "IMPORTER", None)
        if importer is not None:
            found[importer.name] = importer
    for point in entry_points(group=_GROUP):
        importer, where = point.load(), f"entry point {point.value} of {_GROUP}"
        if not isinstance(importer, Importer):
            raise InputError(f"{where}: expected an Importer, not {type(importer).__name__}")
        if importer.name in found:
            raise InputError(f"{where}: an importer {importer.name} is there already; rename one of the two")
        found[importer.name] = importer
    return found


def importer_of(path: Path) -> Importer:
    """The importer that reads a log; InputError for what is none."""
    head = b""
    if not path.is_dir():
        check_file(path)
        with open(path, "rb") as file:
            head = file.read(4096)
        if not head:
            raise InputError(f"{path}: the file is empty")
    known = importers().values()
    if found := next((i for i in known if head.startswith(i.starts)), None):
        return found
    by_content = (i for i in known if i.recognises(path, head) or any(words in head for words in i.inside))
    if found := next(by_content, None):
        return found
    if path.is_dir():
        raise InputError(f"{path}: expected a log, found a folder (that of a ROS 2 bag has a metadata.yaml)")
    if not text_of(head):
        raise InputError(
            f"{path}: not a log that rotorid knows ({', '.join(i.title for i in known)}); its first bytes are "
            + head[:8].hex(" ")
        )
    return TABLE


def read_log(path: Path, mapping: Mapping | None = None) -> Imported:
    """Every flight in a log; InputError in one sentence where the file holds none."""
    path = Path(path)
    importer = importer_of(path)
    if not importer.any_size and (size := path.stat().st_size) > LARGEST_FILE:
        raise InputError(f"{path}: has {size / 1e6:.0f} MB, expected at most {LARGEST_FILE / 1e6:.0f} MB")
    try:
        with _limited(path), _silent():
            mapped = mapping is not None and importer.by_mapping
            found = read_table(path, mapping) if mapped else importer.read(path)
    except InputError as error:
        said = printable(error)  # it may quote what stands in the file
        raise InputError(said if said.startswith(str(path)) else f"{path}: {said}") from None
    return replace(found, format=importer.name)


@contextmanager
def _limited(path: Path) -> Iterator[None]:
    """Inside, memory beyond the limit for this file is an InputError; nothing is limited where the system cannot."""
    try:
        import resource

        said = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    except (ImportError, OSError):  # pragma: no cover - depends on the platform
        yield
        return
    # Bytes that count against the limit already; None where the system does not say.
    taken = next((int(line.split()[1]) * 1024 for line in said if line.startswith("VmData:")), None)
    size = path.stat().st_size if path.is_file() else sum(p.stat().st_size for p in path.rglob("*") if p.is_file())
    more = max(LEAST_MEMORY, MEMORY_TIMES_FILE * size)
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    if taken is None or (soft != resource.RLIM_INFINITY and soft <= taken + more):
        yield
        return
    resource.setrlimit(resource.RLIMIT_DATA, (taken + more, hard))
    try:
        yield
    except MemoryError:
        raise InputError(
            f"{path}: reading it takes more than {more / 1e6:.0f} MB of memory, far more than a log of its size does"
        ) from None
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))


@contextmanager
def _silent() -> Iterator[None]:
    """Inside, nothing reaches the screen, not even from compiled code."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = [os.dup(number) for number in (1, 2)]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for number in (1, 2):
            os.dup2(nowhere, number)
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            yield
    finally:
        for number, own in zip((1, 2), kept, strict=True):
            os.dup2(own, number)
            os.close(own)
        os.close(nowhere)


def usual_coefficient(mass_kg: float, rotors: int) -> float:
    """C_F of a multirotor of usual propellers, N s²."""
    return _USUAL_COEFFICIENT * (mass_kg / rotors) ** (4 / 3)


def in_unit_of_weight(
    runs: Names[str, pd.DataFrame],
    stated: Names[str, str],
    mass_kg: float,
    rotors: int,
    coefficient_n_s2: float | None = None,
) -> tuple[dict[str, pd.DataFrame], list[ImportFault]]:
    """Flights whose rotor speeds are in the unit that carries the weight, and what was changed.

    It is the stated one where its speeds are possible, or no other's are.
    `runs` are in contract columns, rotor speeds by the unit that the log states: `stated` has it for each run (`rad/s`,
    `rpm` or `hz`). The mass is as flown; C_F is that of usual propellers where it is not known.
    """
    possible = 2.2  # Speeds of hover within this factor are.
    expected = coefficient_n_s2 or usual_coefficient(mass_kg, rotors)
    out, faults = dict(runs), []
    for written in dict.fromkeys(stated[run] for run in runs):
        mine = [run for run in runs if stated[run] == written]
        for kind in ("rotor_speed", "rotor_command"):
            names = list(c.rotor_columns(kind, rotors))
            tables = [out[run] for run in mine]
            flown = thrust_coefficient(tables, mass_kg, rotors, kind=kind)
            # Speed of hover in the unit that is stated, over the one expected.
            off = 1.0 if flown is None else float(np.sqrt(expected / flown))
            if 1 / _IMPOSSIBLE < off < _IMPOSSIBLE:
                continue
            factors = {u: f / UNITS["rotor"][written] for u, f in UNITS["rotor"].items() if u != written}
            unit = min(factors, key=lambda u, off=off, factors=factors: abs(np.log(off * factors[u])))
            hover = f"the rotors hover at {off:.2g} times the speed that carries {mass_kg:.3g} kg"
            samples = sum(len(t) for t in tables)
            if abs(np.log(off * factors[unit])) >= np.log(possible):
                found = (
                    f"in {written}, as stated, {hover}, which no unit explains: electrical turns (divide by "
                    "half of the motor's poles), or another vehicle"
                )
                faults.append(ImportFault("unit", kind, found, "kept as recorded", samples))
                continue
            for run in mine:
                if set(names) <= set(out[run].columns):
                    out[run] = out[run].assign(**{name: out[run][name] * factors[unit] for name in names})
            found = f"in {written}, as the log states, {hover}, in {unit} at {off * factors[unit]:.2g} times"
            faults.append(ImportFault("unit", kind, found, f"taken as {unit}", samples))
    return out, faults


@dataclass(frozen=True)
class SetOfLogs:
    """What logs of one vehicle hold, before it is written anywhere."""

    name: str
    runs: Names[str, pd.DataFrame]
    """To the name of a run its table in contract columns."""
    vehicle_text: str
    """The `vehicle.yaml`, comments and all."""
    remarks: tuple[str, ...] = ()
    """One sentence for each value that is proposed, not known."""
    faults: tuple[ImportFault, ...] = ()
    """What was found in the logs."""
    axes: str = ""
    files: Names[str, str] = field(default_factory=dict)
    """To the name of a log its SHA-256."""
    kept_vehicle: bool = False
    """Whether the vehicle's text is that of a file which stays as it is."""
    settings: Names[str, Settings] = field(default_factory=dict)
    """To the name of a log the parameters of its autopilot."""

    @property
    def sentences(self) -> tuple[str, ...]:
        """The faults in words, each once."""
        return tuple(fault.sentence for fault in self.faults)

    def recordings(self) -> RecordingSet:
        """The set without files of its own, as `write` and `read_set` would give it."""
        believed = vehicle_of(parse_yaml(self.vehicle_text, "the vehicle"), "the vehicle")
        runs = tuple(Run(name, table) for name, table in sorted(self.runs.items()))
        return RecordingSet(self.name, believed, runs, proposed=proposed_in(self.vehicle_text))

    def write(self, folder: Path, as_csv: bool = False) -> None:
        """Write `vehicle.yaml` (unless it was there and is kept), a file a run, a report and the list of the runs.

        All of it or nothing: it is written aside and takes its name in one step. A set that is there already gets the
        new runs next to its own; until all are there its list says that it is not whole. Runs are Parquet files; plain
        CSV where wished, and .csv.gz where pyarrow is not installed.

        InputError where something that is there already would change, OSError where the disk is full.
        """
        files = dict(self.files)
        report = ImportReport(
            folder.name, True, ", ".join(files), "", "", "", files, self.axes, self.faults, self.remarks
        )
        if folder.is_dir():
            with staging(folder / "import") as part, only_writer(folder):
                _add_to_set(self._write_files(part, as_csv), report, folder)
                write_settings(folder, self.settings)
        else:
            with staging(folder) as part:
                files = self._write_files(part, as_csv)
                write_manifest(part, [path for path in files if path.name != VEHICLE])
                report.write(part)
                write_settings(part, self.settings)
                take_name(part, folder)

    def _write_files(self, folder: Path, as_csv: bool) -> list[Path]:
        """Write the vehicle, unless it is kept, and the runs; returns their files."""
        vehicle = [] if self.kept_vehicle else [folder / VEHICLE]
        for path in vehicle:
            path.write_text(self.vehicle_text, encoding="utf-8")
        return [*vehicle, *write_runs(self.runs, folder, ".csv" if as_csv else "")]


def set_of_logs(
    logs: Sequence[Path],
    name: str,
    mass_kg: float | None = None,
    like: str | None = None,
    vehicle_file: Path | None = None,
    mapping: Mapping | None = None,
    there: Path | None = None,
) -> SetOfLogs:
    """The flights in `logs` (or runs of a stand), all of one vehicle, and what is known or proposed of it.

    `vehicle_file` is taken as it is, in place of a proposal. So is `there`, a `vehicle.yaml` that may be there already,
    where neither the mass as flown nor the template vehicle for what the logs do not say (`like`) is given. `mapping`
    says what the columns of a CSV or Parquet file are.

    InputError where a log cannot be read or holds no flight, the logs do not belong together, nothing says what vehicle
    it is, or `there` exists and would change.
    """
    if len(logs) > MOST_RUNS:
        raise InputError(f"{len(logs)} logs were given, expected at most {MOST_RUNS}; make several sets of them")
    found = [read_log(path, mapping) for path in logs]
    kinds = {f.kind for f in found}
    if len(kinds) > 1:
        raise InputError(f"the logs are of different kinds ({', '.join(sorted(kinds))}); import each kind by itself")
    runs: dict[str, pd.DataFrame] = {}
    for path, imported in zip(logs, found, strict=True):
        for run, table in imported.runs.items():
            if run in runs:
                raise InputError(f"{path}: another log has a run called {run}, too; rename one of the files")
            runs[run] = table
    readers = (partial(lambda n, t: Run(n, check_table(t, f"run {n}")), run, table) for run, table in runs.items())
    usable, left_out = usable_runs(readers, logs[0].name)
    runs = {run.name: run.table for run in usable}
    faults = [fault for imported in found for fault in imported.faults]
    units = {run: imported.speed_unit for imported in found for run in imported.runs}
    remarks: tuple[str, ...] = ()
    kept = False
    if vehicle_file is not None:
        vehicle = read_vehicle(vehicle_file)
        text = vehicle_file.read_text(encoding="utf-8")
    elif there is not None and there.is_file() and mass_kg is None and like is None:
        vehicle = read_vehicle(there)
        text, kept = there.read_text(encoding="utf-8"), True
    else:
        if kinds != {"flight"}:
            raise InputError(f"{logs[0]}: a log of a {kinds.pop()} needs --vehicle vehicle.yaml")
        # The template of the log's autopilot, else of its format.
        known_as = (importers().get(name) for name in (found[0].known.autopilot, found[0].format))
        template = like or next((importer.template for importer in known_as if importer and importer.template), "")
        if not template:
            raise InputError(
                f"{logs[0]}: nothing says what vehicle this is; give --vehicle vehicle.yaml, or --like with one of "
                f"{', '.join(templates.names())} and --mass-kg"
            )
        vehicle = templates.read(template)
        mass = mass_kg or vehicle.mass_kg
        rotors = len(found[0].known.rotors or found[0].known.directions or vehicle.rotors)
        runs, changed = in_unit_of_weight(runs, units, mass, rotors)
        faults += changed
        text, remarks = propose(name, list(runs.values()), found[0].known, vehicle, template, mass_kg)
        if there is not None and there.is_file() and there.read_text(encoding="utf-8") != text:
            raise InputError(f"{there} is there already and would change; move it away, or leave --mass-kg and --like")
    stated = vehicle_file is not None or kept
    proposed = "the vehicle proposed"
    _check_rotors(runs, vehicle if stated else vehicle_of(parse_yaml(text, proposed), proposed), logs[0])
    if kinds == {"flight"} and stated:
        known = float(np.mean(vehicle.thrust_coefficients_n_s2()))
        runs, changed = in_unit_of_weight(runs, units, vehicle.mass_kg, vehicle.rotor_count, known)
        faults += changed
    if kinds == {"stand"} and all(f.unsigned_torque for f in found):
        runs, changed = _signed_by_spin(runs, vehicle)
        faults += changed
    return SetOfLogs(
        name,
        runs,
        text,
        (*remarks, *left_out),
        tuple(dict.fromkeys(faults)),
        axes=found[0].axes,
        files={name: sha256(file) for path in logs for name, file in _files_of(path).items()},
        kept_vehicle=kept,
        settings={path.name: imported.settings for path, imported in zip(logs, found, strict=True)},
    )


def _signed_by_spin(
    runs: Names[str, pd.DataFrame], vehicle: Vehicle
) -> tuple[Names[str, pd.DataFrame], list[ImportFault]]:
    """Runs of a stand whose torque has the sign that the stated spin of the rotor gives it.

    A rotor that turns ccw pushes its mount to positive z.
    """
    mine = [name for name, table in runs.items() if c.MOMENT[2] in table]
    spin = vehicle.rotors[0].spin if vehicle.rotors else "ccw"
    if not mine:
        return runs, []
    sign = 1.0 if spin == "ccw" else -1.0
    found = "an export does not say which way its torque counts"
    done = f"its sign is that of a rotor that turns {spin}, as the vehicle's file states"
    signed = {name: runs[name].assign(**{c.MOMENT[2]: sign * runs[name][c.MOMENT[2]]}) for name in mine}
    return {**runs, **signed}, [ImportFault("sign", c.MOMENT[2], found, done)]


def _files_of(path: Path) -> dict[str, Path]:
    """The files of a log by name: itself, or all that lie in the folder of a bag."""
    if not path.is_dir():
        return {path.name: path}
    return {f"{path.resolve().name}/{p.name}": p for p in sorted(path.iterdir()) if p.is_file()}


def _check_rotors(runs: Names[str, pd.DataFrame], vehicle: Vehicle, log: Path) -> None:
    """InputError where a log drives more rotors than the vehicle has: without them its thrust would be short."""
    numbers = [found[1] for table in runs.values() for name in table if (found := c.rotor_number(name))]
    if vehicle.kind != "bench" and max(numbers, default=0) > vehicle.rotor_count:
        raise InputError(
            f"{log}: the log drives {max(numbers)} rotors, the vehicle has {vehicle.rotor_count}; "
            f"give --vehicle with a vehicle.yaml of {max(numbers)} rotors"
        )


def _add_to_set(staged: Sequence[Path], report: ImportReport, folder: Path) -> None:
    """Move staged files (a vehicle, runs) into the set `folder`.

    The set's list of runs is there before the first new run and names them after the last. Whoever is killed between
    the two leaves a set that readers refuse, and that the same import completes.

    InputError where a file that is there would change, a run would be there twice, or the set is not whole as it is.
    """
    names = {path.name for path in staged}
    there = run_files(folder)
    for path in staged:
        place, name = folder / path.name, run_name(path)
        if place.exists() and sha256(place) != sha256(path):
            raise InputError(f"{place} is there already and would change; move it away, or choose another folder")
        same = next((p for p in there if name and run_name(p) == name and p.name != path.name), None)
        if same:
            raise InputError(f"{same} is there already, and {path.name} would be the same run again; move it away")
    check_manifest(folder, there, ignored=names)
    runs = {path.name for path in there} | {name for name in names if run_name(Path(name))}
    if len(runs) > MOST_RUNS:
        raise InputError(
            f"{folder}: would have {len(runs)} runs, expected at most {MOST_RUNS}; make several sets of them"
        )
    report = report.after(folder)
    if listed_runs(folder) is None:
        write_manifest(folder, there)
    for path in staged:
        if not (folder / path.name).exists():
            take_place(path, folder / path.name)
    report.write(staged[0].parent)
    take_place(staged[0].parent / REPORT, folder / REPORT)
    write_manifest(folder, [folder / name for name in runs])
