"""What is true in the emulated world: configurable, drawn from a seed, and written to a sealed file.

Rotors, mass and geometry are the thesis's (tables 2.3, 2.5, 4.1), load cells have table 2.8's calibration;
everything else is drawn here and concealed from the pipeline, for its mismatch stage to find.

The bench's geometry turns cell forces into body forces (thesis eqs 2.3–2.9, table 2.3) and back: the recorder shows
forces with it, the emulated bench uses the inverse. The pipeline has an implementation of its own, so that one can be
checked against the other. Weights are put down as an operator does, never twice in quite the same place.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import yaml

from rotorid.io.models import KnownKeys
from rotorid.io.text.files import read_yaml

# a load "along z" pulls upwards, as thrust does
AXES = {"x": np.array([1.0, 0, 0]), "y": np.array([0, 1.0, 0]), "z": np.array([0, 0, -1.0])}
GF_N = 9.80665e-3
_L_M = 0.225
_D_135Z, _D_246Z = 0.02120, 0.050457916
_D_2X, _D_4X, _D_6X = 0.068585472, 0.053814095, 0.014771377
_D_2Y, _D_4Y, _D_6Y = 0.022541324, 0.048126099, 0.070667423
_C30, _C45, _C60 = (math.cos(math.radians(angle)) for angle in (30, 45, 60))

# eq. 2.9, first two rows (forces along x and y) and the linear part of the third, shape (3, 6)
M = np.array([
    [-_D_135Z / (_C60 * _L_M), (_D_246Z / _C30 - _D_2X) / (_C45 * _L_M), _D_135Z / _L_M,
     _D_4X / (_C45 * _L_M), -_D_135Z / (_C60 * _L_M), -(_D_246Z / _C30 - _D_6X) / (_C45 * _L_M)],
    [_D_135Z / (_C30 * _L_M), (_D_246Z / _C60 + _D_2Y) / (_C45 * _L_M), 0.0,
     (_D_4Y - _D_246Z) / (_C45 * _L_M), -_D_135Z / (_C30 * _L_M), (_D_246Z / _C60 - _D_6Y) / (_C45 * _L_M)],
    [0.0, -1 / _C45, 0.0, -1 / _C45, 0.0, -1 / _C45],
])  # fmt: skip

# table 2.8, as printed: gf per 1e-5 V and gf
SLOPE = np.array([39.7571, 37.2649, 40.9000, 39.9259, 42.4717, 39.4705])
_INTERCEPT = np.array([-0.0829, -0.3379, 0.1014, 0.0289, 0.1096, 0.0771])


def body_forces(cells_n: np.ndarray) -> np.ndarray:
    """Force on the vehicle, body axes, shape (3,), N, from the six cells' forces, shape (6,), N (eq. 2.9)."""
    force = M @ cells_n
    force[2] -= np.abs(cells_n[[0, 2, 4]]).sum()
    return force


def cell_forces(volts: np.ndarray) -> np.ndarray:
    """Cells' forces in N, shape (6,), from tared voltages in V, with table 2.8's calibration (eq. 2.10)."""
    return (_INTERCEPT + SLOPE * volts * 1e5) * GF_N


def cell_response() -> np.ndarray:
    """Forces on the six cells for a unit force on the body along x, y and −z, shape (6, 3).

    The inverse of the equations above where they hold, along one axis at a time; six unknowns and three
    equations leave a choice, and it is: least squares of the cells' forces for x and y (with no share in
    the linear part of z), and for −z all cells alike ("the load cells deform equally", thesis 2.4) as
    nearly as no reading in x and y allows.
    """
    lateral = np.linalg.pinv(M)[:, :2]
    rows = M.copy()
    rows[2, [0, 2, 4]] = -1.0  # cells 1, 3, 5 pulled: their absolute value is their value
    wanted = np.array([0.0, 0.0, -1.0])
    alike = np.full(6, 1 / (3 + 3 / _C45))
    vertical = alike + np.linalg.pinv(rows) @ (wanted - rows @ alike)
    if (vertical[[0, 2, 4]] <= 0).any():
        raise AssertionError("cells 1, 3 and 5 must be pulled by a force along -z")
    return np.column_stack([lateral, vertical])


class CellsTruth(KnownKeys, frozen=True):
    """Six load cells; every list has six entries."""

    volts_per_gf: list[float] = [float(1e-5 / slope) for slope in SLOPE]
    seat_v: list[float] = [float(-a0 / a1 * 1e-5) for a0, a1 in zip(_INTERCEPT, SLOPE, strict=True)]
    seat_gf: float = 5.0  # load at which the bearing plate sits and `seat_v` is fully there
    zero_v: list[float] = [0.0] * 6
    drift_v_s: list[float] = [0.0] * 6
    wander_v_sqrt_s: float = 0.0  # random walk of the zero
    creep_share: list[float] = [0.0] * 6
    creep_s: list[float] = [100.0] * 6
    backlash_n: list[float] = [0.0] * 6  # half width of the hysteresis
    rated_n: float = 9.81
    overload_loss: float = 0.0  # share of the force beyond the rated one that no longer bends the cell
    noise_v: float = 0.0


class BenchTruth(KnownKeys, frozen=True):
    """The structure around the cells, for one material."""

    compliance_1_n: list[float] = [0.0] * 3  # relative growth of the reading per newton, loads along x, y, z
    turn_rad_n: float = 0.0  # by how much the load's direction turns per newton
    resonance_hz: float = 40.0
    damping: float = 0.05
    misalignment_rad: list[float] = [0.0, 0.0, 0.0]  # spread of the load's direction, loads along x, y, z
    pulley_loss: float = 0.0  # loads along x and y hang over a pulley that removes at most this share of them


class BatteryTruth(KnownKeys, frozen=True):
    """A 4S lithium-polymer battery."""

    cells: int = 4
    capacity_as: float = 1500 * 3.6
    full_v: float = 4.2
    empty_v: float = 3.3
    resistance_ohm: float = 0.030


class RotorTruth(KnownKeys, frozen=True):
    """Motor, ESC and propeller."""

    thrust_coefficient_n_s2: float = 1.3877e-6
    torque_coefficient_n_m_s2: float = 1.8558e-8
    inertia_kg_m2: float = 8.5e-6
    speed_at_half_rad_s: float = 1829.2  # at throttle 0.5 and the reference voltage (appendix A.1: 1/k_x)
    throttle_exponent: float = 0.669  # so that throttle 0.4 gives 1575 rad/s (appendix A.1)
    dead_throttle: float = 0.0
    reference_voltage_v: float = 15.8
    voltage_exponent: float = 0.0
    rise_s: float = 0.03
    fall_s: float = 0.03
    current_a_s3: float = 2.2e-9  # current = this × speed³ + idle
    idle_a: float = 0.3


class TesterTruth(KnownKeys, frozen=True):
    """The thrust tester's own errors."""

    tare_n: float = 0.0  # spread of the zero from run to run
    thrust_noise_n: float = 0.008
    speed_noise_rpm: float = 6.0


class VehicleTruth(KnownKeys, frozen=True):
    """The quadrotor. Lists over rotors in the thesis's numbering."""

    mass_kg: float = 0.652
    arm_m: float = 0.0884
    com_offset_m: list[float] = [0.0, 0.0, 0.0]
    thrust_factors: list[float] = [1.0] * 4
    torque_factors: list[float] = [1.0] * 4


class SensorTruth(KnownKeys, frozen=True):
    """A six-axis sensor; wrench order: force x y z, moment x y z."""

    crosstalk: list[list[float]] = np.eye(6).tolist()
    noise: list[float] = [0.0] * 6
    vibration: list[float] = [0.0] * 6  # further noise at 1000 rad/s, growing with the speed squared
    drift_per_s: list[float] = [0.0] * 6
    position_error_m: list[float] = [0.0, 0.0, 0.0]
    tilt_rad: list[float] = [0.0, 0.0]  # on the stand the sensor is not quite level: roll, pitch
    resonance_hz: float = 30.0
    damping: float = 0.05


class PlasticTruth(KnownKeys, frozen=True):
    """Printed PLA of one infill density (table 2.5)."""

    modulus_pa: float
    ultimate_pa: float
    yield_pa: float


class _ClockTruth(KnownKeys, frozen=True):
    """Relative error of each device's clock."""

    bench: float = 0.0
    rotor: float = 0.0
    wrench: float = 0.0
    jr3: float = 0.0
    quadrotor: float = 0.0
    tensile: float = 0.0


class Truth(KnownKeys, frozen=True):
    """Everything."""

    cells: CellsTruth = CellsTruth()
    bench: dict[str, BenchTruth] = {"al": BenchTruth(), "pla": BenchTruth()}
    battery: BatteryTruth = BatteryTruth()
    rotor: RotorTruth = RotorTruth()
    tester: TesterTruth = TesterTruth()
    vehicle: VehicleTruth = VehicleTruth()
    wrench: SensorTruth = SensorTruth()
    jr3: SensorTruth = SensorTruth()
    plastic: dict[int, PlasticTruth] = {
        25: PlasticTruth(modulus_pa=1.6099e9, ultimate_pa=36.811e6, yield_pa=12.75e6),
        50: PlasticTruth(modulus_pa=1.6907e9, ultimate_pa=38.591e6, yield_pa=13.2e6),
        75: PlasticTruth(modulus_pa=1.8487e9, ultimate_pa=41.233e6, yield_pa=15.16e6),
        100: PlasticTruth(modulus_pa=1.9482e9, ultimate_pa=41.388e6, yield_pa=16.02e6),
    }
    specimen_scatter: float = 0.0
    clocks: _ClockTruth = _ClockTruth()


def draw_truth(seed: int) -> Truth:
    """A world with all of its concealed imperfections, reproducible from the seed."""
    rng = np.random.default_rng([seed, 0])

    def spread(low: float, high: float, count: int) -> list[float]:
        return [float(f"{value:.4g}") for value in rng.uniform(low, high, count)]

    def signed(low: float, high: float, count: int) -> list[float]:
        return [float(f"{value:.4g}") for value in rng.uniform(low, high, count) * rng.choice([-1.0, 1.0], count)]

    vertical, *lateral = spread(0.0028, 0.0034, 1) + spread(0.06, 0.09, 2)  # the long tube bends sideways
    turn = spread(0.0010, 0.0014, 1)[0]
    stiffer = 1.9482 / 68.9  # table 2.4: the moduli of PLA and aluminium
    return Truth(
        cells=CellsTruth(
            zero_v=signed(2e-5, 2e-4, 6),
            drift_v_s=signed(3e-10, 1e-9, 6),
            wander_v_sqrt_s=2e-9,
            creep_share=spread(3e-4, 9e-4, 6),
            creep_s=spread(60, 240, 6),
            backlash_n=spread(5e-5, 2e-4, 6),
            overload_loss=spread(0.05, 0.12, 1)[0],
            noise_v=6e-8,
        ),
        bench={
            "al": BenchTruth(
                compliance_1_n=[round(c * stiffer, 7) for c in (*lateral, vertical)],
                turn_rad_n=round(turn * stiffer, 8),
                resonance_hz=spread(30, 38, 1)[0],
                damping=0.04,
                misalignment_rad=[0.010, 0.014, 0.0008],
                pulley_loss=0.008,
            ),
            "pla": BenchTruth(
                compliance_1_n=[*lateral, vertical],
                turn_rad_n=turn,
                resonance_hz=spread(9, 12, 1)[0],
                damping=0.06,
                misalignment_rad=[0.010, 0.014, 0.0008],
                pulley_loss=0.008,
            ),
        },
        rotor=RotorTruth(
            dead_throttle=spread(0.002, 0.004, 1)[0],
            voltage_exponent=spread(0.75, 0.95, 1)[0],
            rise_s=spread(0.03, 0.05, 1)[0],
            fall_s=spread(0.05, 0.08, 1)[0],
        ),
        tester=TesterTruth(tare_n=0.006),
        vehicle=VehicleTruth(
            com_offset_m=signed(0.002, 0.005, 3),
            thrust_factors=[1.0, *(1 + v for v in signed(0.01, 0.04, 3))],
            torque_factors=[1.0, *(1 + v for v in signed(0.01, 0.04, 3))],
        ),
        wrench=SensorTruth(
            crosstalk=_crosstalk(rng),
            noise=[0.06, 0.06, 0.08, 0.0007, 0.0007, 0.0006],
            vibration=[0.05, 0.05, 0.08, 0.0015, 0.0015, 0.0008],
            drift_per_s=signed(2e-4, 8e-4, 3) + signed(5e-7, 1.5e-6, 3),
            position_error_m=signed(0.001, 0.003, 3),
            tilt_rad=signed(0.005, 0.015, 2),
            resonance_hz=spread(24, 32, 1)[0],
            damping=0.05,
        ),
        jr3=SensorTruth(
            noise=[0.15, 0.15, 0.25, 0.01, 0.01, 0.01],
            drift_per_s=signed(5e-4, 2e-3, 3) + [0.0, 0.0, 0.0],
            resonance_hz=60.0,
        ),
        specimen_scatter=0.012,
        clocks=_ClockTruth(**dict(zip(_ClockTruth.model_fields, (v * 1e-6 for v in signed(30, 120, 6)), strict=True))),
    )


def _crosstalk(rng: np.random.Generator) -> list[list[float]]:
    """Identity plus up to 1.5 % between forces and between moments, and, across, up to 0.3 N per N m and
    8e-4 N m per N.

    The moment about z is left clean of the others, since table 4.1's torque coefficient is measured by it.
    """
    matrix = np.eye(6)
    off = ~np.eye(6, dtype=bool)
    scale = np.block([[np.full((3, 3), 0.015), np.full((3, 3), 0.3)], [np.full((3, 3), 8e-4), np.full((3, 3), 0.015)]])
    matrix[off] += (rng.uniform(-1, 1, (6, 6)) * scale)[off]
    matrix[5, :5] = 0.0
    return matrix.round(6).tolist()


def write_truth(truth: Truth, path: Path, seed: int | None = None) -> None:
    """The sealed file: only the scoring of the proof may open it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    head = "# SEALED: what is true in the emulated campaign. Only scoring may read this file.\n"
    body = {"seed": seed, "truth": truth.model_dump(mode="json")}
    path.write_text(head + yaml.safe_dump(body, sort_keys=False, width=110), encoding="utf-8")


def read_truth(path: Path) -> Truth:
    """A truth of one's own for the emulators; what is left out keeps its ideal value."""
    return Truth.model_validate(read_yaml(path)["truth"])
