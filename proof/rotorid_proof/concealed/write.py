"""Write a recording set exactly as the contract names its files, columns and units. pandas and yaml only."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd
import yaml


@dataclass(frozen=True)
class Recording:
    """A finished set: vehicle.yaml as a dict, one contract table a run, the held-out runs if named."""

    vehicle: dict
    runs: dict[str, pd.DataFrame]
    held_out: tuple[str, ...] = ()
    form: str = "csv"  # csv | csv.gz | parquet
    notes: dict = field(default_factory=dict)


def plain(value):
    """Numbers that yaml and json can print: numpy scalars and arrays become Python's own."""
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(f"{float(value):.7g}")
    return value


def write_set(recording: Recording, folder: Path) -> None:
    """Write vehicle.yaml, the runs and, where runs are named as held out, split.yaml."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "vehicle.yaml").open("w") as out:
        yaml.safe_dump(plain(recording.vehicle), out, sort_keys=False, default_flow_style=None)
    for name, table in recording.runs.items():
        path = folder / f"{name}.{recording.form}"
        if recording.form == "parquet":
            table.to_parquet(path, index=False)
        else:
            rounded = table.copy()
            rounded["time_s"] = rounded["time_s"].map("{:.6f}".format)
            compression = {"method": "gzip", "mtime": 0} if recording.form == "csv.gz" else None
            rounded.to_csv(path, index=False, float_format="%.8g", compression=compression)
    if recording.held_out:
        with (folder / "split.yaml").open("w") as out:
            yaml.safe_dump({"held_out": list(recording.held_out)}, out)
