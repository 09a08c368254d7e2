"""What the analysis works on: the split, the noise measured from the data, the terms a set can test. What is made of
a motion is made again only where something changed that it is made of. What is fitted where rotor speeds are
known from their commands alone.
"""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import rotorid.mismatch.flight.prepare as module
from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import Motion
from rotorid.mismatch.evidence.rows import form_terms
from rotorid.mismatch.evidence.speedpath import CommandChain, SpeedFit, SpeedResult
from rotorid.mismatch.evidence.split import GAP_S, training_rule
from rotorid.mismatch.flight.fitted import known_by_commands
from rotorid.mismatch.flight.prepare import (
    DEFAULT_TRUST,
    LastMade,
    make_terms,
    prepare,
    prior_of,
    representative,
    sensor_noise,
    split_runs,
    white_level,
    with_predictions,
    with_thrusts,
)
from rotorid.recordings import RecordingSet, Run, Split
from rotorid.recordings import columns as c
from tests.unit.mismatch.evidence.test_speedpath import form
from tests.unit.mismatch.flights import COLUMNS, quad, recorded, with_table


def set_of(*names: str, held_out=None) -> RecordingSet:
    table = pd.DataFrame({"time_s": [0.0, 1.0]})
    return RecordingSet("s", quad(), tuple(Run(n, table) for n in names), held_out)


def test_about_a_third_of_the_runs_is_held_out_spread_in_time():
    assert split_runs(set_of(*"abc")) == Split(("a", "c"), ("b",))
    assert split_runs(set_of(*"abcdef")) == Split(("a", "c", "d", "f"), ("b", "e"))
    assert split_runs(set_of("a", "b")) == Split(("a",), ("b",))
    assert split_runs(set_of(*"abc", held_out=("c",))) == Split(("a", "b"), ("c",))


def test_what_is_done_in_one_run_alone_is_fitted():
    """Two runs of a slow vehicle and one of a fast one: an effect of speed could be found nowhere else."""
    time_s = np.arange(0.0, 60.0, 0.1)

    def run(name, speed_m_s):
        columns = {k: speed_m_s * np.sin(time_s + i) for i, k in enumerate(c.VELOCITY)}
        return Run(name, pd.DataFrame({"time_s": time_s, **columns}))

    for fast in range(4):
        runs = tuple(run("abcd"[k], 6.0 if k == fast else 1.0) for k in range(4))
        assert "abcd"[fast] in split_runs(RecordingSet("s", quad(), runs)).training


def test_of_a_single_run_the_last_third_is_held_out_after_a_gap():
    split = split_runs(set_of("a"))
    assert split == Split(("a",), ("a",))
    time_s = set_of("a").runs[0].time_s
    rule = training_rule(split, [])
    border = split.border_s
    assert border == pytest.approx(time_s[0] + (time_s[-1] - time_s[0]) * 2 / 3)
    around = (-5, -GAP_S / 2 - 0.1, 0, GAP_S / 2 + 0.1, 5)
    assert [rule("a", border + dt) for dt in around] == [True, True, None, False, False]


def test_of_several_runs_whole_ones_are_held_out():
    rule = training_rule(Split(("a", "c"), ("b",)), [])
    assert [rule(name, 1.0) for name in "abc"] == [True, False, True]


def test_the_white_part_of_a_signal_is_its_noise():
    """A slow swing of 3 with white noise of 0.2; without noise nothing is left.

    The lowest stretch of the spectrum is taken, so up to a tenth too little is read and never too much.
    """
    rng = np.random.default_rng(0)
    t = np.arange(8000) / 200.0
    swing = 3.0 * np.sin(2 * np.pi * 0.7 * t)
    assert 0.18 < white_level(swing + 0.2 * rng.standard_normal(8000), 200.0) < 0.205
    assert white_level(swing, 200.0) < 0.005
    assert white_level(np.full(10, np.nan), 200.0) == 0.0


def test_noise_that_a_sensor_smooths_away_at_the_top_is_read_below():
    """White noise of 0.2 through a mean of two samples: half its power at a quarter of the rate, none at half of it."""
    noise = 0.2 * np.random.default_rng(0).standard_normal(16001)
    smoothed = (noise[1:] + noise[:-1]) / 2
    assert white_level(smoothed, 400.0) < 0.02
    assert white_level(smoothed, 400.0, 60.0) == pytest.approx(0.2 * np.cos(np.pi * 60 / 400), rel=0.15)


def test_the_noise_is_measured_not_believed():
    recordings = recorded(1, 2, vehicle=quad(noise={"specific_force_m_s2": 5.0}))
    levels = sensor_noise(recordings.runs, recordings.vehicle)
    true = {"rotors": 5.0, "gyroscope": 0.012, "accelerometer": 0.12, "velocity": 0.02, "position": 0.001}
    for sensor, level in true.items():
        assert np.median(levels[sensor]) == pytest.approx(level, rel=0.12), sensor


def test_each_axis_has_its_own_noise_and_rotors_are_alike():
    """Rotors shake the roll axis alone: yaw, which hardly turns, is read with the gyroscope's own small noise."""
    rng = np.random.default_rng(5)

    def shaken(table):
        name = c.ANGULAR_VELOCITY[0]
        return table.assign(**{name: table[name] + 0.06 * rng.standard_normal(len(table))})

    recordings = recorded(1, 2)
    calm, loud = (sensor_noise(r.runs, r.vehicle) for r in (recordings, with_table(recordings, shaken)))
    assert loud["gyroscope"][0] == pytest.approx(np.hypot(0.06, calm["gyroscope"][0]), rel=0.12)
    np.testing.assert_allclose(loud["gyroscope"][1:], calm["gyroscope"][1:], rtol=1e-9)
    assert np.ptp(loud["rotors"]) == 0.0


def test_trust_of_the_user_or_else_a_default():
    vehicle = quad(trust={"mass_kg": 0.002, "inertia_kg_m2": 0.3, "inertia_zz_kg_m2": 0.4})
    assert prior_of("mass", vehicle) == 0.002
    assert (prior_of("inertia_xx", vehicle), prior_of("inertia_zz", vehicle)) == (0.3, 0.4)
    assert prior_of("thrust", vehicle) == DEFAULT_TRUST["thrust"]


def test_terms_are_what_the_columns_allow_and_the_rest_says_why():
    full = prepare(recorded(1))
    keys = {t.key for t in full.terms}
    assert {"thrust", "torque", "mass", "inertia_zz", "arm"} <= keys
    assert {"rotor_drag/at the hubs", "accelerometer_error/bias", "gyro_error/scale"} <= keys
    assert full.not_testable["ground_effect"] == "no height above ground"
    assert "rotor_drag" not in full.not_testable

    def blind(table):
        return table.drop(columns=[n for s in ("velocity", "position", "attitude") for n in COLUMNS[s]])

    inertial = prepare(with_table(recorded(1), blind))
    keys = {t.key for t in inertial.terms}
    assert inertial.groups == ("force", "moment")
    assert not any(k.startswith(("rotor_drag/", "gyro_error/", "steady_wind/")) for k in keys)
    assert inertial.not_testable["rotor_drag"] == "no velocity or position recorded"
    assert inertial.not_testable["steady_wind"] == "no attitude recorded"
    assert "thrust_tilt/all rotors, at the hubs" in keys


def test_each_start_of_a_nonlinear_parameter_is_a_term():
    forms = {f.name: f for f in catalogue()["ground_effect"].forms(quad(rotor_radius_m=0.06))}
    terms = form_terms("ground_effect", forms["exponential"])
    # a is linear and free, b starts at 0.3 and 1 over the radius.
    assert [t.values for t in terms] == [(0.0, 0.3 / 0.06), (0.0, 1.0 / 0.06)]
    assert [t.key for t in terms] == ["ground_effect/exponential#0", "ground_effect/exponential#1"]
    assert [t.size for t in form_terms("ground_effect", forms["image rotor"])] == [1, 1, 1]
    assert [t.size for t in form_terms("ground_effect", forms["inverse square"])] == [1]


def test_a_form_needs_its_rotors():
    one = quad(rotors=[{"x_m": 0.0, "y_m": 0.0, "spin": "ccw"}])
    (segment,) = prepare(recorded(1)).segments
    motion = replace(segment.motion, rotor_speed=segment.motion.rotor_speed[:, :1])
    terms, reasons = make_terms(one, [replace(segment, motion=motion)], ("force", "moment"))
    assert reasons["rotor_interference"] == "needs at least 3 rotors"
    assert not any(t.effect == "unequal_rotors" for t in terms)


def test_a_long_recording_is_represented_by_pieces_of_all_its_runs(monkeypatch):
    """Three runs of 25 s at 200 Hz in pieces of 8 s: five of nine are 41 s, whether seconds or samples are too many."""
    runs = recorded(1, 2, 3).runs
    assert representative(runs, 100.0) == list(runs)
    monkeypatch.setattr("rotorid.mismatch.flight.prepare._PIECE_S", 8.0)
    cut = representative(runs, 2400.0)
    assert [r.name for r in cut] == ["run00", "run00", "run01", "run02", "run02"]
    monkeypatch.setattr("rotorid.mismatch.flight.prepare.MOST_S", 41.0)
    assert [r.time_s[0] for r in representative(runs, 1.0)] == [r.time_s[0] for r in cut]
    assert cut[0].table.equals(runs[0].table[:1667]) and cut[-1].time_s[-1] == runs[2].time_s[-1]


def test_predicted_accelerations_hold_no_measured_ones():
    """A payload reads accelerations: what it does to the predicted ones is found from predicted ones."""
    prepared = prepare(recorded(1, 2))
    rigid = next(f for f in catalogue()["payload"].forms(prepared.vehicle) if f.name == "rigid")
    effects = [(rigid, np.array([0.1 * prepared.vehicle.mass_kg, 0.0, 0.0, 0.0]))]
    own = prepared.segments[0]
    noisy = replace(own, motion=replace(own.motion, specific_force=own.motion.specific_force + 5.0))
    alone, loaded, again = (
        with_predictions(s, prepared, known).motion.specific_force
        for s, known in ((own, []), (own, effects), (noisy, effects))
    )
    np.testing.assert_allclose(loaded, 0.9 * alone)
    np.testing.assert_allclose(again, loaded)


def test_thrusts_of_a_comparison_are_what_effects_leave_of_them():
    """Rotors that all push with a tenth less lean with a tenth less; under a payload they push as before."""
    prepared = prepare(recorded(1, 2))
    vehicle, motion = prepared.vehicle, prepared.segments[0].motion
    forms = {effect: catalogue()[effect].forms(vehicle) for effect in ("thrust_curve", "payload", "thrust_tilt")}
    curve = next(f for f in forms["thrust_curve"] if f.name == "constant term")
    rigid = next(f for f in forms["payload"] if f.name == "rigid")
    believed = vehicle.thrust_coefficients_n_s2() * motion.rotor_speed**2
    loaded = with_thrusts(motion, vehicle, [(rigid, np.array([0.1, 0.0, 0.0, 0.0]))])
    np.testing.assert_allclose(loaded.rotor_thrust, believed)
    less = 0.1 * believed.sum(axis=1).mean() / vehicle.rotor_count
    weaker = with_thrusts(motion, vehicle, [(curve, np.array([-less]))])
    share = 1.0 - vehicle.rotor_count * less / believed.sum(axis=1)
    np.testing.assert_allclose(weaker.rotor_thrust, believed * share[:, None])
    tilt = next(f for f in forms["thrust_tilt"] if "centre" in f.name)
    sideways = tilt.contribution(weaker, vehicle, np.array([0.01, 0.0])).force[:, 0]
    np.testing.assert_allclose(sideways, 0.01 * share * believed.sum(axis=1))


def flown(size: int = 50) -> Motion:
    """A motion that has what the maker reads."""
    rng = np.random.default_rng(1)
    level, velocity = np.tile(np.eye(3), (size, 1, 1)), rng.standard_normal((size, 3))
    return Motion(np.arange(size) / 50, np.full((size, 4), 500.0), velocity=velocity, rotation=level)


@pytest.fixture
def counted():
    """A maker that counts how often it is asked: the force of the air on a plate, and its half."""
    asked = []

    def make(motion):
        asked.append(motion)
        return [{"force": motion.air_velocity**2}]

    return make, asked


def test_only_what_was_read_counts(counted):
    make, asked = counted
    motion, memory = flown(), LastMade()
    first = memory.made(("plate",), (1.0,), motion, make)
    again = memory.made(("plate",), (1.0,), replace(motion, angular_acceleration=np.ones((motion.size, 3))), make)
    assert again is first and len(asked) == 1
    blown = memory.made(("plate",), (1.0,), replace(motion, wind=np.array([3.0, 0.0, 0.0])), make)
    assert len(asked) == 2 and not np.allclose(blown[0]["force"], first[0]["force"])


def test_other_values_are_made_anew_and_take_the_place_of_the_first(counted):
    make, asked = counted
    motion, memory = flown(), LastMade()
    for value in (1.0, 2.0, 2.0, 1.0):
        memory.made(("plate",), (value,), motion, make)
    assert len(asked) == 3 and len(memory.kept) == 1
    assert memory.size == asked[0].air_velocity.nbytes


def test_what_was_made_first_is_forgotten_first(counted, monkeypatch):
    make, asked = counted
    motion, memory = flown(), LastMade()
    monkeypatch.setattr(module, "MOST_BYTES", 2.5 * motion.velocity.nbytes)
    for key in ("a", "b", "c", "c", "b", "a"):
        memory.made((key,), (), motion, make)
    assert len(asked) == 4 and memory.size <= module.MOST_BYTES


def chain_of(effect_id: str, name: str, values, sd: float = 1e-4) -> CommandChain:
    """A chain of one form, its values known to `sd`."""
    made = form(effect_id, name)
    known = sd**2 * np.eye(len(made.parameters))
    fit = SpeedFit(((effect_id, made),), np.array(values, float), {"late": 0.0}, 0.0, covariance=known)
    return CommandChain(SpeedResult(fit, {}, {}), 2500.0, None)


def test_commands_alone_show_no_curve_of_the_thrust_and_where_they_follow_the_motion_no_gain_of_moments():
    prepared = prepare(recorded(1, flight={"duration_s": 10.0}))
    keys = {t.key for t in prepared.terms}
    turned = known_by_commands(prepared, chain_of("motor_lag", "one constant", (0.05,)))
    assert {t.effect for t in prepared.terms} - {t.effect for t in turned.terms} == {"thrust_curve"}
    assert "throttle" in turned.not_testable["thrust_curve"]
    chain = chain_of("motor_lag", "one constant", (0.05,))
    answering = chain._replace(result=replace(chain.result, turned_by_commands=False))
    left = known_by_commands(prepared, answering)
    gone = keys - {t.key for t in left.terms}
    assert {"arm", "torque", "inertia_xx", "inertia_yy", "inertia_zz"} <= gone
    assert "com_offset" in {t.effect for t in left.terms} and "rotational_damping" in left.not_testable


@pytest.mark.parametrize("groups", [("force", "moment"), ("moment",), ("force",)])
def test_commands_alone_know_neither_thrust_nor_mass_but_what_the_moments_say_of_what_they_lift(groups):
    keys = {t.key: t.kind for t in module.value_terms(quad(), groups, commanded=True)}
    assert not {"thrust", "mass"} & keys.keys()
    assert keys.get("lifted") == ("held" if len(groups) == 2 else None)
