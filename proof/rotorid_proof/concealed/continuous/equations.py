"""The equations of motion with the controller in them, and their solution.

State: position 0-2, velocity 3-5 (world), quaternion 6-9, rates 10-12, integrals of velocity and rate errors 13-15 and
16-18, filtered rates 19-21, battery's used charge 22, wake's inflow memory 23, then n smoothed commands, n speeds.
"""

from dataclasses import dataclass, field

import numpy as np
from numba import njit
from scipy.integrate import solve_ivp

from .craft import GRAVITY, Craft
from .rotor import coefficients, pitch_for

RHO = 1.225
GRID = 0.01
HEAD = 24


class Strayed(RuntimeError):
    """The vehicle was not held on its way."""


@dataclass
class Nature:
    """What is true beyond the believed vehicle; zero and one are nothing hidden."""

    lag: float = 0.0
    second: float = 0.0  # a second lag behind the first
    gain: np.ndarray | None = None  # thrust (and torque) of each rotor over the believed
    centre: np.ndarray = field(default_factory=lambda: np.zeros(3))
    inertia: np.ndarray | None = None
    tilt: np.ndarray = field(default_factory=lambda: np.zeros(2))  # thrust axis towards x and y, rad
    blades: float = 0.0  # 1: rotors by blade elements
    area: np.ndarray = field(default_factory=lambda: np.zeros(3))
    axiswise: float = 0.0  # 1: |v_j| v_j on each axis, 0: |v| v_j
    hub_moment: float = 0.0  # N m per rad/s and m/s
    damping: np.ndarray = field(default_factory=lambda: np.zeros(3))
    wind: np.ndarray = field(default_factory=lambda: np.zeros(3))
    turbulence: np.ndarray | None = None  # (k, 3) on GRID
    sag: float = 0.0  # loss of speed over a run from full battery, share
    limit: float = 1e9  # highest speed that is reached, rad/s
    late: float = 0.0  # commands act late, s
    sail: float = 0.0  # N m per (m/s)²: lift of the frame ahead of the centre of mass
    wake_s: float = 0.0  # memory of the wake: thrust overshoots when speeds change
    wake: float = 0.0


@njit(cache=True)
def cubic(table, t):
    """Catmull-Rom interpolation of a table (k, m) on GRID."""
    at = t / GRID
    i = int(at)
    i = min(max(i, 1), len(table) - 3)
    u = at - i
    a, b, c, d = table[i - 1], table[i], table[i + 1], table[i + 2]
    return b + 0.5 * u * (c - a + u * (2 * a - 5 * b + 4 * c - d + u * (3 * (b - c) + d - a)))


@njit(cache=True)
def cross(a, b):
    out = np.empty(3)
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]
    return out


@njit(cache=True)
def times(m, x):
    """Matrix times vector, without the library for large ones."""
    out = np.zeros(m.shape[0])
    for i in range(m.shape[0]):
        for j in range(m.shape[1]):
            out[i] += m[i, j] * x[j]
    return out


@njit(cache=True)
def turn_matrix(q):
    w, x, y, z = q / np.sqrt((q * q).sum())
    return np.array(
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )


@njit(cache=True)
def slope(
    t, y, path, gusts, c, hubs, spin, gain, centre, inertia, flown_inertia, unturned, inverse, areas, damping, wind
):
    """Time derivative of the state, and at its end the specific force at the believed origin (3)."""
    (mass, thrust_c, torque_c, radius, hover, lag, second, tilt_x, tilt_y, blades, axiswise, hub_moment, sag, limit,
     sail, wake_s, wake, solidity, pitch, loop, capacity, g) = c  # fmt: skip
    n = len(hubs)
    out = np.zeros(len(y) + 3)
    ref = cubic(path, t)
    p, v, q, rates = y[0:3], y[3:6], y[6:10], y[10:13]
    rot = turn_matrix(q)
    # cascade: position, velocity with integral
    slow = loop / 5.0
    goal_v = ref[3:6] + slow * (ref[0:3] - p)
    gap_v = goal_v - v
    want = ref[6:9] + 1.6 * slow * gap_v + y[13:16]
    out[13:16] = 0.3 * slow * slow * gap_v
    flat = np.sqrt(want[0] ** 2 + want[1] ** 2)
    if flat > 0.8 * g:
        want[0] *= 0.8 * g / flat
        want[1] *= 0.8 * g / flat
    push = np.array([want[0], want[1], min(want[2] - g, -0.35 * g)])
    down = -push / np.sqrt((push * push).sum())
    nose = np.array([np.cos(ref[9]), np.sin(ref[9]), 0.0])
    right = cross(down, nose)
    right /= np.sqrt((right * right).sum())
    goal = np.empty((3, 3))
    goal[:, 0], goal[:, 1], goal[:, 2] = cross(right, down), right, down
    err = np.zeros((3, 3))
    for i in range(3):
        err[:, i] = times(rot.T, goal[:, i])
    # attitude error as the vector part of the quaternion of the error, twice (small angles)
    e = np.array([err[2, 1] - err[1, 2], err[0, 2] - err[2, 0], err[1, 0] - err[0, 1]])
    e *= 1.0 / np.sqrt(1 + max(err[0, 0] + err[1, 1] + err[2, 2], -0.9))
    goal_w = loop * e
    goal_w[2] *= 0.4
    gap_w = goal_w - rates
    out[16:19] = 0.5 * loop * loop * gap_w
    out[19:22] = (rates - y[19:22]) * 200.0
    brake = 200.0 * (rates - y[19:22])  # filtered angular acceleration
    ask = 2.2 * loop * gap_w + y[16:19] - 0.1 * brake + ref[10:13]
    moment = times(inertia, ask) + cross(rates, times(inertia, rates))
    asked = np.empty(4)
    asked[0] = mass * max(-(push[0] * rot[0, 2] + push[1] * rot[1, 2] + push[2] * rot[2, 2]), 0.1 * g)
    asked[1:4] = moment
    squares = times(inverse, asked)
    command, speed = y[HEAD : HEAD + n], y[HEAD + n : HEAD + 2 * n]
    for i in range(n):
        w = np.sqrt(min(max(squares[i], (0.3 * hover) ** 2), (1.9 * hover) ** 2))
        out[HEAD + i] = (w - command[i]) * 120.0
    # motors
    used = y[22]
    power = 1.0 - sag * used
    total = 0.0
    real = np.empty(n)
    for i in range(n):
        aim = min(command[i] * power, limit)
        total += (speed[i] / hover) ** 3 / n
        if lag > 0:
            real[i] = speed[i]
            out[HEAD + n + i] = (aim - speed[i]) / lag
        else:
            real[i] = aim
            out[HEAD + n + i] = (aim - speed[i]) / 0.01
    if second > 0:
        for i in range(n):
            last = y[HEAD + 2 * n + i]
            out[HEAD + 2 * n + i] = (speed[i] - last) / second
            real[i] = last
    out[22] = total / capacity
    # wake: a share of the thrust follows the squared speeds late
    level = 0.0
    for i in range(n):
        level += (real[i] / hover) ** 2 / n
    if wake_s > 0:
        out[23] = (level - y[23]) / wake_s
    # forces about the true centre of mass, body axes
    air = wind.copy()
    if len(gusts) > 4:
        air += cubic(gusts, t)
    through = times(rot.T, v - air)
    force, torque = np.zeros(3), np.zeros(3)
    lean = np.array([tilt_x, tilt_y, -np.sqrt(1 - tilt_x**2 - tilt_y**2)])
    for i in range(n):
        arm = hubs[i] - centre
        local = through + cross(rates, arm)
        pull, side = thrust_c * gain[i] * real[i] ** 2, 0.0
        edge = np.sqrt(local[0] ** 2 + local[1] ** 2)
        if blades > 0:
            tip = real[i] * radius
            ct, ch = coefficients(edge / tip, -local[2] / tip, solidity, pitch)
            scale = RHO * np.pi * radius**2 * tip**2
            pull, side = gain[i] * scale * ct, scale * ch
        if wake_s > 0:
            pull += wake * pull * (level - y[23]) / max(level, 0.1)
        f = pull * lean
        if edge > 1e-6 and side > 0:
            f[0] -= side * local[0] / edge
            f[1] -= side * local[1] / edge
        force += f
        torque += cross(arm, f)
        torque -= spin[i] * torque_c * gain[i] * real[i] ** 2 * lean
        torque[0] += -hub_moment * real[i] * local[1]
        torque[1] += hub_moment * real[i] * local[0]
    size = np.sqrt((through * through).sum())
    for j in range(3):
        fast = abs(through[j]) if axiswise > 0 else size
        force[j] -= 0.5 * RHO * areas[j] * fast * through[j]
    torque -= damping * rates
    torque[1] += sail * through[0] * size
    torque[0] -= sail * through[1] * size
    out[0:3] = v
    felt = force / mass
    out[3:6] = times(rot, felt)
    out[5] += g
    unit = (q * q).sum()
    out[6] = -0.5 * (q[1] * rates[0] + q[2] * rates[1] + q[3] * rates[2])
    out[7] = 0.5 * (q[0] * rates[0] + q[2] * rates[2] - q[3] * rates[1])
    out[8] = 0.5 * (q[0] * rates[1] + q[3] * rates[0] - q[1] * rates[2])
    out[9] = 0.5 * (q[0] * rates[2] + q[1] * rates[1] - q[2] * rates[0])
    out[6:10] += 2.0 * (1 - unit) * q
    turning = times(unturned, torque - cross(rates, times(flown_inertia, rates)))
    out[10:13] = turning
    # what an accelerometer at the believed origin feels: it sits at −centre from the true one
    out[len(y) :] = felt - cross(turning, centre) - cross(rates, cross(rates, centre))
    return out


def parameters(craft: Craft, nature: Nature, seconds: float):
    """Arguments of `slope` behind the path."""
    n = craft.n
    share = craft.torque / craft.thrust
    effect = craft.thrust * np.stack([np.ones(n), -craft.hubs[:, 1], craft.hubs[:, 0], share * craft.spin])
    disc = np.pi * craft.radius**2
    target = craft.thrust / (RHO * disc * craft.radius**2)
    solidity = 0.12
    c = (
        craft.mass, craft.thrust, craft.torque, craft.radius, craft.hover, nature.lag, nature.second,
        float(nature.tilt[0]), float(nature.tilt[1]), nature.blades, nature.axiswise, nature.hub_moment, nature.sag,
        nature.limit, nature.sail, nature.wake_s, nature.wake, solidity, pitch_for(target, solidity),
        10.0 * craft.slow, seconds, GRAVITY,
    )  # fmt: skip
    gain = np.ones(n) if nature.gain is None else nature.gain
    flown = craft.inertia if nature.inertia is None else nature.inertia
    back = np.linalg.inv(flown)
    return (tuple(float(x) for x in c), craft.hubs, craft.spin, gain, nature.centre, craft.inertia, flown, back,
            np.linalg.pinv(effect), nature.area, nature.damping, nature.wind)  # fmt: skip


@njit(cache=True)
def forces_at(
    times, states, path, gusts, c, hubs, spin, gain, centre, inertia, flown, back, inverse, areas, damping, wind
):
    """Specific force at the believed origin, (k, 3), of a solution."""
    out = np.empty((len(times), 3))
    for i in range(len(times)):
        out[i] = slope(times[i], states[i], path, gusts, c, hubs, spin, gain, centre, inertia, flown, back, inverse,
                       areas, damping, wind)[-3:]  # fmt: skip
    return out


def start(craft: Craft, path: np.ndarray) -> np.ndarray:
    """At rest in hover at the beginning of a path."""
    y = np.zeros(HEAD + 3 * craft.n)
    y[0:3], y[6] = path[0, 0:3], 1.0
    y[23] = 1.0
    y[HEAD:] = craft.hover
    return y


def solve(craft: Craft, nature: Nature, path: np.ndarray, times: np.ndarray, tolerance: float = 1e-6) -> dict:
    """Fly a path (k, 13 on GRID: position, velocity, acceleration, heading, injected angular acceleration).

    Returns rows at `times`: p, v (of the believed origin), q, w, f, speed, command. Raises `Strayed`.
    """
    rest = parameters(craft, nature, float(times[-1]))
    gusts = np.zeros((1, 3)) if nature.turbulence is None else nature.turbulence

    def rates(t, y):
        return slope(t, y, path, gusts, *rest)[:-3]

    def lost(t, y):
        return 15.0 - np.abs(y[0:3] - cubic(path, t)[0:3]).max()

    lost.terminal = True
    found = solve_ivp(rates, (0.0, times[-1]), start(craft, path), "DOP853", times, rtol=tolerance, atol=1e-7,
                      max_step=0.05, events=lost)  # fmt: skip
    if found.status != 0:
        raise Strayed(f"at {found.t[-1] if len(found.t) else 0.0:.1f} s")
    y = found.y.T
    n = craft.n
    q = y[:, 6:10] / np.linalg.norm(y[:, 6:10], axis=1, keepdims=True)
    rot = np.array([turn_matrix(x) for x in q])
    w = y[:, 10:13]
    command = y[:, HEAD : HEAD + n]
    aim = np.minimum(command * (1 - nature.sag * y[:, 22:23]), nature.limit)
    speed = y[:, HEAD + n : HEAD + 2 * n] if nature.lag > 0 else aim
    if nature.second > 0:
        speed = y[:, HEAD + 2 * n :]
    back = -nature.centre
    return {
        "t": times,
        "p": y[:, 0:3] + rot @ back,
        "v": y[:, 3:6] + np.einsum("kij,kj->ki", rot, np.cross(w, back)),
        "q": q,
        "w": w,
        "f": forces_at(times, y, path, gusts, *rest),
        "speed": speed,
        "command": command,
        "used": y[:, 22],
    }
