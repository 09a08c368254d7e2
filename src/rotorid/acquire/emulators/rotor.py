"""Battery, ESC, motor and propeller."""

from __future__ import annotations

import math

import numpy as np

from rotorid.acquire.emulators.truth import BatteryTruth, RotorTruth, TesterTruth

RPM = 60 / (2 * math.pi)


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


class Rotors:
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
        rotors: Rotors,
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
        speed = float(self.rotors.speed[0]) * RPM
        return speed + self._truth.speed_noise_rpm * self._rng.standard_normal() if speed > 60 else 0.0
