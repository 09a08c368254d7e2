"""Steady points of rotor tests, from tables made by hand, and their noise by the samples that they are means of."""

import numpy as np
import pandas as pd
import pytest

from rotorid_lab.clocks import device_time
from rotorid_lab.rotor import COLUMNS, sample_noise, thrust_points, torque_points
from tests.refusals import refused

STEP_S = 0.02
SPEED = 1600 * (np.arange(1, 21) / 20) ** 0.669


def drive(name: str, throttle: float, speed_rpm: float, thrust_n: float = 0.0) -> pd.DataFrame:
    """A tester's samples: two seconds of rest, four of throttle, two of rest; its zero reads 0.5 N."""
    time = np.arange(0, 8, STEP_S)
    on = (time >= 2) & (time < 6)
    return pd.DataFrame(
        {
            "id": name, "time_s": time, "host_time_s": time, "quality": 0, "throttle": np.where(on, throttle, 0.0),
            "speed_rpm": np.where(on, speed_rpm, 0.0), "thrust_n": 0.5 + np.where(on, thrust_n, 0.0),
            "battery_voltage_v": 15.5,
        }
    )  # fmt: skip


def rows(*names: str, groups: list[str], start_s: float = 0.0) -> pd.DataFrame:
    return pd.DataFrame({"id": names, "group": groups, "host_start_s": start_s})


def test_a_thrust_point_is_the_steady_mean_less_the_rest() -> None:
    tests = [drive("b", 0.2, 9000.0, 3.0), drive("a", 0.1, 6000.0, 1.2)]
    found = thrust_points(pd.concat(tests, ignore_index=True), rows("b", "a", groups=["b", "a"]))
    assert list(found.columns) == list(COLUMNS)
    assert found["test"].tolist() == ["a", "b"]  # by throttle
    np.testing.assert_allclose(found["value"], [1.2, 3.0])
    np.testing.assert_allclose(found["speed_rad_s"], np.array([6000, 9000]) * np.pi / 30)


def test_a_torque_point_pairs_the_instruments_by_group_and_by_the_hosts_clock() -> None:
    """The sensor's recording began 1.5 s before the tester's, so its own times are 1.5 s ahead."""
    sensor_time = np.arange(0, 10, STEP_S)
    on = (sensor_time >= 3.5) & (sensor_time < 7.5)
    reading = pd.DataFrame(
        {
            "id": "w", "time_s": sensor_time, "host_time_s": sensor_time, "quality": 0,
            "moment_z_n_m": 0.01 - np.where(on, 0.03, 0.0),
        }
    )  # fmt: skip
    rotor = (drive("r", 0.2, 9000.0), rows("r", groups=["one"], start_s=101.5))
    found = torque_points(rotor, (reading, rows("w", groups=["one"], start_s=100.0)))
    assert found["test"].tolist() == ["one"] and found["value"][0] == pytest.approx(0.03)
    refused("without a recording of the wrench sensor", torque_points, rotor, (reading, rows("w", groups=["another"])))


def test_a_motor_that_never_ran_is_named() -> None:
    refused("idle: the motor never ran", thrust_points, drive("idle", 0.0, 0.0), rows("idle", groups=["idle"]))


def test_a_test_that_an_emulator_made_faster_than_life_is_taken_by_the_devices_own_time() -> None:
    """Five device seconds a host second: four seconds of throttle arrive within 0.8 s."""
    made = drive("fast", 0.2, 9000.0, 3.0)
    made["host_time_s"] = made["time_s"] / 5
    np.testing.assert_allclose(thrust_points(made, rows("fast", groups=["fast"]))["value"], [3.0])
    time = np.arange(0, 8, STEP_S)
    reading = pd.DataFrame({"id": "w", "time_s": time, "host_time_s": time / 5, "quality": 0})
    reading["moment_z_n_m"] = 0.01 - np.where((time >= 2) & (time < 6), 0.03, 0.0)
    pair = (made, rows("fast", groups=["one"])), (reading, rows("w", groups=["one"]))
    np.testing.assert_allclose(torque_points(*pair)["value"], [0.03])


def test_of_a_batch_that_the_host_sees_at_once_the_last_sample_tells_the_time() -> None:
    """Five samples arrive together every 0.1 s: between two looks of the host, time goes on from the latest sample."""
    time = pd.Series(np.arange(1, 51) * STEP_S)
    seen = pd.Series(10 + np.ceil(np.arange(1, 51) / 5) * 0.1)
    np.testing.assert_allclose(device_time(time, seen, pd.Series([10.1, 10.25, 11.0])), [0.1, 0.25, 1.0])


def rotor_tests(rng: np.random.Generator, growth: float, bend: float = 0.0) -> pd.DataFrame:
    """Twenty tests of 490 samples with a tare of 300; the noise grows linearly with the squared speed."""
    noise = 7e-4 * (1 + (growth - 1) * SPEED**2 / SPEED[-1] ** 2)
    value = 1.8558e-8 * SPEED**2 + bend * SPEED
    sd, means = np.empty(20), np.empty(20)
    for k in range(20):
        samples = rng.normal(value[k], noise[k], 490)
        sd[k], means[k] = samples.std(ddof=1), samples.mean() - rng.normal(0, 7e-4, 300).mean()
    return pd.DataFrame(
        {"speed_rad_s": SPEED, "value": means, "value_sd": sd, "samples": 490, "rest_samples": 300.0}
    ).sample(frac=1, random_state=1)


def test_constant_noise_does_not_grow_and_fits() -> None:
    rng = np.random.default_rng(4)
    found = [sample_noise(rotor_tests(rng, 1.0)) for _ in range(200)]
    assert np.mean([f["sd"] for f in found]) == pytest.approx(7e-4, rel=0.01)
    assert np.mean([f["growth_interval_95"][0] <= 1 <= f["growth_interval_95"][1] for f in found]) > 0.9
    assert np.mean([f["chi_square"] for f in found]) == pytest.approx(19, abs=1.5)
    assert {f["freedom"] for f in found} == {19}
    assert np.mean([f["p_value"] < 0.05 for f in found]) < 0.12


def test_noise_that_grows_is_seen() -> None:
    found = sample_noise(rotor_tests(np.random.default_rng(5), 2.0))
    # Mean square of the noise over the fastest five tests over that of the slowest five.
    level = (1 + SPEED**2 / SPEED[-1] ** 2) ** 2
    assert found["growth"] == pytest.approx(np.sqrt(level[-5:].mean() / level[:5].mean()), rel=0.03)
    assert found["growth_interval_95"][0] < found["growth"] < found["growth_interval_95"][1]


def test_points_that_are_no_parabola_have_a_small_p() -> None:
    assert sample_noise(rotor_tests(np.random.default_rng(6), 1.0, bend=1e-6))["p_value"] < 1e-3
