"""`rotorid check`: what a recording set holds, what it lacks and what looks wrong."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from rotorid.cli.console import INTERRUPTED, one_sentence


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
