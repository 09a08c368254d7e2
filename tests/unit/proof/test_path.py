"""What a verdict states of the path from command to thrust, and what recorded speeds say."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from rotorid.effects.describe import EXAMPLE
from rotorid.recordings import RecordingSet, Run
from rotorid_proof import path
from rotorid_proof.concealed import drawn, feedback


def verdict(**numbers):
    return {"command_path": [{"symbol": s, "value": v, "interval_95": [v - 0.1, v + 0.1]} for s, v in numbers.items()]}


def test_what_is_stated_of_the_thrust_is_half_as_much_of_the_speed():
    found = path.stated_path(verdict(u_h=0.6, e_u=1.6, e_V=1.8, tau=0.2))
    assert {q: n.value for q, n in found.items()} == {"elasticity": 0.8, "late_s": 0.2, "voltage": 0.9}
    n = found["elasticity"]
    assert (n.low, n.high) == (pytest.approx(0.75), pytest.approx(0.85))
    assert n.holds(0.84) and not n.holds(0.9) and path.Number(1.0).holds(1.0) is None
    assert path.stated_path(verdict(u_h=0.6)) == dict.fromkeys(path.QUANTITIES)


def flown(name, n=0.8, lag=0.04, delay=0.006, p=0.9, seconds=16.0, seed=1):
    """Throttles, voltage and the speeds of four unequal rotors, by a recursion of its own; 200 Hz."""
    rng, dt = np.random.default_rng(seed), 0.005
    t = np.arange(0.0, seconds, dt)
    wave = sum(a * np.sin(2 * np.pi * f * t[:, None] + rng.uniform(0, 6, 4)) for a, f in ((0.05, 0.6), (0.05, 2.3)))
    u, volts = 0.4 + wave, 12.0 - 1.2 * t / seconds
    late = np.array([np.interp(t - delay, t, x) for x in u.T]).T
    steady = np.array([900.0, 950.0, 1000.0, 1100.0]) * (late / 0.4) ** n * ((volts / 11.4) ** p)[:, None]
    speed = steady.copy()
    for k in range(1, len(t)):
        speed[k] = speed[k - 1] + (1 - np.exp(-dt / lag)) * (steady[k] - speed[k - 1])
    table = {"time_s": t, "battery_voltage_v": volts, "specific_force_z_m_s2": -9.81 + 0 * t, "odd": t}
    table |= {f"throttle_{i + 1}": u[:, i] for i in range(4)}
    table |= {f"rotor_command_{i + 1}_rad_s": 2000 * u[:, i] for i in range(4)}
    table |= {f"rotor_speed_{i + 1}_rad_s": speed[:, i] + rng.normal(0, 5, len(t)) for i in range(4)}
    table["rotor_speed_1_rad_s"][300:800] = 0.0  # a sensor that lost the rotor
    return Run(name, pd.DataFrame(table))


def test_recorded_speeds_say_the_path_through_lost_readings_and_unequal_rotors():
    found = path.recorded_path([flown("a", seed=1), flown("b", seed=2)], 4)
    assert found["elasticity"].value == pytest.approx(0.8, rel=0.02)
    assert found["late_s"].value == pytest.approx(0.046, rel=0.05)
    assert found["voltage"].value == pytest.approx(0.9, abs=0.03)


def test_halves_that_disagree_are_no_truth():
    found = path.recorded_path([flown("a", n=0.6, seed=1), flown("b", n=1.0, seed=2)], 4)
    assert found["elasticity"] is None and found["late_s"] is not None


def test_a_set_is_concealed_with_each_kind_of_command_and_shows_no_speed():
    whole = RecordingSet("set", EXAMPLE, (flown("a"), flown("b", seed=2)))
    cases = {case.name: path.without_speeds(case) for case in path.cases_of(whole)}
    assert {"set/throttle/whole", "set/speed/whole", "set/throttle/a"} <= cases.keys()
    columns = set(cases["set/throttle/whole"].runs[0].table)
    assert columns == {"time_s", "battery_voltage_v", "specific_force_z_m_s2", *(f"throttle_{i}" for i in range(1, 5))}


def test_a_number_is_right_within_what_is_allowed_and_silence_is_counted_apart():
    truth = {"elasticity": path.Number(0.9, 0.88, 0.92), "late_s": path.Number(0.05, 0.05, 0.05), "voltage": None}
    said = {"elasticity": path.Number(0.75, 0.7, 0.8), "late_s": None, "voltage": path.Number(0.5)}
    rows = pd.DataFrame(map(vars, path.rows_of_case("a", truth, said, "explained", 1.0)))
    assert rows["status"].tolist() == ["right", "silent", "unknown"] and not rows["held"][0]
    total = path.summary(rows).set_index("quantity").loc["all"]
    assert (total["asked"], total["claimed"], total["right"], total["held"], total["silent"]) == (2, 1, 1, 0, 1)
    assert path.status_of("elasticity", path.Number(0.9), path.Number(0.71)) == "wrong"


def test_what_one_code_has_judged_is_not_judged_again(tmp_path):
    judged = []

    def rows_of(item):
        judged.append(item[0])
        return [{"set": item[0], "status": "right"}]

    for code in ("one", "one", "two"):
        path.kept_rows([("a",), ("b",)], rows_of, tmp_path / "rows.csv", code)
    assert judged == ["a", "b"] * 2

    for family in feedback.FAMILIES:
        for seed in range(6):
            own = feedback.drafted(family, seed).path
            assert own.share(np.array([own.hover]), 1.0) == pytest.approx(1.0)
            up = own.share(own.hover * np.exp([1e-4]), 1.0)
            assert np.log(up) / 2e-4 == pytest.approx(own.elasticity, rel=1e-3)
            assert own.command(own.share(np.array([0.6]), 1.0)) == pytest.approx(0.6)
            assert (own.elasticity != 1.0) == (family in ("curved", "both"))
            assert (own.lag_s > 0) == (family in ("late", "both"))


def test_a_drawn_flight_is_held_in_the_air_and_its_lift_follows_its_commands_late(monkeypatch):
    monkeypatch.setattr(feedback, "WARM_UP_S", 1.0)
    card = feedback.drafted("late", 3)
    card = replace(card, seconds=8.0, felt=True, path=feedback.Path(0.4, lag_s=0.06), gyro=0.02)
    flight = feedback.fly(card, np.random.default_rng(0))
    lift, asked = -flight["f"][:, 2] / feedback.GRAVITY, (flight["u"] / 0.4).mean(axis=1) ** 2
    assert lift.mean() == pytest.approx(1.0, abs=0.02) and np.abs(flight["p"]).max() < 5.0
    follows = 1 - np.exp(-feedback.STEP / 0.06)
    speed = np.ones(4)
    expected = []
    for u in flight["u"] / 0.4:
        expected.append(np.mean(speed**2))
        speed = speed + follows * (u - speed)
    left = (lift - np.array(expected))[250:]
    assert left.std() < 1.5 * card.gust and asked[250:].std() > 0


def test_drawn_flights_hold_commands_alone_and_the_same_seed_gives_the_same_set(monkeypatch):
    monkeypatch.setattr(feedback, "drafted", lambda f, s, own=feedback.drafted: replace(own(f, s), seconds=1.0))
    one, two = (drawn.make("feedback/both/development/001", 5) for _ in range(2))
    assert all(one[0].runs[r].equals(two[0].runs[r]) for r in one[0].runs)
    assert not [n for n in one[0].runs["run01"] if n.startswith("rotor_speed")]
    assert {e["id"] for e in one[1]["effects"]} >= {"motor_lag", "throttle_curve"} and json.dumps(one[1])
