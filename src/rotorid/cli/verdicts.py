"""`rotorid verdict`: what the believed vehicle leaves out, from a recording set or straight from logs."""

from __future__ import annotations

import time
import warnings
from pathlib import Path
from typing import Annotated

import typer

from rotorid.cli.console import one_sentence, progress
from rotorid.cli.importing import Like, MappingFile, MassKg, VehicleFile, make_set, tell
from rotorid.errors import InputError

FIXED_S, PER_SAMPLE_S, MOST_SAMPLES = 5.0, 1.2e-3, 300_000
"""What a flight costs on one core (benchmarks/mismatch.md): a fixed part, a part a sample, and where it levels off."""


def verdict(
    paths: Annotated[list[Path], typer.Argument(help="A recording set (folder with vehicle.yaml), or logs.")],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for the results; default NAME-verdict.")
    ] = None,
    mass_kg: MassKg = None,
    like: Like = None,
    vehicle: VehicleFile = None,
    mapping: MappingFile = None,
    series: Annotated[
        bool, typer.Option("--series", help="Also write series.parquet: recorded minus simulated, for PlotJuggler.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print verdict.json on standard output.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress.")] = False,
) -> None:
    """Say where a believed vehicle and its recordings part, why, and write a better vehicle.

    Writes `verdict.json`, `report.html` (open it in a browser) and `improved_vehicle.yaml`. Of logs a recording set is
    made first, as by `rotorid import`. A mismatch found is no error: the exit code is 0.

    Examples:

    `rotorid verdict flights`

    `rotorid verdict log.ulg --mass-kg 1.52 -o answer`
    """
    with one_sentence():
        start = time.monotonic()
        is_set = len(paths) == 1 and paths[0].is_dir()
        name = paths[0].resolve().name if is_set else paths[0].name.split(".")[0]
        target = out or Path(f"{name}-verdict")
        if is_set:
            folder = paths[0]
            if not (folder / "vehicle.yaml").is_file():
                raise InputError(_no_vehicle(folder))
        else:
            made = make_set(paths, target / name, mass_kg, like, vehicle, mapping)
            folder = made.folder
            if not quiet and not as_json:
                tell(made)
        text = deliver_set(folder, target, quiet, series)
        if as_json:
            typer.echo((target / "verdict.json").read_text(encoding="utf-8"), nl=False)
            return
        typer.echo(text)
        typer.echo(
            f"{target / 'report.html'} (and verdict.json, improved_vehicle.yaml, ledger.json), "
            f"{time.monotonic() - start:.0f} s"
        )


def deliver_set(folder: Path, target: Path, quiet: bool, series: bool = False) -> str:
    """Analyse the set in `folder`, write the files into `target`, and return the verdict's sentence.

    With `series` the residuals are written, too, as `series.parquet`.
    """
    from rotorid.recordings.tables import NO_PARQUET, parquet_is_here, write_table

    if series and not parquet_is_here():
        raise InputError(f"{target / 'series.parquet'}: {NO_PARQUET}")
    with progress(None, quiet) as step:
        step(f"reading {folder.name}")
        from rotorid.recordings import read_set

        recordings = read_set(folder)
        # The effects bring a compiler along, whose start takes seconds.
        from rotorid.mismatch.deliver import analysis_of, write_files

    samples = sum(len(run.table) for run in recordings.runs)
    expected = FIXED_S + PER_SAMPLE_S * min(samples, MOST_SAMPLES) if recordings.vehicle.kind == "flight" else None
    files = [target / n for n in ("verdict.json", "report.html", "improved_vehicle.yaml")]
    # What a module warns of goes to no log here; the verdict itself says what a reader must know.
    with progress(expected, quiet) as step, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        step(f"{recordings.name}: analysing {len(recordings.runs)} runs")
        analysis = analysis_of(recordings)
        # The last step told is the verdict's own sentence, which the caller prints.
        verdict = write_files(analysis, *files, progress=lambda text: None if text.endswith(".") else step(text))
        if series:
            from rotorid.result import residuals_of

            write_table(residuals_of(analysis), target / "series.parquet")
        return verdict.sentence


def _no_vehicle(folder: Path) -> str:
    """What to do about a folder without vehicle.yaml, by what is in it."""
    files = [p for p in folder.iterdir() if p.is_file()]
    near = next((p.name for p in files if p.suffix in (".yaml", ".yml") and "vehicle" in p.name.lower()), None)
    if near:
        return f"{folder}: vehicle.yaml is missing; is {near} meant to be it?"
    logs = [p.name for p in files if p.suffix.lower() in (".ulg", ".csv", ".mat", ".parquet", ".bin", ".bbl")]
    if logs:
        return (
            f"{folder}: vehicle.yaml is missing; make a set of logs by `rotorid import {folder / logs[0]} …`, or write "
            f"one by `rotorid init {folder}`"
        )
    return f"{folder}: no vehicle.yaml and no log in it; expected a recording set (a folder with vehicle.yaml and runs)"
