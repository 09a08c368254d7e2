"""Windows of a force that comes and goes, and the terms made for them."""

import numpy as np
import pytest

from rotorid.effects.contract import Motion
from rotorid.effects.gust import form_named, window_form
from rotorid.mismatch.flight.gusts import gust_terms, windows
from tests.unit.mismatch.synthetic import coloured
from tests.unit.vehicle.thesis import thesis_vehicle

RATE_HZ, SIZE = 40.0, 1600
TIME = np.arange(SIZE) / RATE_HZ


def turning(rate_rad_s: float = 0.3) -> np.ndarray:
    """Attitudes of a vehicle that yaws on and on."""
    c, s = np.cos(rate_rad_s * TIME), np.sin(rate_rad_s * TIME)
    zero, one = np.zeros(SIZE), np.ones(SIZE)
    return np.stack([np.stack([c, -s, zero], 1), np.stack([s, c, zero], 1), np.stack([zero, zero, one], 1)], 1)


def force(seed: int, push_n: float = 0.0, start_s: float = 12.0, stop_s: float = 15.0) -> np.ndarray:
    """Coloured noise of 0.1 N and a push to the north between two times, body axes."""
    rng = np.random.default_rng(seed)
    world = np.stack([coloured(SIZE, 0.1, rng, pole=0.6) for _ in range(3)], axis=1)
    world[:, 0] += push_n * ((start_s <= TIME) & (stop_s >= TIME))
    return np.einsum("nji,nj->ni", turning(), world)


def test_a_gust_is_found_where_it_blows():
    ((start_s, stop_s, strength),) = windows(force(0, 1.0), turning(), TIME)
    # The smoothing of 0.6 s spreads the edges.
    assert start_s == pytest.approx(12.0, abs=0.4) and stop_s == pytest.approx(15.0, abs=0.4)
    assert strength > 6.0


def test_noise_opens_no_window():
    assert [windows(force(seed), turning(), TIME) for seed in range(30)] == [[]] * 30


def test_a_lasting_force_is_no_gust():
    assert windows(force(1, 1.0, -1.0, 99.0), turning(), TIME) == []


def test_two_gusts_are_two():
    both = force(3, 1.0, 8.0, 10.0) + force(4, 1.0, 25.0, 28.0)
    assert [round(w[0]) for w in sorted(windows(both, turning(), TIME))] == [8, 25]


def test_a_term_for_each_window_acts_in_its_run_alone():
    (made,) = gust_terms("run07", [(12.0, 15.0, 20.0)])
    assert (made.run, made.effect, made.window) == ("run07", "gust", ("run07", 12.0, 15.0))
    # A knot each 0.6 s: five to the north and five to the east.
    assert made.size == 10 and len(made.form.parameters) == 10


def test_the_form_is_a_tent_between_its_knots_in_world_axes():
    """One knot of 2 N to the east in the middle of 10 to 12 s; the nose points east, so the push comes from behind."""
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    time_s = np.array([9.9, 10.5, 11.0, 11.5, 12.1])
    motion = Motion(time_s, np.full((5, 4), 1000.0), rotation=np.tile(quarter, (5, 1, 1)))
    added = window_form(10.0, 12.0, 1).contribution(motion, thesis_vehicle(), np.array([0.0, 2.0]))
    np.testing.assert_allclose(added.force[:, 0], [0.0, 1.0, 2.0, 1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(added.force[:, 1:], 0.0, atol=1e-12)
    np.testing.assert_allclose(added.moment, 0.0, atol=1e-12)


def test_a_window_is_known_again_by_its_name():
    made = window_form(12.344, 15.6, 4)
    again = form_named(made.name)
    assert made.name == "12.34 s to 15.60 s, 4 knots" == again.name
    assert [p.symbol for p in again.parameters] == [p.symbol for p in made.parameters]
    assert form_named("at the hubs") is None
