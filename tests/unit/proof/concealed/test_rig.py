"""The instruments' parts against closed results, and the sets they make."""

import numpy as np
import pytest

from rotorid_proof.concealed.rig import cases, sensor


def test_creep_of_a_step_is_the_sum_of_its_elements():
    t = np.arange(20_000) * 1e-3
    load = np.ones((len(t), 1))
    load[0] = 0
    terms = ((0.01, 3.0), (0.02, 8.0))
    expected = sum(share * (1 - np.exp(-t / time)) for share, time in terms)
    assert sensor.standard_solid(load, terms, 1e-3)[:, 0] == pytest.approx(expected, abs=1e-5)


def test_the_loop_closes_and_does_not_depend_on_speed():
    for steps in (2000, 20_000):
        x = np.concatenate([np.linspace(0, 10, steps), np.linspace(10, 0, steps), np.linspace(0, 10, steps)])
        z = sensor.bouc_wen(x, 10.0, 1.0, 0.1)
        up, down = z[2 * steps + steps // 2], z[steps + steps // 2]
        assert np.abs(z).max() <= 1.0
        assert (up, down) == pytest.approx((1.0, -1.0), abs=0.02)  # levelled off at 10 % of 10 N, either way


def test_a_mode_rings_at_its_frequency_and_settles_on_the_load():
    hz, zeta, dt = 8.0, 0.05, 1e-4
    load = np.ones((40_000, 1))
    load[0] = 0.0
    y = sensor.mode(load, hz, zeta, dt)[:, 0]
    t = np.arange(len(y)) * dt
    w = 2 * np.pi * hz
    wd = w * np.sqrt(1 - zeta**2)
    expected = 1 - np.exp(-zeta * w * t) * (np.cos(wd * t) + zeta * w / wd * np.sin(wd * t))
    assert y[1:] == pytest.approx(expected[1:], abs=0.01)


def test_a_bessel_amplifier_is_flat_below_and_late_by_its_delay():
    """Phase of a Bessel filter of second order at −3 dB cutoff f_c: a delay of about 1.36/(2π f_c) far below it."""
    dt, hz = 1e-3, 20.0
    t = np.arange(8000) * dt
    x = t[:, None]
    late = (x - sensor.amplifier(x, hz, 2, dt))[-1, 0]
    assert late == pytest.approx(1.3617 / (2 * np.pi * hz), rel=0.02)


def test_flicker_noise_falls_as_one_over_f():
    x = sensor.pink(2**16, 4, np.random.default_rng(0))
    power = (np.abs(np.fft.rfft(x, axis=0)) ** 2).mean(axis=1)
    low, high = power[30:60].mean(), power[3000:6000].mean()
    assert low / high == pytest.approx(100, rel=0.2)
    assert x.std(axis=0) == pytest.approx(np.ones(4))


def test_a_vehicle_at_rest_on_a_stand_weighs_and_its_thrust_lifts():
    speed = np.zeros((3, 4))
    level = cases.stand_wrench(speed, (0.0, 0.3), True, False, {}, 1e-3)[0]
    weight = cases.VEHICLE["mass"] * cases.GRAVITY
    assert level[:3] == pytest.approx([0, 0, weight])
    tilting = cases.stand_wrench(speed, (0.0, 0.3), False, False, {}, 1e-3)[0]
    assert tilting[:3] == pytest.approx([-weight * np.sin(0.3), 0, weight * np.cos(0.3)])
    # four rotors at 1000 rad/s, flat, tared: −4 C_F ω², and no moment
    up = cases.stand_wrench(np.full((3, 4), 1000.0), (0, 0), True, True, {}, 1e-3)[0]
    assert up == pytest.approx([0, 0, -4 * cases.VEHICLE["thrust"] * 1e6, 0, 0, 0], abs=1e-9)


@pytest.mark.parametrize("kind, family", [("bench", f) for f in cases.BENCH] + [("stand", f) for f in cases.STAND])
def test_every_family_is_drawn_with_an_answer(kind, family):
    for seed in range(3):
        card = cases.drafted(kind, family, seed)
        told = bool(card.effects or card.outside or card.wrong or "believed" in card.changes)
        assert told == (family != "clean")


@pytest.mark.parametrize("kind", ["bench", "stand"])
def test_nothing_hidden_leaves_the_noise_and_a_seed_gives_the_same_set(kind):
    recording, truth, _ = cases.make(kind, "clean", 1)
    again, _, _ = cases.make(kind, "clean", 1)
    assert all(recording.runs[r].equals(again.runs[r]) for r in recording.runs)
    assert not any(run.isna().any().any() for run in recording.runs.values())
    for run in truth["oracle"]["runs"].values():
        assert all(found["mismatch_rms"] < 1e-9 for found in run.values())
    assert truth["verdict"] == ["no_mismatch"]
