"""Lines of the table of real recordings, from a verdict written by hand."""

import json
from pathlib import Path

import pandas as pd
import pytest

from rotorid_proof import real
from rotorid_proof.studies import STUDIES, Published, Study
from workflow.scripts import tabulate_real


def verdict(**changes):
    def errors(a, b, c):
        return {"rmse": {"held_out": {"before": a, "refitted": b, "after": c}}}

    base = {
        "verdict": "explained",
        "runs": {"held_out": ["b"]},
        "effects": [
            {
                "id": "rotor_drag",
                "status": "established",
                "alternatives": [],
                "parameters": [{"symbol": "k_d", "value": 4e-5, "unit": "N s2/(rad m)", "interval_95": [3e-5, 5e-5]}],
            },
            {"id": "gust", "status": "not_established", "alternatives": [], "parameters": []},
        ],
        "parameters": {},
        "channels": {"force_x": errors(3.0, 3.0, 0.3), "force_y": errors(4.0, 4.0, 0.4)},
        "unexplained": {"share": 0.1, "depends_on": ["airspeed_m_s"]},
    }
    return base | changes


def test_a_line_of_the_table() -> None:
    row = real.row_of(verdict(), Study("s", "set", ("rotor_drag", "delay"), "about"))
    assert row["found"] == "rotor_drag" and row["expected_found"] == "rotor_drag"
    # 3-4-5
    assert (row["force_before"], row["force_after"]) == (pytest.approx(5.0), pytest.approx(0.5))
    assert row["moment_after"] is None and list(row) == real.ROW_COLUMNS


def test_a_published_number_in_its_own_terms() -> None:
    theirs = Published("rotor_drag", "k_d", 0.26, "N s/m", "x", times_total_speed=True)
    (row,) = real.compared(verdict(), Study("s", "set", (), "", published=(theirs,)), total_speed=6000.0)
    # 4e-5 N s2/(rad m) times 6000 rad/s
    assert row["found"] == pytest.approx(0.24) and row["high_95"] == pytest.approx(0.30)
    assert list(row) == real.COMPARED_COLUMNS
    assert real.compared(verdict(effects=[]), Study("s", "set", (), "", published=(theirs,)), 6000.0) == []


def test_studies_have_names_of_their_own() -> None:
    names = [s.name for s in STUDIES]
    assert len(set(names)) == len(names)


def test_errors_of_neurobem_are_totals_over_the_axes_as_ours_are():
    """(0.3, 0.4, 1.2) N is 1.3 N in all, (3, 4, 0) mN m is 5 mN m; the rigid body's own line is another model's."""
    line = {"flight": "a", "force_x": 0.3, "force_y": 0.4, "force_z": 1.2}
    line |= {"moment_x": 0.003, "moment_y": 0.004, "moment_z": 0.0, "force": 0.75, "moment": 0.003}
    own = real.neurobem_errors([line | {"model": "neurobem"}, line | {"model": "rigid_body", "force_z": 9.0}])
    assert own == {("a", "force"): pytest.approx(1.3), ("a", "moment"): pytest.approx(0.005)}


def test_a_study_on_which_the_stage_stopped_has_its_line(tmp_path: Path) -> None:
    """Before: it was left out of the table as a recording is that could not be obtained."""
    results = {
        "neurobem-1": {"available": True, "row": real.row_of(verdict(), STUDIES[0]), "compared": []},
        "neurobem-4": {"available": False, "reason": f"{real.STOPPED}: KeyError: 'wind'", "study": "neurobem-4"},
        "crazypad-cut": {"available": False, "reason": "not obtained", "study": "crazypad-cut"},
    }
    for name, result in results.items():
        (tmp_path / f"{name}.json").write_text(json.dumps({"reason": ""} | result))
    columns = ["flight", "model", *(f"{g}_{a}" for g in ("force", "moment") for a in "xyz")]
    pd.DataFrame(columns=columns).to_csv(tmp_path / "flights.csv", index=False)
    out = [str(tmp_path / name) for name in ("table.csv", "coefficients.csv")]
    studies = [str(tmp_path / f"{name}.json") for name in results]
    tabulate_real.main(studies, str(tmp_path / "flights.csv"), "abc123", *out)
    table = pd.read_csv(out[0])
    assert table["study"].tolist() == ["neurobem-1", "neurobem-4"]
    assert table["word"].tolist() == ["explained", "stopped"]
    assert table["expected"][1].startswith("rotor_drag") and pd.isna(table["expected_found"][1])
    assert set(table["judged_by"]) == {"abc123"}
