"""Reading and writing recording sets: `vehicle.yaml`, runs (CSV, CSV.gz, Parquet) and `split.yaml`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import yaml
from pydantic import ValidationError

from rotorid.errors import InputError
from rotorid.recordings import columns as c
from rotorid.recordings.run import RecordingSet, Run
from rotorid.recordings.vehicle import Vehicle

RUN_SUFFIXES = (".csv", ".csv.gz", ".parquet")


class TooFewSamples(InputError):
    """A run with a heading and next to nothing below it: a set can do without it."""


def explain(error: ValidationError) -> str:
    """First fault of a pydantic error as one clause: key and what was expected."""
    first = error.errors()[0]
    key = ".".join(str(part) for part in first["loc"])
    message = first["msg"].removeprefix("Value error, ")
    if first["type"] == "extra_forbidden":
        return f"{key}: no such key is known"
    if first["type"] == "missing":
        return f"{key}: is missing"
    value = f" (found {first['input']!r})" if key and first["type"] != "value_error" else ""
    return f"{key}: {message}{value}" if key else message


def read_yaml(path: Path) -> dict:
    """A YAML mapping; InputError names the file and line of a fault."""
    try:
        with open(path, encoding="utf-8") as file:
            content = yaml.safe_load(file)
    except FileNotFoundError:
        raise InputError(f"{path}: file is missing") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f", line {mark.line + 1}" if mark else ""
        raise InputError(f"{path}{line}: not valid YAML ({getattr(error, 'problem', error)})") from None
    if not isinstance(content, dict):
        raise InputError(f"{path}: expected keys with values, found {type(content).__name__}")
    return content


def _numbers(value):
    """YAML 1.1 reads `1e-6` (without a point) as text; turn such text into a number."""
    if isinstance(value, dict):
        return {key: _numbers(v) for key, v in value.items()}
    if isinstance(value, list):
        return [_numbers(v) for v in value]
    if isinstance(value, str):
        try:
            return float(value)
        except ValueError:
            return value
    return value


def read_vehicle(path: Path) -> Vehicle:
    """Read `vehicle.yaml`; InputError in one sentence if it does not fit the contract."""
    content = read_yaml(path)
    content = {k: v if k in ("name", "kind") else _numbers(v) for k, v in content.items()}
    if "name" in content:
        content["name"] = str(content["name"])
    try:
        return Vehicle.model_validate(content)
    except ValidationError as error:
        raise InputError(f"{path}: {explain(error)}") from None


def _plain(value):
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    return value.item() if isinstance(value, np.generic) else value


def write_vehicle(vehicle: Vehicle, path: Path) -> None:
    """Write `vehicle.yaml`, leaving out what the vehicle does not state."""
    content = vehicle.model_dump(exclude_defaults=True)
    path.write_text(
        yaml.safe_dump(_plain(content), sort_keys=False, allow_unicode=True, default_flow_style=None),
        encoding="utf-8",
    )


def run_name(path: Path) -> str | None:
    """Name of the run that a file holds, None if the file is no run."""
    for suffix in RUN_SUFFIXES:
        if path.name.endswith(suffix):
            return path.name.removesuffix(suffix)
    return None


def _first_bad_cell(path: Path) -> str:
    """Where a CSV holds something that is not a number, for the message."""
    table = pd.read_csv(path, dtype=str, keep_default_na=False, skipinitialspace=True)
    for name in table.columns:
        numbers = pd.to_numeric(table[name].replace("", "nan"), errors="coerce")
        bad = numbers.isna() & ~table[name].str.strip().str.lower().isin(["", "nan"])
        if bad.any():
            row = int(np.flatnonzero(bad)[0])
            return f"line {row + 2}, column {name}: expected a number, found {table[name].iloc[row]!r}"
    return "a cell is not a number"


def check_table(table: pd.DataFrame, where: str) -> pd.DataFrame:
    """The table as floats with a usable `time_s`; InputError says what is wrong and where."""
    repeated = table.columns[table.columns.duplicated()]
    if len(repeated):
        raise InputError(f"{where}: column {repeated[0]} is there twice")
    if c.TIME not in table.columns:
        raise InputError(f"{where}: column {c.TIME} is missing")
    table = table.astype(float)
    time = table[c.TIME].to_numpy()
    if len(time) < 2:
        raise TooFewSamples(f"{where}: too little data: expected at least two samples, found {len(time)}")
    if np.isnan(time).any():
        row = int(np.flatnonzero(np.isnan(time))[0])
        raise InputError(f"{where}, line {row + 2}: {c.TIME} is empty")
    steps = np.diff(time)
    if (steps <= 0).any():
        row = int(np.flatnonzero(steps <= 0)[0]) + 1
        raise InputError(
            f"{where}, line {row + 2}: {c.TIME} must increase strictly, found {time[row]:.9g} after {time[row - 1]:.9g}"
        )
    return table


def _read_parquet(path: Path) -> pd.DataFrame:
    try:
        return pd.read_parquet(path)
    except ValueError as error:  # pyarrow's own error for broken files is one of these
        raise InputError(f"{path}: cannot be read as a table ({error})") from None


def read_run(path: Path) -> Run:
    """Read one run; InputError names file, line and column of a fault."""
    name = run_name(path)
    if name is None:
        raise InputError(f"{path}: expected one of {', '.join(RUN_SUFFIXES)}")
    try:
        if path.name.endswith(".parquet"):
            table = _read_parquet(path)
        else:
            table = pd.read_csv(path, skipinitialspace=True, encoding="utf-8-sig")
            table.columns = [str(column).strip() for column in table.columns]
        table = check_table(table, str(path))
    except FileNotFoundError:
        raise InputError(f"{path}: file is missing") from None
    except InputError:
        raise
    except (ValueError, TypeError):
        where = _first_bad_cell(path) if ".csv" in path.name else "a cell is not a number"
        raise InputError(f"{path}, {where}") from None
    except Exception as error:
        raise InputError(f"{path}: cannot be read as a table ({error})") from None
    return Run(name, table, str(path))


def read_set(folder: Path) -> RecordingSet:
    """Read a recording set; InputError in one sentence if anything in it does not fit the contract."""
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: no such recording set (folder)")
    vehicle = read_vehicle(folder / "vehicle.yaml")
    paths = sorted((p for p in folder.iterdir() if run_name(p)), key=lambda p: run_name(p))
    if not paths:
        raise InputError(f"{folder}: no run found, expected files ending in {', '.join(RUN_SUFFIXES)}")
    names = [run_name(p) for p in paths]
    for first, second in zip(paths, paths[1:], strict=False):
        if run_name(first) == run_name(second):
            raise InputError(f"{folder}: run {run_name(first)} is there twice ({first.name}, {second.name})")
    runs, left_out = [], []
    for path in paths:
        try:
            runs.append(read_run(path))
        except TooFewSamples as error:
            left_out.append(f"Left out: {error}.")
            if len(left_out) == len(paths):
                raise
    for run in runs:
        for column in run.table.columns:
            found = c.rotor_number(column)
            if found and vehicle.kind != "bench" and not 1 <= found[1] <= vehicle.rotor_count:
                raise InputError(f"{run.path}, column {column}: vehicle.yaml lists {vehicle.rotor_count} rotors only")
    held_out = None
    if (folder / "split.yaml").exists():
        split = read_yaml(folder / "split.yaml")
        unknown = [k for k in split if k != "held_out"]
        if unknown:
            raise InputError(f"{folder / 'split.yaml'}: {unknown[0]}: no such key is known")
        held_out = tuple(str(n) for n in split.get("held_out") or ())
        for name in held_out:
            if name not in names:
                raise InputError(f"{folder / 'split.yaml'}: held_out names run {name}, which is not in the set")
        if len(held_out) == len(names):
            raise InputError(f"{folder / 'split.yaml'}: every run is held out, none is left to fit")
    return RecordingSet(folder.name, vehicle, tuple(runs), held_out, str(folder), tuple(left_out))


def write_set(recordings: RecordingSet, parent: Path, suffix: str = ".parquet") -> Path:
    """Write a set below `parent`; returns its folder. `suffix` is one of RUN_SUFFIXES."""
    folder = Path(parent) / recordings.name
    folder.mkdir(parents=True, exist_ok=True)
    write_vehicle(recordings.vehicle, folder / "vehicle.yaml")
    for run in recordings.runs:
        path = folder / f"{run.name}{suffix}"
        if suffix == ".parquet":
            run.table.to_parquet(path, index=False)
        else:
            compression = {"method": "gzip", "mtime": 0} if suffix.endswith(".gz") else None
            run.table.to_csv(path, index=False, compression=compression)
    if recordings.held_out is not None:
        (folder / "split.yaml").write_text(yaml.safe_dump({"held_out": list(recordings.held_out)}), encoding="utf-8")
    return folder


def list_sets(parent: Path) -> list[str]:
    """Names of the recording sets below a folder, sorted."""
    parent = Path(parent)
    if not parent.is_dir():
        return []
    return sorted(p.name for p in parent.iterdir() if (p / "vehicle.yaml").is_file())
