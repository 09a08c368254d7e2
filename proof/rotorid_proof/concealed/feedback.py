"""Gentle flights in gusts of which commands alone are recorded: what moves the commands is the controller.

A rigid body with four rotors under a position, attitude and rate controller that hears the gyroscope's noise. Random
forces and moments push it; what lies between command and thrust (a lag, a delay, a curve, a battery) is drawn, and may
be nothing. Whoever takes what a loop does against gusts for physics finds curves here that do not exist. numpy alone.

Of what is there nothing need be found: a quiet hover may not show it. What is said of it must be right.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from .write import Recording, plain

STEP = 0.004
"""Seconds of a step of the controller and of the physics."""
WARM_UP_S, GRAVITY = 3.0, 9.81
FAMILIES = ("clean", "late", "curved", "both")
"""What lies between command and thrust: nothing, a lag, a curve, a lag and a curve."""
LAYOUT = np.array([[1, 1], [-1, -1], [1, -1], [-1, 1]]) / np.sqrt(2)
SPIN = np.array([1.0, 1.0, -1.0, -1.0])


class Strayed(RuntimeError):
    """The controller does not hold the vehicle."""


@dataclass(frozen=True)
class Path:
    """What lies between command and thrust. F = F_0 (u/u_0)^(2n), or ((u − d)/(u_0 − d))², times V^2p, late."""

    hover: float
    """u_0, share of the full command that carries the weight at the full voltage."""
    n: float = 1.0
    dead: float = 0.0
    p: float = 0.0
    sag: float = 0.0
    """Share of the voltage that a flight takes."""
    lag_s: float = 0.0
    delay_s: float = 0.0

    @property
    def elasticity(self) -> float:
        """Of the speed about the hover command."""
        return self.n * self.hover / (self.hover - self.dead)

    def share(self, u: np.ndarray, voltage: float) -> np.ndarray:
        """Steady thrust over the hover's."""
        live = np.maximum(u - self.dead, 1e-6) / (self.hover - self.dead)
        return live ** (2 * self.n) * voltage ** (2 * self.p)

    def command(self, share: np.ndarray) -> np.ndarray:
        """What a controller that knows the curve asks for: no command of its own is far off."""
        return self.dead + (self.hover - self.dead) * share ** (0.5 / self.n)


@dataclass(frozen=True)
class Card:
    """A case while it is drawn."""

    path: Path
    mass: float
    arm: float
    inertia: np.ndarray
    gust: float
    """Random force, one sigma, share of the weight."""
    memory_s: float
    away_m: float
    """Size of a slow figure of eight; 0 of a hover."""
    stiff: float
    """Bandwidth of the attitude loop, rad/s."""
    gyro: float
    knows: bool
    """Whether the controller undoes the curve, as autopilots with a thrust model do."""
    speeds: bool
    """Commanded speeds are recorded, not throttles."""
    felt: bool
    rate_hz: int
    voltage: bool
    seconds: float


def _of_a_body(inertia: np.ndarray) -> np.ndarray:
    """Moments of inertia (3,), the last no larger than the sum of the others."""
    return np.array([*inertia[:2], min(inertia[2], 0.97 * inertia[:2].sum())])


def drafted(family: str, seed: int) -> Card:
    """A card of a family."""
    rng = np.random.default_rng([seed, 1])
    mass = float(np.exp(rng.uniform(np.log(0.3), np.log(3.0))))
    arm = 0.2 * mass ** (1 / 3) * float(rng.uniform(0.8, 1.2))
    own: dict = {"hover": float(rng.uniform(0.25, 0.55))}
    voltage = bool(rng.random() < 0.6)
    if family in ("late", "both"):
        own["lag_s"] = float(np.exp(rng.uniform(np.log(0.015), np.log(0.08))))
        if rng.random() < 0.3:
            own["delay_s"] = STEP * int(rng.integers(1, 6))
    if family in ("curved", "both"):
        if rng.random() < 0.6:
            own["n"] = float(rng.choice([rng.uniform(0.5, 0.8), rng.uniform(1.25, 1.6)]))
        else:
            own["dead"] = float(rng.uniform(0.2, 0.45)) * own["hover"]
    if family == "both" and rng.random() < 0.5:
        own |= {"p": float(rng.uniform(0.6, 1.0)), "sag": float(rng.uniform(0.05, 0.12))}
        voltage = True
    spread = rng.uniform(0.8, 1.2, 3)
    return Card(
        path=Path(**own),
        mass=mass,
        arm=arm,
        inertia=_of_a_body(np.array([0.25, 0.25, 0.45]) * mass * arm**2 * spread),
        gust=float(np.exp(rng.uniform(np.log(0.003), np.log(0.03)))),
        memory_s=float(rng.uniform(0.2, 1.0)),
        away_m=float(rng.choice([0.0, 0.0, rng.uniform(0.3, 1.0)])),
        stiff=float(rng.uniform(5.0, 9.0)),
        gyro=float(np.exp(rng.uniform(np.log(0.004), np.log(0.025)))),
        knows=bool(rng.random() < 0.5),
        speeds=bool(rng.random() < 0.35),
        felt=bool(rng.random() < 0.6),
        rate_hz=int(rng.choice([50, 100, 125, 250])),
        voltage=voltage,
        seconds=float(rng.uniform(18.0, 24.0)),
    )


def turned(by: np.ndarray) -> np.ndarray:
    """Rotation matrix of a rotation vector, Rodrigues."""
    angle = float(np.sqrt(by @ by)) + 1e-12
    x, y, z = by / angle
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * (k @ k)


def quaternions(r: np.ndarray) -> np.ndarray:
    """Of rotation matrices (k, 3, 3), scalar first; tilts and turns are far below half a turn."""
    w = 0.5 * np.sqrt(np.maximum(1 + np.trace(r, axis1=1, axis2=2), 1e-9))
    rest = [r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]]
    return np.column_stack([w, *(x / (4 * w) for x in rest)])


def fly(card: Card, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """One flight, every step; what is before its motion has settled is left out."""
    m, j, weight = card.mass, card.inertia, card.mass * GRAVITY
    at = LAYOUT * card.arm
    mix = np.vstack([np.ones(4), -at[:, 1], at[:, 0], 0.02 * SPIN])
    unmix = np.linalg.inv(mix)
    steps = int((card.seconds + WARM_UP_S) / STEP)
    # Gusts: first-order coloured, force over the weight and moment over that on an arm of a tenth of the vehicle's.
    a = np.exp(-STEP / card.memory_s)
    drive = np.sqrt(1 - a * a) * rng.standard_normal((steps, 6))
    sizes = card.gust * weight * np.array([1.0, 1.0, 1.0, 0.1 * card.arm, 0.1 * card.arm, 0.03 * card.arm])
    heard = card.gyro * rng.standard_normal((steps, 3))
    late = max(0, round(card.path.delay_s / STEP))
    queue = [np.full(4, card.path.hover)] * (late + 1)
    follows = 1.0 - np.exp(-STEP / card.path.lag_s) if card.path.lag_s else 1.0
    r, w, v, p = np.eye(3), np.zeros(3), np.zeros(3), np.zeros(3)
    speed, gust = np.ones(4), np.zeros(6)
    slow, out, times = np.zeros(3), [], STEP * np.arange(steps)
    paths = np.column_stack([np.sin(0.9 * times), np.sin(1.4 * times) * np.cos(0.4 * times), 0.3 * np.sin(0.6 * times)])
    quick, stiffness = np.array([1.0, 1.0, 0.3]) * card.stiff, j * np.array([2.5, 2.5, 1.0]) * card.stiff
    for i in range(steps):
        t, voltage = i * STEP, 1.0 - card.path.sag * i / steps
        goal = card.away_m * min(1.0, t / WARM_UP_S) * paths[i]
        away = goal - p
        slow = np.clip(slow + 0.3 * STEP * away, -1.5, 1.5)
        asked = np.clip(away - 1.6 * v + slow, -2.5, 2.5)
        tilt = np.array([asked[1], -asked[0], 0.0]) / GRAVITY  # of a thrust that points to −z
        error = tilt - 0.5 * np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
        turn = stiffness * (quick * error - w - heard[i])
        share = np.clip(unmix @ np.array([m * (GRAVITY - asked[2]), *turn]) * (4 / weight), 0.05, 4.0)
        u = card.path.command(share) if card.knows else card.path.hover * (1 + 0.5 * (share - 1))
        u = np.clip(u, 0.3 * card.path.hover, 1.0)
        queue.append(u)
        # The speed, over the hover's, follows a command from the next step on; without a lag it is there at once.
        steady = np.sqrt(card.path.share(queue[-1 - late], voltage))
        speed = speed if card.path.lag_s else steady
        gust = a * gust + drive[i]
        push = sizes * gust
        wrench = mix @ (0.25 * weight * speed**2)
        force = np.array([0.0, 0.0, -wrench[0]]) + r.T @ push[:3]
        if t >= WARM_UP_S:
            out.append(np.concatenate([[t - WARM_UP_S], u, p, v, r.ravel(), w + heard[i], force / m, [voltage]]))
        speed = speed + follows * (steady - speed)
        x, y, z = w
        gyroscopic = np.array([(j[2] - j[1]) * y * z, (j[0] - j[2]) * z * x, (j[1] - j[0]) * x * y])
        w = w + STEP * (wrench[1:] + push[3:] - gyroscopic) / j
        v = v + STEP * (r @ force / m + [0.0, 0.0, GRAVITY])
        p = p + STEP * v
        r = r @ turned(STEP * w)
    table = np.array(out)
    if not np.all(np.isfinite(table)) or np.abs(table[:, 5:8]).max() > 20.0:
        raise Strayed(f"{np.abs(table[:, 5:8]).max():.0f} m away")
    names = {"t": 1, "u": 4, "p": 3, "v": 3, "r": 9, "w": 3, "f": 3, "volt": 1}
    parts = np.split(table, np.cumsum(list(names.values()))[:-1], axis=1)
    return dict(zip(names, parts, strict=True))


def recorded(card: Card, flight: dict[str, np.ndarray], full: float, rng: np.random.Generator) -> pd.DataFrame:
    """What is written down: commands, estimates of pose and velocity, gyroscope, where felt an accelerometer."""
    pick = slice(None, None, max(1, round(1 / STEP / card.rate_hz)))
    k = len(flight["t"][pick])
    out = {"time_s": flight["t"][pick, 0]}

    def put(names, values, sigma):
        values = values + sigma * rng.standard_normal(values.shape)
        out.update({n: values[:, i] for i, n in enumerate(names)})

    u = flight["u"][pick]
    if card.speeds:
        put([f"rotor_command_{i}_rad_s" for i in range(1, 5)], full * u, 0.0)
    else:
        put([f"throttle_{i}" for i in range(1, 5)], u, 0.0)
    put([f"position_{a}_m" for a in "xyz"], flight["p"][pick], 0.002)
    put([f"velocity_{a}_m_s" for a in "xyz"], flight["v"][pick], 0.01)
    put([f"quaternion_{a}" for a in "wxyz"], quaternions(flight["r"][pick].reshape(k, 3, 3)), 0.0005)
    put([f"angular_velocity_{a}_rad_s" for a in "xyz"], flight["w"][pick], 0.0)
    if card.felt:
        put([f"specific_force_{a}_m_s2" for a in "xyz"], flight["f"][pick], 0.15)
    if card.voltage:
        put(["battery_voltage_v"], 12.4 * flight["volt"][pick], 0.01)
    return pd.DataFrame(out)


def make(family: str, seed: int):
    """The set, its truth, and no noise-free tables."""
    card = drafted(family, seed)
    rng = np.random.default_rng([seed, 2])
    full = float(rng.uniform(700, 2500))
    coefficient = card.mass * GRAVITY / 4 / (full * card.path.hover) ** 2
    runs = {f"run{i:02d}": recorded(card, fly(card, rng), full, rng) for i in (1, 2)}
    vehicle = {
        "name": "quadrotor",
        "kind": "flight",
        "mass_kg": card.mass,
        "inertia_kg_m2": dict(zip(("xx", "yy", "zz"), card.inertia, strict=True)),
        "rotors": [
            {"x_m": x, "y_m": y, "z_m": 0.0, "spin": "ccw" if s > 0 else "cw"}
            for (x, y), s in zip(LAYOUT * card.arm, SPIN, strict=True)
        ],
        "thrust_coefficient_n_s2": coefficient,
        "torque_coefficient_n_m_s2": 0.02 * coefficient,
        "gravity_m_s2": GRAVITY,
        "rotor_speed_limits_rad_s": [0.0, full],
    }
    path = card.path
    effects = []
    if path.lag_s:
        effects.append(_effect("motor_lag", [("tau", path.lag_s, "s")], ["delay"]))
    if path.delay_s:
        effects.append(_effect("delay", [("T", path.delay_s, "s")], ["motor_lag"]))
    if path.elasticity != 1.0:
        effects.append(_effect("throttle_curve", [], ["thrust_curve"]))
    if path.p:
        effects.append(_effect("battery_sag", [("p", path.p, "1")], ["throttle_curve"]))
    truth = {
        "effects": effects,
        "path": {
            "elasticity": path.elasticity,
            "late_s": path.lag_s + path.delay_s,
            "voltage": path.p if path.sag else None,
            "hover": path.hover,
        },
        "wrong_parameters": {},
        "outside_catalogue": [],
        "fair": ["gust"],
        "fair_why": "random forces act all the time",
        "need_not_be_found": True,
        "grade": "felt" if card.felt else "commands",
        "locations": [],
        "verdict": ["no_mismatch", "explained", "partly_explained", "unexplained"],
        "seed": seed,
    }
    return Recording(vehicle, runs, (), ("csv", "csv.gz", "parquet")[seed % 3]), plain(truth), {}


def _effect(id: str, parameters, equivalent) -> dict:
    listed = [{"symbol": s, "value": v, "unit": u} for s, v, u in parameters]
    return {
        "id": id,
        "form": "",
        "parameters": listed,
        "equivalent": equivalent,
        "size_over_noise": None,
        "main_channel": "force_z",
        "amount": 1.0,
    }
