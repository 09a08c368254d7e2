"""The runs held out change no model, and a verdict says what its own numbers say."""

import json
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from rotorid.mismatch.analyse import analyse, with_noise_held_out
from rotorid.mismatch.decide.enough import contribution, ratio_of, weighed
from rotorid.mismatch.decide.findings import ChannelTrace, Finding, in_interval
from rotorid.mismatch.evidence.split import parts_of, split_runs
from rotorid.mismatch.flight.absent import evidence_of
from rotorid.mismatch.instrument.analyse import analyse_instrument
from rotorid.mismatch.tell.consistency import EXPLAINED_SHARE
from rotorid.recordings import RecordingSet, Run, Vehicle
from rotorid.report.deliver import ledger, verdict_of
from tests.unit.mismatch.flights import Flight, with_table

HELD = "run02"
AT_WORK = ("established", "ambiguous", "suggested")


@cache
def recordings() -> RecordingSet:
    """Three flights with a drag that the believed vehicle lacks, the second held out."""
    flights = {f"run0{k}": Flight(k, 14.0, drag=0.6) for k in (1, 2, 3)}
    runs = tuple(flight.record(100.0, name=name) for name, flight in flights.items())
    return RecordingSet("made", flights["run01"].vehicle, runs, held_out=(HELD,))


def disturbed(size_m_s2: float) -> RecordingSet:
    """The set with a slow force in the run held out that no effect makes."""

    def pushed(table: pd.DataFrame) -> None:
        wave = size_m_s2 * np.sin(2 * np.pi * 0.4 * table["time_s"])
        for name in ("specific_force_x_m_s2", "specific_force_y_m_s2"):
            table[name] += wave

    return with_table(recordings(), pushed, HELD)


@cache
def watched(size_m_s2: float):
    """The analysis of the disturbed set, and what who watches is told of the fitted runs."""
    told = []
    analysis = analyse(disturbed(size_m_s2), watch=told.append)
    (fitted,) = told
    return analysis, fitted


def analysed(size_m_s2: float):
    return watched(size_m_s2)[0]


def test_who_watches_is_told_what_the_fitted_runs_decide_and_nothing_of_the_others():
    plain, other = (watched(size)[1] for size in (0.0, 1.5))
    assert "rotor_drag" in {f.id for f in plain.findings if f.status == "established"}
    assert "rotor_drag" not in {f.id for f in plain.outside}
    assert [f.id for f in plain.findings] == [f.id for f in other.findings] and plain.values == other.values
    a, b = evidence_of(plain.found.model), evidence_of(other.found.model)
    np.testing.assert_array_equal(a.gram, b.gram)
    assert a.active == b.active and any(key.startswith("rotor_drag/") for key in a.active)


def test_what_is_chosen_does_not_depend_on_the_runs_held_out():
    plain, other = analysed(0.0), analysed(1.5)
    chosen = [[(f.id, f.values, f.parameters) for f in a.findings if f.status in AT_WORK] for a in (plain, other)]
    assert chosen[0] == chosen[1] and chosen[0]
    assert plain.improved == other.improved and plain.refitted == other.refitted and plain.values == other.values


@pytest.mark.parametrize("size_m_s2", [1.5, 30.0])
def test_the_runs_held_out_change_no_status_and_report_what_they_contradict(size_m_s2):
    plain, other = analysed(0.0), analysed(size_m_s2)
    said = [[(f.id, f.status, f.probability) for f in a.findings] for a in (plain, other)]
    assert said[0] == said[1]
    assert {f.id: f.status for f in other.findings}["rotor_drag"] == "established"
    assert plain.suggested_values == other.suggested_values
    gains = [{f.id: f for f in a.findings}["rotor_drag"].gain for a in (plain, other)]
    assert gains[0][2] < 1.0 and gains[1][0] > gains[0][0]


def test_what_takes_no_share_of_the_error_of_the_fitted_runs_does_not_stand():
    analysis = analysed(0.0)
    draw = np.random.default_rng(0)
    alike = tuple(t.after + 1e-3 * t.after.std() * draw.standard_normal(len(t.after)) for t in analysis.compared)
    judged = weighed(replace(analysis, without={**analysis.without, "rotor_drag": alike}))
    found = {f.id: f for f in judged.findings}["rotor_drag"]
    assert found.status == "not_established" and "takes 0.0 %" in found.sentence and found.probability > 0.99
    unsure = tuple(replace(f, probability=0.9) if f.id == "rotor_drag" else f for f in analysis.findings)
    judged = weighed(replace(analysis, findings=unsure, without={**analysis.without, "rotor_drag": alike}))
    found = {f.id: f for f in judged.findings}["rotor_drag"]
    assert found.status == "suggested" and "takes 0.0 %" in found.objection


def test_what_betters_no_channel_does_not_stand_though_all_that_goes_goes_with_it():
    """Where nothing else is found, next to nothing is the whole of what is explained."""
    analysis = analysed(0.0)
    traces, between = (
        tuple(replace(t, before=t.named * (1.0 + 2e-4)) for t in own)
        for own in (analysis.traces, analysis.between_sensors)
    )
    alike = tuple(t.before for t in (*traces, *between))
    little = replace(analysis, traces=traces, between_sensors=between, without=dict.fromkeys(analysis.without, alike))
    judged = weighed(little)
    found = {f.id: f for f in judged.findings}["rotor_drag"]
    assert found.status == "not_established" and "betters no channel" in found.sentence


def test_what_is_less_than_half_a_step_of_a_coarse_reading_does_not_stand():
    analysis = analysed(0.0)
    pairs = zip(analysis.without["rotor_drag"], analysis.compared, strict=True)
    largest = max(float(np.abs(left - t.named).max()) for left, t in pairs)
    for step, status in ((1e-3 * largest, "established"), (10.0 * largest, "not_established")):
        every = tuple(dict.fromkeys(t.channel for t in analysis.compared))
        steps = tuple(in_interval(f"q_{c}", step, "N", 0.0) for c in every)
        coarse = Finding("quantisation", "established", parameters=steps, channels=every)
        judged = weighed(replace(analysis, findings=(*analysis.findings, coarse)))
        found = {f.id: f for f in judged.findings}["rotor_drag"]
        assert found.status == status and (status == "established" or "half a step" in found.sentence)


@pytest.mark.parametrize("size_m_s2", [0.0, 1.5, 30.0])
def test_a_reader_with_a_pocket_calculator_gets_the_same_word(size_m_s2):
    told = json.loads(verdict_of(analysed(size_m_s2)).text())
    located = {place["channel"] for place in told["locations"]} & set(told["channels"])
    before = after = noise = 0.0
    for channel in (told["channels"][name] for name in located):
        errors, floor = channel["rmse"]["held_out"], channel["noise_floor"]
        before, after, noise = (
            before + (errors["before"] / floor) ** 2,
            after + (errors["after"] / floor) ** 2,
            noise + 1,
        )
    left = min(1.0, max(0.0, after - noise) / max(before - noise, noise))
    assert told["unexplained"]["share"] == pytest.approx(left, rel=1e-4, abs=1e-4)
    claims = [e for e in told["effects"] if e["status"] in ("established", "ambiguous")]
    if claims or told["parameters"]:
        word = (
            "explained"
            if left <= EXPLAINED_SHARE
            else "partly_explained"
            if left < 1.0 - EXPLAINED_SHARE
            else "unexplained"
        )
        assert told["verdict"] == word
    else:
        assert told["verdict"] == "unexplained"
    assert len(told["sentence"].split()) <= 40 and all(len(e["sentence"].split()) <= 40 for e in told["effects"])


def test_established_effects_better_a_channel_and_come_in_the_order_of_their_shares():
    told = json.loads(verdict_of(analysed(0.0)).text())
    stated = [e for e in told["effects"] if e["status"] == "established"]
    assert stated and all(e["held_out_gain"]["interval_95"][1] < 1.0 for e in stated)
    shares = [e["share"] for e in stated]
    assert shares == sorted(shares, reverse=True) and shares[0] > 0.5


def test_an_effect_is_judged_in_the_channels_that_it_acts_on():
    analysis = analysed(0.0)
    held = [np.full(len(t.time_s), t.run == HELD) for t in analysis.compared]
    without = analysis.without["rotor_drag"]
    assert set(contribution(analysis, without, held, ("force_x",))[0]) == {"force_x"}
    assert set(contribution(analysis, without, held)[0]) > {"force_x"}


def test_a_single_run_is_cut_in_two_with_a_gap():
    (run, *_) = recordings().runs
    single = replace(recordings(), runs=(run,), held_out=None)
    split = split_runs(single)
    fitted, held = parts_of(single, split)
    assert fitted.runs[0].time_s[-1] < split.border_s < held.runs[0].time_s[0]
    assert held.runs[0].time_s[0] - fitted.runs[0].time_s[-1] >= 2.0
    assert split_runs(fitted).held_out == ()


def test_the_runs_held_out_share_what_was_flown():
    """Of a hover and two fast flights a fast one is held out, wherever it stands."""
    calm, fast, faster = (Flight(k, 10.0, excitation=size) for k, size in ((1, 0.05), (2, 1.0), (3, 1.0)))
    runs = (fast.record(50.0, name="run01"), calm.record(50.0, name="run02"), faster.record(50.0, name="run03"))
    whole = RecordingSet("made", calm.vehicle, runs)
    assert split_runs(whole).held_out != ("run02",) and split_runs(whole) == split_runs(whole)


def test_of_two_runs_along_each_axis_one_each_is_held_out():
    """A third of six runs would leave an axis out on one of the two sides: nothing of it could be shown."""
    time_s = np.arange(0.0, 20.0, 0.1)
    runs = []
    for number, axis in enumerate("xyzxyz"):
        load = {f"reference_force_{a}_n": (a == axis) * np.sin(time_s) for a in "xyz"}
        runs.append(Run(f"run{number}", pd.DataFrame({"time_s": time_s, **load})))
    vehicle = Vehicle.model_validate({"name": "bench", "kind": "bench"})
    held = split_runs(RecordingSet("made", vehicle, tuple(runs))).held_out
    assert sorted("xyzxyz"[int(name[3:])] for name in held) == ["x", "y", "z"]


def test_the_ledger_says_which_rule_decided_on_what():
    analysis = analysed(0.0)
    objection = "it is smaller than what the model leaves over"
    lowered = tuple(
        replace(f, status="suggested", objection=objection) if f.id == "rotor_drag" else f for f in analysis.findings
    )
    entries = ledger(replace(analysis, findings=lowered), verdict_of(analysis))
    suggested = {e["on"]: e for e in entries}["rotor_drag"]
    assert suggested["rule"] == "suggested" and suggested["sentence"] == objection and suggested["numbers"]
    kept = {e["on"]: e for e in ledger(analysed(0.0), verdict_of(analysed(0.0)))}["rotor_drag"]
    assert kept["rule"] == "established" and kept["numbers"]["high_95"] < 1.0
    assert json.loads(json.dumps(entries, allow_nan=False)) == entries


def test_the_ratio_is_that_of_errors_with_and_without_where_the_effect_acts():
    """Noise of one sigma; without the effect a movement of one sigma more for the last third: there 1/√2."""
    rng = np.random.default_rng(1)
    time_s = np.arange(0.0, 120.0, 0.025)
    noise = rng.standard_normal(len(time_s))
    added = np.where(time_s > 80.0, rng.standard_normal(len(time_s)), 0.0)
    trace = ChannelTrace("a", "force_x", "N", time_s, noise + added, noise + added, noise, noise)
    analysis = SimpleNamespace(compared=(trace,))
    every, nothing = np.ones(len(time_s), bool), np.zeros(len(time_s), bool)
    value, low, high = ratio_of(analysis, (noise + added,), [every], "force_x")
    assert value == pytest.approx(np.sqrt(0.5), abs=0.02)
    assert low < np.sqrt(0.5) < high and high - low < 0.1
    assert ratio_of(analysis, (noise + added,), [nothing], "force_x") is None


def test_an_error_of_a_sensor_is_judged_by_what_two_sensors_say():
    """A wrong mass makes up for an accelerometer's scale in the force, and not next to the velocity."""
    rng = np.random.default_rng(2)
    time_s = np.arange(0.0, 60.0, 0.025)
    noise, missed = rng.standard_normal((2, len(time_s)))
    force = ChannelTrace("a", "force_z", "N", time_s, noise + missed, noise, noise, noise)
    between = ChannelTrace("a", "accelerometer_z", "m/s2", time_s, noise + missed, noise + missed, noise, noise)
    analysis = SimpleNamespace(
        compared=(force, between),
        between_sensors=(between,),
        noise_floor={"force_z": 1.0, "accelerometer_z": 1.0},
        findings=(),
    )
    every = [np.ones(len(time_s), bool)] * 2
    gains, beyond = contribution(analysis, (noise, noise + missed), every, ("force_z",))
    assert next(iter(gains)) == "accelerometer_z" and gains["accelerometer_z"][2] < 0.8 and beyond


def test_noise_of_the_runs_held_out_counts_where_nothing_is_stated():
    """What is left there and depends on nothing is noise; what depends on something, or beside a claim, is not."""
    claimed = replace(analysed(0.0), noise_floor={"force_x": 1e-6}, p_values={"force_x": (1.0, 1.0)})
    silent = replace(claimed, findings=(), values={}, without={}, unexplained_channels=())
    (held,) = (t.after for t in claimed.traces if t.channel == "force_x" and t.run == HELD)
    assert with_noise_held_out(silent).noise_floor["force_x"] == pytest.approx(np.sqrt(np.mean(held**2)))
    dependent = replace(silent, p_values={"force_x": (1.0, 1e-3)})
    for other in (claimed, dependent, replace(silent, unexplained_channels=("force_x",))):
        assert with_noise_held_out(other).noise_floor["force_x"] == 1e-6


def bench(size_n: float) -> RecordingSet:
    """Three runs of a bench that reads along x 3 % of the load along z, the second held out and disturbed there."""
    rng, runs = np.random.default_rng(5), []
    load = np.repeat([0, 2, 4, 6, 8, 10, 8, 6, 4, 2, 0], 40).astype(float)
    for name in ("a", HELD, "c"):
        table = {"time_s": np.arange(len(load)) / 10, "reference_force_z_n": load, "reference_force_x_n": 0.0 * load}
        table |= {"force_z_n": load + 0.01 * rng.normal(size=len(load))}
        wave = size_n * np.sin(table["time_s"]) if name == HELD else 0.0
        table |= {"force_x_n": 0.03 * load + 0.01 * rng.normal(size=len(load)) + wave}
        runs.append(Run(name, pd.DataFrame(table)))
    vehicle = Vehicle.model_validate({"name": "b", "kind": "bench", "tared": True})
    return RecordingSet("b", vehicle, tuple(runs), (HELD,))


def test_what_is_chosen_for_a_bench_does_not_depend_on_the_runs_held_out():
    plain, other = analyse_instrument(bench(0.0)), analyse_instrument(bench(3.0))
    chosen = [[(f.id, f.values, f.parameters) for f in a.findings if f.status in AT_WORK] for a in (plain, other)]
    assert chosen[0] == chosen[1] and [c[0] for c in chosen[0]] == ["crosstalk"]
    assert plain.improved == other.improved and plain.refitted == other.refitted and plain.values == other.values
    assert [(f.status, f.probability) for f in plain.findings] == [(f.status, f.probability) for f in other.findings]
    assert {f.id: f.probability for f in plain.findings}["crosstalk"] > 0.99
