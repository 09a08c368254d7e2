"""The proof's tables as text: wrong values without their units, small coefficients in a power of ten."""

import pandas as pd

from rotorid.proof import show


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
        "found": "rotor_drag",
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
    shown = show.of_families(families)
    assert shown["family"].tolist() == ["steady wind", "2 families, all right"]
    assert shown["cases"].tolist() == ["2", "5"] and shown["missed"].tolist() == ["steady wind 1", ""]
