"""Slow changes that no column follows: reported where no sensor can have made them, measured rotor speeds or not."""

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from rotorid.mismatch.flight.fitted import turning
from rotorid.mismatch.flight.leftover import slow_excess
from rotorid.mismatch.flight.prepare import prepare
from rotorid.mismatch.flight.wrench import wrench_model
from rotorid.recordings.columns import QUATERNION, VELOCITY
from tests.unit.mismatch.flights import as_commands, quad, recorded, with_table

RATE_HZ = 200.0


def found(commanded: bool, slosh_m_s2: float, moves: bool = True) -> dict:
    """Slow changes of two flights pushed forward to and fro at 0.5 to 1.2 Hz, or whose accelerometer says so."""
    recordings, rng = recorded(1, 2, rate_hz=RATE_HZ), np.random.default_rng(5)
    band = butter(2, (0.5, 1.2), "bandpass", fs=RATE_HZ, output="sos")

    def pushed(table):
        slosh = sosfiltfilt(band, rng.standard_normal(len(table)))
        slosh *= slosh_m_s2 / slosh.std()
        table["specific_force_x_m_s2"] += slosh
        if moves:
            forward = Rotation.from_quat(table[list(QUATERNION)], scalar_first=True).apply([1.0, 0.0, 0.0])
            table[list(VELOCITY)] += np.cumsum(forward * slosh[:, None], axis=0) / RATE_HZ
        return as_commands(table) if commanded else table

    prepared = prepare(with_table(recordings, pushed))
    segments, noisy = turning(prepared)
    model = wrench_model(prepared, prepared.terms, segments=segments, noisy_segments=noisy)
    full = model.full_fit()
    added = model.contributions.of(full.columns, full.beta)
    return slow_excess(prepared, model, segments, noisy, added)


@pytest.mark.slow
@pytest.mark.parametrize("commanded", [True, False])
def test_a_tank_that_slops_is_told_and_nothing_is_where_nothing_does(commanded):
    told = found(commanded, 0.5)
    assert list(told) == ["force_x"]
    rms_n, frequency_hz = told["force_x"]
    assert rms_n == pytest.approx(0.5 * quad().mass_kg, rel=0.3) and 0.4 < frequency_hz < 1.3
    assert found(commanded, 0.0) == {}


def test_what_the_accelerometer_alone_reads_moves_nothing():
    assert found(True, 0.5, moves=False) == {}
