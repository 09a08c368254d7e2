"""From command to rotor speed one step at a time, for flights whose commands nobody knows beforehand.

Under a controller the next command hangs on the flight so far, so that the forms of
`rotorid.effects.contract.SpeedForm` cannot be given the whole series. Each is applied to the shortest series that has
its law in it: a static one to the command of the instant, a lag to a held command over one step; a delay keeps what was
asked before. The speeds are those that `rotorid.vehicle.improved.speeds_of_commands` makes of the same commands once
they are known; a test holds it for every form of the catalogue.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from rotorid.effects.contract import DELAY, LAG, SpeedForm, SpeedPath


@dataclass(frozen=True)
class CommandPath:
    """The speed forms of a vehicle with their values, in the order in which they act, and what they refer to."""

    forms: tuple[tuple[SpeedForm, np.ndarray], ...]
    full_speed: float
    """Rotor speed of the full command, rad/s."""
    voltage: np.ndarray | None = None
    """Battery voltage at each step, (m,), V; None for the full one throughout."""
    full_voltage: float = 1.0
    """Voltage at which commands are right, V."""

    def start(self, step_s: float, rotor_speed: np.ndarray | None = None) -> _Stepper:
        """A flight's own path from its first instant; a lag starts at `rotor_speed` (n, k), rad/s, if that is given."""
        return _Stepper(self, step_s, rotor_speed)

    def steady(self, command: np.ndarray) -> np.ndarray:
        """Rotor speeds (..., k), rad/s, that commands (..., k) lead to when they are held, at the first voltage."""
        speed = np.asarray(command, float)
        for form, values in self.forms:
            if form.stage < DELAY:
                speed = self._static(form, values, speed, 0, 0.0)
        return speed

    def _static(self, form: SpeedForm, values: np.ndarray, speed: np.ndarray, step: int, time_s: float) -> np.ndarray:
        """What a form without memory makes of speeds (..., k) that hold from the start of the run until a time."""
        voltage = np.full(2, self.full_voltage if self.voltage is None else self.voltage[step])
        held = np.stack([speed.ravel(), speed.ravel()])
        path = SpeedPath(held, np.array([0.0, time_s]), self.full_speed, voltage, self.full_voltage)
        return form.apply(path, values)[-1].reshape(speed.shape)


@dataclass
class _Stepper:
    """Where a flight is on its path: call `speed` once for every step, in order."""

    path: CommandPath
    step_s: float
    rotor_speed: np.ndarray | None = None
    """Speed at which a lag starts, (n, k), rad/s."""
    step: int = 0
    _past: dict[int, deque] = field(default_factory=dict)
    """By place in the path, what a delay was asked before, the latest first."""
    _lagging: dict[int, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    """By place in the path, speed of a lag and what it was asked, at the step before."""

    def speed(self, command: np.ndarray) -> np.ndarray:
        """Rotor speeds (n, k), rad/s, at this step under commands (n, k) that hold until the next."""
        speed = np.asarray(command, float)
        for place, (form, values) in enumerate(self.path.forms):
            if form.stage == DELAY:
                speed = self._delayed(place, float(values[0]) / self.step_s, speed)
            elif form.stage == LAG:
                speed = self._lagged(place, form, values, speed)
            else:
                speed = self.path._static(form, values, speed, self.step, self.step * self.step_s)
        self.step += 1
        return speed

    def _delayed(self, place: int, steps: float, asked: np.ndarray) -> np.ndarray:
        """What was asked `steps` before, between two steps the mean over a step; the first holds for all time before.

        A negative delay would need what is asked later: it is taken as none.
        """
        steps = max(steps, 0.0)
        whole = int(np.floor(steps))
        part = steps - whole
        past = self._past.setdefault(place, deque(maxlen=whole + 2))
        past.appendleft(asked)
        later, earlier = (past[min(back, len(past) - 1)] for back in (whole, whole + 1))
        return (1.0 - part) * later + part * earlier

    def _lagged(self, place: int, form: SpeedForm, values: np.ndarray, asked: np.ndarray) -> np.ndarray:
        """The lag's exact step under what was asked at the step before."""
        if place in self._lagging:
            before, held = self._lagging[place]
            # The last sample shows only where the lag is none.
            series = np.stack([before.ravel(), held.ravel(), asked.ravel()])
            path = SpeedPath(series, self.step_s * np.arange(3), self.path.full_speed)
            speed = form.apply(path, values)[-1].reshape(asked.shape)
        else:
            speed = asked if self.rotor_speed is None else np.broadcast_to(self.rotor_speed, asked.shape)
        self._lagging[place] = speed, asked
        return speed
