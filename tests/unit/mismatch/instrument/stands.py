"""What tests of instruments share: vehicles on stands and benches, a run of a bench, and what is claimed of them."""

import numpy as np
import pandas as pd

from rotorid.mismatch.decide.findings import Finding
from rotorid.recordings import RecordingSet, Run, Vehicle

C_F, C_Q, MASS_KG, SENSOR_Z_M = 1.4e-6, 1.9e-8, 0.65, 0.05
HUBS = ((0.09, 0.09, "ccw"), (0.09, -0.09, "cw"), (-0.09, -0.09, "ccw"), (-0.09, 0.09, "cw"))
BENCH = Vehicle.model_validate({"name": "bench", "kind": "bench", "tared": True})


def stand_vehicle(hubs=HUBS, **changes) -> Vehicle:
    """A vehicle of 0.65 kg, its rotors at `hubs` (x, y, turning sense), 0.05 m above a level sensor, not tared."""
    content = {
        "name": "stand", "kind": "stand", "mass_kg": MASS_KG,
        "rotors": [{"x_m": x, "y_m": y, "spin": s} for x, y, s in hubs], "thrust_coefficient_n_s2": C_F,
        "torque_coefficient_n_m_s2": C_Q, "rotor_radius_m": 0.06, "sensor_position_m": [0.0, 0.0, SENSOR_Z_M],
        "tared": False,
    }  # fmt: skip
    return Vehicle.model_validate(content | changes)


def one_rotor(runs, held_out=(), **changes) -> RecordingSet:
    """One rotor on a tared scale."""
    content = {"name": "scale", "kind": "stand", "rotors": [{"x_m": 0.0, "y_m": 0.0, "spin": "ccw"}], "tared": True}
    content |= {"thrust_coefficient_n_s2": C_F, "rotor_radius_m": 0.06} | changes
    return RecordingSet("scale", Vehicle.model_validate(content), tuple(runs), tuple(held_out))


def bench_run(name: str, time_s: np.ndarray, load: np.ndarray, reading: np.ndarray, **columns) -> Run:
    """A run of a bench: load and reading (n, 3), N, and further columns."""
    table = {"time_s": time_s, **columns}
    for k, a in enumerate("xyz"):
        table |= {f"force_{a}_n": reading[:, k], f"reference_force_{a}_n": load[:, k]}
    return Run(name, pd.DataFrame(table))


def claims(analysis) -> dict[str, Finding]:
    """Id to what is established or ambiguous."""
    return {f.id: f for f in analysis.findings if f.status in ("established", "ambiguous")}


def claimed(analysis) -> set[str]:
    """Ids that are established or ambiguous."""
    return set(claims(analysis))
