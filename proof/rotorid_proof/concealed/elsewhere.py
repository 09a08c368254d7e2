"""Sets that leave something open, and planned flights, flown by RotorPy and by MuJoCo with those cases' controllers.

A plan is a table of the project's axes (`time_s`, `position_*_m`, `velocity_*_m_s`, `acceleration_*_m_s2`, `yaw_rad`).
Nothing here imports `rotorid`; whoever plans sees the recordings alone.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pandas as pd

from . import rotorpy_cases as rotorpy
from .multibody import cases as bodies
from .multibody import course, engine, logger
from .planned import WARM_UP_S, reference_of
from .richsim import sensors
from .richsim.scene import Run
from .write import Recording, write_set

CALM = 0.06
"""Size of the flights of MuJoCo's first set, of those that its cases fly."""
EDGE = 500
"""Steps that the logger of MuJoCo's cases leaves out at both ends."""


@dataclass(frozen=True)
class InRotorpy:
    """A vehicle of RotorPy with one of its effects switched on, flown twice for 16 s with one purpose."""

    effect: str
    """RotorPy's name of the coefficient: `k_d`, `c_D`, ..."""
    purpose: str = "gentle"
    vehicle: str = "hummingbird"
    seed: int = 0
    size: float = 1.0
    """Of the coefficient, over its published value."""

    @property
    def name(self) -> str:
        return f"rotorpy/{self.effect}/{self.purpose}/{self.vehicle}/{self.seed}/{self.size:g}"

    @property
    def truth(self) -> str:
        return self.plan.ids()[0]

    @property
    def plan(self) -> rotorpy.RotorpyPlan:
        runs = (Run(self.purpose, 16.0),) * 2
        return rotorpy.RotorpyPlan(vehicle=self.vehicle, switches=((self.effect, self.size),), runs=runs)

    @property
    def bandwidths_rad_s(self) -> tuple[float, float]:
        """Natural frequencies of the attitude and the position loop: the roots of RotorPy's gains."""
        from rotorpy.controllers.quadrotor_control import SE3Control

        controller = SE3Control(rotorpy._parameters(self.plan))
        return float(np.sqrt(controller.kp_att)), float(np.sqrt(controller.kp_pos[0]))

    @cached_property
    def first(self) -> Recording:
        """The set that leaves something open."""
        return rotorpy.make(self.plan, self.seed)[0]

    def fly(self, trajectory: pd.DataFrame) -> tuple[Recording, np.ndarray, np.ndarray, np.ndarray]:
        """The flight as recorded, and its times (n,), s, positions (n, 3), m, and velocities (n, 3), m/s."""
        parameters = rotorpy._parameters(self.plan)
        airframe = rotorpy._airframe(parameters, self.vehicle)
        wind, _ = rotorpy._wind(self.plan, np.random.default_rng([self.seed, 7]))
        reference = reference_of(trajectory, rotorpy.STEP_S, airframe.n)
        flight = rotorpy.fly(parameters, airframe, reference, wind)
        layout = sensors.Layout(self.plan.rate_hz, self.plan.groups)
        rng = np.random.default_rng([self.seed, 79])
        _, table = sensors.record(flight, layout, self.plan.noise, sensors.Errors(), airframe.max_speed_rad_s, rng)
        recording = Recording(self.first.vehicle, {"planned": table}, (), "csv")
        return recording, flight.time_s, flight.position_m, flight.velocity_m_s


@dataclass(frozen=True)
class InMujoco:
    """A vehicle of the cases flown on MuJoCo, with what its family hides, flown twice for 20 s calmly."""

    family: str
    seed: int = 0
    size: float = 1.0
    """Of an offset of the centre of mass, over what the family draws."""

    @property
    def name(self) -> str:
        return f"mujoco/{self.family}/{self.seed}/{self.size:g}"

    @property
    def truth(self) -> str:
        return self.drafted[0].effects[0]["id"]

    @cached_property
    def drafted(self):
        """Draft and instruments: motion capture and rotor speeds."""
        draft, grade, _ = bodies.drafted(self.family, self.seed)
        draft.world = replace(draft.world, centre=self.size * draft.world.centre)
        return draft, replace(logger.drawn("lab", np.random.default_rng([self.seed, 80]), False), rate_hz=250)

    @property
    def bandwidths_rad_s(self) -> tuple[float, float]:
        """Natural frequencies of the attitude and the position loop."""
        fast = min(13.0, 0.4 / max(self.drafted[0].world.lag, 0.02))
        return fast, fast / 5.0

    def _flown(self, path: np.ndarray, number: int) -> tuple[pd.DataFrame, dict]:
        draft, grade = self.drafted
        rng = np.random.default_rng([self.seed, 81, number])
        noise = logger.gyro_noise(len(path), grade.rate, rng)
        wind = draft.wind(np.arange(len(path)) * engine.STEP, number) if draft.wind else None
        world = replace(draft.world, wind=wind)
        flight = engine.fly(draft.quad, world, path, noise, self.bandwidths_rad_s[0])
        cut = int((WARM_UP_S - EDGE * engine.STEP) / engine.STEP) if number else 0
        flight = {k: v[cut:] for k, v in flight.items()}
        return logger.record(flight, grade, draft.quad.hover, noise[cut:], rng)[1], flight

    @cached_property
    def first(self) -> Recording:
        """The set that leaves something open."""
        draft, grade = self.drafted
        vehicle, _ = bodies.believed(draft, np.random.default_rng([self.seed, 2]), grade)
        runs = {}
        for i in range(2):
            rng = np.random.default_rng([self.seed, 82, i])
            path = course.reference(20.0, ("waypoints", "vertical"), rng, CALM)
            path[:, 10:] = 0.0  # nothing shakes
            runs[f"run{i + 1:02d}"] = self._flown(path, 0)[0]
        return Recording(vehicle, runs, (), "csv")

    def fly(self, trajectory: pd.DataFrame) -> tuple[Recording, np.ndarray, np.ndarray, np.ndarray]:
        """The flight as recorded, and its times (n,), s, positions (n, 3), m, and velocities (n, 3), m/s."""
        until = float(trajectory["time_s"].iloc[-1]) + EDGE * engine.STEP
        t = np.arange(-WARM_UP_S, until, engine.STEP)
        names = [
            f"{stem}_{a}_{unit}"
            for stem, unit in (("position", "m"), ("velocity", "m_s"), ("acceleration", "m_s2"))
            for a in "xyz"
        ]
        columns = [np.interp(t, trajectory["time_s"], trajectory[n]) for n in (*names, "yaw_rad")]
        path = np.concatenate([np.stack(columns, axis=1), np.zeros((len(t), 3))], axis=1)
        table, flight = self._flown(path, 1)
        inner = slice(EDGE, len(flight["p"]) - EDGE)
        times = np.arange(len(flight["p"][inner])) * engine.STEP
        recording = Recording(self.first.vehicle, {"planned": table}, (), "csv")
        return recording, times, flight["p"][inner], flight["v"][inner]


__all__ = ["InMujoco", "InRotorpy", "write_set"]
