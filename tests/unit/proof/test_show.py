"""The proof's tables as text: wrong values without their units, small coefficients in a power of ten."""

from pathlib import Path

import numpy as np
import pandas as pd

from rotorid_proof import show, table


def test_small_coefficients_stand_in_units_of_a_power_of_ten() -> None:
    row = {
        "study": "a", "effect": "rotor_drag", "symbol": "k_d", "found": 1.44e-6, "low_95": 1.14e-6,
        "high_95": 1.65e-6,
    }  # fmt: skip
    table = pd.DataFrame([row | {"published": 1.95e-6, "unit": "kg/rad", "source": "s"}])
    shown = show.of_published(table).iloc[0]
    assert (shown["found"], shown["published"], shown["unit"]) == ("1.44 (1.14 to 1.65)", "1.95", "1e-6 kg/rad")
    table.loc[0, ["found", "low_95", "high_95", "published"]] = [0.2, 0.1, 0.3, 0.26]
    assert show.of_published(table).iloc[0]["found"] == "0.2 (0.1 to 0.3)"


def test_a_wrong_value_is_named_without_its_unit() -> None:
    row = {
        "study": "a", "about": "b", "word": "explained", "found": "rotor_drag", "expected": None,
        "expected_found": None, "values": "inertia_yy_kg_m2; mass_kg", "unexplained_share": 1,
    }  # fmt: skip
    errors = {f"force_{stage}": 0.1 for stage in ("before", "refitted", "after")}
    shown = show.of_studies(pd.DataFrame([row | errors])).iloc[0]
    assert shown["found"] == "rotor drag; wrong values: inertia yy, mass"
    assert shown["error"] == "0.100 / 0.100 / 0.100 N".replace(" ", "\u00a0")


STORED = Path(__file__).parents[3] / "docs" / "proof"


def stored(name: str) -> pd.DataFrame:
    return pd.read_csv(STORED / f"{name}.csv", low_memory=False)


def test_what_had_to_be_named_is_counted_apart_from_what_had_not() -> None:
    def case(**changes):
        row = {
            "released": "aa",
            "kind": "flight",
            "clean": False,
            "right": True,
            "false_count": 0,
            "false_alarm": False,
        }
        row |= {"truth": "motor_lag", "primary": "motor_lag", "values_true": None, "claims": "motor_lag"}
        return row | {"judged_by": "c87a46b88923"} | changes

    outside = {"truth": None, "primary": None}
    cases = [case(), case(claims="motor_lag; vibration"), case(right=False, false_count=1, claims="gust")]
    cases += [case(truth=None, primary=None, values_true="mass_kg", claims=None), case(**outside, claims=None)]
    cases += [case(**outside, claims="axial_inflow"), case(clean=True, **outside, claims=None), case(released="bb")]
    planted = [("code 07ac8cc", "named", 0.75, 8), ("code 07ac8cc", "size covered", 0.5, 4), ("all", "named", 1.0, 99)]
    plantings = pd.DataFrame([(*row, "large") for row in planted], columns=["group", "what", "value", "count", "size"])
    shown = show.of_stored(pd.DataFrame(cases), plantings, "aa").set_index("key")
    counts = {key: (row["count"], row["of"]) for key, row in shown.iterrows()}
    assert counts["all"] == (3, 4) and counts["further"] == (1, 3) and counts["outside"] == (2, 2)
    assert counts["allowed"] == (1, 2) and counts["wrong"] == (1, 6) and counts["alarms"] == (0, 1)
    assert counts["planted"] == (6, 8) and shown.loc["planted_size", "code"] == "07ac8cc"
    assert show.of_stored(pd.DataFrame(cases), plantings, "cc")["key"].tolist() == ["planted", "planted_size"]


def test_the_stored_table_counts_what_the_page_says() -> None:
    """The page of the proof and the report are of the same rows."""
    last = str(stored("releases")["released"].iloc[-1])
    shown = show.of_stored(stored("cases"), stored("plantings_summary"), last).set_index("key")
    page = (STORED / "README.md").read_text(encoding="utf-8")
    for key in ("all", "outside", "wrong"):
        assert f"{shown.loc[key, 'count']} of {shown.loc[key, 'of']}" in page
    judged = [*stored("cases")["judged_by"], *stored("plantings")["code"]]
    assert set(shown["code"]) <= set(show.short_code(c) for c in judged)


def labelled(**changes):
    effect = {"id": "unequal_rotors", "status": "established", "alternatives": [], "equation": "C_F (1 + d_i)"}
    effect["share"] = 0.14
    number = {"symbol": "d_3", "value": -0.11, "unit": "1", "interval_95": [-0.16, 0.08]}
    held_out = dict.fromkeys(("before", "refitted", "named", "after"), 0.5)
    verdict = {
        "verdict": "explained", "sentence": "s", "basis": {"sentence": "b"}, "doubts": [], "warnings": [],
        "effects": [effect | {"parameters": [number]}, effect | {"id": "gust", "status": "suggested"}],
        "runs": {"held_out": ["b"], "training": ["a"]}, "unexplained": {"share": 0.1, "description": ""},
        "channels": {"moment_x": {"unit": "N m", "noise_floor": 0.1, "rmse": {"held_out": held_out}}},
    }  # fmt: skip
    return {"study": "crazypad-cut", "available": True, "reason": "", "verdict": verdict | changes}


def test_a_labelled_set_shows_what_is_claimed_of_it() -> None:
    state = show.labelled_state([labelled()])
    assert state["available"] and state["sets"]["cut"]["unequal_rotors"]["numbers"]["d_3"]["value"] == -0.11
    assert state["sets"]["cut"]["names"] == ["unequal rotors"] and state["sets"]["cut"]["com_offset"] is None
    verdicts = {"crazypad-cut": labelled()["verdict"]}
    named, errors = show.of_labelled(verdicts), show.of_errors(verdicts)
    assert named.drop(columns="equation").values.tolist() == [
        ["propeller 3 cut", "unequal rotors", "d_3 = −0.11 (−0.16 to 0.08)", "14 %"]
    ]
    assert errors[["channel", "unit", "named", "noise"]].values.tolist() == [["moment x", "mN m", "500", "100"]]
    gone = show.labelled_state([labelled(), {"study": "x", "available": False, "reason": "no answer"}])
    assert gone == {"available": False, "reason": "no answer", "sets": {}}


def test_the_stored_summary_follows_from_the_stored_cases() -> None:
    rows = pd.DataFrame(table.summary(table.scores_from(stored("cases"), stored("parameters")))).set_index("id")
    kept = stored("summary").set_index("id").drop(index="better")
    assert sorted(rows.index) == sorted(kept.index)
    kept = kept.loc[rows.index]
    assert (rows["holds"].fillna("") == kept["holds"].fillna("")).all() and (rows["cases"] == kept["cases"]).all()
    for column in ("value", "low_95", "high_95"):
        np.testing.assert_allclose(rows[column].astype(float), kept[column], rtol=1e-5)


def test_what_was_expected_of_a_real_set_is_shown_and_whether_it_was_found() -> None:
    row = {"study": "a", "about": "cut", "word": "explained", "found": None, "values": None, "unexplained_share": 1}
    row |= {f"force_{stage}": 0.1 for stage in ("before", "refitted", "after")}
    rows = [row | {"expected": "unequal_rotors; com_offset", "expected_found": None}]
    rows += [row | {"expected": "motor_lag", "expected_found": "motor_lag"}, row | {"expected": None}]
    shown = show.of_studies(pd.DataFrame(rows))
    assert shown["expected"].tolist() == ["unequal rotors; com offset", "motor lag", "–"]
    assert shown["lacking"].tolist() == ["unequal rotors; com offset", "–", "–"]
    assert shown["confirmed"].tolist() == [0, 1, ""]
    halted = show.of_studies(pd.DataFrame([rows[0] | {"word": "stopped"}])).iloc[0]
    assert (halted["found"], halted["error"], halted["confirmed"]) == ("the stage stopped", "–", 0)


def test_a_channel_that_got_worse_says_by_how_much() -> None:
    channels = pd.DataFrame(
        {
            "example": "a", "channel": ["force_x", "force_z", "force_z"],
            "split": ["held_out", "held_out", "training"], "unit": "N", "before": [1.0, 0.106, 1.0],
            "refitted": [1.0, 0.106, 1.0], "after": [0.2, 0.456, 1.0], "noise_floor": [0.1, None, 0.1],
        }
    )  # fmt: skip
    shown = show.of_channels(channels)
    assert shown["channel"].tolist() == ["force x", "force z"]
    assert shown["worse"].tolist() == ["", "330.2 %"] and shown["noise_floor"].tolist() == ["0.1", "–"]


def test_the_numbers_of_the_campaign_say_how_many_are_inside() -> None:
    row = {"set": "s", "effect": "com_offset", "numbers": 3, "held": 1, "symbol": "r_x", "unit": "m"}
    row |= {"truth": -4.045e-4, "found": -5.1e-4, "low_95": -5.2e-4, "high_95": -5.0e-4}
    shown = show.of_campaign_numbers(pd.DataFrame([row]))
    cells = shown.iloc[0][["inside", "truth", "found", "unit"]].tolist()
    assert cells == ["1 of 3", "−404.5", "−510 (−520 to −500)", "1e-6 m"]


def test_an_effect_stands_with_its_class_and_its_interval_in_one_cell() -> None:
    rows = [
        ("rotor_drag", "established", None, "k_d", 4.08e-5, 3.9e-5, 4.34e-5, "N s2"),
        ("axial_inflow", "suggested", "axial_inflow or frame_drag", None, None, None, None, None),
    ]
    names = ["effect", "status", "alternatives", "symbol", "value", "low_95", "high_95", "unit"]
    effects = pd.DataFrame(rows, columns=names)
    shown = show.of_effects(effects)
    assert shown.iloc[0].tolist() == ["rotor drag", "established", "k_d", "40.8 (39 to 43.4)", "1e-6 N s2"]
    unsure = pd.DataFrame([{**effects.iloc[0], "value": -4.38e-5, "low_95": -0.0052, "high_95": 0.0051}])
    assert show.of_effects(unsure)["value"].item() == "−0.00004 (−0.00520 to 0.00510)"
    assert shown.iloc[1].tolist() == ["axial inflow (or: frame drag)", "suggested", "", "", ""]
