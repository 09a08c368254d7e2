"""`rotorid effects [ID]`: the catalogue of what may be found."""

from __future__ import annotations

import json
from difflib import get_close_matches
from typing import Annotated

import typer


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
