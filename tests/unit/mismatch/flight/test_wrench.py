"""The model of force and moment: what counts as noise, and how large a term is."""

from dataclasses import replace

import numpy as np
import pytest

from rotorid.mismatch.evidence.motion import Segment
from rotorid.mismatch.evidence.regression import full_fit_residuals
from rotorid.mismatch.evidence.rows import Rows
from rotorid.mismatch.evidence.speedpath import CommandChain, SpeedFit, SpeedResult
from rotorid.mismatch.flight import wrench
from rotorid.mismatch.flight.prepare import prepare
from rotorid.mismatch.flight.wrench import (
    SAME_WRENCH,
    Seconds,
    caused,
    channel_floor,
    inflated_channels,
    without_unseen,
)
from rotorid.recordings import Vehicle
from tests.unit.mismatch.evidence.test_rows import still
from tests.unit.mismatch.flights import recorded


def two_channels(force: float, moment: float, size: int = 1600) -> Rows:
    """A column in force_x and moment_x, and responses that hold it with these coefficients; noise of one sigma."""
    rng = np.random.default_rng(0)
    y, x = np.full((size, 12), np.nan), np.zeros((size, 12, 1))
    for channel, coefficient in ((0, force), (3, moment)):
        x[:, channel, 0] = 2 * rng.normal(size=size)
        y[:, channel] = coefficient * x[:, channel, 0] + rng.normal(size=size)
    return Rows("b", np.arange(size) / 40.0, y, x)


def test_a_residual_far_above_its_noise_is_itself_the_noise():
    rng = np.random.default_rng(1)
    noise = np.full(12, np.nan)
    noise[[0, 3]] = 0.1, 0.001
    remains = np.full((500, 12), np.nan)
    remains[:, 0], remains[:, 3] = 0.1 * rng.normal(size=500), 0.08 * rng.normal(size=500)
    assert list(np.flatnonzero(inflated_channels([remains], noise))) == [3]


def test_sizes_second_by_second_are_those_of_the_rows():
    """A column of 1 in the first second and 3 in the second, times 2, noise 0.5: 4 and 12, nine tenths up 11.2."""
    rows = two_channels(1.0, 1.0, 85)
    rows.x[:, 0, 0] = np.where(np.arange(85) < 40, 1.0, 3.0)
    rows.x[:, 3, 0] = 0.0
    noise = np.where(np.isfinite(rows.y[0]), 0.5, np.nan)
    found = Seconds([rows], noise, 40).sizes(np.array([0]), np.array([2.0]))
    np.testing.assert_allclose(found, [11.2, *[0.0] * 11])


def sizes_of_parts(parts: list[np.ndarray], noise: np.ndarray, per: int, quantile: float = 0.9) -> np.ndarray:
    """Quantile over seconds of the rms of contributions (n, 12), in units of the noise; the largest of all parts."""
    best = np.zeros(12)
    for part in parts:
        count = len(part) // per
        if count:
            local = np.sqrt((part[: count * per].reshape(count, per, 12) ** 2).mean(axis=1))
            best = np.fmax(best, np.quantile(local, quantile, axis=0) / noise)
    return np.nan_to_num(best)


def test_sizes_of_several_columns_and_stretches():
    rng = np.random.default_rng(2)
    acts = (np.arange(12) < 4)[None, :, None]
    stretches = [Rows("a", np.arange(n) / 40, np.zeros((n, 12)), rng.normal(size=(n, 12, 5)) * acts) for n in (410, 30)]
    cols, beta, noise = np.array([4, 0, 3]), rng.normal(size=3), np.full(12, 2.0)
    expected = sizes_of_parts([r.x[:, :, cols] @ beta for r in stretches], noise, 40)
    np.testing.assert_allclose(Seconds(stretches, noise, 40).sizes(cols, beta), expected, rtol=1e-12)


def with_blue_noise(slow: float) -> tuple[Rows, Rows]:
    """A column `slow` times a sine of 0.5 Hz, read with noise that grows with frequency, in a channel with the same.

    The response holds the true column (2 of it) and noise of its own, as the copy with noise added once more does.
    """
    rng = np.random.default_rng(2)
    size, rate_hz = 8000, 40.0
    time_s = np.arange(size) / rate_hz
    blue = [np.diff(rng.normal(size=size + 2), n=2) for _ in range(4)]
    signal = slow * np.sin(np.pi * time_s)
    y, x = np.full((size, 12), np.nan), np.zeros((size, 12, 1))
    y[:, 5], x[:, 5, 0] = 2 * signal + blue[0], signal + blue[1]
    rows = Rows("b", time_s, y, x)
    y, x = y.copy(), x.copy()
    y[:, 5] += blue[2]
    x[:, 5, 0] += blue[3]
    return rows, Rows("b", time_s, y, x)


def test_a_slow_column_is_seen_through_noise_of_higher_frequency():
    """Noise has six times the sine's energy, but hardly any at its frequency: the fit holds all of it."""
    rows, noisy = with_blue_noise(1.4)
    colours = without_unseen([rows], [noisy], 40.0, 20.0)
    assert rows.x[:, 5].any() and list(colours) == [5]
    _, coefficient = full_fit_residuals([rows], np.zeros(1), colours)
    assert abs(coefficient[0] - 2) < 0.1
    _, attenuated = full_fit_residuals([rows], np.zeros(1))
    assert attenuated[0] < 0.5


def test_a_column_that_is_all_noise_says_nothing():
    rows, noisy = with_blue_noise(0.0)
    assert without_unseen([rows], [noisy], 40.0, 20.0) == {}
    assert not rows.x.any() and not noisy.x.any()


def test_no_channel_is_known_better_than_a_share_of_the_rotors_own_changes():
    """C_F = 1e-6, rotors at x = ±0.1 m; one turns at 1000 and 2000 rad/s in turn: 1.5 N of spread, and a tenth."""
    vehicle = Vehicle(
        name="two", kind="flight", mass_kg=1.0, inertia_kg_m2={"xx": 0.01, "yy": 0.01, "zz": 0.02},
        rotors=[{"x_m": 0.1, "y_m": 0.0, "spin": "ccw"}, {"x_m": -0.1, "y_m": 0.0, "spin": "cw"}],
        thrust_coefficient_n_s2=1e-6, torque_coefficient_n_m_s2=1e-8,
    )  # fmt: skip
    speed = np.tile([[1000.0, 1000.0], [2000.0, 1000.0]], (200, 1))
    segment = Segment("run", 100.0, still(400, rotor_speed=speed), "accelerometer")
    floor = channel_floor([segment], vehicle)
    np.testing.assert_allclose(floor[:6], SAME_WRENCH * np.array([0.375, 0.375, 1.5, 0.0, 0.15, 0.015]), atol=1e-12)


def test_a_channel_known_to_be_above_what_the_catalogue_leaves_is_searched_once(monkeypatch):
    """One search says in which channels the model's own residual is the noise; the next begins with it."""
    prepared = prepare(recorded(1))
    before = wrench.wrench_model(prepared, prepared.terms)
    searches = []
    monkeypatch.setattr(wrench, "searched", lambda *given: searches.append(given[4]) or before)
    known = replace(before, inflated=np.arange(12) == 0)
    again = wrench.wrench_model(prepared, prepared.terms, before=known)
    assert len(searches) == 1 and again.inflated[0]
    own = wrench.after_residual(before)
    assert all(np.array_equal(left[:, 0], part[:, 0]) for left, part in zip(searches[0], own, strict=True))
    assert not np.array_equal(searches[0][0][:, 1], own[0][:, 1])


@pytest.mark.parametrize(("lifted", "turned"), [(True, True), (True, False), (False, True), (False, False)])
def test_of_commands_that_are_answers_the_mean_over_seconds_counts(lifted, turned):
    """Squares of 1 plus a wave of the collective at 2 Hz and one between the rotors at 3 Hz; trims stay."""
    time_s = np.arange(0.0, 12.0, 0.01)[:, None]
    together, apart = 0.2 * np.sin(4 * np.pi * time_s), 0.1 * np.sin(6 * np.pi * time_s) * np.array([1, -1, 1, -1])
    trim = np.array([0.04, 0.0, 0.0, -0.04])
    result = SpeedResult(SpeedFit((), np.zeros(0), {"late": 0.0}, 0.0), {}, {}, lifted_by_commands=lifted)
    chain = CommandChain(replace(result, turned_by_commands=turned), 1.0, None)
    found = caused(np.sqrt(1.0 + trim + together + apart), 0.01, chain) ** 2
    expected = 1.0 + trim + lifted * together + turned * apart
    np.testing.assert_allclose(found[300:-300], np.broadcast_to(expected, found.shape)[300:-300], atol=3e-3)
