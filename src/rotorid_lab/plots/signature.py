"""How each effect of the catalogue shows: its own equations evaluated on one made-up recording, and drawn.

The recording is no flight: each quantity swings at a frequency of its own, so that what an effect hangs on can be seen
from the numbers alone. Of all channels the one that it changes most is shown, over the quantity that explains it best.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from rotorid.effects.contract import Contribution, Effect, Form, Motion, SetForm, SpeedForm, SpeedPath
from rotorid.effects.describe import EXAMPLE, EXAMPLE_BENCH, EXAMPLE_STAND
from rotorid.effects.loading import CHANNELS, UNITS, InstrumentFacts, Loading, forms_of
from rotorid.recordings import columns as c
from rotorid.recordings.run import RecordingSet, Run
from rotorid.recordings.vehicle import Rotor
from rotorid.report.plots import style

_VEHICLE = EXAMPLE.model_copy(
    update={"rotor_inertia_kg_m2": 8.5e-6, "ground_z_m": 0.0, "rotor_speed_limits_rad_s": (0.0, 2500.0)}
)
_DURATION_S, _RATE_HZ = 40.0, 50.0
HOVER_RAD_S = float(np.sqrt(0.652 * 9.81 / (4 * 1.3877e-6)))
_SHARE = 0.1
"""Share of its physical bound at which a parameter is shown, where nothing better is stated."""
_BINS = 25
_LEAST_EXPLAINED = 0.35
"""Share of the variance that a quantity must explain to be what an effect is shown over."""
_SHOWN_S = 4.0
"""Length of what is shown over time, s."""


@dataclass(frozen=True)
class _Signature:
    """One picture: `y` over `x` with the effect; `without` is the same without it, where that is not nothing."""

    form: str
    equation: str
    values: tuple[tuple[str, float, str], ...]
    """Symbol, value and unit of each parameter."""
    over: str
    shows: str
    x: np.ndarray
    y: np.ndarray
    without: np.ndarray | None = None
    layouts: tuple[tuple[Rotor, ...], tuple[Rotor, ...]] | None = None
    """Rotors as they are and as the vehicle's file has them, where no column changes."""


def signature(effect: Effect) -> _Signature | None:
    """The picture of an effect's first form that shows anything on the example; None where none does."""
    for form in effect.forms(_VEHICLE):
        if form.requires and not _flight().has(form.requires):
            continue
        found = _of_wrench(effect, form)
        if found is not None:
            return found
    for form in effect.speed_forms:
        return _of_speed(form)
    for form in effect.set_forms(_VEHICLE):
        return _of_fault(form)
    if effect.reading_forms is not None:
        for instrument in (EXAMPLE_STAND, EXAMPLE_BENCH):
            for form in forms_of(effect, instrument):
                found = _of_reading(effect, form, instrument)
                if found is not None:
                    return found
    return None


def _swing(period_s: float, phase: float = 0.0) -> np.ndarray:
    """A sine over the recording, (n,)."""
    return np.sin(2 * np.pi * _instants() / period_s + phase)


def _instants() -> np.ndarray:
    """The recording's instants, (n,), s."""
    return np.arange(int(_DURATION_S * _RATE_HZ)) / _RATE_HZ


def _flight() -> Motion:
    """The made-up flight: every field of `Motion` that a recording of flight can give."""
    time_s = _instants()
    speed = HOVER_RAD_S * (
        1 + 0.05 * _swing(7.3)[:, None] + 0.06 * np.stack([_swing(1.1 + 0.23 * i, i) for i in range(4)], 1)
    )
    rates = np.stack([1.5 * _swing(2.9), 1.2 * _swing(3.7, 1.0), 1.0 * _swing(5.3, 2.0)], 1)
    angles = np.stack([0.35 * _swing(9.1), 0.3 * _swing(11.3, 0.5), 0.8 * _swing(17.0)], 1)
    velocity = np.stack([6.0 * _swing(19.0), 5.0 * _swing(13.0, 1.0), 4.0 * _swing(23.0, 0.7)], 1)
    height = 0.08 + 0.6 * (1 + _swing(29.0, -1.5)) / 2
    thrust = (EXAMPLE.thrust_coefficients_n_s2() * speed**2).sum(1) / EXAMPLE.mass_kg
    force = np.stack([-0.4 * velocity[:, 0] / 6, -0.4 * velocity[:, 1] / 6, -thrust], 1)
    rotation = Rotation.from_euler("ZYX", angles[:, ::-1]).as_matrix()
    turning = (rates, np.gradient(rates, time_s, axis=0))
    return Motion(
        time_s, speed, np.gradient(speed, time_s, axis=0), *turning, force, force, rates, rotation, velocity,
        position=np.stack([3 * _swing(19.0, 1.6), 3 * _swing(13.0, 2.6), -height], 1),
        height=height,
        voltage=np.linspace(12.4, 10.8, len(time_s)),
    )  # fmt: skip


def _typical(form: Form | SpeedForm) -> np.ndarray:
    """Plain values of a form's parameters: a start of the nonlinear ones, a tenth of the bound of the others."""
    values = []
    for number, p in enumerate(form.parameters):
        if p.nonlinear and p.starts:
            values.append(p.starts[len(p.starts) // 2])
        elif p.low < 0:
            values.append(_SHARE * min(p.high, -p.low, 10.0) * (1.0, -0.7, 0.4, -0.25)[number % 4])
        else:
            values.append(_SHARE * min(p.high, 10.0) * (1.0, 0.7, 0.5)[number % 3])
    return np.array(values)


def _of(form: Form | SpeedForm | SetForm, values, *shown, **more) -> _Signature:
    """The picture of a form with these values of its parameters."""
    named = tuple((p.symbol, float(v), p.unit) for p, v in zip(form.parameters, values, strict=True))
    return _Signature(form.name, form.equation, named, *shown, **more)


def _quantities(motion: Motion) -> dict[str, np.ndarray]:
    """What an effect may hang on, by its words."""
    spin = motion.rotor_speed @ EXAMPLE.yaw_signs()
    return {
        "forward speed (m/s)": motion.velocity[:, 0],
        "sideward speed (m/s)": motion.velocity[:, 1],
        "speed downwards (m/s)": motion.velocity[:, 2],
        "roll rate (rad/s)": motion.angular_velocity[:, 0],
        "pitch rate (rad/s)": motion.angular_velocity[:, 1],
        "yaw rate (rad/s)": motion.angular_velocity[:, 2],
        "roll acceleration (rad/s²)": motion.angular_acceleration[:, 0],
        "pitch acceleration (rad/s²)": motion.angular_acceleration[:, 1],
        "yaw acceleration (rad/s²)": motion.angular_acceleration[:, 2],
        "mean rotor speed (rad/s)": motion.rotor_speed.mean(1),
        "mean rate of rotor speed (rad/s²)": motion.rotor_acceleration.mean(1),
        "sum of rates of rotor speed, ccw minus cw (rad/s²)": motion.rotor_acceleration @ EXAMPLE.yaw_signs(),
        "rotor speeds, right minus left (rad/s)": motion.rotor_speed @ np.sign(EXAMPLE.rotor_positions_m()[:, 1]),
        "rotor speeds, front minus rear (rad/s)": motion.rotor_speed @ np.sign(EXAMPLE.rotor_positions_m()[:, 0]),
        "body rate (rad/s)": np.linalg.norm(motion.angular_velocity, axis=1),
        "rotor speeds, ccw minus cw, times roll rate (rad²/s²)": spin * motion.angular_velocity[:, 0],
        "rotor speeds, ccw minus cw, times pitch rate (rad²/s²)": spin * motion.angular_velocity[:, 1],
        "specific force downwards (m/s²)": motion.specific_force[:, 2],
        "yaw (rad)": np.arctan2(motion.rotation[:, 1, 0], motion.rotation[:, 0, 0]),
        "height (m)": motion.height,
    }


def explained(y: np.ndarray, x: np.ndarray) -> float:
    """Correlation ratio: the share of the variance of `y` (n,) that the mean in bins of `x` (n,) explains, 0 to 1."""
    edges = np.unique(np.quantile(x, np.linspace(0, 1, _BINS + 1)[1:-1]))
    number = np.searchsorted(edges, x)
    counts = np.bincount(number, minlength=len(edges) + 1)
    means = np.bincount(number, y, minlength=len(edges) + 1) / np.maximum(counts, 1)
    return float(1 - np.mean((y - means[number]) ** 2) / max(np.var(y), 1e-300))


def _strongest(added: Contribution) -> tuple[str, np.ndarray] | None:
    """Name and values of the channel that a contribution changes most, each group measured by what is large for it."""
    weight = EXAMPLE.mass_kg * EXAMPLE.gravity_m_s2
    arm = float(np.hypot(EXAMPLE.rotors[0].x_m, EXAMPLE.rotors[0].y_m))
    groups = (
        ("force", added.force, weight, "N"),
        ("moment", added.moment, weight * arm, "N m"),
        ("accelerometer's error", added.specific_force, EXAMPLE.gravity_m_s2, "m/s²"),
        ("gyroscope's error", added.angular_velocity, 1.5, "rad/s"),
    )
    best: tuple[float, str, np.ndarray] | None = None
    for name, values, scale, unit in groups:
        for axis, column in zip("xyz", values.T if values is not None else (), strict=False):
            size = float(np.sqrt(np.mean(column**2))) / scale
            if best is None or size > best[0]:
                where = f"{name} {'about' if name == 'moment' else 'along'} {axis} ({unit})"
                best = (size, where, column)
    return None if best is None or best[0] < 1e-9 else best[1:]


def _of_wrench(effect: Effect, form: Form) -> _Signature | None:
    """A form of a force, moment or inertial sensor, over the quantity that explains it best."""
    motion, values = _flight(), _typical(form)
    shown = _strongest(form.contribution(motion, _VEHICLE, values))
    if shown is None:
        return None
    known = _quantities(motion)
    over = max(known, key=lambda name: explained(shown[1], known[name]))
    # What is always the same, and what no single quantity explains, is shown as it goes on.
    if np.ptp(shown[1]) < 1e-9 * np.abs(shown[1]).max() or explained(shown[1], known[over]) < _LEAST_EXPLAINED:
        over, known = "time (s)", {"time (s)": motion.time_s}
    return _of(form, values, over, shown[0], known[over], shown[1])


def _of_speed(form: SpeedForm) -> _Signature:
    """A form between command and rotor speed: the speed over time, or over the command where it is a map."""
    time_s = 0.01 * np.arange(200)
    steps = 1250 + 500 * np.sign(np.sin(2 * np.pi * 0.7 * time_s))
    ramp = np.linspace(200.0, 2450.0, 200)
    static = form.excited_by in ("command", "limit") and form.stage <= 2
    command = ramp if static else steps
    if form.excited_by in ("voltage", "time"):
        command, time_s = np.full(200, 1800.0), 0.3 * np.arange(200)
    values = _typical(form)
    path = SpeedPath(np.repeat(command[:, None], 4, 1), time_s, 2500.0, np.linspace(12.4, 10.4, 200), 12.4)
    speed = form.apply(path, values)[:, 0]
    over = ("commanded speed (rad/s)", command) if static else ("time (s)", time_s)
    return _of(form, values, over[0], "rotor speed (rad/s)", over[1], speed, command)


def _recorded() -> RecordingSet:
    """The made-up flight as a recording set with every column that a fault may spoil."""
    motion = _flight()
    quaternion = Rotation.from_matrix(motion.rotation).as_quat()[:, [3, 0, 1, 2]]
    world = np.einsum("nij,nj->ni", motion.rotation, motion.velocity)
    columns = {c.TIME: motion.time_s}
    for names, values in (
        (c.POSITION, motion.position),
        (c.VELOCITY, world),
        (c.QUATERNION, quaternion),
        (c.ANGULAR_VELOCITY, motion.angular_velocity),
        (c.SPECIFIC_FORCE, motion.specific_force),
        (c.rotor_columns("rotor_speed", 4), motion.rotor_speed),
        (c.rotor_columns("rotor_command", 4), motion.rotor_speed),
        (c.rotor_columns("throttle", 4), motion.rotor_speed / 2500.0),
    ):
        columns |= dict(zip(names, values.T, strict=True))
    columns |= {c.HEIGHT: motion.height, c.BATTERY_VOLTAGE: motion.voltage}
    return RecordingSet(
        "example", _VEHICLE, (Run("first", pd.DataFrame(columns)), Run("second", pd.DataFrame(columns)))
    )


def _of_fault(form: SetForm) -> _Signature | None:
    """A fault of a set: the column that it changes most, as it should be and as it is."""
    sound = _recorded()
    spoilt = form.apply(sound, np.array(form.example))
    best: tuple[float, str, np.ndarray, np.ndarray, np.ndarray] | None = None
    for before, after in zip(sound.runs, spoilt.runs, strict=True):
        shared = before.table.merge(after.table, on=c.TIME, suffixes=("", "_spoilt"), how="inner")
        pairs = [
            (n, shared[n].to_numpy(), shared[f"{n}_spoilt"].to_numpy()) for n in before.table if f"{n}_spoilt" in shared
        ]
        if len(shared) < 10:  # the clock itself is spoilt
            shared, n = before.table, c.SPECIFIC_FORCE[2]
            pairs = [(n, shared[n].to_numpy(), np.interp(shared[c.TIME], after.time_s, after.table[n]))]
        for name, sure, wrong in pairs:
            change = np.nanmean(np.abs(np.nan_to_num(wrong, nan=0.0) - sure)) / max(np.nanstd(sure), 1e-9)
            if best is None or change > best[0]:
                best = (float(change), name, shared[c.TIME].to_numpy(), sure, wrong)
    if best is None or best[0] == 0.0:
        if sound.vehicle.rotors == spoilt.vehicle.rotors:
            return None
        nothing = np.zeros(0)
        both = (sound.vehicle.rotors, spoilt.vehicle.rotors)
        return _of(form, form.example, "", "", nothing, nothing, layouts=both)
    _, name, time_s, sure, wrong = best
    first = int(np.argmax(np.abs(np.nan_to_num(wrong, nan=np.inf) - sure) > 0))
    start = max(min(time_s[first] - 1.0, time_s[-1] - _SHOWN_S), 0.0)
    inside = (time_s >= start) & (time_s <= start + _SHOWN_S)
    return _of(form, form.example, "time (s)", name, time_s[inside], wrong[inside], sure[inside])


def _loading(instrument: InstrumentFacts) -> Loading:
    """The made-up test on a stand or bench: loads up and down in every channel, a tilting mount, a warming sensor."""
    time_s = _instants()
    triangles = [2 * np.abs(2 * ((time_s / p) % 1) - 1) - 1 for p in (9.0, 7.0, 5.0, 6.1, 4.3, 3.7)]
    load = np.stack([size * tri for size, tri in zip((2.0, 2.0, 6.0, 0.1, 0.1, 0.05), triangles, strict=True)], 1)
    roll, pitch = 0.3 * _swing(17.0), 0.25 * _swing(13.0, 1.0)
    rotation = Rotation.from_euler("ZYX", np.stack([0 * roll, pitch, roll], 1)).as_matrix()
    gravity = np.broadcast_to([0.0, 0.0, 9.81], (len(time_s), 3))
    moving = _flight()
    if instrument.bench:
        on, attitude = Motion(time_s, np.zeros((len(time_s), 0))), None
    else:
        turning, attitude = {"rotation": rotation, "tilt_gravity": gravity, "voltage": moving.voltage}, (roll, pitch)
        on = Motion(time_s, moving.rotor_speed, moving.rotor_acceleration, **turning)
    warm, distance = 5.0 * time_s / _DURATION_S, 0.2 + 0.15 * _swing(19.0)
    of_run = (on, attitude, warm, 22.0 + warm, time_s, distance, moving.rotor_speed)
    return Loading("first", time_s, time_s, load, load, np.zeros(6), *of_run)


def _of_reading(effect: Effect, form: Form, instrument: InstrumentFacts) -> _Signature | None:
    """A form of a stand or bench: the reading's error over what explains it best."""
    test, values = _loading(instrument), _typical(form)
    contribution = form.contribution(test if form.on_loading else test.motion, instrument.vehicle, values)
    reading = contribution.reading
    if reading is None:
        return None
    scale = np.array([2.0, 2.0, 6.0, 0.1, 0.1, 0.05])
    size = np.sqrt(np.nanmean(reading**2, axis=0)) / scale
    if not np.nanmax(size) > 1e-9:
        return None
    channel = int(np.nanargmax(size))
    y = reading[:, channel]
    loads = {f"load, {CHANNELS[i]} ({UNITS[i]})": test.load[:, i] for i in instrument.channels}
    known = {"time (s)": test.time_s}
    excited = effect.excitation(form)
    if "tilt" in excited and test.attitude is not None:
        known = {"roll of the mount (rad)": test.attitude[0], "pitch of the mount (rad)": test.attitude[1]}
    elif excited and set(excited) <= {"load", "load_change"}:
        known = loads
    over = max(known, key=lambda name: explained(y, known[name]))
    return _of(form, values, over, f"error of {CHANNELS[channel]} ({UNITS[channel]})", known[over], y)


if TYPE_CHECKING:
    from matplotlib.figure import Figure


def signature_figure(shown: _Signature) -> Figure:
    """The signature of an effect: points over what it hangs on, or lines with and without it over time."""
    if shown.layouts is not None:
        figure, axes = style.figure(2.4, 1, 2)
        for axis, rotors, title in zip(axes, shown.layouts, ("as it is", "as vehicle.yaml says"), strict=True):
            _draw_rotors(axis, rotors, title)
        return figure
    figure, axis = style.figure(2.1)
    if shown.without is not None:
        axis.plot(shown.x, shown.without, color=style.COLOUR["noise"], label="without")
        axis.plot(shown.x, shown.y, color=style.COLOUR["model"], label="with")
        axis.legend()
    elif shown.over.startswith("time"):
        axis.plot(shown.x, shown.y, color=style.COLOUR["model"])
    else:
        axis.plot(shown.x, shown.y, ".", markersize=1.5, color=style.COLOUR["model"], rasterized=True)
    axis.set_xlabel(shown.over)
    axis.set_ylabel(shown.shows)
    if np.ptp(shown.y) == 0:
        middle = float(shown.y[0]) if len(shown.y) else 0.0
        axis.set_ylim(min(0.0, 2 * middle), max(0.0, 2 * middle))
    return figure


def _draw_rotors(axis, rotors, title: str) -> None:
    for number, rotor in enumerate(rotors, 1):
        colour = style.COLOUR["x"] if rotor.spin == "ccw" else style.COLOUR["y"]
        axis.plot(rotor.y_m, rotor.x_m, "o", markersize=22, markerfacecolor="none", color=colour)
        axis.annotate(f"{number}\n{rotor.spin}", (rotor.y_m, rotor.x_m), ha="center", va="center", fontsize=7.5)
    axis.set_aspect("equal")
    axis.margins(0.35)
    axis.set_title(f"{title}, seen from above")
    axis.set_xlabel("y, to the right (m)")
    axis.set_ylabel("x, forward (m)")
