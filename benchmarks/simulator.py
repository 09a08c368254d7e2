"""Speed of the simulator compared with RotorPy, measured side by side in one run.

Run: python benchmarks/simulator.py [--out benchmarks/simulator.md] [--sets 2000]

RotorPy flies as its own simulator does (RK45 of scipy per control step) the thesis's quadrotor with a 30 ms motor lag,
commands changing every 2 ms, once plain and once with its aerodynamics. Ours flies the same, then with one effect of
each id of the catalogue that moves a vehicle, then under an attitude controller. MuJoCo flies a plain rigid
body on four lagged thrusters by the same Runge-Kutta steps, called from Python at each step. Times are of the processor
(best of several), so that other work on the machine does not count; a batch on two threads is stated as half of what
both cores spent, which is what the clock shows on a free machine.
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
import time
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.effects.instant import Wrench
from rotorid.vehicle.control import AttitudePid, training_reference
from rotorid.vehicle.improved import active_forms
from rotorid.vehicle.simulator import Commands, Motors, Start, simulate
from rotorid.vehicle.windows import Inputs, States, simulate_windows
from rotorid_lab.batch import Batch
from tests.unit.effects.flown import audit_vehicle, entry, typical_values
from tests.unit.vehicle.test_simulator import UP_LEFT, rotorpy_vehicle, wiggle

STEP_S, LAG_S, SPEED = 0.002, 0.03, 1073.0
LAG = {"id": "motor_lag", "form": "one constant", "parameters": {"tau": LAG_S}}
AERO = (
    {"id": "rotor_drag", "form": "at the hubs", "parameters": {"k_d": 1.1e-5}},
    {"id": "axial_inflow", "form": "at the hubs", "parameters": {"k_z": 2.3e-5}},
    {"id": "translational_lift", "form": "at the hubs", "parameters": {"k_h": 3.4e-3}},
)
GAINS = ((0.25, 0.25, 0.5), (0.0, 0.0, 0.0), (0.04, 0.04, 0.07))


def everything() -> tuple[dict, ...]:
    """An entry under `effects` for the first form of every id that moves a vehicle at once, of moderate size."""
    vehicle, out = audit_vehicle(), []
    for effect in catalogue().values():
        forms = [f for f in effect.forms(vehicle) if isinstance(f.contribution, Wrench)]
        if forms:
            out.append(entry(effect.id, forms[0], 0.1 * typical_values(effect.id, forms[0])))
    return tuple(out)


def best(function, repeats: int = 3) -> tuple[float, float, object]:
    """Least processor and clock time, s, of several calls, and the last result."""
    processor, clock, result = [], [], None
    for _ in range(repeats):
        begin, began = time.process_time(), time.perf_counter()
        result = function()
        processor.append(time.process_time() - begin)
        clock.append(time.perf_counter() - began)
    return min(processor), min(clock), result


def rotorpy_flight(commands: np.ndarray, aero: bool) -> np.ndarray:
    """Positions after the flight, m, our axes."""
    from rotorpy.vehicles.multirotor import Multirotor

    still = np.zeros(3)
    state = dict(x=still, v=still, q=np.array([0, 0, 0, 1.0]), w=still, wind=still, rotor_speeds=np.full(4, SPEED))
    peer = Multirotor(rotorpy_vehicle(LAG_S), state, aero=aero)
    for command in commands:
        state = peer.step(state, dict(cmd_motor_speeds=command), STEP_S)
    return state["x"] * UP_LEFT


MUJOCO = """<mujoco><option timestep="{step}" integrator="RK4"/><worldbody><body pos="0 0 20"><freejoint/>
<inertial pos="0 0 0" mass="0.652" diaginertia="2.489e-3 2.5743e-3 4.6838e-3"/>{sites}</body></worldbody>
<actuator>{motors}</actuator></mujoco>"""


def mujoco_flight(seconds: float) -> float | None:
    """Processor seconds per simulated second of MuJoCo; None where it is not installed."""
    try:
        import mujoco
    except ImportError:
        return None
    places = [(0.0884, 0.0884), (-0.0884, 0.0884), (-0.0884, -0.0884), (0.0884, -0.0884)]
    sites = "".join(f'<site name="s{i}" pos="{x} {y} 0"/>' for i, (x, y) in enumerate(places))
    motors = "".join(
        f'<general site="s{i}" gear="0 0 1 0 0 {(-1) ** i * 0.0134}" dyntype="filter" dynprm="{LAG_S}"/>'
        for i in range(4)
    )
    model = mujoco.MjModel.from_xml_string(MUJOCO.format(step=STEP_S, sites=sites, motors=motors))
    thrust = (
        0.652 * 9.81 / 4 * (1 + 0.01 * np.sin(np.arange(int(seconds / STEP_S))[:, None] * STEP_S * 7.0 + np.arange(4)))
    )

    def flown():
        data = mujoco.MjData(model)
        for row in thrust:
            data.ctrl[:] = row
            mujoco.mj_step(model, data)

    return best(flown)[0] / seconds


def one_vehicle(entries: tuple[dict, ...], commands: np.ndarray, controller: bool = False):
    """Seconds per simulated second of `simulate`, and its trace."""
    vehicle = audit_vehicle(effects=entries, ground_z_m=0.0)
    forms = active_forms(vehicle)
    seconds = len(commands) * STEP_S
    high = Start(position_m=np.array([[0.0, 0.0, -20.0]]), rotor_speed_rad_s=np.full((1, 4), SPEED))
    pilot = Commands(STEP_S * np.arange(len(commands)), commands)
    if controller:
        pilot = AttitudePid(vehicle, training_reference(6.4), GAINS, 0.02)

    def flown():
        return simulate(vehicle, pilot, seconds, STEP_S, high, Motors(LAG_S), forms)

    flown()  # compiles
    took, _, trace = best(flown)
    return took / seconds, trace


def many(entries: tuple[dict, ...], commands: np.ndarray, sets: int, threads: int):
    """Processor (of all threads) and clock seconds per simulated second and set of a batch that differs in mass."""
    batch = Batch(audit_vehicle(effects=(*entries, LAG)), sets, {"mass_kg": 0.652 * np.linspace(0.95, 1.05, sets)})
    start = batch.hover(SPEED)
    start[:, 12] = -20.0
    processor, clock, _ = best(lambda: batch.fly(start, commands, STEP_S, every=50, threads=threads), 2)
    whole = sets * len(commands) * STEP_S
    return processor / whole, clock / whole


def windows() -> float:
    """Seconds per recorded second of 60 s at 250 Hz, simulated in windows of 0.5 s with everything on."""
    n, vehicle = 15000, audit_vehicle(effects=everything())
    recorded = States(np.zeros((n, 3)), np.tile([1.0, 0, 0, 0], (n, 1)), np.zeros((n, 3)), np.full((n, 3), -20.0))
    forms, time_s, inputs = active_forms(vehicle), np.arange(n) / 250, Inputs(np.full((n, 4), SPEED))

    def flown():
        return simulate_windows(vehicle, forms, time_s, inputs, recorded, step_s=0.004)

    flown()
    return best(flown)[0] / 60


def main(out: Path | None, sets: int) -> None:
    short, long = wiggle(int(1.0 / STEP_S), STEP_S), wiggle(int(10 / STEP_S), STEP_S)
    rotorpy, _, _ = best(lambda: rotorpy_flight(short, False), 2)
    with_aero, _, peer = best(lambda: rotorpy_flight(short, True), 2)
    rows = [("RotorPy, plain", rotorpy, rotorpy), ("RotorPy with its aerodynamics", with_aero, with_aero)]
    all_on = everything()
    if (peer_s := mujoco_flight(2.0)) is not None:
        rows.append(("MuJoCo, plain", peer_s, rotorpy))

    plain, _ = one_vehicle((), long)
    rows.append(("one vehicle, plain", plain, rotorpy))
    same, _ = one_vehicle(AERO, long)
    _, trace = one_vehicle(AERO, short)
    apart = np.abs(trace.position[0, -1] - [0, 0, -20.0] - peer).max()
    rows.append(("one vehicle, RotorPy's aerodynamics", same, with_aero))
    whole, _ = one_vehicle(all_on, long)
    rows.append((f"one vehicle, {len(all_on)} effects", whole, with_aero))
    closed, _ = one_vehicle(all_on, long, controller=True)
    rows.append((f"one vehicle, {len(all_on)} effects, attitude controller", closed, with_aero))
    rows.append((f"restart windows of 0.5 s, {len(all_on)} effects, a recorded second", windows(), with_aero))
    for entries, name in ((AERO, "RotorPy's aerodynamics"), (all_on, f"{len(all_on)} effects")):
        processor, _ = many(entries, short, sets, 1)
        rows.append((f"{sets} sets, {name}, one core, a set", processor, with_aero))
        both, _ = many(entries, short, sets, 2)
        rows.append((f"{sets} sets, {name}, two cores, a set", both / 2, with_aero))
    load = os.getloadavg()[0]
    text = "\n".join(
        [
            "# Simulator",
            "",
            f"`python benchmarks/simulator.py`: {machine()}; step {STEP_S * 1000:g} ms, motor lag {LAG_S * 1000:g} ms.",
            f"Processor time of one core unless said otherwise; the machine's load was {load:.1f} on "
            f"{os.cpu_count()} cores.",
            "",
            "| simulator | seconds per simulated second | times RotorPy |",
            "| --- | ---: | ---: |",
            *(f"| {name} | {value:.3g} | {peer_s / value:.3g} |" for name, value, peer_s in rows),
            "",
            "Plain flight is compared with RotorPy's plain flight, all else with RotorPy's aerodynamics on. "
            f"With the same aerodynamics positions differ by {apart:.1e} m after 1 s "
            "(RotorPy at its own default tolerance of 1e-3).",
            "",
        ]
    )
    print(text)
    if out:
        out.write_text(text)


def machine() -> str:
    """Processor and versions in one line."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    model = next((line.split(": ")[1] for line in lines if line.startswith("model name")), platform.processor())
    packages = ", ".join(f"{p} {version(p)}" for p in ("numpy", "numba", "scipy", "rotorpy", "mujoco") if find_spec(p))
    return f"{model.strip()}, {os.cpu_count()} cores, Python {platform.python_version()}, {packages}"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--sets", type=int, default=2000)
    given = parser.parse_args()
    main(given.out, given.sets)
