"""Off-diagonal entries of the inertia matrix."""

from rotorid.effects.contract import Effect, Form, Parameter
from rotorid.effects.instant import Wrench
from rotorid.effects.scale import scale


def _products(m, v, p, w):
    """M = -(E dΩ + Ω × E Ω), E the symmetric matrix of J_xy, J_xz, J_yz to be added."""
    a, o = m.angular_acceleration, m.angular_velocity
    x, y, z = p[0] * o[1] + p[1] * o[2], p[0] * o[0] + p[2] * o[2], p[1] * o[0] + p[2] * o[1]
    w.moment[0] -= p[0] * a[1] + p[1] * a[2] + o[1] * z - o[2] * y
    w.moment[1] -= p[0] * a[0] + p[2] * a[2] + o[2] * x - o[0] * z
    w.moment[2] -= p[1] * a[0] + p[2] * a[1] + o[0] * y - o[1] * x


def forms(vehicle):
    bound = scale(vehicle).inertia_kg_m2
    return (
        Form(
            "products",
            "M = −(E dΩ/dt + Ω × E Ω)",
            tuple(
                Parameter(name, "kg m2", -bound, bound, meaning="entry of J to be added")
                for name in ("J_xy", "J_xz", "J_yz")
            ),
            Wrench(_products),
            ("angular_velocity", "angular_acceleration"),
        ),
    )


EFFECT = Effect(
    id="inertia_products",
    name="products of inertia",
    sentence="a moment about one axis follows the angular acceleration about another",
    forms=forms,
    source=("Euler's equations with a full inertia matrix (Goldstein, Classical Mechanics, ch. 5); catalogue F18"),
    sign="entries of J as the recording contract has them: J_xz = −∫ x z dm",
    validity="rigid body; linear in the products, the diagonal as believed",
    excited_by=("angular_velocity", "angular_acceleration"),
    confusers=("gyro_error", "rotor_gyroscopic"),
    separating_manoeuvre="excite roll, pitch and yaw one after the other by doublets",
    cases=("single/inertia_products/moderate/0", "single/rotor_gyroscopic/weak/0"),
)
