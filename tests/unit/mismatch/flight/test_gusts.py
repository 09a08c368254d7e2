"""A gust found as a wind, through the drag it is felt by. A steady wind, through the drag by which it is felt."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rotorid.mismatch.analyse import analyse
from rotorid.mismatch.flight import gusts
from rotorid.mismatch.flight.gusts import Gust, blowing, knots_of
from tests.unit.mismatch.flights import recorded

WINDOW_S, WIND_M_S, DRAG = (8.0, 12.0), np.array([4.0, -2.0]), 0.4


@pytest.fixture(scope="module")
def gusty():
    return analyse(recorded(1, 2, 3, flight={"drag": DRAG, "excitation": 1.5, "gust": (*WINDOW_S, *WIND_M_S)}))


@pytest.mark.slow
def test_the_wind_of_a_gust_and_the_drag_beside_it(gusty):
    """0.4 1/s times 0.652 kg is 0.261 N s/m; rotors turn at about 1070 rad/s, so k_d about 0.261 / 4280 = 6.1e-5."""
    found = {f.id: f for f in gusty.findings if f.status == "established"}
    assert set(found) == {"gust", "rotor_drag"}
    for estimate, wind in zip(found["gust"].parameters, WIND_M_S, strict=True):
        assert abs(estimate.value - wind) < 0.4
    (drag,) = found["rotor_drag"].parameters
    slowing = drag.value * (4280 if "independent" not in found["rotor_drag"].form.name else 1.0)
    assert abs(slowing - 0.261) < 0.02


def test_it_is_found_in_every_run_and_leaves_little(gusty):
    """Runs that are held out too: a wind belongs to its run."""
    (gust,) = [f for f in gusty.findings if f.id == "gust"]
    assert {w[0] for w in gust.windows} == {"run00", "run01", "run02"}
    for _, start, stop in gust.windows:
        assert abs(start - WINDOW_S[0]) < 0.5 and abs(stop - WINDOW_S[1]) < 0.5
    for trace in gusty.traces:
        if trace.channel in ("force_x", "force_y"):
            inside = (trace.time_s > 8.5) & (trace.time_s < 11.5)
            assert trace.after[inside].std() < 0.35 * np.sqrt(np.mean(trace.before[inside] ** 2))


def test_a_weaker_gust_beside_a_strong_one_is_kept(monkeypatch):
    """Of 5, 2, 2 and 0.5 times the noise: the strong one bears out those of 2; alone, those of 2 say nothing."""
    sizes = {"a": 5.0, "b": 2.0, "c": 2.0, "d": 0.5}
    found = [Gust(run, np.arange(3.0), np.ones((3, 2)), np.eye(6), 1e-9) for run in sizes]
    monkeypatch.setattr(gusts, "size_of", lambda gust, model: sizes[gust.run])
    monkeypatch.setattr(gusts, "share_of_airspeed", lambda gust, model: 1.0)
    assert [g.run for g in gusts.believed(found, None)] == ["a", "b", "c"]
    assert gusts.believed(found[1:], None) == []
    doubtful = replace(found[0], p_value=1e-3)
    assert gusts.believed([doubtful, *found[1:]], None) == []


def test_a_wind_of_a_small_share_of_the_airspeed_is_what_the_drag_is_wrong_by(monkeypatch):
    """A wind of 1.4 m/s north and east: met at 10 m/s it is a seventh, at 5 m/s more than a quarter."""
    time_s = np.linspace(0.0, 2.0, 201)
    gust = Gust("a", np.arange(3.0), np.ones((3, 2)), np.eye(6), 1e-9)
    monkeypatch.setattr(gusts, "size_of", lambda gust, model: 5.0)
    for speed_m_s, kept in ((10.0, []), (5.0, [gust])):
        motion = SimpleNamespace(time_s=time_s, velocity=np.tile([0.0, speed_m_s, 0.0], (201, 1)))
        model = SimpleNamespace(segments=[SimpleNamespace(run="a", motion=motion)])
        assert gusts.share_of_airspeed(gust, model) == pytest.approx(np.sqrt(2.0) / speed_m_s)
        assert gusts.believed([gust], model) == kept


def test_of_too_many_windows_the_strongest_are_looked_at():
    """Windows of 3 s have 11 knots: two fit into 25, whatever runs they are of."""
    found = [("a", [(0.0, 3.0, 9.0), (5.0, 8.0, 6.5)]), ("b", [(1.0, 4.0, 7.0)])]
    assert gusts.strongest(found, 25) == [("a", [(0.0, 3.0, 9.0)]), ("b", [(1.0, 4.0, 7.0)])]
    assert gusts.strongest(found, 33) == found


def test_without_a_gust_none_is_told():
    analysis = analyse(recorded(4, 5, flight={"drag": DRAG, "excitation": 1.5}))
    assert "gust" not in {f.id for f in analysis.findings}


def test_the_wind_between_knots_and_outside():
    knots = knots_of(2.0, 4.0, 1.0)
    np.testing.assert_allclose(knots, [2, 3, 4])
    wind = np.array([[0.0, 1.0], [2.0, 1.0], [0.0, 1.0]])
    np.testing.assert_allclose(blowing(knots, wind, np.array([1.9, 2.5, 3.5, 4.1])), [[0, 0], [1, 1], [1, 1], [0, 0]])


def test_height_is_the_mean_from_the_first_to_the_last_strong_knot():
    """Knots of 0, 3, 1, 5, 0 m/s to the north: 3, 1 and 5 have a mean of 3 and a variance of 8/3; the mean's variance
    is 0.01 / 3 from the fit and 8/3 / 3 from the flutter."""
    wind = np.array([[0.0, 0.0], [3.0, 0.0], [1.0, 0.0], [5.0, 0.0], [0.0, 0.0]])
    height, sd = Gust("run", np.arange(5.0), wind, 0.01 * np.eye(10), 0.0).height()
    np.testing.assert_allclose(height, [3.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(sd, np.sqrt([0.01 / 3 + 8 / 9, 0.01 / 3]))


@pytest.mark.slow
def test_a_wind_that_blows_throughout_is_stated_as_a_velocity():
    flights = recorded(1, 2, 3, flight={"drag": DRAG, "excitation": 1.5, "gust": (-10.0, 60.0, 3.0, -1.5)})
    analysis = analyse(replace(flights, held_out=("run01",)))
    found = {f.id: f for f in analysis.findings if f.status == "established"}
    assert set(found) == {"steady_wind", "rotor_drag"}
    assert [p.symbol for p in found["steady_wind"].parameters] == ["w_north", "w_east"]
    for estimate, wind in zip(found["steady_wind"].parameters, (3.0, -1.5), strict=True):
        assert abs(estimate.value - wind) < 0.15 and estimate.low < wind < estimate.high


STEADY_M_S, SQUARE_DRAG = (-1.0, 3.0), 0.06


@pytest.fixture(scope="module")
def blown():
    return analyse(recorded(1, 2, 3, flight={"square_drag": SQUARE_DRAG, "excitation": 1.5, "wind": STEADY_M_S}))


@pytest.mark.slow
def test_a_wind_beside_a_drag_of_the_square(blown):
    """0.06 1/m times 0.652 kg is 0.0391 N s2/m2: through it a wind is no force that is constant in world axes."""
    found = {f.id: f for f in blown.findings if f.status == "established"}
    assert set(found) == {"steady_wind", "frame_drag"}
    for estimate, wind in zip(found["steady_wind"].parameters, STEADY_M_S, strict=True):
        assert estimate.low < wind < estimate.high and abs(estimate.value - wind) < 0.3
    sideways = [p.value for p in found["frame_drag"].parameters][:2]  # it hardly climbs
    assert np.allclose(sideways, 0.652 * SQUARE_DRAG, rtol=0.1)
