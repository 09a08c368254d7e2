"""Inertias by the masked network of thesis 4.3.2 on the simulated manoeuvre (figure 4.22), and what is wrong with it.

- The network from random weights at the thesis's rate: batch, as the thesis trains it, and by its other two data
  methods; batch with inputs and outputs scaled.
- What the thesis's convergence in 20,000 epochs asks of the torques.
- Least squares on the same data, where both would end, with intervals.
- The consistency test of the gyroscopic weights: on these weights, and on those that the thesis prints.
- How well the manoeuvre can determine each weight at all.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.special import chdtri

from rotorid.recordings import read_vehicle
from rotorid_lab import grey_box, log
from rotorid_lab.grey_box import (
    WEIGHT_NAMES,
    NetworkFit,
    check_consistency,
    fit_least_squares,
    fit_masked_network,
    inertias_of_weights,
    weights_of_inertias,
)
from rotorid_lab.networks import Training

THESIS_EPOCHS = 20_000
"""Where the thesis reads off its figure 4.22 that the error of the yaw acceleration has converged."""
MINI_BATCH = 100
COLUMNS = ("angular_velocity_{}_rad_s", "angular_acceleration_{}_rad_s2", "moment_{}_n_m")


def columns(table: pd.DataFrame, name: str) -> np.ndarray:
    return table[[name.format(a) for a in "xyz"]].to_numpy()


def consistency(weights, covariance) -> dict:
    found = check_consistency(weights, covariance)
    return {
        "trained": found["trained"].tolist(),
        "implied": found["implied"].tolist(),
        "sigma": found["sigma"].tolist(),
        "z": (found["gap"] / found["sigma"]).tolist(),
        "statistic": found["statistic"],
        # Only noise so many times larger than assumed would leave the relations in doubt at 5 %.
        "noise_factor": float(np.sqrt(found["statistic"] / chdtri(3, 1 - 0.95))),
        "p_value": found["p_value"],
    }


def method_row(name: str, fit: NetworkFit, truth: np.ndarray, floor: np.ndarray) -> dict:
    """Epoch from which each output's error stays within 1 % (of its first value) of the floor, and the errors left.

    The floor, shape (3,), is the mean squared error that least squares leaves, in the units of the training. An output
    that is not there by the last epoch has none.
    """
    settled = []
    for axis in range(3):
        above = fit.mse[:, axis] - floor[axis] > 0.01 * (fit.mse[0, axis] - floor[axis])
        last = int(np.flatnonzero(above)[-1]) + 1 if above.any() else 0
        settled.append(int(fit.epochs[last]) if last < len(above) - 1 else None)
    return {
        "method": name,
        "settled": settled,
        "error_percent": (100 * (fit.inertias / truth - 1)).tolist(),
        "weights": fit.weights.tolist(),
    }


def main(
    flight: str, vehicle_file: str, rate: float, epochs: int, every: int, seed: int, fits: str, history: str
) -> None:
    """Write weights, inertias and tests (JSON) and the error by epoch (CSV)."""
    truth = np.diag(read_vehicle(Path(vehicle_file)).inertia_kg_m2.matrix())
    table = pd.read_csv(flight)
    whole = [columns(table, name) for name in COLUMNS]
    thinned = [values[::every] for values in whole]
    how = Training(rate, epochs, every=max(epochs // 400, 1), seed=seed)
    plain, scaled = (fit_masked_network(*thinned, how, scaled=s) for s in (False, True))
    squares = fit_least_squares(*whole)
    short = fit_least_squares(*thinned, block=max(50 // every, 1))
    half = 1.96 * squares.inertia_errors
    methods = {
        name: fit_masked_network(*thinned, replace(how, method=method, group=MINI_BATCH))
        for name, method in (("stochastic", "stochastic"), ("mini_batch", "mini-batch"))
    }
    k_d = 1 / np.abs(thinned[1]).max(axis=0)
    floor = np.mean(short.residual**2, axis=0)
    rms = np.sqrt(np.mean(thinned[2] ** 2, axis=0))
    # The torque weight's share of the squared error falls by exp(-2 rate <τ²> epoch): to 1 % in the epochs read off.
    asked = np.sqrt(np.log(100) / (2 * rate * THESIS_EPOCHS))
    printed = np.array(grey_box.INERTIAL_WEIGHTS)
    found = {
        "names": list(WEIGHT_NAMES),
        "truth": weights_of_inertias(truth).tolist(),
        "network": scaled.weights.tolist(),
        "network_plain": plain.weights.tolist(),
        "epochs": epochs,
        "mini_batch": MINI_BATCH,
        "samples": len(thinned[0]),
        "samples_of_all": len(whole[0]),
        "methods": [
            method_row(name, fit, truth, floor * (k_d**2 if "scaled" in name else 1.0))
            for name, fit in (
                ("stochastic", methods["stochastic"]),
                ("mini-batch", methods["mini_batch"]),
                ("batch", plain),
                ("batch, scaled", scaled),
            )
        ],
        "thesis_epochs": THESIS_EPOCHS,
        "torque_rms_n_m": rms.tolist(),
        "torque_rms_asked_n_m": float(asked),
        "epochs_to_settle_plain": plain.epochs_to_settle.tolist(),
        "epochs_to_settle_scaled": scaled.epochs_to_settle.tolist(),
        "least_squares": squares.weights.tolist(),
        "least_squares_sigma": np.sqrt(np.diag(squares.covariance)).tolist(),
        # On the samples that the network is trained on.
        "same_samples": {
            "weights": short.weights.tolist(),
            "sigma": np.sqrt(np.diag(short.covariance)).tolist(),
            "inertias": short.inertias.tolist(),
            "half_width_95": (1.96 * short.inertia_errors).tolist(),
        },
        "thesis": list(printed),
        "inertias": {
            "truth": truth.tolist(),
            "network": scaled.inertias.tolist(),
            "network_plain": plain.inertias.tolist(),
            "least_squares": squares.inertias.tolist(),
            "interval_95": np.stack([squares.inertias - half, squares.inertias + half], axis=1).tolist(),
            "thesis": inertias_of_weights(printed).tolist(),
        },
        "network_error_percent": (100 * (scaled.inertias / truth - 1)).tolist(),
        "network_plain_error_percent": (100 * (plain.inertias / truth - 1)).tolist(),
        "thesis_error_percent": (100 * (inertias_of_weights(printed) / truth - 1)).tolist(),
        "network_consistency": consistency(scaled.weights, short.covariance),
        "network_plain_consistency": consistency(plain.weights, short.covariance),
        "thesis_consistency": consistency(printed, squares.covariance),
        "least_squares_consistency": consistency(squares.weights, squares.covariance),
    }
    Path(fits).write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    errors = pd.DataFrame(plain.mse, columns=["p", "q", "r"])
    errors[["p_scaled", "q_scaled", "r_scaled"]] = scaled.mse / k_d**2
    for name, fit in methods.items():
        errors[[f"{axis}_{name}" for axis in "pqr"]] = fit.mse
    errors.insert(0, "epoch", plain.epochs)
    errors.to_csv(history, index=False, float_format="%.6g")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            flight=snakemake.input.flight,
            vehicle_file=snakemake.input.vehicle,
            rate=snakemake.params.rate,
            epochs=snakemake.params.epochs,
            every=snakemake.params.every,
            seed=snakemake.params.seed,
            fits=snakemake.output.fits,
            history=snakemake.output.history,
        )
