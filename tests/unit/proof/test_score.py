"""Scores of verdicts and answers written by hand."""

import copy
import math

import pytest

from rotorid_proof import table
from rotorid_proof.intervals import bootstrap_mean, wilson
from rotorid_proof.score import f1_of_times, oracle_rms, score_case
from rotorid_proof.spelling import translated
from rotorid_proof.units import same_unit


def effect(id, status="established", alternatives=(), parameters=(), p=1e-9):
    listed = [{"symbol": s, "value": v, "unit": u, "interval_95": [low, high]} for s, v, u, low, high in parameters]
    return {
        "id": id, "status": status, "alternatives": list(alternatives), "parameters": listed, "p_value": p,
        "held_out_gain": None,
    }  # fmt: skip


def verdict(*effects, word="explained", values=None, locations=(), after=1.0):
    errors = {"before": 3.0, "refitted": 2.0, "after": after}
    return {
        "set": "set-x", "runs": {"training": ["a"], "held_out": ["b"]}, "verdict": word, "effects": list(effects),
        "parameters": values or {}, "locations": list(locations),
        "channels": {"force_x": {"rmse": {"training": errors, "held_out": errors}}},
    }  # fmt: skip


def hidden(id, equivalent=(), parameters=(), form=""):
    return {
        "id": id, "form": form, "parameters": [{"symbol": s, "value": v, "unit": u} for s, v, u in parameters],
        "size_over_noise": 1.5, "equivalent": list(equivalent),
    }  # fmt: skip


def answer(
    *effects, case="single/rotor_drag/moderate/0", wrong=None, outside=(), locations=(), verdicts=("explained",)
):
    return {
        "set": "set-x", "case": case, "expected": sorted([e["id"] for e in effects] + list(wrong or {})),
        "effects": list(effects), "wrong_parameters": wrong or {}, "outside_catalogue": list(outside),
        "locations": list(locations), "verdict": list(verdicts),
        "oracle": {"runs": {"b": {"force_x": {"noise_rms": 0.8}, "kinematic_force_x": {"noise_rms": 9.0}}}},
    }  # fmt: skip


def test_the_right_effect_alone_scores_in_full() -> None:
    s = score_case(verdict(effect("rotor_drag")), answer(hidden("rotor_drag")))
    assert s["named"] and s["top_one"] and s["inside"] and s["whole_set"] and s["ambiguity_right"]
    assert s["false_count"] == 0
    # 1.0 N left, 0.8 N of noise
    assert s["held_out_after"] == pytest.approx(1.25) and s["held_out_before"] == pytest.approx(3.75)


def test_a_wrong_name_is_false_and_misses() -> None:
    s = score_case(verdict(effect("frame_drag")), answer(hidden("rotor_drag")))
    assert not s["named"] and not s["inside"] and not s["whole_set"]
    assert (s["false_names"], s["missed"]) == (["frame_drag"], ["rotor_drag"])


def test_a_class_wider_than_the_data_demand_is_inside_but_not_named() -> None:
    both = effect("rotor_drag", "ambiguous", ["rotor_drag", "frame_drag"])
    s = score_case(verdict(both), answer(hidden("rotor_drag")))
    assert s["inside"] and not s["named"] and not s["ambiguity_right"] and s["false_count"] == 0
    s = score_case(verdict(both), answer(hidden("rotor_drag", equivalent=["frame_drag"])))
    assert s["inside"] and s["named"] and s["ambiguity_right"] and not s["separable"]
    # Naming one of two that cannot be told apart states too much.
    s = score_case(verdict(effect("rotor_drag")), answer(hidden("rotor_drag", equivalent=["frame_drag"])))
    assert s["named"] and not s["ambiguity_right"]


def test_a_stands_error_is_held_against_the_noise_of_as_many_samples() -> None:
    means = {"1": 0.2, "4": 0.1}
    truth = answer(hidden("creep"), case="stand/single/creep/strong/0")
    truth["oracle"] = {"runs": {"b": {"force_z": {"noise_rms": 7.0, "noise_rms_of_means": means}}}}
    assert oracle_rms(truth, ["b"]) == pytest.approx({"force_z": 0.2})
    assert oracle_rms(truth, ["b"], samples_per_row=4) == pytest.approx({"force_z": 0.1})
    assert oracle_rms(truth, ["b"], samples_per_row=5) == {}


def test_what_cannot_be_told_apart_may_be_listed_in_groups() -> None:
    both = effect("creep", "ambiguous", ["creep", "zero_drift"])
    truth = answer(hidden("creep", equivalent=[["creep", "zero_drift"]]), case="bench/single/creep/strong/0")
    s = score_case(verdict(both), truth)
    assert s["named"] and (s["kind"], s["family"]) == ("bench", "single")
    rows = {row["id"] for row in table.summary([s])}
    assert "bench_single_named" in rows and "stand_single_named" not in rows


def test_one_class_reported_by_each_of_its_members_is_one_claim() -> None:
    twins = [effect(i, "ambiguous", ["delay", "motor_lag"]) for i in ("delay", "motor_lag")]
    s = score_case(verdict(*twins), answer(hidden("delay", equivalent=["motor_lag"])))
    assert s["claim_count"] == 1


def test_clean_and_alarmed() -> None:
    clean = answer(case="clean/000", verdicts=["no_mismatch"])
    assert not score_case(verdict(word="no_mismatch"), clean)["false_alarm"]
    assert score_case(verdict(word="unexplained"), clean)["false_alarm"]
    assert score_case(verdict(effect("gust")), clean)["false_alarm"]
    assert score_case(verdict(values={"mass_kg": {}}, word="explained"), clean)["false_alarm"]


def test_wrong_values_are_scored_apart_from_physics() -> None:
    truth = answer(case="wrong/mass_kg/0", wrong={"mass_kg": {"believed": 0.66, "true": 0.65}})
    found = {"mass_kg": {"believed": 0.66, "refitted": 0.651, "interval_95": [0.648, 0.654]}}
    s = score_case(verdict(values=found), truth)
    assert s["values_right"] and s["claim_count"] == 0 and s["truth"] == []
    assert s["parameters"][0]["covered"] and s["parameters"][0]["relative_error"] == pytest.approx(1 / 650)
    # distances believed 5 % too long: their scale is 1 / 1.05 of the believed one, which a verdict calls 1
    scale = answer(case="wrong/arm_scale/0", wrong={"arm_scale": {"believed": 1.05, "true": 1.0}})
    found_scale = {"arm_scale": {"believed": 1.0, "refitted": 0.952, "interval_95": [0.950, 0.954]}}
    assert score_case(verdict(values=found_scale), scale)["parameters"][0]["covered"]
    assert not score_case(verdict(values={"inertia_xx_kg_m2": found["mass_kg"]}), truth)["values_right"]


def test_a_stage_that_stopped_is_right_in_nothing() -> None:
    s = score_case({"failed": "ValueError: x"}, answer(hidden("rotor_drag")))
    assert s["failed"] and not s["named"] and not s["inside"] and not s["whole_set"]


def test_a_cause_outside_the_catalogue_may_only_get_an_acceptable_name() -> None:
    cause = [{"id": "banner", "acceptable": ["frame_drag"]}]
    truth = answer(case="outside/banner/0", outside=cause, verdicts=["unexplained", "partly_explained"])
    assert score_case(verdict(effect("frame_drag"), word="partly_explained"), truth)["false_count"] == 0
    s = score_case(verdict(effect("gust"), word="explained"), truth)
    assert s["false_count"] == 1 and not s["word_right"]


def test_parameters_are_compared_in_one_spelling() -> None:
    truth = answer(hidden("rotor_drag", parameters=[("k_d", 2.0, "N/(rad/s m/s)")]))
    found = effect("rotor_drag", parameters=[("k_d", 2.1, "N s2/(rad m)", 1.9, 2.05)])
    (only,) = score_case(verdict(found), truth)["parameters"]
    assert only["covered"] is True and only["relative_error"] == pytest.approx(0.05)
    blade = copy.deepcopy(truth)
    blade["effects"][0]["form"] = "blade"
    assert score_case(verdict(found), blade)["parameters"] == []


def test_units() -> None:
    assert same_unit("N m/(rad/s m/s)", "N m s2/(rad m)")
    assert same_unit("N/(m/s)^2", "N s2/m2")
    assert same_unit("-", "1") and same_unit("N m s", "N m s/rad")
    assert not same_unit("N s/m", "N s2/m2")


def test_answers_in_the_catalogues_symbols() -> None:
    lag = [{"symbol": "tau_up", "value": 0.04, "unit": "s"}, {"symbol": "tau_down", "value": 0.04, "unit": "s"}]
    assert translated("motor_lag", lag)[-1] == {"symbol": "tau", "value": 0.04, "unit": "s"}
    areas = [{"symbol": f"CdA_{a}", "value": 0.02, "unit": "m2"} for a in "xyz"]
    # half of 1.225 kg/m3 times 0.02 m2
    assert translated("frame_drag", areas)[-1] == {"symbol": "c", "value": 0.01225, "unit": "N s2/m2"}


def test_overlap_of_times() -> None:
    # 3 s true, 2 s of them found, 1 s beyond: precision and recall two thirds
    assert f1_of_times([("a", 12.0, 15.0)], [("a", 13.0, 16.0)])["f1"] == pytest.approx(2 / 3)
    assert f1_of_times([("a", 12.0, 15.0)], [("b", 12.0, 15.0)])["f1"] == 0
    # two channels with one stretch count once
    assert f1_of_times([("a", 0.0, 1.0)], [("a", 0.0, 1.0), ("a", 0.0, 1.0)])["f1"] == 1
    assert f1_of_times([], [("a", 0.0, 1.0)]) is None


def test_wilsons_interval_by_hand() -> None:
    # 9 of 10: centre (0.9 + 3.8415/20) / 1.38415, half width 1.96/1.38415 sqrt(0.009 + 3.8415/400)
    assert wilson(9, 10) == pytest.approx((0.59585, 0.98212), abs=1e-5)
    assert wilson(0, 220) == (0.0, pytest.approx(0.01716, abs=1e-5))
    assert wilson(0, 0) == (0.0, 1.0)


def test_bootstrap_of_a_constant_has_no_width() -> None:
    assert bootstrap_mean([0.7] * 5) == pytest.approx((0.7, 0.7))
    assert all(math.isnan(x) for x in bootstrap_mean([]))


def test_the_table_of_targets() -> None:
    scores = [
        score_case(verdict(effect("rotor_drag")), answer(hidden("rotor_drag"))),
        score_case(verdict(effect("gust")), answer(hidden("rotor_drag"), case="single/rotor_drag/moderate/1")),
        score_case(verdict(word="no_mismatch"), answer(case="clean/000", verdicts=["no_mismatch"])),
        score_case(
            verdict(effect("rotor_drag"), effect("com_offset"), effect("gust")),
            answer(hidden("rotor_drag"), hidden("com_offset"), case="mixture/00/0"),
        ),
    ]
    rows = {row["id"]: row for row in table.summary(scores)}
    assert rows["single_named"]["value"] == 0.5 and rows["single_named"]["holds"] == "fails"
    assert rows["clean_alarms"]["value"] == 0.0 and rows["clean_alarms"]["holds"] == "not refuted"
    assert rows["mixture_whole"]["value"] == 0.0
    assert rows["mixture_false"]["value"] == pytest.approx(1 / 3)
    assert rows["location_f1"]["holds"] is None
    confusion = {(r["truth"], r["claimed"]): r["share"] for r in table.confusion(scores)}
    assert confusion == {("rotor_drag", "rotor_drag"): 0.5, ("rotor_drag", "gust"): 0.5, ("nothing", "nothing"): 1.0}


def test_a_target_holds_only_if_the_whole_interval_is_inside() -> None:
    assert table.holds(0.0, None, 0.01, *wilson(0, 20)) == "not refuted"  # up to 0.16
    assert table.holds(0.0, None, 0.01, *wilson(0, 400)) == "holds"  # up to 0.0095
    assert table.holds(0.5, 0.95, None, *wilson(10, 20)) == "fails"
    assert table.holds(0.95, 0.92, 0.98, 0.93, 0.97) == "holds"
    assert table.holds(0.95, 0.92, 0.98, 0.93, 0.99) == "not refuted"
    assert table.holds(1.0, 1.0, None) == "holds" and table.holds(None, 1.0, None) is None


def test_rows_carry_the_code_that_judged_and_what_was_looked_at() -> None:
    def clean(case, released, code):
        s = score_case(
            verdict(word="no_mismatch"), answer(case=case, verdicts=["no_mismatch"]) | {"released": released}
        )
        return s | {"judged_by": code}

    scores = [
        clean("multibody/clean/2026-11-30/000", "2026-11-30", "aa"),
        clean("multibody/clean/2026-11-30/001", "2026-11-30", "bb"),
        clean("multibody/clean/development/000", "", ""),
    ]
    rows = {row["id"]: row for row in table.drawn_rows(scores)}
    fresh, own = rows["multibody_2026-11-30_clean_alarms"], rows["multibody_clean_alarms"]
    assert (fresh["cases"], fresh["judged_by"], fresh["looked_at"]) == (2, "aa bb", 0)
    assert (own["cases"], own["judged_by"], own["looked_at"]) == (1, "unknown", 1)
    # drawn cases count in no other row
    assert {row["id"]: row["cases"] for row in table.summary(scores)}["clean_alarms"] == 0


def test_what_is_fair_to_say_is_no_false_alarm() -> None:
    log = answer(case="continuous/clean/development/000", verdicts=["no_mismatch", "explained"])
    log |= {"fair": ["vibration"]}
    assert not score_case(verdict(effect("vibration")), log)["false_alarm"]
    assert score_case(verdict(effect("delay")), log)["false_alarm"]
    assert score_case(verdict(values={"mass_kg": {}}), log)["false_alarm"]


def test_a_drawn_case_is_right_with_all_its_effects_and_values() -> None:
    truth = answer(hidden("payload"), case="multibody/slung_load/development/000") | {"fair": ["mass_kg"]}
    assert score_case(verdict(effect("payload"), values={"mass_kg": {}}), truth)["right"]
    assert not score_case(verdict(effect("payload"), values={"inertia_xx_kg_m2": {}}), truth)["right"]
    assert not score_case(verdict(effect("payload"), effect("gust")), truth)["right"]
    row = table.drawn_families([score_case(verdict(effect("gust")), truth) | {"judged_by": "aa"}])[0]
    assert (row["family"], row["right"], row["wrong_names"], row["missed"]) == ("slung_load", 0, "gust 1", "payload 1")


def test_power_is_pooled_over_effects() -> None:
    def case(id, size, found):
        said = [effect(id)] if found else []
        return score_case(verdict(*said), answer(hidden(id), case=f"power/{id}/{size}/0"))

    scores = [case("gust", 0.1, False), case("rotor_drag", 0.1, True), case("gust", 1.0, True)]
    found = {(r["effect"], r["size_over_noise"]): r["detected"] for r in table.power(scores)}
    assert found[("all", 0.1)] == 0.5 and found[("all", 1.0)] == 1.0 and found[("gust", 0.1)] == 0.0


def test_better_than_all_needs_a_better_joint_score() -> None:
    ours = dict.fromkeys(table.PEER_COLUMNS, 0.9) | {"mixture_false": 0.0, "clean_alarms": 0.0, "wrong_physics": 0.0}
    other = ours | {"single_named": 0.5}
    rows = [{"method": "rotorid", **ours}, {"method": "other", **other}]
    assert table.better_than_all(rows, "rotorid") is True
    assert table.better_than_all(rows, "other") is False
    assert table.better_than_all(rows[:1], "rotorid") is None
