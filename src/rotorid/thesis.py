"""Numbers that the thesis prints in chapter 4 and appendix A.1, for comparison only: nothing is computed with them."""

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
