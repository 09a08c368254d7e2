"""The voltage to be expected of a noisy voltmeter."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

from rotorid.effects.contract import Motion
from rotorid.mismatch.evidence.motion import Segment, running_mean, without_noise
from rotorid.mismatch.mistakes.signals import connected
from rotorid.recordings import RecordingSet, Run

RATE_HZ = 200.0
TIME_S = np.arange(32000) / RATE_HZ


def flown(voltage, command):
    """A segment with one rotor's command (n,), rad/s, and a reading (n,), V."""
    motion = Motion(time_s=TIME_S, rotor_speed=command[:, None], voltage=voltage)
    return Segment("run", RATE_HZ, motion, "none", command=command[:, None])


def loaded(rng):
    """Commands (n,) about 1000 rad/s and the voltage of a battery that falls 10 mV a second and 0.1 V per 1e9 load."""
    command = 1000.0 + 60.0 * lfilter([0.05], [1, -0.95], rng.standard_normal(TIME_S.size)) / 0.16
    load = command**3
    keep = np.exp(-1 / (0.1 * RATE_HZ))
    lagged = lfilter([1 - keep], [1, -keep], load, zi=[keep * load[0]])[0]
    return command, 12.0 - 0.01 * TIME_S - 1e-10 * lagged


def test_noise_of_any_colour_stays_out_of_the_voltage():
    """Noise of the size of the quick signal, correlated over 50 ms, would take half of a slope on the reading."""
    rng = np.random.default_rng(3)
    command, true = loaded(rng)
    quick = true - running_mean(true, 1001)
    noise = lfilter([1.0], [1, -0.9], rng.standard_normal(TIME_S.size))
    noise *= quick.std() / noise.std()
    (found,) = without_noise([flown(true + noise, command)])

    def slope(reading):
        return np.polyfit(reading - running_mean(reading, 1001), quick, 1)[0]

    assert slope(true + noise) == pytest.approx(0.5, abs=0.05)
    assert slope(found.motion.voltage) == pytest.approx(1.0, abs=0.05)
    assert (found.motion.voltage - true).std() < quick.std() / 5


def test_a_voltage_that_time_and_load_make_is_left_as_it_is():
    command, true = loaded(np.random.default_rng(4))
    (found,) = without_noise([flown(true, command)])
    assert np.abs(found.motion.voltage - true).max() < 1e-6


@pytest.mark.parametrize("size", [176, 177])
def test_a_stretch_shorter_than_the_slow_mean_keeps_its_length(size):
    command, true = loaded(np.random.default_rng(6))
    short = flown(true, command).part(0, size)
    assert without_noise([short])[0].motion.voltage.shape == (size,)


def test_without_commands_the_reading_stays():
    command, true = loaded(np.random.default_rng(5))
    bare = replace(flown(true, command), command=None)
    assert without_noise([bare]) == [bare]


def test_a_voltmeter_that_is_not_connected_is_not_believed():
    """Noise about 0 V is no battery; single zeros among readings of one are holes."""
    rng = np.random.default_rng(7)
    dead = pd.DataFrame({"time_s": TIME_S[:100], "battery_voltage_v": 0.05 * rng.standard_normal(100)})
    sound = dead.assign(battery_voltage_v=12.0)
    holes = sound.assign(battery_voltage_v=np.where(np.arange(100) % 10 == 0, 0.0, 12.0))
    recordings = RecordingSet("s", None, (Run("a", dead), Run("b", sound), Run("c", holes)))
    found = connected(recordings)
    fixed = found.recordings
    assert found.notes == ("battery_voltage_v of a reads below 0.5 V: taken as not connected.",)
    assert not fixed.runs[0].has("battery_voltage_v") and fixed.runs[1] is recordings.runs[1]
    left = fixed.runs[2].column("battery_voltage_v")
    assert np.isnan(left[::10]).all() and (left[1:10] == 12.0).all()


def test_a_running_mean_keeps_a_line_to_its_ends():
    """Of 1, 3, 5, … the mean of any five is the middle one; the ends follow the line."""
    line = 1.0 + 2.0 * np.arange(12)
    assert running_mean(line, 5) == pytest.approx(line)
    assert running_mean(np.array([0.0, 0, 9, 0, 0, 0, 0]), 3)[1:4] == pytest.approx([3.0, 3.0, 3.0])
