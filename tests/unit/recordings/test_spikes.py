"""Spikes of serial sensors: found whatever the sensor, and nothing else taken for one."""

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from rotorid.recordings import RecordingSet, Run, templates
from rotorid.recordings import columns as c
from rotorid.recordings.mended import spikes, with_sizes_of_speeds, without_jumps, without_spikes
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


# Jumps that no motion makes ----------------------------------------------------------------------


def swinging(gyroscope: bool = True) -> pd.DataFrame:
    """Sixty seconds of roll, pitch and yaw with their body rates, and of position and velocity."""
    angles = np.column_stack([0.4 * np.sin(2 * np.pi * f * TIME) for f in (0.4, 0.7, 0.2)])
    turn = Rotation.from_euler("ZYX", angles[:, ::-1])
    rates = (turn[:-1].inv() * turn[1:]).as_rotvec() * RATE_HZ
    table = {c.TIME: TIME} | dict(zip(c.QUATERNION, turn.as_quat()[:, [3, 0, 1, 2]].T, strict=True))
    if gyroscope:
        noisy = np.vstack([rates, rates[-1:]]) + 0.02 * RNG.standard_normal((len(TIME), 3))
        table |= dict(zip(c.ANGULAR_VELOCITY, noisy.T, strict=True))
    place = np.column_stack([3 * np.sin(2 * np.pi * f * TIME) for f in (0.1, 0.15, 0.05)])
    table |= dict(zip(c.POSITION, place.T, strict=True))
    table |= dict(zip(c.VELOCITY, np.gradient(place, 1 / RATE_HZ, axis=0).T, strict=True))
    return pd.DataFrame(table)


def mended(table: pd.DataFrame) -> tuple[pd.DataFrame, tuple[str, ...]]:
    made = without_jumps(RecordingSet("set", templates.read("thesis"), (Run("run", table),)))
    return made.runs[0].table, made.left_out


JUMPED = ((TIME > 10) & (TIME < 10.4)) | ((TIME > 30) & (TIME < 30.2)) | (np.abs(TIME - 50) < 0.01)


@pytest.mark.parametrize("gyroscope", [True, False])
@pytest.mark.parametrize("turn", [np.pi, -0.7])
def test_an_attitude_that_jumps_and_comes_back_is_left_out_there(gyroscope: bool, turn: float) -> None:
    table = swinging(gyroscope)
    true = Rotation.from_quat(table[list(c.QUATERNION)].to_numpy()[:, [1, 2, 3, 0]])
    wrong = (true * Rotation.from_rotvec([0, 0, turn])).as_quat()[:, [3, 0, 1, 2]]
    table[list(c.QUATERNION)] = np.where(JUMPED[:, None], wrong, table[list(c.QUATERNION)])
    made, said = mended(table)
    assert (made[c.QUATERNION[0]].isna().to_numpy() == JUMPED).all()
    assert len(said) == 1 and f"jumps by up to {np.degrees(abs(turn)):.0f} degrees" in said[0]


@pytest.mark.parametrize(("names", "by"), [(c.POSITION, 1.5), (c.VELOCITY, 6.0)])
def test_a_position_or_velocity_that_jumps_is_left_out_there(names, by: float) -> None:
    table = swinging()
    table.loc[JUMPED, names[1]] += by
    made, said = mended(table)
    assert (made[names[0]].isna().to_numpy() == JUMPED).all() and len(said) == 1


def test_an_attitude_that_is_set_anew_is_cut_there() -> None:
    table = swinging()
    true = Rotation.from_quat(table[list(c.QUATERNION)].to_numpy()[:, [1, 2, 3, 0]])
    anew = (Rotation.from_rotvec([0, 0, 0.6]) * true).as_quat()[:, [3, 0, 1, 2]]
    table[list(c.QUATERNION)] = np.where((TIME > 25)[:, None], anew, table[list(c.QUATERNION)])
    made, said = mended(table)
    gone = TIME[made[c.QUATERNION[0]].isna()]
    assert len(gone) == 8 and np.abs(gone - 25).max() < 0.1 and "set anew" in said[0]


def test_what_moves_fast_does_not_jump() -> None:
    """A flip within half a second, quaternions of either sign, and a gyroscope in degrees are no jumps."""
    angle = 2 * np.pi * np.clip((TIME - 20) / 0.5, 0, 1)
    turn = Rotation.from_rotvec(np.outer(angle, [1, 0, 0])).as_quat()[:, [3, 0, 1, 2]]
    table = pd.DataFrame({c.TIME: TIME} | dict(zip(c.QUATERNION, turn.T, strict=True)))
    rates = np.gradient(angle, 1 / RATE_HZ)
    for factor in (1.0, 180 / np.pi):
        own = table.assign(**dict(zip(c.ANGULAR_VELOCITY, (factor * rates, 0 * rates, 0 * rates), strict=True)))
        assert mended(own)[1] == ()
    cut = swinging()
    flipped = np.where(RNG.random(len(TIME)) < 0.5, -1.0, 1.0)
    cut[list(c.QUATERNION)] *= flipped[:, None]
    assert mended(cut)[1] == () and mended(swinging(False))[1] == ()


def test_a_sign_that_a_rotor_keeps_is_its_sense_and_one_that_changes_is_told() -> None:
    speeds = c.rotor_columns("rotor_speed", 4)
    own = 600 + 20 * np.sin(TIME)
    table = pd.DataFrame({c.TIME: TIME} | {n: (-1.0) ** k * own for k, n in enumerate(speeds)})
    table.loc[JUMPED, speeds[1]] = 300.0
    made = with_sizes_of_speeds(RecordingSet("set", templates.read("thesis"), (Run("run", table),)))
    sizes = made.runs[0].table
    assert np.allclose(sizes[speeds[3]], own) and (sizes[speeds[1]].isna() == JUMPED).all()
    assert "turning sense" in made.left_out[0] and f"{speeds[1]}: the rotor turns backwards" in made.left_out[1]
