"""An exported vehicle flown on a log's own rotor speeds, next to the log: its error over half a second.

Windows of half a second are restarted from the recording, as in the verdict. What drives them are the rotor speeds as
recorded or, where only commands are, as the identified chain makes them of the log's commands; each tool's own lag is
then left out. RotorPy and MuJoCo fly their file themselves. PX4's SIH and ArduPilot's frame are flown by their
published equations from the file's text. What SDF and URDF express is flown by our simulator, which Drake and Bullet
match (`rotorid.vehicle.exports.flown`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.mismatch.decide.findings import Analysis
from rotorid.mismatch.decide.sizes import WINDOW_S
from rotorid.mismatch.deliver.flown import UNITS, Model, driven_by, model_of
from rotorid.mismatch.tell.forward import delivered_model, simulated_segments
from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle.attitude import normalised, quaternion_rate, rotation_from_quaternion
from rotorid.vehicle.exports import autopilots
from rotorid.vehicle.exports.flown import passive_forces, read_by, through_rotorpy
from rotorid.vehicle.exports.forms import FLU, KNOWS, Exported, expressed, parts_of
from rotorid.vehicle.windows import Inputs, States, plan_windows, simulate_windows

_STEP_S = 0.002
_SHOWN = ("velocity", "attitude", "position", "angular_velocity")


@dataclass(frozen=True)
class LogWindow:
    """Half a second of a log: where it starts, and what turned the rotors; axes north-east-down and body."""

    run: str
    time_s: np.ndarray
    """(m,)."""
    speed: np.ndarray
    """Rotor speeds, (m, k), rad/s."""
    recorded: States
    """Fields (m, ...)."""
    wind: np.ndarray
    """(3,), m/s."""


@dataclass(frozen=True)
class NextToLog:
    """Errors of a tool's flight and of others on the same windows."""

    how: str
    """What flew: `RotorPy`, `PX4's SIH by its published equations`."""
    windows: tuple[LogWindow, ...]
    flown: tuple[States, ...]
    """What the tool predicts, by window."""
    errors: dict[str, dict[str, np.ndarray]]
    """To each model (`exported`, `improved`, `believed`) and channel the error at each sample, (windows, m)."""

    def error(self, model: str, channel: str) -> float:
        """Root mean square over all samples but the restarts."""
        return float(np.sqrt(np.mean(self.errors[model][channel][:, 1:] ** 2)))

    def table(self) -> pd.DataFrame:
        """A row a model and channel: its error, unit, and of how many windows."""
        rows = [
            (model, channel, self.error(model, channel), UNITS[channel], len(self.windows))
            for model, channels in self.errors.items()
            for channel in channels
        ]
        return pd.DataFrame(rows, columns=["model", "channel", "rms_error", "unit", "windows"])

    def sentences(self) -> list[str]:
        """The numbers, a line a channel."""
        out = [f"flown in {self.how} on the log's rotor speeds, {len(self.windows)} windows of half a second:"]
        for channel in _SHOWN:
            if channel in self.errors["exported"]:
                own, ours, before = (self.error(m, channel) for m in ("exported", "improved", "believed"))
                out.append(
                    f"{channel.replace('_', ' ')} off by {own:.3g} {UNITS[channel]} (improved vehicle here {ours:.3g}, "
                    f"believed vehicle {before:.3g})"
                )
        return out


def next_to_log(analysis: Analysis, to: str, exported: Exported) -> NextToLog:
    """Fly an exported vehicle next to the flights that it was identified from.

    InputError where the recordings do not allow it, or nothing flies such a form here.
    """
    most_windows = 40  # Windows that are flown, spread evenly over the log: RotorPy takes a second for five.
    improved = delivered_model(analysis)
    if to not in FLYERS:
        raise InputError(f"nothing flies {to} here, expected one of {', '.join(FLYERS)}")
    how, package, fly = FLYERS[to]
    if package and find_spec(package) is None:
        raise InputError(f"{package} is not installed: the exported vehicle was not flown next to the log")
    found = []
    usable = simulated_segments(analysis)
    for segment, inputs, states in zip(usable, *driven_by(usable, improved), strict=True):
        if states.quaternion is None:
            continue
        time_s = segment.motion.time_s
        fields = [v for v in vars(states).values() if v is not None]
        known = np.isfinite(np.concatenate([inputs.rotor_speed, *fields], axis=1)).all(axis=1)
        for sample in plan_windows(time_s, WINDOW_S, usable=known):
            wind = np.zeros(3) if inputs.wind is None else np.asarray(inputs.wind, float)
            wind = wind if wind.ndim == 1 else wind[sample].mean(axis=0)
            own = States(**{n: None if v is None else v[sample] for n, v in vars(states).items()})
            found.append(LogWindow(segment.run, time_s[sample], inputs.rotor_speed[sample], own, wind))
    if not found:
        raise InputError(
            f"{analysis.recordings.name}: no half second in which rotors, attitude and body rates are recorded"
        )
    chosen = np.unique(np.linspace(0, len(found) - 1, min(most_windows, len(found))).astype(int))
    first = found[0]
    windows = tuple(found[k] for k in chosen if len(found[k].time_s) == len(first.time_s))
    flown = tuple(fly(improved.vehicle, exported, windows))
    errors = {"exported": _errors(flown, windows)}
    for name, model in (("improved", improved), ("believed", Model(analysis.believed))):
        errors[name] = _errors(_ours(model, windows), windows)
    return NextToLog(how, windows, flown, errors)


def _ours(model: Model, windows: Sequence[LogWindow]) -> list[States]:
    """The windows flown by our own simulator: the wrench of the model's forms at each instant."""
    out = []
    for window in windows:
        inputs = Inputs(window.speed, np.gradient(window.speed, window.time_s, axis=0), wind=window.wind)
        every = np.arange(len(window.time_s))[None]
        made = simulate_windows(model.vehicle, model.forms, window.time_s, inputs, window.recorded, sample=every)
        out.append(States(**{n: None if v is None else v[0] for n, v in vars(made.predicted).items()}))
    return out


def _errors(flown: Sequence[States], windows: Sequence[LogWindow]) -> dict[str, np.ndarray]:
    """To each channel that both sides have the length of the difference, (windows, m)."""
    out: dict[str, list[np.ndarray]] = {}
    for made, window in zip(flown, windows, strict=True):
        for name in UNITS:
            field = "quaternion" if name == "attitude" else name
            a, b = getattr(made, field), getattr(window.recorded, field)
            if a is None or b is None:
                continue
            if name == "attitude":
                off = 2 * np.arccos(np.clip(np.abs((a * b).sum(axis=1)), 0, 1))
            else:
                off = np.linalg.norm(a - b, axis=1)
            out.setdefault(name, []).append(off)
    return {name: np.array(rows) for name, rows in out.items()}


_Wrench = Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Force and moment (n, 3) of signals (n, k), velocities through the air and rates (n, 3), body axes."""


def by_equations(
    windows: Sequence[LogWindow], signals: np.ndarray, wrench: _Wrench, mass_kg: float, inertia: np.ndarray,
    gravity_m_s2: float, gyroscopic: bool, fastest_rad_s: float = np.inf,
) -> list[States]:  # fmt: skip
    """Windows (all at once) of a rigid body under a tool's wrench; signals (w, m, k) go straight between samples.

    Each body rate is held within ± `fastest_rad_s`.
    """
    count, samples = signals.shape[:2]
    inverse = np.linalg.inv(inertia)
    start = [w.recorded for w in windows]
    rates = np.array([s.angular_velocity[0] for s in start])
    quaternion = np.array([s.quaternion[0] for s in start])
    velocity = np.array([np.zeros(3) if s.velocity is None else s.velocity[0] for s in start])
    position = np.array([np.zeros(3) if s.position is None else s.position[0] for s in start])
    wind = np.array([w.wind for w in windows])
    down = np.array([0.0, 0.0, gravity_m_s2])

    def slope(state, signal):
        rates, quaternion, velocity, _ = state
        rotation = rotation_from_quaternion(normalised(quaternion))
        through = np.einsum("nji,nj->ni", rotation, velocity - wind)
        force, moment = wrench(signal, through, rates)
        if gyroscopic:
            moment = moment - np.cross(rates, rates @ inertia)
        return (
            moment @ inverse.T, quaternion_rate(quaternion, rates),
            np.einsum("nij,nj->ni", rotation, force) / mass_kg + down, velocity,
        )  # fmt: skip

    state = (rates, quaternion, velocity, position)
    kept = [state]
    steps = max(int(np.ceil((windows[0].time_s[1] - windows[0].time_s[0]) / _STEP_S)), 1)
    length = np.array([w.time_s[1] - w.time_s[0] for w in windows])[:, None] / steps
    for k in range(samples - 1):
        for step in range(steps):
            ends = [signals[:, k] + (signals[:, k + 1] - signals[:, k]) * (step + s) / steps for s in (0, 0.5, 1)]
            a = slope(state, ends[0])
            b = slope(tuple(x + length / 2 * d for x, d in zip(state, a, strict=True)), ends[1])
            c = slope(tuple(x + length / 2 * d for x, d in zip(state, b, strict=True)), ends[1])
            d = slope(tuple(x + length * d for x, d in zip(state, c, strict=True)), ends[2])
            state = tuple(
                x + length / 6 * (p + 2 * q + 2 * r + s) for x, p, q, r, s in zip(state, a, b, c, d, strict=True)
            )
            state = (np.clip(state[0], -fastest_rad_s, fastest_rad_s), *state[1:])
        kept.append((state[0], normalised(state[1]), *state[2:]))
    series = [np.stack(parts, axis=1) for parts in zip(*kept, strict=True)]
    return [
        States(
            series[0][i], series[1][i],
            None if start[i].velocity is None else series[2][i],
            None if start[i].velocity is None or start[i].position is None else series[3][i],
        )
        for i in range(count)
    ]  # fmt: skip


def in_sih(vehicle: Vehicle, exported: Exported, windows: Sequence[LogWindow]) -> list[States]:
    """By the equations of PX4's SIH, from the file's text."""
    values = autopilots.sih_values(exported.text)
    signals = _shares(vehicle, exported, windows, KNOWS["px4-sih"])
    wrench, inertia = partial(autopilots.sih_wrench, values), autopilots.sih_inertia(values)
    mass, gravity = values["SIH_MASS"], vehicle.gravity_m_s2
    return by_equations(windows, signals, wrench, mass, inertia, gravity, True, autopilots.FASTEST_RAD_S)


def in_ardupilot(vehicle: Vehicle, exported: Exported, windows: Sequence[LogWindow]) -> list[States]:
    """By the equations of ArduPilot's simulated frame, from the file's text."""
    frame = autopilots.ardupilot_values(exported.text)
    share = autopilots.ardupilot_signal(_shares(vehicle, exported, windows, KNOWS["ardupilot-json"]), frame["propExpo"])
    wrench = partial(autopilots.ardupilot_wrench, frame)
    inertia = np.diag(frame["moment_inertia"])
    return by_equations(windows, share, wrench, frame["mass"], inertia, autopilots.ARDUPILOT_GRAVITY, False)


def _shares(vehicle: Vehicle, exported: Exported, windows: Sequence[LogWindow], knows: frozenset[str]) -> np.ndarray:
    """Shares of full thrust, (w, m, 4), in the tool's order."""
    full = autopilots.full_speed_rad_s(vehicle, parts_of(autopilots.with_drag_of_hover(vehicle), knows))
    speed = np.array([w.speed for w in windows])[:, :, list(exported.rotor_order)]
    return (speed / full) ** 2


def _in_rotorpy(vehicle: Vehicle, exported: Exported, windows: Sequence[LogWindow]) -> list[States]:
    """RotorPy's Multirotor with the exported parameters and their companion; the speeds are set at every sample and
    held over a step."""
    out = []
    for window in windows:
        start, mid = window.recorded, 0.5 * (window.speed[:-1] + window.speed[1:])
        state = {
            "x": np.zeros(3), "v": _first(start.velocity) * FLU, "wind": window.wind * FLU,
            "q": (start.quaternion[0] * [1, *FLU])[[1, 2, 3, 0]], "w": start.angular_velocity[0] * FLU,
            "rotor_speeds": mid[0],
        }  # fmt: skip
        series = through_rotorpy(exported, state, mid, np.diff(window.time_s), at_once=True)
        out.append(_from_flu(series["x"], series["v"], series["q"][:, [3, 0, 1, 2]], series["w"], start))
    return out


def _in_mujoco(vehicle: Vehicle, exported: Exported, windows: Sequence[LogWindow]) -> list[States]:
    """MuJoCo with the exported model and its companion; the thrusts are set at every step."""
    import mujoco

    with read_by("MuJoCo"):
        model = mujoco.MjModel.from_xml_string(exported.text)
    with passive_forces(exported):
        coefficients = vehicle.thrust_coefficients_n_s2()
        out = []
        for window in windows:
            data, start = mujoco.MjData(model), window.recorded
            model.opt.wind[:] = window.wind * FLU
            data.qpos[:] = [0, 0, 0, *(start.quaternion[0] * [1, *FLU])]
            data.qvel[:] = [*(_first(start.velocity) * FLU), *(start.angular_velocity[0] * FLU)]
            kept = [(data.qpos.copy(), data.qvel.copy())]
            for k in range(len(window.time_s) - 1):
                gap = window.time_s[k + 1] - window.time_s[k]
                steps = max(int(np.ceil(gap / _STEP_S)), 1)
                model.opt.timestep = gap / steps
                for step in range(steps):
                    share = (step + 0.5) / steps
                    thrust = coefficients * (window.speed[k] + share * (window.speed[k + 1] - window.speed[k])) ** 2
                    data.ctrl[:] = thrust
                    data.act[:] = thrust[: model.na]
                    mujoco.mj_step(model, data)
                kept.append((data.qpos.copy(), data.qvel.copy()))
            at, moving = (np.array(part) for part in zip(*kept, strict=True))
            out.append(_from_flu(at[:, :3], moving[:, :3], at[:, 3:], moving[:, 3:], start))
        return out


def _first(values: np.ndarray | None) -> np.ndarray:
    return np.zeros(3) if values is None else values[0]


def _from_flu(position, velocity, quaternion, rates, start: States) -> States:
    """A flight in forward-left-up axes as states north-east-down."""
    return States(
        rates * FLU,
        quaternion * np.array([1.0, *FLU]),
        None if start.velocity is None else velocity * FLU,
        None if start.velocity is None or start.position is None else start.position[0] + position * FLU,
    )


def as_expressed(to: str, vehicle: Vehicle, exported: Exported, windows: Sequence[LogWindow]) -> list[States]:
    """Our simulator with the effects that a form expresses."""
    return _ours(model_of(expressed(vehicle, to)), windows)


FLYERS: dict[str, tuple[str, str, Callable[[Vehicle, Exported, Sequence[LogWindow]], list[States]]]] = {
    "px4-sih": ("PX4's SIH by its published equations", "", in_sih),
    "ardupilot-json": ("ArduPilot's simulated frame by its published equations", "", in_ardupilot),
    "rotorpy": ("RotorPy", "rotorpy", _in_rotorpy),
    "mjcf": ("MuJoCo", "mujoco", _in_mujoco),
    "sdf": ("our simulator with what the SDF file expresses", "", partial(as_expressed, "sdf")),
    "gym-pybullet-drones": (
        "our simulator with what the URDF expresses",
        "",
        partial(as_expressed, "gym-pybullet-drones"),
    ),
    "crazyflow": ("our simulator with what crazyflow's section expresses", "", partial(as_expressed, "crazyflow")),
}
"""By form what flies it, the package that must be there, and the flight."""
