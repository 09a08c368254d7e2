"""Sizes a pilot knows: shares of weight and moment, and where an error leads within half a second."""

from dataclasses import replace

import numpy as np
import pytest

from rotorid.mismatch.decide.sizes import WINDOW_S, channel_metres, channel_size, drift_m, effect_sizes
from rotorid.mismatch.tell.locate import locate
from rotorid.mismatch.tell.places import size_at
from rotorid.mismatch.tell.sentences import surest_location
from rotorid.mismatch.tell.verdict import make_verdict
from rotorid.vehicle.improved import simulate_as_stated
from rotorid.vehicle.simulator import Commands
from tests.unit.mismatch.synthetic import HOVER, analysis, drag_finding
from tests.unit.vehicle.thesis import thesis_vehicle

TIME = np.arange(400) / 40


def constant(value: float):
    return [(TIME, np.full(len(TIME), value))]


def test_a_constant_force_leads_half_its_acceleration_times_the_square_of_time():
    assert drift_m(thesis_vehicle(), "force_x", constant(0.652)) == pytest.approx(0.5 * WINDOW_S**2, rel=1e-6)


@pytest.mark.parametrize(("axis", "lever", "channel"), [("r_x", 2, "moment_y"), ("r_y", 2, "moment_x")])
def test_a_moment_leads_as_far_as_the_simulator_flies_with_it(axis, lever, channel):
    vehicle, offset = thesis_vehicle(), 1e-4
    parameters = {"r_x": 0.0, "r_y": 0.0} | {axis: offset}
    flown = vehicle.model_copy(update={"effects": ({"id": "com_offset", "form": "moment", "parameters": parameters},)})
    trace = simulate_as_stated(flown, Commands(np.zeros(1), np.full((1, 4), HOVER)), WINDOW_S)
    moment = vehicle.mass_kg * vehicle.gravity_m_s2 * offset
    there = float(np.abs(trace.position[0, -1, :2]).max())
    assert drift_m(vehicle, channel, constant(moment)) == pytest.approx(there, rel=0.02)


def test_a_yaw_moment_and_a_reading_lead_nowhere():
    for channel in ("moment_z", "rotor_speed_1", "accelerometer_x"):
        assert drift_m(thesis_vehicle(), channel, constant(1.0)) is None


def test_windows_with_a_row_that_does_not_count_are_left_out():
    error = np.full(len(TIME), 0.652)
    error[30] = np.nan
    error[20:30] = error[31:40] = 100.0
    assert drift_m(thesis_vehicle(), "force_z", [(TIME, error)]) == pytest.approx(0.125, rel=1e-6)
    assert drift_m(thesis_vehicle(), "force_z", [(TIME[:10], error[:10])]) is None


def test_the_runs_held_out_are_what_a_channel_is_sized_by():
    made = analysis(findings=[drag_finding()])
    louder = replace(made, traces=tuple(replace(t, before=9 * t.before) if t.run != "b" else t for t in made.traces))
    assert channel_metres(louder, "force_x", "before") == channel_metres(made, "force_x", "before")
    size = channel_size(made, "force_x", 0.5, "before")
    assert size.share == pytest.approx(0.5 / (0.652 * 9.81)) and size.metres > 0.05
    assert channel_size(made, "moment_z", 0.01, "before").metres is None


def test_an_effect_has_its_metres_next_to_its_share():
    made = analysis(findings=[drag_finding()])
    made = replace(made, without={"rotor_drag": tuple(t.before for t in made.traces)})
    held = [np.full(len(t.time_s), t.run == "b") for t in made.compared]
    size = effect_sizes(made, held)["rotor_drag"]
    assert size.channel == "force_x" and 0.05 < size.metres < 0.2
    verdict = make_verdict(replace(made, effect_sizes={"rotor_drag": size}), locate(made), {})
    assert verdict.effects[0].size.metres_after_half_a_second == pytest.approx(size.metres, rel=1e-5)


def test_the_first_sentence_has_the_metres_and_so_have_page_and_file():
    made = analysis(findings=[drag_finding()])
    verdict = make_verdict(made, locate(made), {})
    metres = verdict.size.metres_after_half_a_second
    assert verdict.size.channel == "force_x" and verdict.size.of == "the weight"
    assert 0.05 < metres < 0.2
    # The sentence states a regime, and the sizes of this regime: all of the time at 5 m/s, not an eighth of it.
    there = size_at(made, surest_location(verdict.locations))
    assert there.metres > 2 * metres
    assert f"the forward force is {there.rms:.1f} N off, {there.metres:.2f} m after 0.5 s" in verdict.sentence
