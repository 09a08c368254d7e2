"""Many flights at once from Python: arrays of parameters, starts and commands in, trajectories out.

For Monte Carlo, for fitting and for training a policy: n vehicles that differ from one vehicle file in the values of
some parameters, with every effect that the file states, flown by compiled code on all cores.

    batch = Batch(read_vehicle("improved_vehicle.yaml"), 2000, {"mass_kg": masses, "rotor_drag.k_d": drags})
    flown = batch.fly(batch.hover(), commands, step_s=0.002, every=10)
    flown.position                                       # (2000, kept, 3)
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from rotorid.effects.contract import Form
from rotorid.effects.instant import body_of
from rotorid.errors import InputError
from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle import fast
from rotorid.vehicle.fast import AttitudeLoop, Trace
from rotorid.vehicle.improved import LAGS_OF_SPEED, active_forms, active_speed_forms, all_forms, speeds_of_commands


class Batch:
    """n vehicles alike but for `changes`, with every effect that the vehicle's file states.

    Keys of `changes` are `mass_kg` (n,), `inertia_kg_m2` (n, 3) or (n, 3, 3), `thrust_coefficient_n_s2` and
    `torque_coefficient_n_m_s2` (n,) or (n, k), `rotor_positions_m` (n, k, 3), and `<effect>.<symbol>` (n,) for a
    parameter of an effect in the file. InputError names a key that the vehicle does not have, an effect with a
    memory (`rotorid.vehicle.simulator` flies it), and a shape that does not fit.
    """

    def __init__(self, vehicle: Vehicle, size: int, changes: Mapping[str, np.ndarray] | None = None):
        self.vehicle, self.size = vehicle, size
        self._effects = active_forms(vehicle)
        self._kernels = fast.kernels_of(self._effects, vehicle)
        self._body = np.repeat(body_of(vehicle), size)
        self._parameters = [np.tile(values, (size, 1)) for _, values in self._effects]
        for key, values in (changes or {}).items():
            self._change(key, np.asarray(values, float))
        _derive(self._body)
        self._values = self._kernel_values()
        own = {"limits_rad_s": vehicle.rotor_speed_limits_rad_s, "ground_z_m": vehicle.ground_z_m}
        self._fly = partial(fast.fly, self._body, self._kernels, values=self._values, **own)

    def _change(self, key: str, values: np.ndarray) -> None:
        n, k, body = self.size, self.vehicle.rotor_count, self._body
        if key == "mass_kg":
            mass = _shaped(key, values, (n,))
            # Of one rotor in hover: v_h goes as the root of the weight.
            body["hover_inflow"] *= np.sqrt(mass / body["mass"])
            body["mass"] = mass
        elif key == "inertia_kg_m2":
            full = values[:, :, None] * np.eye(3) if values.ndim == 2 else values
            body["inertia"] = _shaped(key, full, (n, 3, 3))
        elif key in ("thrust_coefficient_n_s2", "torque_coefficient_n_m_s2"):
            field = key.split("_")[0] + "_coefficient"
            body[field][:, :k] = _shaped(key, values[:, None] if values.ndim == 1 else values, (n, k), (n, 1))
        elif key == "rotor_positions_m":
            body["hub"][:, :k] = _shaped(key, values, (n, k, 3))
        else:
            self._change_effect(key, values)

    def _change_effect(self, key: str, values: np.ndarray) -> None:
        pairs = zip(self.vehicle.effects, all_forms(self.vehicle), strict=True)
        entries = [entry for entry, (form, _) in pairs if isinstance(form, Form)]
        # Derivatives, the last form, have no entry.
        places = {
            f"{entry['id']}.{p.symbol}": (number, column)
            for number, (entry, (form, _)) in enumerate(zip(entries, self._effects, strict=False))
            for column, p in enumerate(form.parameters)
        }
        if key not in places:
            known = ("mass_kg", "inertia_kg_m2", "thrust_coefficient_n_s2", "torque_coefficient_n_m_s2")
            raise InputError(
                f"vehicle {self.vehicle.name} has no parameter {key!r}; "
                f"expected one of {', '.join((*known, 'rotor_positions_m', *places))}"
            )
        number, column = places[key]
        self._parameters[number][:, column] = _shaped(key, values, (self.size,))

    def _kernel_values(self) -> np.ndarray:
        """(n, p), or (1, p) where all vehicles have the same."""
        columns = []
        for (form, _), values in zip(self._effects, self._parameters, strict=True):
            if form not in self._kernels.forms:
                continue
            alike = (values == values[0]).all()
            rows = [form.contribution.values_of(row) for row in (values[:1] if alike else values)]
            columns.append((self._kernels.forms.index(form), np.array(rows)))
        if not columns:
            return self._kernels.values[None]
        rows = max(len(c) for _, c in columns)
        ordered = [np.broadcast_to(c, (rows, c.shape[1])) for _, c in sorted(columns, key=lambda pair: pair[0])]
        return np.concatenate([*ordered, np.zeros((rows, 1))], axis=1)

    def hover(self, rotor_speed_rad_s: float | None = None) -> np.ndarray:
        """States (n, 13 + k) at rest and level at the origin; rotors as fast as to carry the weight, or as given."""
        k = self.vehicle.rotor_count
        start = np.zeros((self.size, 13 + k))
        start[:, 3] = 1.0
        lift = self._body["thrust_coefficient"][:, :k].sum(axis=1)
        speed = np.sqrt(self._body["mass"] * self._body["gravity"] / lift)
        start[:, 13:] = (speed if rotor_speed_rad_s is None else np.full(self.size, rotor_speed_rad_s))[:, None]
        return start

    def fly(
        self,
        start: np.ndarray,
        commands: np.ndarray | AttitudeLoop,
        step_s: float,
        steps: int | None = None,
        every: int = 1,
        wind_m_s: np.ndarray | None = None,
        pushes: np.ndarray | None = None,
        threads: int | None = None,
    ) -> Trace:
        """Fly from `start` (n, 13 + k): rates, quaternion, velocity and position (world), rotor speeds, SI.

        `commands` are rotor speeds, rad/s, each held over its step, (m, k) for all or (n, m, k), or a controller with
        a reference for every instant. What the file states between command and rotor speed acts on whole series of
        commands, and the rotors start at the first; under a controller, and in `step`, only a lag can, and the
        rotors start as `start` says. `wind_m_s` (3,) or (n, 3), world axes; `pushes` (n, m, 6) further
        force and moment, N, N m, body axes, each held over its step; `every` keeps each so-many-th instant.
        """
        start = _shaped("start", np.asarray(start, float), (self.size, 13 + self.vehicle.rotor_count))
        lags, following = (0.0, 0.0), None
        if isinstance(commands, AttitudeLoop):
            steps = len(commands.reference) - 1 if steps is None else steps
            lags = self._lags()
        else:
            series = np.asarray(commands, float)
            steps = series.shape[-2] if steps is None else steps
            # The command of the last step also stands at the instant that it ends at.
            series = np.concatenate([series[..., :steps, :], series[..., steps - 1 : steps, :]], axis=-2)
            if active_speed_forms(self.vehicle):
                series = self._through_motors(series, step_s)
                following = np.gradient(series, step_s, axis=-2)
            start = start.copy()
            start[:, 13:] = series[..., 0, :]
            commands = series
        if pushes is not None:
            pushes = np.concatenate([pushes, pushes[:, -1:]], axis=1)
        also = {"wind_m_s": wind_m_s, "every": every, "threads": threads}
        return self._fly(start, steps, step_s, commands, lags_s=lags, following=following, pushes=pushes, **also)

    def step(
        self,
        states: np.ndarray,
        commands: np.ndarray,
        step_s: float,
        wind_m_s: np.ndarray | None = None,
        pushes: np.ndarray | None = None,
    ) -> np.ndarray:
        """States (n, 13 + k) one step after `states` under commands (n, k), rad/s; for who decides at every step.

        Rotors follow by the lag that the file states, or at once. `pushes` (n, 6) as of `fly`.
        """
        lags = self._lags()
        states = np.array(states, float)
        commands = np.asarray(commands, float)
        if lags[0] == 0.0:
            states[:, 13:] = commands
        held = np.repeat(commands[:, None, :], 2, axis=1)
        pushes = None if pushes is None else np.repeat(np.asarray(pushes, float)[:, None, :], 2, axis=1)
        return self._fly(states, 1, step_s, held, lags_s=lags, pushes=pushes, wind_m_s=wind_m_s).end

    def _through_motors(self, series: np.ndarray, step_s: float) -> np.ndarray:
        """Rotor speeds that commands (m, k) or (n, m, k) become, all series in one pass."""
        columns = series if series.ndim == 2 else np.moveaxis(series, 0, 1).reshape(series.shape[1], -1)
        speed = speeds_of_commands(self.vehicle, columns, step_s * np.arange(len(columns)))
        return speed if series.ndim == 2 else np.moveaxis(speed.reshape(-1, *series.shape[::2]), 1, 0)

    def _lags(self) -> tuple[float, float]:
        lags = (0.0, 0.0)
        for form, values in active_speed_forms(self.vehicle):
            if form.name not in LAGS_OF_SPEED:
                raise InputError(
                    f"vehicle {self.vehicle.name}: effect form {form.name!r} needs the whole series of commands; "
                    "give them instead of a controller"
                )
            lags = (values[0], values[-1])
        return lags


def _shaped(name: str, values: np.ndarray, *shapes: tuple[int, ...]) -> np.ndarray:
    if values.shape not in shapes:
        raise InputError(f"{name} has shape {values.shape}, expected {' or '.join(map(str, shapes))}")
    return values


def _derive(body: np.ndarray) -> None:
    """Put in what follows from the constants: J⁻¹, the mixer, and how far out the rotors sit."""
    body["inverse_inertia"] = np.linalg.inv(body["inertia"])
    thrust, hub = body["thrust_coefficient"], body["hub"]
    body["mixer"][:, 0] = thrust
    body["mixer"][:, 1] = -hub[:, :, 1] * thrust
    body["mixer"][:, 2] = hub[:, :, 0] * thrust
    body["mixer"][:, 3] = body["yaw_sign"] * body["torque_coefficient"]
    reach = np.sqrt((hub[:, :, :2] ** 2).sum(axis=2)).max(axis=1)
    body["reach"] = np.where(reach > 0, reach, 1.0)
