"""Parameters of autopilots: true values lie in the stated intervals, and what a flight does not show is said."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import rotorid
from rotorid.identify.autopilot import MAPS, as_text, lagging, parameters_of, specific_drag
from rotorid.identify.correlated import autoregression, fit
from rotorid.recordings import RecordingSet, Run, write_set
from rotorid.recordings import columns as c
from rotorid_proof.autopilot_coverage import counted, drawn, flight, signal_of
from tests.command_line import answer
from tests.refusals import refused

THROTTLES = c.rotor_columns("throttle", 4)


def by_name(found) -> dict:
    return {p.name: p for p in found}


@pytest.mark.parametrize(
    "autopilot, shapes",
    [("px4", (0.7,)), ("ardupilot", (0.6, 0.13)), ("betaflight", (0.9,)), ("crazyflie", (0.09, -6e-4))],
)
def test_a_map_undoes_what_the_firmware_sends(autopilot: str, shapes: tuple[float, ...]) -> None:
    thrust = np.linspace(0.05, 1.0, 30)[:, None] * (12.0 if autopilot == "crazyflie" else 1.0)
    volts = np.full((30, 1), 3.9)
    signal = signal_of(autopilot, thrust, volts, shapes)
    assert MAPS[autopilot].thrust(signal, volts, np.array(shapes)) == pytest.approx(thrust, rel=2e-3)
    assert np.ptp(signal / thrust) > 0.01 * np.mean(signal / thrust)  # the map is no proportion: the check could fail


def test_drag_is_that_of_px4() -> None:
    """Values by hand from drag_fusion.cpp: along x alone the elliptic mean is 1/B_x."""
    force = specific_drag(np.array([[5.0, 0.0, 0.0], [3.0, 4.0, 0.0]]), 1 / 25, 1 / 50, 0.15)
    assert force[0] == pytest.approx([-(0.5 * 1.225 / 25 * 5 + 0.15) * 5, 0.0])
    mean = np.hypot(3 / 25, 4 / 50) / 5
    assert force[1] == pytest.approx(-(0.5 * 1.225 * mean * 5 + 0.15) * np.array([3.0, 4.0]))


def test_a_lag_is_exact_for_a_ramp() -> None:
    time = np.arange(0, 1, 0.01)
    assert lagging(time[:, None], 0.01, 0.05)[:, 0] == pytest.approx(
        time - 0.05 * (1 - np.exp(-time / 0.05)), abs=1e-12
    )


def test_intervals_hold_where_residuals_are_coloured() -> None:
    """Of 200 slopes under noise with a memory of 30 samples about 95 % are covered; as if independent, far fewer."""
    x = np.sin(np.arange(1500) / 25)
    hit = naive = 0
    for seed in range(200):
        rng = np.random.default_rng(seed)
        noise = np.zeros(1500)
        for k, white in enumerate(rng.standard_normal(1500)):
            noise[k] = 0.97 * noise[k - 1] + white
        y = 2.0 * x + noise
        wide = (np.array([-9.0, -99.0]), np.array([9.0, 99.0]))
        found = fit(lambda v, y=y: [y - v[0] * x - v[1]], np.zeros(2), wide, np.ones(2), np.full(2, np.inf))
        low, high = found.of(lambda v: float(v[0])).interval_95
        hit += low <= 2.0 <= high
        left = y - y.mean() - (slope := x @ y / (x @ x)) * x
        naive += abs(slope - 2.0) < 1.96 * left.std() / np.sqrt(x @ x)
    assert hit >= 182 and naive < 120


def test_white_residuals_are_left_as_they_are() -> None:
    white = np.random.default_rng(1).standard_normal(3000)
    assert np.abs(autoregression([white])[1:]).max(initial=0) < 0.1


@pytest.mark.parametrize("autopilot", list(MAPS))
def test_true_values_lie_in_their_intervals(autopilot: str) -> None:
    """The small part of what docs/proof/autopilot_parameters.csv counts on a hundred flights."""
    rows = counted(autopilot, range(100, 103), seconds=25.0)
    assert rows["covered"].mean() >= 0.85, rows
    assert rows["determined"].any()
    shapes = rows[rows["parameter"] == MAPS[autopilot].shapes[0].name]
    assert (shapes["high_95"] - shapes["low_95"]).max() < 2 * shapes["true"].abs().max() + 1  # intervals say something


@pytest.mark.slow
def test_of_a_hundred_flights_93_percent_are_covered() -> None:
    rows = [counted(autopilot, range(25)) for autopilot in MAPS]
    assert np.mean(np.concatenate([r["covered"] for r in rows])) >= 0.93


def test_a_calm_hover_does_not_determine_the_curve() -> None:
    rng = np.random.default_rng(3)
    truth = replace(drawn("ardupilot", rng), vigour_m_s2=0.02)
    found = by_name(parameters_of(flight(truth, rng, 20.0), "ardupilot"))
    for name in ("MOT_THST_EXPO", "MOT_SPIN_MIN", "MOT_THST_HOVER"):
        assert not found[name].determined and found[name].to_set is None
        assert found[name].sentence.startswith("not determined by this flight")
    assert found["hover_signal"].determined
    assert "MOT_THST_EXPO," not in as_text(list(found.values()), "ardupilot")


def test_the_curve_of_a_flight_under_a_controller() -> None:
    """The project's own simulator, closed loop: T/T_max = b u + (1 − b) u² is PX4's curve with THR_MDL_FAC = 1 − b."""
    vehicle = rotorid.template(
        "x500",
        effects=[
            {"id": "throttle_curve", "form": "thrust curve of the throttle", "parameters": {"b": 0.4}},
            {"id": "motor_lag", "form": "one constant", "parameters": {"tau": 0.05}},
        ],
    )
    runs = []
    for run in rotorid.simulate(vehicle, seconds=30, flights=2).runs:
        commands = list(c.rotor_columns("rotor_command", 4))
        table = run.table.drop(columns=[n for n in run.table if n.startswith("rotor_speed")])
        table[list(THROTTLES)] = table[commands] / vehicle.rotor_speed_limits_rad_s[1]
        runs.append(Run(run.name, table.drop(columns=commands)))
    found = by_name(
        parameters_of(RecordingSet("swings", vehicle.model_copy(update={"effects": ()}), tuple(runs)), "px4")
    )
    fac, lag = found["THR_MDL_FAC"], found["motor_time_constant_s"]
    assert fac.interval_95[0] <= 0.6 <= fac.interval_95[1]
    assert lag.interval_95[0] <= 0.05 <= lag.interval_95[1]


def test_what_the_recordings_lack_is_said() -> None:
    rng = np.random.default_rng(5)
    made = flight(drawn("px4", rng), rng, 6.0)
    table = made.runs[0].table
    without = replace(made, runs=(Run("flight", table.drop(columns=list(THROTTLES))),))
    found = by_name(parameters_of(without, "px4"))
    assert "holds no signals of the motors" in found["THR_MDL_FAC"].sentence and found["EKF2_MCOEF"].value > 0
    still = replace(made, runs=(Run("flight", table.drop(columns=list(c.VELOCITY))),))
    assert "drag needs attitude and velocity" in by_name(parameters_of(still, "px4"))["EKF2_MCOEF"].sentence
    blind = replace(made, runs=(Run("flight", table.drop(columns=list(c.SPECIFIC_FORCE))),))
    refused("need an accelerometer", parameters_of, blind, "px4")
    refused("did you mean betaflight?", parameters_of, made, "betaflihgt")


def test_the_command_writes_what_the_tool_loads(tmp_path: Path) -> None:
    rng = np.random.default_rng(11)
    truth = drawn("px4", rng)
    write_set(replace(flight(truth, rng, 25.0), name="set"), tmp_path)
    file = tmp_path / "x.params"
    answer("parameters", tmp_path / "set", "--to", "px4", "-o", file)
    rows = [line.split("\t") for line in file.read_text().splitlines() if line[0] != "#"]
    values = {name: float(value) for _, _, name, value, _ in rows}
    assert values["THR_MDL_FAC"] == pytest.approx(truth.shapes[0], abs=0.1)
    assert not set(values) & {"hover_signal", "motor_time_constant_s"}
    said = answer("parameters", tmp_path / "set", "--to", "px4", "--json")
    assert {p["name"] for p in json.loads(said)} >= {"THR_MDL_FAC", "MPC_THR_HOVER", "EKF2_BCOEF_X"}
