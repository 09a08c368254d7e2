"""Steady wrenches of the 48 experiments, the weight under tilt, the rotor's characteristics.

- Plateau (or whole cycles of a sine) of each experiment, the rest reading before and after taken off.
- The believed vehicle's wrench at the same throttles, by the thrust tests' curve, for comparison.
- Mass and centre of mass from the readings at rest under all tilts.
- C_F and C_Q next to the thesis's, and how the speed follows throttle and voltage.
"""

import json
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.recordings import read_set
from rotorid_acquire.io.logs import read_sessions
from rotorid_acquire.io.wire import EXPERIMENTS
from rotorid_lab import log
from rotorid_lab import stand as wrench
from rotorid_lab.black_box import stand_wrench, thrust_of_throttle
from rotorid_lab.rotor import SPEED_LAW_PARAMETERS, speed_by_law, speed_law


def main(
    recordings: str,
    sessions: str,
    thrust: str,
    torque: str,
    parameters: str,
    experiments: str,
    weight: str,
    characteristic: str,
    curve_of_throttle: str,
) -> None:
    """Write the experiments (CSV), the weight (JSON), the characteristics (JSON) and speed by throttle (CSV).

    `sessions` is the table of the sensor's recordings: it gives each run's number in table A.1.
    """
    stand = read_set(Path(recordings))
    number_of = read_sessions(sessions).set_index("group")["experiment"].astype(int)
    numbers = [int(number_of[run.name]) for run in stand.runs]
    evaluated = [
        wrench.evaluate(run, EXPERIMENTS[number].frequency_hz) for run, number in zip(stand.runs, numbers, strict=True)
    ]
    points = pd.read_csv(thrust)
    curve = thrust_of_throttle(points)
    forces = np.array([wrench.mean_thrust(run, entry, curve) for run, entry in zip(stand.runs, evaluated, strict=True)])
    tilts = np.array([[entry.roll_rad, entry.pitch_rad] for entry in evaluated])
    expected = stand_wrench(stand.vehicle, forces, tilts[:, 0], tilts[:, 1])
    vehicle = stand.vehicle
    believed = -np.asarray(vehicle.sensor_position_m)
    found = wrench.fit_weight(evaluated, vehicle.mass_kg, believed, vehicle.gravity_m_s2)
    at_rest = [
        wrench.weights(evaluated, mass, centre, vehicle.gravity_m_s2)
        for mass, centre in ((vehicle.mass_kg, believed), (found["mass_kg"], found["centre_m"]))
    ]
    table = wrench.table(evaluated, numbers, expected, *at_rest)
    table.to_csv(experiments, index=False, float_format="%.9g")
    Path(weight).write_text(
        json.dumps(wrench.weight_as_dict(found, vehicle.mass_kg, believed, table), indent=1) + "\n",
        encoding="utf-8",
    )
    fits = json.loads(Path(parameters).read_text(encoding="utf-8"))
    both = pd.concat([points, pd.read_csv(torque)], ignore_index=True)
    speed = speed_law(both)
    throttle = np.linspace(0.01, 0.5, 50)
    shape = np.array([speed[name] for name in SPEED_LAW_PARAMETERS])
    pd.DataFrame({"throttle": throttle, "speed_rad_s": speed_by_law(shape, throttle, np.ones(50))}).to_csv(
        curve_of_throttle, index=False, float_format="%.9g"
    )
    laws = {"c_f": fits["c_f"], "c_q": fits["c_q"], "speed": speed}
    Path(characteristic).write_text(json.dumps(laws, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            recordings=snakemake.input.recordings,
            sessions=snakemake.input.sessions,
            thrust=snakemake.input.thrust,
            torque=snakemake.input.torque,
            parameters=snakemake.input.parameters,
            experiments=snakemake.output.experiments,
            weight=snakemake.output.weight,
            characteristic=snakemake.output.characteristic,
            curve_of_throttle=snakemake.output.speed,
        )
