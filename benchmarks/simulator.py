"""Speed of the simulator beside RotorPy on the same vehicle, commands and integration accuracy.

Run: python benchmarks/simulator.py [--out benchmarks/simulator.md]

Both fly the thesis's quadrotor with a 30 ms motor lag for a simulated time, commands changing every 2 ms.
RotorPy runs as its own simulator does (RK45 of scipy per control step) and prints the trajectory's
difference, so that speed is compared at the same answer. Times are the best of several repeats on one core.
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from rotorid.vehicle.fast import fly
from rotorid.vehicle.simulator import Commands, Motors, Start, simulate
from rotorid.vehicle.windows import Inputs, States, simulate_windows
from tests.unit.vehicle.test_simulator import UP_LEFT, rotorpy_vehicle, wiggle
from tests.unit.vehicle.thesis import thesis_vehicle

STEP_S, LAG_S = 0.002, 0.03


def best(function, repeats=5):
    times, result = [], None
    for _ in range(repeats):
        begin = time.perf_counter()
        result = function()
        times.append(time.perf_counter() - begin)
    return min(times), result


def rotorpy_flight(commands):
    from rotorpy.vehicles.multirotor import Multirotor

    state = dict(
        x=np.zeros(3),
        v=np.zeros(3),
        q=np.array([0, 0, 0, 1.0]),
        w=np.zeros(3),
        wind=np.zeros(3),
        rotor_speeds=np.full(4, 1073.0),
    )
    peer = Multirotor(rotorpy_vehicle(LAG_S), state, aero=False)
    for command in commands:
        state = peer.step(state, dict(cmd_motor_speeds=command), STEP_S)
    return state["x"] * UP_LEFT


def main(out: Path | None) -> None:
    vehicle = thesis_vehicle()
    seconds = 2.0
    commands = wiggle(int(seconds / STEP_S), STEP_S)
    start = np.zeros((1, 17))
    start[0, 3], start[0, 13:] = 1.0, 1073.0
    peer_s, peer = best(lambda: rotorpy_flight(commands), 3)
    peer_s /= seconds
    fly([vehicle], start, commands, STEP_S, LAG_S)  # compile
    long = wiggle(int(60 / STEP_S), STEP_S)
    single_s, _ = best(lambda: fly([vehicle], start, long, STEP_S, LAG_S))
    end = fly([vehicle], start, commands, STEP_S, LAG_S)[0, -1, 10:13]
    many = 2000
    sets = [vehicle.model_copy(update=dict(mass_kg=0.652 * (1 + 0.05 * i / many))) for i in range(many)]
    starts = np.repeat(start, many, axis=0)
    batch_s, _ = best(lambda: fly(sets, starts, commands, STEP_S, LAG_S, every=50), 3)
    plain = Commands(STEP_S * np.arange(len(commands)), commands)
    first = Start(rotor_speed_rad_s=np.full((1, 4), 1073.0))
    general_s, _ = best(lambda: simulate(vehicle, plain, seconds, STEP_S, first, Motors(LAG_S)), 3)
    n = 15000
    t = np.arange(n) / 250
    recorded = States(np.zeros((n, 3)), np.tile([1.0, 0, 0, 0], (n, 1)), np.zeros((n, 3)), np.zeros((n, 3)))
    speeds = np.full((n, 4), 1073.0)
    windows_s, _ = best(lambda: simulate_windows(vehicle, [], t, Inputs(speeds), recorded, step_s=0.004))
    rows = [
        ("RotorPy (scipy RK45, one vehicle)", peer_s, 1.0),
        ("rotorid.vehicle.fast, one vehicle", single_s / 60, peer_s / (single_s / 60)),
        (
            f"rotorid.vehicle.fast, {many} parameter sets",
            batch_s / (many * seconds),
            peer_s / (batch_s / (many * seconds)),
        ),
        (
            "rotorid.vehicle.simulator (controller, effects), one vehicle",
            general_s / seconds,
            peer_s / (general_s / seconds),
        ),
        (
            "rotorid.vehicle.windows, 60 s at 250 Hz in windows of 0.5 s",
            windows_s / 60,
            peer_s / (windows_s / 60),
        ),
    ]
    lines = [
        "# Simulator",
        "",
        f"`python benchmarks/simulator.py`: Python {platform.python_version()}, numpy {np.__version__}, "
        f"one core of {os.cpu_count()}, step {STEP_S * 1000:g} ms, motor lag {LAG_S * 1000:g} ms.",
        "",
        "| simulator | seconds per simulated second | times RotorPy |",
        "| --- | ---: | ---: |",
        *(f"| {name} | {value:.3g} | {ratio:.0f} |" for name, value, ratio in rows),
        "",
        f"Largest difference of the positions after {seconds:g} s: {np.abs(end - peer).max():.1e} m "
        "(RotorPy at its own default tolerance of 1e-3).",
    ]
    text = "\n".join(lines) + "\n"
    print(text)
    if out:
        out.write_text(text)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path)
    main(parser.parse_args().out)
