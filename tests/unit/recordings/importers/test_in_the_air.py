"""One detector of flight for every importer, on tables whose time in the air is known and on public logs."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rotorid.cli.modelling import fly
from rotorid.recordings import columns as c
from rotorid.recordings import read_set, templates
from rotorid.recordings.importers.faults import airborne, flights
from rotorid.recordings.importers.logfile import read_log
from tests.command_line import answer
from tests.public_logs import public

SPEEDS = list(c.rotor_columns("rotor_speed", 4))


def day(kinds: str, hover: float = 800.0, hz: float = 100.0) -> tuple[pd.DataFrame, np.ndarray]:
    """Stretches of three seconds each, and where they are in the air.

    `r` rest, `i` idle at 40 % of the speed of hover, `s` spun up to 70 % and rocking on the ground, `h` hover, `f` a
    fall at idle, `g` a descent that glides at 80 % of the speed while it turns.
    """
    n = int(3 * hz)
    share = {"r": 0.0, "i": 0.4, "s": 0.7, "h": 1.0, "f": 0.3, "g": 0.8}
    pull = {"r": 9.81, "i": 9.81, "s": 9.81, "h": 9.81, "f": 1.5, "g": 9.81}
    turns = {"r": 0.0, "i": 0.0, "s": 0.3, "h": 0.1, "f": 0.2, "g": 3.0}
    rng = np.random.default_rng(1)
    rows = np.repeat(list(kinds), n)
    noise = rng.standard_normal((len(rows), 4))
    speed = np.array([share[k] for k in rows])[:, None] * hover * (1 + 0.02 * noise)
    table = {c.TIME: np.arange(len(rows)) / hz}
    table |= dict(zip(SPEEDS, speed.T, strict=True))
    force = np.array([pull[k] for k in rows]) + 0.3 * noise[:, 0]
    table |= dict(zip(c.SPECIFIC_FORCE, (0.1 * noise[:, 1], 0.1 * noise[:, 2], -force), strict=True))
    swing = np.sin(2 * np.pi * np.arange(len(rows)) / hz)
    rate = np.array([turns[k] for k in rows]) * swing
    table |= {c.ANGULAR_VELOCITY[0]: rate, c.ANGULAR_VELOCITY[1]: 0 * rate, c.ANGULAR_VELOCITY[2]: 0 * rate}
    return pd.DataFrame(table), np.isin(rows, ["h", "f", "g"])


@pytest.mark.parametrize("kinds", ["hhhh", "rihhhir", "ishhfhhsi", "hhghhi", "rrrrrriiiihhsihhhrr"])
@pytest.mark.parametrize("kind", ["rotor_speed", "rotor_command", "throttle"])
def test_what_is_in_the_air_is_found_within_half_a_second_an_edge(kinds: str, kind: str) -> None:
    table, true = day(kinds, 0.4 if kind == "throttle" else 800.0)
    table = table.rename(columns=dict(zip(SPEEDS, c.rotor_columns(kind, 4), strict=True)))
    found, faults = airborne(table)
    edges = int(np.abs(np.diff(true.astype(int))).sum())
    assert (found != true).sum() <= 50 * edges and not faults
    assert (found == true).all() or edges


def test_a_range_finder_decides_what_thrust_does_not() -> None:
    table, _ = day("hhsshh")
    assert not airborne(table)[0][700:1100].any() and airborne(table.assign(**{c.HEIGHT: 2.0}))[0].all()
    down = np.where(np.arange(len(table)) < 600, 0.02, 2.0)
    assert not airborne(table.assign(**{c.HEIGHT: down}))[0][:500].any()


def test_what_the_log_calls_flight_is_only_narrowed() -> None:
    table, _ = day("hhsshh")
    stated = np.arange(len(table)) > 100
    found, (fault,) = airborne(table, stated)
    assert fault.kind == "on_ground" and "6 s of 17 s that the log calls flight" in fault.found
    assert not found[:100].any()
    without = table.drop(columns=list(c.SPECIFIC_FORCE))
    assert (airborne(without, stated)[0] == stated).all()


def test_the_ground_of_a_csv_is_cut_as_help_says(tmp_path: Path) -> None:
    day("rihhhir")[0].to_csv(tmp_path / "flight.csv", index=False)
    assert "in the air from" in answer("import", tmp_path / "flight.csv", "--like", "thesis", "-o", tmp_path / "set")
    (run,) = read_set(tmp_path / "set").runs
    assert run.time_s[-1] == pytest.approx(9 - 1.5, abs=0.5)
    assert run.array(tuple(SPEEDS)).min() > 0.85 * 800 * 0.9
    assert "Only the part in the air is kept" in answer("import", "--help")


@pytest.mark.parametrize("template", templates.names())
def test_a_csv_that_is_in_the_air_throughout_keeps_every_row(tmp_path: Path, template: str) -> None:
    """Hard flights: their thrust goes to a third of the weight and to three times it."""
    run = read_set(fly(templates.read(template), tmp_path / "flights", 12.0, 1, 5)).runs[0]
    run.table.to_csv(tmp_path / "own.csv", index=False)
    found = read_log(tmp_path / "own.csv")
    assert len(found.runs["own"]) == len(run.table) and not found.faults


@pytest.mark.parametrize(
    ("log", "needs", "flights"),
    [
        ("logs/ardupilot/copter-3.4_22.BIN", "rotorid", [20.2, 53.9, 15.7]),
        ("logs/ardupilot/copter-3.3-dev_31.BIN", "rotorid", [132.8, 63.1, 31.6, 10.5, 83.2, 22.0]),
        ("logs/betaflight/shortLog.BFL", "rotorid", [14.9]),
        ("px4-ulog/sample_px4_events.ulg", "pyulog", [6.6]),
        ("crazyflie-arpl/log10", "rotorid", [35.1]),
        ("crazyflie-arpl/log15", "rotorid", [40.4]),
        ("imrc-crazyflie-rpm/brushed_flights/jana01", "rotorid", [51.4]),
        ("crazypad/normal_flight/E9_log00", "rotorid", [5.8, 7.3]),
    ],
)
def test_public_logs(log: str, needs: str, flights: list[float]) -> None:
    """Lengths, s: of Copter 3.4, Betaflight, log10 and PX4 looked at second by second, of the others what it gave."""
    pytest.importorskip(needs)
    found = read_log(public(log))
    lasts = [float(t[c.TIME].iloc[-1]) for t in found.runs.values()]
    assert lasts == pytest.approx(flights, abs=0.5)


def test_readings_that_no_vehicle_has_are_empty_cells() -> None:
    """One damaged cell is no reason to refuse a log."""
    wild = np.where(np.arange(1000) == 500, np.inf, 0.1)
    table = pd.DataFrame({c.TIME: np.arange(1000) / 100, c.ANGULAR_VELOCITY[0]: wild, "velocity_x_m_s": 1.0})
    runs, faults = flights(table, np.ones(1000, bool), "run", "log")
    assert runs["run"][c.ANGULAR_VELOCITY[0]].isna().sum() == 1 and runs["run"]["velocity_x_m_s"].notna().all()
    assert [(f.kind, f.column, f.samples) for f in faults if f.kind == "wild"] == [("wild", c.ANGULAR_VELOCITY[0], 1)]
