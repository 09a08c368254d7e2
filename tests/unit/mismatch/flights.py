"""Flights made by hand for tests: a prescribed turning and thrust, everything else follows by rigid-body mechanics."""

from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from rotorid.recordings import RecordingSet, Run, Vehicle

DENSE_HZ = 1000.0
GRAVITY = 9.81
QUAD = {
    "name": "hand-made",
    "kind": "flight",
    "mass_kg": 0.652,
    "inertia_kg_m2": {"xx": 2.489e-3, "yy": 2.5743e-3, "zz": 4.6838e-3},
    "rotors": [
        {"x_m": 0.0884, "y_m": 0.0884, "spin": "ccw"},
        {"x_m": 0.0884, "y_m": -0.0884, "spin": "cw"},
        {"x_m": -0.0884, "y_m": -0.0884, "spin": "ccw"},
        {"x_m": -0.0884, "y_m": 0.0884, "spin": "cw"},
    ],
    "thrust_coefficient_n_s2": 1.3877e-6,
    "torque_coefficient_n_m_s2": 1.8558e-8,
}


def quad(**changes) -> Vehicle:
    """The thesis's vehicle, with changes."""
    return Vehicle.model_validate(QUAD | changes)


def smooth(rng: np.random.Generator, count: int, size: float, highest_hz: float) -> np.ndarray:
    """Band-limited noise of a given one-sigma, (count,)."""
    sos = butter(4, highest_hz, fs=DENSE_HZ, output="sos")
    values = sosfiltfilt(sos, rng.standard_normal(count + 4000))[2000:-2000]
    return size * values / values.std()


def slowed(acceleration: np.ndarray, rotation: np.ndarray, wind: np.ndarray, drag: float, square: float) -> np.ndarray:
    """Velocity (n, 3) of what accelerates (n, 3) and is slowed: across its third axis by `drag` per sample, along its
    way through the air by `square` per sample and m/s."""
    across = drag * (np.eye(3) - np.einsum("ni,nj->nij", rotation[:, :, 2], rotation[:, :, 2]))
    gained = acceleration / DENSE_HZ
    velocity = np.zeros_like(acceleration)
    for k in range(1, len(velocity)):
        air = velocity[k - 1] - wind[k]
        velocity[k] = velocity[k - 1] + gained[k] - across[k] @ air - square * np.sqrt(air @ air) * air
    return velocity


def towing(thrust: np.ndarray, rotation: np.ndarray, mass: float, load: tuple[float, float]) -> np.ndarray:
    """Velocity (n, 3) of what is pulled along its third axis by `thrust` (n,), N, and by a `load` (kg, m) on a cable at
    its centre of mass, which is out to the side when it begins."""
    ratio, length = load[0] / mass, load[1]
    down = np.array([0.0, 0.0, GRAVITY])
    cable, turning = np.array([0.5, 0.3, np.sqrt(1 - 0.34)]), np.zeros(3)
    velocity = np.zeros((len(thrust), 3))
    for k in range(1, len(thrust)):
        alone = down - thrust[k] / mass * rotation[k, :, 2]
        pull = ((down - alone) @ cable + length * turning @ turning) / (1.0 + ratio)
        acceleration = alone + ratio * pull * cable
        hanging = down - acceleration
        turning = turning + (hanging - (hanging @ cable) * cable) / length / DENSE_HZ
        cable = cable + turning / DENSE_HZ
        cable /= np.linalg.norm(cable)
        turning -= (turning @ cable) * cable
        velocity[k] = velocity[k - 1] + acceleration / DENSE_HZ
    return velocity


class Flight:
    """True motion on a dense grid; `record` samples it as columns, each sensor at its own instants."""

    def __init__(
        self,
        seed: int,
        duration_s: float = 25.0,
        drag: float = 0.0,
        excitation: float = 1.0,
        gust: tuple[float, float, float, float] | None = None,
        square_drag: float = 0.0,
        wind: tuple[float, float] = (0.0, 0.0),
        load: tuple[float, float] | None = None,
    ):
        """`drag` is a deceleration across the rotors' axis per airspeed, 1/s; `gust` its start and stop, s, and the
        wind north and east, m/s, that comes and goes within 0.3 s; `square_drag` a deceleration per airspeed squared,
        1/m, and `wind` blows all the time, m/s. A `load` (kg, m) hangs on a cable."""
        rng = np.random.default_rng(seed)
        self.vehicle = quad()
        count = int((duration_s + 2.0) * DENSE_HZ)
        t = np.arange(count) / DENSE_HZ
        sizes = ((0.25, 1.0), (0.06, 3.0), (0.06, 3.0))
        angles = np.stack([smooth(rng, count, size * excitation, highest) for size, highest in sizes], axis=1)
        rotation = Rotation.from_euler("ZYX", angles)
        q = rotation.as_quat()[:, [3, 0, 1, 2]]
        q *= np.where(np.einsum("ij,ij->i", q, np.roll(q, 1, axis=0)) < 0, -1.0, 1.0)[:, None]
        slope = CubicSpline(t, q).derivative()(t)
        w, x, y, z = q.T
        dw, dx, dy, dz = slope.T
        rate = 2 * np.stack(
            [w * dx - x * dw - y * dz + z * dy, w * dy - y * dw - z * dx + x * dz, w * dz - z * dw - x * dy + y * dx],
            axis=1,
        )
        thrust = self.vehicle.mass_kg * GRAVITY * (1 + smooth(rng, count, 0.08 * excitation, 3.0))
        air = np.zeros((count, 3))
        air[:, :2] = wind
        if gust is not None:
            start, stop = gust[0] + 1.0, gust[1] + 1.0  # recordings begin one second in
            air[:, :2] += np.interp(t, [start, start + 0.3, stop - 0.3, stop], [0, 1, 1, 0])[:, None] * gust[2:]
        force = np.stack([np.zeros(count), np.zeros(count), -thrust / self.vehicle.mass_kg], axis=1)
        acceleration = rotation.apply(force) + np.array([0.0, 0.0, GRAVITY])
        # With a drag the horizontal velocity stays bounded by itself.
        acceleration -= acceleration.mean(axis=0) * ((0.0, 0.0, 1.0) if drag or square_drag else 1.0)
        if load is not None:
            turned = rotation.as_matrix()
            thrust = (thrust + load[0] * GRAVITY) / turned[:, 2, 2]  # it keeps its height, more or less
            velocity = towing(thrust, turned, self.vehicle.mass_kg, load)
        elif drag or square_drag:
            velocity = slowed(acceleration, rotation.as_matrix(), air, drag / DENSE_HZ, square_drag / DENSE_HZ)
        else:
            velocity = cumulative_trapezoid(acceleration, t, axis=0, initial=0.0)
            velocity -= velocity.mean(axis=0)
        position = cumulative_trapezoid(velocity, t, axis=0, initial=0.0) + np.array([0.0, 0.0, -5.0])
        # The mean acceleration that was taken out returns as specific force, so that kinematics stay exact.
        exact = rotation.inv().apply(CubicSpline(t, velocity).derivative()(t) - np.array([0.0, 0.0, GRAVITY]))
        inertia = self.vehicle.inertia_kg_m2.matrix()
        moment = CubicSpline(t, rate).derivative()(t) @ inertia + np.cross(rate, rate @ inertia)
        at = self.vehicle.rotor_positions_m()
        lever = self.vehicle.torque_coefficient_n_m_s2 / self.vehicle.thrust_coefficient_n_s2
        mixer = np.stack([np.ones(4), -at[:, 1], at[:, 0], lever * self.vehicle.yaw_signs()])
        lift = -exact[:, 2] * self.vehicle.mass_kg if load is None else thrust
        thrusts = np.linalg.solve(mixer, np.column_stack([lift, moment]).T).T
        speed = np.sqrt(np.maximum(thrusts, 1e-3) / self.vehicle.thrust_coefficient_n_s2)
        self.truth = {
            "rotors": CubicSpline(t, speed), "position": CubicSpline(t, position),
            "velocity": CubicSpline(t, velocity), "attitude": CubicSpline(t, q), "gyroscope": CubicSpline(t, rate),
            "accelerometer": CubicSpline(t, exact),
        }  # fmt: skip
        self.phase = cumulative_trapezoid(speed, t, axis=0, initial=0.0)
        self.time_s, self.duration_s, self.rng = t, duration_s, rng

    def record(self, rate_hz: float = 200.0, late_s=None, growth=None, vibration: float = 0.0, name="run01") -> Run:
        """A run with noise. `late_s` and `growth` (sensor to s, s/s) put a sensor's stamps behind."""
        t = np.arange(int(self.duration_s * rate_hz)) / rate_hz
        noise = {"rotors": 5.0, "position": 0.001, "velocity": 0.02, "attitude": 0.001}
        noise |= {"gyroscope": 0.012, "accelerometer": 0.12}
        columns = {"time_s": t}
        for sensor, names in COLUMNS.items():
            when = 1.0 + t - (late_s or {}).get(sensor, 0.0) - (growth or {}).get(sensor, 0.0) * t
            values = self.truth[sensor](when)
            if sensor == "accelerometer" and vibration:
                psi = CubicSpline(self.time_s, self.phase)(when)
                values[:, 0] += vibration * np.cos(psi + np.arange(4)).sum(axis=1)
            values = values + noise[sensor] * self.rng.standard_normal(values.shape)
            columns |= {n: values[:, k] for k, n in enumerate(names)}
        return Run(name, pd.DataFrame(columns))


COLUMNS = {
    "rotors": tuple(f"rotor_speed_{i}_rad_s" for i in range(1, 5)),
    "position": tuple(f"position_{a}_m" for a in "xyz"),
    "velocity": tuple(f"velocity_{a}_m_s" for a in "xyz"),
    "attitude": tuple(f"quaternion_{a}" for a in "wxyz"),
    "gyroscope": tuple(f"angular_velocity_{a}_rad_s" for a in "xyz"),
    "accelerometer": tuple(f"specific_force_{a}_m_s2" for a in "xyz"),
}


def controlled(seed: int, duration_s: float = 20.0, away_m: float = 0.0, drag: float = 0.0, name: str = "run") -> Run:
    """A flight under a controller that answers disturbances and its gyroscope's noise; no accelerometer.

    It keeps its place, or follows a figure of eight of `away_m`; `drag` decelerates it, 1/s. Logged as speeds is what
    the rotors were told; theirs follow 30 ms later.
    """
    rng, step, motor_s = np.random.default_rng(seed), 0.004, 0.03
    vehicle = quad()
    mass, inertia, at = vehicle.mass_kg, np.diag(vehicle.inertia_kg_m2.matrix()), vehicle.rotor_positions_m()
    lever = vehicle.torque_coefficient_n_m_s2 / vehicle.thrust_coefficient_n_s2
    mixer = np.stack([np.ones(4), -at[:, 1], at[:, 0], lever * vehicle.yaw_signs()])
    allot, thrust = np.linalg.inv(mixer), np.full(4, mass * GRAVITY / 4)
    angle, rate, place, velocity, push, turn = np.zeros((6, 3))
    rows = []
    for k in range(int(duration_s / step)):
        t = k * step
        read = rate + 0.02 * rng.standard_normal(3)
        target = away_m * np.array([np.sin(0.9 * t), np.cos(0.7 * t), 0.0])
        moving = away_m * np.array([0.9 * np.cos(0.9 * t), -0.7 * np.sin(0.7 * t), 0.0])
        wish = np.clip(0.15 * (velocity - moving) + 0.08 * (place - target), -0.2, 0.2)
        asked = np.array([6.0, 6.0, 2.0]) * (np.array([-wish[1], wish[0], 0.0]) - angle)
        moment = inertia * np.array([12.0, 12.0, 4.0]) * (asked - read)
        lift = mass * (GRAVITY + 3.0 * velocity[2] + 2.0 * place[2])
        told = np.maximum(allot @ np.array([lift, *moment]), 0.05)
        if k % 2 == 0:
            rows.append([t, *np.sqrt(told / vehicle.thrust_coefficient_n_s2), *place, *velocity, *angle, *read])
        thrust += step / motor_s * (told - thrust)
        push += -push * step / 0.5 + np.sqrt(2 * step / 0.5) * 0.004 * mass * GRAVITY * rng.standard_normal(3)
        turn += -turn * step / 0.3 + np.sqrt(2 * step / 0.3) * 0.1 * inertia * rng.standard_normal(3)
        given = mixer @ thrust
        rate += step * (given[1:] + turn) / inertia
        angle += step * rate
        turned = Rotation.from_euler("ZYX", angle[::-1]).as_matrix()
        velocity += step * ((push - given[0] * turned[:, 2]) / mass - drag * velocity * (1, 1, 0) + (0, 0, GRAVITY))
        place += step * velocity
    table = np.array(rows)
    quaternion = Rotation.from_euler("ZYX", table[:, 13:10:-1]).as_quat()[:, [3, 0, 1, 2]]
    parts = {"rotors": table[:, 1:5], "position": table[:, 5:8], "velocity": table[:, 8:11]}
    parts |= {"attitude": quaternion, "gyroscope": table[:, 14:17]}
    columns = {n: v[:, k] for sensor, v in parts.items() for k, n in enumerate(COLUMNS[sensor])}
    return Run(name, pd.DataFrame({"time_s": table[:, 0], **columns}))


def recorded(*seeds: int, flight=None, vehicle: Vehicle | None = None, **how) -> RecordingSet:
    """A set of one run for every seed."""
    runs = tuple(Flight(seed, **(flight or {})).record(name=f"run{k:02d}", **how) for k, seed in enumerate(seeds))
    return RecordingSet("hand-made", vehicle or quad(), runs)


def as_commands(table):
    """The rotor speeds' columns as commands."""
    return table.rename(columns={name: name.replace("speed", "command") for name in COLUMNS["rotors"]})


def with_table(recordings: RecordingSet, change, *only: str) -> RecordingSet:
    """The set with every run's table, or those of `only` some runs, as `change` returns it, or changes it in place."""

    def changed(run: Run) -> Run:
        made = change(table := run.table.copy())
        return replace(run, table=table if made is None else made)

    return replace(recordings, runs=tuple(changed(r) if not only or r.name in only else r for r in recordings.runs))
