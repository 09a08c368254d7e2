"""Plateaus, steady wrenches, the weight under tilt, the law of speed: against numbers done by hand."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from rotorid.effects.loading import rotation_of
from rotorid.recordings.run import Run
from rotorid_lab import stand
from rotorid_lab.rotor import speed_law
from tests.refusals import refused

WRENCH = stand.WRENCH


def programme(time_s: np.ndarray) -> np.ndarray:
    """Table A.1's trapezoid: 2 s rest, 3 s ramp, 8 s at 0.2, 3 s ramp, rest; motor 2 at half."""
    share = np.interp(time_s, [2, 5, 13, 16], [0.0, 0.2, 0.2, 0.0])
    return np.column_stack([share, share / 2, share, share])


def test_segments_of_a_trapezoid() -> None:
    time_s = np.arange(0, 18, 0.01)
    found = stand.segments(time_s, programme(time_s))
    assert [s.kind for s in found] == ["rest", "ramp", "plateau", "ramp", "rest"]
    flat = stand.longest(found, stand.PLATEAU)
    assert flat.start_s == pytest.approx(5.0, abs=0.06) and flat.stop_s == pytest.approx(13.0, abs=0.06)
    whole = stand.programme(found)
    assert (whole.start_s, whole.stop_s) == pytest.approx((2.0, 16.0), abs=0.02)


def test_a_sine_has_no_plateau_and_rest_alone_is_refused() -> None:
    time_s = np.arange(0, 12, 0.02)
    sine = 0.1 * (1 - np.cos(2 * np.pi * 0.25 * time_s))
    assert stand.longest(stand.segments(time_s, np.column_stack([sine] * 4)), stand.PLATEAU) is None
    refused("never ran", stand.segments, time_s, np.zeros((len(time_s), 4)))


def test_tilt_and_weight_by_hand() -> None:
    # Pitch 30°: x forward goes up (−z), so R e_x = (cos 30°, 0, −sin 30°).
    assert rotation_of(0.0, np.radians(30)) @ [1, 0, 0] == pytest.approx([np.sqrt(3) / 2, 0, -0.5])
    # Roll 30°: y right goes down, R e_y = (0, cos 30°, sin 30°).
    assert rotation_of(np.radians(30), 0.0) @ [0, 1, 0] == pytest.approx([0, np.sqrt(3) / 2, 0.5])
    # 2 kg at (0.1, 0, 0) on a level sensor with g = 10: F = (0, 0, 20), M = c × F = (0, −2, 0).
    assert stand.weight_wrench(2.0, 10.0, np.array([0.1, 0, 0]), np.eye(3)) == pytest.approx([0, 0, 20, 0, -2, 0])


def experiment(roll: float, pitch: float, seed: int = 0, drift_n_s: float = 0.0) -> Run:
    """0.652 kg with its centre of mass at (3, −2, −45) mm from the sensor; on the plateau −4 N along z."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(0, 18.5, 0.01)
    throttle = programme(time_s)
    at_rest = stand.weight_wrench(0.652, 9.81, np.array([0.003, -0.002, -0.045]), rotation_of(roll, pitch))
    values = np.tile(at_rest, (len(time_s), 1))
    values[:, 2] += -4.0 * throttle[:, 0] / 0.2 + drift_n_s * time_s
    values += rng.normal(0, 1, values.shape) * np.array([0.1] * 3 + [0.001] * 3)
    table = pd.DataFrame(values, columns=list(WRENCH))
    table.insert(0, "time_s", time_s)
    for i in range(4):
        table[f"throttle_{i + 1}"] = throttle[:, i]
    table["battery_voltage_v"], table["roll_rad"], table["pitch_rad"] = 16.0, roll, pitch
    return Run("exp-01", table)


def test_steady_wrench_with_rest_and_drift_taken_off() -> None:
    found = stand.evaluate(experiment(0.0, 0.2, drift_n_s=0.05), None)
    assert found.kind == "plateau" and found.throttle == pytest.approx([0.2, 0.1, 0.2, 0.2])
    # The zero drifts linearly, and the rest reading is interpolated: nothing of it stays.
    off = found.steady.mean - [0, 0, -4, 0, 0, 0]
    assert (np.abs(off) < 4 * found.steady.error).all()
    # Without drift 0.1 N / √728 and the rest's error; the drift over the plateau, 0.36 N, adds 0.36/√12/√26 N.
    assert found.steady.error[2] == pytest.approx(np.hypot(0.36 / 12**0.5 / 26**0.5, 0.008), rel=0.25)
    # Rest is read up to 1.85 s and from 16.5 s on: middles 0.925 s and 17.495 s apart by 16.57 s.
    assert found.drift[2] == pytest.approx(0.05 * 16.57, abs=0.03)


def test_intervals_of_the_steady_wrench_cover() -> None:
    inside = []
    for seed in range(60):
        found = stand.evaluate(experiment(0.1, 0.0, seed), None)
        inside.append(np.abs(found.steady.mean - [0, 0, -4, 0, 0, 0]) <= found.steady.half_width_95)
    assert np.mean(inside) == pytest.approx(0.95, abs=0.03)


TILTS = [(0, 0), (0.26, 0), (-0.26, 0), (0, 0.26), (0, -0.26), (0.52, 0), (0, 0.52), (-0.52, 0)]
CENTRE = np.array([0.003, -0.002, -0.045])


def test_the_weight_under_tilt_gives_mass_and_centre() -> None:
    evaluated = [stand.evaluate(experiment(*tilt, seed), None) for seed, tilt in enumerate(TILTS)]
    found = stand.fit_weight(evaluated, 0.652, np.array([0, 0, -0.045]), 9.81)
    assert found["mass_kg"] == pytest.approx(0.652, abs=1e-3)
    assert found["centre_m"] == pytest.approx(CENTRE, abs=1e-4)
    assert found["rms_before"][4] == pytest.approx(0.652 * 9.81 * 0.003, rel=0.05)
    assert found["rms_after"][4] < 3e-4


def test_intervals_of_mass_and_centre_cover() -> None:
    rng = np.random.default_rng(0)
    like = stand.evaluate(experiment(0.0, 0.0), None)
    inside = []
    for _ in range(500):
        evaluated = []
        for roll, pitch in TILTS:
            exact = stand.weight_wrench(0.652, 9.81, CENTRE, rotation_of(roll, pitch))
            rest = replace(like.rest, mean=exact + rng.normal(0, 1, 6) * np.array([0.007] * 3 + [7e-5] * 3))
            evaluated.append(replace(like, roll_rad=roll, pitch_rad=pitch, rest=rest))
        found = stand.fit_weight(evaluated, 0.652, CENTRE, 9.81)
        low, high = found["centre_interval_95"].T
        inside.append(
            [*((low < CENTRE) & (CENTRE < high)), found["mass_interval_95"][0] < 0.652 < found["mass_interval_95"][1]]
        )
    assert np.mean(inside, axis=0) == pytest.approx(np.full(4, 0.95), abs=0.03)


def test_the_law_of_speed_comes_back() -> None:
    rng = np.random.default_rng(2)
    throttle = np.linspace(0.01, 0.5, 50)
    voltage = 16.5 + rng.uniform(-0.4, 0.4, 50)
    speed = 1900 * ((throttle - 0.004) / 0.496) ** 0.67 * (voltage / voltage.mean()) ** 0.8
    speed += rng.normal(0, 0.1, 50)  # means of 100 readings that scatter by 1 rad/s
    points = pd.DataFrame({"throttle": throttle, "speed_rad_s": speed, "voltage_v": voltage})
    points = points.assign(speed_sd_rad_s=1.0, samples=100, test=[f"thrust-{k}" for k in range(50)])
    found = speed_law(points)
    for name, true in (("throttle_exponent", 0.67), ("dead_throttle", 0.004), ("voltage_exponent", 0.8)):
        low, high = found[f"{name}_interval_95"]
        assert low < true < high
        assert high - low < 0.05 * true + 0.01
    assert found["apart"] == []
    refused("at least six points", speed_law, points[:5])
    # Before: a recording of another rotor was pooled in silence.
    mine = points.iloc[[40]].assign(test="mine", speed_rad_s=1.002 * speed[40])
    assert speed_law(pd.concat([points, mine], ignore_index=True))["apart"] == ["mine"]
