"""Command line for people: `rotorid check DIR`, `rotorid effects [ID]`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from rotorid.errors import InputError
from rotorid.recordings import list_sets
from rotorid.recordings.check import as_text, check_folder

app = typer.Typer(add_completion=False, no_args_is_help=True, help="From logs to a quadrotor model.")


@app.callback()
def main() -> None:
    """From instrument logs to a quadrotor model."""


@app.command()
def check(
    folder: Annotated[Path, typer.Argument(help="A recording set, or a folder of sets.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON in place of text.")] = False,
) -> None:
    """Say what a recording set contains, its rates and gaps, and what it lacks."""
    is_set = (folder / "vehicle.yaml").is_file()
    folders = [folder] if is_set else [folder / name for name in list_sets(folder)] or [folder]
    failed = False
    results = []
    for number, path in enumerate(folders):
        try:
            result = check_folder(path)
        except InputError as error:
            typer.echo(f"{error}", err=True)
            failed = True
            continue
        results.append(result.as_dict())
        if not as_json:
            typer.echo(("\n" if number else "") + as_text(result), nl=False)
    if as_json:
        typer.echo(json.dumps(results, indent=1))
    if failed:
        raise typer.Exit(1)


@app.command()
def effects(
    effect_id: Annotated[str | None, typer.Argument(metavar="[ID]", help="One effect in full.")] = None,
    as_markdown: Annotated[bool, typer.Option("--markdown", help="The page docs/effects.md.")] = False,
) -> None:
    """Print the catalogue of effects: a line each, or one with its equations, parameters, bounds and sources."""
    # The effects bring their compiler along; the other commands start without it.
    from rotorid.effects import describe
    from rotorid.effects.catalogue import catalogue

    if as_markdown:
        typer.echo(describe.markdown(), nl=False)
    elif effect_id is None:
        typer.echo(describe.listing(), nl=False)
    elif effect_id in catalogue():
        typer.echo(describe.in_full(catalogue()[effect_id]), nl=False)
    else:
        typer.echo(f"no effect is called {effect_id!r}; `rotorid effects` lists them", err=True)
        raise typer.Exit(1)
