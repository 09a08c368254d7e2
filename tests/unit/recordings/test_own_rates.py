"""Sensors whose readings come at random: an even grid of their own, in place of a flight cut into pieces."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from rotorid.cli.modelling import fly
from rotorid.mismatch.evidence.motion import between_readings
from rotorid.recordings import RecordingSet, Run, read_set, templates
from rotorid.recordings import columns as c
from rotorid.recordings.mended import evenly, is_scattered, noise_gain, on_one_side, on_own_rates, own_period_s
from rotorid.recordings.sufficient import longest_stretch_s, moving_sensors, sufficient
from tests.refusals import refused
from tests.unit.mismatch.flights import with_table

SPEEDS = c.rotor_columns("rotor_speed", 4)
SENSORS = (SPEEDS, c.rotor_columns("rotor_command", 4), c.POSITION, c.VELOCITY, c.QUATERNION,
           c.ANGULAR_VELOCITY, c.SPECIFIC_FORCE)  # fmt: skip


@pytest.fixture(scope="module")
def flown(tmp_path_factory) -> RecordingSet:
    return read_set(fly(templates.read("thesis"), tmp_path_factory.mktemp("sets") / "flights", 12.0, 2, 3))


def with_holes(recordings: RecordingSet, share: float, by_cell: bool, seed: int = 1) -> RecordingSet:
    """Each sensor loses a share of its rows, or each of its columns of its cells, by chance."""
    rng = np.random.default_rng(seed)

    def holed(table: pd.DataFrame) -> None:
        for names in SENSORS:
            for part in [[n] for n in names] if by_cell else [list(names)]:
                table.loc[rng.random(len(table)) < share, part] = np.nan

    return with_table(recordings, holed)


def without(names: tuple[str, ...], start_s: float, stop_s: float):
    """A change of a table: no readings of these columns between two times."""

    def change(table: pd.DataFrame) -> None:
        table.loc[table[c.TIME].between(start_s, stop_s, "neither"), list(names)] = np.nan

    return change


@pytest.mark.parametrize(("share", "by_cell"), [(0.5, False), (0.3, True), (0.5, True)])
def test_half_empty_columns_are_used_in_one_piece(flown: RecordingSet, share: float, by_cell: bool) -> None:
    """They were refused: 'the longest stretch in which every sensor has readings lasts 0.7 s'."""
    holed = with_holes(flown, share, by_cell)
    cut, _ = longest_stretch_s(holed.runs[0], [SPEEDS, *moving_sensors(holed.runs[0])])
    used = sufficient(holed)
    whole, slowest = longest_stretch_s(used.runs[0], [SPEEDS, *moving_sensors(used.runs[0])])
    assert cut < 3 < 11.5 < whole and 0.01 < slowest < 0.03
    assert len(used.left_out) == len(SENSORS)
    empty = f"({share:.0%} of the cells are empty)"
    (said,) = (
        s for s in used.left_out if s.startswith("specific_force_x_m_s2 to specific_force_z_m_s2 come at random")
    )
    assert "the noise is" in said and any(empty in s for s in used.left_out)
    assert sufficient(used).runs[0].table.equals(used.runs[0].table)  # once is enough


def test_a_band_of_signal_and_the_noise_of_what_is_there_remain() -> None:
    """Tones below 0.4 of the new rate keep amplitude and phase; the noise in the band is that of half the readings."""
    rng = np.random.default_rng(3)
    time_s = np.arange(15000) / 250
    tones = np.sin(2 * np.pi * 3 * time_s) + 0.3 * np.cos(2 * np.pi * 15 * time_s)
    noise = 0.1 * rng.standard_normal(len(time_s))
    table = {c.TIME: time_s, c.ANGULAR_VELOCITY[0]: tones + noise, c.ANGULAR_VELOCITY[1]: noise}
    run = Run("run", pd.DataFrame(table | {c.ANGULAR_VELOCITY[2]: tones}))
    gone = rng.random((len(time_s), 3)) < 0.5
    run = replace(
        run, table=run.table.assign(**{n: run.table[n].mask(gone[:, k]) for k, n in enumerate(c.ANGULAR_VELOCITY)})
    )
    assert is_scattered(run, c.ANGULAR_VELOCITY)
    period = own_period_s(run, c.ANGULAR_VELOCITY)
    values = evenly(run, c.ANGULAR_VELOCITY, period, jumps=False)
    rows = np.isfinite(values).all(axis=1)
    assert np.allclose(np.diff(time_s[rows]), period) and 0.016 <= period <= 0.024
    inner = np.flatnonzero(rows)[20:-20]
    assert np.abs(values[inner, 2] - tones[inner]).max() < 0.15  # of 1.3, in the longest steps
    assert np.sqrt(np.mean((values[inner, 2] - tones[inner]) ** 2)) < 0.012  # of 0.74
    density = np.var(values[inner, 1]) * period / (0.1**2 / 250)
    gain = noise_gain(run, c.ANGULAR_VELOCITY, period, jumps=False)
    assert gain == pytest.approx(np.sqrt(density), rel=0.1)
    assert np.sqrt(2) < gain < 1.8  # half the readings have twice the density, their uneven steps cost the rest


def test_a_slow_sensor_keeps_its_band_where_one_reading_in_ten_is_lost() -> None:
    """At 20 Hz a lost reading makes a step of a tenth of a second: a grid of such steps would halve the band."""
    rng = np.random.default_rng(5)
    time_s = np.arange(2000) / 20
    tone = np.sin(2 * np.pi * 3 * time_s)
    table = dict.fromkeys(c.ANGULAR_VELOCITY, np.where(rng.random(len(time_s)) < 0.1, np.nan, tone))
    run = Run("run", pd.DataFrame({c.TIME: time_s} | table))
    period = own_period_s(run, c.ANGULAR_VELOCITY)
    assert 1.0 / period > 17.0
    values = evenly(run, c.ANGULAR_VELOCITY, period, jumps=False)[:, 0]
    inner = np.flatnonzero(np.isfinite(values))[10:-10]
    assert np.sqrt(np.mean((values[inner] - tone[inner]) ** 2)) < 0.06 * np.sqrt(0.5)


def test_commands_that_jitter_faster_than_the_grid_are_averaged_not_sampled() -> None:
    """A throttle at 1 kHz, packets lost several at a time, brought to 50 Hz: its jitter was folded into the band."""
    rng = np.random.default_rng(4)
    time_s = np.arange(20000) / 1000
    slow = 0.5 + 0.1 * np.sin(2 * np.pi * 2 * time_s)
    names = c.rotor_columns("throttle", 4)
    jitter = 0.05 * rng.standard_normal((len(time_s), 4))
    lost = np.repeat(rng.random(len(time_s) // 4) < 0.1, 4)
    table = dict(zip(names, np.where(lost, np.nan, (slow[:, None] + jitter).T), strict=True))
    run = Run("run", pd.DataFrame({c.TIME: time_s} | table))
    values = evenly(run, names, 0.02, jumps=True)
    rows = np.isfinite(values).all(axis=1)
    off = values[rows] - slow[rows, None]
    assert np.std(off) < 0.05 / np.sqrt(3)  # five readings of a jitter of 0.05 are averaged, less where some are lost
    assert abs(np.mean(off)) < 0.001 and noise_gain(run, names, 0.02, jumps=True) < 1.3


@pytest.mark.parametrize("repeated", [False, True])
def test_rotors_that_come_seldom_keep_their_motion(flown: RecordingSet, repeated: bool) -> None:
    """At 10 Hz, swinging at 2 Hz: by straight lines a ninth of it would be lost."""
    time_s = np.arange(0, 20, 0.01)
    true = 600 + 50 * np.sin(2 * np.pi * 2.0 * time_s)
    read = pd.Series(np.where(np.arange(len(time_s)) % 10 == 0, true, np.nan))
    read[(time_s > 10) & (time_s < 12)] = np.nan  # a hole stays one
    read = read.ffill() if repeated else read
    run = Run("run", pd.DataFrame({c.TIME: time_s} | dict.fromkeys(SPEEDS, read)))
    made = on_own_rates(replace(flown, runs=(run,)))
    speed = made.runs[0].column(SPEEDS[0])
    inside = np.abs(time_s - 5) < 3
    assert np.abs(speed - true)[inside].max() < 1.0
    assert repeated or np.isnan(speed[(time_s > 10.1) & (time_s < 11.9)]).all()
    (said,) = made.left_out
    assert "come 10 times a second" in said and "faster than 4 Hz is not in them" in said


def test_a_hole_of_several_periods_stays_one_and_what_is_even_stays_as_it_is(flown: RecordingSet) -> None:
    holed = with_holes(flown, 0.4, False)
    used = sufficient(with_table(holed, without(c.ANGULAR_VELOCITY, 4, 4.5), holed.runs[0].name))
    known = used.runs[0].time_s[np.isfinite(used.runs[0].array(c.ANGULAR_VELOCITY)).all(axis=1)]
    gap = np.argmax(np.diff(known))
    assert known[gap] == pytest.approx(4.0, abs=0.03) and known[gap + 1] == pytest.approx(4.5, abs=0.03)
    assert on_own_rates(flown) is flown
    even = with_table(flown, lambda t: t.assign(**{n: t[n].where(t.index % 5 == 0) for n in c.VELOCITY}))
    assert on_own_rates(even) is even


def with_bursts(recordings: RecordingSet, lasting_s: float, every_s: float) -> RecordingSet:
    """Each sensor gives nothing for a time, again and again, no two of them at once."""

    def burst(table: pd.DataFrame) -> None:
        for k, names in enumerate(SENSORS):
            for start in np.arange(0.3 + 0.07 * k, table[c.TIME].iloc[-1], every_s):
                without(names, start, start + lasting_s)(table)

    return with_table(recordings, burst)


def test_gaps_of_a_tenth_of_a_second_everywhere_are_bridged(flown: RecordingSet) -> None:
    used = sufficient(with_bursts(flown, 0.1, 0.7))
    assert len(used.runs) == 2 and any("brought to an even 50 Hz" in said for said in used.left_out)
    longest, _ = longest_stretch_s(used.runs[0], list(SENSORS))
    assert longest > 11.0
    for run, true in zip(used.runs, flown.runs, strict=True):
        known = np.isfinite(run.array(c.VELOCITY)).all(axis=1)
        off = run.array(c.VELOCITY)[known] - true.array(c.VELOCITY)[known]
        assert np.sqrt(np.mean(off**2)) < 0.05 and np.abs(off).max() < 0.45  # of 5 m/s, read with 0.02 m/s of noise


def test_longer_gaps_everywhere_leave_no_stretch(flown: RecordingSet) -> None:
    refused("the longest stretch in which every sensor has readings lasts 0", sufficient, with_bursts(flown, 0.3, 0.7))


def test_a_run_of_its_own_is_bridged_where_a_gap_would_leave_less_than_is_held_out_of(flown: RecordingSet) -> None:
    one = replace(flown, runs=flown.runs[:1])
    alone = sufficient(with_table(one, without(c.ANGULAR_VELOCITY, 6.0, 6.08)))
    assert longest_stretch_s(alone.runs[0], list(SENSORS))[0] > 11.0


def test_a_sensor_of_next_to_no_readings_is_left_alone(flown: RecordingSet) -> None:
    holed = with_holes(flown, 0.5, False)
    holed = with_table(holed, without(c.VELOCITY, holed.runs[1].time_s[30], np.inf), holed.runs[1].name)
    made = on_own_rates(holed)
    assert made.runs[1].table[list(c.VELOCITY)].equals(holed.runs[1].table[list(c.VELOCITY)])
    assert not made.runs[0].table[list(c.VELOCITY)].equals(holed.runs[0].table[list(c.VELOCITY)])


def test_signs_of_quaternions_with_empty_cells_stay_on_one_side() -> None:
    rng = np.random.default_rng(2)
    angle = np.linspace(0, 8, 400)
    true = np.column_stack([np.cos(angle / 2), np.sin(angle / 2) * 0.6, np.zeros(400), np.sin(angle / 2) * 0.8])
    flipped = true * rng.choice([-1.0, 1.0], 400)[:, None]
    flipped[rng.random((400, 4)) < 0.3] = np.nan
    made = on_one_side(flipped)
    known = np.isfinite(made) & (np.abs(true) > 0.2)
    agrees = np.sign(made[known]) == np.sign(true[known])
    assert max(agrees.mean(), 1 - agrees.mean()) > 0.99


def test_a_half_empty_column_of_ones_own_is_read_between_its_readings() -> None:
    """Empty cells of a column that the contract does not know counted as 0."""
    time_s = np.arange(6.0)
    values = np.array([2.0, np.nan, 4.0, np.nan, np.nan, 7.0])
    assert between_readings(time_s, time_s, values).tolist() == [2, 3, 4, 5, 6, 7]
    assert between_readings(time_s, time_s, np.full(6, np.nan)).tolist() == [0] * 6


@pytest.mark.parametrize("first_s", [0.0, 0.27, 12.34])
def test_a_whole_number_of_periods_ends_with_the_last_reading_whatever_is_rounded(first_s: float) -> None:
    rng = np.random.default_rng(1)
    for rate_hz in (50.0, 100.0, 187.0, 250.0):
        time_s = np.round(first_s + np.arange(1200) / rate_hz, 5)
        for count in range(300, 320):
            read_s = np.sort(rng.choice(time_s[1:-1], count, replace=False))
            run = Run("r", pd.DataFrame({c.TIME: time_s, "height_m": np.where(np.isin(time_s, read_s), 1.0, np.nan)}))
            made = evenly(run, ("height_m",), float(np.diff(read_s).mean()), jumps=False)
            assert np.nanmax(np.abs(made - 1.0)) < 1e-6
