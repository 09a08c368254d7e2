"""Rigid-body residuals against hand-computed wrenches; their growth with airspeed."""

import numpy as np
import pandas as pd
import pytest

from rotorid.recordings import RecordingSet, Run, Vehicle
from rotorid.recordings import columns as c
from rotorid.recordings.importers.neurobem import ANGULAR_ACCELERATION, PREDICTED_FORCE, PREDICTED_MOMENT
from rotorid_lab.rigid_body_residuals import (
    by_airspeed,
    compare_with_neurobem,
    low_pass,
    measured_wrench,
    rmse,
    rotor_wrench,
)
from tests.refusals import refused

VEHICLE = Vehicle(
    name="x",
    kind="flight",
    mass_kg=2.0,
    inertia_kg_m2={"xx": 1.0, "yy": 2.0, "zz": 4.0},
    rotors=[
        {"x_m": 0.1, "y_m": 0.2, "spin": "ccw"},
        {"x_m": 0.1, "y_m": -0.2, "spin": "cw"},
        {"x_m": -0.1, "y_m": -0.2, "spin": "ccw"},
        {"x_m": -0.1, "y_m": 0.2, "spin": "cw"},
    ],
    thrust_coefficient_n_s2=1e-6,
    torque_coefficient_n_m_s2=1e-8,
)


def test_rotors_push_up_and_lever_as_the_thesis_says() -> None:
    # Only rotor 1, front right, counter-clockwise: 4 N up, rolls left, pitches up, yaws right.
    wrench = rotor_wrench(np.array([[2000.0, 0, 0, 0]]), VEHICLE)
    assert wrench[0] == pytest.approx([0, 0, -4.0, -0.8, 0.4, 0.04])
    assert rotor_wrench(np.full((1, 4), 1000.0), VEHICLE)[0] == pytest.approx([0, 0, -4.0, 0, 0, 0])


def test_the_measured_wrench_by_hand() -> None:
    table = {"time_s": [0.0, 1.0]}
    table |= {name: [value] * 2 for name, value in zip(c.SPECIFIC_FORCE, (1.0, 2.0, -9.81), strict=True)}
    table |= {name: [value] * 2 for name, value in zip(c.ANGULAR_VELOCITY, (1.0, 2.0, 3.0), strict=True)}
    run = Run("a", pd.DataFrame(table))
    # J W' = (10, 40, 120); J W = (1, 4, 12); W x J W = (2·12-3·4, 3·1-1·12, 1·4-2·1) = (12, -9, 2).
    found = measured_wrench(run, VEHICLE, np.tile([10.0, 20.0, 30.0], (2, 1)))
    assert found[0] == pytest.approx([2.0, 4.0, -19.62, 22.0, 31.0, 122.0])


def test_the_filter_halves_the_power_at_its_cutoff_and_delays_nothing() -> None:
    time = np.arange(4000) / 400
    for frequency, expected in ((1.0, 1.0), (20.0, np.sqrt(0.5)), (120.0, 0.0)):
        wave = np.sin(2 * np.pi * frequency * time)
        passed = low_pass(wave, 400.0, 20.0)[1000:3000]
        gain = passed @ wave[1000:3000] / (wave[1000:3000] @ wave[1000:3000])
        assert gain == pytest.approx(expected, abs=0.01)
    refused("cutoff 190 Hz is too high for samples at 400 Hz", low_pass, np.zeros(100), 400.0, 190.0)


def test_rmse_by_hand() -> None:
    found = rmse(np.array([[3.0, 0, 0, 0.1, 0, 0], [-3.0, 0, 4.0 * np.sqrt(2), 0.1, 0, 0]]))
    assert found["force_x"] == pytest.approx(3.0) and found["force_z"] == pytest.approx(4.0)
    assert found["force"] == pytest.approx(np.sqrt((9 + 16) / 3))
    assert found["moment"] == pytest.approx(0.1 / np.sqrt(3))


def test_rms_by_airspeed_finds_the_growth_that_was_put_in() -> None:
    rng = np.random.default_rng(2)
    time = np.arange(40_000) * 0.01
    speed = 5 + 4.99 * np.sin(2 * np.pi * time / 40)
    residual = rng.normal(0, 1, (len(time), 6)) * (1 + speed)[:, None]
    found = by_airspeed({"a": residual}, {"a": speed}, {"a": time}, np.arange(0, 11), 1.0, rng)
    assert found["low"].tolist() == list(range(10)) and found["samples"].sum() == len(time)
    inside = [(speed >= low) & (speed < low + 1) for low in range(10)]
    expected = np.array([np.sqrt(np.mean((1 + speed[i]) ** 2)) for i in inside])
    np.testing.assert_allclose(found["rms"][:, 0], expected, rtol=0.05)
    low, high = found["rms_95"]
    assert (low <= found["rms"]).all() and (found["rms"] <= high).all()
    assert found["growth"][0] == pytest.approx(expected[-1] / expected[0], rel=0.05)
    assert found["growth_95"][0, 0] < found["growth"][0] < found["growth_95"][1, 0]


def test_a_bin_seen_in_too_few_blocks_is_left_out() -> None:
    time = np.arange(1000) * 0.01
    speed = np.where(time < 0.5, 9.5, 0.5)
    rng = np.random.default_rng(2)
    found = by_airspeed({"a": np.ones((1000, 6))}, {"a": speed}, {"a": time}, [0, 1, 9, 10], 1.0, rng)
    assert found["low"].tolist() == [0]


def test_the_comparison_finds_a_drag_that_neurobem_knows_and_the_rigid_body_does_not() -> None:
    runs = []
    for name, top in (("a", 6.0), ("b", 10.0)):
        time = np.arange(8000) * 0.0025
        speed = top / 2 * (1 - np.cos(2 * np.pi * time / 10))
        zero = np.zeros_like(time)
        # Force: hover thrust 19.62 N up, drag 0.5 N s/m backwards.
        table = {"time_s": time, **dict(zip(c.VELOCITY, (speed, zero, zero), strict=True))}
        force = (-0.25 * speed, zero, zero - 9.81)
        table |= dict(zip(c.SPECIFIC_FORCE, force, strict=True))
        table |= {n: zero for n in c.ANGULAR_VELOCITY + ANGULAR_ACCELERATION + PREDICTED_MOMENT}
        table |= dict(zip(PREDICTED_FORCE, (-0.5 * speed, zero, zero - 19.62), strict=True))
        table |= {n: zero + np.sqrt(19.62 / 4e-6) for n in c.rotor_columns("rotor_speed", 4)}
        runs.append(Run(name, pd.DataFrame(table)))
    summary, flights, bins, _ = compare_with_neurobem(RecordingSet("s", VEHICLE, tuple(runs)), 20.0, 1.0, 1.0, seed=1)
    assert summary["one_flight_above_m_s"] == pytest.approx(6.0)
    assert summary["flights"]["b"]["rigid_body"]["force_x"] == pytest.approx(0.5 * 10 * np.sqrt(3 / 8), rel=1e-3)
    assert summary["flights"]["b"]["neurobem"]["force"] == pytest.approx(0, abs=1e-9)
    lighter = summary["flights"]["a"]["neurobem_paper_mass"]["force_z"]
    assert lighter == pytest.approx((2.0 - 0.752) * 9.81)
    assert summary["rigid_body"]["force_x"]["growth"] > 10
    bins = bins[(bins["model"] == "rigid_body") & (bins["channel"] == "force_x")]
    assert bins["rms"].is_monotonic_increasing
    assert set(flights["flight"]) == {"a", "b"}
