"""What the thesis prints, checked against itself."""

import pytest

from rotorid_lab import grey_box


@pytest.mark.parametrize(
    ("key", "by_hand"), [("thrust_coefficient_n_s2", 1.3857e-6), ("torque_coefficient_n_m_s2", 1.8534e-8)]
)
def test_the_printed_weights_give_table_4_3(key: str, by_hand: float) -> None:
    coefficient, rounding = grey_box.ROTOR_NETWORKS[key]
    assert coefficient == pytest.approx(by_hand, rel=5e-5)
    assert abs(coefficient - grey_box.GREY_BOX[key]) < rounding
    # The digits that are missing leave no room for table 4.1: the network did not end where least squares does.
    assert abs(coefficient - grey_box.WHITE_BOX[key]) > rounding


def test_the_rounding_is_the_sum_of_half_a_last_digit_of_each_number() -> None:
    coefficient, rounding = grey_box.printed_coefficient(1.0, 2.0, (1.0,), (3.0,), k_x_digit=0.0, k_d_digit=0.2)
    assert coefficient == 1.5
    assert rounding == pytest.approx(1.5 * (0.5e-4 * 4 / 3 + 0.1 / 2))
