"""The campaign's bench, from its raw logs: what is found against what the emulators were given."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from rotorid_acquire.io.logs import read_tables
from rotorid_lab import bench as reconstruct
from rotorid_lab import loadcell
from rotorid_lab.bench import prepare

from .test_chain import SETTINGS

ROOT = Path(__file__).parents[4]
CAMPAIGN = ROOT / "raw" / "campaign"


@pytest.fixture(scope="module")
def truth() -> dict:
    return yaml.safe_load((ROOT / "tests/sealed/campaign_truth.yaml").read_text())["truth"]


def test_the_calibration_recovers_the_thesis_within_its_intervals(truth) -> None:
    samples, sessions = read_tables(sorted((CAMPAIGN / "calibration").glob("*.rlog.gz")))
    readings = reconstruct.readings(prepare(samples, sessions, SETTINGS), sessions)
    idle = reconstruct.idle_slopes(samples, sessions)
    printed = pd.read_csv(ROOT / "raw/thesis/table_2_8.csv").set_index("coefficient")
    inside = {"a0": 0, "a1": 0, "drift": 0, "creep": 0}
    for cell in range(1, 7):
        found = reconstruct.calibrate_cell(readings[readings["cell"] == cell], idle[cell])
        for name in ("a0", "a1"):
            low, high = found[f"{name}_interval_95"]
            inside[name] += low <= printed.loc[name, f"cell_{cell}"] <= high
        drift = truth["cells"]["drift_v_s"][cell - 1] * 60 * found["a1_gf_per_10uv"] * 1e5
        inside["drift"] += found["drift_interval_95"][0] <= drift <= found["drift_interval_95"][1]
        # Creep over the seconds of a recording: the mean slope of share (1 − e^(−t/τ)) from 1.5 to 7 s.
        share, tau = (truth["cells"][name][cell - 1] for name in ("creep_share", "creep_s"))
        rate = share * (np.exp(-1.5 / tau) - np.exp(-7 / tau)) / 5.5 * 60
        inside["creep"] += found["creep_interval_95"][0] <= rate <= found["creep_interval_95"][1]
    # 24 intervals of 95 %: fewer than 21 inside would happen once in 300 times.
    assert inside["a0"] == inside["a1"] == 6 and sum(inside.values()) >= 21


def test_tensile_figures_are_those_of_the_specimens(truth) -> None:
    samples, sessions = read_tables(sorted((CAMPAIGN / "tensile").glob("*.rlog.gz")))
    found, _ = loadcell.specimens(samples, sessions)
    means = loadcell.by_infill(found, pd.read_csv(ROOT / "raw/thesis/table_2_5.csv"))
    for row in means.itertuples():
        told = truth["plastic"][str(row.infill_percent)]
        assert row.modulus_gpa == pytest.approx(told["modulus_pa"] / 1e9, rel=0.005)
        assert row.strength_mpa == pytest.approx(told["ultimate_pa"] / 1e6, rel=0.005)
        assert row.yield_mpa == pytest.approx(told["yield_pa"] / 1e6, rel=0.005)
        assert row.modulus_gpa_low_95 < row.modulus_gpa_thesis < row.modulus_gpa_high_95
