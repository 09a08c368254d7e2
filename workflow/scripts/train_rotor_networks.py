"""C_F and C_Q by the linear 1-4-1 network of thesis 4.3.1 (figures 4.18-4.20).

- Scaling of eqs 4.67-4.73, batch method, rate and epochs from the configuration.
- The error by epoch for several sizes of the hidden layer, each from several seeds.
- The coefficients of the weights that the thesis prints. One whose tests were not recorded is left out.
"""

import json
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid_lab import grey_box, log
from rotorid_lab.grey_box import fit_coefficient_network
from rotorid_lab.networks import Training
from rotorid_lab.rotor import fit_coefficient

HISTORY = ["coefficient", "epoch", "mse"]
SIZES = ["coefficient", "hidden", "epoch", "mse"]


def main(
    thrust: str, torque: str, rate: float, epochs: int, hidden: int, seed: int, fits: str, history: str, sizes: str
) -> None:
    """Train on the points; write coefficients (JSON), error by epoch (CSV) and by hidden size (CSV)."""
    found, curves, by_size = {}, [pd.DataFrame(columns=HISTORY)], [pd.DataFrame(columns=SIZES)]
    for name, path, key in (
        ("c_f", thrust, "thrust_coefficient_n_s2"),
        ("c_q", torque, "torque_coefficient_n_m_s2"),
    ):
        points = pd.read_csv(path)
        if points.empty:
            continue
        printed, rounding = grey_box.ROTOR_NETWORKS[key]
        speed, value = points["speed_rad_s"].to_numpy(), points["value"].to_numpy()
        coefficient, (k_x, k_d), network, kept, mse = fit_coefficient_network(
            speed, value, hidden, Training(rate, epochs, seed=seed)
        )
        squares = fit_coefficient([("tests", speed, value)], offset=False)
        mse = mse[:, 0]
        found[name] = {
            "network": coefficient,
            "least_squares": squares.value,
            "interval_95": squares.interval_95,
            "thesis_network": grey_box.GREY_BOX[key],
            "thesis_least_squares": grey_box.WHITE_BOX[key],
            "thesis_weights": printed,
            "thesis_weights_rounding": rounding,
            "network_inside": squares.interval_95[0] <= coefficient <= squares.interval_95[1],
            "k_x": k_x,
            "k_d": k_d,
            "w1": network.weights[0][:, 0].tolist(),
            "w2": network.weights[1][0].tolist(),
            "final_mse": float(mse[-1]),
            "settled_epoch": int(np.argmax(mse < 2 * mse[-1])),
        }
        curves.append(pd.DataFrame({"coefficient": name, "epoch": kept, "mse": mse}))
        for size in (1, 2, 4, 8, 16):
            runs = [
                fit_coefficient_network(speed, value, size, Training(rate, epochs, seed=s, every=5))[3:]
                for s in range(seed, seed + 8)
            ]
            middle = np.median([mse[:, 0] for _, mse in runs], axis=0)
            by_size.append(pd.DataFrame({"coefficient": name, "hidden": size, "epoch": runs[0][0], "mse": middle}))
    Path(fits).write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    pd.concat(curves[1:] or curves).to_csv(history, index=False, float_format="%.6g")
    pd.concat(by_size[1:] or by_size).to_csv(sizes, index=False, float_format="%.6g")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            thrust=snakemake.input.thrust,
            torque=snakemake.input.torque,
            rate=snakemake.params.rate,
            epochs=snakemake.params.epochs,
            hidden=snakemake.params.hidden,
            seed=snakemake.params.seed,
            fits=snakemake.output.fits,
            history=snakemake.output.history,
            sizes=snakemake.output.sizes,
        )
