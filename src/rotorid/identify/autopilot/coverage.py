"""How often a true value lies in its stated 95 % interval: simulated flights by each autopilot's own map.

    python -m rotorid.identify.autopilot.coverage docs/proof/autopilot_parameters.csv [flights a map]

writes a row a flight and parameter.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.identify.autopilot.known_flights import GRAVITY, FlightTruth, drawn, flight
from rotorid.identify.autopilot.parameters import AutopilotParameter, parameters_of
from rotorid.identify.autopilot.thrust_maps import MAPS

FLIGHTS = 25
SEED = 46


def _true_values(truth: FlightTruth) -> dict[str, float]:
    """What a flight was made with, by the names and in the units of `parameters_of`."""
    shapes = MAPS[truth.autopilot].shapes
    values = {s.name: s.factor * v for s, v in zip(shapes, truth.shapes, strict=True)}
    values["motor_time_constant_s"] = truth.time_constant_s
    if truth.autopilot in ("px4", "ardupilot"):
        values["MPC_THR_HOVER" if truth.autopilot == "px4" else "MOT_THST_HOVER"] = GRAVITY / truth.full_m_s2
    if truth.autopilot == "px4":
        values |= {"EKF2_BCOEF_X": 1 / truth.bluff[0], "EKF2_BCOEF_Y": 1 / truth.bluff[1]}
        values |= {"EKF2_MCOEF": truth.momentum}
        values |= {"wind_north_m_s (flight)": truth.wind_m_s[0], "wind_east_m_s (flight)": truth.wind_m_s[1]}
    return values


def counted(autopilot: str, seeds: Sequence[int], seconds: float = 40.0) -> pd.DataFrame:
    """A row a flight and parameter: true, value, low, high, whether it is determined, whether it is in."""
    rows = []
    for seed in seeds:
        rng = np.random.default_rng([SEED, list(MAPS).index(autopilot), seed])
        truth = drawn(autopilot, rng)
        found: dict[str, AutopilotParameter] = {
            p.name: p for p in parameters_of(flight(truth, rng, seconds), autopilot)
        }
        for name, true in _true_values(truth).items():
            p = found[name]
            low, high = p.interval_95
            rows.append((autopilot, seed, name, true, p.value, low, high, p.determined, low <= true <= high))
    names = ["autopilot", "flight", "parameter", "true", "value", "low_95", "high_95", "determined", "covered"]
    return pd.DataFrame(rows, columns=names)


def main(path: Path, flights: int) -> None:
    """Count `flights` of each map and write the table."""
    table = pd.concat([counted(autopilot, range(flights)) for autopilot in MAPS], ignore_index=True)
    table.round(9).to_csv(path, index=False)
    for keys, own in table.groupby(["autopilot", "parameter"], sort=False):
        print(*keys, f"{own['covered'].sum()} of {len(own)} covered, {own['determined'].sum()} determined")
    print(f"{table['covered'].sum()} of {len(table)} covered ({table['covered'].mean():.1%})")


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else FLIGHTS)
