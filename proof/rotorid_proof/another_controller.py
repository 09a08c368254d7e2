"""Drawn flights flown once more, along other paths by a slower controller: how far delivered vehicles are from them.

    python -m rotorid_proof.another_controller --cases 'multibody/drag/*' --out ROWS.csv

What a controller does against a disturbance is not the vehicle's: whoever learnt it predicts that controller's flights
and no other's. Vehicles are run forward for half a second at a time with the rotor speeds as they were, from the true
states, and compared with the true flight. Rows are geometric means over position, velocity, attitude and rates, over
the refitted vehicle's.
"""

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.mismatch.decide.findings import Analysis
from rotorid.mismatch.deliver.files import improved_vehicle
from rotorid.mismatch.deliver.flown import UNITS, model_of, squares_of_windows
from rotorid.mismatch.evidence.motion import HIGHEST_CUTOFF_HZ, analysis_rate_hz, build_segments, full_speed
from rotorid.recordings import Run, Vehicle, read_set
from rotorid.report.deliver import analysis_of, verdict_of
from rotorid_proof.concealed import cases, drawn
from rotorid_proof.concealed.continuous import cases as continuous
from rotorid_proof.concealed.multibody import cases as multibody
from rotorid_proof.concealed.write import write_set
from rotorid_proof.delivered import row_of

PACE = 0.6
NEGLIGIBLE = {"position": 1e-4, "velocity": 1e-3, "attitude": 1e-3, "angular_velocity": 1e-3}
"""m, m/s, rad, rad/s: smaller distances after half a second count as these; files are written with six digits."""
SHOWN = ("set", "hidden", "chosen", "derivative_channels", "again_believed", "again_delivered", "unfit", "failed")
FLOWN_AGAIN = {"multibody": multibody.flown_again, "continuous": continuous.flown_again}


def errors(vehicle: Vehicle, runs: list[Run]) -> np.ndarray:
    """Root mean squares of the windows' errors, (channels,)."""
    rate, cutoff = analysis_rate_hz(runs, vehicle, HIGHEST_CUTOFF_HZ)
    full = full_speed(runs, vehicle)
    segments = [s for r in runs for s in build_segments(r, vehicle, rate, cutoff, full_speed_rad_s=full)]
    segments = [
        replace(s, motion=replace(s.motion, rotor_speed=s.command)) if s.motion.rotor_speed is None else s
        for s in segments
    ]
    sums = squares_of_windows(segments, model_of(vehicle), lambda run, t: np.zeros(len(t), int), 1)
    found = dict(zip(UNITS, np.sqrt(sums[:, 0, 0] / np.maximum(sums[:, 1, 0], 1.0)), strict=True))
    return np.array([max(e, NEGLIGIBLE[name]) for name, e in found.items()])


def row(name: str, seed: int) -> dict:
    """Distances to the true flight, the refitted vehicle's being one."""
    simulator, family, _, _ = drawn.parts(name)
    recording, truth, _ = drawn.make(name, seed)
    with tempfile.TemporaryDirectory() as place:
        write_set(recording, Path(place) / "set")
        recordings = read_set(Path(place) / "set")
        analysis: Analysis = analysis_of(recordings)
        judged = row_of(recordings, analysis, verdict_of(analysis))
    again = [Run(n, t) for n, t in FLOWN_AGAIN[simulator](family, seed, PACE).items()]
    delivered = improved_vehicle(analysis)
    own = {
        "believed": analysis.believed,
        "refitted": analysis.refitted,
        "delivered": delivered,
        "without_derivatives": delivered.model_copy(update={"derivatives": ()}),
    }
    found = {n: errors(v, again) for n, v in own.items()}
    return {
        **judged,
        "set": name,
        "hidden": " ".join([*(e["id"] for e in truth["effects"]), *truth["wrong_parameters"]]),
        "derivative_channels": len({d.channel for d in delivered.derivatives}),
        **{f"again_{n}": round(float(np.exp(np.log(e / found["refitted"]).mean())), 4) for n, e in found.items()},
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", required=True)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    rows = []
    for case in cases.matching(args.cases, None):
        try:
            rows.append(row(case.settings, case.seed))
        except Exception as error:  # any fault of the stage is a result here
            rows.append({"set": case.name, "failed": f"{type(error).__name__}: {error}"})
        print({k: v for k, v in rows[-1].items() if k in SHOWN}, flush=True)
        pd.DataFrame(rows).to_csv(args.out, index=False)


if __name__ == "__main__":
    main()
