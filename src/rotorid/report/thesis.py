"""Numbers that the thesis prints in chapter 4 and appendix A.1, for comparison: no result of ours rests on them."""

from dataclasses import dataclass

WHITE_BOX = {
    "mass_kg": 0.652,
    "thrust_coefficient_n_s2": 1.3877e-6,
    "torque_coefficient_n_m_s2": 1.8558e-8,
    "inertia_xx_kg_m2": 2.4890e-3,
    "inertia_yy_kg_m2": 2.5743e-3,
    "inertia_zz_kg_m2": 4.6838e-3,
}
"""Table 4.1."""
GREY_BOX = {
    "thrust_coefficient_n_s2": 1.3859e-6,
    "torque_coefficient_n_m_s2": 1.8534e-8,
    "inertia_xx_kg_m2": 2.4903e-3,
    "inertia_yy_kg_m2": 2.5756e-3,
    "inertia_zz_kg_m2": 4.5862e-3,
}
"""Table 4.3."""
INERTIAL_WEIGHTS = (-1.7592, 0.0076, 4.0810, 401.5602, 388.2557, 218.0455)
"""Appendix A.1.3: w11, w22, w33, w14, w25, w36."""


@dataclass(frozen=True)
class PrintedNetwork:
    """A rotor network of appendix A.1: scaling factors and weights as printed, and the last digit of each."""

    k_x: float
    """s/rad."""
    k_d: float
    """1/N or 1/(N m)."""
    w1: tuple[float, ...]
    w2: tuple[float, ...]
    k_x_digit: float
    k_d_digit: float = 1e-4
    weight_digit: float = 1e-4

    @property
    def coefficient(self) -> float:
        """Eq. 4.73: thrust in N s² or torque in N m s² over squared speed."""
        return self._product * self.k_x**2 / self.k_d

    @property
    def rounding(self) -> float:
        """By how much the digits that are not printed may change the coefficient, in its unit."""
        weights = self.weight_digit / 2 * sum(abs(weight) for weight in (*self.w1, *self.w2))
        relative = weights / abs(self._product) + self.k_x_digit / self.k_x + self.k_d_digit / 2 / self.k_d
        return abs(self.coefficient) * relative

    @property
    def _product(self) -> float:
        return sum(first * second for first, second in zip(self.w1, self.w2, strict=True))


ROTOR_NETWORKS = {
    "thrust_coefficient_n_s2": PrintedNetwork(
        k_x=5.4669e-4,
        k_d=0.2133,
        w1=(-0.5311, 0.1014, -1.0462, -0.1708),
        w2=(-0.4342, -0.6602, -0.7606, -0.1731),
        k_x_digit=1e-8,
    ),
    "torque_coefficient_n_m_s2": PrintedNetwork(
        k_x=6.3486e-4,
        k_d=20.8333,
        w1=(-0.4279, 1.0063, -0.8083, -0.4139),
        w2=(-0.3693, 0.5336, -0.0600, -0.5183),
        k_x_digit=1e-8,
    ),
}
"""Appendix A.1.1 and A.1.2."""
