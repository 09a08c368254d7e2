"""`rotorid parameters`: what a flight says of an autopilot's parameters."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rotorid.cli.console import one_sentence
from rotorid.cli.importing import Like, MappingFile, MassKg, VehicleFile

if TYPE_CHECKING:
    from rotorid.identify.autopilot.parameters import AutopilotParameter


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
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON in place of text.")] = False,
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
        from rotorid.identify.autopilot.parameters import as_text

        data = paths[0] if len(paths) == 1 else paths
        found = of(data, to, vehicle=vehicle, mass_kg=mass_kg, like=like, mapping=mapping)
        if out is not None:
            from rotorid.io.text.writing import all_or_none

            with all_or_none(out) as (part,):
                part.write_text(as_text(found, to), encoding="utf-8")
        if as_json:
            typer.echo(json.dumps([_as_dict(p) for p in found], indent=1, ensure_ascii=False, allow_nan=False))
            return
        for p in found:
            typer.echo(line(p))
        if out is not None:
            number = sum(p.to_set is not None for p in found)
            typer.echo(f"{out}: {number} parameter{'' if number == 1 else 's'} to load")


def line(p: AutopilotParameter) -> str:
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
