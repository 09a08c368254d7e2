"""What a command did between its samples, which nobody recorded, is free within what it can be. Readings that are
missing for a while: a sensor goes on remembering the load, and nothing is compared there.
"""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from rotorid.effects.amplifier_filter import EFFECT as AMPLIFIER
from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import Motion, SpeedPath
from rotorid.effects.loading import forms_of
from rotorid.effects.motor_lag import lagged
from rotorid.mismatch.evidence.rows import form_reading
from rotorid.mismatch.evidence.split import parts_of, split_runs
from rotorid.mismatch.instrument.chain import find_chain, moved_between_samples, unknown_courses
from rotorid.mismatch.instrument.setup import pieces_of, set_up, with_speed
from rotorid.recordings import RecordingSet, Run
from tests.unit.mismatch.instrument.stands import C_F, one_rotor
from tests.unit.mismatch.instrument.test_instrument import RATE_HZ, bench_set

DT_S, TAU_S = 0.01, 0.03
FINE = 20
LAG = next(f for f in catalogue()["motor_lag"].speed_forms if f.name == "one constant")
DELAY = catalogue()["delay"].speed_forms[0]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_lag_of_a_ramp_is_exact_between_samples_and_has_its_own_constant_up_and_down(sign):
    """ω = t − τ (1 − exp(−t/τ)) for ω_c = t from rest, and down by the other constant."""
    t = np.arange(40) * DT_S
    up_s, down_s = (TAU_S, 0.01)[:: int(sign)]
    found = lagged(sign * t[:, None], up_s, down_s, DT_S, holds=False)[:, 0]
    np.testing.assert_allclose(found, sign * (t - TAU_S * (1 - np.exp(-t / TAU_S))), atol=1e-12)


def test_a_smooth_command_is_delayed_without_being_smoothed():
    """A sine of 10 Hz at 100 Hz, half a sample late: straight lines would take 5 % of it, a cubic takes 0.3 %."""
    t = np.arange(200) * DT_S
    wave = np.sin(2 * np.pi * 10 * t)[:, None]
    late = DELAY.apply(SpeedPath(wave, t, 1.0, holds=False), np.array([0.5 * DT_S]))
    true = np.sin(2 * np.pi * 10 * (t - 0.5 * DT_S))
    assert np.abs(late[2:-2, 0] - true[2:-2]).max() < 0.011
    straight = DELAY.apply(SpeedPath(wave, t, 1.0), np.array([0.5 * DT_S]))
    assert np.abs(straight[2:-2, 0] - true[2:-2]).max() == pytest.approx(0.05, abs=0.005)


def test_the_moments_of_a_parabola_by_hand():
    """ω = t²: later by δ it is (t − δ)², spread by v it is v more; a cubic between samples is exact for it."""
    t = np.arange(39) * DT_S / 2
    moved = moved_between_samples((t**2)[:, None], np.array([0.002, 1e-5]), DT_S, 2)[2:-1, 0]
    np.testing.assert_allclose(moved, (t[::2][2:-1] - 0.002) ** 2 + 1e-5, atol=1e-12)


def test_what_is_not_known_of_a_command():
    """Half a sample and the variance of a hold, dt²/12."""
    np.testing.assert_allclose(unknown_courses(0.012), [0.006, 1.2e-5])


def lagging_set(between) -> RecordingSet:
    """Three runs of a rotor with a lag of 30 ms whose command's course between samples is `between(fine command)`."""
    runs = []
    for number in range(3):
        rng = np.random.default_rng(number)
        t = np.arange(0, 20, DT_S / FINE)
        knots = np.arange(0, 20.4, 0.4) + 0.1 * rng.random(51)
        places = np.repeat(knots, 2)[1:-1] + 0.0371 * np.tile([0, 1], 50)
        course = np.interp(t, places, np.repeat(rng.uniform(400, 900, 50), 2))
        speed = lagged(between(course)[:, None], TAU_S, TAU_S, DT_S / FINE)[::FINE, 0]
        read = speed + 0.5 * rng.standard_normal(len(speed))
        table = {
            "time_s": t[::FINE],
            "rotor_command_1_rad_s": course[::FINE],
            "rotor_speed_1_rad_s": read,
            "force_z_n": -C_F * speed**2 + 0.003 * rng.standard_normal(len(speed)),
        }
        runs.append(Run(f"run{number}", pd.DataFrame(table)))
    return one_rotor(runs, ("run2",))


@pytest.mark.parametrize("between", [lambda x: x, lambda x: np.repeat(x[::FINE], FINE)], ids=["smooth", "holds"])
def test_a_lag_is_found_whatever_the_command_did_between_its_samples(between):
    made = lagging_set(between)
    setup = set_up(parts_of(made, split_runs(made))[0], made)
    (found,) = [f for f in find_chain(setup).findings if f.id == "motor_lag"]
    first = found.parameters[0]
    assert first.low < TAU_S < first.high and first.high - first.low < 0.04 * TAU_S


def test_the_acceleration_of_a_cubic_is_exact():
    """d(t³)/dt = 3 t²: the kernel has no error of third order, which would read a rotor's inertia too large."""
    t = np.arange(30) * 0.005
    motion = with_speed(Motion(time_s=t, rotor_speed=None), (t**3)[:, None])
    np.testing.assert_allclose(motion.rotor_acceleration[2:-2, 0], 3 * t[2:-2] ** 2, atol=1e-12)


def with_a_gap(start_s: float, stop_s: float):
    recordings = bench_set()
    first = recordings.runs[0]
    table = first.table.copy()
    table.loc[(table.time_s > start_s) & (table.time_s < stop_s), "force_z_n"] = np.nan
    return replace(recordings, runs=(Run(first.name, table), *recordings.runs[1:]))


def test_a_short_gap_stays_in_its_stretch_and_is_not_compared():
    """Half a second from 10 s on at 50 Hz: 24 samples lack between 10.00 and 10.50 s."""
    (x,) = [x for x in set_up(with_a_gap(10.0, 10.5)).loadings if x.run == "run1"]
    assert x.size == 30 * RATE_HZ and np.isfinite(x.reading[:, :3]).all()
    missing = x.time_s[~x.keep]
    assert len(missing) == 24 and missing[0] == pytest.approx(10.02) and missing[-1] == pytest.approx(10.48)
    assert [len(p) for p in pieces_of(x, 1)] == [501, 975]


def test_after_a_long_gap_a_new_stretch_begins():
    spans = [(x.time_s[0], x.time_s[-1]) for x in set_up(with_a_gap(10.0, 14.0)).loadings if x.run == "run1"]
    assert np.allclose(spans, [(0.0, 10.0), (14.0, 29.98)])


def test_one_missing_sample_is_filled():
    (x,) = [x for x in set_up(with_a_gap(10.0, 10.03)).loadings if x.run == "run1"]
    assert x.keep is None
    assert x.reading[501, 2] == pytest.approx((x.reading[500, 2] + x.reading[502, 2]) / 2)


def test_a_filter_has_settled_on_the_load_that_a_stretch_begins_with():
    setup = set_up(bench_set())
    x = setup.loadings[0]
    still = replace(x, load=np.broadcast_to(np.array([1.0, -2.0, 5.0, 0, 0, 0]), x.load.shape).copy())
    for form in forms_of(AMPLIFIER, setup.instrument):
        assert np.abs(form_reading(form, [2.0], still, setup.vehicle)).max() < 1e-12
