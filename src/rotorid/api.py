"""The library for a script or notebook: tables, logs or a folder in, objects out.

`rotorid` itself offers the names of this module. Units and columns are those of the recording contract; what does not
fit raises `rotorid.InputError`, whose message is one sentence that names file, column or key.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeAlias

import pandas as pd

from rotorid.errors import InputError
from rotorid.io.text.wording import hint
from rotorid.recordings import RecordingSet, Run, Vehicle, read_set, read_vehicle, templates, vehicle_of
from rotorid.recordings.check import SetCheck, check_recordings
from rotorid.recordings.files import check_belief, check_rotors, usable_runs
from rotorid.recordings.tables import check_table, numbers
from rotorid.report.deliver import FILES, OTHERS, Result
from rotorid.steps import heard_by
from rotorid.vehicle.exports import Exported, export_vehicle

Believed: TypeAlias = Vehicle | Mapping | str | Path
"""A vehicle, the keys of a `vehicle.yaml`, the path of one, or the name of a template."""
_Recorded: TypeAlias = RecordingSet | pd.DataFrame | Mapping[str, pd.DataFrame] | Sequence | str | Path
"""A set, a table, tables by name, a folder, a log, or several tables or logs."""


def verdict(
    data: _Recorded,
    vehicle: Believed | None = None,
    *,
    name: str = "flights",
    held_out: Sequence[str] | None = None,
    mass_kg: float | None = None,
    like: str | None = None,
    mapping: str | Path | None = None,
    progress: Callable[[str], None] | None = None,
) -> Result:
    """Where a believed vehicle and its recordings part, why, and a better vehicle.

    Parameters
    ----------
    data
        Flights as a table (`pandas.DataFrame`) in the contract's columns, as tables by the name of their run, as a
        list of tables, as a folder with `vehicle.yaml` and runs, or as one log or a list of logs that `rotorid import`
        knows.
    vehicle
        What is believed: a `Vehicle`, a dictionary with the keys of `vehicle.yaml`, the path of one, or the name of a
        template. A folder and logs bring their own, or a proposal, where it is left out.
    name
        What the set is called, where it is made of tables or logs.
    held_out
        Names of the runs that the model is judged by and not fitted to; else chosen as the contract says.
    mass_kg, like, mapping
        For logs, as the options of `rotorid import`.
    progress
        Takes the name of the step whenever it changes.

    Returns
    -------
    Result
        Sentence, tables of effects, values and errors, the improved vehicle, the page; `save` writes the files.

    Raises
    ------
    InputError
        Something in the data or the vehicle does not fit; one sentence says what.
    """
    # The effects bring a compiler along, whose start takes seconds.
    from rotorid.report.deliver import analysis_of, write_files

    recordings = recording_set(data, vehicle, name=name, held_out=held_out, mass_kg=mass_kg, like=like, mapping=mapping)
    # What a module warns of goes to no log here; the verdict itself says what a reader must know.
    hears = heard_by(lambda path: progress(path[-1]) if progress and path else None)
    with warnings.catch_warnings(), TemporaryDirectory() as folder, hears:
        warnings.simplefilter("ignore")
        analysis = analysis_of(recordings)
        found = write_files(analysis, Path(folder))
        there = [path for name in (*FILES, *OTHERS) if (path := Path(folder) / name).exists()]
        texts = {path.name: path.read_text(encoding="utf-8") for path in there}
    return Result(found, texts, analysis)


def recording_set(
    data: _Recorded,
    vehicle: Believed | None = None,
    *,
    name: str = "flights",
    held_out: Sequence[str] | None = None,
    mass_kg: float | None = None,
    like: str | None = None,
    mapping: str | Path | None = None,
) -> RecordingSet:
    """What `verdict` analyses, from whatever it takes; the parameters are `verdict`'s."""
    if isinstance(data, RecordingSet):
        found = data
    elif isinstance(data, pd.DataFrame):
        found = _of_tables({"run": data}, name, vehicle)
    elif isinstance(data, Mapping):
        found = _of_tables(data, name, vehicle)
    elif isinstance(data, str | Path) and Path(data).is_dir():
        found = read_set(Path(data))
    elif isinstance(data, str | Path):
        found = _of_logs([Path(data)], name, vehicle, mass_kg, like, mapping)
    elif isinstance(data, Sequence) and data and all(isinstance(part, pd.DataFrame) for part in data):
        found = _of_tables({f"run_{i}": part for i, part in enumerate(data, 1)}, name, vehicle)
    elif isinstance(data, Sequence) and data and all(isinstance(part, str | Path) for part in data):
        found = _of_logs([Path(part) for part in data], name, vehicle, mass_kg, like, mapping)
    else:
        raise InputError(
            f"data is {type(data).__name__}, expected a table, tables by name, a folder, or one or more logs"
        )
    believed = found.vehicle if vehicle is None else _believed_vehicle(vehicle)
    for run in found.runs:
        check_rotors(run, believed)
    names = [run.name for run in found.runs]
    for chosen in held_out or ():
        if chosen not in names:
            raise InputError(f"held_out names run {chosen!r}, which is not in the set{hint(chosen, names)}")
    if held_out and set(held_out) == set(names):
        raise InputError("held_out names every run, none is left to fit")
    kept = found.held_out if held_out is None else tuple(held_out)
    return RecordingSet(
        found.name, believed, found.runs, kept, found.path, found.left_out, found.proposed if vehicle is None else ()
    )


def _believed_vehicle(vehicle: Believed) -> Vehicle:
    """A vehicle of what `verdict` takes for one; InputError where nobody can believe it."""
    found = _vehicle_from(vehicle)
    check_belief(found, str(vehicle) if isinstance(vehicle, str | Path) else "vehicle")
    return found


def _vehicle_from(vehicle: Believed) -> Vehicle:
    """The same, be it believed or improved."""
    if isinstance(vehicle, Vehicle):
        return vehicle
    if isinstance(vehicle, Mapping):
        return vehicle_of(dict(vehicle), "vehicle")
    if not Path(vehicle).exists() and Path(vehicle).suffix not in (".yaml", ".yml"):
        return templates.read(str(vehicle))
    return read_vehicle(Path(vehicle))


def _of_tables(tables: Mapping[str, pd.DataFrame], name: str, vehicle: Believed | None) -> RecordingSet:
    if vehicle is None:
        raise InputError(
            "a table needs a vehicle: a dictionary with the keys of vehicle.yaml, the path of one, or a template "
            f"({', '.join(templates.names())})"
        )
    if not tables:
        raise InputError("data holds no table")
    runs, left_out = usable_runs((partial(_of_table, run, table) for run, table in sorted(tables.items())), name)
    return RecordingSet(name, _believed_vehicle(vehicle), runs, left_out=left_out)


def _of_table(name: str, table: pd.DataFrame) -> Run:
    named = table.set_axis([str(n) for n in table.columns], axis=1)
    return Run(str(name), check_table(numbers(named, f"run {name}"), f"run {name}"))


def _of_logs(logs, name, vehicle, mass_kg, like, mapping) -> RecordingSet:
    from rotorid.recordings.importers.logfile import set_of_logs
    from rotorid.recordings.importers.mapping import read_mapping

    found = set_of_logs(
        logs,
        name,
        mass_kg,
        like if vehicle is None or like else "thesis",  # the proposal is then not looked at
        mapping=read_mapping(Path(mapping)) if mapping else None,
    )
    recordings = found.recordings()
    return recordings if vehicle is None else replace(recordings, vehicle=_believed_vehicle(vehicle), proposed=())


def template(name: str, **changes) -> Vehicle:
    """A template vehicle (`rotorid init --list`), with keys of `vehicle.yaml` changed: `mass_kg=0.71`.

    Raises
    ------
    InputError
        There is no such template or key; the nearest is named.
    """
    content = templates.read(name).model_dump(exclude_defaults=True)
    return vehicle_of({**content, **changes}, f"template {name}")


def check(data: _Recorded, vehicle: Believed | None = None, **options) -> SetCheck:
    """What recordings hold, what they lack, and what in them cannot be right; takes what `verdict` takes.

    `print(rotorid.check(...))` shows it as `rotorid check` does. `lacks` holds sentences; each of `doubts` names what
    is in doubt, with a sentence and whether it stops a verdict.
    """
    return check_recordings(recording_set(data, vehicle, **options))


def read_log(path: str | Path, mapping: str | Path | None = None) -> dict[str, pd.DataFrame]:
    """The flights of a log by name, in the contract's columns, axes and units; InputError where it holds none."""
    from rotorid.recordings.importers.logfile import read_log as read
    from rotorid.recordings.importers.mapping import read_mapping

    return dict(read(Path(path), read_mapping(Path(mapping)) if mapping else None).runs)


def simulate(vehicle: Believed, seconds: float = 20.0, flights: int = 2, seed: int = 1) -> RecordingSet:
    """Flights of a vehicle, with every effect that it states, as `rotorid simulate` writes them.

    The vehicle swings in roll and pitch about hover under an attitude controller; sensors are noisy. The set's own
    vehicle is the one without the effects.
    """
    from rotorid.vehicle.control import swings

    return swings(_vehicle_from(vehicle), "simulated", seconds, flights, seed)


def export(vehicle: Believed, to: str) -> Exported:
    """The vehicle for another tool (`rotorid export`): its `text`, `companions` (files next to it), and `left_out`.

    The last is what it cannot express."""
    return export_vehicle(_vehicle_from(vehicle), to)


def parameters(data: _Recorded, to: str, vehicle: Believed | None = None, **options) -> tuple:
    """What flights say of an autopilot's parameters (`rotorid parameters`).

    Parameters
    ----------
    data, vehicle, options
        As for `verdict`.
    to
        `px4`, `ardupilot`, `betaflight` or `crazyflie`.

    Returns
    -------
    tuple of rotorid.identify.autopilot.AutopilotParameter
        Each with `value`, `interval_95`, `determined` and `to_set`.
    """
    from rotorid.identify.autopilot import parameters_of

    return parameters_of(recording_set(data, vehicle, **options), to)
