"""Flights by differential equations against closed results: hover, fall, energy, blades, lags, the observer."""

import numpy as np
import pytest

from rotorid_proof.concealed.continuous import cases, craft, paths
from rotorid_proof.concealed.continuous.equations import (
    GRID,
    HEAD,
    RHO,
    Nature,
    parameters,
    slope,
    solve,
    start,
    turn_matrix,
)
from rotorid_proof.concealed.continuous.instruments import Kit, mounted, observe
from rotorid_proof.concealed.continuous.rotor import coefficients, pitch_for

CRAFT = craft.drawn(np.random.default_rng(3))
NO_GUSTS = np.zeros((1, 3))


def still(seconds):
    path = np.zeros((int(seconds / GRID) + 8, 13))
    path[:, 2] = -15.0
    return path


def derivative(nature, change=(), speed=None):
    """State derivative and specific force of the vehicle in hover but for `change` (index, value)."""
    y = start(CRAFT, still(1.0))
    if speed is not None:
        y[HEAD + CRAFT.n :] = speed
    for index, value in change:
        y[index] = value
    out = slope(0.0, y, still(1.0), NO_GUSTS, *parameters(CRAFT, nature, 1.0))
    return out[:-3], out[-3:]


def test_hover_is_an_equilibrium_and_stays_one():
    out, felt = derivative(Nature(lag=0.03))
    assert out[:13] == pytest.approx(np.zeros(13), abs=1e-9)
    assert felt == pytest.approx([0, 0, -craft.GRAVITY])
    times = np.arange(0, 3, 0.01)
    flight = solve(CRAFT, Nature(lag=0.03), still(3.0), times)
    assert flight["speed"] == pytest.approx(CRAFT.hover, rel=1e-4)
    assert np.ptp(flight["p"], axis=0).max() < 1e-3


def test_a_vehicle_with_still_rotors_falls_to_its_terminal_speed():
    area = np.array([0.02, 0.02, 0.05]) * CRAFT.arm**2
    end = np.sqrt(2 * CRAFT.mass * craft.GRAVITY / (RHO * area[2]))
    out, felt = derivative(Nature(lag=0.03, area=area), [(5, end)], speed=0.0)
    assert out[5] == pytest.approx(0, abs=1e-9) and felt[2] == pytest.approx(-craft.GRAVITY)
    out, felt = derivative(Nature(lag=0.03), speed=0.0)
    assert out[5] == pytest.approx(craft.GRAVITY) and felt == pytest.approx([0, 0, 0], abs=1e-12)


def test_turning_freely_follows_euler_and_an_accelerometer_off_centre_feels_it():
    rates = np.array([1.0, -0.5, 2.0])
    centre = np.array([0.01, -0.02, 0.0])
    change = [(10 + i, w) for i, w in enumerate(rates)]
    out, felt = derivative(Nature(lag=0.03, centre=centre), change, speed=0.0)
    turning = np.linalg.solve(CRAFT.inertia, -np.cross(rates, CRAFT.inertia @ rates))
    assert out[10:13] == pytest.approx(turning)
    at = -centre
    assert felt == pytest.approx(np.cross(turning, at) + np.cross(rates, np.cross(rates, at)))


def test_thrust_to_the_front_pitches_up_and_a_centre_ahead_of_it_pitches_down():
    out, _ = derivative(Nature(lag=0.03, gain=np.where(CRAFT.hubs[:, 0] > 0, 1.05, 0.95)))
    assert out[11] > 0
    out, _ = derivative(Nature(lag=0.03, centre=np.array([0.002, 0, 0])))
    moment = CRAFT.inertia @ out[10:13]
    assert moment == pytest.approx([0, -0.002 * CRAFT.mass * craft.GRAVITY, 0], abs=1e-9)


def test_blades_carry_the_vehicle_and_follow_momentum_theory():
    target = CRAFT.thrust / (RHO * np.pi * CRAFT.radius**4)
    pitch = pitch_for(target, 0.12)
    assert coefficients(0.0, 0.0, 0.12, pitch)[0] == pytest.approx(target, rel=1e-6)
    _, felt = derivative(Nature(lag=0.03, blades=1.0))
    assert felt == pytest.approx([0, 0, -craft.GRAVITY], rel=1e-5)
    climb, sink = (coefficients(0.0, m, 0.12, pitch)[0] for m in (0.01, -0.01))
    # with k = σa/4 and λ = μ_z + C_T/2λ, in hover 2 dλ = dμ_z + dC_T/2λ, so that
    # dC_T/dμ_z = −(k/2) / (1 + k/4λ) with 4λ = 2 √(2 C_T)
    k = 0.12 * 5.7 / 4
    slope_ = -0.5 * k / (1 + k / (2 * np.sqrt(2 * target)))
    assert (climb - sink) / 0.02 == pytest.approx(slope_, rel=0.05)
    ahead, side = coefficients(0.1, 0.0, 0.12, pitch)
    assert ahead > target and side > 0


def test_motors_lag_in_flight_by_their_constant():
    way = paths.path(8.0, "stir", np.random.default_rng(0), 0.4, CRAFT.name == "micro")
    times = np.arange(0, 7.5, 0.001)
    flight = solve(CRAFT, Nature(lag=0.05), way, times)
    lagged = flight["speed"] + 0.05 * np.gradient(flight["speed"], 0.001, axis=0)
    assert np.abs(lagged - flight["command"])[5:-5].max() < 2e-3 * CRAFT.hover


def test_specific_force_is_the_derivative_of_the_velocity():
    way = paths.path(8.0, "survey", np.random.default_rng(0), 0.4, CRAFT.name == "micro")
    times = np.arange(0, 7.5, 0.001)
    flight = solve(CRAFT, Nature(lag=0.03, centre=np.array([0.01 * CRAFT.arm, 0, 0])), way, times)
    along = np.gradient(flight["v"], 0.001, axis=0) - np.array([0, 0, craft.GRAVITY])
    for i in (2000, 4000, 6000):
        assert turn_matrix(flight["q"][i]).T @ along[i] == pytest.approx(flight["f"][i], abs=2e-3)


def test_the_observer_finds_a_tilt_that_it_was_started_without():
    k = 30_000
    force = np.tile([0.0, 0, -craft.GRAVITY], (k, 1))
    q = np.array([np.cos(0.1), np.sin(0.1), 0, 0])
    v, found = observe(force, np.zeros((k, 3)), np.zeros((k, 3)), np.zeros(k), q, 50, 1e-3)
    assert 2 * np.arccos(min(found[-1, 0], 1.0)) < 0.01
    assert np.abs(v[-1]).max() < 0.1


def test_a_turned_accelerometer_on_an_arm_reads_what_geometry_says():
    k = 200
    t = np.arange(k) * 1e-3
    flight = {"t": t, "w": np.stack([0 * t, 0 * t, 3 + 0 * t], 1), "f": np.tile([0.0, 0, -9.8], (k, 1))}
    still_turned = mounted(flight, Kit("capture", 100, (), force_turn=(0.02, 0.0, 0.0)))
    assert still_turned[0] == pytest.approx([0, -9.8 * 0.02, -9.8], abs=3e-3)
    on_arm = mounted(flight, Kit("capture", 100, (), arm=(0.1, 0.0, 0.0)))
    assert on_arm[0] == pytest.approx([-0.9, 0, -9.8], abs=1e-9)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_clean_flight_leaves_noise_alone(seed):
    sheet, kit = cases.drafted("clean", seed)
    times = np.arange(8000) / cases.FINE_HZ
    way = paths.path(8.0, "stir", np.random.default_rng(1), 0.4, sheet.craft.name == "micro")
    flight = solve(sheet.craft, sheet.nature, way, times)
    flight["sag"] = 0.0
    vehicle, off = cases.believed(sheet, np.random.default_rng(0), kit)
    ideal, written = cases.record(flight, kit, sheet.craft.hover, np.random.default_rng(0))
    a, b = cases.residuals(ideal, vehicle), cases.residuals(written, vehicle)
    assert not off
    for channel in a:
        assert cases.rms(a[channel]) < 0.5 * cases.rms(b[channel] - a[channel]) + 1e-12, channel


@pytest.mark.parametrize("family", sorted(cases.FAMILIES))
def test_every_family_is_drawn_with_an_answer(family):
    for seed in range(4):
        sheet, _ = cases.drafted(family, seed)
        assert bool(sheet.effects or sheet.outside or sheet.wrong) == (family != "clean")
