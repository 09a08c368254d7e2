"""Plantings: what they put in is exact, and what a verdict says of them is scored as it should be."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rotorid.effects.motor_lag import lagged
from rotorid.effects.throttle_curve import root
from rotorid.recordings import Inertia, RecordingSet, Rotor, Run, Vehicle
from rotorid.recordings import columns as c
from rotorid_proof.plantings import judge, plan, score, sow, tables
from rotorid_proof.plantings.flights import FLIGHTS, flight, taken
from rotorid_proof.plantings.kinds import Ratio, Size, Truth, named
from tests.unit.mismatch.flights import with_table

ROOT = Path(__file__).parents[3]
RATE_HZ, ARM = 400.0, 0.1
SPEEDS = c.rotor_columns("rotor_speed", 4)
COMMANDS = c.rotor_columns("rotor_command", 4)


def smooth_noise(rng: np.random.Generator, n: int, columns: int, highest_hz: float) -> np.ndarray:
    """Band-limited noise of rms one, (n, columns)."""
    spectrum = np.fft.rfft(rng.normal(size=(n, columns)), axis=0)
    spectrum[np.fft.rfftfreq(n, 1 / RATE_HZ) > highest_hz] = 0.0
    out = np.fft.irfft(spectrum, n, axis=0)
    return out / out.std(axis=0)


@pytest.fixture(scope="module")
def recorded() -> RecordingSet:
    """Two runs with every column that a planting may change; smooth, so that it can be read between samples."""
    hubs = ((1, 1, "ccw"), (1, -1, "cw"), (-1, -1, "ccw"), (-1, 1, "cw"))
    vehicle = Vehicle(
        name="made up", kind="flight", mass_kg=0.8, inertia_kg_m2=Inertia(xx=2e-3, yy=3e-3, zz=4e-3),
        rotors=tuple(Rotor(x_m=x * ARM, y_m=y * ARM, spin=s) for x, y, s in hubs), thrust_coefficient_n_s2=1.5e-6,
        torque_coefficient_n_m_s2=3e-8,
    )  # fmt: skip
    rng = np.random.default_rng(3)
    runs = []
    for k in range(2):
        n = 4000
        t = np.arange(n) / RATE_HZ
        turn = smooth_noise(rng, n, 4, 1.0) * 0.1 + np.array([1.0, 0, 0, 0])
        speed = 1150 + 60 * smooth_noise(rng, n, 4, 8.0)
        columns = {
            c.TIME: t[:, None], c.POSITION: smooth_noise(rng, n, 3, 1.0),
            c.VELOCITY: 3 * smooth_noise(rng, n, 3, 1.0),
            c.QUATERNION: turn / np.linalg.norm(turn, axis=1, keepdims=True),
            c.ANGULAR_VELOCITY: smooth_noise(rng, n, 3, 6.0),
            c.SPECIFIC_FORCE: smooth_noise(rng, n, 3, 6.0) + np.array([0, 0, -9.8]), SPEEDS: speed, COMMANDS: speed,
            c.BATTERY_VOLTAGE: (16.0 - 0.2 * t)[:, None],
        }  # fmt: skip
        table = {}
        for names, values in columns.items():
            for j, name in enumerate((names,) if isinstance(names, str) else names):
                table[name] = values[:, j]
        runs.append(Run(f"run{k}", pd.DataFrame(table)))
    return RecordingSet("made-up", vehicle, tuple(runs))


def planted(recorded: RecordingSet, name: str, size: str = "large") -> tuple[RecordingSet, Truth]:
    wanted = sow.kind(name)
    out, (truth,) = sow.plant(recorded, plan.Planting("made-up", wanted.family, (name,), size, 0))
    return out, truth


def sizes(truth: Truth) -> dict[str, float]:
    return {s.symbol: s.value for s in truth.sizes[0]}


def without(recordings: RecordingSet, *names: str) -> RecordingSet:
    return with_table(recordings, lambda t: t.drop(columns=list(names)))


def by_throttle(recordings: RecordingSet, throttle) -> RecordingSet:
    """The set with a throttle, alike for all rotors, in place of speeds and commands."""
    columns = dict.fromkeys(c.rotor_columns("throttle", 4), throttle)
    return with_table(without(recordings, *SPEEDS, *COMMANDS), lambda t: t.assign(**columns))


def wrench(recordings: RecordingSet, run: int = 0, about: np.ndarray | None = None) -> np.ndarray:
    """Thrust, roll, pitch and yaw moment (n, 4) of the rotors as believed, moments about a point, N and N m."""
    v, speed = recordings.vehicle, recordings.runs[run].array(SPEEDS)
    thrust = speed**2 * v.thrust_coefficients_n_s2()
    at = v.rotor_positions_m() - (np.zeros(3) if about is None else about)
    yaw = speed**2 * v.torque_coefficients_n_m_s2() @ v.yaw_signs()
    return np.stack([thrust.sum(axis=1), -thrust @ at[:, 1], thrust @ at[:, 0], yaw], axis=1)


def test_a_centre_of_mass_moves_every_arm_and_the_accelerometer(recorded: RecordingSet) -> None:
    out, truth = planted(recorded, "centre_of_mass")
    r = np.array([sizes(truth)["r_x"], sizes(truth)["r_y"], 0.0])
    assert np.linalg.norm(r) == pytest.approx(0.08 * ARM)
    # Moments about the true centre of mass are those of the vehicle as it was.
    np.testing.assert_allclose(wrench(out, about=r), wrench(recorded), atol=1e-12)
    np.testing.assert_allclose(out.vehicle.accelerometer_position_m, r)


def test_a_weak_rotor_gives_its_share_less_at_the_recorded_speed(recorded: RecordingSet) -> None:
    out, truth = planted(recorded, "weak_rotor")
    single = truth.sizes[1][0]
    k, d = int(single.symbol[-1]) - 1, single.value
    shares = np.ones(4)
    shares[k] += d
    thrust = out.runs[0].array(SPEEDS) ** 2 * 1.5e-6
    np.testing.assert_allclose(thrust * shares, recorded.runs[0].array(SPEEDS) ** 2 * 1.5e-6)
    free = np.array([s.value for s in truth.sizes[0]])
    np.testing.assert_allclose(np.append(free, -free.sum()), shares / shares.mean() - 1.0)


def test_of_a_throttle_alone_the_believed_coefficients_make_a_weak_rotor(recorded: RecordingSet) -> None:
    bare = by_throttle(recorded, 0.5)
    out, truth = planted(bare, "weak_rotor")
    share = out.vehicle.thrust_coefficients_n_s2() / 1.5e-6
    assert sorted(share)[:3] == [1.0, 1.0, 1.0]
    assert max(share) * (1 + truth.sizes[1][0].value) == pytest.approx(1.0)
    assert out.runs == bare.runs


@pytest.mark.parametrize("name", ["rotors_late", "gyroscope_late"])
def test_a_late_sensor_writes_what_was_a_whole_number_of_samples_ago(recorded: RecordingSet, name: str) -> None:
    out, truth = planted(recorded, name)
    steps = round(truth.sizes[0][0].value * RATE_HZ)
    names = SPEEDS if "rotors" in name else c.ANGULAR_VELOCITY
    new, old = out.runs[0].array(names), recorded.runs[0].array(names)
    assert steps == 8 and np.isnan(new[:steps]).all()
    np.testing.assert_array_equal(new[steps:], old[:-steps])


def test_a_skewed_clock_reads_further_and_further_from_its_stamps(recorded: RecordingSet) -> None:
    out, truth = planted(recorded, "gyroscope_skewed")
    t, e = recorded.runs[0].time_s, truth.sizes[0][0].value
    start = t[0] if e > 0 else t[-1]
    asked = t - e * (t - start)
    old, new = recorded.runs[0].array(c.ANGULAR_VELOCITY), out.runs[0].array(c.ANGULAR_VELOCITY)
    for k in range(3):
        wanted = np.interp(asked, t, old[:, k])
        good = np.isfinite(new[:, k])
        assert good.mean() > 0.99
        assert np.abs(new[good, k] - wanted[good]).max() < 0.01


def test_a_moved_accelerometer_feels_the_turning(recorded: RecordingSet) -> None:
    out, truth = planted(recorded, "lever_arm")
    r = np.array([sizes(truth)[f"r_{a}"] for a in "xyz"])
    run = recorded.runs[0]
    rate = run.array(c.ANGULAR_VELOCITY)
    wanted = np.cross(np.gradient(rate, run.time_s, axis=0), r) + np.cross(rate, np.cross(rate, r))
    got = out.runs[0].array(c.SPECIFIC_FORCE) - run.array(c.SPECIFIC_FORCE)
    inside = slice(100, -100)
    assert np.abs(got[inside] - wanted[inside]).max() < 0.02 * np.abs(wanted).max()


@pytest.mark.parametrize(("name", "symbol"), [("accelerometer_biased", "b"), ("accelerometer_turned", "theta")])
def test_an_accelerometers_error_is_the_catalogues(recorded: RecordingSet, name: str, symbol: str) -> None:
    out, truth = planted(recorded, name)
    p = np.array([sizes(truth)[f"{symbol}_{a}"] for a in "xyz"])
    old = recorded.runs[0].array(c.SPECIFIC_FORCE)
    wanted = old + (p if symbol == "b" else np.cross(p, old))
    np.testing.assert_allclose(out.runs[0].array(c.SPECIFIC_FORCE), wanted)


def test_a_wind_leaves_the_motion_through_the_air_as_it_was(recorded: RecordingSet) -> None:
    out, truth = planted(recorded, "steady_wind")
    w = np.array([sizes(truth)["w_north"], sizes(truth)["w_east"], 0.0])
    old, new = recorded.runs[0], out.runs[0]
    np.testing.assert_allclose(new.array(c.VELOCITY) - w, old.array(c.VELOCITY))
    drift = np.diff(new.array(c.POSITION) - old.array(c.POSITION), axis=0) * RATE_HZ
    np.testing.assert_allclose(drift, np.broadcast_to(w, drift.shape), atol=1e-9)


def test_a_lag_brings_the_planted_command_back(recorded: RecordingSet) -> None:
    out, truth = planted(recorded, "motor_lag")
    command = out.runs[0].array(COMMANDS)
    speed = lagged(command, sizes(truth)["tau"], sizes(truth)["tau"], 1 / RATE_HZ, holds=False)
    assert np.abs((speed - recorded.runs[0].array(SPEEDS))[200:-200]).max() < 0.01 * 60


def test_a_throttle_that_no_pilot_could_give_says_nothing(recorded: RecordingSet) -> None:
    """A lag of 40 ms before a throttle that goes up in steps asks for more than all of it."""
    steps = np.repeat([0.2, 0.9] * 20, 100)
    for u, unseen in ((steps, True), (0.5 + 0.01 * np.sin(np.arange(4000) / 200.0), False)):
        _, (truth,) = sow.plant(by_throttle(recorded, u), plan.parsed("x/commands/motor_lag/large/0"))
        assert bool(truth.unseen) == unseen


def test_a_curve_of_the_throttle_brings_the_planted_command_back(recorded: RecordingSet) -> None:
    out, truth = planted(recorded, "throttle_curve")
    full = max(float(run.array(COMMANDS).max()) for run in recorded.runs)

    class Path:
        speed, full_speed = out.runs[0].array(COMMANDS), full

    np.testing.assert_allclose(root(Path, [sizes(truth)["b"]]), recorded.runs[0].array(COMMANDS), rtol=1e-9)


@pytest.mark.parametrize("kind", ["motor_lag", "dead_time", "throttle_curve"])
def test_commands_that_are_made_are_numbers(recorded: RecordingSet, kind: str) -> None:
    """Where no limit of the speed is believed the curve is over the largest command that was made."""
    planted, _ = sow.plant(without(recorded, *COMMANDS), plan.parsed(f"x/commands/{kind}/large/0"))
    for run in planted.runs:
        assert np.isfinite(run.array(COMMANDS)).mean() > 0.9


def test_a_flight_without_commands_is_given_some(recorded: RecordingSet) -> None:
    bare = without(recorded, *COMMANDS)
    out, truth = planted(bare, "dead_time")
    steps = round(truth.sizes[0][0].value * RATE_HZ)
    inside = slice(200, -200)
    moved = out.runs[0].array(COMMANDS)[:-steps][inside]
    assert np.abs(moved - bare.runs[0].array(SPEEDS)[steps:][inside]).max() < 1.0


def same_tables(first: RecordingSet, second: RecordingSet) -> bool:
    return all(a.table.equals(b.table) for a, b in zip(first.runs, second.runs, strict=True))


def test_every_kind_leaves_a_set_that_can_be_read_and_says_what_it_did(recorded: RecordingSet) -> None:
    for kind in sow.fitting(recorded):
        out, truth = planted(recorded, kind.name)
        assert truth.names and (out.vehicle != recorded.vehicle or not same_tables(out, recorded)), kind.name
        again, _ = planted(recorded, kind.name)
        assert same_tables(out, again) and again.vehicle == out.vehicle


def test_mistakes_planted_in_a_made_up_set_are_told_by_the_search_for_them(recorded: RecordingSet) -> None:
    known = [plan.Planting("made-up", "units", (k,), "large", 0) for k in ("rotors_in_rpm", "voltage_in_millivolt")]
    rows = tables.mistake_rows(recorded, known, "now")
    assert [r["named"] for r in rows] == [score.ALONE] * 2
    assert "rpm" in rows[0]["said"] and rows[0]["code"] == "now"
    assert plan.mistakes([*known, plan.Planting("made-up", "values", ("mass",), "large", 0)], "made-up") == known


def test_the_list_is_long_drawn_once_and_read_as_it_was_written(tmp_path: Path) -> None:
    known = plan.read_list(ROOT / "workflow/plantings.tsv")
    assert len(known) >= 200 and len({p.name for p in known}) == len(known)
    assert {p.flight for p in known} == {f.name for f in FLIGHTS}
    for p in known:
        assert plan.parsed(p.name) == p
        for name in p.kinds:
            assert p.family in (sow.kind(name).family, plan.PAIR)
    for flight_name in {p.flight for p in known}:
        own = [p for p in known if p.flight == flight_name]
        kinds = [sow.kind(n) for n in dict.fromkeys(p.kinds[0] for p in own if p.family != plan.PAIR)]
        assert sow.planned(flight(flight_name), kinds) == own


def test_a_flight_takes_the_middle_of_its_runs(recorded: RecordingSet) -> None:
    short = taken(recorded, replace(flight("neurobem"), seconds=4.0, runs=("run1",)))
    assert [r.name for r in short.runs] == ["run1"]
    assert short.runs[0].time_s[[0, -1]] == pytest.approx([3.0, 7.0], abs=0.01)


def test_batches_are_of_one_flight_and_named_by_what_is_in_them() -> None:
    known = [plan.Planting(f, "values", (k,), "large", 0) for f in "ab" for k in ("mass", "arm", "inertia_xx")]
    found = plan.batches(known, 2)
    assert [len(v) for v in found.values()] == [2, 1, 2, 1]
    assert all(len({p.flight for p in v}) == 1 for v in found.values())
    assert not set(found) & set(plan.batches(known[1:], 2)) - set(plan.batches(known[3:], 2))
    assert plan.chosen(known, ["a/*/mass/*"]) == [known[0]]


def test_what_was_judged_is_not_judged_again(recorded: RecordingSet, tmp_path: Path, monkeypatch) -> None:
    seen = []
    monkeypatch.setattr(judge, "cut", lambda folder, name: recorded)
    made = {"verdict": {"verdict": "x"}, "seconds": 1.0, "flown_s": 2.0}
    monkeypatch.setattr(judge, "judged", lambda r: seen.append(r) or made)
    wanted = [plan.Planting("made-up", "values", ("mass",), size, 0) for size in ("large", "small")]
    for out, plantings in (("one", wanted[:1]), ("two", wanted)):
        judge.judge_plantings(Path("x"), plantings, "abc", tmp_path / out, tmp_path / "memory", lambda text: None)
    assert len(seen) == 2
    result = json.loads((tmp_path / "two" / f"{wanted[0].file}.json").read_text())
    assert result["code"] == "abc" and result["planting"] == wanted[0].name


def effect(id, parameters=(), status="established", alternatives=()):
    listed = [{"symbol": s, "value": v, "unit": "", "interval_95": [v - h, v + h]} for s, v, h in parameters]
    return {"id": id, "status": status, "alternatives": list(alternatives), "parameters": listed}


def verdict(*effects, **values):
    stated = {n: {"believed": b, "refitted": r, "interval_95": [r - h, r + h]} for n, (b, r, h) in values.items()}
    return {"verdict": "explained", "effects": list(effects), "parameters": stated}


OFFSET = named("com_offset", fair=("unequal_rotors",), sizes=((Size("com_offset", "r_x", 0.01),),))


def test_a_cause_is_told_alone_in_a_fair_class_or_not() -> None:
    untouched = verdict(effect("rotor_drag"))
    of = {
        score.ALONE: effect("com_offset", [("r_x", 0.0102, 0.001)]),
        score.IN_CLASS: effect("unequal_rotors", (), "ambiguous", ("com_offset", "unequal_rotors")),
        score.NOT_NAMED: effect("com_offset", (), "ambiguous", ("com_offset", "payload")),
    }
    for word, claim in of.items():
        assert score.score_truth(verdict(claim), untouched, OFFSET)["named"] == word
    row = score.score_truth(verdict(of[score.ALONE]), untouched, OFFSET)
    assert row["covered"] is True and row["true"] == 0.01
    assert score.score_truth({"failed": "x"}, untouched, OFFSET)["named"] == score.NOT_NAMED
    suggested = effect("com_offset", [("r_x", 0.0102, 0.001)], "not_established")
    assert score.score_truth(verdict(suggested), untouched, OFFSET)["named"] == score.NOT_NAMED


def test_what_the_flight_held_before_must_move_and_adds_to_the_size() -> None:
    untouched = verdict(effect("com_offset", [("r_x", 0.02, 0.001)]))
    same = verdict(effect("com_offset", [("r_x", 0.021, 0.001)]))
    assert score.score_truth(same, untouched, OFFSET)["named"] == score.NOT_NAMED
    moved = score.score_truth(verdict(effect("com_offset", [("r_x", 0.0305, 0.001)])), untouched, OFFSET)
    assert (moved["named"], moved["covered"], moved["true"]) == (score.ALONE, True, pytest.approx(0.03))


def test_of_mass_and_thrust_only_their_ratio_is_held_against_the_verdict() -> None:
    ratio = Ratio({"thrust_coefficient_n_s2": 1.0, "mass_kg": -1.0}, np.log(1.2))
    truth = named("mass_kg", fair=("thrust_coefficient_n_s2",), ratio=ratio)
    heavy = verdict(mass_kg=(1.2, 1.0, 0.02))
    row = score.score_truth(heavy, verdict(), truth)
    assert (row["named"], row["covered"]) == (score.ALONE, True)
    strong = verdict(thrust_coefficient_n_s2=(1.0, 1.2, 0.02))
    assert score.score_truth(strong, verdict(), truth)["named"] == score.IN_CLASS
    wrong = verdict(mass_kg=(1.2, 1.44, 0.02))
    assert score.score_truth(wrong, verdict(), truth)["named"] == score.NOT_NAMED
    # What was planted corrects what the untouched flight calls wrong: silence is the answer.
    assert score.score_truth(verdict(), verdict(mass_kg=(1.0, 1.2, 0.02)), truth)["named"] == score.ALONE
    little = verdict(mass_kg=(1.2, 1.05, 0.02))
    assert score.score_truth(little, verdict(), truth)["covered"] is False


def test_a_size_in_a_form_that_has_it_not_is_wrong() -> None:
    truth = named("gyro_error", sizes=((Size("gyro_error", "theta_x", 0.05),),), form_bound=True)
    row = score.score_truth(verdict(effect("gyro_error", [("s_x", 0.03, 0.01)])), verdict(), truth)
    assert (row["named"], row["covered"]) == (score.ALONE, False)


def test_what_cannot_show_is_counted_apart_even_where_it_is_named() -> None:
    hidden = replace(OFFSET, unseen="no body rates")
    named_it = verdict(effect("com_offset", [("r_x", 0.01, 0.001)]))
    assert score.score_truth(named_it, verdict(), hidden)["named"] == score.UNSEEN
    windy = named("steady_wind", shown_by=frozenset({"rotor_drag"}))
    assert score.score_truth(verdict(), verdict(), windy)["named"] == score.UNSEEN
    assert score.score_truth(verdict(), verdict(effect("rotor_drag")), windy)["named"] == score.NOT_NAMED
    heavier = named("mass_kg", hidden_by=frozenset({"throttle_curve"}))
    assert score.score_truth(verdict(), verdict(effect("throttle_curve")), heavier)["named"] == score.UNSEEN
    assert score.score_truth(verdict(), verdict(effect("rotor_drag")), heavier)["named"] == score.NOT_NAMED


def test_what_is_new_and_what_is_lost_beside_it() -> None:
    untouched = verdict(effect("rotor_drag"), effect("gyro_error"), mass_kg=(1.0, 1.1, 0.01))
    drag = effect("rotor_drag", (), "ambiguous", ("frame_drag", "rotor_drag"))
    now = verdict(drag, effect("com_offset"), effect("payload"), arm_scale=(1.0, 1.2, 0.01))
    found = score.beside(now, untouched, (OFFSET,))
    new = {"new": ("payload",), "values_new": ("arm_scale",)}
    assert found == new | {"lost": ("gyro_error",), "values_lost": ("mass_kg",)}


def row(planting: str, named: str = score.ALONE, covered=True, new: str = "", code: str = "now"):
    p = plan.parsed(planting)
    base = dict.fromkeys(tables.COLUMNS, "")
    base |= {"planting": planting, "flight": p.flight, "family": p.family, "kind": p.kinds[0], "size": p.size}
    return {**base, "set_of": "single", "named": named, "covered": covered, "new": new, "code": code}


def test_the_summary_counts_sets_and_causes_and_marks_older_rows() -> None:
    rows = pd.DataFrame(
        [
            row("a/values/mass/large/0"),
            row("a/values/arm/large/0", score.NOT_NAMED, None, "payload; gust", "older"),
            row("b/values/arm/large/0", score.UNSEEN, None, "vortex_ring"),
        ],
        columns=tables.COLUMNS,
    )
    found = tables.summary(rows, "now").set_index(["group", "size", "what"])
    named = found.loc[("all", "large", "named")]
    assert (named["value"], named["count"], named["older_rows"]) == (0.5, 2, 1)
    assert found.loc[("all", "large", "ids new or lost a set"), "value"] == 1.0
    assert found.loc[("all", "large", "cannot be seen"), "value"] == pytest.approx(1 / 3)
    assert found.loc[("all", "large", "size covered"), "count"] == 1
    assert set(tables.differing_names(rows)["name"]) == {"payload", "gust", "vortex_ring"}


def test_a_target_holds_only_where_the_whole_interval_is_inside() -> None:
    assert tables.state(1.0, 0.95, 1.0, 0.9, None) == "holds"
    assert tables.state(1.0, 0.6, 1.0, 0.9, None) == "not refuted"
    assert tables.state(0.3, 0.1, 0.6, 0.9, None) == "fails"
    assert tables.state(0.0, 0.0, 0.3, None, 0.1) == "not refuted"


def test_rows_judged_before_are_kept_with_their_own_code() -> None:
    rows = [row(f"a/values/{kind}/large/0", code="older") for kind in ("mass", "arm")]
    old = pd.DataFrame(rows, columns=tables.COLUMNS)
    new = pd.DataFrame([row("a/values/mass/large/0")], columns=tables.COLUMNS)
    found = tables.kept_with(new, old).set_index("planting")["code"]
    assert dict(found) == {"a/values/mass/large/0": "now", "a/values/arm/large/0": "older"}
