"""A vehicle in a simulator.

- `rotorid model`: from logs to a vehicle in a simulator, in one go.
- `rotorid export`: the identified vehicle in the forms that other tools know.
- `rotorid simulate`: a flight of a vehicle with every effect its file states.
- `rotorid parameters`: what a flight says of an autopilot's parameters.
"""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rotorid.cli.console import one_sentence, progress
from rotorid.cli.sets import AsJson, Like, MappingFile, MassKg, Quiet, Stated, VehicleFile, name_of, set_of
from rotorid.errors import InputError
from rotorid.io.text.writing import copy_together, staging, write_texts
from rotorid.steps import step

if TYPE_CHECKING:
    from rotorid.identify.autopilot import AutopilotParameter
    from rotorid.recordings import Vehicle


def model(
    paths: Annotated[list[Path], typer.Argument(metavar="SET|LOG", help="A recording set, or logs of one vehicle.")],
    to: Annotated[
        str, typer.Option("--to", help="px4-sih, sdf, ardupilot-json, mjcf, rotorpy, gym-pybullet-drones or crazyflow.")
    ],
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Folder for all of it; default NAME-FORM.")] = None,
    mass_kg: MassKg = None,
    like: Like = None,
    vehicle: VehicleFile = None,
    mapping: MappingFile = None,
    quiet: Quiet = False,
) -> None:
    """Identify a vehicle from its logs and write it for a simulator, flown next to the log.

    Imports the logs, judges them, takes the improved vehicle and writes it in the form of a simulator, with what the
    form cannot express. The exported vehicle is then flown on the log's own rotor speeds in windows of half a second:
    `next_to_log.csv` and `next_to_log.png` say how far it is off. The verdict's files lie in the same folder.

    Examples:

    `rotorid model flight.ulg --mass-kg 1.52 --to px4-sih -o sih`

    `rotorid model flights --to sdf`
    """
    with one_sentence():
        from rotorid.report.next_to_log import FLYERS

        if to not in FLYERS:
            raise InputError(f"no simulator is called {to!r}, expected one of {', '.join(FLYERS)}")
        from rotorid.recordings.files import is_bag

        is_set = len(paths) == 1 and (paths[0] / "vehicle.yaml").is_file() and not is_bag(paths[0])
        target = out or Path(f"{name_of(paths[0])}-{to}")
        folder = set_of(paths, is_set, target, quiet, Stated(mass_kg, like, vehicle, mapping))
        written, said = _write_model(folder, target, to, quiet)
        for sentence in said:
            typer.echo(sentence)
        typer.echo(", ".join(str(path) for path in written))


def _write_model(folder: Path, target: Path, to: str, quiet: bool) -> tuple[list[Path], list[str]]:
    """Judge the set in `folder`, write verdict, export and comparison into `target`; the files, and what to say."""
    with progress("model", quiet), warnings.catch_warnings(), staging(target / "model") as aside:
        warnings.simplefilter("ignore")
        from rotorid.recordings import read_set

        recordings = read_set(folder)
        from rotorid.recordings import read_vehicle
        from rotorid.report.deliver import FILES, OTHERS, analysis_of, write_files
        from rotorid.report.next_to_log import next_to_log
        from rotorid.report.plots.next_to_log import draw
        from rotorid.vehicle.exports import export_vehicle
        from rotorid.vehicle.exports.autopilots import gazebo_airframe

        analysis = analysis_of(recordings)
        verdict = write_files(analysis, aside)
        improved = read_vehicle(aside / FILES[2])
        exported = gazebo_airframe(improved) if to == "sdf" else export_vehicle(improved, to)
        texts = {exported.file_name: exported.text, **exported.companions}
        write_texts({aside / name: text for name, text in texts.items()})
        written = list(texts)
        said = [verdict.sentence, *(f"! {doubt.sentence}" for doubt in verdict.doubts)]
        said += [f"  - not expressed: {sentence}" for sentence in exported.left_out]
        try:
            with step("flying it next to the log"):
                found = next_to_log(analysis, to, exported)
            found.table().to_csv(aside / "next_to_log.csv", index=False)
            draw(found, aside / "next_to_log.png")
            written += ["next_to_log.csv", "next_to_log.png"]
            first, *rest = found.sentences()
            said += [first, *(f"  - {sentence}" for sentence in rest)]
        except InputError as error:
            said.append(f"not flown next to the log: {error}")
        copy_together(aside, target, FILES[0], OTHERS)
        return [target / name for name in written], said


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
    from rotorid.vehicle.control import remarks, swings, turned_over

    for sentence in remarks(vehicle):
        say(sentence)
    flown = swings(vehicle, folder.name, seconds, flights, seed)
    for sentence in turned_over(flown):
        say(sentence)
    return write_set(flown, folder.parent)


def export(
    vehicle_file: Annotated[Path, typer.Argument(metavar="VEHICLE", help="vehicle.yaml or improved_vehicle.yaml.")],
    to: Annotated[
        str,
        typer.Option(
            "--to", help="rotorpy, mjcf, sdf, gym-pybullet-drones, px4, px4-sih, ardupilot-json or crazyflow."
        ),
    ],
    out: Annotated[Path | None, typer.Option("--out", "-o", help="File to write; default by the form.")] = None,
) -> None:
    """Write the vehicle, with its effects as far as the form knows them, for another tool.

    What the form cannot express is named, on the screen and in the file. Derivatives that the tool can add in its own
    step are a further file next to it. Where the tool is installed the vehicle is flown there and compared with ours
    first: a file that the tool does not read is not written.

    Example: `rotorid export flights-verdict/improved_vehicle.yaml --to rotorpy`
    """
    with one_sentence():
        from rotorid.recordings import read_vehicle
        from rotorid.vehicle.exports import export_vehicle
        from rotorid.vehicle.exports.flown import try_out

        vehicle = read_vehicle(vehicle_file)
        exported = export_vehicle(vehicle, to)
        flown = try_out(vehicle, to, exported)
        path = out or Path(exported.file_name)
        texts = {path: exported.text} | {path.parent / name: text for name, text in exported.companions.items()}
        write_texts(texts)
        for written in texts:
            typer.echo(f"{written}: written for {to}")
        for sentence in exported.left_out:
            typer.echo(f"  - not expressed: {sentence}")
        if flown:
            typer.echo(f"  {flown}")


def parameters(
    paths: Annotated[list[Path], typer.Argument(metavar="SET|LOG", help="A recording set, or logs of one vehicle.")],
    to: Annotated[str, typer.Option("--to", help="px4, ardupilot, betaflight or crazyflie.")],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File that the autopilot's tools load; default none.")
    ] = None,
    mass_kg: MassKg = None,
    like: Like = None,
    vehicle: VehicleFile = None,
    mapping: MappingFile = None,
    as_json: AsJson = False,
) -> None:
    """State what flights determine of an autopilot's parameters, each with its 95 % interval, and write a file to load.

    Thrust curve (PX4 THR_MDL_FAC; ArduPilot MOT_THST_EXPO, MOT_SPIN_MIN; Betaflight thrust_linear; the Crazyflie's
    volts a gram), hover, lag of the motors, and for PX4 drag jointly with the wind (EKF2_BCOEF_X, EKF2_BCOEF_Y,
    EKF2_MCOEF). What the flights do not determine is not set, and said. A log needs no verdict first.

    Examples:

    `rotorid parameters flight.ulg --to px4 -o flight.params`

    `rotorid parameters flights --to ardupilot`
    """
    with one_sentence():
        from rotorid.api import parameters as of
        from rotorid.identify.autopilot import as_text

        data = paths[0] if len(paths) == 1 else paths
        found = of(data, to, vehicle=vehicle, mass_kg=mass_kg, like=like, mapping=mapping)
        if out is not None:
            write_texts({out: as_text(found, to)})
        if as_json:
            typer.echo(json.dumps([_as_dict(p) for p in found], indent=1, ensure_ascii=False, allow_nan=False))
            return
        for p in found:
            typer.echo(_line(p))
        if out is not None:
            number = sum(p.to_set is not None for p in found)
            typer.echo(f"{out}: {number} parameter{'' if number == 1 else 's'} to load")


def _line(p: AutopilotParameter) -> str:
    """`NAME = value [low, high] unit: sentence`; the sentence alone where nothing was estimated."""
    if math.isnan(p.value):
        return f"{p.name}: {p.sentence}"
    low, high = (_number(end, p.decimals) for end in p.interval_95)
    return f"{p.name} = {_number(p.value, p.decimals)} [{low}, {high}]{' ' + p.unit if p.unit else ''}: {p.sentence}"


def _number(value: float, decimals: int) -> str:
    return f"{value:.{decimals}f}" if math.isfinite(value) else ("∞" if value > 0 else "−∞")


def _as_dict(p: AutopilotParameter) -> dict:
    def plain(x: float) -> float | None:
        return x if math.isfinite(x) else None

    return {
        "name": p.name, "value": plain(p.value), "interval_95": [plain(x) for x in p.interval_95], "unit": p.unit,
        "determined": p.determined, "to_set": p.to_set, "sentence": p.sentence,
    }  # fmt: skip
