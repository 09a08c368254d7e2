"""New runs into a recording set that is there: nothing of it changes, and half of them is not taken for all."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from rotorid.errors import InputError
from rotorid.io.text.bounds import LARGEST_METADATA, MOST_RUNS
from rotorid.io.text.files import read_text
from rotorid.io.text.writing import take_place
from rotorid.recordings.files import run_files, run_name
from rotorid.recordings.importers.report import FILE_NAME as REPORT
from rotorid.recordings.importers.report import ImportReport
from rotorid.recordings.manifest import check_manifest, listed_runs, sha256, write_manifest


def add_to_set(staged: Sequence[Path], report: ImportReport, folder: Path) -> None:
    """Move staged files (a vehicle, runs) into the set `folder`.

    The set's list of runs is there before the first new run and names them after the last. Whoever is killed between
    the two leaves a set that readers refuse, and that the same import completes.

    Raises
    ------
    InputError
        A file that is there would change, a run would be there twice, or the set is not whole as it is.
    """
    names = {path.name for path in staged}
    there = run_files(folder)
    for path in staged:
        _check_place(path, folder, there)
    check_manifest(folder, there, ignored=names)
    runs = {path.name for path in there} | {name for name in names if run_name(Path(name))}
    if len(runs) > MOST_RUNS:
        raise InputError(
            f"{folder}: would have {len(runs)} runs, expected at most {MOST_RUNS}; make several sets of them"
        )
    report = _after(report, folder)
    if listed_runs(folder) is None:
        write_manifest(folder, there)
    for path in staged:
        if not (folder / path.name).exists():
            take_place(path, folder / path.name)
    report.write(staged[0].parent)
    take_place(staged[0].parent / REPORT, folder / REPORT)
    write_manifest(folder, [folder / name for name in runs])


def _check_place(path: Path, folder: Path, there: Sequence[Path]) -> None:
    """InputError where a staged file would change one that is there, or give a run a second file."""
    place = folder / path.name
    if place.exists() and sha256(place) != sha256(path):
        raise InputError(f"{place} is there already and would change; move it away, or choose another folder")
    name = run_name(path)
    same = next((p for p in there if name and run_name(p) == name and p.name != path.name), None)
    if same:
        raise InputError(f"{same} is there already, and {path.name} would be the same run again; move it away")


def _after(report: ImportReport, folder: Path) -> ImportReport:
    """The report together with the set's own, where it has one."""
    path = folder / REPORT
    if not path.exists():
        return report
    try:
        return report.after(json.loads(read_text(path, LARGEST_METADATA)))
    except (ValueError, KeyError, TypeError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: is no report of an import; move it away") from None
