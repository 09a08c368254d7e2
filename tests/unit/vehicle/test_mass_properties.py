import numpy as np
import pytest

from rotorid_lab.inertias import COLUMNS, compose, own_inertia, read_components


def write(path, *rows):
    path.write_text(",".join(COLUMNS) + "\n" + "\n".join(rows) + "\n")
    return path


def test_two_points_by_hand(tmp_path):
    """1 kg at x = 0 and 1 kg at x = 2: centre at 1, J_yy = J_zz = 2 kg m2."""
    table = read_components(write(tmp_path / "c.csv", "a,1,1,point,0,0,0,0,0,0", "b,1,1,point,0,0,0,2,0,0"))
    mass_kg, centre_m, inertia = compose(table)
    assert mass_kg == 2
    np.testing.assert_allclose(centre_m, [1, 0, 0])
    np.testing.assert_allclose(inertia, np.diag([0, 2, 2]))


def test_box_and_cylinder_by_hand():
    np.testing.assert_allclose(np.diag(own_inertia("box", 12.0, np.array([1.0, 2, 3]))), [13, 10, 5])
    # Radius 1, height 2, 12 kg: across 12 (3 + 4) / 12 = 7, about its axis 6.
    np.testing.assert_allclose(np.diag(own_inertia("cylinder", 12.0, np.array([2.0, 2, 2]))), [7, 7, 6])


def test_four_corners_are_symmetric(tmp_path):
    table = read_components(write(tmp_path / "c.csv", "arm,4,0.1,box,0.2,0.01,0.01,0.1,0.1,0"))
    _, _, inertia = compose(table)
    np.testing.assert_allclose(inertia - np.diag(np.diag(inertia)), 0, atol=1e-18)
    assert inertia[0, 0] == pytest.approx(inertia[1, 1])
    # About z: own 0.1 (0.04 + 0.0001) / 12 and 0.1 * 0.02, four times.
    assert inertia[2, 2] == pytest.approx(4 * (0.1 * 0.0401 / 12 + 0.1 * 0.02))


@pytest.mark.parametrize(
    "row, message",
    [
        ("a,1,1,ball,0,0,0,0,0,0", "line 2: shape 'ball'"),
        ("a,3,1,box,1,1,1,0,0,0", "line 2: count 3"),
        ("a,1,-1,box,1,1,1,0,0,0", "line 2: mass must be positive"),
    ],
)
def test_bad_lines_are_named(tmp_path, row, message):
    with pytest.raises(ValueError, match=message):
        read_components(write(tmp_path / "c.csv", row))
