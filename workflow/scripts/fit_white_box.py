"""White box: rotor coefficients from the rotor tests, mass properties from the component table.

- Steady points of the thrust and torque tests from the campaign's raw logs; without logs, stand-in points.
- C_F and C_Q through the origin (thesis eqs 4.25, 4.26) with intervals, and with the noise of the speed considered.
- Mass, centre of mass and inertia from the components by parallel axes.
"""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid import log, thesis
from rotorid.rotor.campaign import generated_points, thrust_points, torque_points
from rotorid.rotor.coefficients import LEAST_FORCE_SD_N, Points, fit_coefficient
from rotorid.vehicle.mass_properties import compose, read_components

LEAST_TORQUE_SD_N_M = 1e-6


def coefficient(points: pd.DataFrame, believed: float, least_sd: float) -> dict:
    """C with its intervals: speed exact, and speed as noisy as its own readings at each point scattered."""
    run = [Points("tests", points["speed_rad_s"].to_numpy(), points["value"].to_numpy())]
    plain = fit_coefficient(run, offset=False)
    # The mean of n readings: its speed is uncertain by sd / sqrt(n) as a share of the speed.
    relative = float(np.median(points["speed_sd_rad_s"] / np.sqrt(points["samples"]) / points["speed_rad_s"]))
    noisy = fit_coefficient(run, offset=False, speed_noise_relative=relative, least_sd=least_sd)
    offset = fit_coefficient(run, offset=True)
    return {
        "value": plain.value,
        "interval_95": plain.interval_95,
        "speed_noise_relative": relative,
        "value_speed_noise": noisy.value,
        "interval_95_speed_noise": noisy.interval_95,
        "value_with_offset": offset.value,
        "offset": offset.offsets_n[0],
        "offset_interval_95": offset.offset_intervals_n[0],
        "residual_rms": plain.residual_rms_n,
        "points": plain.points,
        "thesis": believed,
        "difference": plain.value / believed - 1,
        "thesis_inside": plain.interval_95[0] <= believed <= plain.interval_95[1],
    }


def main(
    thrust_logs: Sequence[str],
    torque_logs: Sequence[str],
    components: str,
    seed: int,
    thrust: str,
    torque: str,
    parameters: str,
    table: str,
) -> None:
    """Write the points (CSV), the parameters (JSON) and the comparison with table 4.1 (CSV)."""
    if thrust_logs and torque_logs:
        lift = thrust_points(thrust_logs)
        rotor = [path for path in torque_logs if "-rotor." in path]
        twist = torque_points([(path, path.replace("-rotor.", "-wrench.")) for path in rotor])
    else:
        rng = np.random.default_rng(seed)
        c_f, c_q = thesis.WHITE_BOX["thrust_coefficient_n_s2"], thesis.WHITE_BOX["torque_coefficient_n_m_s2"]
        lift = generated_points(c_f, thesis.LARGEST_THRUST_SPEED_RAD_S, 50, 0.01, rng)
        twist = generated_points(c_q, thesis.LARGEST_TORQUE_SPEED_RAD_S, 20, 2e-4, rng)
    lift.to_csv(thrust, index=False)
    twist.to_csv(torque, index=False)
    composed = compose(read_components(components))
    found = {
        "source": "campaign" if thrust_logs and torque_logs else "generated",
        "c_f": coefficient(lift, thesis.WHITE_BOX["thrust_coefficient_n_s2"], LEAST_FORCE_SD_N),
        "c_q": coefficient(twist, thesis.WHITE_BOX["torque_coefficient_n_m_s2"], LEAST_TORQUE_SD_N_M),
        "mass_kg": composed.mass_kg,
        "centre_m": composed.centre_m.tolist(),
        "inertia_kg_m2": dict(zip(("xx", "yy", "zz"), np.diag(composed.inertia_kg_m2).tolist(), strict=True)),
        "inertia_difference": {
            axis: float(composed.inertia_kg_m2[k, k] / thesis.WHITE_BOX[f"inertia_{axis}_kg_m2"] - 1)
            for k, axis in enumerate(("xx", "yy", "zz"))
        },
    }
    Path(parameters).write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    rows = [
        {
            "parameter": name,
            "unit": unit,
            "thesis": fit["thesis"],
            "value": fit["value"],
            "low_95": fit["interval_95"][0],
            "high_95": fit["interval_95"][1],
            "difference_percent": 100 * fit["difference"],
            "how": "least squares through the origin",
        }
        for name, unit, fit in (("C_F", "N s²", found["c_f"]), ("C_Q", "N m s²", found["c_q"]))
    ]
    for axis in ("xx", "yy", "zz"):
        believed = thesis.WHITE_BOX[f"inertia_{axis}_kg_m2"]
        value = found["inertia_kg_m2"][axis]
        rows.append(
            {
                "parameter": f"J_{axis}",
                "unit": "kg m²",
                "thesis": believed,
                "value": value,
                "difference_percent": 100 * (value / believed - 1),
                "how": "component table",
            }
        )
    pd.DataFrame(rows).to_csv(table, index=False)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            thrust_logs=list(snakemake.input.get("thrust_logs", [])),
            torque_logs=list(snakemake.input.get("torque_logs", [])),
            components=snakemake.input.components,
            seed=snakemake.params.seed,
            thrust=snakemake.output.thrust,
            torque=snakemake.output.torque,
            parameters=snakemake.output.parameters,
            table=snakemake.output.table,
        )
