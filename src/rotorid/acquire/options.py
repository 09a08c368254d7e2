"""The options that all recording commands share, in one place."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, get_type_hints

import typer

from rotorid.io.session import Air

DEFAULT_OUT = Path("raw/local")


@dataclass(frozen=True)
class Shared:
    """Where a recording goes, what it is called, and what is seen meanwhile."""

    out: Annotated[Path, typer.Option(help="folder for the log and its metadata")] = DEFAULT_OUT
    name: Annotated[str | None, typer.Option("--id", help="name of the recording; default: instrument and time")] = None
    operator: Annotated[str | None, typer.Option(help="who records")] = None
    air: Annotated[str | None, typer.Option("--air", help="temperature °C, pressure Pa, humidity: 23,95400,0.5")] = None
    plot: Annotated[
        list[str] | None, typer.Option("--plot", help="also draw this column, e.g. cell_1_v; repeatable")
    ] = None
    limit: Annotated[
        list[str] | None,
        typer.Option("--limit", help="stop when a column leaves its range: battery_current_a:0:30; repeatable"),
    ] = None
    source: Annotated[
        str | None, typer.Option(help="instrument or emulator, where the device itself does not say it rightly")
    ] = None

    @property
    def weather(self) -> Air | None:
        """The air as metadata have it. Raises typer.BadParameter."""
        if self.air is None:
            return None
        try:
            temperature, pressure, humidity = (float(part) for part in self.air.split(","))
            return Air(temperature_c=temperature, pressure_pa=pressure, relative_humidity=humidity)
        except ValueError as error:
            raise typer.BadParameter(
                "--air is temperature in °C, pressure in Pa and humidity from 0 to 1, such as 23,95400,0.5"
            ) from error

    def limits(self, columns: list[str]) -> dict[str, tuple[float, float]]:
        """Ranges by column. Raises typer.BadParameter."""
        found = {}
        for text in self.limit or []:
            try:
                column, low, high = text.split(":")
                found[column] = (float(low), float(high))
            except ValueError as error:
                raise typer.BadParameter(
                    f"--limit is COLUMN:LOW:HIGH, such as battery_current_a:0:30, not {text!r}"
                ) from error
            if column not in columns:
                raise typer.BadParameter(f"--limit is for one of {', '.join(columns)}, not {column!r}")
        return found


def with_shared(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the shared options; it gets them as its argument `shared`."""
    hints = get_type_hints(command, include_extras=True)
    own = [
        parameter.replace(annotation=hints[name])
        for name, parameter in inspect.signature(command).parameters.items()
        if name != "shared"
    ]
    types = get_type_hints(Shared, include_extras=True)
    keyword = inspect.Parameter.KEYWORD_ONLY
    more = [inspect.Parameter(f.name, keyword, default=f.default, annotation=types[f.name]) for f in fields(Shared)]

    @functools.wraps(command)
    def wrapped(**given) -> None:
        shared = Shared(**{field.name: given.pop(field.name) for field in fields(Shared)})
        command(**given, shared=shared)

    parameters = [parameter.replace(kind=keyword) for parameter in own] + more
    wrapped.__signature__ = inspect.Signature(parameters)
    wrapped.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    del wrapped.__wrapped__  # its signature is not the one to look at
    return wrapped
