"""The vehicle on the experimental stand: four rotors, gravity, a level six-axis sensor below it.

A six-axis force-torque sensor: crosstalk, resonance of what stands on it, drift, noise.
"""

from __future__ import annotations

import math

import numpy as np

from rotorid.acquire.emulators.oscillator import Oscillator
from rotorid.acquire.emulators.rotor import Battery, Rotors, TesterPhysics
from rotorid.acquire.emulators.truth import RotorTruth, SensorTruth, Truth, VehicleTruth
from rotorid.acquire.geometry import AXES, put_down

GRAVITY = 9.81
SENSOR_POSITION_M = (0.0, 0.0, 0.045)  # believed, body axes, from the believed centre of mass
_SPIN = np.array([1.0, -1.0, 1.0, -1.0])  # counter-clockwise from above: reaction about +z
CORNERS = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]], dtype=float)  # rotors 1–4: forward, right


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
        rotors: Rotors,
        roll_deg: float,
        pitch_deg: float,
        rng: np.random.Generator,
    ) -> None:
        self.rotors = rotors
        self._thrust = rotor.thrust_coefficient_n_s2 * np.array(vehicle.thrust_factors)
        self._torque = rotor.torque_coefficient_n_m_s2 * np.array(vehicle.torque_factors)
        self._inertia = rotor.inertia_kg_m2
        self._weight_n = vehicle.mass_kg * GRAVITY
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


class TorqueRig:
    """Vehicle on the wrench sensor, motor 1 driven and counted by the thrust tester (fig. 3.20b)."""

    def __init__(self, truth: Truth, battery: Battery, rng: np.random.Generator) -> None:
        rotors = Rotors(truth.rotor, battery, 4)
        level = truth.wrench.model_copy(update={"tilt_rad": [0.0, 0.0]})  # a fixture of its own, levelled
        self.stand = StandPhysics(truth.vehicle, truth.rotor, level, rotors, 0.0, 0.0, rng)
        self.tester = TesterPhysics(rotors, truth.rotor, truth.tester, rng, loaded=False)

    def process(self, dt_s: float) -> None:
        """Advance by `dt_s`; the stand advances the rotors that both look at."""
        self.stand.process(dt_s)


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
        self._load = np.concatenate([AXES[axis] * put_down(load_gf, self._rng), np.zeros(3)])

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
