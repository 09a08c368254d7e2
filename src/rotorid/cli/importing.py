"""`rotorid import`: logs of flight controllers and tables of one's own as a recording set."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rotorid.cli.console import one_sentence
from rotorid.errors import InputError

if TYPE_CHECKING:
    from rotorid.recordings.importers.logfile import SetOfLogs

Like = Annotated[
    str | None,
    typer.Option("--like", help="Template vehicle for what the log does not say; `rotorid init --list` lists them."),
]
MassKg = Annotated[float | None, typer.Option("--mass-kg", help="Mass of the vehicle as flown, with battery, kg.")]
VehicleFile = Annotated[
    Path | None, typer.Option("--vehicle", help="A vehicle.yaml to take as it is, in place of a proposal.")
]
MappingFile = Annotated[Path | None, typer.Option("--mapping", help="What the columns of a CSV or Parquet file are.")]


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
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON in place of text.")] = False,
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
        made = make_set(logs, folder, mass_kg, like, vehicle, mapping, as_csv)
        from rotorid.recordings.sufficient import LEAST_SINGLE_S

        durations, refused = _contents(folder)
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
        print_notes(made, folder)
        if refused:
            typer.echo(f"`rotorid verdict {folder}` will refuse the set: {refused}")
            if len(durations) == 1 and max(durations.values()) < LEAST_SINGLE_S:
                typer.echo(f"Next: add another flight of this vehicle: `rotorid import LOG -o {folder}`")
        else:
            typer.echo(f"Next: look through {folder / 'vehicle.yaml'}, then `rotorid verdict {folder}`")


def _write_mapping(logs: list[Path], target: Path, as_json: bool) -> None:
    from rotorid.recordings.importers.guessing.guess import as_text, guess
    from rotorid.recordings.importers.logfile import format_of
    from rotorid.recordings.importers.mapping import read_columns

    if target.exists():
        raise InputError(f"{target} is there already; choose another name")
    if format_of(logs[0]) not in ("csv", "parquet"):
        raise InputError(f"{logs[0]}: its columns are known, no mapping is needed")
    found = guess(read_columns(logs[0]))
    target.write_text(as_text(found, logs[0].name), encoding="utf-8")
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


def make_set(
    logs: list[Path],
    folder: Path,
    mass_kg: float | None = None,
    like: str | None = None,
    vehicle_file: Path | None = None,
    mapping_file: Path | None = None,
    as_csv: bool = False,
) -> SetOfLogs:
    """Write the set `folder` of logs of one vehicle; a `vehicle.yaml` that is there already stays."""
    from rotorid.recordings.importers.logfile import set_of_logs
    from rotorid.recordings.importers.mapping import read_mapping

    mapping = read_mapping(mapping_file) if mapping_file else None
    found = set_of_logs(logs, folder.name, mass_kg, like, vehicle_file, mapping, folder / "vehicle.yaml")
    found.write(folder, as_csv)
    return found


def print_notes(made: SetOfLogs, folder: Path) -> None:
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


def _contents(folder: Path) -> tuple[dict[str, float], str]:
    """To the runs of a set their lengths, s, and why `rotorid verdict` would refuse the set; empty where it would not.

    The very look that the verdict has first: a single flight must be long enough to hold out a part of it.
    """
    from rotorid.recordings import read_set
    from rotorid.recordings.check import check_run
    from rotorid.recordings.sufficient import sufficient

    recordings = read_set(folder)
    durations = {check.name: check.duration_s for check in map(check_run, recordings.runs)}
    try:
        sufficient(recordings)
    except InputError as error:
        return durations, str(error)
    return durations, ""
