"""`rotorid history`: what changed in one vehicle over its flights, from a folder of logs or recording sets."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rotorid.cli.console import one_sentence, progress
from rotorid.cli.junit import as_junit
from rotorid.cli.sets import Like, MappingFile, MassKg, Quiet, Stated, VehicleFile, log_by_log
from rotorid.cli.verdicts import JunitFile
from rotorid.errors import InputError
from rotorid.io.text.writing import write_texts
from rotorid.steps import step

if TYPE_CHECKING:
    from rotorid.recordings import RecordingSet


def history(
    folder: Annotated[Path, typer.Argument(help="A folder of logs or recording sets, all of one vehicle.")],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for page and tables; default NAME-history.")
    ] = None,
    good: Annotated[int, typer.Option("--good", min=1, help="How many of the first sets are surely good.")] = 3,
    as_json: Annotated[bool, typer.Option("--json", help="Print the events as JSON.")] = False,
    junit: JunitFile = None,
    quiet: Quiet = False,
    ci: Annotated[bool, typer.Option("--ci", help="Exit code 1 where something changed.")] = False,
    mass_kg: MassKg = None,
    like: Like = None,
    vehicle: VehicleFile = None,
    mapping: MappingFile = None,
) -> None:
    """Say what changed in a vehicle over its flights, and from which on: trims, rotors, thrust, sensors, noise.

    The order is that of the days in the names (2026-10-05), then of the names. The first flights are the reference.
    Nothing is named as a cause; `rotorid compare` seeks one. Written are `history.html` with every quantity over the
    flights, `numbers.csv` and `events.csv`. A log or set that cannot be used is left out and named.

    Examples:

    `rotorid history logs-of-the-x500 --mass-kg 2.06`

    `rotorid history sets --good 5 --junit history.xml --ci`
    """
    with one_sentence():
        start, left_out = time.monotonic(), []
        with progress("history", quiet):
            from rotorid.report.fleet import history as history_of
            from rotorid.report.fleet import vehicle_page

            sets = _sets_in(folder, left_out, Stated(mass_kg, like, vehicle, mapping))
            if len(sets) <= good:
                for line in left_out:
                    typer.echo(f"! {line}", err=True)
                raise InputError(
                    f"{folder}: has {len(sets)} sets of flights that can be used, expected more than the {good} that "
                    "are taken as good (--good)"
                )
            name = folder.resolve().name
            with step("what differs"):
                numbers, events = history_of({name: sets}, good, left_out.append)
            if not len(numbers):
                raise InputError(
                    left_out[-1] if left_out else f"{folder}: no set after the first {good} can be compared"
                )
            with step("drawing"):
                target = out or Path(f"{name}-history")
                page = vehicle_page(name, numbers, events)
        texts = {
            target / "history.html": page,
            target / "numbers.csv": numbers.to_csv(index=False, float_format="%.6g"),
            target / "events.csv": events.to_csv(index=False, float_format="%.6g"),
        }
        compared = list(dict.fromkeys(numbers["set"]))
        if junit is not None:
            cases = {
                f"unchanged at {own}": events.loc[events["set"] == own, "sentence"].tolist() for own in compared[good:]
            }
            texts[junit] = as_junit(f"history {name}", cases, time.monotonic() - start)
        write_texts(texts)
        if as_json:
            said = {"sets": compared, "good": good, "events": events.to_dict("records"), "left_out": left_out}
            typer.echo(json.dumps(said, indent=1, ensure_ascii=False))
        else:
            for line in left_out:
                typer.echo(f"! {line}")
            for sentence in events["sentence"]:
                typer.echo(sentence)
            if not len(events):
                typer.echo(f"Nothing changed over {len(compared)} sets, from {compared[0]} to {compared[-1]}.")
            typer.echo(f"{target / 'history.html'} (and numbers.csv, events.csv), {time.monotonic() - start:.0f} s")
    if ci and len(events):
        raise typer.Exit(1)


def _sets_in(folder: Path, left_out: list[str], stated: Stated) -> list[RecordingSet]:
    """Sets and logs of a folder in the order they were flown; all logs get one vehicle. What cannot be used is said."""
    from rotorid.recordings import read_set
    from rotorid.recordings.files import VEHICLE, is_bag
    from rotorid.report.fleet import day_of

    if not folder.is_dir():
        raise InputError(f"{folder}: expected a folder of logs or recording sets")
    if (folder / VEHICLE).is_file():
        raise InputError(f"{folder}: is one recording set; expected a folder of several, or of logs")
    paths = [p for p in folder.iterdir() if not p.name.startswith(".")]
    out = []
    with log_by_log(stated) as made_of:
        for path in sorted(paths, key=lambda p: (day_of(p.name), p.name)):
            try:
                if not path.is_dir() or is_bag(path):
                    if path.suffix.lower() in (".md", ".txt", ".yaml", ".json", ".html", ".pdf"):
                        continue
                    with step("importing"):
                        found = made_of(path, path.name.split(".")[0]).recordings()
                elif (path / VEHICLE).is_file():
                    found = read_set(path)
                else:
                    continue
            except InputError as error:
                left_out.append(f"{path.name} is left out: {error}")
                continue
            if found.vehicle.kind == "flight":
                out.append(found)
    return out
