"""A payload that the user did not count: fixed to the frame, or slung below."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter
from rotorid.effects.instant import Wrench
from rotorid.effects.pendulum import cable_pull, likely_lengths
from rotorid.effects.scale import scale

_SHORTEST_M, _LONGEST_M, _LONGEST_ARMS = 0.15, 6.0, 30.0
"""Cables: nobody slings a load below a vehicle by more than this many of its arms."""
_DAMPING_RATIO = 0.03


def _slung(motion, vehicle, values):
    """F = m_p (e·n + L |n'|²) n, n the cable's direction downward, e = g − a what hangs it; M = z ẑ × F.

    The hook is z below the centre of mass, moved by it alone; `values` are m_p (kg), m_p z (kg m), L (m) and ζ. Needs
    many instants in a row. How it hung before the first is not known: unless the motion says so it starts at rest along
    the mean of e with weights 1 − ω t/π (to zero), and what that misses fades with the damping. A cable does not push:
    where it would, the force is zero.
    """
    return _pull(motion, vehicle, values, 0.0)


def _pull(motion, vehicle, values, slowed):
    """Wrench in body axes of what hangs and is slowed by the acceleration `slowed` (n, 3)."""
    mass_kg, hook_kg_m, length_m, damping_ratio = values
    hanging, time_s = hanging_acceleration(motion) - slowed, motion.time_s
    swung_by = None if motion.hung_by is None else motion.hung_by - slowed
    world = cable_pull(hanging, time_s, length_m, damping_ratio, vehicle.gravity_m_s2, motion.hung, swung_by)
    pull = np.einsum("nji,nj->ni", motion.rotation, world)
    if motion.on_board is not None:
        pull *= motion.on_board[:, None]
    return Contribution(force=mass_kg * pull, moment=hook_kg_m * np.cross([0.0, 0.0, 1.0], pull))


def hanging_acceleration(motion):
    """e = g − a in world axes (n, 3), m/s2: what a payload at the centre of mass hangs by."""
    return -np.einsum("nij,nj->ni", motion.rotation, motion.specific_force)


def _slung_in_air(motion, vehicle, values):
    """As `_slung`, but slowed by the air that it moves through and not by its swing: e = g − a − 2 ζ ω v."""
    _, _, length_m, damping_ratio = values
    slowed = 2 * damping_ratio * np.sqrt(vehicle.gravity_m_s2 / length_m)
    through_air = np.einsum("nij,nj->ni", motion.rotation, motion.air_velocity)
    return _pull(motion, vehicle, values, slowed * through_air)


def _lengths_m(vehicle) -> tuple[float, float]:
    """Shortest and longest cable of a vehicle, m."""
    return _SHORTEST_M, max(4 * _SHORTEST_M, min(_LONGEST_M, _LONGEST_ARMS * scale(vehicle).arm_m))


def _slung_starts(parts, vehicle):
    """The likeliest lengths of a cable, each with its damping."""
    stretches = []
    for motion, left in parts:
        velocity = np.zeros_like(motion.specific_force) if motion.velocity is None else motion.velocity
        pulls = [left["force"]]
        if "moment" in left:
            # M = z ẑ × F: the force that the moment is of.
            pulls.append(np.cross(left["moment"], [0.0, 0.0, 1.0]))
        world = [np.einsum("nij,nj->ni", motion.rotation, x)[:, :2] for x in (velocity, *pulls)]
        stretches.append((motion.time_s, hanging_acceleration(motion), world[0], world[1:]))
    return likely_lengths(stretches, _lengths_m(vehicle), _DAMPING_RATIO, vehicle.gravity_m_s2)


def _rigid(m, v, p, w):
    """A mass m_p at r that moves with the body: F = -m_p (a + dΩ × r + Ω × (Ω × r)), M = -m_p r × a.

    a is the specific force at the believed centre of mass; `p` is m_p (kg), m_p r (kg m), and the products of inertia
    that it brings (its moments of inertia count as values), J_xy, J_xz, J_yz (kg m²).
    """
    s, a, o = m.specific_force, m.angular_acceleration, m.angular_velocity
    # Ω × m_p r, and of that Ω × once more.
    i, j, k = o[1] * p[3] - o[2] * p[2], o[2] * p[1] - o[0] * p[3], o[0] * p[2] - o[1] * p[1]
    w.force[0] -= m.on_board * (p[0] * s[0] + a[1] * p[3] - a[2] * p[2] + o[1] * k - o[2] * j)
    w.force[1] -= m.on_board * (p[0] * s[1] + a[2] * p[1] - a[0] * p[3] + o[2] * i - o[0] * k)
    w.force[2] -= m.on_board * (p[0] * s[2] + a[0] * p[2] - a[1] * p[1] + o[0] * j - o[1] * i)
    w.moment[0] -= m.on_board * (p[2] * s[2] - p[3] * s[1])
    w.moment[1] -= m.on_board * (p[3] * s[0] - p[1] * s[2])
    w.moment[2] -= m.on_board * (p[1] * s[1] - p[2] * s[0])
    if p[4] == 0.0 and p[5] == 0.0 and p[6] == 0.0:
        return
    x, y, z = p[4] * o[1] + p[5] * o[2], p[4] * o[0] + p[6] * o[2], p[5] * o[0] + p[6] * o[1]
    w.moment[0] -= m.on_board * (p[4] * a[1] + p[5] * a[2] + o[1] * z - o[2] * y)
    w.moment[1] -= m.on_board * (p[4] * a[0] + p[6] * a[2] + o[2] * x - o[0] * z)
    w.moment[2] -= m.on_board * (p[5] * a[0] + p[6] * a[1] + o[0] * y - o[1] * x)


def _without_products(values):
    """m_p, m_p r and no products of inertia."""
    return (*values, 0.0, 0.0, 0.0)


def forms(vehicle):
    size = scale(vehicle)
    mass, bound = size.mass_kg, size.inertia_kg_m2
    m_p = Parameter("m_p", "kg", 0.0, 2 * mass, meaning="mass of the payload")
    reach = mass * size.arm_m
    places = (
        Parameter("m_p x", "kg m", -reach, reach, meaning="its mass times its place forward"),
        Parameter("m_p y", "kg m", -reach, reach, meaning="its mass times its place to the right"),
        Parameter("m_p z", "kg m", -reach, reach, meaning="its mass times its place downward"),
    )
    lengths_m = _lengths_m(vehicle)
    starts = tuple(x for x in (0.3, 0.6, 1.2, 2.4) if x < lengths_m[1])
    cable = (
        m_p,
        Parameter("m_p z", "kg m", -reach, reach, meaning="its mass times how far below the centre its hook is"),
        Parameter("L", "m", *lengths_m, True, starts, "length of the cable"),
        Parameter("ζ", "1", 0.002, 0.3, True, (_DAMPING_RATIO,), "damping of its swing, share of the critical"),
    )
    products = tuple(
        Parameter(name, "kg m2", -bound, bound, meaning="product of inertia that it adds")
        for name in ("J_xy", "J_xz", "J_yz")
    )
    moments = tuple(f"inertia_{axis}_kg_m2" for axis in ("xx", "yy", "zz"))
    return (
        Form(
            "rigid with its products of inertia",
            "F = −m_p (a + dΩ/dt × r + Ω × (Ω × r)), M = −m_p r × a − (E dΩ/dt + Ω × E Ω)",
            (m_p, *places, *products),
            Wrench(_rigid),
            ("specific_force", "angular_velocity", "angular_acceleration"),
            must_show=(0,),
            comes_and_goes=True,
            brings=moments,
        ),
        Form(
            "rigid",
            "F = −m_p (a + dΩ/dt × r + Ω × (Ω × r)), M = −m_p r × a",
            (m_p, *places),
            Wrench(_rigid, _without_products),
            ("specific_force",),
            must_show=(0,),
            comes_and_goes=True,
            brings=moments,
        ),
        Form(
            "slung",
            "F = m_p (e·n + L |n'|²) n, M = z ẑ × F, n'' = (e − (e·n) n)/L − |n'|² n − 2ζω n', e = g − a",
            cable,
            _slung,
            ("specific_force", "rotation"),
            must_show=(0,),
            memory=True,
            swings=True,
            excited_by=("always",),
            guess=_slung_starts,
        ),
        Form(
            "slung, slowed by the air",
            "F = m_p (e·n + L |n'|²) n, M = z ẑ × F, n'' = (e − (e·n) n)/L − |n'|² n − 2ζω n', e = g − a − 2ζω v",
            cable,
            _slung_in_air,
            ("specific_force", "rotation", "velocity"),
            must_show=(0,),
            memory=True,
            swings=True,
            excited_by=("always",),
            guess=_slung_starts,
        ),
    )


EFFECT = Effect(
    id="payload",
    name="a payload",
    sentence="the vehicle is heavier than believed, off its centre, or carries a pendulum",
    forms=forms,
    shows_in=("share", "trim", "lift", "lift_of_throttle", "lift_without_voltage"),
    source=("rigid-body mechanics; Sreenath, Lee and Kumar, CDC 2013 (suspended load); recording contract"),
    sign="positive m_p pulls down; r is where it sits from the believed centre of mass",
    validity=(
        "rigid: a point mass, whose moments of inertia count as values. Slung: any angle, cable taut, hung at "
        "the centre of mass and at rest when the recording starts, damped in proportion to its swing or to its speed"
        " through the air"
    ),
    excited_by=("specific_force", "angular_velocity", "angular_acceleration"),
    confusers=("com_offset",),
    separating_manoeuvre="weigh the vehicle; stop sharply from forward flight and hover",
    would_change=(
        "mass_kg",
        "thrust_coefficient_n_s2",  # of these two their ratios to mass and inertia
        "torque_coefficient_n_m_s2",
        *(f"inertia_{axis}_kg_m2" for axis in ("xx", "yy", "zz")),
    ),
    like_on_heavier=("com_offset", "inertia_products"),
    cases=("multibody/rigid_payload/2026-11-30/000", "single/com_offset/moderate/0"),
)
