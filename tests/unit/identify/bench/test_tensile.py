"""Tensile figures of a curve that is known."""

import numpy as np
import pytest

from rotorid_lab.loadcell import evaluate
from tests.refusals import refused

GAUGE_MM, SECTION_MM2 = 40.0, 20.0


def curve(noise_n: float = 0.0, slack_mm: float = 0.08, yields: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """2 GPa up to 10 MPa, from there a tenth of that up to 20 MPa, then broken.

    By hand: the line moved by 0.2 % meets σ = 10 + 200 (ε − 0.005) MPa where 2000 (ε − 0.002) = 10 + 200 (ε − 0.005),
    at ε = 13/1800, σ = 10.4444 MPa; the strength of 20 MPa is reached at ε = 0.055.
    """
    displacement = np.arange(0, 2.6, 1 / 60)
    strain = (displacement - slack_mm) / GAUGE_MM
    bent = 10 + 200 * (strain - 0.005)
    stress = np.where(strain < 0, 0, np.where(strain < 0.005, 2000 * strain, bent if yields else 2000 * strain))
    stress = np.where(stress > 20.0, 0.0, stress)
    force = stress * SECTION_MM2 + noise_n * np.random.default_rng(0).normal(size=len(stress))
    return displacement, force


def test_modulus_yield_and_strength_by_hand() -> None:
    found, _ = evaluate(*curve(noise_n=0.05), GAUGE_MM, SECTION_MM2)
    assert found["modulus_gpa"] == pytest.approx(2, rel=2e-3)
    assert found["modulus_low_95_gpa"] < 2 < found["modulus_high_95_gpa"]
    assert found["yield_mpa"] == pytest.approx(10.4444, rel=2e-3)
    assert found["strength_mpa"] == pytest.approx(20, rel=5e-3)
    assert found["slack_mm"] == pytest.approx(0.08, abs=2e-3)
    assert found["proportional_mpa"] == pytest.approx(10, rel=0.1)
    assert found["break_strain"] == pytest.approx(0.055, rel=0.02)


def test_more_slack_changes_nothing_but_the_slack() -> None:
    little, much = (evaluate(*curve(0.05, slack), GAUGE_MM, SECTION_MM2)[0] for slack in (0.02, 0.3))
    assert much["modulus_gpa"] == pytest.approx(little["modulus_gpa"], rel=5e-3)
    assert much["yield_mpa"] == pytest.approx(little["yield_mpa"], rel=5e-3)
    assert much["slack_mm"] - little["slack_mm"] == pytest.approx(0.28, abs=5e-3)


def test_a_brittle_specimen_is_named_as_such() -> None:
    refused("broke before it yielded", evaluate, *curve(0.05, yields=False), GAUGE_MM, SECTION_MM2)
