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
    """Say what changed since the sets that were good, and by how much at most everything else.

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
        with progress("compare", quiet):
            from rotorid.mismatch.changes import as_one, changes_between, words

            *known, second = read(sets, mass_kg, like, vehicle, mapping)
            with step("comparing"):
                found = changes_between(as_one(known), second)
        text = json.dumps(words.as_json(found), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
        if out is not None:
            write(out, text)
        if page is not None:
            from rotorid.report.page.changes import make_changes_page

            write(page, make_changes_page(found))
        if as_json:
            typer.echo(text, nl=False)
        else:
            for line in words.sentences(found):
                typer.echo(line)
    if ci and any(c.status in ("established", "ambiguous") for c in found.changes):
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
