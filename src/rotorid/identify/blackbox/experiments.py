"""The 48 dynamics experiments (table A.1) as samples: motor forces, roll, pitch, and the wrench they exert.

A motor's force is read from its throttle through the thrust tests of the same propeller, as the thesis does.
The two loggers have their own clocks; the wrench is shifted to the throttles by the largest correlation of
its vertical force with their total thrust. The reading at rest is taken off, which removes the weight.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.interpolate import PchipInterpolator

from rotorid.errors import InputError
from rotorid.io.experiments import EXPERIMENTS
from rotorid.io.tables import by_recording
from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle.mixer import wrench_matrix

INPUTS = ("force_1_n", "force_2_n", "force_3_n", "force_4_n", "roll_rad", "pitch_rad")
OUTPUTS = ("force_x_n", "force_y_n", "force_z_n", "moment_x_n_m", "moment_y_n_m", "moment_z_n_m")
COLUMNS = ("experiment", "sample", *INPUTS, *OUTPUTS)
PLATEAU_BLOCKS = 2
SINE_BLOCKS = 12
_LARGEST_SHIFT_S = 1.0


def thrust_of_throttle(points: pd.DataFrame):
    """Thrust (N) as a monotone curve of throttle through the thrust tests and the origin."""
    # Tests at one throttle count as one point; throttles are sent in steps far wider than this rounding.
    by_throttle = points.groupby(points["throttle"].round(6))["value"].mean()
    throttle = np.append(0.0, by_throttle.index.to_numpy())
    thrust = np.maximum.accumulate(np.append(0.0, by_throttle.to_numpy()))
    return PchipInterpolator(throttle, thrust, extrapolate=True)


def samples_of(number: int, quadrotor: pd.DataFrame, wrench: pd.DataFrame, curve) -> pd.DataFrame:
    """Averaged samples of one experiment from its two tables (host's time), columns `COLUMNS`.

    A trapezoid gives blocks of its plateau, a sine blocks of its steady cycles; each is a mean over the
    block.
    """
    experiment = EXPERIMENTS[number]
    grid = np.arange(quadrotor["host_time_s"].iloc[0], quadrotor["host_time_s"].iloc[-1], 0.01)
    throttle = np.column_stack(
        [np.interp(grid, quadrotor["host_time_s"], quadrotor[f"throttle_{i}"]) for i in (1, 2, 3, 4)]
    )
    forces = np.clip(curve(throttle), 0.0, None)
    total = forces.sum(axis=1)
    if total.max() <= 0:
        raise InputError(f"experiment {number}: the motors never ran")
    when = wrench["host_time_s"].to_numpy()
    begin = grid[np.argmax(total > 0)]
    rest = wrench[when < begin - 0.3]
    if len(rest) < 10:
        raise InputError(f"experiment {number}: no reading at rest before the motors started")
    values = wrench[list(OUTPUTS)].to_numpy() - rest[list(OUTPUTS)].mean().to_numpy()
    shift = _shift(grid, total, when, -values[:, 2])
    felt = np.column_stack([np.interp(grid + shift, when, v) for v in values.T])
    if experiment.signal == "trapezoidal":
        flat = np.flatnonzero(total > 0.99 * total.max())
        flat = flat[60:-60]
        blocks = np.array_split(flat, PLATEAU_BLOCKS)
    else:
        active = np.flatnonzero(total > 0.02 * total.max())
        blocks = np.array_split(active, max(SINE_BLOCKS * 3, 1))[::3]
    rows = []
    for sample, block in enumerate(blocks, 1):
        if len(block) == 0:
            continue
        rows.append(
            [
                number,
                sample,
                *forces[block].mean(axis=0),
                np.radians(experiment.roll_deg),
                np.radians(experiment.pitch_deg),
                *felt[block].mean(axis=0),
            ]
        )
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _shift(grid, total, when, lift) -> float:
    """Seconds by which the wrench's clock is ahead, by the largest correlation of lift with thrust."""
    shifts = np.arange(-_LARGEST_SHIFT_S, _LARGEST_SHIFT_S, 0.01)
    scores = [np.corrcoef(total, np.interp(grid + s, when, lift))[0, 1] for s in shifts]
    return float(shifts[int(np.argmax(scores))])


def read_experiments(
    quadrotor: tuple[pd.DataFrame, pd.DataFrame], wrench: tuple[pd.DataFrame, pd.DataFrame], curve
) -> pd.DataFrame:
    """Samples of all experiments, columns `COLUMNS`, by number and then by time.

    `quadrotor` and `wrench` are (samples, recordings) of `rotorid.io.tables`; recordings of one group are one
    experiment. A number of table A.1 that was recorded more than once has the samples of every recording. Raises
    InputError for a recording without a number of table A.1 or without the sensor's.
    """
    commands, felt = (by_recording(samples[samples["quality"] == 0]) for samples, _ in (quadrotor, wrench))
    sensors = {row.group: row for row in wrench[1].itertuples()}
    parts = []
    for sent in quadrotor[1].sort_values("experiment", kind="stable").itertuples():
        if sent.group not in sensors:
            raise InputError(f"{sent.id}: an experiment without a recording of the wrench sensor in its group")
        read = sensors[sent.group]
        if pd.isna(sent.experiment) or int(sent.experiment) not in EXPERIMENTS:
            raise InputError(f"{sent.id}: its metadata give no number of table A.1 (1 to {len(EXPERIMENTS)})")
        # Each recording's times count from its own beginning.
        reading = felt[read.id].assign(
            host_time_s=felt[read.id]["host_time_s"] + (read.host_start_s - sent.host_start_s)
        )
        parts.append(samples_of(int(sent.experiment), commands[sent.id], reading, curve))
    table = pd.concat(parts, ignore_index=True)
    return table.assign(sample=table.groupby("experiment").cumcount() + 1)


def stand_wrench(vehicle: Vehicle, forces_n: np.ndarray, roll_rad: np.ndarray, pitch_rad: np.ndarray) -> np.ndarray:
    """Wrench (n, 6) on a level sensor, N and N m, of rotor thrusts (n, k), N, of a vehicle tilted on it; no
    weight.

    Thrust and torque per rotor by C_F and C_Q, turned into the sensor's axes; moments about the sensor.
    """
    matrix = wrench_matrix(vehicle)
    square = forces_n / vehicle.thrust_coefficients_n_s2()
    body = square @ matrix.T
    force = np.zeros((len(forces_n), 3))
    force[:, 2] = -body[:, 0]
    moment = body[:, 1:] - np.cross(np.asarray(vehicle.sensor_position_m)[None], force)
    rotation = _tilt(roll_rad, pitch_rad)
    return np.concatenate([np.einsum("nij,nj->ni", rotation, force), np.einsum("nij,nj->ni", rotation, moment)], axis=1)


def _tilt(roll: np.ndarray, pitch: np.ndarray) -> np.ndarray:
    from rotorid.vehicle.attitude import quaternion_from_euler, rotation_from_quaternion

    return rotation_from_quaternion(quaternion_from_euler(np.stack([roll, pitch, 0 * roll], axis=-1)))
