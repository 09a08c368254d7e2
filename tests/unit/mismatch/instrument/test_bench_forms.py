"""Forms and rules that other laboratories' benches asked for, with numbers by hand."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.signal import bessel, sosfilt

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import Motion
from rotorid.effects.hysteresis import settling
from rotorid.effects.loading import InstrumentFacts, Loading, forms_of
from rotorid.mismatch.evidence.rows import form_reading
from rotorid.mismatch.evidence.unknowns import UNKNOWNS
from rotorid.mismatch.instrument.analyse import _parameters_of, _with_alternatives, analyse_instrument
from rotorid.mismatch.instrument.model import kept_values, make_terms, reading_model
from rotorid.mismatch.instrument.setup import session_of, set_up, zero_temperature
from rotorid.recordings import RecordingSet, Run
from tests.unit.mismatch.instrument.stands import BENCH, bench_run, claimed

RATE_HZ = 50.0


def instrument(**changes) -> InstrumentFacts:
    given = dict(
        vehicle=BENCH, channels=(0, 1, 2), loaded=(0, 1, 2), rate_hz=RATE_HZ, duration_s=30.0, run_s=30.0,
        runs=("a", "b", "c"), largest=(10.0, 10.0, 20.0, 1.0, 1.0, 1.0), returns=(0, 1, 2), temperature=True,
        temperatures_c=(20.0, 24.0), first_temperature_c=20.0, session_s=100.0, session_clock=True,
    )  # fmt: skip
    return InstrumentFacts(**given | changes)


def loading(force_z: np.ndarray, run: str = "a", start_s: float = 0.0, temperature_c: float = 20.0) -> Loading:
    """A load along z alone that starts `start_s` into the session."""
    t = np.arange(len(force_z)) / RATE_HZ
    load = np.zeros((len(t), 6))
    load[:, 2] = force_z
    warmth = np.full(len(t), temperature_c)
    motion = Motion(time_s=t, rotor_speed=None)
    return Loading(run, t, t, load, load.copy(), np.zeros(6), motion, temperature_c=warmth, session_time_s=t + start_s)


def form(effect: str, name: str, **changes):
    return next(f for f in forms_of(catalogue()[effect], instrument(**changes)) if f.name == name)


def added(effect: str, name: str, values, given: Loading) -> np.ndarray:
    return form_reading(form(effect, name), np.array(values, float), given, BENCH)


def test_a_session_has_pauses_where_its_clock_runs_on_and_none_where_each_run_starts_anew():
    def runs(*starts):
        return tuple(Run(f"r{i}", pd.DataFrame({"time_s": s + np.arange(11.0)})) for i, s in enumerate(starts))

    def of(*starts):
        found = session_of(RecordingSet("s", BENCH, runs(*starts)))
        return list(found.start_s.values()), found.length_s, found.clock

    assert of(5.0, 35.0, 65.0) == ([0.0, 30.0, 60.0], 70.0, True)
    assert of(0.0, 0.0, 0.0) == ([0.0, 10.0, 20.0], 30.0, False)
    assert of(7.0) == ([0.0], 0.0, False)


def test_a_warming_up_goes_on_over_the_session():
    """τ = 50 s, the run starts at 50 s: b (1 − 1/e) = 0.632 b at its first sample."""
    given = loading(np.zeros(10), start_s=50.0)
    reading = added("zero_drift", "warming up over the session", [0.1, 0.2, 1.0, 50.0], given)
    assert reading[0, :3] == pytest.approx((1 - np.exp(-1)) * np.array([0.1, 0.2, 1.0]))


def test_a_zero_that_goes_with_the_temperature_was_right_at_one():
    given = loading(np.zeros(10), temperature_c=23.5)
    reading = added("zero_drift", "with temperature, zero at T_0", [0.1, -0.2, 0.4, 21.0], given)
    assert reading[0, :3] == pytest.approx([0.25, -0.5, 1.0])
    over_session = added("zero_drift", "with temperature over the session", [0.1, -0.2, 0.4], given)
    assert over_session[0, :3] == pytest.approx([0.35, -0.7, 1.4])


def test_the_temperature_of_the_zero_is_read_off_the_readings():
    """b = (0.1, −0.2, 0.4) N/K from 21 °C on, beside a gain of one per cent, which is none of it."""
    given = loading(5 * np.random.default_rng(0).standard_normal(500))
    warmth = np.linspace(20, 24, 500)
    drift = (warmth - 21.0)[:, None] * np.array([0.1, -0.2, 0.4])
    reading = 1.01 * given.load
    reading[:, :3] += drift
    given = replace(given, reading=reading, temperature_c=warmth)
    assert zero_temperature((given,), (0, 1, 2)) == pytest.approx(21.0)


def test_a_clock_of_the_session_is_late_from_the_start_of_a_later_run():
    """F = 2 t N; e = 1e-3 after 60 s is 0.06 s late: 0.12 N too little, and 0.0004 N more after 0.2 s."""
    t = np.arange(50) / RATE_HZ
    reading = added("clock_skew", "other rate over the session", [1e-3], loading(2 * t, start_s=60.0))
    assert reading[10, 2] == pytest.approx(-0.12 - 2e-3 * 0.2, rel=1e-6)


def test_a_loop_of_exponentials_by_hand():
    """Up by one width from rest: z = 1 − 1/e; back by one width: z = −1 + (2 − 1/e)/e, however fine the steps."""
    up = 1 - np.exp(-1)
    back = -1 + (up + 1) * np.exp(-1)
    assert settling(np.array([0.0, 3.0, 0.0]), 3.0) == pytest.approx([0.0, up, back])
    fine = np.r_[np.linspace(0, 3, 40), np.linspace(3, 0, 70)]
    assert settling(fine, 3.0)[[39, -1]] == pytest.approx([up, back])
    reading = added("hysteresis", "exponential loop", [0.0, 0.0, -0.5, 0.15], loading(np.array([0.0, 3.0, 0.0])))
    assert reading[:, 2] == pytest.approx([0.0, -0.5 * up, -0.5 * back])


def test_an_s_shape_is_right_at_none_and_at_full_scale_and_takes_up_the_gain():
    """F_max 20 N, s 1.5: full scale 30 N; a at half of it, and half of a at a sixth."""
    reading = added("load_nonlinearity", "S-shape", [0.1, 0.1, 0.4, 1.5], loading(np.array([0.0, 5.0, 15.0, 30.0])))
    assert reading[:, 2] == pytest.approx([0.0, 0.2, 0.4, 0.0])
    assert set(form("load_nonlinearity", "S-shape").takes_up) == {"gain", "gain_x", "gain_y", "gain_z"}
    assert form("load_nonlinearity", "S-shape of Fz").takes_up == ("gain_z",)


def test_a_curve_of_cube_and_fifth_power():
    values = [0, 0, 1e-3, 0, 0, -1e-5]
    reading = added("load_nonlinearity", "cube and fifth power", values, loading(np.array([2.0, -10.0])))
    assert reading[:, 2] == pytest.approx([8e-3 - 32e-5, -1.0 + 1.0])


def test_creep_with_two_time_constants_is_the_sum_of_two():
    given = loading(np.r_[0.0, np.full(1499, 10.0)])
    both = added("creep", "two time constants, alike on all channels", [0.01, 0.02, 3.0, 30.0], given)
    one, other = (added("creep", "alike on all channels", v, given) for v in ([0.01, 3.0], [0.02, 30.0]))
    assert both == pytest.approx(one + other)
    # After 29.96 s: 10 N (0.01 (1 − e^−9.99) + 0.02 (1 − e^−0.9987)).
    assert both[-1, 2] == pytest.approx(0.1 * (1 - np.exp(-9.987)) + 0.2 * (1 - np.exp(-0.9987)), abs=2e-3)


def test_loads_mixed_anew_in_each_run_are_no_crosstalk():
    """With entries 0.02 in the first of three runs: 0.02 F there, nothing in the second, −0.02 F in the last."""
    forms = UNKNOWNS["unknown_gain"].reading_forms(instrument())
    mixed = next(f for f in forms if f.name == "loads mixed anew in each run")
    names = [p.symbol for p in mixed.parameters]
    values = np.zeros(len(names))
    values[names.index("M_Fx,Fz(a)")] = 0.02
    loads = (loading(np.array([5.0]), run=run) for run in "abc")
    found = [mixed.contribution(own, BENCH, values).reading[0, 0] for own in loads]
    assert found == pytest.approx([0.1, 0.0, -0.1])


def test_crosstalk_mixes_what_the_weight_loads_where_the_mount_tilts():
    """5 N along z and, of a weight, 2 N along x: 2 % of the latter are read along z."""
    plain = {f.name: f for f in forms_of(catalogue()["crosstalk"], instrument(loaded=(2,)))}
    assert "between all, of the weight too" not in plain
    mixed = form("crosstalk", "between all, of the weight too", loaded=(2,), weighed=(0,))
    names = [p.symbol for p in mixed.parameters]
    assert sorted(names) == ["C_Fx,Fz", "C_Fy,Fx", "C_Fy,Fz", "C_Fz,Fx"]
    given = loading(np.array([5.0]))
    given.load[:, 0] = 2.0
    values = np.eye(4)[names.index("C_Fz,Fx")] * 0.02
    assert mixed.contribution(given, BENCH, values).reading[0, 2] == pytest.approx(0.04)


def recorded(change, runs: int = 5, noise_n: float = 0.05, seed: int = 0, step_n: float = 0.0) -> RecordingSet:
    """A bench loaded in ramps along all axes; `change(load, run, session_s)` is the reading before noise.

    Its clock runs on, and it warms up from 20 °C by 4 K.
    """
    rng = np.random.default_rng(seed)
    made = []
    for number in range(runs):
        t = np.arange(int(60 * RATE_HZ)) / RATE_HZ
        corners = np.linspace(0, 60, 16)
        load = np.stack([np.interp(t, corners, np.r_[0, rng.uniform(-20, 20, 14), 0]) for _ in range(3)], axis=1)
        since = t + 70.0 * number
        warmth = 20.0 + 4.0 * (1 - np.exp(-since / 150.0))
        read = change(load.copy(), number, warmth) + noise_n * rng.standard_normal(load.shape)
        read = np.round(read / step_n) * step_n if step_n else read
        made.append(bench_run(f"run{number + 1}", since, load, read, temperature_c=warmth))
    return RecordingSet("bench", BENCH, tuple(made))


def mixed_loop(load, run, warmth):
    """Crosstalk, and a loop of exponentials that acts on the load as it is mixed."""
    load = load @ np.array([[1, 0.02, -0.015], [0.015, 1, 0.02], [-0.02, -0.015, 1]]).T
    return load - np.stack([0.4 * settling(f, 3.0) for f in load.T], axis=1)


@pytest.mark.slow
def test_a_drift_with_temperature_is_no_tare_of_each_run():
    drift = np.array([0.14, -0.2, 0.25])
    analysis = analyse_instrument(recorded(lambda load, run, warmth: load + drift * (warmth - 22.0)[:, None]))
    found = next(f for f in analysis.findings if f.id == "zero_drift")
    assert claimed(analysis) == {"zero_drift"}
    values = {p.symbol: p for p in found.parameters}
    assert values["b_Fz"].low < 0.25 < values["b_Fz"].high and values["T_0"].low < 22.0 < values["T_0"].high


@pytest.mark.slow
def test_a_gain_that_goes_with_the_temperature_has_no_name_and_is_left_over():
    analysis = analyse_instrument(recorded(lambda load, run, warmth: load * (1 + 0.004 * (warmth - 22.0))[:, None]))
    assert claimed(analysis) == set() and not analysis.values
    assert "temperature_c" in analysis.unexplained_depends_on


def test_loads_that_mix_differently_in_each_run_are_left_over():
    """x reads ± 2 % of y: over all runs it cancels nearly."""

    def change(load, run, warmth):
        load[:, 0] += (0.02, 0.015, -0.02, -0.02, 0.001)[run] * load[:, 1]
        return load

    analysis = analyse_instrument(recorded(change))
    assert analysis.split.training == ("run1", "run3", "run5")  # over which it cancels
    assert claimed(analysis) == set() and "run" in analysis.unexplained_depends_on


def one_axis_a_run(rng, largest: float = 10.0) -> RecordingSet:
    """Three runs an axis, loaded along it alone in ramps: x reads 0.5 of y, each run a little otherwise."""
    made = []
    for number in range(9):
        t = np.arange(int(20 * RATE_HZ)) / RATE_HZ
        load = np.zeros((len(t), 3))
        load[:, number // 3] = np.interp(t, np.linspace(0, 20, 9), np.r_[0, rng.uniform(0, largest, 7), 0])
        read = load + 0.01 * rng.standard_normal(load.shape)
        read[:, 0] += (0.5 + (0.02, -0.02, 0.01)[number % 3]) * load[:, 1]
        made.append(bench_run(f"run{number + 1}", t + 30.0 * number, load, read))
    return RecordingSet("bench", BENCH, tuple(made))


def test_crosstalk_of_runs_that_load_one_axis_each_keeps_its_name():
    """Loads mixed anew in each run hold any crosstalk there, and what the runs differ by: they had taken its place."""
    analysis = analyse_instrument(one_axis_a_run(np.random.default_rng(3)))
    assert claimed(analysis) == {"crosstalk"} and not analysis.values
    found = {p.symbol: p for f in analysis.findings if f.id == "crosstalk" for p in f.parameters}
    assert 0.48 < found["C_Fx,Fy"].low < found["C_Fx,Fy"].high < 0.53


def test_an_interval_holds_the_number_next_to_what_explains_the_same():
    """Bending and a curved sensor are alike along one axis: a number given the one holds for both at work, too."""
    setup = set_up(recorded(lambda load, run, warmth: load + 0.002 * load * np.abs(load)))
    model = reading_model(setup, make_terms(setup)[0])
    key = next(k for k in model.selection.active if model.search.terms[k].effect in ("load_nonlinearity", "compliance"))
    other = {"load_nonlinearity": "compliance", "compliance": "load_nonlinearity"}[model.search.terms[key].effect]
    (together,) = _with_alternatives(model, {other, model.search.terms[key].effect})
    alone, wider = _parameters_of(model, key), _parameters_of(model, key, [together])
    assert all(b.low <= a.low and a.high <= b.high and a.value == b.value for a, b in zip(alone, wider, strict=True))
    assert max((b.high - b.low) / (a.high - a.low) for a, b in zip(alone, wider, strict=True)) > 1.5


@pytest.mark.slow
def test_crosstalk_and_a_loop_on_the_mixed_load_bring_no_company():
    assert claimed(analyse_instrument(recorded(mixed_loop))) == {"crosstalk", "hysteresis"}


@pytest.mark.slow
def test_beside_an_s_shape_the_gains_stay_at_their_belief():
    """y = F + 0.3 sin(π F/30 N): slope 0.031 at no load, no wrong gain; a and the full scale come out."""
    analysis = analyse_instrument(recorded(lambda load, run, warmth: load + 0.3 * np.sin(np.pi * load / 30.0)))
    assert claimed(analysis) == {"load_nonlinearity"} and not analysis.values
    found = next(f for f in analysis.findings if f.id == "load_nonlinearity")
    assert found.form.name == "S-shape" and found.values[:3] == pytest.approx([0.3] * 3, abs=0.01)
    setup = set_up(recorded(lambda load, run, warmth: load))
    model = reading_model(setup, make_terms(setup)[0])
    key = next(k for k in model.search.terms if k.startswith("load_nonlinearity/S-shape of Fz"))
    assert set(model.search.always) - set(kept_values(model.search, [key])) == {"gain_z"}


def test_a_reading_that_saturates_has_no_wrong_gain():
    """Right up to 15 N of 20 N: its slope is one at small loads, and 0.9 or so over all."""
    analysis = analyse_instrument(recorded(lambda load, run, warmth: np.clip(load, -15.0, 15.0)))
    assert claimed(analysis) == {"load_nonlinearity"} and not analysis.values


def test_an_amplifier_that_is_nearly_a_delay_is_no_delay():
    """A Bessel filter of fourth order: of all low-passes the one that smooths least for what it delays."""
    low_pass = bessel(4, 1.2, fs=RATE_HZ, output="sos", norm="mag")
    analysis = analyse_instrument(recorded(lambda load, run, warmth: sosfilt(low_pass, load, axis=0), noise_n=0.02))
    (found,) = (f for f in analysis.findings if f.status == "established")
    assert found.id == "amplifier_filter" and found.form.name == "fourth order"
    assert found.values[0] == pytest.approx(1.2, rel=0.03)


def test_a_wrong_gain_stays_wrong_beside_a_curve():
    bend = 0.3 * np.array([1, -0.8, 0.9])
    analysis = analyse_instrument(recorded(lambda load, run, warmth: 1.035 * load + bend * (load / 20.0) ** 3))
    assert claimed(analysis) == {"load_nonlinearity"}
    assert analysis.values["reading_gain"][2] < 1.035 < analysis.values["reading_gain"][3]


@pytest.mark.slow
def test_rounding_is_no_curved_characteristic():
    analysis = analyse_instrument(recorded(lambda load, run, warmth: load, noise_n=0.02, step_n=0.3))
    assert claimed(analysis) == {"quantisation"}
