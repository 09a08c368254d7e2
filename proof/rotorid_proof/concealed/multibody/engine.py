"""The flight itself: MuJoCo moves the bodies, this module brings thrust, air and motors to them at 1 kHz."""

from dataclasses import dataclass, field

import mujoco
import numpy as np
from numba import njit

from .vehicle import GRAVITY, RHO, Quad

STEP = 1e-3
SWINGING = 0.1
"""Second difference of the yaw rate from step to step, rad/s: commands with noise make a hundredth of it."""
mujoco.set_mju_user_warning(lambda text: None)  # said by `Lost`; MuJoCo would write a file where it is run


class Lost(RuntimeError):
    """The vehicle left its reference: of a crash nothing is asked."""


@dataclass
class World:
    """What is true, in addition to the quadrotor that the user believes in. All zero is nothing hidden."""

    extra_bodies: str = ""
    """MJCF of bodies that hang on the vehicle."""
    extra_world: str = ""
    """MJCF of the world next to it."""
    extra_tendons: str = ""
    mass: float | None = None
    """Mass, centre and inertia about it of the vehicle's own body, where they are not the believed ones."""
    centre: np.ndarray = field(default_factory=lambda: np.zeros(3))
    inertia: np.ndarray | None = None
    thrust_gain: np.ndarray = field(default_factory=lambda: np.ones(4))
    torque_gain: np.ndarray = field(default_factory=lambda: np.ones(4))
    drag_speed: float = 0.0  # N per rad/s and m/s, at each hub
    drag_thrust: float = 0.0  # per m/s, share of the thrust
    area: np.ndarray = field(default_factory=lambda: np.zeros(3))  # drag areas of the frame, m²
    wind: np.ndarray | None = None  # (k, 3) m/s in the world, each step
    ground: float = 0.0  # 1: rotors feel the ground at z = 0
    rotor_inertia: float = 0.0  # kg m², gyroscopic and spin-up moments
    motor: dict | None = None  # machine and battery; without: speeds follow with `lag`
    lag: float = 0.0
    load_drag: float = 0.0  # drag area of the hung load, m²


def mjcf(quad: Quad, world: World) -> str:
    """The model as MuJoCo's XML."""
    mass = quad.mass if world.mass is None else world.mass
    j = quad.inertia if world.inertia is None else world.inertia
    full = " ".join(f"{v:.17g}" for v in (j[0, 0], j[1, 1], j[2, 2], j[0, 1], j[0, 2], j[1, 2]))
    at = " ".join(f"{v:.17g}" for v in world.centre)
    sites = "".join(f'<site name="r{i}" pos="{r[0]:.17g} {r[1]:.17g} {r[2]:.17g}"/>' for i, r in enumerate(quad.hubs))
    pushes = "".join(
        f'<general name="f{i}" site="r{i}" gear="0 0 -1 0 0 0"/><general name="q{i}" site="r{i}" gear="0 0 0 0 0 1"/>'
        for i in range(len(quad.hubs))
    )
    return f"""<mujoco>
<option timestep="{STEP}" integrator="RK4" gravity="0 0 {GRAVITY}"/>
<compiler balanceinertia="false" boundmass="0" boundinertia="0"/>
<worldbody>{world.extra_world}
<body name="quad"><freejoint/><inertial pos="{at}" mass="{mass:.17g}" fullinertia="{full}"/>
<site name="imu"/>{sites}{world.extra_bodies}</body></worldbody>
<tendon>{world.extra_tendons}</tendon>
<actuator>{pushes}</actuator>
<sensor><accelerometer site="imu"/></sensor></mujoco>"""


@njit(cache=True)
def steer(p, v, rot, rates, ref, memory, gains, mass, inertia, inverse, top, hover):
    """Rotor speeds of a geometric controller on SO(3) with an integral (Lee 2010, Goodarzi 2013).

    `ref` is position, velocity, acceleration (3 each), heading, angular acceleration to inject (3).
    """
    kp, kv, ki, kr, kw = gains
    for i in range(3):
        memory[i] = min(max(memory[i] + ki * STEP * (p[i] - ref[i]), -4.0), 4.0)
    want = np.empty(3)
    for i in range(3):
        want[i] = ref[6 + i] - kp * (p[i] - ref[i]) - kv * (v[i] - ref[3 + i]) - memory[i]
    flat = np.sqrt(want[0] ** 2 + want[1] ** 2)
    most = 0.9 * GRAVITY
    if flat > most:
        want[0] *= most / flat
        want[1] *= most / flat
    want[2] -= GRAVITY
    want[2] = min(want[2], -0.3 * GRAVITY)
    size = np.sqrt((want * want).sum())
    down = -want / size
    heading = np.array([np.cos(ref[9]), np.sin(ref[9]), 0.0])
    right = np.cross(down, heading)
    right /= np.sqrt((right * right).sum())
    ahead = np.cross(right, down)
    goal = np.empty((3, 3))
    goal[:, 0], goal[:, 1], goal[:, 2] = ahead, right, down
    gap = goal.T @ rot
    error = 0.5 * np.array([gap[2, 1] - gap[1, 2], gap[0, 2] - gap[2, 0], gap[1, 0] - gap[0, 1]])
    turn = np.empty(3)
    for i in range(3):
        soft = 0.35 if i == 2 else 1.0
        turn[i] = -soft * kr * error[i] - np.sqrt(soft) * kw * rates[i] + ref[10 + i]
    momentum = inertia @ rates
    moment = inertia @ turn + np.cross(rates, momentum)
    asked = np.empty(4)
    asked[0] = mass * -(want[0] * rot[0, 2] + want[1] * rot[1, 2] + want[2] * rot[2, 2])
    asked[1:] = moment
    squares = inverse @ asked
    out = np.empty(len(squares))
    for i in range(len(out)):
        out[i] = np.sqrt(min(max(squares[i], (0.25 * hover) ** 2), top**2))
    return out


@njit(cache=True)
def airload(rot, v, rates, wind, speed, thrust, hubs, drag_speed, drag_thrust, area):
    """Force and moment of the air about the body's origin, body axes, less the rotors' thrust."""
    through = rot.T @ (v - wind)
    force, moment = np.zeros(3), np.zeros(3)
    for i in range(len(speed)):
        local = through + np.cross(rates, hubs[i])
        k = drag_speed * speed[i] + drag_thrust * thrust[i]
        push = np.array([-k * local[0], -k * local[1], 0.0])
        force += push
        moment += np.cross(hubs[i], push)
    size = np.sqrt((through * through).sum())
    force -= 0.5 * RHO * area * size * through
    return force, moment


def cushion(height, radius, spacing):
    """Thrust near the ground over thrust away from it, for four rotors and a body between them.

    Sanchez-Cuevas, Heredia, Ollero (2017): images of all rotors and of the fountain, K_b = 2.
    """
    z, r2 = np.maximum(height, 0.6 * radius), radius * radius
    b2 = 2 * spacing**2
    less = (radius / (4 * z)) ** 2 + r2 * z / (spacing**2 + 4 * z * z) ** 1.5
    less += 0.5 * r2 * z / (b2 + 4 * z * z) ** 1.5 + 4 * r2 * z / (b2 + 4 * z * z) ** 1.5
    return 1 / (1 - np.minimum(less, 0.5))


def machine(speed, duty, voltage, m, torque):
    """Acceleration of a direct-current motor with its propeller, and its current: V u = K ω + R i, J ω' = K i − Q."""
    current = (voltage * duty - m["k"] * speed) / m["r"]
    return (m["k"] * current - torque * speed**2) / m["j"], current


def fly(quad: Quad, world: World, reference: np.ndarray, noise: np.ndarray, bandwidth: float, charge: float = 1.0):
    """Fly a reference (k, 13) from hover; `noise` (k, 3) is on the rates that the controller sees.

    Returns a dict of arrays with one row a step. Raises `Lost` if the vehicle strays more than 12 m, or its
    controller and the reaction of its rotors set each other swinging.
    """
    model = mujoco.MjModel.from_xml_string(mjcf(quad, world))
    data = mujoco.MjData(model)
    data.qpos[:3] = reference[0, :3]
    body = model.body("quad").id
    k, n = len(reference), len(quad.hubs)
    share = quad.torque / quad.thrust
    effect = np.stack([np.ones(n), -quad.hubs[:, 1], quad.hubs[:, 0], share * quad.spin]) * quad.thrust
    inverse = np.linalg.pinv(effect)
    slow = bandwidth / 5.0
    gains = (slow**2, 1.8 * slow, 0.25 * slow**3, bandwidth**2, 1.7 * bandwidth)
    memory = np.zeros(3)
    speed = np.full(n, quad.hover)
    smooth = speed.copy()
    slope = np.zeros(n)
    loads = [b for b in range(model.nbody) if (model.body(b).name or "").startswith("load")]
    out = {
        name: np.empty((k, size))
        for name, size in (("p", 3), ("v", 3), ("q", 4), ("w", 3), ("f", 3), ("speed", n), ("command", n))
    }
    out["voltage"], out["current"] = np.zeros(k), np.zeros(k)
    m, used, voltage, current = world.motor, 0.0, 0.0, 0.0
    if m:
        voltage = m["open"] * charge
    blend = 1 - np.exp(-STEP * 2 * np.pi * 30.0)  # the controller smooths its commands at 30 Hz
    still = np.zeros(3)
    for i in range(k):
        q = data.qpos[3:7].copy()
        rot = np.array(
            [
                [1 - 2 * (q[2] ** 2 + q[3] ** 2), 2 * (q[1] * q[2] - q[0] * q[3]), 2 * (q[1] * q[3] + q[0] * q[2])],
                [2 * (q[1] * q[2] + q[0] * q[3]), 1 - 2 * (q[1] ** 2 + q[3] ** 2), 2 * (q[2] * q[3] - q[0] * q[1])],
                [2 * (q[1] * q[3] - q[0] * q[2]), 2 * (q[2] * q[3] + q[0] * q[1]), 1 - 2 * (q[1] ** 2 + q[2] ** 2)],
            ]
        )
        p, v, rates = data.qpos[:3].copy(), data.qvel[:3].copy(), data.qvel[3:6].copy()
        wanted = steer(
            p, v, rot, rates + noise[i], reference[i], memory, gains, quad.mass, quad.inertia, inverse, quad.top,
            quad.hover,
        )  # fmt: skip
        smooth += blend * (wanted - smooth)
        if m:
            # the speed controller's feed-forward is right at the nominal voltage
            duty = (m["k"] * smooth + m["r"] * quad.torque * smooth**2 / m["k"]) / m["nominal"]
            slope, amps = machine(speed, np.clip(duty, 0, 1), voltage, m, quad.torque)
            current = float(np.sum(np.clip(duty, 0, 1) * np.maximum(amps, 0.0)))
            used += current * STEP
            # open voltage falls with the charge used; a resistance and a slow branch (Thevenin) in series
            goal = m["open"] * (charge - 0.16 * used / m["capacity"]) - m["internal"] * current
            voltage += (goal - voltage) * min(1.0, STEP / 0.05)
        elif world.lag > 0:
            slope = (smooth - speed) / world.lag
        else:
            slope = (smooth - speed) / STEP
            speed = smooth.copy()
        thrust = quad.thrust * world.thrust_gain * speed**2
        if world.ground:
            heights = -(p[2] + (quad.hubs @ rot.T)[:, 2])
            thrust = thrust * cushion(heights, quad.radius, 1.41421356 * quad.arm)
        spun = share * quad.spin * quad.thrust * world.torque_gain * speed**2
        data.ctrl[0::2] = thrust
        data.ctrl[1::2] = spun
        wind = still if world.wind is None else world.wind[i]
        force, moment = airload(
            rot, v, rates, wind, speed, thrust, quad.hubs, world.drag_speed, world.drag_thrust, world.area
        )
        if world.rotor_inertia:
            # a counter-clockwise rotor seen from above turns about −z of the body
            total = -world.rotor_inertia * quad.spin @ speed
            moment = moment - np.cross(rates, np.array([0.0, 0.0, total]))
            moment[2] += world.rotor_inertia * quad.spin @ slope
        pushed = rot @ force
        data.xfrc_applied[body, :3] = pushed
        data.xfrc_applied[body, 3:] = rot @ (moment - np.cross(world.centre, force))
        for b in loads if world.load_drag and i else ():
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, b, scratch := np.zeros(6), 0)
            gone = scratch[3:] - wind
            data.xfrc_applied[b, :3] = -0.5 * RHO * world.load_drag * np.linalg.norm(gone) * gone
        mujoco.mj_step(model, data)
        out["p"][i], out["v"][i], out["q"][i], out["w"][i] = p, v, q, rates
        out["f"][i] = data.sensordata[:3]
        out["speed"][i], out["command"][i] = speed, smooth
        out["voltage"][i], out["current"][i] = voltage, current
        if m or world.lag > 0:
            speed = np.clip(speed + STEP * slope, 0.0, 1.2 * quad.top)
        if (
            data.warning[mujoco.mjtWarning.mjWARN_BADQVEL].number
            or data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number
        ):
            raise Lost(f"a hung body whipped about at {i * STEP:.1f} s")
        if i % 200 == 0 and not (np.abs(p - reference[i, :3]).max() < 12.0):
            raise Lost(f"strayed at {i * STEP:.1f} s")
    # Slow rotors of much inertia that follow their commands at once: the reaction of one step is the controller's next.
    if np.abs(np.diff(out["w"][:, 2], 2)).max() > SWINGING:
        raise Lost("yaw swings from step to step")
    return out
