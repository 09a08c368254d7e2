"""`rotorid export`: the identified vehicle in the forms that other tools know."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rotorid.cli.console import one_sentence


def export(
    vehicle_file: Annotated[Path, typer.Argument(metavar="VEHICLE", help="vehicle.yaml or improved_vehicle.yaml.")],
    to: Annotated[
        str, typer.Option("--to", help="rotorpy, mjcf, sdf, gym-pybullet-drones, px4, px4-sih or ardupilot-json.")
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
        from rotorid.io.text.writing import all_or_none
        from rotorid.recordings import read_vehicle
        from rotorid.vehicle.exports import export_vehicle
        from rotorid.vehicle.exports.flown import try_out

        vehicle = read_vehicle(vehicle_file)
        exported = export_vehicle(vehicle, to)
        flown = try_out(vehicle, to, exported)
        path = out or Path(exported.file_name)
        texts = {path: exported.text} | {path.parent / name: text for name, text in exported.companions.items()}
        with all_or_none(*texts) as parts:
            for part, text in zip(parts, texts.values(), strict=True):
                part.write_text(text, encoding="utf-8")
        for written in texts:
            typer.echo(f"{written}: written for {to}")
        for sentence in exported.left_out:
            typer.echo(f"  - not expressed: {sentence}")
        if flown:
            typer.echo(f"  {flown}")
