"""Thrust coefficient of a propeller from stand runs: through the origin, with an offset, per motor, pooled.

- Through the origin, F = C_F ω² (thesis eq. 4.25), and with an offset of each run, F = C_F ω² + F_0.
- Speeds are noisy too: where their noise σ_ω is given, the fit is the maximum-likelihood one with errors in
  both variables, min Σ (F - F_0 - C_F Ω²)²/σ_F² + (ω - Ω)²/σ_ω² over C_F, F_0 and the true speeds Ω. At its
  solution each point weighs 1/(σ_F² + (2 C_F Ω σ_ω)²); σ_F is what gives weighted residuals unit variance.
- Without a noise of the speed the covariance allows each point a variance of its own (HC2, MacKinnon and White 1985),
  with Satterthwaite's degrees of freedom: points at high speed count for more, and if they scatter more, an interval
  that takes all points as equally noisy is too narrow. Where the samples behind the points show that all are equally
  noisy (below), `equal_noise` gives the usual formula.
- One motor's interval says how well that motor's points fit a curve, not how well the propeller is known: the
  same propeller differs from motor to motor. The pooled value is therefore a random-effects mean
  (Paule and Mandel 1982) with Hartung's and Knapp's interval (2001), which holds for few motors.
- A motor is called outlying where its modified z-score, 0.6745 |C - median| / MAD, exceeds a threshold of 3.5
  (Iglewicz and Hoaglin 1993): neither centre nor scale is moved by the outlier itself.

The steady points are those of the rotor tests: 50 of thrust and 20 of torque (thesis 3.5.3), from tables of samples.

The reading at rest is taken off each test (the tare): before the motor starts, of a torque test also after.
Thrust comes from the tester alone. Torque comes from two instruments with their own clocks: the tester counts
revolutions, the wrench sensor feels the moment. The host's time shows which of its samples are of the motor's run; all
margins are in each device's own time, which also holds for an emulator that runs faster than life. Tables are those of
`rotorid_acquire.io.logs`: all samples of one instrument, and one row a recording.

Of the points two more things are asked:

- how the speed follows throttle and voltage (next to thesis fig. 3.22);
- how noisy they are, by the samples that each is the mean of. A point is the mean of n samples under load less the mean
  of m samples at rest. If every sample has the same noise s, the point has the variance s² (1/n + 1/m). Two checks of
  that, neither of which uses the scatter of the points: whether s grows with the rotor speed (RMS of s over the fastest
  quarter of the tests over that of the slowest), and whether the points scatter about the fitted curve as s says
  (chi-square of the residuals).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.optimize import brentq, least_squares
from scipy.special import chdtrc, fdtri
from scipy.special import stdtrit as student_quantile

from rotorid.errors import InputError
from rotorid.recordings import RecordingSet
from rotorid.recordings.mended import lost_speed
from rotorid_acquire.io.logs import by_recording
from rotorid_lab.clocks import device_time

_FORMS = {"origin": False, "offset": True}
_PROPELLERS = {
    "t5040c": "Cyclone T5040C, 3 blades",
    "t5045c": "Cyclone T5045C, 3 blades",
    "hq5x4": "HQ 5x4, 4 blades",
    "lumenier5x45": "Lumenier 5x4.5, 2 blades",
}
PROPELLER_COLUMNS = (
    "propeller motor form c_f_n_s2 low_95_n_s2 high_95_n_s2 offset_2s_n offset_3s_n residual_rms_n points "
    "modified_z outlying"
).split()
_RPM = 2 * np.pi / 60
_MARGIN_S = 0.6
COLUMNS = (
    *("test", "throttle", "speed_rad_s", "speed_sd_rad_s"),
    *("value", "value_sd", "samples", "rest_samples", "voltage_v"),
)
"""`rest_samples`: of how many samples the mean would be as uncertain as the tare is."""
APART_LEVEL = 0.001
"""Share of pools of one rotor's tests in which any is called apart by chance."""
_MEDIAN_OF_NORMAL = 0.6745
"""Median of the size of a normal variable over its standard deviation."""
SPEED_LAW_PARAMETERS = ("speed_at_half_rad_s", "throttle_exponent", "dead_throttle", "voltage_exponent")


Points = tuple[str, np.ndarray, np.ndarray]
"""Steady points of one run: its name, rotor speed (rad/s) and thrust (N), shape (n,) each."""


@dataclass(frozen=True)
class _CoefficientFit:
    """A thrust coefficient with its interval; offsets are empty for a fit through the origin."""

    value: float
    """C_F, N s²."""
    standard_error: float
    interval_95: tuple[float, float]
    offsets_n: tuple[float, ...]
    offset_intervals_n: tuple[tuple[float, float], ...]
    residual_rms_n: float
    points: int
    freedom: float
    """Degrees of freedom of Student's t that the interval is made with."""


def usable(speed_rad_s: np.ndarray, thrust_n: np.ndarray) -> np.ndarray:
    """Points with a speed: a reading of 0 while there is thrust is a missing speed, not a rotor at rest."""
    known = np.isfinite(speed_rad_s) & np.isfinite(thrust_n) & (speed_rad_s > 0)
    return known & ~lost_speed(speed_rad_s, thrust_n)


def _true_speeds(speed, thrust, offsets, c_f, force_sd, speed_sd):
    """Speeds nearest to reading and curve together: min (F - F_0 - C_F Ω²)²/σ_F² + (ω - Ω)²/σ_ω²."""
    found = speed.copy()
    for _ in range(8):
        left = thrust - offsets - c_f * found**2
        slope = -2 * c_f * found * left / force_sd**2 - (speed - found) / speed_sd**2
        bend = ((2 * c_f * found) ** 2 - 2 * c_f * np.minimum(left, 0)) / force_sd**2 + 1 / speed_sd**2
        found = found - slope / bend
    return found


def _each_its_own_noise(
    columns: np.ndarray, inverse: np.ndarray, residual: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Covariance (k, k) of least squares whose points have variances of their own, and degrees of freedom (k,).

    Residuals are enlarged by their leverage (HC2). The degrees of freedom are those of a chi-square with the mean and
    variance that each coefficient's variance has where all points are in truth equally noisy.
    """
    scale = np.linalg.norm(columns, axis=0)
    unit = columns / scale
    weights = (inverse * np.outer(scale, scale)) @ unit.T
    leverage = np.einsum("nk,kn->n", unit, weights)
    # A point that alone determines an unknown leaves no residual, and says nothing of its noise.
    free = np.where(1 - leverage > 1e-9, 1 / np.maximum(1 - leverage, 1e-9), 0.0)
    covariance = (weights * (residual**2 * free)) @ weights.T
    rest = np.eye(len(columns)) - unit @ weights
    freedom = []
    for row in weights:
        shape = rest @ ((row**2 * free)[:, None] * rest)
        freedom.append(np.trace(shape) ** 2 / np.sum(shape * shape.T))
    return covariance / np.outer(scale, scale), np.array(freedom)


LEAST_FORCE_SD_N = 1e-4
"""The balance is never taken as more exact than this."""


def fit_coefficient(
    runs: Sequence[Points],
    offset: bool,
    speed_noise_relative: float = 0.0,
    least_sd: float = LEAST_FORCE_SD_N,
    equal_noise: bool = False,
) -> _CoefficientFit:
    """C_F of one motor and propeller from its runs, with one offset a run where `offset`.

    `speed_noise_relative` is the one-sigma noise of the speed reading as a share of the speed, 0 for ordinary least
    squares; where it is considered the force (or torque) is never taken as more exact than `least_sd`, N (N m). Unless
    `equal_noise`, each point has a variance of its own. InputError: not more points than unknowns.
    """
    kept = [usable(speed, thrust) for _, speed, thrust in runs]
    speed = np.concatenate([speed[k] for (_, speed, _), k in zip(runs, kept, strict=True)])
    thrust = np.concatenate([thrust[k] for (_, _, thrust), k in zip(runs, kept, strict=True)])
    # Columns of the offsets, shape (n, runs) or (n, 0).
    offset_columns = np.repeat(np.eye(len(runs)), [int(k.sum()) for k in kept], axis=0)[:, : len(runs) * offset]
    unknowns = 1 + offset_columns.shape[1]
    freedom = len(speed) - unknowns
    if freedom < 1:
        names = ", ".join(name for name, *_ in runs)
        raise InputError(f"runs {names}: {len(speed)} points for {unknowns} unknowns")
    columns = np.column_stack([speed**2, offset_columns])
    scale = np.linalg.norm(columns, axis=0)
    inverse = np.linalg.inv((columns / scale).T @ (columns / scale)) / np.outer(scale, scale)
    values = inverse @ (columns.T @ thrust)
    residual = thrust - columns @ values
    variance = np.sum(residual**2) / freedom
    if equal_noise:
        covariance, freedoms = variance * inverse, np.full(unknowns, float(freedom))
    else:
        covariance, freedoms = _each_its_own_noise(columns, inverse, residual)
    if speed_noise_relative > 0:

        def fit_at(force_sd):
            """Maximum-likelihood fit with noise in thrust and speed: estimate, covariance, chi-square."""
            theta, true = values.copy(), speed
            for _ in range(60):
                offsets = offset_columns @ theta[1:]
                # A share of the true speed: a share of the reading would trust low readings more and raise C_F.
                speed_sd = speed_noise_relative * true
                true = _true_speeds(speed, thrust, offsets, theta[0], force_sd, speed_sd)
                slope = 2 * theta[0] * true
                residual = thrust - offsets - theta[0] * true**2 - slope * (speed - true)
                weight = 1 / (force_sd**2 + (slope * speed_sd) ** 2)
                columns = np.column_stack([true**2, offset_columns])
                scale = np.linalg.norm(columns, axis=0)
                inverse = np.linalg.inv((columns / scale).T @ (weight[:, None] * columns / scale))
                step = inverse @ ((columns / scale).T @ (weight * residual)) / scale
                theta = theta + step
                if abs(step[0]) < 1e-12 * abs(theta[0]):
                    break
            return theta, inverse / np.outer(scale, scale), float(np.sum(weight * residual**2))

        ceiling = 3 * np.sqrt(variance) + 2 * least_sd
        force_sd = least_sd
        if fit_at(force_sd)[2] > freedom:
            force_sd = brentq(lambda sd: fit_at(sd)[2] - freedom, force_sd, ceiling, rtol=1e-3)
        values, covariance, _ = fit_at(force_sd)
        freedoms = np.full(unknowns, float(freedom))
    half = student_quantile(freedoms, 0.975) * np.sqrt(np.diag(covariance))
    intervals = tuple((float(v - h), float(v + h)) for v, h in zip(values, half, strict=True))
    return _CoefficientFit(
        value=float(values[0]),
        standard_error=float(np.sqrt(covariance[0, 0])),
        interval_95=intervals[0],
        offsets_n=tuple(float(v) for v in values[1:]),
        offset_intervals_n=intervals[1:],
        residual_rms_n=float(np.sqrt(np.mean((thrust - columns @ values) ** 2))),
        points=len(speed),
        freedom=float(freedoms[0]),
    )


def fit_exponent(runs: Sequence[Points]) -> tuple[float, tuple[float, float]]:
    """Exponent n of F = C ω^n with one C a run, and its 95 % interval: 2 where C_F is truly constant.

    Least squares of log F on log ω; points below 2 % of the largest thrust are left out, since there the
    balance's own offset rules the logarithm.
    """
    x, y = [], []
    for _, speed, thrust in runs:
        keep = usable(speed, thrust) & (thrust > 0.02 * np.nanmax(thrust))
        log_speed, log_thrust = np.log(speed[keep]), np.log(thrust[keep])
        x.append(log_speed - log_speed.mean())
        y.append(log_thrust - log_thrust.mean())
    x, y = np.concatenate(x), np.concatenate(y)
    freedom = len(x) - len(runs) - 1
    exponent = np.sum(x * y) / np.sum(x**2)
    error = np.sqrt(np.sum((y - exponent * x) ** 2) / freedom / np.sum(x**2))
    half = student_quantile(freedom, 0.975) * error
    return float(exponent), (float(exponent - half), float(exponent + half))


def pool(values: Sequence[float], standard_errors: Sequence[float]) -> dict:
    """Random-effects mean of the motors' values: `value`, `interval_95`, `between_sd`, `prediction_95`.

    `between_sd` is the standard deviation of the true values between motors, in the unit of the values; in
    `prediction_95` the value of one further motor is expected.

    τ² solves Σ (C_i - C̄)² / (s_i² + τ²) = k - 1 (Paule and Mandel); the interval is Hartung's and Knapp's,
    with Student's t for k - 1 degrees of freedom.
    """
    values, variances = np.asarray(values, float), np.asarray(standard_errors, float) ** 2
    k = len(values)
    if k < 2 or len(variances) != k:
        raise InputError(f"pooling needs the values of at least two motors, found {k}")

    def mean_of(tau2):
        weight = 1 / (variances + tau2)
        return np.sum(weight * values) / np.sum(weight), weight

    def excess(tau2):
        mean, weight = mean_of(tau2)
        return np.sum(weight * (values - mean) ** 2) - (k - 1)

    ceiling = 10 * np.var(values, ddof=1) + 1e-300
    tau2 = brentq(excess, 0.0, ceiling, xtol=1e-12 * ceiling) if excess(0.0) > 0 else 0.0
    mean, weight = mean_of(tau2)
    spread = np.sum(weight * (values - mean) ** 2) / ((k - 1) * np.sum(weight))
    half = student_quantile(k - 1, 0.975) * np.sqrt(spread)
    ahead = student_quantile(k - 1, 0.975) * np.sqrt(tau2 + spread)
    return {
        "value": float(mean),
        "interval_95": (float(mean - half), float(mean + half)),
        "between_sd": float(np.sqrt(tau2)),
        "prediction_95": (float(mean - ahead), float(mean + ahead)),
    }


def modified_z_scores(values: Sequence[float]) -> np.ndarray:
    """0.6745 (C - median) / MAD of each value, shape (n,); zeros where the median deviation is zero."""
    values = np.asarray(values, float)
    deviation = values - np.median(values)
    scale = np.median(np.abs(deviation))
    return np.zeros_like(values) if scale == 0 else 0.6745 * deviation / scale


def rest_reading(thrust_n: Sequence[float]) -> dict:
    """Mean thrust (N) of points with the rotor at rest, its 95 % interval and their number.

    A true zero error of the balance would show here too; an offset that does not is a bend of the curve.
    """
    thrust_n = np.asarray(thrust_n, float)
    if len(thrust_n) < 2:
        return {"mean_n": None, "interval_95_n": None, "points": len(thrust_n)}
    half = student_quantile(len(thrust_n) - 1, 0.975) * thrust_n.std(ddof=1) / np.sqrt(len(thrust_n))
    mean = float(thrust_n.mean())
    return {"mean_n": mean, "interval_95_n": [float(mean - half), float(mean + half)], "points": len(thrust_n)}


def summarise_propeller(
    recordings: RecordingSet, speed_noise_relative: float, outlying_above: float
) -> tuple[dict, list[dict], list[dict]]:
    """Summary, one row a motor and form, and all points of one propeller's set.

    Runs are called `<motor>_2s` and `<motor>_3s`; keys carry their units.
    """
    name = recordings.name.removeprefix("strawson-")
    points, at_rest, lost = {}, [], 0
    for run in recordings.runs:
        speed, thrust = run.column("rotor_speed_1_rad_s"), -run.column("force_z_n")
        points.setdefault(run.name[0], []).append((run.name, speed, thrust))
        at_rest += list(thrust[(run.column("throttle_1") == 0) & (speed == 0)])
        lost += int((~usable(speed, thrust) & (run.column("throttle_1") > 0)).sum())
    summary = {"name": _PROPELLERS[name], "runs": len(recordings.runs), "points_without_speed": lost}
    rows = []
    for form, offset in _FORMS.items():
        fits = {m: fit_coefficient(p, offset, speed_noise_relative) for m, p in points.items()}
        exact = {m: fit_coefficient(p, offset) for m, p in points.items()}
        values = [fit.value for fit in fits.values()]
        scores = modified_z_scores(values)
        pooled = pool(values, [fit.standard_error for fit in fits.values()])
        without_noise = pool([f.value for f in exact.values()], [f.standard_error for f in exact.values()])
        furthest = int(np.argmax(np.abs(scores)))
        summary[form] = {
            **pooled,
            "between_relative": pooled["between_sd"] / pooled["value"],
            "value_if_speed_exact": without_noise["value"],
            "median_standard_error": float(np.median([f.standard_error for f in fits.values()])),
            "median_residual_rms_n": float(np.median([f.residual_rms_n for f in fits.values()])),
            "outlying": [m for m, z in zip(fits, scores, strict=True) if abs(z) > outlying_above],
            "furthest_motor": list(fits)[furthest],
            "furthest_modified_z": float(scores[furthest]),
        }
        for (motor, fit), score in zip(fits.items(), scores, strict=True):
            offsets = fit.offsets_n or (None, None)
            values = (fit.value, *fit.interval_95, *offsets, fit.residual_rms_n, fit.points)
            row = (name, motor, form, *values, float(score), "yes" if abs(score) > outlying_above else "")
            rows.append(dict(zip(PROPELLER_COLUMNS, row, strict=True)))
    exponents = [fit_exponent(p)[0] for p in points.values()]
    mean = float(np.mean(exponents))
    half = float(1.96 * np.std(exponents, ddof=1) / np.sqrt(len(exponents)))
    summary["exponent"] = {"value": mean, "interval_95": [mean - half, mean + half]}
    summary["rest"] = rest_reading(at_rest)
    offsets = [v for row in rows if row["form"] == "offset" for v in (row["offset_2s_n"], row["offset_3s_n"])]
    summary["mean_offset_n"] = float(np.mean(offsets))
    scattered = [
        {"propeller": name, "run": run, "speed_rad_s": s, "thrust_n": t, "used": bool(u)}
        for group in points.values()
        for run, speed, thrust in group
        for s, t, u in zip(speed, thrust, usable(speed, thrust), strict=True)
    ]
    return summary, rows, scattered


def _running(table: pd.DataFrame, name: str) -> pd.DataFrame:
    """First and last sample with the motor on."""
    on = table[table["throttle"] > 0]
    if len(on) == 0 or on["time_s"].iloc[-1] - on["time_s"].iloc[0] <= 2 * _MARGIN_S:
        raise InputError(f"{name}: the motor never ran for more than {2 * _MARGIN_S} s")
    return on.iloc[[0, -1]]


def thrust_points(samples: pd.DataFrame, recordings: pd.DataFrame) -> pd.DataFrame:
    """One row a thrust test, columns `COLUMNS` (`value` in N), by throttle.

    Raises InputError for a test whose motor never ran or that has no reading at rest.
    """
    tables = by_recording(samples[samples["quality"] == 0])
    rows = []
    for name in recordings["id"]:
        table = tables[name]
        start, stop = _running(table, name)["time_s"]
        steady = table[table["time_s"].between(start + _MARGIN_S, stop - _MARGIN_S / 3)]
        rest = table[table["time_s"] < start - 0.05]
        if len(rest) == 0:
            raise InputError(f"{name}: no sample before the motor started, so no tare")
        rows.append(_row(name, steady, steady["thrust_n"] - rest["thrust_n"].mean(), len(rest)))
    return _sorted(rows)


def torque_points(rotor: tuple[pd.DataFrame, pd.DataFrame], wrench: tuple[pd.DataFrame, pd.DataFrame]) -> pd.DataFrame:
    """One row a torque test, by throttle; `value` in N m, positive.

    `rotor` and `wrench` are (samples, recordings) of the tester and of the wrench sensor; recordings of one group are
    one test. Raises InputError for a tester's recording without the sensor's, and as `thrust_points`.
    """
    counted, felt = (by_recording(samples[samples["quality"] == 0]) for samples, _ in (rotor, wrench))
    sensors = {row.group: row for row in wrench[1].itertuples()}
    rows = []
    for drive in rotor[1].itertuples():
        if drive.group not in sensors:
            raise InputError(
                f"{drive.id}: a torque test without a recording of the wrench sensor (group {drive.group})"
            )
        read = sensors[drive.group]
        table, reading = counted[drive.id], felt[read.id]
        ends = _running(table, drive.id)
        start, stop = ends["time_s"]
        steady = table[table["time_s"].between(start + _MARGIN_S, stop - _MARGIN_S)]
        # Each recording's times count from its own beginning.
        seen = reading["host_time_s"] + (read.host_start_s - drive.host_start_s)
        start, stop = device_time(reading["time_s"], seen, ends["host_time_s"])
        when = reading["time_s"]
        loaded = reading.loc[when.between(start + _MARGIN_S, stop - _MARGIN_S), "moment_z_n_m"]
        before = reading.loc[when < start - 0.1, "moment_z_n_m"]
        after = reading.loc[when > stop + _MARGIN_S, "moment_z_n_m"]
        if len(loaded) == 0 or len(before) == 0 or len(after) == 0:
            raise InputError(f"{read.id}: no samples while the rotor ran, or none at rest before or after")
        # The run lies in the middle between both rests, so that a steady drift of the zero drops out.
        turned = loaded - (before.mean() + after.mean()) / 2
        # The sign of the mean, not of each sample: that would turn noise into torque.
        resting = 4 / (1 / len(before) + 1 / len(after))
        rows.append(_row(drive.group, steady, turned * np.sign(turned.mean()), resting))
    return _sorted(rows)


def _sorted(rows: list[dict]) -> pd.DataFrame:
    return pd.DataFrame(rows, columns=list(COLUMNS)).sort_values("throttle", ignore_index=True, kind="stable")


def _row(test: str, steady: pd.DataFrame, value: pd.Series, rest_samples: float) -> dict:
    speed = steady["speed_rpm"] * _RPM
    return {
        "test": test,
        "throttle": float(steady["throttle"].mean()),
        "speed_rad_s": float(speed.mean()),
        "speed_sd_rad_s": float(speed.std()),
        "value": float(value.mean()),
        "value_sd": float(value.std()),
        "samples": int(len(value)),
        "rest_samples": float(rest_samples),
        "voltage_v": float(steady["battery_voltage_v"].mean()),
    }


def speed_by_law(values: np.ndarray, throttle: np.ndarray, voltage_share: np.ndarray) -> np.ndarray:
    """ω, rad/s, of throttle and voltage over its mean, for values in the order of `SPEED_LAW_PARAMETERS`."""
    half, exponent, dead, sag = values
    return half * (np.clip(throttle - dead, 1e-9, None) / (0.5 - dead)) ** exponent * voltage_share**sag


def speed_law(points: pd.DataFrame) -> dict:
    """ω = ω_½ ((u − u₀)/(½ − u₀))ⁿ (V/V̄)ᵐ from steady points, with 95 % intervals.

    `points` has the columns `test throttle speed_rad_s speed_sd_rad_s samples voltage_v`; each point counts by the
    standard error of its mean speed, and the intervals are as wide as the residuals in these units ask for. `apart` are
    the tests that lie off the law by more than chance, against the spread of the others. Raises InputError
    for fewer than six points at which the motor turns.
    """
    kept = points[(points["speed_rad_s"] > 0) & (points["throttle"] > 0)]
    if len(kept) < 6:
        raise InputError("a law of throttle and voltage needs at least six points at which the motor turns")
    throttle, speed = kept["throttle"].to_numpy(), kept["speed_rad_s"].to_numpy()
    voltage_v = float(kept["voltage_v"].mean())
    share = kept["voltage_v"].to_numpy() / voltage_v
    error = (kept["speed_sd_rad_s"] / np.sqrt(kept["samples"])).to_numpy()
    largest_dead = 0.9 * float(throttle.min())
    start = np.array([np.interp(0.5, throttle, speed), 0.7, 0.1 * largest_dead, 1.0])
    fit = least_squares(
        lambda values: (speed_by_law(values, throttle, share) - speed) / error,
        start,
        bounds=([0.0, 0.1, 0.0, -5.0], [np.inf, 3.0, largest_dead, 5.0]),
        x_scale=np.array([1000.0, 1.0, 0.01, 1.0]),
    )
    freedom = len(kept) - len(SPEED_LAW_PARAMETERS)
    covariance = np.linalg.inv(fit.jac.T @ fit.jac) * 2 * fit.cost / freedom
    half = student_quantile(freedom, 0.975) * np.sqrt(np.diag(covariance))
    relative = fit.fun * error / speed
    out = {"mean_voltage_v": voltage_v, "residual_rms_relative": float(np.sqrt(np.mean(relative**2)))}
    for name, value, width in zip(SPEED_LAW_PARAMETERS, fit.x.tolist(), half.tolist(), strict=True):
        out |= {name: value, f"{name}_interval_95": [value - width, value + width]}
    spread = float(np.median(np.abs(fit.fun))) / _MEDIAN_OF_NORMAL
    limit = student_quantile(freedom, 1 - APART_LEVEL / (2 * len(kept)))
    apart = kept["test"][np.abs(fit.fun) > limit * max(spread, 1e-12)].tolist() if "test" in kept else []
    return out | {"points": len(kept), "apart": apart}


def sample_noise(points: pd.DataFrame) -> dict:
    """Noise of four tests or more (columns `COLUMNS`), and the chi-square of a parabola through the origin.

    `sd` is of one sample, all tests together, N or N m; `growth` of the fastest quarter of the tests over the slowest;
    `p_value` of a chi-square as large or larger, if the parabola holds and all samples are equally noisy.
    """
    tests = points.sort_values("speed_rad_s")
    square, value = tests["speed_rad_s"].to_numpy() ** 2, tests["value"].to_numpy()
    counts = tests["samples"].to_numpy(float)
    squares, quarter = tests["value_sd"].to_numpy() ** 2 * (counts - 1), len(tests) // 4
    ends = slice(0, quarter), slice(-quarter, None)
    slow, fast = (float(np.sum(squares[part]) / np.sum(counts[part] - 1)) for part in ends)
    freedoms = [float(np.sum(counts[part] - 1)) for part in ends]
    rest = tests["rest_samples"].to_numpy(float)
    variance = float(np.sum(squares) / np.sum(counts - 1))
    each = variance * (1 / counts + 1 / rest)
    left = value - square * np.sum(square * value / each) / np.sum(square**2 / each)
    total, freedom = float(np.sum(left**2 / each)), len(tests) - 1
    low, high = fdtri(freedoms[1], freedoms[0], [0.975, 0.025])
    return {
        "sd": variance**0.5,
        "growth": (fast / slow) ** 0.5,
        "growth_interval_95": (float((fast / slow / low) ** 0.5), float((fast / slow / high) ** 0.5)),
        "chi_square": total,
        "freedom": freedom,
        "p_value": float(chdtrc(freedom, total)),
    }
