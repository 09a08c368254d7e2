"""White and grey box on references and flights that were not used for training (figure 4.23).

- Eq. 4.81 flown by the white box, by the thesis's grey box and by the improved one: angular accelerations compared.
- Real flights simulated forward in windows with the published inertias and with those estimated from other flights.
"""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.recordings import Inertia, Run, Vehicle, read_set, read_vehicle
from rotorid.recordings import columns as c
from rotorid.recordings.importers.faults import read_report
from rotorid.vehicle.control import AttitudePid, validation_reference
from rotorid.vehicle.simulator import simulate
from rotorid.vehicle.windows import Inputs, States, simulate_windows
from rotorid_lab import grey_box, log
from rotorid_lab.inertias import band_signals, fit_flights

WINDOW_S = 0.25
STEP_S = 0.002
FLIGHT_COLUMNS = "set run axis windows published estimated ratio".split()


def with_inertias(vehicle: Vehicle, inertias, **changes) -> Vehicle:
    x, y, z = (float(v) for v in inertias)
    return vehicle.model_copy(update={"inertia_kg_m2": Inertia(xx=x, yy=y, zz=z), **changes})


def accelerations(vehicle: Vehicle, controller_of: Vehicle, duration_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Times and angular accelerations (n, 3), rad/s2, of `vehicle` flown by a controller made for `controller_of`."""
    pid = AttitudePid(controller_of, validation_reference())
    trace = simulate(vehicle, pid, duration_s, STEP_S)
    return trace.time_s, trace.angular_acceleration[0]


def forward_error(vehicle: Vehicle, run: Run, delay_s: float) -> tuple[np.ndarray, int]:
    """RMSE (3,), rad/s, of the body rates simulated forward in windows, and the number of windows."""
    time_s = run.time_s
    speeds = run.array(c.rotor_columns("rotor_speed", vehicle.rotor_count))
    good = np.isfinite(speeds).all(axis=1)
    late = np.column_stack([np.interp(time_s - delay_s, time_s[good], column[good]) for column in speeds.T])
    rates = run.array(c.ANGULAR_VELOCITY)
    found = simulate_windows(vehicle, [], time_s, Inputs(late), States(rates), WINDOW_S, STEP_S)
    error = found.predicted.angular_velocity - rates[found.sample]
    # A moment constant over the window (aerodynamics, trim) is not the inertia's doing: its ramp is taken out.
    ramp = np.linspace(0, 1, error.shape[1])[None, :, None]
    error = error - ramp * (error * ramp).sum(1, keepdims=True) / (ramp**2).sum(1, keepdims=True)
    return np.sqrt(np.mean(error**2, axis=(0, 1))), len(found.sample)


def real_flights(folder: Path, band_hz, rate_hz: float, block_s: float, delay_s: float, seed: int) -> list[dict]:
    """Each run simulated with the published inertias and with those estimated from all other runs."""
    recordings = read_set(folder)
    vehicle = recordings.vehicle
    parts = {run.name: band_signals(run, vehicle, band_hz, delay_s, rate_hz) for run in recordings.runs}
    rows = []
    for run in recordings.runs:
        others = [part for name, part in parts.items() if part is not None and name != run.name]
        if parts[run.name] is None or not others:
            continue
        fits = fit_flights(others, rate_hz, block_s, np.random.default_rng(seed), draws=2)
        estimated = np.diag(vehicle.inertia_kg_m2.matrix()).copy()
        # Yaw is kept as published: its band holds no moment that the rotors' speeds explain.
        estimated[:2] = [fits[0]["estimate"], fits[1]["estimate"]]
        before, count = forward_error(vehicle, run, delay_s)
        after, _ = forward_error(with_inertias(vehicle, estimated), run, delay_s)
        rows += [
            {
                "set": recordings.name,
                "run": run.name,
                "axis": axis,
                "windows": count,
                "published": before[k],
                "estimated": after[k],
                "ratio": after[k] / before[k],
            }
            for k, axis in enumerate(("roll", "pitch"))
        ]
    return rows


def main(
    vehicle_file: str,
    improved: str,
    sets: Sequence[str],
    inertias: str,
    band_hz,
    rates_hz: Sequence[float],
    block_s: float,
    duration_s: float,
    seed: int,
    traces: str,
    summary: str,
    flights: str,
) -> None:
    """Write the accelerations (CSV), their differences (JSON) and the forward errors on flights (CSV)."""
    white = read_vehicle(Path(vehicle_file))
    grey = with_inertias(
        white,
        [grey_box.GREY_BOX[f"inertia_{a}_kg_m2"] for a in ("xx", "yy", "zz")],
        thrust_coefficient_n_s2=grey_box.GREY_BOX["thrust_coefficient_n_s2"],
        torque_coefficient_n_m_s2=grey_box.GREY_BOX["torque_coefficient_n_m_s2"],
    )
    better = with_inertias(white, json.loads(Path(improved).read_text(encoding="utf-8"))["inertias"])
    table, found = {}, {"window_s": WINDOW_S}
    for name, model in (("white", white), ("thesis_grey", grey), ("improved_grey", better)):
        time_s, values = accelerations(model, model, duration_s)
        table["time_s"] = time_s
        for k, axis in enumerate("pqr"):
            table[f"{name}_{axis}_rad_s2"] = values[:, k]
    frame = pd.DataFrame(table)
    frame.to_csv(traces, index=False, float_format="%.6g")
    for name in ("thesis_grey", "improved_grey"):
        difference = np.stack([frame[f"{name}_{a}_rad_s2"] - frame[f"white_{a}_rad_s2"] for a in "pqr"])
        spread = np.stack([frame[f"white_{a}_rad_s2"] for a in "pqr"])
        found[name] = {
            "rmse_rad_s2": np.sqrt(np.mean(difference**2, axis=1)).tolist(),
            "relative": np.sqrt(np.mean(difference**2, axis=1) / np.mean(spread**2, axis=1)).tolist(),
        }
    rows = []
    delays = json.loads(Path(inertias).read_text(encoding="utf-8"))["sets"]
    for folder, rate_hz in zip(sets, rates_hz, strict=True):
        if read_report(Path(folder))["available"]:
            delay_s = delays[Path(folder).name]["xx"]["delay_ms"] / 1000
            rows += real_flights(Path(folder), tuple(band_hz), rate_hz, block_s, delay_s, seed)
    per_flight = pd.DataFrame(rows, columns=FLIGHT_COLUMNS)
    per_flight.to_csv(flights, index=False, float_format="%.6g")
    found["flights"] = {
        name: {axis: float(part["ratio"].median()) for axis, part in mine.groupby("axis")}
        for name, mine in per_flight.groupby("set")
    }
    Path(summary).write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        settings = {k: v for k, v in snakemake.params.items() if k != "code"}
        main(
            vehicle_file=snakemake.input.vehicle,
            improved=snakemake.input.improved,
            sets=snakemake.input.sets,
            inertias=snakemake.input.inertias,
            **settings,
            **dict(snakemake.output.items()),
        )
