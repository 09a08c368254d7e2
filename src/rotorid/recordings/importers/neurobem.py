"""NeuroBEM test flights as MATLAB matrices (UZH Robotics and Perception Group, RSS 2021).

Columns in order: time, angular acceleration, body rates, quaternion x y z w, specific force, body velocity,
position, four rotor speeds, their derivatives, battery, NeuroBEM's own predicted force and moment, and
residuals that upstream computed with a superseded mass (not used). Frames: body forward-left-up, world with
z up. Its accelerations agree with the derivative of its velocities to 0.05 m/s²: they are a derivative of
the motion capture, not an independent accelerometer.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import scipy

from rotorid.errors import InputError
from rotorid.io.text.files import check_file
from rotorid.io.text.wording import printable
from rotorid.recordings import columns as c
from rotorid.recordings.importers.contract import Imported, Importer
from rotorid.recordings.importers.faults import ImportFault, drop_repeated_times, report_gaps
from rotorid.recordings.importers.mapping import half_turn_about_x, quaternion_to_frd_ned

_LAYOUT = (
    ("time", 1), ("angular_acceleration", 3), ("angular_velocity", 3), ("quaternion_xyzw", 4),
    ("specific_force", 3), ("velocity_body", 3), ("position", 3), ("rotor_speed", 4),
    ("rotor_acceleration", 4), ("battery", 1), ("predicted_force", 3), ("predicted_moment", 3),
)  # fmt: skip
USED = sum(width for _, width in _LAYOUT)
PREDICTED_FORCE = tuple(f"neurobem_force_{a}_n" for a in "xyz")
PREDICTED_MOMENT = tuple(f"neurobem_moment_{a}_n_m" for a in "xyz")
ANGULAR_ACCELERATION = tuple(f"angular_acceleration_{a}_rad_s2" for a in "xyz")


def _read_matrix(path: Path) -> np.ndarray:
    """The one matrix in a NeuroBEM `.mat`, shape (n, at least 35)."""
    check_file(path)
    try:
        content = scipy.io.loadmat(path)
    except MemoryError:
        raise
    except Exception as error:
        raise InputError(f"{path}: not a MATLAB file that can be read ({printable(error)[:150]})") from None
    matrices = [v for k, v in content.items() if not k.startswith("__") and getattr(v, "ndim", 0) == 2]
    if len(matrices) != 1 or matrices[0].shape[1] < USED:
        shapes = [m.shape for m in matrices]
        raise InputError(f"{path}: expected one matrix with at least {USED} columns, found {shapes}")
    return np.asarray(matrices[0], float)


def _convert(matrix: np.ndarray) -> tuple[pd.DataFrame, list[ImportFault]]:
    """Contract columns of a NeuroBEM matrix; NeuroBEM's prediction and accelerations ride as own columns."""
    ends = np.cumsum([width for _, width in _LAYOUT])
    parts = {name: part for (name, _), part in zip(_LAYOUT, np.split(matrix, ends, axis=1), strict=False)}
    attitude = scipy.spatial.transform.Rotation.from_quat(parts["quaternion_xyzw"])
    vectors = {
        c.POSITION: parts["position"],
        c.VELOCITY: attitude.apply(parts["velocity_body"]),
        c.ANGULAR_VELOCITY: parts["angular_velocity"],
        c.SPECIFIC_FORCE: parts["specific_force"],
        ANGULAR_ACCELERATION: parts["angular_acceleration"],
        PREDICTED_FORCE: parts["predicted_force"],
        PREDICTED_MOMENT: parts["predicted_moment"],
    }
    columns = {c.TIME: parts["time"][:, 0]}
    for names, values in vectors.items():
        columns |= dict(zip(names, half_turn_about_x(values).T, strict=True))
    quaternion = quaternion_to_frd_ned(parts["quaternion_xyzw"][:, [3, 0, 1, 2]])
    columns |= dict(zip(c.QUATERNION, quaternion.T, strict=True))
    columns |= dict(zip(c.rotor_columns("rotor_speed", 4), parts["rotor_speed"].T, strict=True))
    battery = parts["battery"][:, 0]
    faults = []
    if np.nanmedian(battery) > 60:  # no quadrotor of this size flies on more than 14 cells
        found = f"battery reads {np.nanmedian(battery):.0f}, a tenth of a volt"
        faults.append(ImportFault("unit", c.BATTERY_VOLTAGE, found, "divided by 10", len(battery)))
        battery = battery / 10
    columns[c.BATTERY_VOLTAGE] = battery
    if matrix.shape[1] > USED:
        found = f"{matrix.shape[1] - USED} columns of residuals made with a mass of 0.752 kg"
        faults.append(ImportFault("superseded", "", found, "left out"))
    table, repeated = drop_repeated_times(pd.DataFrame(columns))
    table[c.TIME] -= table[c.TIME].iloc[0]
    found = "acceleration agrees with the derivative of the velocity: not an independent accelerometer"
    faults.append(ImportFault("derived", ", ".join(c.SPECIFIC_FORCE), found, "kept"))
    return table, faults + repeated + report_gaps(table)


def read_neurobem(path: Path) -> tuple[pd.DataFrame, list[ImportFault]]:
    """One NeuroBEM flight in contract columns, and its faults."""
    return _convert(_read_matrix(path))


def _read(path: Path) -> Imported:
    table, faults = read_neurobem(path)
    return Imported({path.stem: table}, faults, "NeuroBEM's, turned into FRD and NED")


IMPORTER = Importer(
    "neurobem",
    "NeuroBEM .mat",
    _read,
    "as the laboratory wrote it",
    recognises=lambda path, head: path.suffix.lower() == ".mat",
    known_by="name",
    template="neurobem",
)
