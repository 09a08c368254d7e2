"""What the user believes about a vehicle or a stand: `vehicle.yaml` as a typed model.

Axes: world north-east-down, body forward-right-down with its origin at the believed centre of mass.
A rotor's thrust acts along -z of the body. A rotor that spins counter-clockwise seen from above (`ccw`)
pushes the airframe clockwise: positive yaw moment.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from rotorid.io.models import KnownKeys
from rotorid.recordings import columns as c

_Number = Annotated[float, Field(strict=True)]
"""A number: no text, no `true`."""


class Inertia(KnownKeys, frozen=True, allow_inf_nan=False):
    """Entries of the inertia matrix J about the centre of mass, kg m2 (J_xz = -∫ x z dm)."""

    xx: _Number = Field(ge=1e-12, le=1e6)
    yy: _Number = Field(ge=1e-12, le=1e6)
    zz: _Number = Field(ge=1e-12, le=1e6)
    xy: _Number = Field(0.0, ge=-1e6, le=1e6)
    xz: _Number = Field(0.0, ge=-1e6, le=1e6)
    yz: _Number = Field(0.0, ge=-1e6, le=1e6)

    def matrix(self) -> np.ndarray:
        """Inertia matrix, shape (3, 3), kg m2, body axes."""
        return np.array([[self.xx, self.xy, self.xz], [self.xy, self.yy, self.yz], [self.xz, self.yz, self.zz]])


class Rotor(KnownKeys, frozen=True, allow_inf_nan=False):
    """Where a rotor sits (body axes, m) and how it spins seen from above."""

    x_m: _Number = Field(ge=-100, le=100)
    y_m: _Number = Field(ge=-100, le=100)
    z_m: _Number = Field(0.0, ge=-100, le=100)
    spin: Literal["ccw", "cw"]

    @property
    def yaw_sign(self) -> float:
        """+1 where the rotor's reaction torque on the airframe is a positive yaw moment (ccw)."""
        return 1.0 if self.spin == "ccw" else -1.0


class Noise(KnownKeys, frozen=True, allow_inf_nan=False):
    """One-sigma sensor noise as the user believes it; a hint that the tool checks."""

    specific_force_m_s2: _Number | None = Field(None, ge=0)
    angular_velocity_rad_s: _Number | None = Field(None, ge=0)
    rotor_speed_relative: _Number | None = Field(None, ge=0)
    velocity_m_s: _Number | None = Field(None, ge=0)
    position_m: _Number | None = Field(None, ge=0)
    force_n: _Number | None = Field(None, ge=0)
    moment_n_m: _Number | None = Field(None, ge=0)


def unit_of(channel: str, quantity: str) -> str:
    """Unit of a derivative: of its channel per unit of its quantity."""
    force = channel.startswith("force")
    if quantity in ("u", "v", "w"):
        return "N s/m" if force else "N s"
    if quantity in ("p", "q", "r"):
        return "N s/rad" if force else "N m s/rad"
    return "N" if force else "N m"


class Derivative(KnownKeys, frozen=True, allow_inf_nan=False):
    """What a channel of force or moment gains per unit of a quantity (`rotorid.vehicle.derivatives`)."""

    channel: Literal["force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z"]
    quantity: Literal[
        "constant", "u", "v", "w", "p", "q", "r", "thrust", "thrust_roll", "thrust_pitch", "thrust_yaw", "speed"
    ]
    unit: str
    value: _Number
    interval_95: tuple[_Number, _Number]
    low: _Number
    high: _Number
    """Range in which it holds; beyond, the quantity is held at the edge."""

    @model_validator(mode="after")
    def _consistent(self) -> Derivative:
        if self.low > self.high:
            raise ValueError(f"low is {self.low:g}, above high, {self.high:g}")
        if self.quantity == "constant" and not self.low - 1e-9 <= 1 <= self.high + 1e-9:
            raise ValueError(f"a constant is 1, outside low to high, {self.low:g} to {self.high:g}")
        wanted = unit_of(self.channel, self.quantity)
        if self.unit != wanted:
            raise ValueError(f"unit is {self.unit!r}, expected {wanted!r} of {self.channel} by {self.quantity}")
        return self


_Length = Annotated[_Number, Field(ge=-100, le=100)]
_Place = tuple[_Length, _Length, _Length]
_SMALLEST_COEFFICIENT, _LARGEST_COEFFICIENT = 1e-14, 1e2
_LARGEST_SPEED_RAD_S = 1e6
_LARGEST_TRUST = 100.0
"""Relative one-sigma with which a value says nothing any more."""
_FLIGHT_NEEDS = ("mass_kg", "inertia_kg_m2", "rotors", "thrust_coefficient_n_s2", "torque_coefficient_n_m_s2")


class Vehicle(KnownKeys, frozen=True, allow_inf_nan=False):
    """A vehicle (kinds `flight`, `stand`) or a bench, as believed by its user."""

    name: str
    kind: Literal["flight", "stand", "bench"]
    mass_kg: _Number | None = Field(None, ge=1e-6, le=1e5)
    inertia_kg_m2: Inertia | None = None
    rotors: tuple[Rotor, ...] = ()
    thrust_coefficient_n_s2: _Number | tuple[_Number, ...] | None = None
    torque_coefficient_n_m_s2: _Number | tuple[_Number, ...] | None = None
    gravity_m_s2: _Number = Field(9.81, ge=0.01, le=1000)
    rotor_radius_m: _Number | None = Field(None, ge=1e-4, le=100)
    rotor_inertia_kg_m2: _Number | None = Field(None, ge=0, le=1e6)
    ground_z_m: _Number | None = Field(None, ge=-1e7, le=1e7)
    accelerometer_position_m: _Place = (0.0, 0.0, 0.0)
    sensor_position_m: _Place = (0.0, 0.0, 0.0)
    sensor_mount: Literal["level", "tilting"] = "level"
    tared: Annotated[bool, Field(strict=True)] | None = None
    rotor_speed_limits_rad_s: tuple[_Number, _Number] | None = None
    noise: Noise = Noise()
    trust: dict[str, _Number] = Field(default_factory=dict)
    reading_gain: tuple[_Number, _Number, _Number] | None = None
    """Factors of a bench's force readings by axis (`improved_vehicle.yaml` only)."""
    effects: tuple[dict[str, Any], ...] = ()
    """Established effects (`improved_vehicle.yaml` only): id, form and parameters each."""
    derivatives: tuple[Derivative, ...] = ()
    """Stability and control derivatives (`improved_vehicle.yaml` only) of what the effects leave."""

    @field_validator("trust")
    @classmethod
    def _trust_is_positive(cls, trust: dict[str, float]) -> dict[str, float]:
        for key, sigma in trust.items():
            if not 0 <= sigma <= _LARGEST_TRUST:
                raise ValueError(
                    f"trust of {key} is {sigma:g}, expected a relative one-sigma of 0 to {_LARGEST_TRUST:g}"
                )
        return trust

    @model_validator(mode="after")
    def _complete(self) -> Vehicle:
        if self.kind == "flight":
            missing = [key for key in _FLIGHT_NEEDS if getattr(self, key) in (None, ())]
            if missing:
                raise ValueError(f"kind flight needs {', '.join(missing)}")
        if self.kind == "stand" and (not self.rotors or self.thrust_coefficient_n_s2 is None):
            raise ValueError("kind stand needs rotors and thrust_coefficient_n_s2")
        count = len(self.rotors)
        for key in ("thrust_coefficient_n_s2", "torque_coefficient_n_m_s2"):
            value = getattr(self, key)
            if isinstance(value, tuple) and len(value) != count:
                raise ValueError(f"{key} has {len(value)} values for {count} rotors")
            values = value if isinstance(value, tuple) else () if value is None else (value,)
            if any(v <= 0 for v in values):
                raise ValueError(f"{key} must be positive")
            if not all(_SMALLEST_COEFFICIENT <= v <= _LARGEST_COEFFICIENT for v in values):
                raise ValueError(f"{key} must lie between {_SMALLEST_COEFFICIENT:g} and {_LARGEST_COEFFICIENT:g}")
        if self.rotor_speed_limits_rad_s is not None:
            low, high = self.rotor_speed_limits_rad_s
            if not 0 <= low < high <= _LARGEST_SPEED_RAD_S:
                raise ValueError(
                    f"rotor_speed_limits_rad_s must be [low, high] with 0 <= low < high <= {_LARGEST_SPEED_RAD_S:g}"
                )
        if self.inertia_kg_m2 is not None and np.linalg.eigvalsh(self.inertia_kg_m2.matrix())[0] <= 0:
            raise ValueError("inertia_kg_m2 is not a positive definite matrix")
        self._check_derivatives()
        return self

    def _check_derivatives(self) -> None:
        if self.derivatives and self.kind != "flight":
            raise ValueError(f"derivatives belong to a vehicle of kind flight, this is a {self.kind}")
        first: dict = {}
        for i, d in enumerate(self.derivatives):
            if (k := first.setdefault((d.channel, d.quantity), i)) != i:
                raise ValueError(f"derivatives.{i} states {d.channel} by {d.quantity} again, after derivatives.{k}")
            k = first.setdefault(d.quantity, i)
            if (d.low, d.high) != (self.derivatives[k].low, self.derivatives[k].high):
                raise ValueError(f"derivatives.{i} has another range of {d.quantity} than derivatives.{k}")

    @property
    def rotor_count(self) -> int:
        return len(self.rotors)

    def rotor_groups(self) -> dict[str, tuple[str, ...]]:
        """Kind of column (measured speeds, commanded ones, throttles) to its names for these rotors."""
        return {kind: c.rotor_columns(kind, self.rotor_count) for kind in c.PER_ROTOR}

    def rotor_positions_m(self) -> np.ndarray:
        """Rotor hubs, shape (n_rotors, 3), m, body axes."""
        return np.array([[r.x_m, r.y_m, r.z_m] for r in self.rotors], dtype=float).reshape(-1, 3)

    def yaw_signs(self) -> np.ndarray:
        """Sign of each rotor's reaction torque about body z, shape (n_rotors,)."""
        return np.array([r.yaw_sign for r in self.rotors])

    def thrust_coefficients_n_s2(self) -> np.ndarray:
        """C_F per rotor, shape (n_rotors,), N s2."""
        return np.broadcast_to(np.asarray(self.thrust_coefficient_n_s2, float), (self.rotor_count,)).copy()

    def torque_coefficients_n_m_s2(self) -> np.ndarray:
        """C_Q per rotor, shape (n_rotors,), N m s2; zero where the vehicle states none."""
        value = 0.0 if self.torque_coefficient_n_m_s2 is None else self.torque_coefficient_n_m_s2
        return np.broadcast_to(np.asarray(value, float), (self.rotor_count,)).copy()
