"""Models of the stand's wrench, alike in use: fit on a table of samples, predict (n, 6) for another.

- `thesis_network`: 6-20-20-6, sigmoid inside, linear out, batch, rate 0.1 (thesis 4.4).
- `linear`: least squares on the six inputs and a constant.
- `ridge_physics`: ridge on products of the motors' forces with the cosines and sines of the tilt.
- `boosting`: gradient boosting, one ensemble an output.
- `white_box`: the equations of chapter 4.1 with the believed values; nothing is fitted.
- `white_box_effects`: the same with the effects that the stand's recordings show (unequal rotors and torques, shifted
  sensor origin, tilted mount) fitted by least squares.

They are compared on whole experiments held out, with intervals; there are calibrated prediction intervals and the range
of validity. Samples are those of the 48 dynamics experiments (table A.1). A motor's force is read from its throttle
through the thrust tests of the same propeller, as the thesis does. The two loggers have their own clocks; the wrench is
shifted to the throttles by the largest correlation of its vertical force with their total thrust. The reading at rest
is taken off, which removes the weight.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.interpolate import PchipInterpolator
from scipy.optimize import least_squares

from rotorid.errors import InputError
from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle.attitude import quaternion_from_euler, rotation_from_quaternion
from rotorid.vehicle.mixer import wrench_matrix
from rotorid_acquire.io.logs import by_recording
from rotorid_acquire.io.wire import EXPERIMENTS
from rotorid_lab.networks import Training, build, train

INPUTS = ("force_1_n", "force_2_n", "force_3_n", "force_4_n", "roll_rad", "pitch_rad")
OUTPUTS = ("force_x_n", "force_y_n", "force_z_n", "moment_x_n_m", "moment_y_n_m", "moment_z_n_m")
COLUMNS = ("experiment", "sample", *INPUTS, *OUTPUTS)
PLATEAU_BLOCKS = 2
SINE_BLOCKS = 12
_LARGEST_SHIFT_S = 1.0
_Predict = Callable[[pd.DataFrame], np.ndarray]
NAMES = {
    "thesis_network": "thesis's network",
    "linear": "least squares",
    "ridge_physics": "ridge on physical features",
    "boosting": "gradient boosting",
    "white_box": "white box",
    "white_box_effects": "white box with effects",
}
_INPUT_NAMES = {f"force_{i}_n": f"the force of motor {i} (N)" for i in (1, 2, 3, 4)} | {
    "roll_rad": "roll (rad)",
    "pitch_rad": "pitch (rad)",
}

_Fit = Callable[[pd.DataFrame], _Predict]


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
        blocks = np.array_split(np.flatnonzero(total > 0.99 * total.max())[60:-60], PLATEAU_BLOCKS)
    else:
        active = np.flatnonzero(total > 0.02 * total.max())
        blocks = np.array_split(active, max(SINE_BLOCKS * 3, 1))[::3]
    tilt = np.radians([experiment.roll_deg, experiment.pitch_deg])
    rows = [
        [number, sample, *forces[block].mean(axis=0), *tilt, *felt[block].mean(axis=0)]
        for sample, block in enumerate(blocks, 1)
        if len(block)
    ]
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

    `quadrotor` and `wrench` are (samples, recordings) of `rotorid_acquire.io.logs`; recordings of one group are one
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
    rotation = rotation_from_quaternion(quaternion_from_euler(np.stack([roll_rad, pitch_rad, 0 * roll_rad], axis=-1)))
    return np.concatenate([np.einsum("nij,nj->ni", rotation, force), np.einsum("nij,nj->ni", rotation, moment)], axis=1)


def _range_of(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lowest value and span of each column, which are scaled to 0-1 by them, as networks want it."""
    low = values.min(axis=0)
    span = values.max(axis=0) - low
    return low, np.where(span > 0, span, 1.0)


def fit_thesis_network(
    table: pd.DataFrame,
    epochs: int,
    rate: float = 0.1,
    hidden: tuple[int, ...] = (20, 20),
    seed: int = 0,
    every: int = 10,
    checkpoint: Path | None = None,
) -> tuple[_Predict, np.ndarray, np.ndarray]:
    """The network of thesis 4.4 on a table of `INPUTS` and `OUTPUTS`: its model, and epochs and errors of `train`."""
    x, y = table[list(INPUTS)].to_numpy(), table[list(OUTPUTS)].to_numpy()
    (low_x, span_x), (low_y, span_y) = _range_of(x), _range_of(y)
    sizes = (len(INPUTS), *hidden, len(OUTPUTS))
    activations = ("sigmoid",) * len(hidden) + ("linear",)
    network = build(sizes, activations, np.random.default_rng(seed))
    how = Training(rate, epochs, every=every, seed=seed, checkpoint_every=10_000)
    network, kept, errors = train(network, (x - low_x) / span_x, (y - low_y) / span_y, how, checkpoint)

    def predict(other: pd.DataFrame) -> np.ndarray:
        return low_y + network((other[list(INPUTS)].to_numpy() - low_x) / span_x) * span_y

    return predict, kept, errors


def fit_linear(table: pd.DataFrame) -> _Predict:
    def design(t):
        return np.column_stack([t[list(INPUTS)].to_numpy(), np.ones(len(t))])

    found, *_ = np.linalg.lstsq(design(table), table[list(OUTPUTS)].to_numpy(), rcond=None)
    return lambda other: design(other) @ found


def _physical_features(table: pd.DataFrame) -> np.ndarray:
    """Each motor's force times 1, sin and cos of roll and pitch and their product, (n, 24)."""
    forces = table[list(INPUTS[:4])].to_numpy()
    roll, pitch = table["roll_rad"].to_numpy(), table["pitch_rad"].to_numpy()
    ways = [np.ones(len(table)), np.sin(roll), np.cos(roll) - 1, np.sin(pitch), np.cos(pitch) - 1]
    ways.append(np.sin(roll) * np.sin(pitch))
    return np.concatenate([forces * way[:, None] for way in ways], axis=1)


def fit_ridge_physics(table: pd.DataFrame, groups: np.ndarray) -> _Predict:
    """Ridge with the penalty chosen per output by leaving whole experiments out."""
    from sklearn.linear_model import Ridge
    from sklearn.model_selection import GroupKFold, cross_val_score
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    x, y = _physical_features(table), table[list(OUTPUTS)].to_numpy()
    models = []
    for output in y.T:
        scores = {}
        for penalty in (1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0):
            model = make_pipeline(StandardScaler(), Ridge(alpha=penalty))
            scores[penalty] = cross_val_score(
                model, x, output, groups=groups, cv=GroupKFold(5), scoring="neg_mean_squared_error"
            ).mean()
        best = max(scores, key=scores.get)
        models.append(make_pipeline(StandardScaler(), Ridge(alpha=best)).fit(x, output))
    return lambda other: np.column_stack([m.predict(_physical_features(other)) for m in models])


def fit_boosting(table: pd.DataFrame, seed: int = 0) -> _Predict:
    from sklearn.ensemble import GradientBoostingRegressor

    x = table[list(INPUTS)].to_numpy()
    models = [
        GradientBoostingRegressor(
            n_estimators=300, max_depth=3, learning_rate=0.05, subsample=0.7, random_state=seed
        ).fit(x, table[name].to_numpy())
        for name in OUTPUTS
    ]
    return lambda other: np.column_stack([m.predict(other[list(INPUTS)].to_numpy()) for m in models])


def white_box(vehicle: Vehicle) -> _Predict:
    return lambda other: stand_wrench(
        vehicle, other[list(INPUTS[:4])].to_numpy(), other["roll_rad"].to_numpy(), other["pitch_rad"].to_numpy()
    )


EFFECT_PARAMETERS = (
    *(f"thrust_factor_{i}" for i in (1, 2, 3, 4)),
    *(f"torque_factor_{i}" for i in (1, 2, 3, 4)),
    "sensor_origin_x_m",
    "sensor_origin_y_m",
    "mount_roll_rad",
    "mount_pitch_rad",
)


def effects_wrench(vehicle: Vehicle, table: pd.DataFrame, values: np.ndarray) -> np.ndarray:
    """The stand's wrench with `EFFECT_PARAMETERS` (neutral: ones, ones, zeros), (n, 6)."""
    factors, torques, mount = values[:4], values[4:8], values[10:12]
    # Along the thrust a shift of the sensor changes nothing.
    origin = np.array([values[8], values[9], 0.0])
    forces = table[list(INPUTS[:4])].to_numpy() * factors
    ratio = vehicle.torque_coefficients_n_m_s2() / vehicle.thrust_coefficients_n_s2()
    places = vehicle.rotor_positions_m() - np.asarray(vehicle.sensor_position_m) - origin
    # r × (0, 0, -F) = (-y F, x F, 0)
    moment = np.column_stack(
        [
            -forces @ places[:, 1],
            forces @ places[:, 0],
            table[list(INPUTS[:4])].to_numpy() * torques @ (vehicle.yaw_signs() * ratio),
        ]
    )
    force = np.zeros_like(moment)
    force[:, 2] = -forces.sum(axis=1)
    angles = np.column_stack([table["roll_rad"], table["pitch_rad"], np.zeros(len(table))])
    turn = rotation_from_quaternion(quaternion_from_euler(angles))
    level = rotation_from_quaternion(quaternion_from_euler(np.array([mount[0], mount[1], 0.0])))
    turn = level @ turn
    return np.concatenate([np.einsum("nij,nj->ni", turn, v) for v in (force, moment)], axis=1)


def fit_white_box_effects(vehicle: Vehicle, table: pd.DataFrame) -> tuple[_Predict, np.ndarray, np.ndarray]:
    """Effects by least squares: model, `EFFECT_PARAMETERS` and their standard errors, shape (12,) each.

    Forces are weighted by 0.1 N and moments by 0.001 N m, the sensor's resolution. The errors hold for residuals that
    the samples of one experiment share (cluster-robust over experiments); what the model itself lacks they do not know.
    """
    measured = table[list(OUTPUTS)].to_numpy()
    neutral = np.concatenate([np.ones(8), np.zeros(4)])
    sigma = np.repeat([0.1, 0.001], 3)
    found = least_squares(
        lambda v: ((effects_wrench(vehicle, table, v) - measured) / sigma).ravel(), neutral, x_scale=0.01
    )
    rows = np.repeat(table["experiment"].to_numpy(), len(OUTPUTS))
    scores = np.array([found.jac[rows == number].T @ found.fun[rows == number] for number in np.unique(rows)])
    inverse = np.linalg.inv(found.jac.T @ found.jac)
    factor = len(scores) / (len(scores) - 1)
    errors = np.sqrt(np.diag(factor * inverse @ (scores.T @ scores) @ inverse))
    return lambda other: effects_wrench(vehicle, other, found.x), found.x, errors


def folds(experiments: np.ndarray, count: int, rng: np.random.Generator) -> list[np.ndarray]:
    """Masks (n,) of the held-out samples of each fold; whole experiments go together.

    InputError where a fold would have no experiment.
    """
    numbers = rng.permutation(np.unique(experiments))
    if count > len(numbers):
        raise InputError(f"black_box.folds is {count}, expected at most the {len(numbers)} experiments")
    return [np.isin(experiments, part) for part in np.array_split(numbers, count)]


def out_of_fold(table: pd.DataFrame, fits: Mapping[str, _Fit], masks: Sequence[np.ndarray]) -> dict[str, np.ndarray]:
    """Predictions (n, 6) of each model for samples that its training did not hold."""
    found = {name: np.full((len(table), len(OUTPUTS)), np.nan) for name in fits}
    for held_out in masks:
        for name, fit in fits.items():
            found[name][held_out] = fit(table[~held_out])(table[held_out])
    return found


def scores(
    measured: np.ndarray, predicted: np.ndarray, experiments: np.ndarray, rng: np.random.Generator, draws: int = 1000
) -> dict[str, np.ndarray]:
    """RMSE and R² of each output with 95 % intervals by drawing whole experiments, arrays (6,) and (6, 2)."""
    numbers = np.unique(experiments)
    error2, spread2, count = (np.empty((len(numbers), measured.shape[1])) for _ in range(3))
    mean = measured.mean(axis=0)
    for row, number in enumerate(numbers):
        mine = experiments == number
        error2[row] = ((measured - predicted)[mine] ** 2).sum(axis=0)
        spread2[row] = ((measured[mine] - mean) ** 2).sum(axis=0)
        count[row] = mine.sum()
    drawn = rng.integers(0, len(numbers), (draws, len(numbers)))
    e, s, c = error2[drawn].sum(1), spread2[drawn].sum(1), count[drawn].sum(1)
    return {
        "rmse": np.sqrt(error2.sum(0) / count.sum(0)),
        "rmse_interval": np.quantile(np.sqrt(e / c), [0.025, 0.975], axis=0).T,
        "r2": 1 - error2.sum(0) / spread2.sum(0),
        "r2_interval": np.quantile(1 - e / s, [0.025, 0.975], axis=0).T,
    }


def conformal_half_width(absolute_error: np.ndarray, experiments: np.ndarray, share: float = 0.95) -> np.ndarray:
    """Half widths (6,) of intervals that cover `share` of new samples of new experiments.

    Split conformal with whole experiments as the exchangeable unit: each experiment counts alike (its samples
    share its weight), and one unseen experiment is added at infinity.
    """
    numbers, index, counts = np.unique(experiments, return_inverse=True, return_counts=True)
    weight = 1.0 / counts[index] / (len(numbers) + 1)
    out = np.empty(absolute_error.shape[1])
    for k, column in enumerate(absolute_error.T):
        order = np.argsort(column)
        total = np.cumsum(weight[order])
        place = np.searchsorted(total, share - 1e-9)
        out[k] = column[order[place]] if place < len(order) else np.inf
    return out


def conformal_coverage(
    measured: np.ndarray, predicted: np.ndarray, experiments: np.ndarray, masks: Sequence[np.ndarray], share: float
) -> tuple[np.ndarray, np.ndarray]:
    """Half widths (6,) from all folds, and the coverage (6,) of each fold by widths from the other folds alone.

    Raises InputError where no width covers `share`: of n experiments n / (n + 1) can be promised.
    """
    fewest = min(len(np.unique(experiments[~held_out])) for held_out in masks)
    if share > fewest / (fewest + 1):
        raise InputError(
            f"black_box.share is {share:g}, expected at most {fewest / (fewest + 1):.3g}, all that the {fewest} "
            f"experiments outside one of {len(masks)} folds can promise"
        )
    error = np.abs(measured - predicted)
    inside = np.zeros_like(error, bool)
    for held_out in masks:
        width = conformal_half_width(error[~held_out], experiments[~held_out], share)
        inside[held_out] = error[held_out] <= width
    return conformal_half_width(error, experiments, share), inside.mean(axis=0)


def within_training(table: pd.DataFrame) -> Callable[[Sequence[float]], str]:
    """What gives a sentence on one input (6,): inside the training samples, or what lies outside and by how much."""
    values = table[list(INPUTS)].to_numpy()
    lowest, span = _range_of(values)
    points = (values - lowest) / span
    experiments = table["experiment"].to_numpy()
    gap = np.linalg.norm(points[:, None] - points[None], axis=2)
    gap[experiments[:, None] == experiments[None]] = np.inf
    # Distance to the nearest sample of another experiment within which 99 % of the training samples lie.
    reach = float(np.quantile(gap.min(axis=1), 0.99))

    def statement(inputs: Sequence[float]) -> str:
        scaled = (np.asarray(inputs, float) - lowest) / span
        outside = [
            f"{_INPUT_NAMES[name]} is {value:.3g}, trained from {low:.3g} to {high:.3g}"
            for name, value, low, high, s in zip(INPUTS, inputs, lowest, lowest + span, scaled, strict=True)
            if s < -1e-9 or s > 1 + 1e-9
        ]
        if outside:
            return "outside the training range: " + "; ".join(outside)
        distance = float(np.min(np.linalg.norm(points - scaled, axis=1)))
        if distance > reach:
            return (
                f"outside the training data: no such combination was trained (nearest sample {distance:.2f} of the "
                f"range away, {reach:.2f} is usual)"
            )
        return "inside the training range"

    return statement
