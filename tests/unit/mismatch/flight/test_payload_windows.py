"""A payload that is picked up or dropped in flight."""

from dataclasses import replace

import numpy as np
import pytest

from rotorid.mismatch.analyse import analyse
from rotorid.mismatch.deliver.files import delivered
from rotorid.mismatch.flight.swinging import change_rows, two_plateaus
from tests.unit.mismatch.flights import COLUMNS, quad, recorded

PARCEL_KG = 0.05
DROPPED_S = 12.0
CARRIED = {"run00": (15.0, 20.0), "run01": (0.0, DROPPED_S), "run02": (30.0, 30.0)}
"""Most of the time nothing is on board, and in the run that is held out it is picked up and dropped."""


def with_parcel(recordings):
    """Rotors that carry a parcel at the centre of mass as well, in some part of each run."""
    vehicle, runs = quad(), []
    for run in recordings.runs:
        table = run.table.copy()
        start, stop = CARRIED[run.name]
        aboard = (table["time_s"] >= start) & (table["time_s"] < stop)
        more = PARCEL_KG * -table["specific_force_z_m_s2"] / (4 * vehicle.thrust_coefficient_n_s2)
        for name in COLUMNS["rotors"]:
            table[name] = np.sqrt(table[name] ** 2 + np.where(aboard, more, 0.0))
        runs.append(replace(run, table=table))
    return replace(recordings, runs=tuple(runs))


def loads(states, rng, step=5.0, slope=0.0):
    """Loads of one stretch by half seconds: a plateau more where `states`, growing by `slope` a block."""
    noise = rng.standard_normal((len(states), 3))
    noise[:, 0] += step * np.asarray(states, float) + slope * np.arange(len(states))
    return noise


@pytest.mark.parametrize("dropped", [10, 37])
def test_a_step_in_the_midst_of_a_run_is_found_to_the_block(dropped):
    rng = np.random.default_rng(dropped)
    states = [np.zeros(60, bool), np.arange(60) < dropped, np.ones(40, bool)]
    found = two_plateaus([loads(s, rng) for s in states])
    assert all(np.array_equal(a, b) for a, b in zip(found, states, strict=True))


def test_what_drifts_or_differs_between_whole_runs_is_no_payload():
    rng = np.random.default_rng(1)
    nothing, everything = np.zeros(60, bool), np.ones(60, bool)
    assert two_plateaus([loads(nothing, rng) for _ in range(3)]) is None
    assert two_plateaus([loads(nothing, rng), loads(everything, rng)]) is None
    assert two_plateaus([loads(nothing, rng, slope=0.15) for _ in range(2)]) is None


def test_the_instant_is_found_to_the_row():
    """At row 63 of blocks of 10: the blocks change at 60."""
    rng = np.random.default_rng(2)
    column = np.full(120, 9.81)
    left = column * 0.1 * (np.arange(120) < 63) + 0.1 * rng.standard_normal(120)
    assert change_rows(np.arange(12) < 6, left, column, 10) == [63]


@pytest.mark.slow
def test_a_parcel_dropped_in_flight_is_a_payload_for_so_long():
    analysis = analyse(with_parcel(recorded(1, 2, 3)))
    (found,) = [f for f in analysis.findings if f.status == "established"]
    assert found.id == "payload" and not analysis.values
    mass = found.parameters[0]
    assert mass.low < PARCEL_KG < mass.high and abs(mass.value - PARCEL_KG) < 0.003
    windows = {run: (start, stop) for run, start, stop in found.windows}
    assert set(windows) == {"run00", "run01"} and analysis.split.held_out == ("run01",)
    assert windows["run01"][1] == pytest.approx(DROPPED_S, abs=0.1)
    assert windows["run00"] == pytest.approx(CARRIED["run00"], abs=0.1)
    assert "run01" in found.sentence and "12.0 s" in found.sentence
    assert delivered(analysis, "vehicle") == []  # it is no property of the vehicle
    assert [f.id for f in delivered(analysis, "conditions")] == ["payload"]
    assert analysis.p_values["force_z"][1] > 0.01
