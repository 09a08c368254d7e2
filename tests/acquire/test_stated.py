"""The campaign's sealed truth in the words of the catalogue."""

from pathlib import Path

import numpy as np
import pytest

from rotorid_acquire.campaign import STATED
from rotorid_acquire.emulators import physics
from rotorid_acquire.emulators.physics import CORNERS
from rotorid_acquire.emulators.truth import BenchTruth, SensorTruth, Truth, VehicleTruth, read_truth

SEALED = Path(__file__).parents[1] / "sealed"


def test_the_sealed_file_is_what_the_truth_gives(tmp_path: Path) -> None:
    physics.write_stated(read_truth(SEALED / "campaign_truth.yaml"), tmp_path / STATED)
    assert (tmp_path / STATED).read_text() == (SEALED / STATED).read_text()


def test_an_ideal_bench_reads_a_lateral_load_as_a_vertical_one_too() -> None:
    """The equations' absolute values do that; nothing gives way, so that nothing grows with the square."""
    found = physics.readings(Truth(), "al")
    assert found["crosstalk"]["C_Fz,Fx"] < -1.5
    assert found["crosstalk"]["C_Fx,Fz"] == pytest.approx(0, abs=1e-9)
    assert max(abs(v) for v in found["compliance"].values()) < 1e-3


def test_a_bench_that_gives_way_under_thrust_grows_by_its_compliance() -> None:
    truth = Truth(bench={"pla": BenchTruth(compliance_1_n=[0, 0, 0.003])})
    assert physics.readings(truth, "pla")["compliance"]["k_Fz,Fz"] == pytest.approx(0.003, rel=0.01)


def test_a_displaced_sensor_moves_the_moments_as_these_rotors_and_this_centre_do() -> None:
    """All four rotors alike, level mount: the moments about the displaced sensor, by hand and by what stands for it."""
    truth = Truth(
        vehicle=VehicleTruth(com_offset_m=[0.004, 0.0, 0.0]), wrench=SensorTruth(position_error_m=[0.001, -0.003, 0.0])
    )
    found = physics.displaced(truth)
    x, y = CORNERS[:, 0] * truth.vehicle.arm_m, CORNERS[:, 1] * truth.vehicle.arm_m
    excess = np.array(list(found["unequal_rotors"].values()))
    thrust, weight = 1.5, 6.4
    by_hand = [-np.sum(y + 0.003) * thrust + 0.003 * weight, np.sum(x - 0.001) * thrust - (0.004 - 0.001) * weight]
    centre = found["com_offset"]
    stands_for = [
        -np.sum(y * (1 + excess)) * thrust + centre["r_y"] * weight,
        np.sum(x * (1 + excess)) * thrust - centre["r_x"] * weight,
    ]
    np.testing.assert_allclose(stands_for, by_hand, atol=1e-12)
