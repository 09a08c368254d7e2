"""Spikes of serial sensors: found whatever the sensor, and nothing else taken for one."""

import numpy as np
import pandas as pd
import pytest

from rotorid.recordings import RecordingSet, Run, templates
from rotorid.recordings import columns as c
from rotorid.recordings.mended import spikes, without_spikes
from rotorid.recordings.sufficient import sufficient

RATE_HZ, SECONDS = 80.0, 60.0
TIME = np.arange(0, SECONDS, 1 / RATE_HZ)
RNG = np.random.default_rng(4)
SLOW = 2.0 + np.sin(2 * np.pi * 0.11 * TIME) + 0.4 * np.sin(2 * np.pi * 0.9 * TIME) + 0.3 * np.sign(np.sin(TIME))
NOISE = 0.02 * RNG.standard_normal(len(TIME))
WRONG = RNG.random(len(TIME)) < 0.03


def wrong(values: np.ndarray, to) -> np.ndarray:
    return np.where(WRONG, to(values), values)


@pytest.mark.parametrize(
    "to",
    [
        lambda x: 2.0 ** np.random.default_rng(1).integers(0, 4, len(x)) * 0.78,  # lower bits read as ones
        lambda x: 0 * x,  # an empty frame
        lambda x: 2 * x,  # two pulses counted for one
        lambda x: x + 3.0,
        lambda x: 32.767 + 0 * x,
        lambda x: -x,
    ],
    ids=["bits", "zero", "double", "offset", "largest number", "sign"],
)
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
def test_single_wrong_readings_are_found(to, scale: float) -> None:
    values = scale * (SLOW + NOISE)
    read = wrong(values, lambda x: scale * to(x / scale))
    found = spikes(read)
    far = WRONG & (np.abs(read - values) > 0.4 * scale)
    assert found[far].mean() > 0.9 and not found[~WRONG].any()


@pytest.mark.parametrize(
    "values",
    [
        SLOW, SLOW + NOISE, NOISE, 0 * TIME, np.round(SLOW + NOISE, 1), np.round(NOISE, 1), np.sign(np.sin(TIME)),
        RNG.laplace(size=len(TIME)), RNG.standard_t(3, len(TIME)), np.sin(2 * np.pi * 27 * TIME),
        NOISE + np.exp(-((TIME - 30) ** 2)) * np.sin(2 * np.pi * 33 * TIME),  # a burst of vibration
        np.cumsum(NOISE), np.floor(TIME), np.where(TIME % 10 < 1, np.nan, SLOW), SLOW[:50], TIME % 1,
        np.where((TIME > 20) & (TIME < 20.3), 0, SLOW + NOISE),  # a sensor that gives nothing for a while
    ],
)  # fmt: skip
def test_what_a_sensor_reads_is_no_spike(values: np.ndarray) -> None:
    assert not spikes(values).any()


@pytest.mark.parametrize("pairs", [2, 3])
def test_two_in_a_row_are_found_three_are_a_pulse(pairs: int) -> None:
    values = SLOW + NOISE
    for start in range(100, 4000, 300):
        values[start : start + pairs] += 2.0
    assert spikes(values).sum() == (2 * 13 if pairs == 2 else 0)


def test_spikes_are_made_empty_cells_and_named_once_a_column() -> None:
    vehicle = templates.read("thesis")
    table = pd.DataFrame({c.TIME: TIME, "force_z_n": wrong(SLOW + NOISE, lambda x: 6.24 + 0 * x)})
    runs = (Run("a", table), Run("b", table.assign(force_z_n=SLOW + NOISE)))
    clean = without_spikes(RecordingSet("set", vehicle, runs))
    assert clean.run("a").table["force_z_n"].isna().sum() == pytest.approx(WRONG.sum(), abs=3)
    assert clean.run("b") == runs[1]
    (said,) = clean.left_out
    assert said.startswith("force_z_n: ") and "1.5 %" in said and "most of them at 6.24: left out" in said


def test_two_far_readings_are_what_a_vehicle_does_once() -> None:
    values = SLOW + NOISE
    values[[1000, 3000]] += 3.0
    assert spikes(values).sum() == 2
    recordings = RecordingSet(
        "set", templates.read("thesis"), (Run("a", pd.DataFrame({c.TIME: TIME, "force_z_n": values})),)
    )
    assert without_spikes(recordings) is recordings


def test_a_stand_with_spikes_is_used_without_them() -> None:
    vehicle = templates.read("thesis").model_copy(update={"kind": "stand"})
    speeds = {n: 1000 + 0 * TIME + 5 * np.sin(TIME) for n in c.rotor_columns("rotor_speed", 4)}
    table = pd.DataFrame({c.TIME: TIME, "force_z_n": -wrong(SLOW + NOISE, lambda x: 0.78 + 0 * x), **speeds})
    found = sufficient(RecordingSet("set", vehicle, tuple(Run(n, table.assign(k=k)) for k, n in enumerate("abc"))))
    assert any("spikes" in sentence for sentence in found.left_out) and len(found.runs) == 3
