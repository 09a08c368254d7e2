"""`rotorid simulate`: a flight of a vehicle with every effect its file states."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rotorid.cli.console import one_sentence
from rotorid.errors import InputError

if TYPE_CHECKING:
    from rotorid.recordings import Vehicle


def simulate(
    vehicle_file: Annotated[Path, typer.Argument(metavar="VEHICLE", help="vehicle.yaml or improved_vehicle.yaml.")],
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Folder of the set; default NAME-simulated.")] = None,
    seconds: Annotated[float, typer.Option(help="Length of each flight, s.")] = 20.0,
    flights: Annotated[int, typer.Option(help="Number of flights; two or more let one be held out.")] = 2,
    seed: Annotated[int, typer.Option(help="Seed of the sensors' noise.")] = 1,
) -> None:
    """Fly a vehicle, with the effects its file states, and write the flights as a recording set.

    The vehicle swings in roll and pitch about hover under an attitude controller; sensors are noisy. The set's own
    vehicle.yaml is the one without the effects, so that `rotorid verdict` has something to find. What cannot be flown
    as the file says is named.

    Example: `rotorid simulate flights-verdict/improved_vehicle.yaml -o simulated`
    """
    with one_sentence():
        from rotorid.recordings import read_vehicle

        vehicle = read_vehicle(vehicle_file)
        folder = out or Path(f"{vehicle_file.resolve().parent.name}-simulated")
        if (folder / "vehicle.yaml").exists():
            raise InputError(f"{folder / 'vehicle.yaml'} is there already; choose another folder with -o")
        written = fly(vehicle, folder, seconds, flights, seed, lambda sentence: typer.echo(f"  - {sentence}"))
        typer.echo(f"{written}: {flights} flights of {seconds:g} s. Next: `rotorid verdict {written}`")


def fly(
    vehicle: Vehicle,
    folder: Path,
    seconds: float,
    flights: int,
    seed: int,
    say: Callable[[str], None] = lambda sentence: None,
) -> Path:
    """Write `flights` simulated flights of a vehicle as the set `folder`; `say` takes what a reader must know."""
    from rotorid.recordings import write_set
    from rotorid.vehicle.control.swings import remarks, swings, turned_over

    for sentence in remarks(vehicle):
        say(sentence)
    flown = swings(vehicle, folder.name, seconds, flights, seed)
    for sentence in turned_over(flown):
        say(sentence)
    return write_set(flown, folder.parent)
