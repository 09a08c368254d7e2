"""A payload that the user did not count: fixed to the frame, or slung below."""

from math import exp, sqrt

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter
from rotorid.effects.scale import scale

SWING_RATE_HZ = 100.0
"""Rate of the pendulum's own steps: thirty a radian for the shortest cable allowed."""


def slung(motion, vehicle, values):
    """F = m_p (e·n + L |n'|²) n, n the cable's direction downward, e = g − a what hangs it.

    The pendulum hangs at the centre of mass; `values` are m_p (kg), L (m) and ζ. Needs many instants in a row. How it
    hung before the first is not known: it starts at rest along the mean of e over its first period, and what that
    misses fades with the damping. A cable does not push: where it would, the force is zero.
    """
    mass_kg, length_m, damping_ratio = values
    hanging = -np.einsum("nij,nj->ni", motion.rotation, motion.specific_force)
    direction, rate_square = swing(hanging, motion.time_s, length_m, damping_ratio, vehicle.gravity_m_s2)
    tension = mass_kg * np.maximum(np.einsum("ni,ni->n", hanging, direction) + length_m * rate_square, 0.0)
    return Contribution(force=np.einsum("nji,nj->ni", motion.rotation, tension[:, None] * direction))


def swing(hanging, time_s, length_m, damping_ratio, gravity_m_s2):
    """Direction (n, 3) and squared rate (n,), rad²/s², of a spherical pendulum in world axes.

    n'' = (e − (e·n) n)/L − |n'|² n − 2 ζ ω n', ω² = g/L, e = `hanging` (n, 3), m/s2, by leapfrog on blocks of
    instants, which are averaged before and interpolated between afterwards.
    """
    size = len(hanging)
    dt = float(np.median(np.diff(time_s))) if size > 1 else 1.0 / SWING_RATE_HZ
    block = max(1, min(round(1.0 / (SWING_RATE_HZ * dt)), size))
    edges = np.arange(0, size, block)
    counts = np.diff(np.append(edges, size))[:, None]
    coarse, instants = np.add.reduceat(hanging, edges) / counts, np.add.reduceat(time_s, edges) / counts[:, 0]
    omega = sqrt(gravity_m_s2 / length_m)
    period = max(1, round(2 * np.pi / omega / (block * dt)))
    states = _leapfrog(coarse, coarse[:period].mean(axis=0), block * dt, length_m, 2 * damping_ratio * omega)
    states = np.stack([np.interp(time_s, instants, column) for column in states.T], axis=1)
    direction = states[:, :3] / np.maximum(np.linalg.norm(states[:, :3], axis=1, keepdims=True), 1e-12)
    return direction, states[:, 3]


def _leapfrog(hanging, start, dt, length_m, damping):
    """Direction and squared rate of a pendulum at even instants, (n, 4), from rest along `start`."""
    # Plain numbers: a step of an array of three costs ten times as much.
    kept = exp(-damping * dt)
    pull = sqrt(kept) * dt / length_m
    length = sqrt(float(start @ start))
    x, y, z = (start / length).tolist() if length > 0 else (0.0, 0.0, 1.0)
    # Rates live half a step behind: a half step back from rest.
    u, v, w = (-0.5 * pull * (hanging[0] - (hanging[0] @ (x, y, z)) * np.array((x, y, z)))).tolist()
    before = u * u + v * v + w * w
    states = []
    for e_x, e_y, e_z in hanging.tolist():
        along = e_x * x + e_y * y + e_z * z
        u = kept * u + pull * (e_x - along * x)
        v = kept * v + pull * (e_y - along * y)
        w = kept * w + pull * (e_z - along * z)
        after = u * u + v * v + w * w
        states.append((x, y, z, 0.5 * (before + after)))
        before = after
        x, y, z = x + dt * u, y + dt * v, z + dt * w
        longer = sqrt(x * x + y * y + z * z)
        x, y, z = x / longer, y / longer, z / longer
        # The rate is carried along the sphere: it turns with the direction and keeps its size.
        u, v, w = u * longer - dt * after * x, v * longer - dt * after * y, w * longer - dt * after * z
    return np.array(states)


def rigid(motion, vehicle, values):
    """F = -m_p a, M = -(m_p r) × a: added mass m_p at (x, y) carried along; a the specific force."""
    mass_kg, moment_x, moment_y = values
    lever = np.array([moment_x, moment_y, 0.0])
    return Contribution(force=-mass_kg * motion.specific_force, moment=-np.cross(lever, motion.specific_force))


def rigid_with_inertia(motion, vehicle, values):
    """The rigid payload and the products of inertia that it brings (its moments of inertia count as values)."""
    extra = np.zeros((3, 3))
    extra[0, 1], extra[0, 2], extra[1, 2] = values[3:]
    extra += extra.T
    rate = motion.angular_velocity
    turning = motion.angular_acceleration @ extra + np.cross(rate, rate @ extra)
    carried = rigid(motion, vehicle, values[:3])
    return Contribution(force=carried.force, moment=carried.moment - turning)


def forms(vehicle):
    size = scale(vehicle)
    mass, bound = size.mass_kg, size.inertia_kg_m2
    m_p = Parameter("m_p", "kg", 0.0, 2 * mass, meaning="mass of the payload")
    places = (
        Parameter("m_p x", "kg m", -mass, mass, meaning="its mass times its place forward"),
        Parameter("m_p y", "kg m", -mass, mass, meaning="its mass times its place to the right"),
    )
    products = tuple(
        Parameter(name, "kg m2", -bound, bound, meaning="product of inertia that it adds")
        for name in ("J_xy", "J_xz", "J_yz")
    )
    return (
        Form(
            "rigid with its products of inertia",
            "F = −m_p a, M = −m_p r × a − (E dΩ/dt + Ω × E Ω)",
            (m_p, *places, *products),
            rigid_with_inertia,
            ("specific_force", "angular_velocity", "angular_acceleration"),
            must_show=(0,),
        ),
        Form("rigid", "F = −m_p a, M = −m_p r × a", (m_p, *places), rigid, ("specific_force",), must_show=(0,)),
        Form(
            "slung",
            "F = m_p (e·n + L |n'|²) n, n'' = (e − (e·n) n)/L − |n'|² n − 2ζω n', e = g − a",
            (
                m_p,
                Parameter("L", "m", 0.15, 6.0, True, (0.3, 0.6, 1.2, 2.4), "length of the cable"),
                Parameter("ζ", "1", 0.002, 0.3, True, (0.03,), "damping of its swing, share of the critical"),
            ),
            slung,
            ("specific_force", "rotation"),
            memory=True,
            excited_by=("always",),
        ),
    )


EFFECT = Effect(
    id="payload",
    name="a payload",
    sentence="the vehicle is heavier than believed, off its centre, or carries a pendulum",
    forms=forms,
    source=("rigid-body mechanics; Sreenath, Lee and Kumar, CDC 2013 (suspended load); recording contract"),
    sign="positive m_p pulls down; (x, y) is where it hangs from the believed centre of mass",
    validity=(
        "rigid: a point mass in the rotor plane, its own inertia left out. Slung: any angle, cable taut, hung at "
        "the centre of mass and at rest when the recording starts, damped in proportion to its swing alone"
    ),
    excited_by=("specific_force", "angular_velocity", "angular_acceleration"),
    confusers=("com_offset",),
    separating_manoeuvre="weigh the vehicle; stop sharply from forward flight and hover",
)
