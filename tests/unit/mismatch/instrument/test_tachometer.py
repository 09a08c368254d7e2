"""Measured rotor speeds without their noise: plateaus are averaged, steps stay steps."""

import numpy as np
import pytest
from scipy.signal import lfilter

from rotorid.effects.contract import Motion
from rotorid.effects.loading import Loading
from rotorid.mismatch.instrument.analyse import analyse_instrument
from rotorid.mismatch.instrument.sampling import WIDTHS, noise_of, quieter, without_noise
from tests.unit.mismatch.instrument.stands import claimed
from tests.unit.mismatch.instrument.test_approximate import stand_set

RATE_HZ = 200.0
TIME_S = np.arange(6000) / RATE_HZ
LAG_S = 0.05


def stepping() -> np.ndarray:
    """A rotor that steps between 600 and 900 rad/s every two seconds, with a lag of 50 ms."""
    command = np.where((TIME_S // 2) % 2 == 0, 600.0, 900.0)
    share = 1 - np.exp(-1 / RATE_HZ / LAG_S)
    return lfilter([share], [1, share - 1], command, zi=[(1 - share) * 600.0])[0]


def read(noise: np.ndarray) -> np.ndarray:
    return without_noise((stepping() + noise)[:, None], RATE_HZ)[:, 0]


def test_noise_of_a_half_percent_is_taken_out_and_steps_stay():
    """On a plateau the longest windows leave a tenth to a third of the noise; at a step the readings stay."""
    true = stepping()
    noise = 0.005 * true * np.random.default_rng(0).standard_normal(TIME_S.size)
    left = read(noise) - true
    settled, stepped = TIME_S % 2 > 1, TIME_S % 2 < 0.05
    assert np.std(left[settled]) < 0.4 * np.std(noise[settled])
    assert np.abs(left[stepped]).max() < 4 * np.std(noise)
    assert np.mean(left) == pytest.approx(0.0, abs=0.1)


def test_speeds_without_noise_stay_as_they_are():
    np.testing.assert_allclose(read(np.zeros(TIME_S.size)), stepping(), atol=1e-6)


def test_a_speed_that_moves_quickly_is_no_noise():
    """A vibration at 60 Hz of a smooth speed: the upper end of the spectrum is not white."""
    vibration = 20.0 * np.sin(2 * np.pi * 60.0 * TIME_S)
    np.testing.assert_array_equal(read(vibration), stepping() + vibration)


def test_a_short_stretch_stays_as_it_is():
    short = np.random.default_rng(1).standard_normal((2 * WIDTHS[-1] - 1, 2))
    assert without_noise(short, RATE_HZ) is short


def loading(load: np.ndarray) -> Loading:
    """A stretch with this load along z, N, and a reading of 6 times the steps' thrust with noise of 0.1 N."""
    noise = 0.1 * np.random.default_rng(3).standard_normal(TIME_S.size)
    whole, reading = np.full((TIME_S.size, 6), np.nan), np.full((TIME_S.size, 6), np.nan)
    whole[:, 2], reading[:, 2] = load, 6e-6 * stepping() ** 2 + noise
    motion = Motion(time_s=TIME_S, rotor_speed=None)
    return Loading("run", TIME_S, TIME_S, whole, reading, np.zeros(6), motion)


def test_the_reading_tells_noise_of_the_counter_from_unrest_of_the_rotor():
    """Loads with 0.3 N of noise that the reading does not show, against the true ones: and the other way round."""
    true = 6e-6 * stepping() ** 2
    noisy, clean = (loading(true + size * np.random.default_rng(4).standard_normal(true.size)) for size in (0.3, 0.0))
    assert quieter([noisy], [clean]) == [clean]
    assert quieter([clean], [noisy]) == [clean]
    assert quieter([clean], [clean]) == [clean]


def test_the_size_of_a_counters_noise():
    noise = 3.0 * np.random.default_rng(4).standard_normal(TIME_S.size)
    found = noise_of((stepping() + noise)[:, None], RATE_HZ)[:, 0]
    assert np.median(found) == pytest.approx(3.0, rel=0.1)
    vibration = 20.0 * np.sin(2 * np.pi * 60.0 * TIME_S)
    assert not noise_of((stepping() + vibration)[:, None], RATE_HZ).any()


@pytest.mark.parametrize("share", [0.005, 0.01])
def test_noise_of_counters_is_no_effect_and_no_wrong_value(share):
    """Four rotors whose counters read 0.5 or 1 % of noise: as it was read the load would be filtered, late or wrong."""

    def counted(speed, wrench, t):
        speed *= 1.0 + share * np.random.default_rng(len(t)).standard_normal(speed.shape)
        return wrench

    analysis = analyse_instrument(stand_set(counted))
    assert not claimed(analysis) and not analysis.values
