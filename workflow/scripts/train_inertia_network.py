"""Inertias by the masked network of thesis 4.3.2 on the simulated manoeuvre (figure 4.22), and what is wrong with it.

- The network from random weights, rate 0.8, batch: as the thesis trains it, and with inputs and outputs scaled.
- Least squares on the same data, where both would end, with intervals.
- The consistency test of the gyroscopic weights: on these weights, and on those that the thesis prints.
- How well the manoeuvre can tell each weight at all.
"""

import json
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid import log, thesis
from rotorid.estimate.consistency import check_consistency
from rotorid.estimate.inertial import (
    WEIGHT_NAMES,
    fit_least_squares,
    fit_masked_network,
    inertias_of_weights,
    weights_of_inertias,
)
from rotorid.networks.training import Training
from rotorid.recordings import read_vehicle

COLUMNS = ("angular_velocity_{}_rad_s", "angular_acceleration_{}_rad_s2", "moment_{}_n_m")


def columns(table: pd.DataFrame, name: str) -> np.ndarray:
    return table[[name.format(a) for a in "xyz"]].to_numpy()


def consistency(weights, covariance) -> dict:
    found = check_consistency(weights, covariance)
    return {
        "trained": found.trained.tolist(),
        "implied": found.implied.tolist(),
        "sigma": found.sigma.tolist(),
        "z": (found.gap / found.sigma).tolist(),
        "statistic": found.statistic,
        "p_value": found.p_value,
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
    printed = np.array(thesis.INERTIAL_WEIGHTS)
    found = {
        "names": list(WEIGHT_NAMES),
        "truth": weights_of_inertias(truth).tolist(),
        "network": scaled.weights.tolist(),
        "network_plain": plain.weights.tolist(),
        "epochs": epochs,
        "epochs_to_settle_plain": plain.epochs_to_settle.tolist(),
        "epochs_to_settle_scaled": scaled.epochs_to_settle.tolist(),
        "least_squares": squares.weights.tolist(),
        "least_squares_sigma": np.sqrt(np.diag(squares.covariance)).tolist(),
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
    errors = pd.DataFrame(plain.trained.mse, columns=["p", "q", "r"])
    k_d = np.abs(thinned[1]).max(axis=0)
    errors[["p_scaled", "q_scaled", "r_scaled"]] = scaled.trained.mse * k_d**2
    errors.insert(0, "epoch", plain.trained.epochs)
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
