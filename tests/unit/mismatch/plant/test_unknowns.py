"""Empirical terms: which flights could tell them from effects with a name."""

import numpy as np
from scipy.spatial.transform import Rotation

from rotorid.mismatch.plant.unknowns import can_show


def flown(spread_rad: float) -> np.ndarray:
    headings = spread_rad * np.random.default_rng(0).standard_normal(4000)
    return Rotation.from_euler("ZYX", np.stack([headings, 0.1 + 0 * headings, 0 * headings], axis=1)).as_matrix()


def test_a_moment_fixed_in_the_world_shows_on_a_vehicle_that_turns():
    assert can_show("unknown_heading", [flown(0.5)])
    assert not can_show("unknown_heading", [flown(0.1)])
    # Two flights that each keep their heading, one north and one east, tell it too.
    east = Rotation.from_euler("z", np.pi / 2).as_matrix() @ flown(0.1)
    assert can_show("unknown_heading", [flown(0.1), east])


def test_other_empirical_terms_and_unknown_attitudes_are_not_concerned():
    assert can_show("unknown_place", [flown(0.0)])
    assert can_show("unknown_heading", [None])
