"""What a verdict on one of the campaign's sets states of the truth."""

import numpy as np
import pytest

from rotorid_proof import campaign


def verdict(*effects: dict) -> dict:
    return {"effects": list(effects)}


def effect(name: str, status: str = "established", alternatives=(), **numbers: tuple[float, float, float]) -> dict:
    parameters = [
        {"symbol": symbol, "value": value, "unit": "1", "interval_95": [low, high]}
        for symbol, (value, low, high) in numbers.items()
    ]
    return {"id": name, "status": status, "alternatives": list(alternatives), "parameters": parameters}


def test_a_class_that_holds_what_is_at_work_is_right_and_a_suggestion_is_no_claim() -> None:
    found = campaign.names(
        verdict(
            effect("thrust_curve", "ambiguous", ["thrust_curve", "throttle_curve"]),
            effect("command_saturation"),
            effect("delay", "suggested"),
        ),
        ["throttle_curve", "motor_lag"],
    )
    assert found == {"right": ["thrust_curve or throttle_curve"], "wrong": ["command_saturation"]}


def test_the_number_furthest_out_speaks_for_its_effect() -> None:
    stated = verdict(effect("com_offset", r_x=(1.0, 0.0, 2.0), r_y=(5.0, 4.0, 6.0)), effect("delay", "suggested"))
    table = campaign.numbers(stated, {"com_offset": {"r_x": 1.5, "r_y": 9.0}, "delay": {"t": 1.0}})
    assert table["inside"].tolist() == [True, False]
    row = campaign.furthest(table).iloc[0]
    assert (row["symbol"], row["held"], row["numbers"]) == ("r_y", 1, 2)
    assert campaign.furthest(table.iloc[:0]).empty


def test_a_straight_line_is_fitted_to_some_runs_and_judged_on_others() -> None:
    load = np.random.default_rng(0).uniform(0, 9, (40, 3))
    slopes = np.array([[0.0, 0.1, 0.0], [0.0, 0.0, 0.0], [-2.0, -0.8, 0.0]])
    error = load @ slopes.T
    held_out = np.arange(40) >= 30
    error[held_out, 1] += 1.0  # what no training run has
    error[0] = np.nan
    found = campaign.straight_line(load, error, held_out)
    np.testing.assert_allclose(found["slopes"], slopes, atol=1e-12)
    np.testing.assert_allclose(found["after_n"], [0.0, 1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(found["before_n"][2], np.sqrt(np.mean(error[held_out, 2] ** 2)))


def test_a_sensor_that_stands_for_both_displacements_leaves_the_thrusts_moment_to_the_rotors():
    """Rotors at (±0.1, ±0.1) m, all with thrust F: the sensor has 10 mm along x too much, so that 4 F less 0.01 m must
    come from rotors that differ: Σ d_i F x_i = −0.04 F m with d = −0.1 in front and +0.1 at the rear.
    """
    places = np.array([[0.1, 0.1, 0.0], [0.1, -0.1, 0.0], [-0.1, -0.1, 0.0], [-0.1, 0.1, 0.0]])
    known = {
        "sensor_origin": {"d_x": 0.002, "d_y": 0.0, "d_z": 0.0},
        "com_offset": {"r_x": 0.01, "r_y": 0.0, "r_z": 0.001},
        "unequal_rotors": {"d_1": 0.02, "d_2": 0.0, "d_3": -0.02, "d_4": 0.0},
    }
    found = campaign.sensor_for_both(known, places)
    assert found["sensor_origin"] == pytest.approx({"d_x": 0.012, "d_y": 0.0, "d_z": 0.001})
    assert list(found["unequal_rotors"].values()) == pytest.approx([-0.08, -0.1, 0.08, 0.1])
