"""White box: rotor coefficients from the rotor tests, mass properties from the component table.

- Steady points of the thrust and torque tests; a coefficient whose tests were not recorded is left out.
- C_F and C_Q through the origin (thesis eqs 4.25, 4.26) with intervals, and with the noise of the speed considered.
- Noise of the samples behind the points: whether it grows with speed, and whether the points scatter as it says.
- Mass, centre of mass and inertia from the components by parallel axes.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import stdtr

from rotorid_acquire.io.logs import read_sessions
from rotorid_lab import grey_box, log
from rotorid_lab.inertias import compose, read_components
from rotorid_lab.rotor import (
    COLUMNS,
    LEAST_FORCE_SD_N,
    fit_coefficient,
    sample_noise,
    thrust_points,
    torque_points,
)

LEAST_TORQUE_SD_N_M = 1e-6


def coefficient(points: pd.DataFrame, believed: float, least_sd: float) -> dict:
    """C with its intervals: speed exact, and speed as noisy as its own readings at each point scattered."""
    run = [("tests", points["speed_rad_s"].to_numpy(), points["value"].to_numpy())]
    plain = fit_coefficient(run, offset=False, equal_noise=True)
    own_noise = fit_coefficient(run, offset=False)
    # The mean of n readings: its speed is uncertain by sd / sqrt(n) as a share of the speed.
    relative = float(np.median(points["speed_sd_rad_s"] / np.sqrt(points["samples"]) / points["speed_rad_s"]))
    noisy = fit_coefficient(run, offset=False, speed_noise_relative=relative, least_sd=least_sd)
    offset = fit_coefficient(run, offset=True, equal_noise=True)
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
        "standard_errors_off": (plain.value - believed) / plain.standard_error,
        "p_value": float(2 * stdtr(plain.freedom, -(abs(plain.value - believed) / plain.standard_error))),
        "thesis_inside": plain.interval_95[0] <= believed <= plain.interval_95[1],
        "interval_95_own_noise": own_noise.interval_95,
        "noise": sample_noise(points),
    }


def main(
    thrust_tests: Sequence[str],
    torque_tests: Sequence[str],
    torque_wrench: Sequence[str],
    components: str,
    thrust: str,
    torque: str,
    parameters: str,
    table: str,
) -> None:
    """Write the points (CSV), the parameters (JSON) and the comparison with table 4.1 (CSV).

    Tests come as (samples, recordings), or empty where none was recorded.
    """
    nothing = pd.DataFrame(columns=list(COLUMNS))
    lift = thrust_points(*_read(thrust_tests)) if thrust_tests else nothing
    twist = torque_points(_read(torque_tests), _read(torque_wrench)) if torque_tests and torque_wrench else nothing
    lift.to_csv(thrust, index=False)
    twist.to_csv(torque, index=False)
    coefficients = {
        key: coefficient(points, grey_box.WHITE_BOX[believed], least)
        for key, points, believed, least in (
            ("c_f", lift, "thrust_coefficient_n_s2", LEAST_FORCE_SD_N),
            ("c_q", twist, "torque_coefficient_n_m_s2", LEAST_TORQUE_SD_N_M),
        )
        if len(points)
    }
    mass_kg, centre_m, inertia = compose(read_components(components))
    found: dict[str, Any] = {
        **coefficients,
        "mass_kg": mass_kg,
        "centre_m": centre_m.tolist(),
        "inertia_kg_m2": dict(zip(("xx", "yy", "zz"), np.diag(inertia).tolist(), strict=True)),
        "inertia_difference": {
            axis: float(inertia[k, k] / grey_box.WHITE_BOX[f"inertia_{axis}_kg_m2"] - 1)
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
            "how": "fitted",
        }
        for name, unit, fit in (("C_F", "N s²", found.get("c_f")), ("C_Q", "N m s²", found.get("c_q")))
        if fit
    ]
    for axis in ("xx", "yy", "zz"):
        believed = grey_box.WHITE_BOX[f"inertia_{axis}_kg_m2"]
        value = found["inertia_kg_m2"][axis]
        rows.append(
            {
                "parameter": f"J_{axis}",
                "unit": "kg m²",
                "thesis": believed,
                "value": value,
                "difference_percent": 100 * (value / believed - 1),
                "how": "composed",
            }
        )
    pd.DataFrame(rows).to_csv(table, index=False)


def _read(pair: Sequence[str]) -> tuple[pd.DataFrame, pd.DataFrame]:
    samples, recordings = pair
    return pd.read_parquet(samples), read_sessions(recordings)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            thrust_tests=snakemake.input.thrust_tests,
            torque_tests=snakemake.input.torque_tests,
            torque_wrench=snakemake.input.torque_wrench,
            components=snakemake.input.components,
            thrust=snakemake.output.thrust,
            torque=snakemake.output.torque,
            parameters=snakemake.output.parameters,
            table=snakemake.output.table,
        )
