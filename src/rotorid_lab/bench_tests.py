"""Tests of the bench: static ones of known load (thesis 2.8.1, figs 2.42 and 2.45), flights on it (2.8.2, fig. 2.47).

Each static recording becomes one point: the mean force while the load was read, by the thesis's equations and, on the
aluminium bench, by the calibration matrix, each with the uncertainty that the calibration and the noise leave.

The thesis reconstructs one axis at a time (eqs 2.6 to 2.8) and says itself that six readings do not determine six
unknowns. Three of these, the forces, they do determine once it is known how the cells answer to each: voltages of
loads of known direction give the answer R (6 × 3, V/N), and its weighted pseudo-inverse A = (Rᵀ W R)⁻¹ Rᵀ W gives
the force of any reading, combined loads included, for as long as the bench answers linearly.

In flight the pilot follows the same plan on each of three platforms with timing of his own, so they are compared by
what they agree in whatever the timing: levels held, the largest force, noise at rest, the return to zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.special import stdtrit as student_quantile

from rotorid.errors import InputError
from rotorid.recordings.signal import mean_and_error
from rotorid_acquire.io.logs import by_recording
from rotorid_lab.bench import (
    DIRECTION,
    GF_N,
    PULLED,
    Geometry,
    cell_forces,
    cell_variance,
    force_covariance,
    forces,
)
from rotorid_lab.loadcell import LineFit, fit_line, mean_interval

_AXES = "xyz"
_REST_S = 1.0
"""Length of the stretches at the beginning and the end that are taken as rest."""
_HELD_S = 0.8
"""A thrust counts as held when it stays within ± `_HELD_N` for that long."""
_HELD_N = 0.02
_MARGIN_S = 0.25
"""Left off both ends of a held stretch before platforms are compared: the pilot's timing differs by that much."""


def direction(axis: str) -> np.ndarray:
    """Unit vector of a load, shape (3,), body axes; `xz` is halfway between x and z. Loads along z pull up, −z."""
    if not axis or any(letter not in DIRECTION for letter in axis):
        raise InputError(f"a load's axis is x, y, z or several of them, not {axis!r}")
    together = np.sum([DIRECTION[letter] for letter in axis], axis=0)
    return together / np.linalg.norm(together)


@dataclass(frozen=True)
class Means:
    """Mean readings of recordings while the load was read, in the order of `sessions`."""

    sessions: pd.DataFrame
    values: np.ndarray
    """Cells' tared voltages, V, shape (n, 6), or the sensor's tared forces, N, shape (n, 3)."""
    variance: np.ndarray
    """Variance of these means from the samples' scatter, that of the tare included, same shape."""
    applied_n: np.ndarray
    """Known loads, N, shape (n, 3), body axes."""


def mean_readings(prepared: pd.DataFrame, sessions: pd.DataFrame, channels: tuple[str, ...]) -> Means:
    """Mean of each channel between the marks `read_start` and `read_stop`, flagged samples left out."""
    parts = by_recording(prepared)
    means, variances, applied = [], [], []
    for session in sessions.itertuples():
        table = parts[session.id]
        table = table[table["quality"] == 0]
        read = table.loc[table["index"].between(session.mark_read_start, session.mark_read_stop), list(channels)]
        rest = table.loc[table["index"].between(session.mark_tare_start, session.mark_tare_stop), list(channels)]
        if len(read) < 2 or len(rest) < 2:
            raise InputError(f"{session.id}: fewer than two good samples at rest or under load")
        means.append(read.mean().to_numpy())
        variances.append((read.var(ddof=1) / len(read) + rest.var(ddof=1) / len(rest)).to_numpy())
        applied.append(direction(session.axis) * session.load_gf * GF_N)
    return Means(sessions.reset_index(drop=True), np.array(means), np.array(variances), np.array(applied))


def by_equations(means: Means, lines: list[LineFit], geometry: Geometry) -> tuple[np.ndarray, np.ndarray]:
    """Force and its standard uncertainty, N, shape (n, 3) each, by eqs 2.3 to 2.8."""
    coefficients = np.array([[line.a0, line.a1] for line in lines])
    cells = cell_forces(means.values, coefficients)
    covariance = force_covariance(cells, cell_variance(means.values, lines, means.variance), geometry)
    return forces(cells, geometry), np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))


def by_matrix(means: Means, calibration: _Calibration) -> tuple[np.ndarray, np.ndarray]:
    """Force and its standard uncertainty, N, shape (n, 3) each, by the calibration matrix."""
    force = calibration.force(means.values)
    noise_v = np.sqrt(means.variance.mean(axis=0))
    return force, np.sqrt(np.diagonal(calibration.force_covariance(force, noise_v), axis1=1, axis2=2))


def lateral_as_vertical(calibration: _Calibration, lines: list[LineFit], geometry: Geometry) -> dict[str, dict]:
    """What eq. 2.8 makes of one newton along x or y alone, N: `force_z_n`, and of it the absolute values' part.

    The cells answer as the matrix has measured it, so it is the equation that turns a lateral load into a vertical one.
    `absolute_n` is −(|F1| + |F3| + |F5|); it does not change sign with the load.
    """
    slopes = np.array([line.a1 for line in lines]) * 1e5 * GF_N
    cells = (slopes[:, None] * calibration.response_v_n[:, :2]).T
    along_z = forces(cells, geometry)[:, 2]
    absolute = -np.abs(cells[:, PULLED]).sum(axis=1)
    return {
        axis: {"force_z_n": float(f), "absolute_n": float(a)}
        for axis, f, a in zip("xy", along_z, absolute, strict=True)
    }


def matrix_of(means: Means, largest_n: float, repeats: set[int] | None = None) -> _Calibration:
    """Calibration matrix from loads along one axis at a time, up to `largest_n`; of some `repeats` only if given."""
    use = (np.linalg.norm(means.applied_n, axis=1) <= largest_n) & (means.sessions["axis"].str.len() == 1).to_numpy()
    if repeats is not None:
        use &= means.sessions["repeat"].isin(repeats).to_numpy()
    return calibrate(means.values[use], means.applied_n[use])


def points(means: Means, force_n: np.ndarray, uncertainty_n: np.ndarray, method: str) -> pd.DataFrame:
    """One row a recording: load and force along the load, the error, what appears across, the uncertainty."""
    load = np.linalg.norm(means.applied_n, axis=1)
    unit = means.applied_n / load[:, None]
    along = np.einsum("ij,ij->i", force_n, unit)
    across = np.linalg.norm(force_n - along[:, None] * unit, axis=1)
    out = means.sessions[["id", "platform", "axis", "repeat"]].copy()
    out["method"] = method
    out["load_n"] = load
    out["force_n"] = along
    out["error_n"] = along - load
    out["across_n"] = across
    out["uncertainty_n"] = np.sqrt(np.einsum("ij,ij->i", unit**2, uncertainty_n**2))
    for k, axis in enumerate(_AXES):
        out[f"error_{axis}_n"] = force_n[:, k] - means.applied_n[:, k]
    return out


def by_load(table: pd.DataFrame) -> pd.DataFrame:
    """Mean error of each platform, axis and load with its interval, spread of the repeats, propagated uncertainty."""
    rows = []
    for (platform, axis, method, load), part in table.groupby(["platform", "axis", "method", "load_n"]):
        mean, (low, high) = mean_interval(part["error_n"])
        rows.append(
            {
                "platform": platform,
                "axis": axis,
                "method": method,
                "load_n": load,
                "repeats": len(part),
                "error_n": mean,
                "low_95_n": low,
                "high_95_n": high,
                "error_percent": 100 * mean / load,
                "repeatability_n": part["error_n"].std(ddof=1),
                "across_n": part["across_n"].mean(),
                "uncertainty_n": part["uncertainty_n"].mean(),
            }
        )
    return pd.DataFrame(rows)


def by_series(table: pd.DataFrame) -> pd.DataFrame:
    """Each platform and axis: r (fig. 2.45), slope with its interval, largest error, repeatability, error's growth.

    `bend_percent_per_n` is the slope of the relative error over the load with its interval: not zero where the
    platform reads further off as the load grows.
    """
    rows = []
    for (platform, axis, method), part in table.groupby(["platform", "axis", "method"]):
        line = fit_line(part["load_n"], part["force_n"])
        # A weight along the load's axis of 1/load: the relative error is what a bench that gives way changes.
        bend = fit_line(part["load_n"], part["error_n"] / part["load_n"])
        within = part.groupby("load_n")["error_n"]
        freedom = (within.count() - 1).clip(lower=0)
        pooled = np.sqrt((within.var(ddof=1) * freedom).sum() / freedom.sum())
        low, high = line.interval(1)
        low_bend, high_bend = bend.interval(1)
        rows.append(
            {
                "platform": platform,
                "axis": axis,
                "method": method,
                "recordings": len(part),
                "r": line.r,
                "one_minus_r": 1 - line.r,
                "slope": line.a1,
                "slope_low_95": low,
                "slope_high_95": high,
                "rms_error_n": float(np.sqrt((part["error_n"] ** 2).mean())),
                "largest_mean_error_n": float(within.mean().abs().max()),
                "repeatability_n": float(pooled),
                "across_n": float(part["across_n"].mean()),
                "bend_percent_per_n": 100 * bend.a1,
                "bend_low_95": 100 * low_bend,
                "bend_high_95": 100 * high_bend,
            }
        )
    return pd.DataFrame(rows)


def only(means: Means, kept: np.ndarray) -> Means:
    """The recordings for which `kept` is true."""
    sessions = means.sessions[kept].reset_index(drop=True)
    return Means(sessions, means.values[kept], means.variance[kept], means.applied_n[kept])


def methods_compared(table: pd.DataFrame) -> dict:
    """Equations and matrix on the same loads: RMS error per component, N, and of the whole as a share of the load.

    Along one axis only recordings that the matrix has not seen are compared.
    """
    out = {}
    matrix = table[table["method"] == "matrix"]
    for name, single in (("one_axis", True), ("several_axes", False)):
        seen = matrix[(matrix["axis"].str.len() == 1) == single]
        entry = {"recordings": len(seen), "largest_load_n": float(seen["load_n"].max())}
        for method in ("equations", "matrix"):
            part = table[(table["method"] == method) & table["id"].isin(seen["id"])]
            squares = part[[f"error_{axis}_n" for axis in _AXES]].to_numpy() ** 2
            entry[method] = {
                "rms_n": np.sqrt(squares.mean(axis=0)).tolist(),
                "rms_share_of_load": float(np.sqrt(squares.sum() / (part["load_n"] ** 2).sum())),
                "largest_share_of_load": float((np.sqrt(squares.sum(axis=1)) / part["load_n"]).max()),
            }
        out[name] = entry
    return out


@dataclass(frozen=True)
class _Calibration:
    """The bench's answer to forces and its inverse."""

    response_v_n: np.ndarray
    """R, V/N, shape (6, 3): column by column the cells' voltages for 1 N along +x, +y, +z."""
    matrix_n_v: np.ndarray
    """A, N/V, shape (3, 6)."""
    response_covariance: np.ndarray
    """Covariance of the rows of R up to each cell's variance: (Fᵀ F)⁻¹, 1/N², shape (3, 3)."""
    residual_v: np.ndarray
    """Standard deviation of each cell's residuals, V, shape (6,)."""
    degrees_of_freedom: int

    def force(self, volts: np.ndarray) -> np.ndarray:
        """Force, N, shape (n, 3), of tared voltages (n, 6), V."""
        return np.asarray(volts, float) @ self.matrix_n_v.T

    def response_interval(self, level: float = 0.95) -> np.ndarray:
        """Half widths of the intervals of R, V/N, shape (6, 3)."""
        quantile = student_quantile(self.degrees_of_freedom, 0.5 + level / 2)
        return quantile * np.outer(self.residual_v, np.sqrt(np.diag(self.response_covariance)))

    def force_covariance(self, force_n: np.ndarray, noise_v: np.ndarray) -> np.ndarray:
        """Covariance of a force, N², shape (n, 3, 3), to first order: R's own and the readings' noise (V, shape (6,)).

        dF = A dv − A dR F: the error of R at a force enters as the voltages would.
        """
        force = np.atleast_2d(force_n)
        spread = np.einsum("ni,ij,nj->n", force, self.response_covariance, force)
        variance = np.asarray(noise_v, float) ** 2 + spread[:, None] * self.residual_v**2
        return np.einsum("ij,nj,kj->nik", self.matrix_n_v, variance, self.matrix_n_v)


def calibrate(volts: np.ndarray, force_n: np.ndarray) -> _Calibration:
    """The bench's answer to loads of known direction.

    `volts`: mean tared voltages of the cells, V, shape (n, 6). `force_n`: known loads, N, shape (n, 3), body axes;
    between them they must cover all three. Raises InputError: fewer than five loads, or none along some direction.
    """
    volts, force_n = np.asarray(volts, float), np.asarray(force_n, float)
    if len(volts) < 5 or np.linalg.matrix_rank(force_n) < 3:
        raise InputError("a calibration matrix needs at least five loads that cover all three directions")
    response, *_ = np.linalg.lstsq(force_n, volts, rcond=None)
    left = volts - force_n @ response
    freedom = len(volts) - 3
    residual = np.sqrt((left**2).sum(axis=0) / freedom)
    weight = np.diag(1 / residual**2)
    inverse = np.linalg.solve(response @ weight @ response.T, response @ weight)
    return _Calibration(response.T, inverse, np.linalg.inv(force_n.T @ force_n), residual, freedom)


def as_dict(calibration: _Calibration) -> dict:
    """The calibration for a JSON file."""
    return {
        "response_v_n": calibration.response_v_n.tolist(),
        "response_half_width_95_v_n": calibration.response_interval().tolist(),
        "matrix_n_v": calibration.matrix_n_v.tolist(),
        "residual_v": calibration.residual_v.tolist(),
        "degrees_of_freedom": calibration.degrees_of_freedom,
    }


def sets_of(sessions: pd.DataFrame) -> dict[str, int]:
    """To the id of each recording, of all platforms, the number of its set: one plan, flown once on each platform.

    A set is numbered by its recordings' `repeat`. Where a platform has flown that number already, the recordings of
    the later group are a set of their own, with the next number that is free: two flights are never taken for one.

    Raises InputError for a group that holds a platform twice.
    """
    platforms: dict[int, set[str]] = {}
    numbers: dict[str, int] = {}
    for group, flown in sorted(sessions.groupby("group"), key=lambda part: (part[1]["started"].min(), part[0])):
        for number, part in flown.groupby(flown["repeat"].astype(int)):
            twice = part[part["platform"].duplicated(keep=False)]
            if len(twice):
                ids = ", ".join(twice["id"])
                raise InputError(f"{ids}: group {group} holds the same platform and repeat twice; give each its own")
            here = set(part["platform"])
            if here & platforms.get(number, set()):
                number = max(platforms) + 1
            platforms.setdefault(number, set()).update(here)
            numbers |= dict.fromkeys(part["id"], number)
    return numbers


def flights(
    force_z_n: dict[str, np.ndarray], prepared: pd.DataFrame, sessions: pd.DataFrame, sets: dict[str, int]
) -> pd.DataFrame:
    """Thrust (−F_z) over time since `read_start`, columns `platform set time_s thrust_n low_pass_n zero_phase_n`.

    `force_z_n` gives F_z of each prepared recording for the three kinds of signal, keyed by id and kind
    (`<id>`, `<id>_low_pass`, `<id>_zero_phase`); `sets` is of `sets_of`.
    """
    parts = by_recording(prepared)
    out = []
    for session in sessions.itertuples():
        table = parts[session.id]
        kept = table["index"].between(session.mark_read_start, session.mark_read_stop).to_numpy()
        if not kept.any():
            raise InputError(f"{session.id}: nothing between its marks read_start and read_stop")
        time_s = table["time_s"].to_numpy()[kept]
        flight = {"platform": session.platform, "set": sets[session.id], "time_s": time_s - time_s[0]}
        for column, kind in (("thrust_n", ""), ("low_pass_n", "_low_pass"), ("zero_phase_n", "_zero_phase")):
            flight[column] = -force_z_n[f"{session.id}{kind}"][kept]
        out.append(pd.DataFrame(flight))
    return pd.concat(out, ignore_index=True)


def _held(time_s: np.ndarray, thrust_n: np.ndarray) -> list[tuple[float, float]]:
    """Stretches (start and stop, s) in which a smooth thrust above rest is held.

    Over every `_HELD_S` within a stretch the thrust spans less than twice `_HELD_N`; stretches whose levels do not
    differ by more than that are one.
    """
    step_s = float(np.median(np.diff(time_s)))
    window = max(2, round(_HELD_S / step_s))
    series = pd.Series(thrust_n)
    flat = (series.rolling(window).max() - series.rolling(window).min() < 2 * _HELD_N).to_numpy()
    found: list[tuple[float, float]] = []
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flat.astype(int), [0]])))
    for first, beyond in edges.reshape(-1, 2):
        start = first - window + 1
        if np.mean(thrust_n[start:beyond]) > 5 * _HELD_N:
            found.append((float(time_s[start]), float(time_s[beyond - 1])))
    return found


def agreement(flown: pd.DataFrame, base: str = "al") -> pd.DataFrame:
    """Mean thrust of every platform in the stretches that `base` holds, one row a stretch and platform.

    The plan of a set is the same on all platforms; a margin at both ends allows for the pilot's timing. Columns
    `set stretch start_s stop_s platform thrust_n error_n` (standard error of the mean from the samples' scatter,
    neighbours' correlation included). A set that `base` did not fly compares nothing.
    """
    rows = []
    for number, flights_of_set in flown.groupby("set"):
        steady = flights_of_set[flights_of_set["platform"] == base]
        if steady.empty:
            continue
        stretches = _held(steady["time_s"].to_numpy(), steady["zero_phase_n"].to_numpy())
        for place, (start, stop) in enumerate(stretches, start=1):
            if stop - start <= 2 * _MARGIN_S:
                continue
            for platform, flight in flights_of_set.groupby("platform"):
                inside = flight["time_s"].between(start + _MARGIN_S, stop - _MARGIN_S)
                found = mean_and_error(flight.loc[inside, "thrust_n"].to_numpy())
                rows.append((number, place, start, stop, platform, *found))
    return pd.DataFrame(rows, columns=["set", "stretch", "start_s", "stop_s", "platform", "thrust_n", "error_n"])


def ratios(levels: pd.DataFrame, base: str = "al") -> list[dict]:
    """Each other platform against `base`: slope over all stretches, one zero per set, with 95 % intervals.

    A flight's tare is shared by all its stretches (25 samples of a noisy sensor leave an error), so each set has a
    zero of its own: thrust = zero_set + slope · thrust_base, least squares; the pilot's scatter is in the residuals.
    """
    wide = levels.pivot_table(index=["set", "stretch"], columns="platform", values="thrust_n")
    out = []
    for platform in (name for name in wide.columns if name != base):
        both = wide[[base, platform]].dropna()
        means = both.groupby("set").mean()
        centred = both - both.groupby("set").transform("mean")
        x, y = centred[base].to_numpy(), centred[platform].to_numpy()
        slope = float(x @ y / (x @ x))
        freedom = len(x) - len(means) - 1
        error = np.sqrt(np.sum((y - slope * x) ** 2) / freedom / (x @ x))
        half = float(student_quantile(freedom, 0.975) * error)
        out.append(
            {
                "platform": platform,
                "ratio": slope,
                "interval_95": (slope - half, slope + half),
                "zeros_n": (means[platform] - slope * means[base]).tolist(),
                "stretches": len(both),
            }
        )
    return out


def figures(flown: pd.DataFrame) -> pd.DataFrame:
    """One row a flight: largest smoothed thrust, mean thrust, noise at rest, return to zero."""
    rows = []
    for (number, platform), flight in flown.groupby(["set", "platform"]):
        time_s = flight["time_s"].to_numpy()
        before, after = time_s < _REST_S, time_s > time_s[-1] - _REST_S
        rest = flight.loc[before, "thrust_n"]
        rows.append(
            {
                "set": number,
                "platform": platform,
                "largest_n": float(flight["zero_phase_n"].max()),
                "largest_low_pass_n": float(flight["low_pass_n"].max()),
                "mean_n": float(flight["thrust_n"].mean()),
                "noise_n": float(rest.std(ddof=1)),
                "return_to_zero_n": float(flight.loc[after, "thrust_n"].mean() - rest.mean()),
            }
        )
    return pd.DataFrame(rows)
