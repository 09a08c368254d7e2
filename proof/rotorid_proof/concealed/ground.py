"""Recordings of benches and stands whose hidden cause is known: an instrument model of its own.

Loads are made on a clock ten times finer than the recording's and pass, in this order, through what is hidden in the
load (rotors, battery, mount, structure) and what is hidden in the reading (sensor, amplifier, clock, steps). Nothing
here comes from the catalogue under test; creep is one spring and damper or a chain of two, hysteresis a sum of plays
(Prandtl and Ishlinskii), ringing and filters are integrated in time (steps of a tenth of a sample, each exact for
loads that are linear over it, so that an answer's time constants are those of the equation and not of the integrator).

Axes as in the contract: forward-right-down, thrust along -z; the reading is the wrench on the sensor.
"""

from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from scipy.signal import butter, lfilter, sosfiltfilt

from .write import Recording, plain

FINE = 10
AXES = ("force_x_n", "force_y_n", "force_z_n", "moment_x_n_m", "moment_y_n_m", "moment_z_n_m")
MEANS = range(1, 13)
"""Numbers of neighbouring samples of which a stage may compare the mean."""
REFERENCES = ("reference_force_x_n", "reference_force_y_n", "reference_force_z_n")
RANGE_N = 10.0
GRAVITY = 9.81


@dataclass(frozen=True)
class Cause:
    """One hidden cause; `size` is over noise (found by scaling), else `amount` in the cause's own unit."""

    id: str
    size: float | None = None
    amount: float = 1.0
    form: str = ""


@dataclass(frozen=True)
class GroundPlan:
    """What is recorded and what is hidden."""

    kind: str  # bench | stand
    runs: tuple[str, ...]
    seconds: float = 40.0
    rate_hz: float = 100.0
    force_noise_n: float = 0.01
    moment_noise_n_m: float = 0.0005
    coloured_share: float = 0.0
    memory_s: float = 0.05
    step_share: float = 0.1  # resolution over noise
    axes: str = "xyz"  # bench: axes loaded
    rotors: int = 4
    columns: tuple[str, ...] = ("speed",)  # of speed, command, throttle, limits, battery, temperature, height
    mount: str = "level"
    tared: bool = False
    hidden: tuple[Cause, ...] = ()
    wrong: tuple[tuple[str, float], ...] = ()
    held_out: bool = False
    form: str = "csv"
    equivalent: tuple[tuple[str, ...], ...] = field(default_factory=tuple)


# ---- what was put on -------------------------------------------------------------------------------------------


def staircase(t, levels, ramp_s=0.15):
    """Piecewise constant levels of equal length joined by short ramps."""
    hold = t[-1] / len(levels)
    knots_t, knots_y = [0.0], [levels[0]]
    for k, level in enumerate(levels[1:], 1):
        knots_t += [k * hold, k * hold + ramp_s]
        knots_y += [levels[k - 1], level]
    return np.interp(t, [*knots_t, t[-1] + 1], [*knots_y, levels[-1]])


def bench_load(purpose, t, rng):
    """Scalar course of a load between 0 and 1."""
    if purpose == "updown":
        n = int(rng.integers(5, 8))
        up = np.linspace(0, 1, n)
        return staircase(t, np.concatenate([[0.0], up, up[::-1][1:], [0.0]]))
    if purpose == "ramps":
        period = t[-1] / float(rng.integers(2, 5))
        return 1 - np.abs(1 - 2 * ((t / period) % 1))
    if purpose == "random":
        levels = rng.uniform(0, 1, int(rng.integers(8, 14)))
        levels[[0, -1]] = 0
        return staircase(t, levels)
    if purpose == "hold":
        return staircase(t, [0, 1, 1, 1, 1, 0, 0, 0])
    f = np.array([0.15, 0.4, 0.9, 1.7, 3.1])
    wave = sum(np.sin(2 * np.pi * fk * t + rng.uniform(0, 6.28)) / (1 + k) for k, fk in enumerate(f))
    ramp = np.clip(np.minimum(t, t[-1] - t) / 2, 0, 1)
    return ramp * (0.5 + 0.22 * wave)


def throttles(purpose, t, k, rng):
    """Throttles (n, k) of a stand's run."""
    base = np.zeros((len(t), k))
    if purpose == "trapezoid":
        tops = rng.uniform(0.25, 0.85, k)
        edge = float(rng.uniform(1.0, 3.0))
        shape = np.clip(np.minimum((t - 2) / edge, (t[-1] - 2 - t) / edge), 0, 1)
        return shape[:, None] * tops
    if purpose == "stairs":
        n = int(rng.integers(5, 9))
        levels = np.concatenate([[0], rng.uniform(0.15, 0.9, n), [0]])
        common = staircase(t, levels)
        own = np.stack([staircase(t, np.concatenate([[1], rng.uniform(0.8, 1.2, n), [1]])) for _ in range(k)], axis=1)
        return np.clip(common[:, None] * own, 0, 1)
    if purpose == "updown":
        n = 6
        up = np.linspace(0.15, 0.9, n)
        common = staircase(t, np.concatenate([[0], up, up[::-1][1:], [0]]))
        own = rng.uniform(0.85, 1.1, k)
        return np.clip(common[:, None] * own, 0, 1)
    if purpose == "excite":
        for i in range(k):
            f = rng.uniform([0.2, 0.7, 1.5, 3.0, 5.0], [0.5, 1.2, 2.5, 4.5, 8.0])
            a = np.array([0.08, 0.07, 0.06, 0.05, 0.04])
            base[:, i] = 0.5 + (a * np.sin(2 * np.pi * f * t[:, None] + rng.uniform(0, 6.28, 5))).sum(axis=1)
        shape = np.clip(np.minimum((t - 1.5) / 1.0, (t[-1] - 1.5 - t) / 1.0), 0, 1)
        return np.clip(shape[:, None] * base, 0, 1)
    if purpose == "single":
        i = int(rng.integers(k))
        base[:, i] = staircase(t, [0, 0.3, 0.6, 0.8, 0.4, 0])
        return base
    raise ValueError(purpose)


# ---- hidden dynamics, integrated ------------------------------------------------------------------------------


def lagged(x, tau_up, tau_down, dt):
    """First-order lag on (n, k) with a constant for each direction, exact for inputs that are linear over a step."""
    if tau_up == tau_down:
        stay, share = held(tau_up, dt)
        # what the filter remembers of sample 0: input and state both stood at x[0]
        later, _ = lfilter([1.0 - share, share - stay], [1.0, -stay], x[1:], axis=0, zi=share * x[:1])
        return np.concatenate([x[:1], later])
    out = np.empty_like(x)
    state = x[0].copy()
    out[0] = state
    for i in range(1, len(x)):
        old, new = x[i - 1], x[i]
        stay, share = held(np.where(0.5 * (old + new) > state, tau_up, tau_down), dt)
        state = stay * state + (share - stay) * old + (1.0 - share) * new
        out[i] = state
    return out


def held(tau, dt):
    """Share of a lag's state that is left after a step, and its mean over the step."""
    ratio = dt / np.maximum(tau, 1e-6)
    return np.exp(-ratio), (1.0 - np.exp(-ratio)) / ratio


def oscillator(x, f_hz, zeta, dt):
    """y'' = ω²(x − y) − 2ζω y', (n, k), starting at rest on x[0]; exact for inputs that are linear over a step.

    The distance from the load obeys e'' + 2ζω e' + ω² e = x'' + 2ζω x'. With the pole p = ω(−ζ + i√(1−ζ²)) and the
    complex lag z' = p z + x' it is e = Re(z) − (Re p / Im p) Im(z), zero at the start.
    """
    w = 2 * np.pi * f_hz
    pole = w * complex(-zeta, np.sqrt(1.0 - zeta * zeta))
    turn = np.exp(pole * dt)
    slope = np.diff(x, axis=0, prepend=x[:1]) / dt
    z = lfilter([(turn - 1.0) / pole], [1.0, -turn], slope.astype(complex), axis=0)
    return x - (z.real - pole.real / pole.imag * z.imag)


def creep(x, amount, dt):
    """What springs and dampers in a chain add to (n, k): pairs of a share c and a time constant t."""
    if "c" in amount:
        return amount["c"] * lagged(x, amount["t_c"], amount["t_c"], dt)
    return sum(amount[f"c_{i}"] * lagged(x, amount[f"t_{i}"], amount[f"t_{i}"], dt) for i in (1, 2))


def prandtl_ishlinskii(x, amount, full):
    """Mean of plays of widths 1 to 12 % of full scale, less the load: a loop of rising and falling, (n,)."""
    widths = full * np.array([0.01, 0.03, 0.06, 0.09, 0.12])
    weights = np.array([0.35, 0.25, 0.2, 0.1, 0.1])
    out = np.zeros_like(x)
    for width, weight in zip(widths, weights, strict=True):
        state = 0.0
        track = np.empty_like(x)
        for i, v in enumerate(x):
            state = min(max(state, v - width), v + width)
            track[i] = state
        out += weight * (track - x) / (widths @ weights)
    return amount * out


# ---- the bench -------------------------------------------------------------------------------------------------


def bench_run(plan, purpose, axis, amounts, rng):
    """Reference, true reading before noise, and time on the fine clock; `purpose` is a name, or loads (n, 3) of t."""
    dt = 1 / plan.rate_hz / FINE
    t = np.arange(int(plan.seconds / dt)) * dt
    if callable(purpose):
        load = purpose(t)
        return t, load, sense(plan, np.concatenate([load, np.zeros((len(t), 3))], axis=1), t, amounts)
    course = bench_load(purpose, t, rng)
    load = np.zeros((len(t), 3))
    sign = {"x": 1.0, "y": 1.0, "z": -1.0}
    if axis == "all":
        for k, a in enumerate("xyz"):
            load[:, k] = sign[a] * RANGE_N * float(rng.uniform(0.6, 1.0)) * bench_load(purpose, t, rng)
    else:
        load[:, "xyz".index(axis)] = sign[axis] * RANGE_N * float(rng.uniform(0.85, 1.0)) * course
    full = np.concatenate([load, np.zeros((len(t), 3))], axis=1)
    reading = sense(plan, full.copy(), t, amounts)
    return t, load, reading


def sense(plan, load, t, amounts):
    """Reading (n, 6) of loads (n, 6) with everything hidden that a bench and a stand's sensor share."""
    dt = t[1] - t[0]
    y = load.copy()
    for cause, amount in amounts:
        pick = np.random.default_rng(7)
        signs = pick.choice([-1.0, 1.0], 6) * pick.uniform(0.4, 1.0, 6)
        full = np.array([RANGE_N] * 3 + [RANGE_N * 0.05] * 3)
        if cause.id == "structural_resonance":
            y = oscillator(y, amount["f_n"], amount["zeta"], dt)
        elif cause.id == "amplifier_filter":
            if cause.form == "second":
                y = oscillator(y, amount["f_c"], np.sqrt(0.5), dt)
            else:
                tau = 1 / (2 * np.pi * amount["f_c"])
                y = lagged(y, tau, tau, dt)
        elif cause.id == "creep":
            y = y + creep(load - load[0], amount, dt)
        elif cause.id == "hysteresis":
            # Widths and height of the loop belong to the sensor's range: they are the same in every run.
            for k in range(6):
                if np.ptp(load[:, k]) > 0:
                    y[:, k] += prandtl_ishlinskii(load[:, k] - load[0, k], amount["h"] * full[k], full[k])
        elif cause.id == "load_nonlinearity":
            for k in range(6):
                span = full[k]
                if cause.form == "cubic":
                    y[:, k] += amount["a"] * signs[k] * load[:, k] ** 3 / span**2
                else:
                    y[:, k] += amount["a"] * signs[k] * load[:, k] ** 2 / span
        elif cause.id == "crosstalk":
            matrix = pick.uniform(-1, 1, (6, 6)) * amount["C"]
            np.fill_diagonal(matrix, 0.0)
            matrix[:3, 3:] *= 5.0
            matrix[3:, :3] *= 0.02
            if cause.form == "z":
                keep = np.zeros((6, 6))
                keep[:, 2] = 1
                matrix = matrix * keep
            y = y + load @ matrix.T
        elif cause.id == "mount_tilt" and plan.kind == "bench":
            y = turn(y, amount["angle"] * np.array([1.0, -0.7, 0.0]))
        elif cause.id == "compliance":
            bend = amount["k"]
            for k in range(3):
                f = load[:, k]
                aside = (k + 1) % 3
                y[:, k] += bend * signs[k] * f * np.abs(f) / RANGE_N
                y[:, aside] += 0.6 * bend * f * np.sin(np.abs(f) / RANGE_N)
        elif cause.id == "zero_drift":
            if cause.form == "settling":
                y = y + amount["b"] * signs * unit6() * (1 - np.exp(-t / (0.3 * t[-1])))[:, None]
            else:
                y = y + amount["b"] * signs * unit6() * (t / t[-1])[:, None]
        elif cause.id == "tare_offset":
            y = y + amount["b"] * signs * unit6()
        elif cause.id == "clock_skew":
            late = amount["e"] * t
            y = np.stack([np.interp(t - late, t, column) for column in y.T], axis=1)
        elif cause.id == "reading_gain":
            y[:, :3] *= amount["gain"]
    return y


def unit6():
    """Newtons and the moment that goes with one, for constants that a sensor shares over its channels."""
    return np.array([1.0, 1.0, 1.0, 0.05, 0.05, 0.05])


def turn(y, angles):
    """Wrench as read by a sensor turned by small Euler angles (exact rotation matrices)."""
    ax, ay, az = angles
    cx, sx, cy, sy, cz, sz = np.cos(ax), np.sin(ax), np.cos(ay), np.sin(ay), np.cos(az), np.sin(az)
    rx = np.array([[1, 0, 0], [0, cx, sx], [0, -sx, cx]])
    ry = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]])
    rz = np.array([[cz, sz, 0], [-sz, cz, 0], [0, 0, 1]])
    r = rz @ ry @ rx
    return np.concatenate([y[:, :3] @ r.T, y[:, 3:] @ r.T], axis=1)


# ---- the stand -------------------------------------------------------------------------------------------------

THRUST, TORQUE, MASS, ARM, RADIUS, TOP = 1.41e-6, 1.9e-8, 0.66, 0.09, 0.0635, 1750.0
SENSOR_Z = 0.05
HUBS = np.array([[ARM, ARM, 0], [ARM, -ARM, 0], [-ARM, -ARM, 0], [-ARM, ARM, 0]])
SPINS = np.array([1.0, -1.0, 1.0, -1.0])


def stand_run(plan, purpose, tilt, amounts, rng):
    """Time, command, speed, voltage, height, roll, pitch and the true reading, on the fine clock.

    `purpose` is a name, or throttles (n, k) as a function of the time.
    """
    dt = 1 / plan.rate_hz / FINE
    t = np.arange(int(plan.seconds / dt)) * dt
    k = plan.rotors
    hubs = HUBS[:k] if k > 1 else np.zeros((1, 3))
    spins = SPINS[:k]
    u = purpose(t) if callable(purpose) else throttles(purpose, t, k, rng)
    command = u * TOP
    voltage = 16.4 - 0.9 * np.cumsum(u.mean(axis=1)) * dt / plan.seconds - 0.5 * u.mean(axis=1)
    speed = command.copy()
    found = {c.id: (c, a) for c, a in amounts}
    if "throttle_curve" in found:
        c, a = found["throttle_curve"]
        if c.form == "dead":
            speed = TOP * np.clip(u - a["u_0"], 0, None) / (1 - a["u_0"])
        else:
            speed = TOP * np.sqrt(np.clip(a["b"] * u + (1 - a["b"]) * u * u, 0, None))
    if "battery_sag" in found:
        speed = speed * ((voltage / voltage.max()) ** found["battery_sag"][1]["p"])[:, None]
    if "command_saturation" in found:
        speed = np.minimum(speed, found["command_saturation"][1]["limit"] * TOP)
    if "delay" in found:
        n = int(round(found["delay"][1]["T"] / dt))
        speed = np.concatenate([np.repeat(speed[:1], n, axis=0), speed[: len(speed) - n]]) if n else speed
    if "motor_lag" in found:
        a = found["motor_lag"][1]
        speed = lagged(speed, a["up"], a["down"], dt)
    thrust = THRUST * speed**2
    torque = TORQUE * speed**2
    if "thrust_curve" in found:
        c, a = found["thrust_curve"]
        thrust = thrust + (
            a["c"] * TOP * THRUST * speed if c.form != "constant" else a["c"] * THRUST * TOP**2 * (speed > 1)
        )
    if "unequal_rotors" in found:
        gains = 1 + found["unequal_rotors"][1]["d"] * np.array([1.0, -0.6, 0.3, -0.7])[:k]
        thrust, torque = thrust * gains, torque * gains
    if "wall_interference" in found:
        a = found["wall_interference"][1]
        # Air that was thrown out comes back as inflow: it takes thrust from a disc that turns, none from one at rest.
        thrust = thrust * (1 - a["c"] * lagged(speed, a["tau"], a["tau"], dt) / np.maximum(speed, 1e-9))
    height = 0.06 + 0.5 * float(rng.random()) + np.zeros(len(t))
    if "height" in plan.columns:
        height = staircase(t, rng.uniform(0.1, 0.5, 5), 1.0)
    if "ground_effect" in found:
        drop = hubs @ rotation(*tilt)[2]
        ratio = found["ground_effect"][1]["c"] * (RADIUS / (4 * np.maximum(height[:, None] - drop, 0.02))) ** 2
        thrust = thrust / (1 - np.minimum(ratio, 0.7))
    lean = found["thrust_tilt"][1]["eps"] * np.array([1.0, -0.6]) if "thrust_tilt" in found else np.zeros(2)
    axis = np.array([np.sin(lean[0]), np.sin(lean[1]), -np.sqrt(1 - np.sin(lean[0]) ** 2 - np.sin(lean[1]) ** 2)])
    force = thrust.sum(axis=1)[:, None] * axis
    moment = np.zeros((len(t), 3))
    for i in range(k):
        moment += np.cross(hubs[i], thrust[:, i : i + 1] * axis) - (spins[i] * torque[:, i])[:, None] * axis
    if "rotor_acceleration_torque" in found:
        moment[:, 2] += found["rotor_acceleration_torque"][1]["J_r"] * np.gradient(speed, dt, axis=0) @ spins
    roll, pitch = tilt
    a = found["mount_tilt"][1]["angle"] if "mount_tilt" in found else 0.0
    true_roll, true_pitch = roll + a, pitch - 0.7 * a
    body = rotation(true_roll, true_pitch)
    offset = found["com_offset"][1]["r"] * np.array([1.0, -0.6, 0.5]) if "com_offset" in found else np.zeros(3)
    origin = np.array([0, 0, SENSOR_Z]) if k > 1 else np.zeros(3)
    if "sensor_origin" in found:
        origin = origin + found["sensor_origin"][1]["d"] * np.array([1.0, -0.7, 0.0])
    weight_level = np.array([0, 0, MASS * GRAVITY])
    weight = np.zeros(6)
    wrench_f, wrench_m = force, moment - np.cross(origin, force)
    heavy_f = body.T @ weight_level
    heavy_m = np.cross(offset - origin, heavy_f)
    if plan.mount == "level":
        wrench_f, wrench_m = wrench_f @ body.T, wrench_m @ body.T
        heavy_f, heavy_m = body @ heavy_f, body @ heavy_m
    if not plan.tared:
        weight = np.concatenate([heavy_f, heavy_m])
    load = np.concatenate([wrench_f, wrench_m], axis=1) + weight
    if "cable_stiffness" in found:
        stiff = found["cable_stiffness"][1]["k"]
        load = load + stiff * np.array(
            [np.sin(pitch), -0.8 * np.sin(roll), 0, 0.03 * np.sin(roll), 0.04 * np.sin(pitch), 0]
        )
    return t, u, command, speed, voltage, height, sense(plan, load, t, amounts)


def rotation(roll, pitch):
    """Body into level axes: pitch after roll."""
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    return np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]]) @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])


TILTS = ((0.0, 0.0), (0.2618, 0.0), (0.0, -0.2618), (-0.5236, 0.0), (0.0, 0.5236), (0.0, 0.2618))

# unit amounts: (parameters at amount 1, those that the size scales)
UNIT_OF = {
    "up": "s",
    "down": "s",
    "T": "s",
    "t_c": "s",
    "t_1": "s",
    "t_2": "s",
    "tau": "s",
    "f_c": "Hz",
    "f_n": "Hz",
    "J_r": "kg m2",
}
"""Units of parameters that have one and mean the same for every channel; of the others 1, or not to be compared."""
UNITS = {
    "zero_drift": ({"b": 0.02}, ("b",)),
    "tare_offset": ({"b": 0.02}, ("b",)),
    "creep": ({"c": 0.01, "t_c": 0.12}, ("c",)),
    "hysteresis": ({"h": 0.002}, ("h",)),
    "load_nonlinearity": ({"a": 0.005}, ("a",)),
    "crosstalk": ({"C": 0.01}, ("C",)),
    "compliance": ({"k": 0.01}, ("k",)),
    "mount_tilt": ({"angle": 0.01}, ("angle",)),
    "cable_stiffness": ({"k": 0.2}, ("k",)),
    "sensor_origin": ({"d": 0.002}, ("d",)),
    "com_offset": ({"r": 0.002}, ("r",)),
    "unequal_rotors": ({"d": 0.03}, ("d",)),
    "thrust_tilt": ({"eps": 0.01}, ("eps",)),
    "thrust_curve": ({"c": 0.03}, ("c",)),
    "wall_interference": ({"c": 0.03, "tau": 6.0}, ("c",)),
    "ground_effect": ({"c": 3.0}, ("c",)),
    "rotor_acceleration_torque": ({"J_r": 8.5e-6}, ("J_r",)),
    "battery_sag": ({"p": 1.0}, ("p",)),
    "throttle_curve": ({"b": 0.1, "u_0": 0.03}, ("b", "u_0")),
    "motor_lag": ({"up": 0.045, "down": 0.06}, ("up", "down")),
    "delay": ({"T": 0.05}, ("T",)),
    "command_saturation": ({"limit": 0.75}, ()),
    "amplifier_filter": ({"f_c": 3.0}, ()),
    "structural_resonance": ({"f_n": 9.0, "zeta": 0.04}, ()),
    "clock_skew": ({"e": 2e-3}, ("e",)),
    "quantisation": ({"q": 3.0}, ("q",)),
}


def parameters(cause, factor, plan):
    """Parameters of a cause at a factor of its unit amount."""
    values, scaled = UNITS.get(cause.id, ({}, ()))
    out = {k: v * (factor if k in scaled else 1.0) for k, v in values.items()}
    if cause.id == "creep":
        out["t_c"] = out["t_c"] * plan.seconds
        if cause.form == "chain":  # most with t_c, a fifth with 3 t_c
            c, t = out["c"], out["t_c"]
            out = {"c_1": 0.8 * c, "t_1": t, "c_2": 0.2 * c, "t_2": 3 * t}
    if cause.id == "amplifier_filter":
        out["f_c"] = out["f_c"] / factor
    if cause.id == "structural_resonance":
        out["f_n"], out["zeta"] = min(out["f_n"], 0.2 * plan.rate_hz), 0.04
    return out


def simulate(plan, factors, seed):
    """Noise-free runs on the recording's clock: (table of columns that are known, reading (n, 6)) by run."""
    out = {}
    amounts = [(c, parameters(c, f, plan)) for c, f in zip(plan.hidden, factors, strict=True)]
    for number, purpose in enumerate(plan.runs):
        rng = np.random.default_rng([seed, 17, number])
        if plan.kind == "bench":
            axis = "all" if purpose == "mixed" else plan.axes[number // 2 % len(plan.axes)]
            wave = "waves" if purpose == "mixed" else purpose
            t, load, reading = bench_run(plan, wave, axis, amounts, rng)
            table = {"time_s": t}
            for k, name in enumerate(REFERENCES):
                if "xyz"[k] in plan.axes or plan.axes == "z":
                    table[name] = load[:, k]
        else:
            tilt = TILTS[number % len(TILTS)] if plan.rotors > 1 else (0.0, 0.0)
            t, *made, reading = stand_run(plan, purpose, tilt, amounts, rng)
            table = {"time_s": t} | stand_columns(plan, tilt, *made)
        pick = slice(0, len(t), FINE)
        out[f"run{number + 1:02d}"] = ({k: v[pick] for k, v in table.items()}, reading[pick])
    return out


def stand_columns(plan, tilt, u, command, speed, voltage, height):
    """What a stand records next to the reading."""
    table = {}
    for i in range(plan.rotors):
        if "speed" in plan.columns:
            table[f"rotor_speed_{i + 1}_rad_s"] = speed[:, i]
        if "command" in plan.columns:
            table[f"rotor_command_{i + 1}_rad_s"] = command[:, i]
        if "throttle" in plan.columns:
            table[f"throttle_{i + 1}"] = u[:, i]
    if "battery" in plan.columns:
        table["battery_voltage_v"] = voltage
    if "height" in plan.columns:
        table["height_m"] = height
    if plan.rotors > 1:
        table["roll_rad"], table["pitch_rad"] = np.full(len(speed), tilt[0]), np.full(len(speed), tilt[1])
    return table


def resolution(plan, factors):
    """Steps (6,) of the reading."""
    sigma = np.array([plan.force_noise_n] * 3 + [plan.moment_noise_n_m] * 3)
    coarse = next((f for c, f in zip(plan.hidden, factors, strict=True) if c.id == "quantisation"), None)
    return sigma * plan.step_share if coarse is None else sigma * UNITS["quantisation"][0]["q"] * coarse


def written(plan, known, noisy, rng):
    """The table of a run: what is known, speeds with a tachometer's noise, and readings (n, 6)."""
    columns = {k: np.array(v) for k, v in known.items()}
    for key in list(columns):
        if key.startswith("rotor_speed"):
            columns[key] = columns[key] * (1 + 0.0005 * rng.standard_normal(len(noisy)))
    for c in channels_of(plan):
        columns[AXES[c]] = noisy[:, c]
    return pd.DataFrame(columns)


def noise_of(plan, n, rng):
    """Noise (n, 6): white with a coloured share."""
    sigma = np.array([plan.force_noise_n] * 3 + [plan.moment_noise_n_m] * 3)
    white = rng.standard_normal((n, 6))
    a = np.exp(-1 / plan.rate_hz / plan.memory_s)
    coloured = np.empty_like(white)
    state = rng.standard_normal(6)
    drive = rng.standard_normal((n, 6)) * np.sqrt(1 - a * a)
    for i in range(n):
        state = a * state + drive[i]
        coloured[i] = state
    share = plan.coloured_share
    return sigma * (np.sqrt(1 - share) * white + np.sqrt(share) * coloured)


def channels_of(plan):
    if plan.kind == "bench":
        return [0, 1, 2]
    return [2] if plan.rotors == 1 else list(range(6))


def rms_of_means(values, count):
    """Rms of the means of every `count` neighbours."""
    whole = values[: len(values) // count * count].reshape(-1, count)
    return float(np.sqrt(np.mean(whole.mean(axis=1) ** 2)))


def filtered(values, rate_hz, cutoff_hz=20.0):
    if cutoff_hz >= 0.45 * rate_hz:
        return values
    return sosfiltfilt(butter(2, cutoff_hz, fs=rate_hz, output="sos"), values, axis=0)


def make(plan, seed):
    """Recording, truth and noise-free tables, in the form of the flights' answers."""
    rng = np.random.default_rng([seed, 3])
    still = simulate(GroundPlan(**{**plan.__dict__, "hidden": ()}), (), seed)
    noises = {name: noise_of(plan, len(r), rng) for name, (_, r) in still.items()}
    channels = channels_of(plan)
    level = np.sqrt(np.mean(np.concatenate([filtered(n, plan.rate_hz) for n in noises.values()]) ** 2, axis=0))
    factors = [c.amount for c in plan.hidden]

    def differs(only):
        """Ratio of an effect to the noise in its main channel, and that channel."""
        alone = GroundPlan(**{**plan.__dict__, "hidden": (plan.hidden[only],)})
        shown = simulate(alone, (factors[only],), seed)
        energy = np.concatenate([filtered(shown[n][1] - response(plan, still, shown, n), plan.rate_hz) for n in still])
        ratio = np.sqrt(np.mean(energy**2, axis=0)) / level
        best = max(channels, key=lambda c: ratio[c])
        return float(ratio[best]), best

    entries = []
    for k, cause in enumerate(plan.hidden):
        ratio, main = (None, channels[0]) if cause.id == "quantisation" else differs(k)
        if cause.size is not None and ratio:
            for _ in range(3):
                factors[k] *= cause.size / max(ratio, 1e-9)
                ratio, main = differs(k)
        entries.append(
            {
                "id": cause.id,
                "form": cause.form,
                "parameters": [
                    {"symbol": s, "value": v, "unit": UNIT_OF.get(s, "")}
                    for s, v in parameters(cause, factors[k], plan).items()
                ],
                "size_over_noise": ratio,
                "main_channel": AXES[main].rsplit("_n", 1)[0].removesuffix("_m").removesuffix("_n"),
                "amount": factors[k],
                "equivalent": [list(g) for g in plan.equivalent if cause.id in g],
            }
        )
    shown = simulate(plan, tuple(factors), seed)
    tables, oracle, ideals = {}, {}, {}
    step = resolution(plan, factors)
    gain = dict(plan.wrong).get("reading_gain", 1.0)
    for name, (known, reading) in shown.items():
        reading = reading.copy()
        reading[:, :3] *= gain
        noisy = np.round((reading + noises[name]) / step) * step
        tables[name] = written(plan, known, noisy, np.random.default_rng([seed, 5, len(tables)]))
        ideals[name] = pd.DataFrame({"time_s": known["time_s"], **{AXES[c]: reading[:, c] for c in channels}})
        off = reading - response(plan, still, shown, name)
        remainder = noisy - reading
        oracle[name] = {
            AXES[c].removesuffix("_m").removesuffix("_n"): {
                "noise_rms_of_means": {str(n): rms_of_means(remainder[:, c], n) for n in MEANS},
                "noise_rms": float(np.sqrt(np.mean(filtered(noises[name][:, c], plan.rate_hz) ** 2))),
                "mismatch_rms": float(np.sqrt(np.mean(filtered(off[:, c], plan.rate_hz) ** 2))),
                "before_rms": float(np.sqrt(np.mean(filtered(off[:, c] + noises[name][:, c], plan.rate_hz) ** 2))),
            }
            for c in channels
        }
    truth = {
        "effects": entries,
        "wrong_parameters": {},
        "outside_catalogue": [],
        "locations": [],
        "verdict": ["explained", "partly_explained"] if plan.hidden or plan.wrong else ["no_mismatch"],
        "oracle": {"cutoff_hz": 20.0, "runs": oracle},
    }
    vehicle = believed(plan, truth)
    held = (list(tables)[-1],) if plan.held_out and len(tables) > 2 else ()
    return Recording(vehicle, tables, held, plan.form), plain(truth), ideals


def response(plan, still, shown, name):
    """Reading that the believed model predicts from the recorded columns: true speeds where they are recorded."""
    known, _ = shown[name]
    if plan.kind == "bench":
        load = np.stack([known.get(r, np.zeros(len(known["time_s"]))) for r in REFERENCES], axis=1)
        return np.concatenate([load, np.zeros_like(load)], axis=1)
    if "speed" not in plan.columns:
        return still[name][1]
    k = plan.rotors
    speed = np.stack([known[f"rotor_speed_{i + 1}_rad_s"] for i in range(k)], axis=1)
    hubs, origin = (HUBS[:k], np.array([0, 0, SENSOR_Z])) if k > 1 else (np.zeros((1, 3)), np.zeros(3))
    thrust = THRUST * speed**2
    force = np.zeros((len(speed), 3))
    force[:, 2] = -thrust.sum(axis=1)
    moment = np.stack([-thrust @ hubs[:, 1], thrust @ hubs[:, 0], TORQUE * speed**2 @ SPINS[:k]], axis=1)
    moment = moment - np.cross(origin, force)
    body = rotation(known["roll_rad"][0], known["pitch_rad"][0]) if k > 1 else np.eye(3)
    heavy_f = body.T @ np.array([0, 0, MASS * GRAVITY])
    heavy_m = -np.cross(origin, heavy_f)
    if plan.mount == "level":
        force, moment, heavy_f, heavy_m = force @ body.T, moment @ body.T, body @ heavy_f, body @ heavy_m
    out = np.concatenate([force, moment], axis=1)
    return out if plan.tared else out + np.concatenate([heavy_f, heavy_m])


def believed(plan, truth):
    """vehicle.yaml, with wrong values noted in the truth."""
    wrong = dict(plan.wrong)
    noise = {"force_n": plan.force_noise_n}
    if plan.kind == "bench":
        if "reading_gain" in wrong:
            truth["wrong_parameters"]["reading_gain"] = {"believed": 1.0, "true": wrong["reading_gain"]}
        return {"name": "bench", "kind": "bench", "tared": True, "noise": noise}
    k = plan.rotors
    hubs = HUBS[:k] if k > 1 else np.zeros((1, 3))
    values = {"thrust_coefficient_n_s2": THRUST, "torque_coefficient_n_m_s2": TORQUE, "mass_kg": MASS, "arm_scale": 1.0}
    for name, factor in wrong.items():
        truth["wrong_parameters"][name] = {"believed": values[name] / factor, "true": values[name]}
        values[name] = values[name] / factor
    names = ("ccw", "cw", "ccw", "cw")
    vehicle = {
        "name": "stand",
        "kind": "stand",
        "rotors": [
            {"x_m": float(x * values["arm_scale"]), "y_m": float(y * values["arm_scale"]), "z_m": 0.0, "spin": names[i]}
            for i, (x, y, _) in enumerate(hubs)
        ],
        "thrust_coefficient_n_s2": values["thrust_coefficient_n_s2"],
        "torque_coefficient_n_m_s2": values["torque_coefficient_n_m_s2"],
        "rotor_radius_m": RADIUS,
        "tared": plan.tared,
        "noise": {**noise, "moment_n_m": plan.moment_noise_n_m},
    }
    if k > 1:
        vehicle |= {
            "mass_kg": values["mass_kg"],
            "inertia_kg_m2": {"xx": 0.0025, "yy": 0.0026, "zz": 0.0047},
            "sensor_position_m": [0.0, 0.0, SENSOR_Z],
            "sensor_mount": plan.mount,
        }
    if "limits" in plan.columns or "command" in plan.columns:
        vehicle["rotor_speed_limits_rad_s"] = [0.0, TOP]
    return vehicle
