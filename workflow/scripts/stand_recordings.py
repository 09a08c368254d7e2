"""The stand's tests as recording sets of kind stand.

- 48 experiments and 20 torque tests of two instruments each, put on one clock; 50 thrust tests of one.
- The clocks: arrival times first, then lift, throttle and the battery's sag.
"""

import json
import logging
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from rotorid.recordings import read_vehicle, write_set
from rotorid_acquire.io.logs import read_sessions
from rotorid_lab import log
from rotorid_lab import stand as sets
from rotorid_lab.black_box import thrust_of_throttle
from rotorid_lab.clocks import align, clock_summary, clock_table, skew

LOGGER = logging.getLogger("rotorid_lab.stand")


def main(
    quadrotor: Sequence[str],
    wrench: Sequence[str],
    torque_rotor: Sequence[str],
    torque_wrench: Sequence[str],
    thrust: Sequence[str],
    thrust_points: str,
    vehicle: str,
    clock_error: float,
    wrench_noise: dict[str, float],
    tester_noise: dict[str, float],
    folders: dict[str, str],
    clocks: str,
    summary: str,
) -> None:
    """Write the sets to `folders` (keys dynamics, torque, thrust), the clocks (CSV) and their summary (JSON).

    Tables of logs come as (samples, recordings).
    """
    believed = read_vehicle(Path(vehicle))
    name = {key: Path(folder).name for key, folder in folders.items()}
    quadrotor, wrench, torque_rotor, torque_wrench, thrust = (
        _read(pair) for pair in (quadrotor, wrench, torque_rotor, torque_wrench, thrust)
    )
    curve = thrust_of_throttle(pd.read_csv(thrust_points))
    pairs = sets.read_pairs(quadrotor, wrench, clock_error)
    aligned = align(pairs, curve)
    made = [
        sets.dynamics_set(name["dynamics"], aligned, wrench[1], believed, wrench_noise),
        sets.torque_set(
            name["torque"], torque_rotor, torque_wrench, believed, wrench_noise | tester_noise, clock_error
        ),
        sets.thrust_set(name["thrust"], thrust, believed, tester_noise),
    ]
    for recordings, folder in zip(made, folders.values(), strict=True):
        write_set(recordings, Path(folder).parent)
    table = clock_table(aligned)
    table.to_csv(clocks, index=False, float_format="%.9g")
    found = clock_summary(aligned, skew(pairs, curve))
    LOGGER.info("motors lag %.4f s, clocks differ by %.4f s", found["motor_delay_s"], found["offset_median_s"])
    Path(summary).write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


def _read(pair: Sequence[str]) -> tuple[pd.DataFrame, pd.DataFrame]:
    samples, recordings = pair
    return pd.read_parquet(samples), read_sessions(recordings)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            quadrotor=snakemake.input.quadrotor,
            wrench=snakemake.input.wrench,
            torque_rotor=snakemake.input.torque_rotor,
            torque_wrench=snakemake.input.torque_wrench,
            thrust=snakemake.input.thrust,
            thrust_points=snakemake.input.thrust_points,
            vehicle=snakemake.input.vehicle,
            clock_error=snakemake.params.clock_error,
            wrench_noise={
                "force_n": snakemake.params.force_noise_n,
                "moment_n_m": snakemake.params.moment_noise_n_m,
            },
            tester_noise={
                "force_n": snakemake.params.thrust_noise_n,
                "rotor_speed_relative": snakemake.params.speed_noise_relative,
            },
            folders={key: snakemake.output[key] for key in ("dynamics", "torque", "thrust")},
            clocks=snakemake.output.clocks,
            summary=snakemake.output.summary,
        )
