"""A payload that the user did not count: fixed to the frame, or slung below."""

import numpy as np
from scipy.signal import cont2discrete, lfilter

from rotorid.effects.contract import Contribution, Effect, Form, Parameter
from rotorid.effects.scale import scale


def slung(motion, vehicle, values):
    """F = m_p g θ in world axes, θ'' + 2 ζ ω θ' + ω² θ = -a_h / L, ω² = g/L (small angles), ζ = 0.05.

    The pendulum hangs at the centre of mass; `values` are m_p (kg) and L (m). Needs many instants in a row.
    """
    mass_kg, length_m = values
    gravity = vehicle.gravity_m_s2
    omega = np.sqrt(gravity / length_m)
    force_body = motion.specific_force
    world = np.einsum("nij,nj->ni", motion.rotation, force_body)
    horizontal = world[:, :2]
    dt = float(np.median(np.diff(motion.time_s))) if motion.size > 1 else 0.01
    system = ([-1.0 / length_m], [1.0, 2 * 0.05 * omega, omega**2])
    numerator, denominator, _ = cont2discrete(system, dt, method="bilinear")
    angle = lfilter(numerator.ravel(), denominator, horizontal, axis=0)
    # The cable pulls along its direction: sideways by the angle, down by the payload's weight.
    pull = np.zeros_like(world)
    pull[:, :2] = mass_kg * gravity * angle
    pull[:, 2] = mass_kg * gravity
    return Contribution(force=np.einsum("nji,nj->ni", motion.rotation, pull))


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
            "F = m_p g θ, θ'' + 2ζωθ' + ω²θ = −a_h/L",
            (m_p, Parameter("L", "m", 0.15, 6.0, True, (0.3, 0.6, 1.2, 2.4), "length of the cable")),
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
        "rigid: a point mass in the rotor plane, its own inertia left out. Slung: small angles (below "
        "about 0.3 rad), cable taut, hung at the centre of mass"
    ),
    excited_by=("specific_force", "angular_velocity", "angular_acceleration"),
    confusers=("com_offset",),
    separating_manoeuvre="weigh the vehicle; stop sharply from forward flight and hover",
)
