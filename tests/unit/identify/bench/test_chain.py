"""From raw logs to calibration, static points and recording sets, on small logs written here."""

import numpy as np
import pandas as pd
import pytest

from rotorid_acquire.io.logs import read_sessions, read_tables
from rotorid_acquire.io.session import Ended, Setup
from rotorid_lab import bench as reconstruct
from rotorid_lab import bench_tests as static
from rotorid_lab.bench import CELLS, GF_N, SPIKE, Filter, bench_force, bench_set, prepare
from tests.refusals import refused

from .logs import cells, write_log
from .test_reconstruct import GEOMETRY, forces_by_matrix

SETTINGS = Filter(1.5, 5.0, 5, 12.0, 25, 2e-7)
WEIGHTS = (50.0, 100.0, 250.0, 500.0)
NOISE_V = 6e-8


def calibration_logs(folder, slope=40.0, offset=0.5) -> list:
    """Two cells, four weights, three repeats each; reading = (weight − offset)/slope × 1e-5 V."""
    paths = []
    for cell in (1, 2):
        for number, weight in enumerate(WEIGHTS):
            for repeat in (1, 2, 3):
                loaded = np.zeros(6)
                loaded[cell - 1] = (weight - offset) / slope * 1e-5
                values = cells(loaded, noise_v=NOISE_V, seed=100 * cell + 10 * number + repeat)
                setup = Setup(kind="calibration", cell=cell, load_gf=weight, repeat=repeat)
                name = f"cal-{cell}-{number}-{repeat}"
                paths.append(write_log(folder, name, "bench", values, setup, {"load": 61}))
    return paths


def tables(paths, folder):
    samples, sessions = read_tables(paths)
    sessions.to_csv(folder / "sessions.csv", index=False)
    return samples, read_sessions(folder / "sessions.csv")


def prepared(paths, folder):
    """Samples of logs, filtered, and their recordings."""
    samples, sessions = tables(paths, folder)
    return prepare(samples, sessions, SETTINGS), sessions


def test_logs_become_tidy_tables(tmp_path) -> None:
    samples, sessions = tables(calibration_logs(tmp_path), tmp_path)
    assert len(samples) == 24 * 200 and len(sessions) == 24
    assert list(samples.columns[:6]) == ["id", "time_s", "host_time_s", "segment", "index", "quality"]
    assert sessions["rate_hz"].to_numpy() == pytest.approx(50.0)
    assert sessions.loc[0, ["kind", "cell", "load_gf", "mark_load"]].tolist() == ["calibration", 1, 50.0, 61]
    assert sessions["missing"].sum() == 0


def test_a_log_that_did_not_end_is_listed_but_not_used(tmp_path) -> None:
    paths = calibration_logs(tmp_path)
    setup = Setup(kind="calibration", cell=1, load_gf=50.0)
    broken = write_log(tmp_path, "zz", "bench", cells(np.zeros(6)), setup, {"load": 61}, ended=Ended.DISK_FULL)
    samples, sessions = read_tables([*paths, broken])
    assert not sessions.set_index("id").loc["zz", "finished"]
    sessions.to_csv(tmp_path / "s.csv", index=False)
    assert "zz" not in set(read_sessions(tmp_path / "s.csv")["id"])


def test_logs_that_cannot_be_one_table_are_named(tmp_path) -> None:
    first = calibration_logs(tmp_path)[0]
    other = write_log(tmp_path, "t", "tensile", np.zeros((5, 2)), Setup(kind="tensile"), {})
    refused(r"t\.rlog: is of a tensile, expected one of a bench", read_tables, [first, other])
    first.with_suffix(".yaml").unlink()
    refused("its metadata file is missing", read_tables, [first])
    refused("no raw logs to read", read_tables, [])


def test_the_line_that_made_the_readings_comes_back(tmp_path) -> None:
    readings = reconstruct.readings(*prepared(calibration_logs(tmp_path), tmp_path))
    # The zero of 1e-4 V is tared away; 100 gf read (100 − 0.5)/40 = 2.4875.
    assert readings.loc[readings["weight_gf"] == 100, "reading_10uv"].to_numpy() == pytest.approx(2.4875, abs=4e-3)
    # Of 140 samples under load the first 25 fill the window, and the filter takes as long to settle.
    assert 75 < readings["samples"].min() < 115
    found = reconstruct.calibrate_cell(readings[readings["cell"] == 1], np.array([1e-9, 3e-9, 2e-9]))
    assert found["a1_gf_per_10uv"] == pytest.approx(40, abs=0.02)
    assert found["a0_interval_95"][0] < 0.5 < found["a0_interval_95"][1]
    assert found["noise_gf"] == pytest.approx(6e-8 * 1e5 * 40, rel=0.1)
    # Mean slope of 2e-9 V/s is 2e-9 × 60 × 40e5 gf/min.
    assert found["drift_gf_min"] == pytest.approx(2e-9 * 60 * 40e5, rel=1e-3)


def test_repeatability_and_linearity_by_hand() -> None:
    # Readings of 0 and 10 gf, twice each, 1 apart: on the line 0.5 | 10.5 nothing is left but ± 0.5.
    table = {"weight_gf": [0.0, 0.0, 10.0, 10.0, 5.0, 5.0], "reading_10uv": [-0.5, 0.5, 9.5, 10.5, 5.5, 6.5]}
    found = reconstruct.calibrate_cell(pd.DataFrame(table | {"noise_10uv": 0.1, "slope_v_s": 0.0}), np.zeros(3))
    by_weight = found["a0_gf"] + found["a1_gf_per_10uv"] * np.array([0.0, 10.0, 6.0])
    assert found["linearity_gf"] == pytest.approx(np.abs(by_weight - [0, 10, 5]).max())
    # Two readings 1 apart have a standard deviation of 1/√2, times the slope.
    assert found["repeatability_gf"] == pytest.approx(found["a1_gf_per_10uv"] / np.sqrt(2))
    assert found["full_scale_gf"] == 10


def test_a_weight_put_on_long_after_its_mark_is_waited_for(tmp_path) -> None:
    loaded = np.array([2e-5, 0, 0, 0, 0, 0])
    setup = Setup(kind="calibration", cell=1, load_gf=80.0, repeat=1)
    path = write_log(tmp_path, "late", "bench", cells(loaded, rest=120, load=140), setup, {"load": 50})
    readings = reconstruct.readings(*prepared([path], tmp_path))
    assert readings["reading_10uv"].item() == pytest.approx(2.0, abs=1e-3)


def test_a_reading_that_never_settles_is_refused(tmp_path) -> None:
    values = cells(np.zeros(6))
    values[60:, 0] += np.linspace(0, 1e-4, 140)
    setup = Setup(kind="calibration", cell=1, load_gf=50.0, repeat=1)
    path = write_log(tmp_path, "drifting", "bench", values, setup, {"load": 61})
    said = "drifting: the reading was not steady for the last 50 samples"
    refused(said, reconstruct.readings, *prepared([path], tmp_path))


MARKS = {"tare_start": 20, "tare_stop": 44, "load": 70, "read_start": 120, "read_stop": 169}


def static_log(folder, name, loaded_v, axis, load_gf, repeat=1, spike_at=None, noise_v=NOISE_V, minute=0):
    values = cells(np.asarray(loaded_v, float), noise_v=noise_v, seed=repeat)
    if spike_at is not None:
        values[spike_at] += 1e-4
    setup = Setup(kind="static", platform="al", axis=axis, load_gf=load_gf, repeat=repeat)
    return write_log(folder, name, "bench", values, setup, MARKS, f"2024-03-04T09:{minute:02d}:00-06:00")


def test_a_static_reading_without_its_spike(tmp_path) -> None:
    path = static_log(tmp_path, "s", [1e-5, 0, 0, 0, 0, 0], "x", 100.0, spike_at=150)
    samples, sessions = prepared([path], tmp_path)
    assert samples.loc[samples["index"] == 151, "quality"].item() == SPIKE
    means = static.mean_readings(samples, sessions, CELLS)
    assert means.values[0] == pytest.approx([1e-5, 0, 0, 0, 0, 0], abs=5e-8)
    assert means.applied_n[0] == pytest.approx([100 * GF_N, 0, 0])
    # 49 samples left of 50, 25 of tare: variance σ²(1/49 + 1/25)
    assert means.variance[0].mean() == pytest.approx(NOISE_V**2 * (1 / 49 + 1 / 25), rel=0.3)


def test_directions_of_loads() -> None:
    assert static.direction("z") == pytest.approx([0, 0, -1])
    assert static.direction("xz") == pytest.approx([0.70710678, 0, -0.70710678])
    refused("not 'u'", static.direction, "u")


def test_points_by_hand() -> None:
    sessions = pd.DataFrame({"id": ["a"], "platform": ["al"], "axis": ["z"], "repeat": [1]})
    means = static.Means(sessions, np.zeros((1, 6)), np.zeros((1, 6)), np.array([[0.0, 0, -2]]))
    row = static.points(means, np.array([[0.3, 0.4, -2.1]]), np.array([[0.1, 0.1, 0.02]]), "equations").iloc[0]
    assert (row["load_n"], row["force_n"], row["error_n"]) == pytest.approx((2.0, 2.1, 0.1))
    assert tuple(row[["across_n", "uncertainty_n", "error_z_n"]]) == pytest.approx((0.5, 0.02, -0.1))


def test_a_static_series_becomes_a_bench_set(tmp_path) -> None:
    paths = [
        # Without noise: eq. 2.8 would turn the noise of the idle cells 1 and 5 into force.
        static_log(tmp_path, f"s{i}", [0, 0, v, 0, 0, 0], "z", w, noise_v=0.0, minute=i)
        for i, (v, w) in enumerate([(1e-5, 40), (2e-5, 80)])
    ]
    coefficients = np.array([[0.0, 40.0]] * 6)
    made = bench_set("b", *prepared(paths, tmp_path), bench_force(coefficients, GEOMETRY), 0.01)
    assert made.vehicle.kind == "bench" and made.vehicle.tared
    (run,) = made.runs
    assert run.name == "z-r01"
    loaded = run.column("reference_force_z_n")
    assert sorted(set(np.round(loaded / GF_N, 6))) == [-80.0, -40.0, 0.0]
    # Cell 3 alone: 40 gf push along −z with its absolute value, and Fx = D_135z/L of it.
    expected = forces_by_matrix(np.array([[0.0, 0, 80 * GF_N, 0, 0, 0]]), GEOMETRY)[0]
    found = run.array(("force_x_n", "force_y_n", "force_z_n"))[loaded < -0.6].mean(axis=0)
    # Half a count of the converter is 0.18 mN, and those of the idle cells 1 and 5 count with their absolute value.
    assert found == pytest.approx(expected, abs=2 * 0.19e-3)
    # The load comes on at row 61; reading from tare (index 20) on, the 41 samples before it know no load.
    assert (loaded[:41] == 0).all() and loaded[41] == pytest.approx(-40 * GF_N)
