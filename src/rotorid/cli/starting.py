"""`rotorid init`: a commented `vehicle.yaml` to start from.

`rotorid check`: what a recording set holds, what it lacks and what looks wrong.

`rotorid effects [ID]`: the catalogue of what may be found.
"""

from __future__ import annotations

import json
import math
import re
import sys
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated

import typer

from rotorid.cli.console import INTERRUPTED, one_sentence
from rotorid.cli.importing import MassKg
from rotorid.errors import InputError
from rotorid.io.text.wording import printable


def init(
    folder: Annotated[Path, typer.Argument(help="Folder of the recording set to be.")] = Path("."),
    like: Annotated[str | None, typer.Option("--like", help="Template vehicle; asked for where it is missing.")] = None,
    mass_kg: MassKg = None,
    name: Annotated[str | None, typer.Option(help="What the vehicle is called.")] = None,
    example: Annotated[
        bool, typer.Option("--example", help="Write a small set with two simulated flights to try things on.")
    ] = False,
    listing: Annotated[bool, typer.Option("--list", help="List the template vehicles and leave.")] = False,
) -> None:
    """Write a commented `vehicle.yaml` from a template vehicle.

    Examples:

    `rotorid init flights --like five-inch --mass-kg 0.71`

    `rotorid init flights --example`, a set to try things on
    """

    from rotorid.io.text.files import as_yaml, parse_yaml
    from rotorid.recordings import templates
    from rotorid.recordings.files import vehicle_of

    with one_sentence():
        if listing:
            for known in templates.names():
                vehicle = templates.read(known)
                typer.echo(f"{known:24} {vehicle.name}, {vehicle.mass_kg:g} kg")
            return
        if example:
            from rotorid.cli import examples

            written = examples.write(folder)
            typer.echo(f"{folder}: {', '.join(p.name for p in written)}. Next: `rotorid verdict {folder}`")
            return
        path = folder / "vehicle.yaml"
        if path.exists():
            raise InputError(f"{path} is there already; nothing was written")
        if like is None:
            if not sys.stdin.isatty():
                raise InputError(f"give --like with one of {', '.join(templates.names())}")
            like = typer.prompt(f"Which vehicle is closest ({', '.join(templates.names())})")
            name = name or typer.prompt("What is it called", default=templates.read(like).name)
            mass_kg = mass_kg or typer.prompt("Mass as flown, kg", default=templates.read(like).mass_kg, type=float)
        text = templates.text(like)
        if mass_kg is not None:
            if not 0 < mass_kg < math.inf:
                raise InputError(f"--mass-kg is {mass_kg:g}, expected a finite number of more than 0")
            text = re.sub(r"(?m)^mass_kg:.*$", lambda _: f"mass_kg: {as_yaml(mass_kg)}   # as you stated it", text)
        if name is not None:
            if not name.strip():
                raise InputError(f"--name is {name!r}, expected text")
            try:
                name.encode("utf-8")
            except UnicodeEncodeError:
                raise InputError(f"--name is '{printable(name)}', expected UTF-8 text") from None
            text = re.sub(r"(?m)^name:.*$", lambda _: f"name: {as_yaml(name)}", text)
        # What is written must be read again: a mass beyond the contract's bounds is refused here, not by `check`.
        vehicle_of(parse_yaml(text, str(path)), str(path))
        folder.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        typer.echo(
            f"{path}: written from template {like}. Put runs (CSV or Parquet, columns as in the recording contract) "
            f"next to it, then `rotorid check {folder}`"
        )


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
    from rotorid.recordings.files import run_paths, write_manifest
    from rotorid.recordings.importers.logfile import format_of, is_bag

    with one_sentence():
        if folder.is_file() and (folder.parent / "vehicle.yaml").is_file():
            said = f"is a file of a recording set; check the set: `rotorid check {folder.parent}`"
            raise InputError(f"{folder}: {said}")
        if is_bag(folder) or folder.is_file() and format_of(folder):
            said = f"is a log, not a recording set; make a set of it first: `rotorid import {folder}`"
            raise InputError(f"{folder}: {said}")
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


def effects(
    effect_id: Annotated[str | None, typer.Argument(metavar="[ID]", help="One effect in full.")] = None,
    as_markdown: Annotated[bool, typer.Option("--markdown", help="All in full, as a page of Markdown.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Ids with names and sentences as JSON.")] = False,
) -> None:
    """Print the catalogue of effects: a line each, or one with its equations, parameters, bounds and sources.

    Example: `rotorid effects rotor_drag`
    """
    # The effects bring their compiler along; the other commands start without it.
    from rotorid.effects import describe
    from rotorid.effects.catalogue import catalogue

    known = catalogue()
    if effect_id is not None and effect_id not in known:
        near = get_close_matches(effect_id, list(known), 1)
        meant = f"; did you mean {near[0]}?" if near else ";"
        typer.echo(f"rotorid: no effect is called {effect_id!r}{meant} `rotorid effects` lists them", err=True)
        raise typer.Exit(1)
    chosen = {effect_id: known[effect_id]} if effect_id else known
    if as_json:
        typer.echo(json.dumps({k: {"name": e.name, "sentence": e.sentence} for k, e in chosen.items()}, indent=1))
    elif as_markdown:
        typer.echo(describe.markdown(), nl=False)
    elif effect_id is None:
        typer.echo(describe.listing(), nl=False)
    else:
        typer.echo(describe.in_full(known[effect_id]), nl=False)
