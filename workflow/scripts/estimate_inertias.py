"""Grey box, better: an excitation under which every inertia shows, and output error with intervals.

- Standard errors that the thesis's manoeuvres and the designed multisine allow, for the same readings.
- The multisine flown in closed loop with motor lag, disturbance and noisy readings.
- Inertias by output error over windows for many such flights, each with its own disturbance and noise; gyroscopic
  weights left free and tested for consistency.
"""

import json
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.recordings import read_vehicle
from rotorid.vehicle.control import AttitudePid, training_reference, validation_reference
from rotorid.vehicle.mixer import wrench_matrix
from rotorid.vehicle.simulator import Disturbance, Motors, Start, simulate
from rotorid_lab import log
from rotorid_lab.config import READING_S
from rotorid_lab.grey_box import (
    WEIGHT_NAMES,
    check_consistency,
    cut_windows,
    fit_output_error,
    tied,
    untied,
    weights_of_inertias,
)
from rotorid_lab.inertias import WINDOW_S, ExcitedHold, Readings, design, promised_errors, readings_at_hover

AXES = ("xx", "yy", "zz")


def moments_of(vehicle, speeds: np.ndarray) -> np.ndarray:
    """Moments (n, 3), N m, of rotor speeds (n, k), rad/s."""
    return speeds**2 @ wrench_matrix(vehicle)[1:].T


def promises(vehicle, flights: dict[str, tuple[np.ndarray, np.ndarray]], readings: Readings, truth) -> pd.DataFrame:
    """Standard errors of the six weights for each manoeuvre, scaled to ten seconds of readings."""
    rows = []
    for name, (rates, moments) in flights.items():
        errors = promised_errors(rates, moments, truth, readings, READING_S, WINDOW_S)
        errors = errors * np.sqrt(len(rates) * READING_S / 10.0)
        rows += [
            {"manoeuvre": name, "weight": weight, "standard_error": error}
            for weight, error in zip(WEIGHT_NAMES, errors, strict=True)
        ]
    return pd.DataFrame(rows)


def untied_weights(fit) -> tuple[np.ndarray, np.ndarray]:
    """The six weights and their covariance from a fit with gyroscopic weights of their own."""
    torque = np.exp(-fit.parameters[:3])
    slope = np.zeros((6, 6))
    slope[:3, 3:] = np.eye(3)
    slope[3:, :3] = -np.diag(torque)
    return np.concatenate([fit.parameters[3:6], torque]), slope @ fit.covariance @ slope.T


def main(
    vehicle_file: str,
    limits_rad_s: tuple[float, float],
    design_limits_rad_s: tuple[float, float],
    tilt_deg: float,
    harmonics: tuple[int, int],
    period_s: float,
    candidates: int,
    duration_s: float,
    step_s: float,
    motor_time_s: float,
    moment_n_m: float,
    force_n: float,
    correlation_s: float,
    rate_noise: float,
    speed_noise_relative: float,
    draws: int,
    seed: int,
    fits: str,
    errors: str,
    identifiability: str,
    traces: str,
) -> None:
    """Design, fly, estimate; write results (JSON), one row a draw, the promises and a stretch of the flight (CSV)."""
    vehicle, rng = read_vehicle(Path(vehicle_file)), np.random.default_rng(seed)
    truth = np.diag(vehicle.inertia_kg_m2.matrix())
    wanted = tuple(design_limits_rad_s), np.radians(tilt_deg), tuple(harmonics), period_s
    readings = readings_at_hover(vehicle, rate_noise, speed_noise_relative, 1 / READING_S)
    multisine, _ = design(vehicle, *wanted, readings, candidates, rng)
    push = Disturbance(force_n, moment_n_m, correlation_s)
    lag, hold = Motors(motor_time_s), ExcitedHold(vehicle, multisine, tuple(limits_rad_s))
    start = Start(*(np.zeros((draws, 3)) for _ in range(4)))
    trace = simulate(vehicle, hold, duration_s, step_s, start, lag, disturbance=push, rng=rng)
    # Commands are held over a step, and between two readings the speeds bend by what no reading shows: with steps
    # as long as the readings' the inertias would come out up to 0.05 % large, a quarter of that with half as long.
    every = round(READING_S / step_s)
    rates, speeds = trace.angular_velocity[0, ::every], trace.rotor_speed[0, ::every]
    flights = {}
    for reference in (training_reference(), validation_reference()):
        flown = simulate(vehicle, AttitudePid(vehicle, reference), 10.0, READING_S, motors=Motors(0.0))
        flights[f"thesis, {reference.name}"] = flown.angular_velocity[0], moments_of(vehicle, flown.rotor_speed[0])
    flights["designed multisine"] = rates, moments_of(vehicle, speeds)
    promises(vehicle, flights, readings, truth).to_csv(identifiability, index=False, float_format="%.6g")

    rows, fitted = [], []
    for draw in range(draws):
        noise = np.random.default_rng([seed, draw])
        read_speeds = trace.rotor_speed[draw, ::every] * (1 + speed_noise_relative * noise.normal(size=speeds.shape))
        read_rates = trace.angular_velocity[draw, ::every] + rate_noise * noise.normal(size=rates.shape)
        windows = cut_windows(read_rates, moments_of(vehicle, read_speeds), READING_S, WINDOW_S)
        guess = np.log(truth * np.array([1.2, 0.85, 1.1]))
        fit = fit_output_error(*windows, READING_S, tied, guess, moment_noise_n_m=readings[1])
        apart = np.concatenate([guess, np.zeros(3)])
        free = fit_output_error(*windows, READING_S, untied, apart, moment_noise_n_m=readings[1])
        weights, covariance = untied_weights(free)
        agreement = check_consistency(weights, covariance)
        fitted.append((fit, weights, covariance, agreement))
        row = {"draw": draw, "consistency_p": agreement["p_value"]}
        for k, axis in enumerate(AXES):
            low, high = fit.inertia_intervals_95[k]
            row |= {
                f"{axis}_error_percent": 100 * (fit.inertias[k] / truth[k] - 1),
                f"{axis}_half_width_percent": 50 * (high - low) / truth[k],
                f"{axis}_inside": low <= truth[k] <= high,
            }
        rows.append(row)
    table = pd.DataFrame(rows)
    table.to_csv(errors, index=False, float_format="%.6g")
    fit, weights, covariance, agreement = fitted[0]
    found = {
        "duration_s": duration_s,
        "largest_tilt_deg": float(np.degrees(np.abs(trace.euler_rad[0, :, :2]).max())),
        "speed_range_rad_s": [float(speeds.min()), float(speeds.max())],
        "moment_rms_n_m": moments_of(vehicle, speeds).std(axis=0).tolist(),
        "rate_rms_rad_s": rates.std(axis=0).tolist(),
        "inertias": fit.inertias.tolist(),
        "intervals_95": fit.inertia_intervals_95.tolist(),
        "error_percent": (100 * (fit.inertias / truth - 1)).tolist(),
        "largest_error_percent": [float(table[f"{a}_error_percent"].abs().max()) for a in AXES],
        "mean_error_percent": [float(table[f"{a}_error_percent"].mean()) for a in AXES],
        "coverage": float(np.mean([table[f"{a}_inside"].mean() for a in AXES])),
        "gyroscopic": weights[:3].tolist(),
        "gyroscopic_sigma": np.sqrt(np.diag(covariance)[:3]).tolist(),
        "gyroscopic_truth": weights_of_inertias(truth)[:3].tolist(),
        "consistency_p": agreement["p_value"],
        "consistency_p_smallest": float(table["consistency_p"].min()),
        "consistency_share": float(np.mean(table["consistency_p"] > 0.05)),
        "draws": draws,
        "all_within_0_2_percent": bool(max(table[f"{a}_error_percent"].abs().max() for a in AXES) < 0.2),
    }
    Path(fits).write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    shown = slice(0, int(min(period_s, 5.0) / READING_S))
    moments = moments_of(vehicle, speeds)
    stretch = {"time_s": trace.time_s[::every][shown]}
    for k, axis in enumerate("xyz"):
        stretch[f"moment_{axis}_n_m"] = moments[shown, k]
        stretch[f"angular_velocity_{axis}_rad_s"] = rates[shown, k]
    pd.DataFrame(stretch).to_csv(traces, index=False, float_format="%.6g")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        settings = {k: v for k, v in snakemake.params.items() if k != "code"}
        main(vehicle_file=snakemake.input.vehicle, **settings, **dict(snakemake.output.items()))
