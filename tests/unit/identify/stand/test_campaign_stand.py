"""The campaign's rotor tests and clocks, from its raw logs: what is found against what the emulators were given."""

from pathlib import Path

import pandas as pd
import pytest
import yaml

from rotorid_acquire.io.logs import read_tables
from rotorid_acquire.io.wire import EXPERIMENTS
from rotorid_lab import clocks, grey_box
from rotorid_lab.black_box import thrust_of_throttle
from rotorid_lab.rotor import fit_coefficient, speed_law, thrust_points, torque_points
from rotorid_lab.stand import read_pairs

ROOT = Path(__file__).parents[4]
CAMPAIGN = ROOT / "raw" / "campaign"


@pytest.fixture(scope="module")
def truth() -> dict:
    return yaml.safe_load((ROOT / "tests/sealed/campaign_truth.yaml").read_text())["truth"]


@pytest.fixture(scope="module")
def thrust() -> pd.DataFrame:
    return thrust_points(*read_tables(sorted((CAMPAIGN / "thrust").glob("*.rlog.gz"))))


@pytest.fixture(scope="module")
def torque() -> pd.DataFrame:
    return torque_points(
        *(read_tables(sorted((CAMPAIGN / "torque").glob(f"*-{device}.rlog.gz"))) for device in ("rotor", "wrench"))
    )


def coefficient(points: pd.DataFrame):
    run = [("tests", points["speed_rad_s"].to_numpy(), points["value"].to_numpy())]
    return fit_coefficient(run, offset=False)


def test_thrust_and_torque_coefficients_are_the_thesis_s(thrust, torque) -> None:
    """The noise of the torque does not grow with speed: its interval is narrow, and the thesis's value just outside."""
    c_f, c_q = coefficient(thrust), coefficient(torque)
    low, high = c_f.interval_95
    assert low < grey_box.WHITE_BOX["thrust_coefficient_n_s2"] < high
    believed = grey_box.WHITE_BOX["torque_coefficient_n_m_s2"]
    assert believed < c_q.interval_95[0] < 1.001 * believed
    assert c_q.standard_error < 0.001 * c_q.value


def test_the_speed_follows_throttle_and_voltage_as_told(thrust, torque, truth) -> None:
    found = speed_law(pd.concat([thrust, torque], ignore_index=True))
    for name, told in (
        ("throttle_exponent", truth["rotor"]["throttle_exponent"]),
        ("dead_throttle", truth["rotor"]["dead_throttle"]),
        ("voltage_exponent", truth["rotor"]["voltage_exponent"]),
    ):
        low, high = found[f"{name}_interval_95"]
        half = (high - low) / 2
        assert abs(found[name] - told) < 1.4 * half, name  # 99 %
        assert half < 0.02 * told


def test_the_clocks_of_the_experiments(thrust, truth) -> None:
    numbers = (1, 3, 22, 23, 24, 27)
    tables = [
        read_tables(CAMPAIGN / "dynamics" / f"exp-{n:02d}-{device}.rlog.gz" for n in numbers)
        for device in ("quadrotor", "wrench")
    ]
    pairs = read_pairs(*tables, 2e-4)
    assert [pair.sine for pair in pairs] == [EXPERIMENTS[n].signal == "sine" for n in numbers]
    curve = thrust_of_throttle(thrust)
    skew, error = clocks.skew(pairs, curve)
    told = truth["clocks"]["wrench"] - truth["clocks"]["quadrotor"]
    assert abs(skew - told) < 3 * error
    assert error < 2e-4
    for entry in clocks.align(pairs, curve):
        # The emulators' samples were taken 0.07 s apart from what the arrival times of these recordings say.
        assert entry.offset_s == pytest.approx(-0.07, abs=0.012)
    lag = clocks.align(pairs, curve)[0].motor_delay_s
    assert min(truth["rotor"]["rise_s"], truth["rotor"]["fall_s"]) - 0.005 < lag < 0.07
