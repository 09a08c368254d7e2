"""`rotorid compare`: what changed from one set of a vehicle, a stand or a bench to another."""

from __future__ import annotations

import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

from rotorid.cli.console import one_sentence, progress
from rotorid.cli.importing import Like, MappingFile, MassKg, VehicleFile, make_set
from rotorid.errors import InputError
from rotorid.steps import step

if TYPE_CHECKING:
    from rotorid.recordings import RecordingSet


def compare(
    sets: Annotated[
        list[Path],
        typer.Argument(
            metavar="GOOD... NEW", help="Sets, or logs: one or more that were good, then the one in question."
        ),
    ],
    out: Annotated[Path | None, typer.Option("--out", "-o", help="File for the result as JSON.")] = None,
    page: Annotated[Path | None, typer.Option("--page", help="File for a page with figures (HTML).")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON on standard output.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress.")] = False,
    ci: Annotated[bool, typer.Option("--ci", help="Exit code 1 where a change is stated (probability 0.99).")] = False,
    mass_kg: MassKg = None,
    like: Like = None,
    vehicle: VehicleFile = None,
    mapping: MappingFile = None,
) -> None:
    """Say what differs from the sets that were good, then what changed, and by how much at most everything else.

    What differs is stated within seconds and without a cause: trims, each rotor's share of the thrust, sensors, noise.

    Flights of one vehicle, or recordings of one stand or bench: there the answer is whether to calibrate it again.
    Each set is held against its own vehicle.yaml: what was changed on purpose and is written there is no change. With
    three or more good flights their differences among themselves are the yardstick.
    A log is one flight; all logs get the same vehicle.yaml: that of --vehicle, or the one proposed for the first log.
    Not compared yet: what lies between command and rotor speed on a stand.

    Examples:

    `rotorid compare flights-of-monday flights-of-friday`

    `rotorid compare monday tuesday wednesday thursday`

    `rotorid compare reference today --ci --page changes.html`

    `rotorid compare bench-after-calibration bench-today`

    `rotorid compare good.ulg today.ulg --vehicle vehicle.yaml`
    """
    with one_sentence():
        if len(sets) < 2:
            raise InputError(
                f"{sets[0]}: nothing to compare it with; expected two sets or more, the last one in question"
            )
        with progress("compare: what differs", quiet):
            from rotorid.mismatch.changes.level_one import as_one, of_one_vehicle, seen_by
            from rotorid.mismatch.changes.level_one_words import level_one_sentences

            *known, second = of_one_vehicle(read(sets, mass_kg, like, vehicle, mapping))
            good = as_one(known)
            seen = seen_by(good, second)
        # What cannot be wrong comes first, and before the minutes that its explanation takes.
        if seen is not None and not as_json:
            for line in level_one_sentences(seen):
                typer.echo(line)
        with progress("compare", quiet), step("comparing"):
            from rotorid.mismatch.changes import words
            from rotorid.mismatch.changes.compare import changes_between

            found = changes_between(good, second, seen=seen)
        text = json.dumps(words.as_json(found), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
        if out is not None:
            write(out, text)
        if page is not None:
            from rotorid.report.page.changes import make_changes_page

            write(page, make_changes_page(found))
        if as_json:
            typer.echo(text, nl=False)
        else:
            for line in words.level_two_sentences(found):
                typer.echo(line)
    differs = found.level_1 is not None and bool(found.level_1.stated)
    if ci and (differs or any(c.status in ("established", "ambiguous") for c in found.changes)):
        raise typer.Exit(1)


def read(
    paths: list[Path],
    mass_kg: float | None = None,
    like: str | None = None,
    vehicle: Path | None = None,
    mapping: Path | None = None,
) -> list[RecordingSet]:
    """The sets of folders and logs, each log a set of its own; all logs have one vehicle.

    Raises
    ------
    InputError
        A path is neither.
    """
    from rotorid.recordings import read_set
    from rotorid.recordings.importers.logfile import is_bag

    out = []
    with TemporaryDirectory() as made:
        for path in paths:
            if path.is_dir() and not is_bag(path):
                out.append(read_set(path))
                continue
            folder = Path(made) / str(len(out)) / path.stem
            out.append(read_set(make_set([path], folder, mass_kg, like, vehicle, mapping).folder))
            vehicle, mass_kg, like = folder / "vehicle.yaml", None, None
        return out


def write(path: Path, text: str) -> None:
    """Write a file whole or not at all."""
    from rotorid.io.text.writing import all_or_none

    with all_or_none(path) as (part,):
        part.write_text(text, encoding="utf-8")
