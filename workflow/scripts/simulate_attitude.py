"""The thesis's attitude-control simulation (section 4.1.3, figure 4.9).

- PID of table 4.2 on Euler angles, allocation by the true inverse of eq. 4.31, references of eq. 4.28.
- Random moment and force on the airframe; noise on what is recorded.
"""

import json
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.recordings import read_vehicle
from rotorid.vehicle.control import AttitudePid, training_reference
from rotorid.vehicle.mixer import wrench_matrix
from rotorid.vehicle.simulator import Disturbance, simulate
from rotorid_lab import log


def traces(trace, vehicle, reference, rate_noise: float, acceleration_noise: float, rng) -> pd.DataFrame:
    """Columns of the flight: angles and their references (rad), rates, accelerations and moments with noise."""
    table = {"time_s": trace.time_s}
    wanted = np.array([reference.euler_rad(t) for t in trace.time_s])
    noisy = {
        "angular_velocity_{}_rad_s": (trace.angular_velocity[0], rate_noise),
        "angular_acceleration_{}_rad_s2": (trace.angular_acceleration[0], acceleration_noise),
        "moment_{}_n_m": (trace.rotor_speed[0] ** 2 @ wrench_matrix(vehicle)[1:].T, 0.0),
        "position_{}_m": (trace.position[0], 0.0),
    }
    for k, (axis, angle) in enumerate(zip("xyz", ("roll", "pitch", "yaw"), strict=True)):
        table[f"{angle}_rad"] = trace.euler_rad[0, :, k]
        table[f"{angle}_reference_rad"] = wanted[:, k]
        for name, (values, sigma) in noisy.items():
            table[name.format(axis)] = values[:, k] + sigma * rng.normal(size=len(values))
    return pd.DataFrame(table)


def main(
    vehicle_file: str,
    duration_s: float,
    step_s: float,
    moment_n_m: float,
    correlation_s: float,
    rate_noise: float,
    acceleration_noise: float,
    seed: int,
    flight: str,
    summary: str,
) -> None:
    """Simulate and write the traces (CSV) and the tracking errors (JSON)."""
    vehicle, rng = read_vehicle(Path(vehicle_file)), np.random.default_rng(seed)
    reference = training_reference()
    push = Disturbance(moment_n_m=moment_n_m, correlation_s=correlation_s)
    trace = simulate(vehicle, AttitudePid(vehicle, reference), duration_s, step_s, disturbance=push, rng=rng)
    table = traces(trace, vehicle, reference, rate_noise, acceleration_noise, rng)
    table.to_csv(flight, index=False, float_format="%.9g")
    late = table["time_s"] > 1.0
    found = {"thrust_n": reference.thrust_n, "weight_n": vehicle.mass_kg * vehicle.gravity_m_s2}
    for angle in ("roll", "pitch", "yaw"):
        error = np.degrees(table[f"{angle}_rad"] - table[f"{angle}_reference_rad"])[late]
        found[f"{angle}_rms_deg"] = float(np.sqrt(np.mean(error**2)))
    found["largest_moment_n_m"] = [float(np.abs(table[f"moment_{a}_n_m"]).max()) for a in "xyz"]
    found["fallen_m"] = float(trace.position[0, -1, 2])
    Path(summary).write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            vehicle_file=snakemake.input.vehicle,
            duration_s=snakemake.params.duration_s,
            step_s=snakemake.params.step_s,
            moment_n_m=snakemake.params.moment_n_m,
            correlation_s=snakemake.params.correlation_s,
            rate_noise=snakemake.params.rate_noise,
            acceleration_noise=snakemake.params.acceleration_noise,
            seed=snakemake.params.seed,
            flight=snakemake.output.flight,
            summary=snakemake.output.summary,
        )
