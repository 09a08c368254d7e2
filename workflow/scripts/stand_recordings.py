"""The stand's tests as recording sets of kind stand.

- 48 experiments and 20 torque tests of two instruments each, put on one clock; 50 thrust tests of one.
"""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from rotorid import log
from rotorid.io.tables import read_sessions
from rotorid.recordings import read_vehicle, write_set
from rotorid.stand import recordings as sets


def main(
    quadrotor: Sequence[str],
    wrench: Sequence[str],
    torque_rotor: Sequence[str],
    torque_wrench: Sequence[str],
    thrust: Sequence[str],
    vehicle: str,
    clock_error: float,
    wrench_noise: dict[str, float],
    tester_noise: dict[str, float],
    folders: dict[str, str],
) -> None:
    """Write the sets to `folders` (keys dynamics, torque, thrust); tables come as (samples, recordings)."""
    believed = read_vehicle(Path(vehicle))
    name = {key: Path(folder).name for key, folder in folders.items()}
    tables = [_read(pair) for pair in (quadrotor, wrench, torque_rotor, torque_wrench, thrust)]
    made = [
        sets.dynamics_set(name["dynamics"], *tables[:2], believed, wrench_noise, clock_error),
        sets.torque_set(name["torque"], *tables[2:4], believed, wrench_noise | tester_noise, clock_error),
        sets.thrust_set(name["thrust"], tables[4], believed, tester_noise),
    ]
    for recordings, folder in zip(made, folders.values(), strict=True):
        write_set(recordings, Path(folder).parent)


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
            folders=dict(snakemake.output.items()),
        )
