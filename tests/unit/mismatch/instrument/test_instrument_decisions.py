"""Instruments: what is of no use on the runs held out, what only scales commands, what nothing excites, slow noise."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from rotorid.effects.scale import rotor_inertia
from rotorid.mismatch.evidence.regression import Fit, build, spread_of
from rotorid.mismatch.evidence.rows import Rows, Term
from rotorid.mismatch.flight.wrench import WrenchModel
from rotorid.mismatch.instrument.analyse import analyse_instrument
from rotorid.mismatch.instrument.chain import find_chain
from rotorid.mismatch.instrument.model import MEMORY, MOST_OFFSET, OFFSET, UNMOVED, restrain
from rotorid.mismatch.instrument.setup import set_up
from rotorid.recordings import RecordingSet, Run
from tests.unit.mismatch.instrument.stands import BENCH, C_F, C_Q, claimed, one_rotor, stand_vehicle
from tests.unit.mismatch.instrument.test_stand import FULL_RAD_S, TILTS, tilted

LIMITS = {"rotor_speed_limits_rad_s": (0.0, FULL_RAD_S), "torque_coefficient_n_m_s2": C_Q}


def commanded_run(name: str, thrust_share: float, power: float, seed: int) -> Run:
    """Throttle in steps and the thrust C_F (1 + share) (2000 u^power)² at 50 Hz; no speed is measured."""
    rng = np.random.default_rng(seed)
    u = np.repeat(np.concatenate([np.linspace(0.2, 1, 9), np.linspace(0.9, 0.2, 8)]), 100)
    thrust = C_F * (1 + thrust_share) * (FULL_RAD_S * u**power) ** 2
    table = {"time_s": np.arange(len(u)) / 50, "throttle_1": u, "force_z_n": -thrust + 0.02 * rng.normal(size=len(u))}
    return Run(name, pd.DataFrame(table))


def commanded(thrust_share: float, power: float) -> RecordingSet:
    runs = [commanded_run(n, thrust_share, power, k) for k, n in enumerate("abc")]
    return one_rotor(runs, ["c"], **LIMITS)


def test_commands_all_a_share_too_low_are_a_thrust_coefficient_and_no_curve_of_the_throttle():
    analysis = analyse_instrument(commanded(0.04, 1.0))
    assert claimed(analysis) == set()
    assert analysis.values["thrust_coefficient_n_s2"][1] == pytest.approx(1.04 * C_F, rel=0.003)


def test_a_curve_of_the_throttle_stays_one_beside_it():
    assert claimed(find_chain(set_up(commanded(0.0, 0.8)))) == {"throttle_curve"}


def test_a_centre_of_mass_on_a_tilting_mount_is_no_tare_of_single_runs():
    """Runs at other tilts are held out: offsets of the runs fitted say nothing of them, a centre of mass does."""
    runs = tilted((0.004, -0.003, 0.002), TILTS[:5])
    analysis = analyse_instrument(RecordingSet("s", stand_vehicle(), runs, ("r1", "r3")))
    assert claimed(analysis) == {"com_offset"} and analysis.values == {}


def test_a_value_whose_column_is_mostly_noise_of_the_speeds_stays_as_believed():
    """While all rotors turn alike the arm's column is the tachometers' noise; the thrust's is not."""
    noise, limit = {"thrust": 0.01, "arm": 0.6}, np.array([0.15, 0.15, np.inf])
    where = {"thrust": 0, "arm": 1, OFFSET: 2}
    regression = SimpleNamespace(
        limit=limit,
        memory=0,
        keys_of=lambda kind: [OFFSET] if kind == "nuisance" else list(noise),
        columns=lambda keys: np.array([where[k] for k in keys]),
        column_noise=noise.__getitem__,
    )
    restrain(regression, SimpleNamespace(instrument=SimpleNamespace(rate_hz=50.0)))
    assert limit.tolist() == [0.15, UNMOVED, MOST_OFFSET / 50.0] and regression.memory == MEMORY


def test_the_share_of_noise_in_a_column():
    """A column of 2 and noise of 1 in every row: a quarter of its energy."""
    rows = [Rows("a", np.arange(100.0), np.zeros((100, 6)), np.full((100, 6, 1), 2.0))]
    noisy = [Rows("a", r.time_s, r.y, r.x + np.tile([1.0, -1.0], 50)[:, None, None]) for r in rows]
    term = Term("arm", "value", prior_sd=(0.03,))
    made = build(rows, [term], {0: np.array([1.0])}, lambda run, time_s: True, 1.0, 10.0, noisy)
    assert made.column_noise("arm") == pytest.approx(0.25)


def bench_of_slow_noise(seed: int) -> RecordingSet:
    """Four runs of staircases on one axis; noise 1/f, two and a half times as large as the white part."""
    rng, runs = np.random.default_rng(seed), []
    load = np.repeat([0, 2, 4, 6, 8, 10, 8, 6, 4, 2, 0], 60).astype(float)
    frequency = np.fft.rfftfreq(len(load), 0.1)
    for name in "abcd":
        spectrum = np.fft.rfft(rng.normal(size=len(load)))
        spectrum[1:] /= np.sqrt(frequency[1:] / frequency[1])
        spectrum[0] = 0.0
        slow = np.fft.irfft(spectrum, len(load))
        noise = 0.01 * rng.normal(size=len(load)) + 0.025 * slow / slow.std()
        table = {"time_s": np.arange(len(load)) / 10, "force_z_n": load + noise, "reference_force_z_n": load}
        runs.append(Run(name, pd.DataFrame(table)))
    return RecordingSet("b", BENCH, tuple(runs), ("c",))


@pytest.mark.parametrize("seed", range(4))
def test_slow_noise_of_a_sensor_is_no_effect(seed):
    assert claimed(analyse_instrument(bench_of_slow_noise(seed))) == set()


def test_the_spread_of_scores_that_last_is_that_of_their_sums():
    """AR(1) scores of pole 0.8: the sum's variance is n σ² (1 + 0.8)/(1 − 0.8); neighbours of other runs count not."""
    rng = np.random.default_rng(1)
    n = 20_000
    scores = np.zeros((n, 1))
    for i in range(1, n):
        scores[i] = 0.8 * scores[i - 1] + rng.normal()
    white = (scores.T @ scores).item()
    assert spread_of(scores, np.zeros(n), 60)[0, 0] / white == pytest.approx(9.0, rel=0.1)
    assert spread_of(scores, np.arange(n), 60)[0, 0] == pytest.approx(white)
    assert spread_of(scores, np.zeros(n), 0)[0, 0] == pytest.approx(white)


def test_a_rotor_may_be_as_heavy_as_stated_whatever_the_stand_s_inertia():
    def bound(**changes):
        return rotor_inertia(stand_vehicle(inertia_kg_m2={"xx": 2e-5, "yy": 2e-5, "zz": 1.2e-5}, **changes)).high

    assert bound() == pytest.approx(5e-6)
    assert bound(rotor_inertia_kg_m2=8e-6) == pytest.approx(3.2e-5)


def test_an_offset_in_time_must_be_three_standard_errors_from_none():
    """Of two offsets, 4 and 2.4 of their errors, the surer one is delivered."""
    keys = ["offset:surely", "offset:hardly"]
    fit = Fit(np.array([0, 1]), np.array([0.004, -0.0043]), 0.0, np.diag([0.001**2, 0.0018**2]), np.zeros(1))
    regression = SimpleNamespace(
        keys_of=lambda *kinds: keys if kinds == ("nuisance",) else [],
        columns=lambda asked: np.array([keys.index(k) for k in asked]),
        fit=lambda asked, loose: fit,
    )
    model = SimpleNamespace(regression=regression)
    assert WrenchModel.delivered_with(model, ["rotor_drag"], {}) == ["offset:surely", "rotor_drag"]


def sagging_run(name: str, seed: int) -> Run:
    """Throttle in steps of a second, ω = 2000 u (V/16)^0.8 at once, a voltmeter with 0.05 V of noise."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(0.2, 1.0, 40), 50)
    time_s = np.arange(len(u)) / 50
    volts = 16.0 - 0.01 * time_s - 0.8 * u**3
    thrust = C_F * (FULL_RAD_S * u * (volts / 16.0) ** 0.8) ** 2
    table = {"time_s": time_s, "throttle_1": u, "battery_voltage_v": volts + 0.05 * rng.standard_normal(len(u))}
    return Run(name, pd.DataFrame(table | {"force_z_n": -thrust + 0.02 * rng.standard_normal(len(u))}))


def test_noise_of_a_voltmeter_next_to_a_sag_is_no_other_effect():
    recordings = one_rotor([sagging_run(n, k) for k, n in enumerate("abc")], ["c"], **LIMITS)
    assert claimed(analyse_instrument(recordings)) == {"battery_sag"}
