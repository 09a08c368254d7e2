"""The truth of the emulated campaign in the words of the catalogue: what a verdict on each of its sets could state.

The emulators are given causes in their own terms; a verdict states what a recording shows of them.

- On the bench a reading is what the thesis's equations make of the cells. A lateral load, or one that turns as the
  bench gives way, becomes a vertical force there (the absolute values of eq. 2.9). So the coefficients of a reading
  follow from the emulated bench and from the equations together. They are fitted to noise-free loads.
- Of rotors, a verdict on a stand states what each gives beyond their mean.

A displaced sensor (`sensor_origin`) acts on the moments as a displaced centre of mass and as unequal rotors do.
`displaced` gives the numbers that these two would have if they stood for the sensor as well.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import yaml

from rotorid.acquire.emulators.physics import CORNERS, BenchPhysics
from rotorid.acquire.emulators.truth import Truth
from rotorid.acquire.geometry import body_forces, cell_response

_CHANNELS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
_LOADS_N = np.linspace(0.35, 9.39, 8)
"""Of the static tests."""
_SENSES = {"x": 1.0, "y": 1.0, "z": -1.0}
"""In which sense weights pull along each axis; thrust is along −z."""


def stated(truth: Truth) -> dict[str, Any]:
    """Ids at work in each set (`ids`, also what is smaller than the noise) and their `numbers` by id and symbol.

    Next to the `sets`: `displaced`, the sensor's place error (m), and its crosstalk of a force into the moment
    about z (m).
    """
    rotor, vehicle, wrench = truth.rotor, truth.vehicle, truth.wrench
    speed = {
        "throttle_curve": {"n": rotor.throttle_exponent, "u_0": rotor.dead_throttle},
        "motor_lag": {"tau_up": rotor.rise_s, "tau_down": rotor.fall_s},
        "battery_sag": {"p": rotor.voltage_exponent},
    }
    sensor = {
        "crosstalk": _off_diagonal(wrench.crosstalk),
        "sensor_origin": {f"d_{a}": -e for a, e in zip("xyz", wrench.position_error_m, strict=True)},
        "rotor_acceleration_torque": {"J_r": rotor.inertia_kg_m2},
        "com_offset": {f"r_{a}": c for a, c in zip("xyz", vehicle.com_offset_m, strict=True)},
        "unequal_rotors": _excess("d", vehicle.thrust_factors) | _excess("q", vehicle.torque_factors),
    }
    cells = ("zero_drift", "creep", "hysteresis", "load_nonlinearity")
    small = ("mount_tilt", "zero_drift", "vibration", "structural_resonance")
    al, pla = (readings(truth, material) for material in ("al", "pla"))
    sets = {
        "campaign-bench-al": (("crosstalk", "compliance", *cells), al),
        "campaign-bench-pla": (("compliance", *cells[:3]), {"compliance": pla["compliance"]}),
        "campaign-bench-jr3": (("zero_drift",), {}),
        "campaign-stand": ((*speed, *sensor, *small), speed | sensor),
        "campaign-torque": ((*speed, *sensor, *small[1:]), speed | sensor),
        "campaign-thrust": ((*speed, "tare_offset"), speed),
    }
    return {
        "sets": {name: {"ids": list(ids), "numbers": numbers} for name, (ids, numbers) in sets.items()},
        "displaced": displaced(truth),
        "sensor_place_error_m": list(wrench.position_error_m),
        "force_into_moment_z_m": max(abs(value) for value in wrench.crosstalk[5][:3]),
    }


def write_stated(truth: Truth, path: Path) -> None:
    """The sealed file that the scoring of the campaign's verdicts reads."""
    head = "# SEALED: the emulated campaign's truth as a verdict could state it. Only scoring may read this file.\n"
    path.write_text(head + yaml.safe_dump(_rounded(stated(truth)), sort_keys=False, width=110), encoding="utf-8")


def _rounded(value: Any) -> Any:
    """Numbers with six digits: the last ones hang on the machine."""
    if isinstance(value, dict):
        return {key: _rounded(part) for key, part in value.items()}
    if isinstance(value, list):
        return [_rounded(part) for part in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value


def _off_diagonal(matrix: list[list[float]]) -> dict[str, float]:
    """`C_to,from` of each pair of channels."""
    return {f"C_{_CHANNELS[t]},{_CHANNELS[s]}": matrix[t][s] for t in range(6) for s in range(6) if t != s}


def _excess(letter: str, factors: list[float]) -> dict[str, float]:
    """Share by which each rotor gives more than the mean of all."""
    mean = float(np.mean(factors))
    return {f"{letter}_{i + 1}": factor / mean - 1 for i, factor in enumerate(factors)}


def readings(truth: Truth, material: str) -> dict[str, dict[str, float]]:
    """Crosstalk C and compliance k of the thesis's readings: y_i = F_i + C_ij F_j + k_ij F_j |F_j|.

    Least squares over `_LOADS_N` along one axis at a time, without noise, drift and slant; a cell beyond its range
    reads too little.
    """
    bench = BenchPhysics(truth.cells, truth.bench[material], np.random.default_rng(0))
    response = cell_response() * np.array([1.0, 1.0, -1.0])
    crosstalk, compliance = {}, {}
    for source, (axis, sense) in enumerate(_SENSES.items()):
        load = np.zeros((len(_LOADS_N), 3))
        load[:, source] = sense * _LOADS_N
        cells = np.array([response @ bench.bent(one) for one in load])
        beyond = np.maximum(np.abs(cells) - truth.cells.rated_n, 0.0)
        cells -= np.sign(cells) * truth.cells.overload_loss * beyond
        columns = np.column_stack([load[:, source], load[:, source] * np.abs(load[:, source])])
        linear, square = np.linalg.lstsq(columns, np.array([body_forces(one) for one in cells]) - load, rcond=None)[0]
        for target, other in enumerate(_SENSES):
            if other != axis:
                crosstalk[f"C_F{other},F{axis}"] = float(linear[target])
            compliance[f"k_F{other},F{axis}"] = float(square[target])
    return {"crosstalk": crosstalk, "compliance": compliance}


def displaced(truth: Truth) -> dict[str, dict[str, float]]:
    """Numbers of a displaced centre of mass and of unequal thrusts that stand for the displaced sensor as well.

    The weight's lever is the centre of mass less the sensor's place. The place e adds (e_y, −e_x) times the thrust to
    the moments; of all sets of four rotors that do so together, the smallest is meant (as least squares takes it).
    """
    error = np.array(truth.wrench.position_error_m)
    centre = np.array(truth.vehicle.com_offset_m) - error
    own = np.array(truth.vehicle.thrust_factors) / np.mean(truth.vehicle.thrust_factors) - 1
    excess = own - CORNERS @ error[:2] / truth.vehicle.arm_m
    return {
        "com_offset": {f"r_{a}": float(v) for a, v in zip("xyz", centre, strict=True)},
        "unequal_rotors": {f"d_{i + 1}": float(v) for i, v in enumerate(excess)},
    }
