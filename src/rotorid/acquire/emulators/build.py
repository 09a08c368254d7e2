"""Whole worlds by name, for the command line and the tests."""

from __future__ import annotations

import numpy as np

from rotorid.acquire.emulators.devices import (
    BenchDevice,
    Jr3Device,
    QuadrotorDevice,
    RotorDevice,
    TensileDevice,
    WrenchDevice,
)
from rotorid.acquire.emulators.physics import (
    Battery,
    BenchPhysics,
    CellClamp,
    LoadedSensor,
    StandPhysics,
    TensilePhysics,
    TesterPhysics,
    TorqueRig,
    TurningRotors,
)
from rotorid.acquire.emulators.truth import Truth
from rotorid.acquire.emulators.wire import Faults, WireHalf, World
from rotorid.io.experiments import EXPERIMENTS

_NAMES = ("bench", "rotor", "wrench", "quadrotor", "stand", "torque", "jr3", "tensile")


def build(
    what: str,
    truth: Truth,
    seed: int = 1,
    material: str = "al",
    experiment: int = 1,
    infill_percent: int = 100,
    fault_share: float = 0.0,
    faults: Faults | None = None,
    cell: int | None = None,
) -> World:
    """A world with one instrument, or (`stand`) with quadrotor and wrench, or (`torque`) with thrust tester
    and wrench. `cell`: of the bench this cell alone, clamped for its calibration. Raises ValueError for a name,
    material, experiment, infill or cell that does not exist."""
    rng = np.random.default_rng(seed)

    def line(device, **options) -> WireHalf:
        error = getattr(truth.clocks, device.instrument.name)
        chosen = faults or Faults(share=fault_share)
        device.needs_watchdog = True
        return WireHalf(device, rng, clock_error=error, faults=chosen, **options)

    if cell is not None and (what != "bench" or cell not in range(1, 7)):
        raise ValueError(f"a cell is one of the bench, 1 to 6, not {cell} of {what!r}")
    if what == "bench" and cell is not None:
        clamp = CellClamp(truth.cells, rng, cell)
        return World(clamp, line(BenchDevice(clamp)))
    if what == "bench":
        if material not in truth.bench:
            raise ValueError(f"the bench is made of {' or '.join(truth.bench)}, not of {material!r}")
        physics = BenchPhysics(truth.cells, truth.bench[material], rng)
        return World(physics, line(BenchDevice(physics)))
    if what == "jr3":
        physics = LoadedSensor(truth.jr3, rng)
        return World(physics, line(Jr3Device(physics)))
    if what == "tensile":
        if infill_percent not in truth.plastic:
            raise ValueError(f"specimens have an infill of {list(truth.plastic)} percent, not {infill_percent}")
        physics = TensilePhysics(truth.plastic[infill_percent], 1.0, 0.05, rng)
        return World(physics, line(TensileDevice(physics)))
    if what == "rotor":
        rotors = TurningRotors(truth.rotor, Battery(truth.battery), 1)
        physics = TesterPhysics(rotors, truth.rotor, truth.tester, rng)
        return World(physics, line(RotorDevice(physics)))
    if what == "torque":
        rig = TorqueRig(truth, Battery(truth.battery), rng)
        return World(rig, line(RotorDevice(rig.tester)), line(WrenchDevice(rig.stand)))
    if what not in _NAMES:
        raise ValueError(f"there is no emulator {what!r}; there are {', '.join(_NAMES)}")
    if experiment not in EXPERIMENTS:
        raise ValueError(f"table A.1 has experiments 1 to 48, not {experiment}")
    row = EXPERIMENTS[experiment]
    rotors = TurningRotors(truth.rotor, Battery(truth.battery), 4)
    stand = StandPhysics(truth.vehicle, truth.rotor, truth.wrench, rotors, row.roll_deg, row.pitch_deg, rng)
    vehicle = line(QuadrotorDevice(rotors, rng), burst_s=0.04)
    sensor = line(WrenchDevice(stand))
    lines = {"quadrotor": [vehicle], "wrench": [sensor], "stand": [vehicle, sensor]}[what]
    return World(stand, *lines)


def parse_load(text: str) -> tuple[float, str, float]:
    """Time in s since the stream began, axis and weight in gf, from `AXIS:GF@SECONDS`."""
    try:
        axis, rest = text.split(":")
        load_gf, time_s = (float(part) for part in rest.split("@"))
        if axis not in "xyz":
            raise ValueError(axis)
    except ValueError as error:
        raise ValueError(f"a load is AXIS:GF@SECONDS such as z:500.48@6, not {text!r}") from error
    return time_s, axis, load_gf
