"""The proof's tables as text: wrong values without their units, small coefficients in a power of ten."""

from pathlib import Path

import pandas as pd

from rotorid_proof import plots as proof
from rotorid_proof import show


def test_small_coefficients_stand_in_units_of_a_power_of_ten() -> None:
    row = {
        "study": "a",
        "effect": "rotor_drag",
        "symbol": "k_d",
        "found": 1.44e-6,
        "low_95": 1.14e-6,
        "high_95": 1.65e-6,
    }
    table = pd.DataFrame([row | {"published": 1.95e-6, "unit": "kg/rad", "source": "s"}])
    shown = show.of_published(table).iloc[0]
    assert (shown["found"], shown["published"], shown["unit"]) == ("1.44 (1.14 to 1.65)", "1.95", "1e-6 kg/rad")
    table.loc[0, ["found", "low_95", "high_95", "published"]] = [0.2, 0.1, 0.3, 0.26]
    assert show.of_published(table).iloc[0]["found"] == "0.2 (0.1 to 0.3)"


def test_a_wrong_value_is_named_without_its_unit() -> None:
    row = {
        "study": "a",
        "about": "b",
        "word": "explained",
        "found": "rotor_drag",
        "expected": None,
        "expected_found": None,
        "values": "inertia_yy_kg_m2; mass_kg",
        "unexplained_share": 1,
    }
    errors = {f"force_{stage}": 0.1 for stage in ("before", "refitted", "after")}
    shown = show.of_studies(pd.DataFrame([row | errors])).iloc[0]
    assert shown["found"] == "rotor drag; wrong values: inertia yy, mass"
    assert shown["error"] == "0.100 / 0.100 / 0.100 N".replace(" ", "\u00a0")


def test_families_in_which_nothing_was_wrong_stand_together():
    families = pd.DataFrame(
        [
            ("Drawn", "late", "2026-11-30", 1, 1, 0, None, None, "aa", 0),
            ("Drawn", "steady_wind", "2026-11-30", 2, 1, 0, None, "steady_wind 1", "aa", 0),
            ("Drawn", "clean", "2026-11-30", 4, 4, 0, None, None, "aa", 0),
        ],
        columns="simulator family released cases right false_alarms wrong_names missed judged_by looked_at".split(),
    )
    shown = show.of_families(families, {"2026-11-30": "6319ce1"})
    assert set(shown["released"]) == {"6319ce1"}
    assert shown["family"].tolist() == ["steady wind", "2 families, all right"]
    assert shown["cases"].tolist() == ["2", "5"] and shown["missed"].tolist() == ["steady wind 1", ""]


def release_row(key: str, value: float, cases: int) -> dict:
    blank = {"what": key, "at_least": None, "at_most": 0.05, "low_95": 0.0, "high_95": 1.0, "holds": "not refuted"}
    return {"id": key, "value": value, "cases": cases, "judged_by": "", "looked_at": 0, **blank}


def test_releases_have_a_row_for_each_date_and_simulator_and_one_for_all():
    rows = []
    for date, right in (("2026-11-26", 0.75), ("2026-11-27", 0.5)):
        for simulator in ("multibody", "stand_rig"):
            rows += [
                release_row(f"{simulator}_{date}_clean_alarms", 0.25, 4),
                release_row(f"{simulator}_{date}_right", right, 8),
                release_row(f"{simulator}_{date}_false", 0.1, 10),
            ]
    summary = pd.DataFrame([*rows, release_row("clean_alarms", 0.0, 20)])
    shown = show.of_releases(summary, {"2026-11-26": "40ff225"})
    assert shown["released"].tolist() == ["40ff225", "40ff225", "2026-11-27", "2026-11-27", "all"]
    assert list(shown["simulator"]) == ["flights (multibody)", "stands", "flights (multibody)", "stands", ""]
    assert list(shown["right"]) == ["6 of 8", "6 of 8", "4 of 8", "4 of 8", "20 of 32"]
    assert shown.iloc[-1]["alarms"] == "4 of 16"
    assert shown.iloc[-1]["share"] == "45.3 to 77.1 %".replace(" ", "\u00a0")
    # All targets stand in one table, those of releases too; further scores leave releases out.
    assert len(show.with_target(summary)) == len(summary)
    assert list(show.without_target(summary.assign(at_most=float("nan")))["what"]) == ["clean_alarms"]


def test_a_row_says_which_code_judged_it_and_what_was_looked_at() -> None:
    row = release_row("multibody_2026-11-26_false", 0.1, 10) | {"what": "Drawn stands, released 2026-11-26: wrong"}
    rows = pd.DataFrame(
        [
            row | {"judged_by": "c87a46b88923cd47"},
            row | {"judged_by": "unknown", "looked_at": 10},
            row | {"judged_by": None, "looked_at": 4},
        ]
    )
    shown = show.with_target(rows, {"2026-11-26": "40ff225"})
    assert shown["by"].tolist() == ["c87a46b", "not kept", "not kept, 4 seen"]
    assert shown["what"].unique().tolist() == ["Drawn stands, 40ff225: wrong"]
    assert shown["with_interval"][0] == "10.0 % (0.0 to 100.0 %)".replace(
        "0.0 to 100.0 %", "0.0\u00a0to\u00a0100.0\u00a0%"
    )


def test_codes_of_stored_tables() -> None:
    tables = {"a": pd.DataFrame({"judged_by": ["c87a46b88923cd47", None]}), "b": pd.DataFrame({"x": [1]})}
    assert show.codes_of(tables) == {"a": "c87a46b, not kept", "b": "not kept"}
    assert show.codes_of(tables, "24d4ace")["a"] == "c87a46b, not kept (of commit 24d4ace or before)"


def test_every_stored_table_of_the_repository_has_a_code_or_a_commit() -> None:
    stored = Path(__file__).parents[3] / "docs" / "proof"
    names = show.commits(pd.read_csv(stored / "releases.csv"))
    tables = {name: pd.read_csv(stored / f"{name}.csv") for name in ("cases", "confusion", "power", "peers", "real")}
    codes = show.codes_of(tables, names[show.DEVELOPMENT])
    assert codes["confusion"] == codes["power"] == codes["peers"] == "not kept (of commit 24d4ace or before)"
    assert codes["cases"].endswith(codes["power"]) and "not kept" not in codes["real"]
    drawn = tables["cases"].dropna(subset="released")
    by_release = pd.read_csv(stored / "releases.csv").set_index("released")["code"]
    assert (drawn["judged_by"] == drawn["released"].map(by_release)).all()


def test_the_figure_of_the_targets_has_every_target() -> None:
    rows = [release_row("clean_alarms", 0.0, 20), release_row("multibody_2026-11-26_right", 0.9, 4)]
    rows += [release_row("oracle", 1.01, 9) | {"at_most": 1.05, "low_95": 1.0, "high_95": 1.02}]
    fig = proof.targets(pd.DataFrame(rows).astype({"at_least": float}))
    labels = [text.get_text() for axis in fig.axes for text in axis.get_yticklabels()]
    assert sorted(labels) == ["clean_alarms (20)", "multibody_2026-11-26_right (4)", "oracle (9)"]


def test_what_was_expected_of_a_real_set_is_shown_and_whether_it_was_found() -> None:
    row = {"study": "a", "about": "cut", "word": "explained", "found": None, "values": None, "unexplained_share": 1}
    row |= {f"force_{stage}": 0.1 for stage in ("before", "refitted", "after")}
    rows = [row | {"expected": "unequal_rotors; com_offset", "expected_found": None}]
    rows += [row | {"expected": "motor_lag", "expected_found": "motor_lag"}, row | {"expected": None}]
    shown = show.of_studies(pd.DataFrame(rows))
    assert shown["expected"].tolist() == ["unequal rotors: no; com offset: no", "motor lag: found", "–"]
    assert shown["confirmed"].tolist() == [0, 1, ""]
    halted = show.of_studies(pd.DataFrame([rows[0] | {"word": "stopped"}])).iloc[0]
    assert (halted["found"], halted["error"], halted["confirmed"]) == ("the stage stopped", "–", 0)


def test_plantings_are_counted_by_flight_and_family():
    def scores(group: str, named: float, count: int) -> list[dict]:
        values = {"named": named, "size covered": 0.5, "ids new or lost a set": 0.68, "values new or lost a set": 0.0}
        rated = {"size": "large", "count": count, "at_least": float("nan"), "at_most": 0.1, "state": "fails"}
        return [{"group": group, "what": w, "value": v, **rated} for w, v in values.items()]

    now = pd.DataFrame([*scores("family air", 1.0, 2), *scores("all", 0.56, 25), *scores("kind mass", 0.0, 2)])
    shown = show.of_plantings(now)
    assert list(shown["group"]) == ["all", "target", "verdict", "air"]
    assert list(shown["named"]) == ["14 of 25", "≤ 0.1", "fails", "2 of 2"]
    assert shown.iloc[0]["moved"] == "0.68"


def test_a_channel_that_got_worse_says_by_how_much() -> None:
    channels = pd.DataFrame(
        {
            "example": "a",
            "channel": ["force_x", "force_z", "force_z"],
            "split": ["held_out", "held_out", "training"],
            "unit": "N",
            "before": [1.0, 0.106, 1.0],
            "refitted": [1.0, 0.106, 1.0],
            "after": [0.2, 0.456, 1.0],
            "noise_floor": [0.1, None, 0.1],
        }
    )
    shown = show.of_channels(channels)
    assert shown["channel"].tolist() == ["force x", "force z"]
    assert shown["worse"].tolist() == ["", "330.2 %"]
    assert shown["noise_floor"].tolist() == ["0.1", "–"]


def test_the_numbers_of_the_campaign_say_how_many_are_inside() -> None:
    row = {"set": "s", "effect": "com_offset", "numbers": 3, "held": 1, "symbol": "r_x", "unit": "m"}
    row |= {"truth": -4.045e-4, "found": -5.1e-4, "low_95": -5.2e-4, "high_95": -5.0e-4}
    shown = show.of_campaign_numbers(pd.DataFrame([row]))
    assert shown.iloc[0][["inside", "truth", "found", "unit"]].tolist() == [
        "1 of 3",
        "−404.5",
        "−510 (−520 to −500)",
        "1e-6 m",
    ]


def test_an_effect_stands_with_its_class_and_its_interval_in_one_cell() -> None:
    effects = pd.DataFrame(
        [
            ("rotor_drag", "established", "", "k_d", 4.08e-5, 3.9e-5, 4.34e-5, "N s2"),
            ("axial_inflow", "suggested", "axial_inflow or frame_drag", None, None, None, None, None),
        ],
        columns=["effect", "status", "alternatives", "symbol", "value", "low_95", "high_95", "unit"],
    )
    shown = show.of_effects(effects)
    assert shown.iloc[0].tolist() == ["rotor drag", "established", "k_d", "40.8 (39 to 43.4)", "1e-6 N s2"]
    unsure = pd.DataFrame([{**effects.iloc[0], "value": -4.38e-5, "low_95": -0.0052, "high_95": 0.0051}])
    assert show.of_effects(unsure)["value"].item() == "−0.00004 (−0.00520 to 0.00510)"
    assert shown.iloc[1].tolist() == ["axial inflow (or: axial inflow or frame drag)", "suggested", "", "", ""]
