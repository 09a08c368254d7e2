"""How a slung payload hung in a run, from what it leaves of the sideways force."""

import numpy as np
import pytest

from rotorid.effects.pendulum import cable_pull, swing
from rotorid.mismatch.analyse import analyse
from rotorid.mismatch.flight.swinging import (
    Cable,
    HangingStretch,
    fitted_piece,
    largest_pieces,
    likely_cable,
    moved,
    share_left,
    swing_in,
)
from tests.unit.mismatch.flights import recorded

G, LENGTH_M, RATIO, MASS_KG = 9.81, 0.6, 0.01, 0.2
CABLE = Cable(LENGTH_M, RATIO, G)
DOWN = np.array([0.0, 0, 1, 0, 0, 0])


def shaken(seed: int, seconds: float = 30.0):
    """What hangs a payload (n, 3), m/s2, world axes, and its instants: a vehicle that is thrown about."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(int(seconds * 200)) / 200.0
    hanging = np.tile([0.0, 0.0, G], (len(time_s), 1))
    phases = rng.uniform(0, 2 * np.pi, (2, 4))
    for axis in (0, 1):
        for k, phase in enumerate(phases[axis]):
            hanging[:, axis] += 2.0 * np.sin(2 * np.pi * (0.2 + 0.23 * k) * time_s + phase)
    return hanging, time_s


def sideways(hanging, time_s, start, noise_n: float, seed: int):
    """Sideways force at 10 Hz of a load that set out from `start`, with noise."""
    pull = MASS_KG * cable_pull(hanging, time_s, LENGTH_M, RATIO, G, np.array([[0.0, *start]]))[:, :2]
    at_s = time_s[10::20]
    force = np.stack([np.interp(at_s, time_s, column) for column in pull.T], axis=1)
    return at_s, force + noise_n * np.random.default_rng(seed).standard_normal(force.shape)


def test_the_states_of_a_load_that_swings_far_are_read_piece_by_piece():
    hanging, time_s = shaken(1)
    at_s, force = sideways(hanging, time_s, moved(DOWN, [0.7, -0.4, 0.5, 0.3], 4.0), 0.05, 2)
    stretch = HangingStretch(hanging, time_s, at_s, force)
    assert np.median(swing_in(stretch, CABLE, None).masses_kg) == pytest.approx(MASS_KG, rel=0.03)
    found = swing_in(stretch, CABLE, MASS_KG)
    assert found.states.shape == (5, 7) and found.left_n2 == pytest.approx(0.05**2 * force.size, rel=0.2)
    whole = MASS_KG * cable_pull(hanging, time_s, LENGTH_M, RATIO, G, found.states)[9::20, :2][: len(force)]
    from_rest = MASS_KG * cable_pull(hanging, time_s, LENGTH_M, RATIO, G)[9::20, :2][: len(force)]
    assert ((force - whole) ** 2).sum() < 0.1 * ((force - from_rest) ** 2).sum()


def test_noise_swings_not():
    hanging, time_s = shaken(3)
    at_s = time_s[10::20]
    force = 0.2 * np.random.default_rng(4).standard_normal((len(at_s), 2))
    stretch = HangingStretch(hanging, time_s, at_s, force)
    assert len(largest_pieces([stretch], CABLE)) == 3
    assert share_left([stretch], CABLE) > 0.7 and likely_cable(CABLE, [stretch]) is None
    assert share_left([], CABLE) == 1.0


def test_a_piece_that_no_state_explains_is_halved():
    """The load is pushed in the middle of a piece: two states explain what one cannot."""
    hanging, time_s = shaken(6, 5.0)
    half = len(time_s) // 2
    first, second = (moved(DOWN, np.array(m), 4.0) for m in ([0.2, 0, 0, 0], [-0.9, 0.7, 1, 1]))
    states = np.array([[0.0, *first], [time_s[half], *second]])
    pull = MASS_KG * cable_pull(hanging, time_s, LENGTH_M, RATIO, G, states)[:, :2]
    at_s = time_s[10::20]
    force = np.stack([np.interp(at_s, time_s, column) for column in pull.T], axis=1)
    stretch = HangingStretch(hanging, time_s, at_s, force)
    _, _, left_by_one_n2 = fitted_piece(stretch, CABLE, first, MASS_KG)
    found = swing_in(stretch, CABLE, MASS_KG)
    assert left_by_one_n2 > 0.1 * stretch.squares
    assert len(found.states) > 1 and found.left_n2 < 0.25 * left_by_one_n2


def test_a_piece_goes_on_where_the_one_before_ends():
    hanging, time_s = shaken(5, 4.0)
    start = moved(DOWN, [0.3, 0.2, 0.1, -0.2], 4.0)
    middle = HangingStretch(hanging[:401], time_s[:401], time_s[:0], np.zeros((0, 2))).end(CABLE, start)
    whole, _ = swing(hanging, time_s, LENGTH_M, RATIO, G, np.array([[0.0, *start]]))
    rest, _ = swing(hanging[400:], time_s[400:], LENGTH_M, RATIO, G, np.array([[time_s[400], *middle]]))
    assert np.abs(rest - whole[400:]).max() < 0.02


def test_a_long_cable_is_read_for_two_swings():
    assert Cable(0.3, RATIO, G).piece_s == 5.0
    assert Cable(6.0, RATIO, G).piece_s == pytest.approx(2 * 4.914, rel=0.001)


@pytest.mark.slow
def test_a_load_on_a_cable_is_told_with_its_mass_and_length():
    """80 g on 0.6 m below a vehicle of 652 g that is thrown about, out to the side when the recording begins."""
    found = analyse(recorded(1, 2, 3, flight={"load": (0.08, 0.6), "excitation": 1.5}))
    (payload,) = [f for f in found.findings if f.id == "payload" and f.status == "established"]
    numbers = {p.symbol: p for p in payload.parameters}
    assert payload.form.swings
    left, before = (sum(float(np.nansum(getattr(x, s) ** 2)) for x in found.traces) for s in ("after", "before"))
    assert left < 0.01 * before
    for symbol, truth in (("m_p", 0.08), ("L", 0.6)):
        assert numbers[symbol].low < truth < numbers[symbol].high
        assert numbers[symbol].value == pytest.approx(truth, rel=0.02)


def test_a_piece_that_begins_with_one_force_at_its_first_instant_says_nothing_of_the_rate():
    hanging, time_s = shaken(7, 5.0)
    at_s = np.r_[time_s[0], time_s[time_s > time_s[0] + 2.0][::20]]
    force = 0.2 * np.random.default_rng(4).standard_normal((len(at_s), 2))
    stretch = HangingStretch(hanging, time_s, at_s, force)
    assert np.isfinite(fitted_piece(stretch, CABLE, moved(DOWN, np.zeros(4), 4.0), MASS_KG)[2])
