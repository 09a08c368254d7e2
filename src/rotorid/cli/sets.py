"""Recording sets: `rotorid init` begins one, `rotorid import` makes one of logs, `rotorid check` looks through it.

`rotorid effects [ID]`: the catalogue of what may be found.
"""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

from rotorid.cli.console import INTERRUPTED, one_sentence
from rotorid.errors import InputError
from rotorid.io.text.wording import printable
from rotorid.io.text.writing import write_texts

if TYPE_CHECKING:
    from rotorid.recordings.importers.logfile import SetOfLogs
    from rotorid.recordings.importers.mapping import Mapping

Like = Annotated[
    str | None,
    typer.Option("--like", help="Template vehicle for what the log does not say; `rotorid init --list` lists them."),
]
MassKg = Annotated[float | None, typer.Option("--mass-kg", help="Mass of the vehicle as flown, with battery, kg.")]
VehicleFile = Annotated[
    Path | None, typer.Option("--vehicle", help="A vehicle.yaml to take as it is, in place of a proposal.")
]
MappingFile = Annotated[Path | None, typer.Option("--mapping", help="What the columns of a CSV or Parquet file are.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON in place of text.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress.")]


def import_logs(
    logs: Annotated[list[Path], typer.Argument(help="Logs of one vehicle: PX4 .ulg, ROS bag (file or folder), CSV, …")],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", help="Folder of the set; default: the first log's name (of a bag's folder NAME-set)."
        ),
    ] = None,
    mass_kg: MassKg = None,
    like: Like = None,
    vehicle: VehicleFile = None,
    mapping: MappingFile = None,
    write_mapping: Annotated[
        Path | None, typer.Option(help="Look at a CSV or Parquet file, write what its columns seem to be, and stop.")
    ] = None,
    as_csv: Annotated[bool, typer.Option("--csv", help="Write runs as CSV in place of Parquet.")] = False,
    as_json: AsJson = False,
) -> None:
    """Turn logs of one vehicle into a recording set: a folder with a run a flight and a `vehicle.yaml`.

    Only the part in the air is kept. What the logs do not say of the vehicle is proposed and marked as a proposal.

    Examples:

    `rotorid import log_1.ulg log_2.ulg --mass-kg 1.52 -o flights`

    `rotorid import flight.csv --write-mapping mapping.yaml`, then
    `rotorid import flight.csv --mapping mapping.yaml --like five-inch --mass-kg 0.7`
    """
    with one_sentence():
        if write_mapping is not None:
            _write_mapping(logs, write_mapping, as_json)
            return
        # `flight` of flight.ulg, `flight-set` of the bag in the folder flight
        name, is_folder = (logs[0].resolve().name, True) if logs[0].is_dir() else (logs[0].name, False)
        folder = out or Path((name.split(".")[0] or "flights") + "-set" * is_folder)
        made = make_set(logs, folder, Stated(mass_kg, like, vehicle, mapping), as_csv)
        from rotorid.recordings import read_set
        from rotorid.recordings.check import check_run
        from rotorid.recordings.sufficient import LEAST_SINGLE_S, sufficient

        recordings, refused = read_set(folder), ""
        durations = {check.name: check.duration_s for check in map(check_run, recordings.runs)}
        try:  # the very look that the verdict has first: a single flight must be long enough to hold out a part of it
            sufficient(recordings)
        except InputError as error:
            refused = str(error)
        if as_json:
            said = {
                "set": str(folder),
                "runs": [{"name": name, "duration_s": round(seconds, 6)} for name, seconds in durations.items()],
                "found": list(made.sentences),
                "proposed": list(made.remarks),
                "kept_vehicle": made.kept_vehicle,
                "verdict_refuses": refused or None,
            }
            typer.echo(json.dumps(said, indent=1, ensure_ascii=False))
            return
        word = "run" if len(durations) == 1 else "runs"
        typer.echo(f"{folder}: {len(durations)} {word}, {sum(durations.values()):.0f} s, {', '.join(durations)}")
        _print_notes(made, folder)
        if refused:
            typer.echo(f"`rotorid verdict {folder}` will refuse the set: {refused}")
            if len(durations) == 1 and max(durations.values()) < LEAST_SINGLE_S:
                typer.echo(f"Next: add another flight of this vehicle: `rotorid import LOG -o {folder}`")
        else:
            typer.echo(f"Next: look through {folder / 'vehicle.yaml'}, then `rotorid verdict {folder}`")


def _write_mapping(logs: list[Path], target: Path, as_json: bool) -> None:
    from rotorid.recordings.importers.guessing import as_text, guess
    from rotorid.recordings.importers.logfile import importer_of
    from rotorid.recordings.importers.mapping import read_columns

    if target.exists():
        raise InputError(f"{target} is there already; choose another name")
    if importer_of(logs[0]).name != "table":
        raise InputError(f"{logs[0]}: its columns are known, no mapping is needed")
    found = guess(read_columns(logs[0]))
    write_texts({target: as_text(found, logs[0].name)})
    channels = found.mapping.channels
    if as_json:
        said = {
            "mapping": str(target),
            "channels": list(channels),
            "evidence": found.evidence,
            "open": found.open,
            "left_out": found.left_out,
        }
        typer.echo(json.dumps(said, indent=1, ensure_ascii=False))
        return
    typer.echo(f"{target}: {len(channels)} channels recognised ({', '.join(channels)})")
    for name, why in found.evidence.items():
        typer.echo(f"  - {name}: {why}")
    for sentence in found.left_out:
        typer.echo(f"  - {sentence}")
    for name, question in found.open.items():
        typer.echo(f"  ? {name}: {question}")
    first = f"answer what is open ('?') in it ({', '.join(found.open)})" if found.open else "look through it"
    typer.echo(f"Next: {first}, then `rotorid import {logs[0]} --mapping {target} --like NAME --mass-kg KG`")


@dataclass(frozen=True)
class Stated:
    """What is stated of the vehicle whose logs are given; what is not is proposed."""

    mass_kg: float | None = None
    like: str | None = None
    """A template vehicle."""
    vehicle: Path | None = None
    """A `vehicle.yaml`, in place of mass and template."""
    mapping: Path | None = None
    """What the columns of a table are."""

    def columns(self) -> Mapping | None:
        """The mapping's content."""
        from rotorid.recordings.importers.mapping import read_mapping

        return read_mapping(self.mapping) if self.mapping else None


@contextmanager
def log_by_log(stated: Stated) -> Iterator[Callable[[Path, str], SetOfLogs]]:
    """A function that makes a set of one log, by its path and a name; all have one vehicle, that of the first log."""
    from rotorid.recordings.importers.logfile import set_of_logs

    vehicle, columns = stated.vehicle, stated.columns()
    with TemporaryDirectory() as folder:

        def made_of(path: Path, name: str) -> SetOfLogs:
            nonlocal vehicle
            found = set_of_logs([path], name, stated.mass_kg, stated.like, vehicle, columns)
            if vehicle is None:
                vehicle = Path(folder) / "vehicle.yaml"
                vehicle.write_text(found.vehicle_text, encoding="utf-8")
            return found

        yield made_of


def make_set(logs: list[Path], folder: Path, stated: Stated, as_csv: bool = False) -> SetOfLogs:
    """Write the set `folder` of logs of one vehicle; a `vehicle.yaml` that is there already stays."""
    from rotorid.recordings.importers.logfile import set_of_logs

    there, columns = folder / "vehicle.yaml", stated.columns()
    found = set_of_logs(logs, folder.name, stated.mass_kg, stated.like, stated.vehicle, columns, there)
    found.write(folder, as_csv)
    return found


def set_of(paths: list[Path], is_set: bool, target: Path, quiet: bool, stated: Stated) -> Path:
    """The folder of a set: the one that is given, or below `target` one made of logs."""
    if is_set:
        return paths[0]
    folder = target / name_of(paths[0])
    made = make_set(paths, folder, stated)
    if not quiet:
        _print_notes(made, folder)
    return folder


def name_of(path: Path) -> str:
    """What is made of a set or log is called after it."""
    return path.resolve().name if path.is_dir() else path.name.split(".")[0]


def _print_notes(made: SetOfLogs, folder: Path) -> None:
    """Print what was found in the logs and what is only proposed."""
    if made.sentences:
        typer.echo("Found in the logs:")
        for sentence in made.sentences:
            typer.echo(f"  - {sentence}")
    if made.kept_vehicle:
        typer.echo(f"{folder / 'vehicle.yaml'} was there and stays as it is.")
    if made.remarks:
        typer.echo("Proposed, not measured (marked PROPOSED in vehicle.yaml):")
        for remark in made.remarks:
            typer.echo(f"  - {remark}")


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
        write_texts({path: text})
        typer.echo(
            f"{path}: written from template {like}. Put runs (CSV or Parquet, columns as in the recording contract) "
            f"next to it, then `rotorid check {folder}`"
        )


def check(
    folder: Annotated[Path, typer.Argument(help="A recording set, or a folder of sets.")],
    as_json: AsJson = False,
    renew: Annotated[
        bool, typer.Option("--renew", help="List the runs anew in manifest.json, after runs were changed by hand.")
    ] = False,
) -> None:
    """Say what a recording set contains, its rates and gaps, what it lacks and what cannot be right.

    Example: `rotorid check flights`
    """
    from rotorid.recordings import list_sets
    from rotorid.recordings.check import as_text, check_folder
    from rotorid.recordings.files import is_bag, run_paths, write_manifest
    from rotorid.recordings.importers.logfile import importer_of

    with one_sentence():
        if folder.is_file() and (folder.parent / "vehicle.yaml").is_file():
            said = f"is a file of a recording set; check the set: `rotorid check {folder.parent}`"
            raise InputError(f"{folder}: {said}")
        if is_bag(folder) or folder.is_file() and importer_of(folder):
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
