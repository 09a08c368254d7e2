"""Loads put on by hand: what happens in the moments after a step is not the instrument's."""

import numpy as np
import pytest

from rotorid.mismatch.instrument.analyse import analyse_instrument
from rotorid.mismatch.instrument.setup import set_up
from rotorid.recordings import RecordingSet
from tests.unit.mismatch.instrument.stands import BENCH, bench_run, claimed

RATE_HZ, STEP_S = 50.0, 4.0
LEVELS_N = np.concatenate([np.arange(6.0), np.arange(4.0, -1.0, -1.0)])


def bench(seed: int, latest_s: float, lag_s: float = 0.0) -> RecordingSet:
    """Three runs of steps along one axis each: every load comes on evenly within up to `latest_s` of its step."""
    rng, runs = np.random.default_rng(seed), []
    load = np.repeat(LEVELS_N, int(STEP_S * RATE_HZ))
    time_s = np.arange(len(load)) / RATE_HZ
    for axis in range(3):
        real = load.copy()
        for k in range(1, len(LEVELS_N)):
            after_s = time_s - k * STEP_S
            part = 1.0 - after_s / rng.uniform(0.1, 1.0) / latest_s if latest_s else np.zeros(len(load))
            part = np.exp(-after_s / lag_s) if lag_s else part
            real -= (LEVELS_N[k] - LEVELS_N[k - 1]) * np.where(after_s >= 0, np.clip(part, 0.0, 1.0), 0.0)
        along = np.eye(3)[axis]
        reading = real[:, None] * along + 0.01 * rng.standard_normal((3, len(load))).T
        runs.append(bench_run(f"along {axis}", time_s, load[:, None] * along, reading))
    return RecordingSet("b", BENCH, tuple(runs))


@pytest.mark.parametrize("seed", range(2))
def test_a_hand_that_lets_go_slowly_is_no_filter(seed: int) -> None:
    """Every load comes on within a tenth to six tenths of a second, each time anew."""
    recordings = bench(seed, latest_s=0.6)
    assert set_up(recordings).settling_s > 0.5 and claimed(analyse_instrument(recordings)) == set()


def test_a_lag_of_the_instrument_repeats_itself_and_is_found() -> None:
    recordings = bench(0, latest_s=0.0, lag_s=0.1)
    assert set_up(recordings).settling_s == 0.0
    assert claimed(analyse_instrument(recordings)) == {"amplifier_filter"}
