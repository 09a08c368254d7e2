"""`rotorid compare`: what changed from one set of flights of a vehicle to another."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rotorid.cli.console import one_sentence, progress
from rotorid.errors import InputError

if TYPE_CHECKING:
    from rotorid.recordings import RecordingSet


def compare(
    base: Annotated[Path, typer.Argument(help="The recording set of the flights that were good.")],
    new: Annotated[Path, typer.Argument(help="The recording set of the flights in question.")],
    out: Annotated[Path | None, typer.Option("--out", "-o", help="File for the result as JSON.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON on standard output.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress.")] = False,
    ci: Annotated[bool, typer.Option("--ci", help="Exit code 1 where a change is stated (probability 0.99).")] = False,
) -> None:
    """Say what changed between two sets of flights of one vehicle, and by how much at most everything else.

    Both sets are held against their own vehicle.yaml: what was changed on purpose and is written there is no change.
    Not compared yet: the chain from command to rotor speed where speeds are not measured, and stands and benches.

    Examples:

    `rotorid compare flights-of-monday flights-of-friday`

    `rotorid compare reference today --ci`
    """
    with one_sentence():
        with progress(None, quiet) as step:
            step(f"reading {base.name} and {new.name}")
            first, second = flights(base), flights(new)
            from rotorid.mismatch.changes import changes_between, words

            step(f"comparing {second.name} with {first.name}")
            found = changes_between(first, second)
        text = json.dumps(words.as_json(found), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
        if out is not None:
            from rotorid.writing import all_or_none

            with all_or_none(out) as (part,):
                part.write_text(text, encoding="utf-8")
        if as_json:
            typer.echo(text, nl=False)
        else:
            for line in words.sentences(found):
                typer.echo(line)
    if ci and any(c.status in ("established", "ambiguous") for c in found.changes):
        raise typer.Exit(1)


def flights(folder: Path) -> RecordingSet:
    """The set in a folder; InputError where it is none of flights."""
    from rotorid.recordings import read_set

    found = read_set(folder)
    if found.vehicle.kind != "flight":
        raise InputError(
            f"{folder / 'vehicle.yaml'}: kind is {found.vehicle.kind}, expected flight: only flights compare"
        )
    return found
