"""The load-cell bench: a force on the vehicle bends six cells by the inverse of the bench's geometry.

Six load cells: gain, zero, seat, drift, creep, hysteresis, overload, noise. Force in, volts out.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rotorid.acquire.emulators.oscillator import Oscillator
from rotorid.acquire.emulators.truth import BenchTruth, CellsTruth
from rotorid.acquire.geometry import GF_N, cell_response, direction_of, put_down


class BenchPhysics:
    """Bench with a structure that rings, gives way and turns. Loads act along +x, +y or, like thrust, −z."""

    def __init__(self, cells: CellsTruth, bench: BenchTruth, rng: np.random.Generator) -> None:
        self._rng = rng
        self._bench = bench
        self._cells = LoadCells(cells, rng)
        self._compliance = np.array(bench.compliance_1_n)
        self._structure = Oscillator(3, bench.resonance_hz, bench.damping)
        self._to_cells = cell_response() * np.array([1.0, 1.0, -1.0])  # for forces along +x, +y, +z
        self._load_n = np.zeros(3)
        self._drive: Callable[[float], np.ndarray] | None = None
        self._time_s = 0.0

    def place_load(self, axis: str, load_gf: float) -> None:
        """Put a weight on (or, with 0, take all off); the direction is never quite the same twice. `axis` names
        one axis, or several along which the weight pulls alike."""
        load_n = put_down(load_gf, self._rng)
        if axis != "z":
            load_n *= 1 - self._bench.pulley_loss * self._rng.random()
        direction = direction_of(axis)
        spread = max(self._bench.misalignment_rad["xyz".index(letter)] for letter in axis)
        slant = spread * self._rng.standard_normal(3)
        direction = direction + np.cross(slant, direction)
        self._load_n = load_n * direction / np.linalg.norm(direction)

    def drive(self, force: Callable[[float], np.ndarray]) -> None:
        """A force on the body in N, shape (3,), as a function of the time from now on in s (rotors)."""
        begin = self._time_s
        self._drive = lambda time_s: force(time_s - begin)

    def process(self, dt_s: float) -> None:
        """Advance by `dt_s`."""
        self._time_s += dt_s
        load = self._load_n if self._drive is None else self._load_n + self._drive(self._time_s)
        felt = self._structure.process(dt_s, load)
        self._cells.process(dt_s, self._to_cells @ self.bent(felt))

    def volts(self) -> np.ndarray:
        """Voltages of the six bridges, V."""
        return self._cells.volts()

    def bent(self, force_n: np.ndarray) -> np.ndarray:
        """The force as the cells feel it once the structure has given way: larger, and turned."""
        size = float(np.sqrt(force_n @ force_n))
        turned = force_n + self._bench.turn_rad_n * size * np.cross(np.array([0.6, 0.8, 0.0]), force_n)
        return turned * (1 + self._compliance @ np.abs(force_n))


class CellClamp:
    """One cell clamped like a cantilever for its calibration; the other five hang unloaded."""

    def __init__(self, cells: CellsTruth, rng: np.random.Generator, cell: int) -> None:
        self._rng = rng
        self._cells = LoadCells(cells, rng)
        self._structure = Oscillator(1, 6.0, 0.25)
        self._force_n = np.zeros(6)
        self._load_n = np.zeros(1)
        self._cell = cell - 1

    def place_load(self, axis: str, load_gf: float) -> None:
        """Put a weight on the cell's plate; the axis is the cell's own."""
        load_n = put_down(load_gf, self._rng)
        self._load_n = np.array([load_n])

    def process(self, dt_s: float) -> None:
        """Advance by `dt_s`."""
        self._force_n[self._cell] = self._structure.process(dt_s, self._load_n)[0]
        self._cells.process(dt_s, self._force_n)

    def volts(self) -> np.ndarray:
        """Voltages of the six bridges, V."""
        return self._cells.volts()


class LoadCells:
    """State of the six bridges; all arrays have shape (6,)."""

    def __init__(self, truth: CellsTruth, rng: np.random.Generator) -> None:
        self._rng = rng
        self._volts_per_n = np.array(truth.volts_per_gf) / GF_N
        self._seat_v = np.array(truth.seat_v)
        self._seat_n = truth.seat_gf * GF_N
        self._zero_v = np.array(truth.zero_v)
        self._drift_v_s = np.array(truth.drift_v_s)
        self._wander = truth.wander_v_sqrt_s
        self._creep_share = np.array(truth.creep_share)
        self._creep_s = np.array(truth.creep_s)
        self._backlash_n = np.array(truth.backlash_n)
        self._rated_n, self._loss = truth.rated_n, truth.overload_loss
        self._noise_v = truth.noise_v
        self._creep_n = np.zeros(6)
        self._play_n = np.zeros(6)

    def process(self, dt_s: float, force_n: np.ndarray) -> None:
        """Advance by `dt_s` under the given forces in N."""
        self._creep_n += (self._creep_share * force_n - self._creep_n) * -np.expm1(-dt_s / self._creep_s)
        self._play_n = np.clip(self._play_n, force_n - self._backlash_n, force_n + self._backlash_n)
        self._zero_v = self._zero_v + self._drift_v_s * dt_s
        if self._wander:
            self._zero_v += self._wander * np.sqrt(dt_s) * self._rng.standard_normal(6)

    def volts(self) -> np.ndarray:
        """What the converter sees now, in V."""
        felt = self._play_n + self._creep_n
        beyond = np.maximum(np.abs(felt) - self._rated_n, 0) * np.sign(felt)
        felt = felt - self._loss * beyond
        seat = self._seat_v * np.tanh(felt / self._seat_n)
        noise = self._noise_v * self._rng.standard_normal(6)
        return self._volts_per_n * felt + seat + self._zero_v + noise
