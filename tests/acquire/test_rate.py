"""Recording at 1 kHz: nothing lost, less than a tenth of a core."""

import time

import numpy as np
import pytest

from rotorid_acquire import procedures
from rotorid_acquire.io.logs import read_log


def record_at_1_khz(recorder, seconds: int) -> float:
    """Recorder's own CPU time (of this thread) per second of device time."""
    begin = time.thread_time()
    with recorder:
        procedures.stream(recorder, 1000 * seconds, 0.001)
    return (time.thread_time() - begin) / seconds


@pytest.mark.parametrize("seconds", [20, pytest.param(600, marks=pytest.mark.slow)])
def test_1_khz_loses_nothing_and_costs_less_than_a_tenth_of_a_core(plugged, recorder_on, seconds):
    ports = plugged("bench")
    recorder = recorder_on("bench", ports.names[0])
    share = record_at_1_khz(recorder, seconds)
    log = read_log(recorder.log_path)
    assert log.complete and len(log.table) == log.end.sent >= 1000 * seconds
    assert (log.table.quality == 0).all() and ports.overruns == 0
    np.testing.assert_allclose(np.diff(log.table.time_s), 0.001, atol=2e-6)
    assert share < 0.10
    print(f"\n1 kHz, {seconds} s of device time: {share:.2%} of one core")
