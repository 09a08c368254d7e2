"""The test that a residual does not depend on the inputs: right under coloured noise, and it sees what is there."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import kstest

from rotorid.mismatch.decide.dependence import wald, with_products
from rotorid.mismatch.evidence.regression import autoregression
from rotorid.mismatch.evidence.rows import Thinner
from rotorid.mismatch.flight.leftover import kept_by_values, left_by, most_noise, probes
from tests.unit.mismatch.evidence.test_rows import one, still, thesis_vehicle
from tests.unit.mismatch.synthetic import coloured

RATE_HZ = 40.0


def p_of(noise: np.ndarray, inputs: np.ndarray) -> float:
    half = len(noise) // 2
    taps = autoregression([noise[:half], noise[half:]])
    return wald([noise[:half], noise[half:]], [inputs[:half], inputs[half:]], taps, RATE_HZ)[0]


@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_p_values_are_uniform_when_a_coloured_residual_is_independent_of_coloured_inputs(pole):
    """200 recordings of a minute; whiteness alone would call each of the coloured ones a mismatch."""
    rng = np.random.default_rng(0)
    values = []
    for _ in range(200):
        inputs = np.stack([coloured(2400, 1.0, rng, pole=0.95) for _ in range(4)], axis=1)
        values.append(p_of(coloured(2400, 1.0, rng, pole=pole), inputs))
    values = np.array(values)
    assert kstest(values, "uniform", alternative="greater").pvalue > 0.01
    assert np.mean(values < 0.05) <= 0.09 and values.min() > 1e-4
    # Nor is the test dead: half of the p-values lie below a half, about.
    assert 0.25 < np.mean(values < 0.5) < 0.65


def test_a_dependence_of_a_third_of_the_noise_is_seen():
    rng = np.random.default_rng(1)
    inputs = np.stack([coloured(2400, 1.0, rng, pole=0.95) for _ in range(4)], axis=1)
    assert p_of(coloured(2400, 1.0, rng, pole=0.6) + 0.35 * inputs[:, 2], inputs) < 1e-5


def read_by_noisy_tachometers(slope: float, pole: float, seed: int):
    """A residual that hangs on a reading by `slope`; the reading's noise is in both. And one more draw of the noise."""
    rng = np.random.default_rng(seed)
    moved, noise, again = (coloured(4800, size, rng, pole=p) for size, p in ((1.0, 0.9), (1.0, pole), (0.4, 0.0)))
    residual = slope * moved - 0.5 * noise + coloured(4800, 1.0, rng, pole=0.0)
    inputs, taps = (moved + noise)[:, None], autoregression([residual])
    return [residual], [inputs], taps, [(-0.5 * again, again[:, None])]


def test_the_noise_that_residual_and_input_share_is_no_dependence():
    """The noise is six times as strong as its white part (0.4² of 1²) says; where it may be, nothing is called."""
    residual, inputs, taps, shared = read_by_noisy_tachometers(0.0, pole=0.8, seed=3)
    assert wald(residual, inputs, taps, RATE_HZ)[0] < 1e-9
    assert wald(residual, inputs, taps, RATE_HZ, shared)[0] < 1e-5
    assert wald(residual, inputs, taps, RATE_HZ, shared, most=20.0)[0] > 0.01


def test_a_dependence_beyond_what_shared_noise_makes_is_still_seen():
    """The other sign, and the same sign with noise that cannot be as strong as that."""
    residual, inputs, taps, shared = read_by_noisy_tachometers(1.2, pole=0.8, seed=4)
    assert wald(residual, inputs, taps, RATE_HZ, shared, most=20.0)[0] < 1e-6
    residual, inputs, taps, shared = read_by_noisy_tachometers(-0.8, pole=0.8, seed=5)
    assert wald(residual, inputs, taps, RATE_HZ, shared, most=2.0)[0] < 1e-6


def test_noise_has_no_more_energy_than_the_combination_of_rotors_that_moves_least():
    """All four rotors move together by 9 rad/s and each by itself by 3; the noise added is 1: nine times at most."""
    rng = np.random.default_rng(6)
    speed = 1000 + 9 * rng.standard_normal((8000, 1)) + 3 * rng.standard_normal((8000, 4))
    noisy = speed + rng.standard_normal((8000, 4))
    prepared = SimpleNamespace(thinner=lambda x: x)
    segments = [[SimpleNamespace(motion=SimpleNamespace(rotor_speed=x))] for x in (speed, noisy)]
    assert most_noise(prepared, *segments) == pytest.approx(9.0, rel=0.05)
    assert most_noise(prepared, segments[0], []) == 1.0


def test_too_few_blocks_say_nothing():
    rng = np.random.default_rng(2)
    assert p_of(rng.standard_normal(200), rng.standard_normal((200, 4))) == 1.0


def test_the_inputs_are_those_the_recording_has():
    vehicle = thesis_vehicle(rotor_radius_m=0.1)
    recordings = SimpleNamespace(runs=[SimpleNamespace(name="run", time_s=np.array([-2.0, 0.0]))])
    prepared = SimpleNamespace(vehicle=vehicle, thinner=Thinner(100.0, 10.0), recordings=recordings)
    velocity = np.tile([3.0, -4.0, 1.0], (400, 1))
    found = probes(one(still(400, velocity=velocity, height=np.full(400, 0.3))), prepared)
    by_hand = {
        "velocity_y": -4.0, "velocity_y_abs": -16.0, "airspeed_squared": 25.0, "north": 1.0, "rotor_speed": 1000.0,
        "thrust": 1e6, "height": 1 / (1 + 9.0),
    }  # fmt: skip
    for name, value in by_hand.items():
        np.testing.assert_allclose(found[name], value, rtol=1e-9, err_msg=name)
    bare = probes(one(still(400, velocity=None, rotation=None, angular_velocity=None)), prepared)
    assert set(bare) == {"rotor_speed", "thrust", "time_s"}
    # Of the run, whose log began two seconds before the stretch.
    thinned = prepared.thinner.times(np.arange(400) / 100.0)
    np.testing.assert_allclose(found["time_s"], 2.0 + thinned, atol=1e-9)


def test_products_of_inputs():
    np.testing.assert_array_equal(with_products(np.array([[2.0, 3.0]])), [[2, 3, 4, 6, 9]])


def test_what_free_values_explain_and_no_wrong_value_tells_is_left_over():
    """A residual of 5 where the fit with every value free leaves 2, noise of 1: 3 are kept; of 2.5, nothing."""
    assert kept_by_values(5.0, 2.0, 1.0) == 3.0
    assert kept_by_values(2.5, 2.0, 1.0) == 0.0
    assert kept_by_values(4.9, 2.0, 1.0, least=3.0) == 0.0 and kept_by_values(5.1, 2.0, 1.0, least=3.0) > 3.0


def test_a_fit_that_leaves_more_than_there_was_is_not_believed():
    """y = (1, 2): less (1, 1) there remain (0, 1); less (5, 5), (-4, -3), which is more than y."""
    rows = [SimpleNamespace(y=np.array([[1.0], [2.0]]))]
    np.testing.assert_allclose(left_by(rows, 0, [np.ones((2, 1))])[0], [0.0, 1.0])
    np.testing.assert_allclose(left_by(rows, 0, [np.full((2, 1), 5.0)])[0], [1.0, 2.0])
