"""What the emulated instruments measure: force in, volts or readings out, advanced by a time step.

- The load-cell bench: a force on the vehicle bends six cells by the inverse of the bench's geometry; the cells have
  gain, zero, seat, drift, creep, hysteresis, overload and noise. Its structure rings when its load changes.
- Rotors: battery, ESC, motor and propeller, on the thrust tester or on the vehicle.
- The vehicle on the stand: four rotors, gravity, and a level six-axis sensor below it with crosstalk, resonance of what
  stands on it, drift and noise.
- A printed specimen in the tensile tester: linear up to a limit, then yielding, then it breaks.

`write_stated` writes the truth of the emulated campaign in the words of the catalogue: what a verdict on each of its
sets could state. The emulators are given causes in their own terms; a verdict states what a recording shows of them.

- On the bench a reading is what the thesis's equations make of the cells. A lateral load, or one that turns as the
  bench gives way, becomes a vertical force there (the absolute values of eq. 2.9). So the coefficients of a reading
  follow from the emulated bench and from the equations together. They are fitted to noise-free loads.
- Of rotors, a verdict on a stand states what each gives beyond their mean.

A displaced sensor (`sensor_origin`) acts on the moments as a displaced centre of mass and as unequal rotors do.
`displaced` gives the numbers that these two would have if they stood for the sensor as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from rotorid_acquire.emulators.truth import (
    AXES,
    GF_N,
    BatteryTruth,
    BenchTruth,
    CellsTruth,
    PlasticTruth,
    RotorTruth,
    SensorTruth,
    TesterTruth,
    Truth,
    VehicleTruth,
    body_forces,
    cell_response,
)

_RPM = 60 / (2 * math.pi)
_GRAVITY = 9.81
SENSOR_POSITION_M = (0.0, 0.0, 0.045)  # believed, body axes, from the believed centre of mass
_SPIN = np.array([1.0, -1.0, 1.0, -1.0])  # counter-clockwise from above: reaction about +z
CORNERS = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]], dtype=float)  # rotors 1–4: forward, right
GAUGE_MM = 40.0
SECTION_MM2 = 19.2  # type IV: 6.0 mm × 3.2 mm
_SPEED_MM_S = 10 / 60
_ELASTIC_SHARE = 0.62  # of the yield strength: up to here the specimen is linear
_HARDENING = 1.2
_FORCE_NOISE_N = 0.25
_CHANNELS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
_LOADS_N = np.linspace(0.35, 9.39, 8)
"""Of the static tests."""
_SENSES = {"x": 1.0, "y": 1.0, "z": -1.0}
"""In which sense weights pull along each axis; thrust is along −z."""
_SPREAD = 1e-4
_SPREAD_GF = 0.08
"""Of a weight from one time that it is put down to the next, one sigma."""


def _direction_of(axis: str) -> np.ndarray:
    """Unit vector of a load along one axis, or along several alike (`xz`: halfway between x and z)."""
    together = sum(AXES[letter] for letter in axis)
    return together / np.linalg.norm(together)


def _put_down(load_gf: float, rng: np.random.Generator) -> float:
    """Force in N that a weight in gf exerts this time: none is put down twice in quite the same place."""
    if load_gf == 0:
        return 0.0
    return (load_gf * (1 + _SPREAD * rng.standard_normal()) + _SPREAD_GF * rng.standard_normal()) * GF_N


@lru_cache(maxsize=64)
def _transition(omega: float, damping: float, dt_s: float) -> tuple[float, float, float, float]:
    """Exact transition of (deviation from rest position, velocity) over a step, underdamped."""
    decay = math.exp(-damping * omega * dt_s)
    omega_d = omega * math.sqrt(1 - damping**2)
    c, s = math.cos(omega_d * dt_s), math.sin(omega_d * dt_s)
    k = damping * omega / omega_d
    return decay * (c + k * s), decay * s / omega_d, -decay * s * omega**2 / omega_d, decay * (c - k * s)


class Oscillator:
    """x'' + 2 ζ ω x' + ω² x = ω² u for every entry of u; unit static gain."""

    def __init__(self, size: int, frequency_hz: float, damping: float) -> None:
        self.position = np.zeros(size)
        self.velocity = np.zeros(size)
        self._omega = 2 * math.pi * frequency_hz
        self._damping = damping

    def process(self, dt_s: float, drive: np.ndarray) -> np.ndarray:
        """Advance by `dt_s` with the drive held; returns the position."""
        a, b, c, d = _transition(self._omega, self._damping, round(dt_s, 7))
        deviation = self.position - drive
        self.position = drive + a * deviation + b * self.velocity
        self.velocity = c * deviation + d * self.velocity
        return self.position


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
        load_n = _put_down(load_gf, self._rng)
        if axis != "z":
            load_n *= 1 - self._bench.pulley_loss * self._rng.random()
        direction = _direction_of(axis)
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
        load_n = _put_down(load_gf, self._rng)
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


class Battery:
    """Voltage falls with the charge taken out and with the current."""

    def __init__(self, truth: BatteryTruth, charge: float = 1.0) -> None:
        self._truth = truth
        self.charge = charge  # 1 full, 0 empty
        self.current_a = 0.0

    def process(self, dt_s: float, current_a: float) -> None:
        """Advance by `dt_s` at a current in A."""
        self.current_a = current_a
        self.charge = max(0.0, self.charge - current_a * dt_s / self._truth.capacity_as)

    @property
    def voltage_v(self) -> float:
        t = self._truth
        open_v = t.cells * (t.empty_v + (t.full_v - t.empty_v) * self.charge)
        return open_v - self.current_a * t.resistance_ohm


class TurningRotors:
    """Any number of rotors on one battery; arrays have shape (n,)."""

    def __init__(self, truth: RotorTruth, battery: Battery, count: int) -> None:
        self._truth = truth
        self.battery = battery
        self.throttle = np.zeros(count)
        self.speed = np.zeros(count)  # rad/s
        self.acceleration = np.zeros(count)  # rad/s²

    def process(self, dt_s: float) -> None:
        """Advance by `dt_s`: first-order lag towards the speed the ESC asks for at this voltage."""
        t = self._truth
        target = self._target()
        time_constant = np.where(target > self.speed, t.rise_s, t.fall_s)
        change = (target - self.speed) * -np.expm1(-dt_s / time_constant)
        self.acceleration = change / dt_s
        self.speed = self.speed + change
        turning = self.speed > 1.0
        current = t.current_a_s3 * (self.speed**3).sum() + t.idle_a * turning.sum()
        self.battery.process(dt_s, float(current))

    def _target(self) -> np.ndarray:
        t = self._truth
        open_share = np.maximum(self.throttle - t.dead_throttle, 0) / (0.5 - t.dead_throttle)
        voltage = (self.battery.voltage_v / t.reference_voltage_v) ** t.voltage_exponent
        return t.speed_at_half_rad_s * open_share**t.throttle_exponent * voltage


class TesterPhysics:
    """One motor on the thrust tester. With `loaded=False` the tester only drives and counts turns."""

    def __init__(
        self,
        rotors: TurningRotors,
        rotor: RotorTruth,
        truth: TesterTruth,
        rng: np.random.Generator,
        loaded: bool = True,
    ) -> None:
        self.rotors = rotors
        self._coefficient = rotor.thrust_coefficient_n_s2 if loaded else 0.0
        self._truth = truth
        self._rng = rng
        self._tare_n = truth.tare_n * rng.standard_normal()

    def process(self, dt_s: float) -> None:
        """Advance by `dt_s`."""
        self.rotors.process(dt_s)

    def thrust_n(self) -> float:
        """Reading of the thrust cell, N."""
        noise = self._truth.thrust_noise_n * self._rng.standard_normal()
        return float(self._coefficient * self.rotors.speed[0] ** 2 + self._tare_n + noise)

    def speed_rpm(self) -> float:
        """Reading of the optical counter, rpm."""
        speed = float(self.rotors.speed[0]) * _RPM
        return speed + self._truth.speed_noise_rpm * self._rng.standard_normal() if speed > 60 else 0.0


def tilt_matrix(roll_rad: float, pitch_rad: float) -> np.ndarray:
    """Body axes to level axes, shape (3, 3), yaw zero (thesis eq. 4.10)."""
    cr, sr, cp, sp = math.cos(roll_rad), math.sin(roll_rad), math.cos(pitch_rad), math.sin(pitch_rad)
    return np.array([[cp, sr * sp, cr * sp], [0.0, cr, -sr], [-sp, sr * cp, cr * cp]])


class StandPhysics:
    """What the vehicle exerts on the sensor, sensor axes: thrust, reaction torques, weight."""

    def __init__(
        self,
        vehicle: VehicleTruth,
        rotor: RotorTruth,
        sensor: SensorTruth,
        rotors: TurningRotors,
        roll_deg: float,
        pitch_deg: float,
        rng: np.random.Generator,
    ) -> None:
        self.rotors = rotors
        self._thrust = rotor.thrust_coefficient_n_s2 * np.array(vehicle.thrust_factors)
        self._torque = rotor.torque_coefficient_n_m_s2 * np.array(vehicle.torque_factors)
        self._inertia = rotor.inertia_kg_m2
        self._weight_n = vehicle.mass_kg * _GRAVITY
        sensor_roll, sensor_pitch = sensor.tilt_rad
        level_to_sensor = tilt_matrix(sensor_roll, sensor_pitch).T
        self._body_to_sensor = level_to_sensor @ tilt_matrix(math.radians(roll_deg), math.radians(pitch_deg))
        self._down = level_to_sensor @ np.array([0.0, 0.0, 1.0])
        place = np.array(SENSOR_POSITION_M) + np.array(sensor.position_error_m)
        arms = np.column_stack([vehicle.arm_m * CORNERS, np.zeros(4)]) - place
        self._arms = arms  # rotors from the sensor, body axes
        self._com_arm = self._body_to_sensor @ (np.array(vehicle.com_offset_m) - place)
        self.sensor = _SixAxis(sensor, rng, self.wrench())

    def wrench(self) -> np.ndarray:
        """Force in N and moment in N m on the sensor, shape (6,)."""
        thrust = self._thrust * self.rotors.speed**2
        force = self._body_to_sensor @ np.array([0.0, 0.0, -thrust.sum()])
        # arm × (0, 0, −F) = (−y F, x F, 0)
        moment = np.array([-(self._arms[:, 1] @ thrust), self._arms[:, 0] @ thrust, 0.0])
        moment[2] = _SPIN @ (self._torque * self.rotors.speed**2 + self._inertia * self.rotors.acceleration)
        weight = self._weight_n * self._down
        moment = self._body_to_sensor @ moment + np.cross(self._com_arm, weight)
        return np.concatenate([force + weight, moment])

    def process(self, dt_s: float) -> None:
        """Advance by `dt_s`."""
        self.rotors.process(dt_s)
        self.sensor.process(dt_s, self.wrench())


def torque_rig(truth: Truth, battery: Battery, rng: np.random.Generator) -> tuple[StandPhysics, TesterPhysics]:
    """Vehicle on the wrench sensor, motor 1 driven and counted by the thrust tester (fig. 3.20b).

    The stand advances the rotors that both look at.
    """
    rotors = TurningRotors(truth.rotor, battery, 4)
    level = truth.wrench.model_copy(update={"tilt_rad": [0.0, 0.0]})  # a fixture of its own, levelled
    stand = StandPhysics(truth.vehicle, truth.rotor, level, rotors, 0.0, 0.0, rng)
    return stand, TesterPhysics(rotors, truth.rotor, truth.tester, rng, loaded=False)


class LoadedSensor:
    """A six-axis sensor alone, with a weight or a vehicle on it (the reference in the bench's tests)."""

    def __init__(self, sensor: SensorTruth, rng: np.random.Generator) -> None:
        self.sensor = _SixAxis(sensor, rng, np.zeros(6))
        self.rotors = None
        self._rng = rng
        self._load = np.zeros(6)
        self._drive = None
        self._time_s = 0.0

    def place_load(self, axis: str, load_gf: float) -> None:
        """A weight along +x, +y or, like thrust, −z."""
        self._load = np.concatenate([AXES[axis] * _put_down(load_gf, self._rng), np.zeros(3)])

    def drive(self, force) -> None:
        """A force on the body, N, shape (3,), as a function of the time from now on in s."""
        begin = self._time_s
        self._drive = lambda time_s: np.concatenate([force(time_s - begin), np.zeros(3)])

    def process(self, dt_s: float) -> None:
        """Advance by `dt_s`."""
        self._time_s += dt_s
        load = self._load if self._drive is None else self._load + self._drive(self._time_s)
        self.sensor.process(dt_s, load)


class _SixAxis:
    """State of the sensor; wrenches have shape (6,): force in N, moment in N m, sensor axes."""

    def __init__(self, truth: SensorTruth, rng: np.random.Generator, at_rest: np.ndarray) -> None:
        self._truth = truth
        self._rng = rng
        self._crosstalk = np.array(truth.crosstalk)
        self._noise, self._vibration = np.array(truth.noise), np.array(truth.vibration)
        self._drift_per_s = np.array(truth.drift_per_s)
        self._structure = Oscillator(6, truth.resonance_hz, truth.damping)
        self._structure.position = at_rest.copy()
        self._zero = np.zeros(6)
        self._offset = np.zeros(6)

    def process(self, dt_s: float, wrench: np.ndarray) -> None:
        """Advance by `dt_s` under a wrench."""
        self._structure.process(dt_s, wrench)
        self._zero = self._zero + self._drift_per_s * dt_s

    def read(self, speed_rad_s: float = 0.0) -> np.ndarray:
        """A reading; rotors that turn at a mean speed shake it."""
        noise = self._noise + self._vibration * (speed_rad_s / 1000) ** 2
        felt = self._crosstalk @ self._structure.position
        return felt + self._zero - self._offset + noise * self._rng.standard_normal(6)

    def offset(self) -> None:
        """Take the present mean reading as zero."""
        self._offset = self._crosstalk @ self._structure.position + self._zero


class TensilePhysics:
    """Strain ε = σ/E + 0.002 ((σ − σ_p)/(σ_y − σ_p))^n beyond the proportional limit σ_p, so that the stress
    at 0.2 % plastic strain is the yield strength; it breaks a little after the ultimate strength."""

    def __init__(self, plastic: PlasticTruth, scale: float, slack_mm: float, rng: np.random.Generator) -> None:
        """`scale` multiplies all strengths and the modulus; the crosshead moves `slack_mm` before the force rises."""
        self._rng = rng
        stress = np.linspace(0, plastic.ultimate_pa * scale, 2000)
        limit = _ELASTIC_SHARE * plastic.yield_pa * scale
        beyond = np.maximum(stress - limit, 0) / (plastic.yield_pa * scale - limit)
        self._strain = stress / (plastic.modulus_pa * scale) + 0.002 * beyond**_HARDENING
        self._stress = stress
        self._slack_mm = slack_mm
        self.displacement_mm = 0.0
        self.moving = False

    def process(self, dt_s: float) -> None:
        """Advance by `dt_s`."""
        if self.moving:
            self.displacement_mm += _SPEED_MM_S * dt_s

    def force_n(self) -> float:
        """Reading of the tester's force cell, N."""
        strain = max(self.displacement_mm - self._slack_mm, 0) / GAUGE_MM
        last = self._strain[-1]
        if strain <= last:
            stress = np.interp(strain, self._strain, self._stress)
        elif strain <= 1.12 * last:  # necking
            stress = self._stress[-1] * (1 - 0.5 * (strain / last - 1))
        else:
            stress = 0.0
        return float(stress * SECTION_MM2 * 1e-6 + _FORCE_NOISE_N * self._rng.standard_normal())

    @property
    def broken(self) -> bool:
        return max(self.displacement_mm - self._slack_mm, 0) / GAUGE_MM > 1.2 * self._strain[-1]


def _stated(truth: Truth) -> dict[str, Any]:
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
        "crosstalk": {
            f"C_{to},{by}": wrench.crosstalk[t][s]
            for t, to in enumerate(_CHANNELS)
            for s, by in enumerate(_CHANNELS)
            if t != s
        },
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
    path.write_text(head + yaml.safe_dump(_rounded(_stated(truth)), sort_keys=False, width=110), encoding="utf-8")


def _rounded(value: Any) -> Any:
    """Numbers with six digits: the last ones hang on the machine."""
    if isinstance(value, dict):
        return {key: _rounded(part) for key, part in value.items()}
    if isinstance(value, list):
        return [_rounded(part) for part in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value


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
