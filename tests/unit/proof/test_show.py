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
MOST_ROWS = {"of_questions": 28, "of_releases": 12, "of_drawn": 6, "of_plantings": 4}
"""Rows of the tables in the proof's chapter: all of them together fill two pages, and it stays one that is read."""


def stored(name: str) -> pd.DataFrame:
    return pd.read_csv(STORED / f"{name}.csv", low_memory=False)


def drawn(released: str, kind: str, clean: bool, right: bool = True, false: int = 0) -> dict:
    counts = {"claim_count": 0 if clean else 1, "false_count": false, "false_alarm": clean and not right}
    return {"released": released, "kind": kind, "clean": clean, "right": right, "judged_by": "c87a46b88923", **counts}


def test_drawn_cases_have_a_row_for_each_kind_and_the_state_of_their_targets() -> None:
    cases = [drawn("aa", "flight", clean=False, right=k > 0, false=int(k == 0)) for k in range(8)]
    cases += [drawn("aa", "bench", clean=False)] + [drawn("aa", "flight", clean=True, right=k > 9) for k in range(20)]
    cases = pd.DataFrame([*cases, drawn("bb", "stand", clean=False), {"released": None, "kind": "flight"}])
    shown = show.of_drawn(cases, "aa")
    assert shown["kind"].tolist() == ["flights", "benches", "all", "target", "state"]
    assert shown["hidden"].tolist() == ["8", "1", "9", "", ""] and shown["right"].tolist()[:3] == ["7", "1", "8"]
    assert shown["alarms"].tolist() == ["10 of 20", "–", "10 of 20", "≤ 1 %", "fails"]
    assert shown["names"].tolist()[2:] == ["1 of 9", "≤ 5 %", "not refuted"] and shown["wrong"][2] == "1"
    assert show.of_drawn(cases, "cc").empty


def test_a_release_has_one_row_and_all_releases_one_more() -> None:
    cases = pd.DataFrame([drawn(r, kind, clean) for r in "ab" for kind in ("flight", "stand") for clean in (0, 1)])
    named = [("development", "24d4aceab5", None), ("a", "40ff225aa7", "c87a46b8"), ("b", "dfbaf78b", "c9fa")]
    shown = show.of_releases(cases, pd.DataFrame(named, columns=["released", "commit", "code"]))
    assert shown["released"].tolist() == ["40ff225", "dfbaf78", "all"]
    assert shown["by"].tolist() == ["c87a46b", "c9fa", "each its own"]
    assert shown["right"].tolist() == ["2", "2", "4"] and shown["alarms"].tolist() == ["0 of 2", "0 of 2", "0 of 4"]


def test_questions_are_the_stored_summary_with_the_kinds_together() -> None:
    summary, better = stored("summary").set_index("id"), stored("summary").tail(0)
    shown = show.of_questions(stored("cases"), stored("parameters"), better).set_index("what")
    row = shown.loc["Single effects, weak: right one named"]
    prefixes = ("", "stand_", "bench_")
    assert row["kinds"] == " / ".join(f"{100 * summary['value'][f'{p}single_weak']:.3g}" for p in prefixes) + " %"
    assert int(row["cases"]) == sum(summary["cases"][f"{p}single_weak"] for p in prefixes)
    of_flights_alone = shown.loc["Location: stated regime is the effect's"]
    assert of_flights_alone["kinds"] == ""
    assert of_flights_alone["measured"] == f"{100 * summary['value']['regime']:.1f} %"
    # What has a target stands first.
    assert (shown["target"] != "").tolist() == sorted(shown["target"] != "", reverse=True)


def test_the_stored_summary_follows_from_the_stored_cases() -> None:
    rows = pd.DataFrame(table.summary(table.scores_from(stored("cases"), stored("parameters")))).set_index("id")
    kept = stored("summary").set_index("id").drop(index="better")
    assert sorted(rows.index) == sorted(kept.index)
    kept = kept.loc[rows.index]
    assert (rows["holds"].fillna("") == kept["holds"].fillna("")).all() and (rows["cases"] == kept["cases"]).all()
    for column in ("value", "low_95", "high_95"):
        np.testing.assert_allclose(rows[column].astype(float), kept[column], rtol=1e-5)


def test_the_chapter_stays_one_that_is_read_to_the_end() -> None:
    """Before: thirteen pages of 94 targets, one for each family of each release."""
    releases = stored("releases")
    planted = show.of_plantings(stored("plantings_summary"))
    sizes = {
        "of_questions": len(show.of_questions(stored("cases"), stored("parameters"), stored("summary").tail(0))),
        "of_releases": len(show.of_releases(stored("cases"), releases)),
        "of_drawn": len(show.of_drawn(stored("cases"), str(releases["released"].iloc[-1]))),
        "of_plantings": int(planted["kind"].isin(["code", "all", "target", "state"]).sum()),
    }
    assert {name: most for name, most in MOST_ROWS.items() if sizes[name] > most} == {}
    assert min(sizes.values()) > 3


def test_codes_of_stored_tables() -> None:
    tables = {"a": pd.DataFrame({"judged_by": ["c87a46b88923cd47", None]}), "b": pd.DataFrame({"x": [1]})}
    assert show.codes_of(tables) == {"a": "c87a46b, not kept", "b": "not kept"}
    assert show.codes_of(tables, "24d4ace")["a"] == "c87a46b, not kept (of commit 24d4ace or before)"


def test_every_stored_table_of_the_repository_has_a_code_or_a_commit() -> None:
    names = show.commits(stored("releases"))
    tables = {name: stored(name) for name in ("cases", "confusion", "power", "peers", "real")}
    codes = show.codes_of(tables, names[show.DEVELOPMENT])
    assert codes["confusion"] == codes["power"] == codes["peers"] == "not kept (of commit 24d4ace or before)"
    assert codes["cases"].endswith(codes["power"]) and "not kept" not in codes["real"]
    drawn = tables["cases"].dropna(subset="released")
    by_release = stored("releases").set_index("released")["code"]
    assert (drawn["judged_by"] == drawn["released"].map(by_release)).all()


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


def test_plantings_are_counted_by_flight_and_family():
    def scores(group: str, named: float, count: int) -> list[dict]:
        values = {"named": named, "size covered": 0.5, "ids new or lost a set": 0.68, "values new or lost a set": 0.0}
        rated = {"size": "large", "count": count, "at_least": float("nan"), "at_most": 0.1, "state": "fails"}
        return [{"group": group, "what": w, "value": v, **rated} for w, v in values.items()]

    groups = [("family air", 1.0, 2), ("all", 0.56, 25), ("code 07ac8cc", 0.5, 10), ("kind mass", 0.0, 2)]
    shown = show.of_plantings(pd.DataFrame([score for group in groups for score in scores(*group)]))
    assert list(shown["group"]) == ["code 07ac8cc", "all codes", "target", "state", "air"]
    assert list(shown["named"]) == ["5 of 10", "14 of 25", "≤ 0.1", "fails", "2 of 2"]
    assert shown.iloc[0]["moved"] == "0.68"


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
