"""The thin scripts of the public recordings and of the two computations on them, called as the rules do."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rotorid.recordings import RecordingSet, Run, Vehicle, write_set
from rotorid.recordings.importers.faults import ImportReport, read_report
from rotorid_lab.public_sets import sets_of
from tests.unit.mismatch.flights import Flight
from workflow.scripts import (
    check_recordings,
    compare_labelled,
    fit_rotor_coefficients,
    import_public,
    neurobem_residuals,
)

ROOT = Path(__file__).parents[2]
SETTINGS = {"cutoff_hz": 20.0, "airspeed_bin_m_s": 1.0, "block_s": 1.0, "seed": 1}


def report_into(folder: Path, available: bool) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    reason = "" if available else "4 files could not be had: no answer from nowhere"
    ImportReport(folder.name, available, "x", "MIT", "Someone", reason=reason).write(folder)


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    """A propeller on three motors, C_F 1.1, 1.2 and 1.3e-6 N s², offset -0.05 N, one speed missing."""
    rotors = [{"x_m": 0, "y_m": 0, "spin": "ccw"}]
    vehicle = Vehicle(name="x", kind="stand", rotors=rotors, thrust_coefficient_n_s2=1e-6)
    speed = np.linspace(500, 2000, 11)
    runs = []
    for motor, c_f in (("a", 1.1e-6), ("b", 1.2e-6), ("c", 1.3e-6)):
        for cells in ("2s", "3s"):
            read = speed.copy()
            read[0] = 0 if cells == "2s" else speed[0]
            table = {"time_s": np.arange(11.0), "throttle_1": np.linspace(0.05, 1, 11)}
            table |= {"rotor_speed_1_rad_s": read, "force_z_n": -(c_f * speed**2 - 0.05)}
            runs.append(Run(f"{motor}_{cells}", pd.DataFrame(table)))
    folder = write_set(RecordingSet("strawson-t5040c", vehicle, tuple(runs)), tmp_path)
    report_into(folder, True)
    return folder


def fit(sets: list[Path], out: Path) -> tuple[dict, pd.DataFrame]:
    paths = {name: str(out / name) for name in ("summary", "motors", "points")}
    fit_rotor_coefficients.main([str(s) for s in sets], 0.0, 3.5, **paths)
    return json.loads(Path(paths["summary"]).read_text()), pd.read_csv(paths["motors"])


def test_coefficients_of_a_bench_with_known_ones(bench: Path, tmp_path: Path) -> None:
    summary, motors = fit([bench], tmp_path)
    found = summary["propellers"]["t5040c"]
    assert found["offset"]["value"] == pytest.approx(1.2e-6)
    assert found["offset"]["between_sd"] == pytest.approx(1e-7, rel=1e-3)
    assert found["mean_offset_n"] == pytest.approx(-0.05) and found["points_without_speed"] == 3
    by_motor = motors[motors["form"] == "offset"].set_index("motor")["c_f_n_s2"]
    assert by_motor.tolist() == pytest.approx([1.1e-6, 1.2e-6, 1.3e-6])


def test_without_the_recordings_the_results_say_so(tmp_path: Path) -> None:
    folder = tmp_path / "strawson-t5040c"
    report_into(folder, False)
    summary, motors = fit([folder], tmp_path)
    assert summary["available"] is False and "no answer from nowhere" in summary["reason"]
    assert len(motors) == 0 and "c_f_n_s2" in motors
    paths = {name: str(tmp_path / f"n_{name}") for name in ("summary", "flights", "bins", "points")}
    neurobem_residuals.main(str(folder), SETTINGS, **paths)
    assert json.loads(Path(paths["summary"]).read_text())["available"] is False
    assert list(pd.read_csv(paths["bins"]).columns)[:2] == ["model", "channel"]


def test_an_import_without_files_leaves_every_set_with_its_reason(tmp_path: Path) -> None:
    status = tmp_path / "status.json"
    import_public.main(
        source="crazypad",
        manifest=str(ROOT / "workflow" / "public_data.yaml"),
        vehicles=sorted(str(path) for path in (ROOT / "workflow" / "vehicles").glob("*.yaml")),
        folder=str(tmp_path / "nothing"),
        cache=str(tmp_path / "cache"),
        parent=str(tmp_path / "sets"),
        status=str(status),
    )
    found = json.loads(status.read_text())
    assert found["available"] is False and found["files_missing"] == found["files"] == 11
    for name in sets_of("crazypad"):
        assert read_report(tmp_path / "sets" / name)["available"] is False
        assert not (tmp_path / "sets" / name / "vehicle.yaml").exists()


def test_the_check_writes_a_page_for_each_set_and_names_the_others(bench: Path, tmp_path: Path) -> None:
    absent, broken = tmp_path / "absent", tmp_path / "broken"
    report_into(absent, False)
    broken.mkdir()
    (broken / "vehicle.yaml").write_text("name: x\n")
    check_recordings.main([str(bench), str(absent), str(broken)], str(tmp_path / "page.txt"))
    page = (tmp_path / "page.txt").read_text()
    assert "strawson-t5040c: kind stand, 1 rotors, 6 runs" in page and "absent: not there; see" in page
    assert "broken/vehicle.yaml: kind: is missing" in page


def labelled(folder: Path, drag: float, number: int) -> str:
    """A set of one flight with its import report."""
    flight = Flight(number, 8.0, drag=drag)
    write_set(RecordingSet(folder.name, flight.vehicle, (flight.record(100.0, name="run01"),)), folder.parent)
    report_into(folder, True)
    return str(folder)


def test_labelled_flights_are_compared_with_the_good_ones(tmp_path: Path) -> None:
    normal = labelled(tmp_path / "normal", 0.4, 1)
    changed = {"weight": labelled(tmp_path / "weight", 1.4, 2), "cut": labelled(tmp_path / "cut", 0.4, 3)}
    out = tmp_path / "found.json"
    compare_labelled.main(normal, changed, str(out))
    found = json.loads(out.read_text())
    assert found["available"] and list(found["pairs"]) == ["weight", "cut"]
    assert "rotor_drag" in [i for c in found["pairs"]["weight"]["changes"] for i in (c["id"], *c["alternatives"])]
    assert found["pairs"]["cut"]["changes"] == []
    quantities = found["pairs"]["weight"]["level_1"]["quantities"]
    assert {d["id"] for d in quantities} == set(found["pairs"]["weight"]["names"]) != set()


def test_without_the_labelled_flights_the_result_says_why(tmp_path: Path) -> None:
    for name in ("normal", "weight", "cut"):
        report_into(tmp_path / name, name != "cut")
    changed = {name: str(tmp_path / name) for name in ("weight", "cut")}
    out = tmp_path / "found.json"
    compare_labelled.main(str(tmp_path / "normal"), changed, str(out))
    found = json.loads(out.read_text())
    assert found == {"available": False, "reason": "4 files could not be had: no answer from nowhere", "pairs": {}}
