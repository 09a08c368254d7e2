"""`rotorid check`: what a recording set holds, what it lacks and what looks wrong."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from rotorid.cli.console import INTERRUPTED, one_sentence
from rotorid.errors import InputError


def check_no_log(path: Path) -> None:
    """InputError for a log, whether a file or the folder of a bag: a recording set is made of it first."""
    from rotorid.recordings.importers.logfile import format_of, is_bag

    if path.is_file() and (path.parent / "vehicle.yaml").is_file():
        raise InputError(f"{path}: is a file of a recording set; check the set: `rotorid check {path.parent}`")
    if is_bag(path) or path.is_file() and format_of(path):
        raise InputError(f"{path}: is a log, not a recording set; make a set of it first: `rotorid import {path}`")


def check(
    folder: Annotated[Path, typer.Argument(help="A recording set, or a folder of sets.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON in place of text.")] = False,
    renew: Annotated[
        bool, typer.Option("--renew", help="List the runs anew in manifest.json, after runs were changed by hand.")
    ] = False,
) -> None:
    """Say what a recording set contains, its rates and gaps, what it lacks and what cannot be right.

    Example: `rotorid check flights`
    """
    from rotorid.recordings import list_sets
    from rotorid.recordings.check import as_text, check_folder
    from rotorid.recordings.files import run_paths
    from rotorid.recordings.manifest import write_manifest

    with one_sentence():
        check_no_log(folder)
    is_set = (folder / "vehicle.yaml").is_file()
    folders = [folder] if is_set else [folder / name for name in list_sets(folder)] or [folder]
    failed = False
    results = []
    for number, path in enumerate(folders):
        try:
            with one_sentence():
                if renew:
                    write_manifest(path, run_paths(path))
                result = check_folder(path)
        except typer.Exit as end:
            if end.exit_code == INTERRUPTED:
                raise
            failed = True
            continue
        results.append(result.as_dict())
        if not as_json:
            typer.echo(("\n" if number else "") + as_text(result), nl=False)
    if as_json:
        typer.echo(json.dumps(results, indent=1))
    if failed:
        raise typer.Exit(1)
