"""Cost of the mismatch analysis: seconds of one core and memory against the length of the recording.

    python benchmarks/mismatch.py                  the table of benchmarks/mismatch.md
    python benchmarks/mismatch.py --hour           the same and an hour at 500 Hz
    python benchmarks/mismatch.py --profile        where the time goes (60 s at 250 Hz)

Each row runs in a process of its own, so that its peak memory is its own. The flight is band-limited motion with
every column of the contract; rotor drag, motor lag and a steady wind are hidden in it. It repeats every minute,
its noise does not.
"""

from __future__ import annotations

import argparse
import cProfile
import json
import os
import platform
import pstats
import resource
import subprocess
import sys
import time

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"

import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402
from scipy.spatial.transform import Rotation  # noqa: E402

from rotorid.effects.describe import EXAMPLE  # noqa: E402
from rotorid.mismatch.analyse import analyse  # noqa: E402
from rotorid.recordings import RecordingSet, Run  # noqa: E402

ROWS = ((15, 250), (30, 250), (60, 250), (120, 250), (240, 250), (600, 500))
HOUR = (3600, 500)
PERIOD_S = 60
DRAG_N_S_M, TAU_S, G = 0.26, 0.04, 9.81
WIND_M_S = np.array([2.0, -1.0, 0.0])
VEHICLE = EXAMPLE.model_copy(update={"name": "benchmark", "ground_z_m": 0.0, "rotor_speed_limits_rad_s": (0.0, 2500.0)})


def periodic(rng: np.random.Generator, rate_hz: int, size: float, highest_hz: float) -> np.ndarray:
    """Band-limited noise of a given one-sigma that repeats every PERIOD_S, (n,)."""
    count = PERIOD_S * rate_hz
    highest = int(highest_hz * PERIOD_S)
    spectrum = np.zeros(count // 2 + 1, complex)
    spectrum[1 : highest + 1] = rng.standard_normal(highest) + 1j * rng.standard_normal(highest)
    values = np.fft.irfft(spectrum, count)
    return size * values / values.std()


def slope(values: np.ndarray, rate_hz: int, order: int = 1) -> np.ndarray:
    """Derivative (order 1) or zero-mean integral (order −1) of a periodic signal along axis 0."""
    omega = 2j * np.pi * np.fft.rfftfreq(len(values), 1 / rate_hz)
    omega[0] = 1.0
    spectrum = np.fft.rfft(values, axis=0)
    spectrum[0] = 0.0
    return np.fft.irfft(spectrum * omega.reshape(-1, *[1] * (values.ndim - 1)) ** order, len(values), axis=0)


def attitude(up: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """Rotations (n, 3, 3) whose body −z points along `up` (n, 3), nose towards `yaw` (n,)."""
    z = -up / np.linalg.norm(up, axis=1, keepdims=True)
    nose = np.stack([np.cos(yaw), np.sin(yaw), np.zeros(len(yaw))], axis=1)
    y = np.cross(z, nose)
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    return np.stack([np.cross(y, z), y, z], axis=2)


def minute(rate_hz: int, seed: int = 8) -> dict[str, np.ndarray]:
    """One minute of true motion, every signal periodic: the path is given, attitude and rotors follow from it."""
    rng = np.random.default_rng(seed)
    sizes = ((2.5, 0.35, 0.02, 3.0), (2.5, 0.35, 0.02, 3.0), (0.7, 0.5, 0.02, 3.0))
    velocity = np.stack([periodic(rng, rate_hz, a, f) + periodic(rng, rate_hz, b, g) for a, f, b, g in sizes], axis=1)
    yaw = periodic(rng, rate_hz, 1.0, 0.4) + periodic(rng, rate_hz, 0.05, 2.0)
    mass, inertia, at = VEHICLE.mass_kg, VEHICLE.inertia_kg_m2.matrix(), VEHICLE.rotor_positions_m()
    ratio = VEHICLE.torque_coefficient_n_m_s2 / VEHICLE.thrust_coefficient_n_s2
    mixer = np.linalg.inv(np.stack([np.ones(4), -at[:, 1], at[:, 0], ratio * VEHICLE.yaw_signs()]))
    felt = slope(velocity, rate_hz) - [0.0, 0.0, G]
    drag, air = np.zeros_like(velocity), velocity - WIND_M_S
    for _ in range(8):
        # Thrust carries what drag does not; drag needs the attitude, which needs the thrust.
        rotation = attitude(felt - drag, yaw)
        body = np.einsum("nji,nj->ni", rotation, air) * [1.0, 1.0, 0.0]
        drag = np.einsum("nij,nj->ni", rotation, -DRAG_N_S_M / mass * body)
    force = np.einsum("nji,nj->ni", rotation, felt)
    turning = np.einsum("nji,njk->nik", rotation, slope(rotation, rate_hz))
    rates = np.stack([turning[:, 2, 1], turning[:, 0, 2], turning[:, 1, 0]], axis=1)
    moment = slope(rates, rate_hz) @ inertia + np.cross(rates, rates @ inertia)
    thrusts = np.column_stack([-mass * force[:, 2], moment]) @ mixer.T
    if thrusts.min() < 0:
        raise ValueError("no rotor pulls: the motion asks for more than the vehicle can do")
    speed = np.sqrt(thrusts / VEHICLE.thrust_coefficient_n_s2)
    quaternion = Rotation.from_matrix(rotation).as_quat(scalar_first=True)
    turned = np.einsum("ij,ij->i", quaternion[1:], quaternion[:-1]) < 0
    quaternion[1:] *= np.cumprod(np.where(turned, -1.0, 1.0))[:, None]
    return dict(
        rotor_speed=speed,
        rotor_command=speed + TAU_S * slope(speed, rate_hz),
        position=slope(velocity, rate_hz, -1) + [0.0, 0.0, -10.0],
        velocity=velocity,
        quaternion=quaternion,
        angular_velocity=rates,
        specific_force=force,
    )


NAMES = {
    "rotor_speed": [f"rotor_speed_{i}_rad_s" for i in range(1, 5)],
    "rotor_command": [f"rotor_command_{i}_rad_s" for i in range(1, 5)],
    "position": [f"position_{a}_m" for a in "xyz"],
    "velocity": [f"velocity_{a}_m_s" for a in "xyz"],
    "quaternion": [f"quaternion_{a}" for a in "wxyz"],
    "angular_velocity": [f"angular_velocity_{a}_rad_s" for a in "xyz"],
    "specific_force": [f"specific_force_{a}_m_s2" for a in "xyz"],
}
NOISE = dict(
    rotor_speed=5.0, rotor_command=0.0, position=0.002, velocity=0.02, quaternion=5e-4, angular_velocity=0.01
) | dict(specific_force=0.1)


def recording(seconds: int, rate_hz: int) -> RecordingSet:
    """A set of three runs of the given length in all, each with its own noise."""
    true, rng, runs = minute(rate_hz), np.random.default_rng(2), []
    count = seconds * rate_hz // 3
    for k in range(3):
        index = (np.arange(count) + k * count) % (PERIOD_S * rate_hz)
        table = {"time_s": np.arange(count) / rate_hz}
        for group, names in NAMES.items():
            values = true[group][index] + NOISE[group] * rng.standard_normal((count, len(names)))
            table |= {n: values[:, j] for j, n in enumerate(names)}
        table["battery_voltage_v"] = 12.4 - 1.5 * np.arange(count) / count + 0.01 * rng.standard_normal(count)
        runs.append(Run(f"run{k + 1}", pd.DataFrame(table)))
    return RecordingSet("benchmark", VEHICLE, tuple(runs))


def measured(seconds: int, rate_hz: int) -> dict:
    """Cost of one analysis in this process."""
    recordings = recording(seconds, rate_hz)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    cpu, wall = time.process_time(), time.perf_counter()
    found = analyse(recordings)
    return {
        "seconds": seconds,
        "rate_hz": rate_hz,
        "cpu_s": time.process_time() - cpu,
        "wall_s": time.perf_counter() - wall,
        "recording_mb": before / 1024,
        "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "found": sorted({f.id for f in found.findings if f.status in ("established", "ambiguous")}),
    }


def in_its_own_process(seconds: int, rate_hz: int) -> dict:
    command = [sys.executable, __file__, "--one", str(seconds), str(rate_hz)]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()[-1])


def profile() -> None:
    analyse(recording(15, 250))  # compile what numba compiles
    recordings, profiler = recording(60, 250), cProfile.Profile()
    profiler.runcall(analyse, recordings)
    stats = pstats.Stats(profiler)
    stats.sort_stats("cumulative").print_stats("rotorid", 45)
    stats.sort_stats("tottime").print_stats(25)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--one", nargs=2, type=int)
    parser.add_argument("--hour", action="store_true")
    parser.add_argument("--profile", action="store_true")
    arguments = parser.parse_args()
    if arguments.one:
        analyse(recording(15, 100))  # compile what numba compiles
        print(json.dumps(measured(*arguments.one)))
        return
    if arguments.profile:
        profile()
        return
    print(f"Python {platform.python_version()}, numpy {np.__version__}, one core.\n")
    print("| recording | samples | analysis, s of one core | per recorded second, s | peak memory, MB | found |")
    print("| --- | ---: | ---: | ---: | ---: | --- |")
    for seconds, rate_hz in (*ROWS, *([HOUR] if arguments.hour else [])):
        row = in_its_own_process(seconds, rate_hz)
        print(
            f"| {seconds} s at {rate_hz} Hz | {seconds * rate_hz} | {row['cpu_s']:.1f} | {row['cpu_s'] / seconds:.3f} "
            f"| {row['peak_mb']:.0f} | {', '.join(row['found'])} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
