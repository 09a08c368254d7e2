"""The verdict: its file, its word, its sentence."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from rotorid.mismatch.decide.findings import ValueRow
from rotorid.mismatch.tell.locate import locate
from rotorid.mismatch.tell.verdict import (
    SCHEMA_PATH,
    Channel,
    Errors,
    PValues,
    SplitErrors,
    Verdict,
    make_verdict,
    reached,
    schema_text,
)
from rotorid.recordings.run import Doubt
from tests.unit.mismatch.synthetic import analysis, drag_finding


def verdict_of(made, forward=None):
    return make_verdict(made, locate(made), forward or {})


def test_the_schema_is_in_step():
    assert SCHEMA_PATH.read_text() == schema_text(), "python -m rotorid.mismatch.tell.verdict --write-schema"


def test_the_file_has_the_keys_of_the_contract():
    content = json.loads(verdict_of(analysis(findings=[drag_finding()])).text())
    assert list(content) == [
        *("set", "kind", "runs", "verdict", "basis", "doubts", "sentence", "size", "details", "warnings", "channels"),
        "locations",
        *("effects", "delivered", "derivatives", "absent", "parameters", "believed_values", "correlations"),
        *("command_path", "not_testable", "unexplained", "next_experiment"),
    ]
    channel = content["channels"]["force_x"]
    assert list(channel) == ["unit", "noise_floor", "rmse", "p_value"]
    assert list(channel["rmse"]["held_out"]) == ["before", "refitted", "named", "after"]
    keys = ["run", "channel", "start_s", "stop_s", "p_value", "energy_share", "regime"]
    assert list(content["locations"][0]) == keys
    effect = content["effects"][0]
    assert effect["parameters"] == [
        {"symbol": "k_d", "value": 6e-05, "unit": "N s2/(rad m)", "interval_95": [5.8e-05, 6.2e-05]}
    ]
    assert effect["held_out_gain"] == {"rmse_ratio": 0.3, "interval_95": [0.25, 0.36]}
    assert Verdict.model_validate(content).text() == verdict_of(analysis(findings=[drag_finding()])).text()


def test_errors_are_the_root_mean_squares_of_the_runs_of_each_kind():
    made = analysis(findings=[drag_finding()])
    errors = verdict_of(made).channels["force_x"].rmse
    held = next(t for t in made.traces if (t.run, t.channel) == ("b", "force_x"))
    assert errors.held_out.before == pytest.approx(np.sqrt(np.mean(held.before**2)), rel=1e-5)
    assert errors.held_out.after == pytest.approx(0.05, rel=0.1)


def test_numbers_that_are_not_finite_are_written_as_null():
    made = analysis(findings=[drag_finding(gain=(math.nan, 0.1, math.inf))], noise_floor={"force_x": math.nan})
    content = json.loads(verdict_of(made).text(), parse_constant=pytest.fail)
    assert content["channels"]["force_x"]["noise_floor"] is None
    assert content["effects"][0]["held_out_gain"] == {"rmse_ratio": None, "interval_95": [0.1, None]}


def left_with(share: float, findings, values):
    """An analysis of which so much of the mismatch's energy in the forward force is left on the run held out."""
    made = analysis(findings=findings, values=values)
    sigma = made.noise_floor["force_x"]

    def scaled(t):
        energy = np.mean(t.before**2) / sigma**2
        wanted = 1.0 + share * max(energy - 1.0, 0.0)
        return replace(t, named=t.named * np.sqrt(wanted * sigma**2 / np.mean(t.named**2)))

    return replace(made, traces=tuple(scaled(t) if t.channel == "force_x" else t for t in made.traces))


@pytest.mark.parametrize(
    ("findings", "values", "share", "word"),
    [
        ((), {}, 0.0, "no_mismatch"),
        ((drag_finding(),), {}, 0.1, "explained"),
        ((drag_finding(status="ambiguous", alternatives=("rotor_drag", "frame_drag")),), {}, 0.0, "explained"),
        ((drag_finding(),), {}, 0.4, "partly_explained"),
        ((drag_finding(),), {}, 0.9, "unexplained"),
        ((drag_finding(status="not_established"),), {}, 0.9, "unexplained"),
        ((), {"mass_kg": (0.6, 0.65, 0.64, 0.66)}, 0.0, "explained"),
    ],
)
def test_the_word(findings, values, share, word):
    found = make_verdict(left_with(share, findings, values), [], {})
    assert found.verdict == word and found.unexplained.share == pytest.approx(share, abs=0.05)


def test_an_error_that_did_not_get_smaller_is_not_sold_as_a_gain():
    made = analysis(findings=[drag_finding()])
    worse = replace(made, traces=tuple(replace(t, named=1.2 * t.before, after=1.2 * t.before) for t in made.traces))
    found = make_verdict(worse, [], {})
    assert "is not smaller with this" in found.sentence and "goes from" not in " ".join(found.details)
    assert any("the error of the forward force is larger with the improved vehicle" in text for text in found.warnings)
    assert not make_verdict(made, [], {}).warnings
    assert "goes from" in " ".join(make_verdict(made, [], {}).details)


def test_a_burst_that_nothing_explains_is_unexplained():
    found = verdict_of(analysis(bursts=[("b", "moment_y", 20.0, 23.0, 6.0)]))
    assert found.verdict == "unexplained"
    assert "pitch moment" in found.sentence and "none of the known effects" in found.sentence


def test_the_sentence_says_where_what_and_how_much_better():
    found = verdict_of(analysis(findings=[drag_finding()]))
    assert "m/s of airspeed on, the forward force is" in found.sentence
    assert "rotor drag was left out; overall the error falls from 0.49 to 0.049 N (noise 0.049)" in found.sentence
    told = " ".join(found.details)
    assert "Rotor drag was left out: the sideways force grows with airspeed times rotor speed" in told
    assert "k_d = 6.00e-5 ± 0.20e-5 N s2/(rad m)" in told
    assert "on flights not used for fitting" in told and "the sensor's own noise is 0.049 N" in told


def test_a_wrong_value_is_told_with_what_was_believed():
    made = analysis(values={"mass_kg": (0.6, 0.652, 0.65, 0.654)}, findings=[drag_finding(status="absorbed")])
    found = verdict_of(made)
    assert found.sentence[0].isupper() and "the mass is 0.652 kg, not 0.600" in found.sentence
    assert "The mass is 0.6520 ± 0.0020 kg, not the 0.6000 kg believed." in found.details


def test_an_ambiguous_class_is_named_in_full_with_what_would_settle_it():
    finding = drag_finding(status="ambiguous", alternatives=("frame_drag", "rotor_drag"))
    told = " ".join(verdict_of(analysis(findings=[finding], next_manoeuvre="fly faster")).details)
    assert "Either rotor drag or" in told and "cannot show which" in told and "fly faster" in told


def test_the_simulation_run_forward_is_told_as_it_is():
    made = analysis(findings=[drag_finding()])

    def channel(before, after):
        errors = Errors(before=before, refitted=before, named=after, after=after)
        none = PValues(before=None, after=None)
        return Channel(unit="m", noise_floor=0.1, rmse=SplitErrors(training=errors, held_out=errors), p_value=none)

    forward = {"position": channel(1.0, 0.5), "attitude": channel(1.27, 1.27), "velocity": channel(1.0, 1.4)}
    found = verdict_of(made, forward)
    said = " ".join(found.details)
    assert "better: position (1.0 before, 0.50 m after)" in said and "no better: attitude (1.3 before" in said
    (warning,) = found.warnings
    assert (
        "velocity after half a second is larger with the improved vehicle: 1.4 m; with the refitted values alone 1.0 m"
        in warning
    )


def test_the_sentence_goes_by_size_and_names_what_stays_off():
    """0.015 N sideways is seven times its noise and nothing to a vehicle of 6.4 N; half a newton metre is not."""
    rng = np.random.default_rng(3)
    made = analysis(findings=[drag_finding(channels=("force_x",))])

    def changed(trace):
        if trace.channel == "force_x":
            small = 0.015 * rng.normal(size=len(trace.before))
            return replace(trace, before=small, refitted=small, named=0.1 * small, after=0.1 * small)
        if trace.channel == "moment_y":
            large = 0.45 * np.sin(trace.time_s)
            return replace(trace, before=large, refitted=large, named=large, after=large)
        return trace

    made = replace(made, traces=tuple(map(changed, made.traces)), noise_floor=made.noise_floor | {"force_x": 0.002})
    found = verdict_of(made)
    assert "the pitch moment stays 0.32 N m off" in found.sentence
    assert "% of the available pitch moment" in found.sentence and "rotor drag" in found.sentence


def test_a_doubt_that_stops_makes_the_set_not_judged():
    doubt = Doubt("mass_kg", "mass_kg is 652: the rotors lift 6.4 N; it would fit in grams.", stops=True)
    mild = Doubt("inertia_kg_m2", "inertia_kg_m2 is only proposed.", stops=False)
    found = verdict_of(replace(analysis(findings=[drag_finding()]), doubts=(mild, doubt)))
    assert found.verdict == "not_judged" and found.sentence.startswith("Not judged. mass_kg is 652")
    assert [d.what for d in found.doubts] == ["inertia_kg_m2", "mass_kg"]
    assert verdict_of(replace(analysis(findings=[drag_finding()]), doubts=(mild,))).verdict == "explained"


def test_all_believed_values_stand_in_one_table():
    row = ValueRow("mass_kg", 0.652, 0.70, 0.68, 0.72, 0.652)
    made = analysis(findings=[drag_finding()])
    made = replace(made, believed_values=(row,), value_correlations={("mass_kg", "thrust_coefficient_n_s2"): 0.999})
    found = verdict_of(made)
    value = found.believed_values["mass_kg"]
    assert (value.believed, value.estimate, value.interval_95, value.delivered) == (0.652, 0.70, (0.68, 0.72), 0.652)
    assert found.correlations[0].correlation == 0.999
    held = replace(row, low=float("nan"), high=float("nan"))
    assert verdict_of(replace(made, believed_values=(held,))).believed_values["mass_kg"].interval_95 == (None, None)


def test_a_floor_is_no_larger_than_an_error_that_is_reached_where_nothing_was_fitted():
    reached_there = Errors(before=0.4, refitted=0.3, named=None, after=0.2)
    assert reached(1.0, reached_there) == 0.2 and reached(0.1, reached_there) == 0.1
    assert reached(1.0, Errors(before=None, refitted=None, named=None, after=None)) == 1.0
    assert reached(None, reached_there) is None


def test_of_many_wrong_values_the_others_are_counted():
    values = {"mass_kg": (0.6, 0.652, 0.65, 0.654), "thrust_coefficient_n_s2": (1e-6, 2e-6, 1.9e-6, 2.1e-6)}
    values |= {f"inertia_{a}{a}_kg_m2": (0.01, 0.012, 0.011, 0.013) for a in "xy"}
    one, two = (verdict_of(analysis(values=dict(list(values.items())[:n]))).sentence for n in (3, 4))
    assert one.endswith("and one more value is wrong.") and two.endswith("and 2 more values are wrong.")


def test_nothing_is_explained_while_a_force_is_off_by_more_than_a_fifth_of_the_weight():
    made = analysis(findings=[drag_finding()])
    assert verdict_of(made).verdict == "explained"
    weight_n = made.believed.mass_kg * made.believed.gravity_m_s2
    far = [replace(t, named=t.named + 0.25 * weight_n) if t.channel == "force_z" else t for t in made.traces]
    unknown = replace(made, traces=tuple(far), noise_floor={**made.noise_floor, "force_z": weight_n})
    assert verdict_of(unknown).verdict == "partly_explained"
