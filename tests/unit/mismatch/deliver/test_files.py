"""`conditions.yaml` and `instruments.yaml`: what belongs to a run and to a sensor, read back as it was written."""

from dataclasses import replace

import numpy as np
import pytest

from rotorid.mismatch.decide.findings import RunWind
from rotorid.mismatch.decide.sizes import segments_of
from rotorid.mismatch.deliver.files import (
    conditions_of,
    empty,
    instruments_of,
    read_conditions,
    read_instruments,
    text_of,
)
from rotorid.mismatch.deliver.flown import model_of
from rotorid.mismatch.tell.forward import delivered_model, errors_of, forward_channels
from rotorid.report.deliver import write_files
from tests.refusals import refused
from tests.unit.mismatch.deliver.test_parts import WIND, sensor_error
from tests.unit.mismatch.synthetic import HOVER, K_D, analysis, drag_finding

NAMES = ("verdict.json", "report.html", "improved_vehicle.yaml")


def windy(**changes):
    """Drag in a steady wind of 2 m/s to the north."""
    winds = tuple(RunWind(run, "all the time", np.array([0.5, 39.5]), np.array([[2.0, 0.0]] * 2)) for run in "abc")
    return replace(analysis(findings=[drag_finding(), WIND]), winds=winds, **changes)


def test_a_steady_wind_stands_with_its_runs_and_comes_back(tmp_path):
    path = tmp_path / "conditions.yaml"
    path.write_text(text_of(conditions_of(windy())))
    found = read_conditions(path)
    assert [(c.id, c.run, c.start_s, c.stop_s) for c in found.conditions] == [
        ("steady_wind", run, None, None) for run in "abc"
    ]
    assert found.conditions[0].parameters == {"w_north": 2.0, "w_east": 0.0}
    assert found.wind("a", np.array([-1.0, 20.0, 99.0])).tolist() == [[2.0, 0.0, 0.0]] * 3
    assert found.wind("z", np.array([0.0])) is None


def test_a_gust_blows_in_its_window_alone():
    gust = replace(WIND, id="gust", windows=(("a", 4.0, 6.0),))
    wind = RunWind("a", "in windows", np.array([4.0, 5.0, 6.0]), np.array([[0.0, 0.0], [3.0, 1.0], [0.0, 0.0]]))
    found = conditions_of(replace(analysis(findings=[gust]), winds=(wind,)))
    assert found.wind("a", np.array([3.0, 4.5, 5.0, 7.0]))[:, 0].tolist() == [0.0, 1.5, 3.0, 0.0]
    assert (found.conditions[0].start_s, found.conditions[0].stop_s) == (4.0, 6.0)


def test_what_is_judged_is_what_is_read_back(tmp_path):
    """Numbers of more digits than the file states made the flight of the file another one."""
    gust = replace(WIND, id="gust", windows=(("a", 4.0, 6.0),))
    wind = RunWind("a", "in windows", np.array([4.0, 15.1234567, 26.0]), np.array([[0.0, 0.0], [np.pi, 1 / 3], [0, 0]]))
    judged = conditions_of(replace(analysis(findings=[gust]), winds=(wind,)))
    path = tmp_path / "conditions.yaml"
    path.write_text(text_of(judged))
    assert judged.conditions[0].air.north_m_s[1] != np.pi and read_conditions(path) == judged


def test_the_simulation_run_forward_flies_in_the_wind_that_was_found():
    """At a steady velocity in a wind as fast there is no airspeed, so no drag: the vehicle goes straight on."""
    made = windy()
    runs = tuple(
        replace(r, table=r.table.assign(velocity_x_m_s=2.0, position_x_m=2.0 * r.time_s)) for r in made.recordings.runs
    )
    made = replace(made, recordings=replace(made.recordings, runs=runs))
    with_wind = forward_channels(made)[0]["velocity"].rmse.held_out.after
    still = forward_channels(replace(made, winds=()))[0]["velocity"].rmse.held_out.after
    assert with_wind == pytest.approx(0.0, abs=1e-6)
    assert still > 0.1 * K_D * 4 * HOVER * 2.0 / 0.652


def test_an_error_of_a_gyroscope_is_taken_off_the_reading():
    """Rates that read 0.01 rad/s too much are no rotation where the instrument is known to."""
    made = analysis(findings=[sensor_error(values=(0.01, 0.0, 0.0))])
    runs = tuple(replace(r, table=r.table.assign(angular_velocity_x_rad_s=0.01)) for r in made.recordings.runs)
    made = replace(made, recordings=replace(made.recordings, runs=runs))
    segments = segments_of(made)
    known = errors_of(segments, delivered_model(made))[0].channels["attitude"]
    unknown = errors_of(segments, model_of(made.improved))[0].channels["attitude"]
    assert np.abs(known).max() < 1e-4 < np.abs(unknown).max()


def test_the_files_are_there_where_there_is_something_to_write_and_gone_where_not(tmp_path):
    write_files(replace(windy(), findings=(drag_finding(), WIND, sensor_error())), tmp_path)
    assert {"conditions.yaml", "instruments.yaml"} <= {p.name for p in tmp_path.iterdir()}
    assert read_instruments(tmp_path / "instruments.yaml").instruments[0].id == "gyro_error"
    write_files(analysis(findings=[drag_finding()]), tmp_path)
    assert {p.name for p in tmp_path.iterdir()} == {*NAMES, "ledger.json"}


def test_a_fault_of_a_sensor_has_the_times_at_which_it_was_there(tmp_path):
    dropped = sensor_error(id="sensor_dropout", form=None, values=(), windows=(("a", 4.0, 6.0), ("b", 1.0, np.inf)))
    path = tmp_path / "instruments.yaml"
    path.write_text(text_of(instruments_of(analysis(findings=[dropped]))))
    (found,) = read_instruments(path).instruments
    assert [(w.run, w.start_s, w.stop_s) for w in found.windows] == [("a", 4.0, 6.0), ("b", 1.0, None)]
    assert empty(conditions_of(analysis(findings=[dropped])))


def test_nothing_found_is_empty():
    made = analysis(findings=[drag_finding()])
    assert empty(conditions_of(made)) and empty(instruments_of(made))


@pytest.mark.parametrize(
    ("text", "said"), [("set: a\nwinds: []\n", "winds"), ("{", "not valid YAML"), ("[]", "found a list")]
)
def test_a_file_that_does_not_fit_is_refused_in_one_sentence(tmp_path, text, said):
    path = tmp_path / "conditions.yaml"
    path.write_text(text)
    refused(said, read_conditions, path)
