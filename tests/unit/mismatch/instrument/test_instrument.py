"""Effects of stands and benches: each recovers its own parameters, is nothing without a load, and is named alone."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import Motion
from rotorid.effects.loading import InstrumentFacts, Loading, at_sensor, forms_of, rotation_of, weight
from rotorid.mismatch.deliver.files import read_instruments
from rotorid.mismatch.evidence.rows import Rows, form_reading
from rotorid.mismatch.instrument.analyse import analyse_instrument
from rotorid.mismatch.instrument.mistakes import find_mistakes
from rotorid.mismatch.instrument.model import size_of_columns, value_column
from rotorid.mismatch.instrument.sampling import step_of
from rotorid.mismatch.instrument.setup import set_up
from rotorid.recordings import RecordingSet, Run, Vehicle, read_vehicle
from rotorid.report.deliver import deliver
from tests.refusals import refused
from tests.unit.mismatch.instrument.stands import BENCH, bench_run, claimed, stand_vehicle

NEW = (
    *("zero_drift", "creep", "hysteresis", "load_nonlinearity", "crosstalk", "tare_offset", "cable_stiffness"),
    *("structural_resonance", "mount_tilt", "wall_interference", "amplifier_filter", "sensor_origin", "compliance"),
    *("clock_skew", "com_offset", "delay"),
)
RATE_HZ = 50.0


def stand_loading(vehicle: Vehicle, seconds: float = 30.0, tilt=(0.2, -0.1), seed: int = 0) -> Loading:
    """Rotor speeds that rise and fall, on a tilted mount."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(seconds * RATE_HZ)) / RATE_HZ
    level = np.interp(t, np.linspace(0, seconds, 9), [0, 0.3, 0.6, 0.9, 1, 0.7, 0.4, 0.2, 0])
    wave = 0.1 * level[:, None] * np.sin(2 * np.pi * rng.uniform(0.3, 3.0, 4) * t[:, None])
    speed = 1400 * (level[:, None] + wave) * rng.uniform(0.9, 1.1, 4)
    roll, pitch = np.full(len(t), tilt[0]), np.full(len(t), tilt[1])
    motion = Motion(time_s=t, rotor_speed=speed, rotation=rotation_of(roll, pitch))
    motion = replace(motion, rotor_acceleration=np.gradient(speed, 1 / RATE_HZ, axis=0))
    thrust = -(vehicle.thrust_coefficients_n_s2() * speed**2)
    force, moment = np.zeros((len(t), 3)), np.zeros((len(t), 3))
    force[:, 2] = thrust.sum(axis=1)
    hubs = vehicle.rotor_positions_m()
    moment[:, 0], moment[:, 1] = thrust @ hubs[:, 1], -thrust @ hubs[:, 0]
    heavy = weight(motion, vehicle)
    load = at_sensor(force, moment, motion, vehicle) + heavy
    warmth = 20 + 1e-2 * t
    return Loading("a", t, t, load, load, heavy[0], motion, (roll, pitch), 1e-2 * t, warmth, session_time_s=t + 100.0)


def instrument_for(loading: Loading, vehicle: Vehicle) -> InstrumentFacts:
    largest = tuple(np.abs(loading.load - loading.rest).max(axis=0))
    every = (0, 1, 2, 3, 4, 5)
    span = float(loading.time_s[-1])
    return InstrumentFacts(
        vehicle=vehicle, channels=every, loaded=every, rate_hz=RATE_HZ, duration_s=span, run_s=span, runs=("a",),
        largest=largest, tilts=True, returns=every, temperature=True, temperatures_c=(20.0, 20.3),
        first_temperature_c=20.0, session_s=200.0, session_clock=True,
    )  # fmt: skip


def bench_instrument():
    return replace(instrument_for(stand_loading(stand_vehicle()), stand_vehicle()), vehicle=BENCH)


def forms():
    vehicle = stand_vehicle()
    instrument, bench = instrument_for(stand_loading(vehicle), vehicle), bench_instrument()
    of = {key: bench if key == "compliance" else instrument for key in NEW}
    return [(key, form) for key in NEW for form in forms_of(catalogue()[key], of[key])]


@pytest.mark.parametrize(("key", "form"), forms(), ids=lambda x: getattr(x, "name", x))
def test_a_form_of_an_instrument_is_linear_and_recovers_its_own_parameters(key, form):
    vehicle = stand_vehicle()
    loading = stand_loading(vehicle)
    rng = np.random.default_rng(3)
    values = np.array([p.starts[0] if p.nonlinear else rng.uniform(0.5, 1.0) * 1e-2 for p in form.parameters])
    reading = form_reading(form, values, loading, vehicle)
    assert reading.shape == (loading.size, 6) and np.isfinite(reading).all()
    assert np.abs(reading).max() > 0
    columns = []
    for i in form.linear:
        unit = values.copy()
        unit[list(form.linear)] = 0.0
        unit[i] = 1.0
        columns.append(form_reading(form, unit, loading, vehicle).ravel())
    if not columns:
        return
    found, *_ = np.linalg.lstsq(np.stack(columns, axis=1), reading.ravel(), rcond=None)
    # Two plays, or pitch and roll that never vary within one run, may be one column: what they add up to must agree.
    assert np.allclose(np.stack(columns, axis=1) @ found, reading.ravel(), atol=1e-9 * np.abs(reading).max())


WITHOUT_A_LOAD = ("tare_offset", "zero_drift", "com_offset", "cable_stiffness")


@pytest.mark.parametrize("key", [k for k in NEW if k not in WITHOUT_A_LOAD])
def test_an_effect_of_the_reading_is_nothing_without_a_load(key):
    vehicle = stand_vehicle()
    loading = stand_loading(vehicle)
    still = replace(loading, load=np.zeros_like(loading.load), rest=np.zeros(6))
    still = replace(still, motion=replace(loading.motion, rotor_speed=np.zeros_like(loading.motion.rotor_speed)))
    for form in forms_of(catalogue()[key], instrument_for(loading, vehicle)):
        if form.name == "vehicle on the mount":
            continue  # its load is the weight, which is there all the same
        values = np.array([p.starts[0] if p.nonlinear else 0.01 for p in form.parameters])
        assert np.abs(form_reading(form, values, still, vehicle)).max() < 1e-12


def test_every_new_effect_states_source_sentence_and_what_would_separate_it():
    for key in (*NEW, "quantisation"):
        effect = catalogue()[key]
        assert effect.source and effect.sentence and effect.separating_manoeuvre, key


def test_a_weight_under_tilt_is_read_in_level_axes_and_its_moment_by_hand():
    vehicle = stand_vehicle()
    roll = np.full(2, np.radians(30.0))
    motion = Motion(time_s=np.arange(2.0), rotor_speed=np.zeros((2, 4)), rotation=rotation_of(roll, 0 * roll))
    # Level sensor: the weight pulls straight down. The mass is 0.05 m above the sensor along the leaning body axis:
    # arm = R (0, 0, −0.05) = (0, 0.05 sin 30°, −0.05 cos 30°), moment = arm × (0, 0, 6.3765).
    assert np.allclose(weight(motion, vehicle)[0], [0, 0, 6.3765, 0.025 * 6.3765, 0, 0], atol=1e-9)
    tilting = weight(motion, stand_vehicle(sensor_mount="tilting"))[0]
    assert np.allclose(tilting[:3], [0, 6.3765 * 0.5, 6.3765 * np.sqrt(0.75)], atol=1e-9)


def test_a_change_of_mass_is_the_weight():
    vehicle = stand_vehicle()
    loading = stand_loading(vehicle)
    heavier = vehicle.model_copy(update={"mass_kg": vehicle.mass_kg * 1.1})
    change = weight(loading.motion, heavier) - weight(loading.motion, vehicle)
    assert np.allclose(0.1 * value_column("mass", loading, vehicle), change)


def test_steps_of_a_reading():
    rng = np.random.default_rng(0)
    assert step_of(np.round(rng.normal(size=3000) / 0.1) * 0.1) == pytest.approx(0.1, rel=1e-6)
    assert step_of(rng.normal(size=3000)) == 0.0


def bench_set(change=lambda f: f, runs: int = 4, seed: int = 0, noise_n: float = 0.01) -> RecordingSet:
    """A bench loaded along x, y and z at once, in steps up and down."""
    rng = np.random.default_rng(seed)
    made = []
    for number in range(runs):
        t = np.arange(int(30 * RATE_HZ)) / RATE_HZ
        corners = np.linspace(0, 30, 13)
        load = np.stack([np.interp(t, corners, np.r_[0, rng.uniform(-8, 8, 11), 0]) for _ in range(3)], axis=1)
        read = change(load.copy()) + noise_n * rng.standard_normal(load.shape)
        made.append(bench_run(f"run{number + 1}", t, load, read))
    return RecordingSet("bench", BENCH, tuple(made))


def test_a_bench_without_a_fault_has_none():
    analysis = analyse_instrument(bench_set())
    assert claimed(analysis) == set() and not analysis.values


def crosstalk(load: np.ndarray) -> np.ndarray:
    """Two per cent of the load along z read along x as well."""
    load[:, 0] += 0.02 * load[:, 2]
    return load


def test_crosstalk_of_a_bench_with_its_number():
    analysis = analyse_instrument(bench_set(crosstalk, seed=1))
    found = next(f for f in analysis.findings if f.id == "crosstalk")
    assert found.status == "established" and claimed(analysis) == {"crosstalk"}
    estimate = next(e for e in found.parameters if e.symbol == "C_Fx,Fz")
    assert estimate.low < 0.02 < estimate.high and estimate.high - estimate.low < 0.001


def test_a_wrong_gain_is_a_value_and_no_effect():
    analysis = analyse_instrument(bench_set(lambda load: 1.04 * load))
    assert claimed(analysis) == set()
    believed, refitted, low, high = analysis.values["reading_gain"]
    assert believed == 1.0 and low < 1.04 < high


def test_a_flipped_channel_is_named_and_turned_round():
    corrected, findings, _ = find_mistakes(bench_set(lambda load: load * [1.0, -1.0, 1.0]))
    assert [f.id for f in findings] == ["axis_sign"] and findings[0].channels == ("force_y",)
    run = corrected.runs[0]
    assert np.corrcoef(run.column("force_y_n"), run.column("reference_force_y_n"))[0, 1] > 0.99


def test_gram_force_is_recognised():
    _, findings, _ = find_mistakes(bench_set(lambda load: 101.972 * load, noise_n=1.0))
    assert [f.id for f in findings] == ["unit_error"] and "gf" in findings[0].sentence


def test_nothing_to_compare_is_one_sentence():
    run = Run("a", pd.DataFrame({"time_s": np.arange(10.0), "force_x_n": np.zeros(10)}))
    said = "no force or moment is recorded in every run together with its reference"
    refused(said, set_up, RecordingSet("b", BENCH, (run,)))


def test_the_files_of_a_bench_hold_its_model(tmp_path):
    verdict = deliver(bench_set(lambda load: 1.03 * load + np.array([0.05, 0.0, -0.05])), tmp_path)
    assert verdict.kind == "bench" and verdict.verdict == "explained"
    assert {e.id for e in verdict.effects if e.status == "established"} == {"tare_offset"}
    errors = verdict.channels["force_x"].rmse.held_out
    assert errors.after < 0.012 < 0.05 < errors.before
    written = read_vehicle(tmp_path / "improved_vehicle.yaml")
    assert written.reading_gain == pytest.approx((1.03, 1.03, 1.03), abs=0.002)
    assert written.effects == ()
    errors_found = read_instruments(tmp_path / "instruments.yaml").instruments
    assert [(e.id, e.form) for e in errors_found] == [("tare_offset", "constant")]
    assert not (tmp_path / "conditions.yaml").exists()
    assert "flight" not in verdict.sentence


def test_a_load_along_two_axes_is_turned_by_what_bends():
    """F = (3, 0, 4) N with b 0.01, e_y 0.02 rad/N: θ_y = 0.03 + 0.08 = 0.11, θ × F = (0.44, 0, −0.33) N."""
    form = next(f for f in forms_of(catalogue()["compliance"], bench_instrument()) if f.name == "turning")
    loading = stand_loading(stand_vehicle())
    loading = replace(loading, load=np.tile([3.0, 0, 4, 0, 0, 0], (loading.size, 1)))
    reading = form_reading(form, np.array([0.01, 0.05, 0.02]), loading, stand_vehicle())
    # θ_x = 0.05 · 4 = 0.2 turns the vertical force sideways: −0.2 · 4 along y.
    np.testing.assert_allclose(reading[0, :3], [0.44, -0.8, -0.33], atol=1e-12)


def test_what_shows_in_few_seconds_has_the_size_of_the_strongest_tenth() -> None:
    """Before: a filter that shows after a change of load, in fewer than a tenth of the seconds, had no size."""
    per, seconds = 50, 100
    column = np.zeros((per * seconds, 6, 1))
    column[: 5 * per, 2, 0] = 1.0
    rows = [Rows("r", np.arange(len(column)) / per, np.zeros((len(column), 6)), column)]
    size = size_of_columns(rows, np.full(6, 0.1), per)(np.array([0]), np.array([2.0]))
    assert size == pytest.approx([0, 0, 2.0 / 0.1 * np.sqrt(0.5), 0, 0, 0])


@pytest.mark.parametrize("every", [2, 5])
def test_readings_slower_than_rows_are_taken_at_their_own_rate(every: int) -> None:
    whole = bench_set()
    runs = []
    for run in whole.runs:
        forces = [n for n in run.table if n.startswith("force")]
        table = run.table.copy()
        table.loc[np.arange(len(table)) % every != 1, forces] = np.nan
        runs.append(Run(run.name, table))
    setup, known = set_up(replace(whole, runs=tuple(runs))), set_up(whole)
    assert setup.instrument.rate_hz == pytest.approx(known.instrument.rate_hz / every, rel=1e-3)
    assert sum(x.size for x in setup.loadings) == pytest.approx(sum(x.size for x in known.loadings) / every, rel=0.02)


@pytest.mark.parametrize("hole", [slice(0, 500), slice(300, 800), slice(-500, None)])
def test_a_hole_of_what_drives_the_model_is_no_straight_line(hole: slice) -> None:
    whole = bench_set(runs=1)
    table = whole.runs[0].table.copy()
    lost = table.index[hole]
    table.loc[lost, [n for n in table if n.startswith("reference")]] = np.nan
    table.loc[table.index[50], [n for n in table if n.startswith("reference")]] = np.nan  # a cell is joined
    setup = set_up(replace(whole, runs=(Run("r", table),)))
    at = np.concatenate([x.time_s if x.keep is None else x.time_s[x.keep] for x in setup.loadings])
    inside = (at > table.time_s[lost[0]]) & (at < table.time_s[lost[-1]])
    assert not inside.any() and len(at) > 0.9 * (len(table) - len(lost))
