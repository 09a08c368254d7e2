"""Mistakes in a set are found, named with the right correction and undone; sound sets are left alone."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from rotorid.mismatch.mistakes import dropout, find_mistakes, lagged
from rotorid.mismatch.mistakes.lagged import Blocks
from rotorid.mismatch.mistakes.timing import Lateness, in_agreement, one_quantity
from rotorid.recordings import RecordingSet, Run, Vehicle, read_set
from rotorid.recordings.held import SHORTEST_FREEZE_PERIODS, SHORTEST_FREEZE_S
from rotorid.recordings.signal.kernels import gaussian
from rotorid_proof.concealed import build as concealed
from rotorid_proof.concealed import cases
from tests.unit.mismatch.flights import COLUMNS, controlled, quad, recorded, with_table


@pytest.fixture(scope="module")
def sound() -> RecordingSet:
    """Two runs without a mistake."""
    return recorded(1, 2)


@pytest.fixture(scope="module")
def short() -> RecordingSet:
    """Four runs of nine seconds, each too short to be judged by its own blocks of spectra."""
    return recorded(61, 62, 63, 64, flight={"duration_s": 9.0})


def ids(findings) -> list[str]:
    return [f.id for f in findings]


def one(findings, name: str):
    (finding,) = findings
    assert finding.id == name and finding.status == "established" and finding.p_value < 1e-6
    return finding


def column(recordings: RecordingSet, name: str) -> np.ndarray:
    return np.concatenate([run.column(name) for run in recordings.runs])


ROTORS, GYROSCOPE, ACCELEROMETER, VELOCITY = (
    list(COLUMNS[sensor]) for sensor in ("rotors", "gyroscope", "accelerometer", "velocity")
)
COMMANDS = {name: name.replace("speed", "command") for name in ROTORS}
ALL = [name for names in COLUMNS.values() for name in names]


def holding(names: list[str], others: list[str], sign=1.0):
    """A change of a table: columns `names` hold what `others` held, times a sign."""
    return lambda table: table.assign(**dict(zip(names, (table[others] * sign).to_numpy().T, strict=True)))


def assert_restored(fixed: RecordingSet, before: RecordingSet, names=ALL) -> None:
    for name in names:
        np.testing.assert_array_equal(column(fixed, name), column(before, name))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("rate_hz", [100.0, 250.0])
def test_a_sound_set_is_left_alone(seed, rate_hz):
    recordings = recorded(10 + seed, 20 + seed, rate_hz=rate_hz)
    fixed, findings, _ = find_mistakes(recordings)
    assert findings == ()
    for before, after in zip(recordings.runs, fixed.runs, strict=True):
        assert before.table.equals(after.table)


@pytest.mark.parametrize(
    "flown",
    [
        {"vehicle": quad(torque_coefficient_n_m_s2=1.8558e-8 * 1.2)},
        {"vehicle": quad(mass_kg=0.652 * 1.15)},
        {"vehicle": quad(thrust_coefficient_n_s2=1.3877e-6 * 0.8)},
        {"vehicle": quad(inertia_kg_m2={"xx": 2.489e-3 * 1.3, "yy": 2.5743e-3 * 0.8, "zz": 4.6838e-3})},
        {"flight": {"drag": 0.4}},
        {"flight": {"excitation": 0.02}},
        {"late_s": {"rotors": 0.003, "attitude": -0.002}},
    ],
    ids=[
        "torque", "mass", "thrust", "inertia", "strong drag", "hover that moves nothing",
        "late by less than a sample",
    ],
)  # fmt: skip
def test_wrong_values_effects_and_small_offsets_are_no_mistakes(flown):
    assert find_mistakes(recorded(3, 4, **flown))[1] == ()


@pytest.mark.parametrize(
    ("sensor", "factor", "word"),
    [
        ("rotors", 60 / (2 * np.pi), "rpm"), ("gyroscope", 180 / np.pi, "deg/s"), ("accelerometer", 1 / 9.80665, "g"),
        ("velocity", 100.0, "cm/s"), ("position", 1000.0, "mm"),
    ],
)  # fmt: skip
def test_units(sound, sensor, factor, word):
    names = list(COLUMNS[sensor])
    fixed, findings, _ = find_mistakes(with_table(sound, holding(names, names, factor)))
    finding = one(findings, "unit_error")
    assert f" hold {word}," in finding.sentence
    estimate = finding.parameters[0]
    # The unit's own factor; what the recording itself gives carries the believed values' error and is in the interval.
    assert estimate.value == pytest.approx(factor) and estimate.low < factor < estimate.high
    for name in names:
        assert column(fixed, name) == pytest.approx(column(sound, name), rel=1e-9)


@pytest.mark.parametrize(("unit", "make"), [("percent", lambda u: 100 * u), ("pulses", lambda u: 1000 + 1000 * u)])
def test_throttle_units(sound, unit, make):
    def to_throttle(table):
        for i, name in enumerate(ROTORS):
            table[f"throttle_{i + 1}"] = make(table.pop(name) / 2500.0)
        return table

    bad = replace(with_table(sound, to_throttle), vehicle=quad(rotor_speed_limits_rad_s=[0, 2500]))
    fixed, findings, _ = find_mistakes(bad)
    assert unit in one(findings, "unit_error").sentence
    assert column(fixed, "throttle_2") == pytest.approx(column(sound, "rotor_speed_2_rad_s") / 2500.0)


@pytest.mark.parametrize("name", [GYROSCOPE[0], GYROSCOPE[2], ACCELEROMETER[2], *VELOCITY[1:], COLUMNS["position"][0]])
def test_one_flipped_axis(sound, name):
    fixed, findings, _ = find_mistakes(with_table(sound, holding([name], [name], -1.0)))
    assert one(findings, "axis_sign").channels == (name,)
    assert_restored(fixed, sound)


IMAGINARY = list(COLUMNS["attitude"][1:])


@pytest.mark.parametrize(
    ("mistake", "change", "said"),
    [
        # East-north-up instead of north-east-down.
        ("axis_sign", holding(VELOCITY, [VELOCITY[k] for k in (1, 0, 2)], [1, 1, -1]), ["x, y, z hold y, x, −z"]),
        ("axis_sign", holding(IMAGINARY, IMAGINARY, -1.0), ["conjugated"]),
        ("rotor_order", holding(ROTORS[1:3], ROTORS[2:0:-1]), [f"column {a} belongs to rotor {5 - a}" for a in (2, 3)]),
        ("rotor_order", holding(ROTORS, list(np.roll(ROTORS, 1))), []),
    ],
    ids=["axes of the velocity", "conjugated attitude", "two rotors", "rotors moved round by one"],
)
def test_exchanged_columns_are_named_and_exchanged_back(sound, mistake, change, said):
    fixed, findings, _ = find_mistakes(with_table(sound, change))
    sentence = one(findings, mistake).sentence
    assert all(words in sentence for words in said)
    assert_restored(fixed, sound)


@pytest.mark.parametrize(
    ("flights", "turned"), [("sound", (1,)), ("sound", (0, 1, 2, 3)), ("short", (0, 1, 2, 3))], ids=str
)
def test_turning_senses(request, flights, turned):
    flown = request.getfixturevalue(flights)
    other = {"ccw": "cw", "cw": "ccw"}
    rotors = tuple(
        r.model_copy(update={"spin": other[r.spin]}) if i in turned else r for i, r in enumerate(flown.vehicle.rotors)
    )
    fixed, findings, _ = find_mistakes(replace(flown, vehicle=flown.vehicle.model_copy(update={"rotors": rotors})))
    one(findings, "spin_direction")
    assert fixed.vehicle == flown.vehicle


@pytest.mark.parametrize(
    ("late_s", "sensors", "value", "word"),
    [
        ({"rotors": 0.012}, ("rotor_speed_1_rad_s",), 0.012, "late"),
        ({s: 0.0235 for s in ("gyroscope", "accelerometer")}, (ACCELEROMETER[0], GYROSCOPE[0]), 0.0235, "late"),
        ({"attitude": -0.02}, ("quaternion_w",), 0.02, "early"),
    ],
    ids=["rotors", "imu", "attitude"],
)
def test_delays(late_s, sensors, value, word):
    fixed, findings, _ = find_mistakes(recorded(31, 32, late_s=late_s))
    finding = one(findings, "delay")
    assert set(finding.channels) == set(sensors)
    estimate = finding.parameters[0]
    assert estimate.low <= value <= estimate.high and estimate.value == pytest.approx(value, abs=5e-4)
    assert f" ms {word} against" in finding.sentence
    assert find_mistakes(fixed)[1] == ()


@pytest.mark.parametrize("growth", [0.001, -0.006])
def test_a_drifting_clock(growth):
    fixed, findings, _ = find_mistakes(recorded(41, 42, growth={"rotors": growth}))
    finding = one(findings, "clock_skew")
    assert finding.channels == ("rotor_speed_1_rad_s",)
    assert finding.parameters[0].value == pytest.approx(growth, abs=6e-5)
    assert find_mistakes(fixed)[1] == ()


@pytest.mark.parametrize("kind", ["held", "zero", "missing"])
def test_dropouts(sound, kind):
    name = "rotor_speed_3_rad_s"

    def spoil(table):
        inside = (table["time_s"] >= 8.0) & (table["time_s"] <= 10.5)
        before = table.loc[table["time_s"] < 8.0, name].iloc[-1]
        table.loc[inside, name] = {"held": before, "zero": 0.0, "missing": np.nan}[kind]
        return table

    fixed, findings, _ = find_mistakes(with_table(sound, spoil))
    finding = one(findings, "sensor_dropout")
    assert kind in finding.sentence and finding.channels == (name,)
    assert [w[0] for w in finding.windows] == ["run00", "run01"]
    for _, start, stop in finding.windows:
        assert start == pytest.approx(8.0, abs=0.006) and stop == pytest.approx(10.5, abs=0.006)
    run = fixed.runs[0]
    inside = (run.time_s >= 8.0) & (run.time_s <= 10.5)
    assert np.isnan(run.column(name)[inside]).all() and np.isfinite(run.column(name)[~inside]).all()


@pytest.mark.parametrize("value", [0.0, None])
def test_a_rotor_that_stands_as_it_was_commanded_is_no_lost_sensor(sound, value):
    """A simulated rotor at its lower limit, and speeds that are a copy of commands which stand still."""

    def spoil(table, commanded):
        name, inside = "rotor_speed_3_rad_s", (table["time_s"] >= 8.0) & (table["time_s"] <= 8.6)
        table.loc[inside, name] = table.loc[table["time_s"] < 8.0, name].iloc[-1] if value is None else value
        return table.assign(**{COMMANDS[n]: table[n] for n in ROTORS}) if commanded else table

    def named(commanded):
        return {c for f in find_mistakes(with_table(sound, lambda t: spoil(t, commanded)))[1] for c in f.channels}

    assert named(False) == {"rotor_speed_3_rad_s"} and "rotor_speed_3_rad_s" not in named(True)


BENCH = Vehicle.model_validate({"name": "b", "kind": "bench", "tared": True})


def test_a_reading_held_at_zero_under_a_steady_load_dropped_out():
    """The load does not change there, but the reading is not what it makes; the first zero is none of its own."""
    rng = np.random.default_rng(4)
    load = np.repeat([0.0, 2.0, 4.0, 2.0, 0.0], 400)
    reading = np.round(load + 0.01 * rng.standard_normal(len(load)), 3)
    reading[900:1100] = 0.0
    table = {"time_s": np.arange(len(load)) / 100, "reference_force_x_n": load, "force_x_n": reading}
    fixed, finding = dropout.find(RecordingSet("b", BENCH, (Run("r", pd.DataFrame(table)),)))
    assert finding.windows == (("r", 9.0, 10.99),)
    assert np.flatnonzero(np.isnan(fixed.runs[0].column("force_x_n"))).tolist() == list(range(900, 1100))


@pytest.mark.parametrize(("drift", "went_on"), [(0.05, False), (0.4, True)])
def test_a_coarse_reading_stands_still_until_the_load_has_changed_by_a_step(drift, went_on):
    """Steps of 0.1 N: weights of whole steps leave next to no residual, and beside that half a step is plain."""
    weights = np.repeat(np.tile([0.0, 2.0, 4.0, 1.0, 3.0], 8), 100)
    load = np.concatenate([weights, 2.0 + np.linspace(0.0, drift, 500), weights])
    reading = np.round(load / 0.1) * 0.1
    reading[7::900] += 0.1
    held = np.zeros(len(load), bool)
    held[len(weights) : len(weights) + 500] = True
    reading[held] = 2.0
    run = Run("r", pd.DataFrame({"time_s": np.arange(len(load)) / 100, "reference_force_x_n": load}))
    assert dropout.load_went_on(run, BENCH, reading, held) is went_on


@pytest.mark.parametrize("phase", [0.0, 1.2])
def test_two_readings_of_one_quantity_tell_time_where_their_gain_is_one(phase):
    """Above 5 Hz one reading is mostly a noise of which the other holds a tenth, with a phase of its own."""
    rng = np.random.default_rng(5)
    frequency_hz = np.arange(1, 31) / 2.56
    shape = (40, len(frequency_hz), 1)
    moved, noise = (rng.standard_normal(shape) + 1j * rng.standard_normal(shape) for _ in range(2))
    size = np.where(frequency_hz > 5.0, 8.0, 0.0)[None, :, None]
    motion = moved / (1.0 + frequency_hz[None, :, None] ** 2)
    readings = motion + 0.1 * size * noise * np.exp(-1j * phase), motion + size * noise
    others = np.zeros((40, len(frequency_hz), 0), complex)
    narrow = one_quantity(Blocks(frequency_hz, *readings, others, np.zeros(40, int), np.arange(40.0)), [0])
    assert 2.0 < narrow.frequency_hz[-1] <= 5.3
    assert abs(lagged.fit(narrow).lag_s) < 1e-4


def test_a_sensor_that_freezes_for_a_tenth_of_a_second(sound):
    """All axes stand still at once, ten times: too short for one column alone, but no noise does that."""
    starts = np.arange(3.0, 12.0, 0.9)

    def spoil(table):
        for start in starts:
            inside = (table["time_s"] >= start) & (table["time_s"] < start + 0.1)
            table.loc[inside, ACCELEROMETER] = table.loc[table["time_s"] < start, ACCELEROMETER].iloc[-1].values
        return table

    fixed, findings, _ = find_mistakes(with_table(sound, spoil))
    finding = one(findings, "sensor_dropout")
    assert finding.channels == tuple(ACCELEROMETER) and "held" in finding.sentence
    assert len(finding.windows) == 2 * len(starts)
    for _, start, stop in finding.windows:
        assert np.abs(starts - start).min() < 0.011 and stop - start == pytest.approx(0.1, abs=0.011)
    blank = np.isnan(fixed.runs[0].array(ACCELEROMETER))
    assert blank.all(axis=1).sum() == blank.any(axis=1).sum() == pytest.approx(0.1 * len(starts) * 200, abs=len(starts))


def test_one_column_that_rests_for_a_tenth_of_a_second_is_no_dropout(sound):
    def spoil(table):
        inside = (table["time_s"] >= 8.0) & (table["time_s"] < 8.1)
        table.loc[inside, ACCELEROMETER[0]] = 0.125
        return table

    assert "sensor_dropout" not in ids(find_mistakes(with_table(sound, spoil))[1])


def test_a_reading_without_noise_may_stand_still():
    """A simulator hovers for two seconds, then swings: the rate leaves zero without a jump. With noise, or a jump of
    fifty of its steps, standing still is a dropout; so is a run of it where other runs show noise."""
    t = np.arange(2000) / 100.0
    swing = np.where(t < 2.0, 0.0, 1.0 - np.cos(t - 2.0))
    held = lambda values, **known: dropout.held(t, values[:, None], **known)  # noqa: E731
    assert held(swing) == []
    noisy = np.where(t < 2.0, 0.0, swing + 0.01 * np.random.default_rng(6).standard_normal(t.size))
    assert len(held(noisy)) == 1
    frozen = np.where((t > 8.0) & (t < 10.0), swing[800], swing)
    assert len(held(frozen)) == 1
    assert held(np.zeros(2000)) == [] and len(held(np.zeros(2000), noisy=True)) == 1


def test_a_slow_sensor_that_loses_packets_is_no_dropout():
    """25 Hz in a log of 250 Hz, one in five packets lost: stretches of two to five periods are its habit."""
    rng = np.random.default_rng(5)
    t = np.arange(20_000) / 250.0
    kept = np.flatnonzero((np.arange(t.size) % 10 == 0) & (rng.random(t.size) > 0.2))
    values = rng.standard_normal((t.size, 3))[kept[np.searchsorted(kept, np.arange(t.size), "right") - 1]]
    assert dropout.held(t, values, SHORTEST_FREEZE_S, SHORTEST_FREEZE_PERIODS) == []


def test_a_rotor_that_is_hardly_ever_read(sound):
    rng = np.random.default_rng(0)

    def spoil(table):
        keep = rng.random(len(table)) < 0.05
        table["rotor_speed_1_rad_s"] = np.where(keep, 0.4 * table["rotor_speed_1_rad_s"], 0.0)
        return table

    fixed, findings, _ = find_mistakes(with_table(sound, spoil))
    assert ids(findings) == ["sensor_dropout"]
    assert not any(run.has("rotor_speed_1_rad_s") for run in fixed.runs)


def test_a_vibration_that_follows_the_rotors():
    # At 200 Hz the rotors' order (about 1070 rad/s, 170 Hz) is seen at an alias only.
    _, findings, _ = find_mistakes(recorded(51, 52, vibration=0.5))
    finding = one(findings, "vibration")
    assert finding.channels == ("specific_force_x_m_s2",)
    assert finding.parameters[0].value == pytest.approx(0.5, rel=0.15)


@pytest.mark.parametrize(("size", "seen"), [(0.5, True), (0.0, False)])
def test_a_vibration_is_seen_with_commands_alone(size, seen):
    """Commands 8 % below what the rotors turn at, 30 ms ahead of it."""

    def commanded(table):
        return (0.92 * table[ROTORS].shift(-6).ffill()).rename(columns=COMMANDS).join(table.drop(columns=ROTORS))

    _, findings, _ = find_mistakes(with_table(recorded(51, 52, vibration=size), commanded))
    assert ("vibration" in ids(findings)) is seen


def held_command(table, value):
    """The set with its speeds as commands, the third of which reads `value(before)` from 8 s to 10 s."""
    table = table.rename(columns=COMMANDS)
    name, inside = COMMANDS["rotor_speed_3_rad_s"], (table["time_s"] >= 8.0) & (table["time_s"] <= 10.0)
    table.loc[inside, name] = value(table.loc[table["time_s"] < 8.0, name])
    return table


def test_a_command_that_stands_still_while_the_others_go_on_dropped_out(sound):
    spoilt = with_table(sound, lambda table: held_command(table, lambda before: before.iloc[-1]))
    fixed, findings, _ = find_mistakes(spoilt)
    finding = one(findings, "sensor_dropout")
    assert finding.channels == ("rotor_command_3_rad_s",)
    assert {(round(a), round(b)) for _, a, b in finding.windows} == {(8, 10)}


def test_a_command_at_the_end_of_its_range_may_stand_still(sound):
    saturated = with_table(sound, lambda table: held_command(table, lambda before: 1.3 * before.max()))
    assert "sensor_dropout" not in ids(find_mistakes(saturated)[1])


def test_a_line_at_its_own_frequency_is_no_vibration_of_the_rotors(sound):
    def shake(table):
        table["specific_force_x_m_s2"] += 0.5 * np.cos(2 * np.pi * 31.0 * table["time_s"])
        return table

    assert find_mistakes(with_table(sound, shake))[1] == ()


def without_attitude(table):
    return table[[n for n in table if not n.startswith(("quaternion_", "position_", "velocity_"))]]


def test_short_runs_without_a_mistake(short):
    assert find_mistakes(short)[1] == () and find_mistakes(with_table(short, without_attitude))[1] == ()


@pytest.mark.parametrize("lag_s", [0.0, 0.045])
def test_a_yaw_oscillation_that_follows_its_commands_late_says_nothing_of_turning_senses(lag_s):
    """At 9 Hz torque that is late by 45 ms is nearly that of rotors which spin the other way, without a lag."""
    calm = recorded(1, 2, flight={"excitation": 0.2})
    vehicle = calm.vehicle
    signs, torque = vehicle.yaw_signs(), vehicle.torque_coefficients_n_m_s2()

    def shake(table):
        t = table["time_s"].to_numpy()
        own = table[ROTORS].to_numpy()
        more = 60.0 * signs * np.sin(2 * np.pi * 9.0 * t)[:, None]
        turned = ((own + more) ** 2 - own**2) @ (signs * torque) / vehicle.inertia_kg_m2.zz
        commands = own + 60.0 * signs * np.sin(2 * np.pi * 9.0 * (t + lag_s))[:, None]
        changed = {GYROSCOPE[2]: table[GYROSCOPE[2]] + np.cumsum(turned) * np.gradient(t)}
        changed |= {n.replace("speed", "command"): commands[:, k] for k, n in enumerate(ROTORS)}
        return table.assign(**changed).drop(columns=ROTORS)

    assert "spin_direction" not in ids(find_mistakes(with_table(calm, shake))[1])


@pytest.mark.parametrize("pair", [(0, 1), (1, 2), (0, 2)])
def test_two_rotors_exchanged_in_short_runs(short, pair):
    """Neighbours on one side leave one axis as it was: the other alone has to tell."""
    names = [ROTORS[k] for k in pair]
    fixed, findings, _ = find_mistakes(with_table(short, holding(names, names[::-1])))
    one(findings, "rotor_order")
    assert_restored(fixed, short, ROTORS)


@pytest.mark.parametrize("sensor", ["gyroscope", "rotors"])
def test_a_drifting_clock_in_short_runs(sensor):
    bad = recorded(61, 62, 63, 64, flight={"duration_s": 9.0}, growth={sensor: 0.002})
    estimate = next(f for f in find_mistakes(bad)[1] if f.id == "clock_skew").parameters[0]
    assert min(abs(estimate.low), abs(estimate.high)) <= 0.002 <= max(abs(estimate.low), abs(estimate.high))


@pytest.mark.parametrize("factor", [1.0, 180 / np.pi])
def test_a_gyroscope_in_degrees_beside_nothing_but_a_throttle_that_the_motors_follow_late(short, factor):
    """A lag of 50 ms takes three quarters of a quick moment away: a factor of 57 would look like one of 15."""

    def spoil(table):
        rotors = table[ROTORS].to_numpy()
        early = rotors + 0.05 * np.gradient(gaussian(rotors, 3.0), table["time_s"], axis=0)
        table = without_attitude(table).drop(columns=ROTORS)
        table[GYROSCOPE] *= factor
        return table.assign(**{f"throttle_{k + 1}": early[:, k] / 2000.0 for k in range(4)})

    thrown = with_table(short, spoil)
    _, findings, _ = find_mistakes(replace(thrown, vehicle=quad(rotor_speed_limits_rad_s=(0.0, 2000.0))))
    assert ids(findings) == (["unit_error"] if factor > 1 else [])


def test_an_exchanged_gyroscope_without_attitude_may_be_two_exchanged_rotors(short):
    exchanged = holding(GYROSCOPE[:2], GYROSCOPE[1::-1])
    fixed, findings, _ = find_mistakes(with_table(short, lambda table: without_attitude(exchanged(table))))
    assert ids(findings) == ["axis_sign"] and findings[0].status == "ambiguous"
    assert findings[0].alternatives == ("axis_sign", "rotor_order")
    assert_restored(fixed, short, GYROSCOPE)


@pytest.mark.filterwarnings("error")
def test_rotors_of_which_nothing_is_read_for_a_while(sound):
    def spoil(table):
        table.loc[table["time_s"] < 3.0, ROTORS] = np.nan
        table["rotor_speed_2_rad_s"] = np.nan
        return table

    for run in with_table(sound, spoil).runs:
        assert dropout.standing_rotors(run, sound.vehicle, ROTORS) == {}


def test_three_mistakes_at_once(sound):
    wrong = [ROTORS[k] for k in (3, 1, 2, 0)]
    in_rpm, flipped = holding(ROTORS, wrong, 60 / (2 * np.pi)), holding(GYROSCOPE[1:2], GYROSCOPE[1:2], -1.0)
    fixed, findings, _ = find_mistakes(with_table(sound, lambda table: flipped(in_rpm(table))))
    assert sorted(ids(findings)) == ["axis_sign", "rotor_order", "unit_error"]
    for name in ALL:
        assert column(fixed, name) == pytest.approx(column(sound, name))


def test_a_sensor_that_is_badly_known_does_not_join_two_that_part():
    """Growths of lateness 0, 0 and 2 ms/s beside one of 1 ms/s known to 1 ms/s alone, which is near to each of them."""
    names = ["accelerometer", "attitude", "gyroscope", "rotors"]
    values, sd = np.array([1e-3, 0.0, 0.0, 2e-3]), np.array([1e-3, 1e-5, 1e-5, 1e-5])
    known = Lateness(names, values, np.eye(4), sd, np.zeros(4), [names])
    assert sorted(in_agreement(known, names, dict.fromkeys(names, 1e-4), 3.0, 0.0)) == names[:3]


@pytest.fixture(scope="module")
def hovering() -> RecordingSet:
    """A quiet hover under a controller, which answers its gyroscope's noise."""
    return RecordingSet("hovering", quad(), (controlled(1, 30.0),))


@pytest.mark.parametrize("change", [lambda table: table, without_attitude], ids=["all", "gyroscope alone"])
def test_answers_of_a_controller_are_no_layout_but_a_doubt(hovering, change):
    fixed, findings, _ = find_mistakes(with_table(hovering, change))
    assert not {"spin_direction", "rotor_order", "axis_sign"} & set(ids(findings))
    assert fixed.vehicle == hovering.vehicle
    (doubt,) = fixed.proposed
    assert "turning senses" in doubt.sentence and "not by the drag" in doubt.sentence and not doubt.stops


def test_answers_that_past_torques_foretell_are_no_turning_senses(tmp_path):
    """In gusts, rotors that follow their commands by a curve and 67 ms later."""
    (case,) = cases.with_names(["feedback/both/26241a85/003"])
    concealed.build(case, tmp_path / "sets", tmp_path / "answers")
    _, findings, _ = find_mistakes(read_set(tmp_path / "sets" / case.set_name))
    assert "spin_direction" not in ids(findings)


def test_rotors_exchanged_are_found_next_to_answers_of_a_controller(hovering):
    fixed, findings, _ = find_mistakes(with_table(hovering, holding(ROTORS[1:3], ROTORS[2:0:-1])))
    assert "rotor_order" in ids(findings) and "spin_direction" not in ids(findings)
    assert_restored(fixed, hovering, ROTORS)


def test_a_layout_that_half_of_the_recordings_contradict_is_a_doubt(sound):
    """The second run, held out, has its rotors in order, the first has two exchanged."""
    bad = with_table(replace(sound, held_out=("run01",)), holding(ROTORS[1:3], ROTORS[2:0:-1]), "run00")
    fixed, findings, _ = find_mistakes(bad)
    assert "rotor_order" not in ids(findings)
