"""Sessions of stands and benches: schedules, what a step would hold, and what a session settles."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rotorid.effects.catalogue import catalogue
from rotorid.plan import session
from rotorid.plan.candidates import SessionLimits
from rotorid.plan.plan import Plan
from rotorid.plan.questions import Hypothesis, Question
from rotorid.plan.separation import asked_terms
from rotorid.plan.session import (
    REST_S,
    courses,
    known_instrument,
    of_step,
    options,
    plan_session,
    table_of,
    through,
)
from rotorid.plan.write import STEPS
from rotorid.recordings import RecordingSet, Run, Vehicle

RATE_HZ = 20.0
CREEP = 0.02
"""Share of the load by which the reading of the bench below goes on growing."""
TIME_S = 8.0
LIMITS = SessionLimits()


@pytest.mark.parametrize("name", courses(LIMITS))
def test_a_course_starts_and_ends_unloaded_and_reaches_the_largest_load(name: str) -> None:
    _, seconds, course = courses(LIMITS)[name]
    load = course(np.arange(0, seconds + 2 * REST_S, 0.01))
    assert abs(load[0]) < 1e-9 and abs(load[-1]) < 0.02
    assert load.max() == pytest.approx(1.0, abs=1e-6) and load.min() > -1e-9


def test_levels_are_held_for_equal_times() -> None:
    t = np.arange(0, 16 + 1e-9, 0.01)
    load = through(t, [0.5, 1.0, 0.25])
    middles = REST_S + (t[-1] - 2 * REST_S) * (np.arange(3) + 0.5) / 3
    assert np.interp(middles, t, load) == pytest.approx([0.5, 1.0, 0.25], abs=1e-6)


def test_steps_by_hand_are_of_ids_that_exist_and_said_once() -> None:
    assert set(STEPS) <= set(catalogue())
    left = ((("unequal_rotors", "com_offset", "unequal_rotors"), "why"), (("vortex_ring",), "why"))
    plan = Plan("chosen", (), None, None, (), (), "set", LIMITS, unanswerable=left)
    assert sum(line.startswith("By hand: ") for line in session.text(plan)) == 2


def crept(load: np.ndarray) -> np.ndarray:
    """A load (n,) and its creep of one time constant."""
    out = np.zeros(len(load))
    for i in range(1, len(load)):
        out[i] = out[i - 1] + (CREEP * load[i] - out[i - 1]) / (TIME_S * RATE_HZ)
    return load + out


@pytest.fixture(scope="module")
def known():
    """A bench with creep, loaded along z."""
    rng = np.random.default_rng(5)
    t = np.arange(0, 40, 1 / RATE_HZ)
    runs = []
    for i, levels in enumerate(([0.4, 0.8, 1.0, 0.5], [1.0, 0.2, 0.6], [0.7, 1.0, 0.3, 0.9])):
        load = -8.0 * through(t, levels)
        read = crept(load) + 0.004 * rng.standard_normal(len(t))
        table = {"time_s": t, "reference_force_z_n": load, "force_z_n": read}
        runs.append(Run(f"run{i}", pd.DataFrame(table)))
    vehicle = Vehicle.model_validate({"name": "bench", "kind": "bench", "tared": True})
    return known_instrument(RecordingSet("bench", vehicle, tuple(runs), None))


def test_what_the_engine_finds_is_found_again(known) -> None:
    assert [known.model.search.terms[k].effect for k in known.model.selection.active] == ["creep"]


def test_a_longer_hold_tells_more_of_creep_than_quick_steps(known) -> None:
    steps = {s.name: s for s in options(known, LIMITS)}
    (key,) = known.model.selection.active
    terms = asked_terms(known)
    at = known.regression.columns([key])

    def told(name: str) -> float:
        step = steps[name]
        return float(np.trace(of_step(known, step, terms).gram[np.ix_(at, at)])) / step.duration_s

    assert told("held along z") > 2.0 * told("quick steps along z")


def test_a_step_of_a_bench_has_the_largest_load_of_the_set(known) -> None:
    table = table_of(known, options(known, LIMITS)[0])
    assert table["reference_force_z_n"].min() == pytest.approx(-8.0, rel=1e-3)
    assert (table["reference_force_x_n"] == 0).all()


def test_a_session_settles_an_open_question_and_is_written(known, tmp_path: Path) -> None:
    # The question a shorter set would leave open: creep, or a curve of the reading.
    search = known.model.search
    (own,) = known.model.selection.active
    curve = next(t.key for t in search.terms.values() if t.effect == "load_nonlinearity")
    fit = search.regression.fit([*search.always, own])
    where = fit.places(search.regression.columns([own]))
    creep = Hypothesis("creep", (own,), 0.005 * fit.beta[where], fit.covariance[np.ix_(where, where)])
    bent = Hypothesis("load_nonlinearity", (), np.zeros(0), np.zeros((0, 0)))
    rivals = {"creep": ((own,),), "load_nonlinearity": ((curve,),)}
    question = Question(("creep", "load_nonlinearity"), (creep, bent), tuple(search.always), rivals)
    asking = type(known)(known.recordings, known.model, known.chain, (question,), ())
    plan = plan_session(asking, LIMITS)
    ((_, (found,)),) = plan.questions
    assert found.sigma > found.so_far > 0
    assert plan.duration_s <= LIMITS.duration_s
    files = session.write(plan, tmp_path / "plan")
    assert [f.name for f in files] == ["plan.json", "session.csv", "plan.png"]
    table = pd.read_csv(tmp_path / "plan" / "session.csv")
    assert table["run"].nunique() == len(plan.pieces)
    assert not [n for n in table.columns if n.startswith(("force", "moment"))]
    assert {other.name for other in (plan, *plan.others)} == {"chosen", "second", "standard"}
    assert all(plan.reached(6.0) >= other.reached(6.0) - 0.01 for other in plan.others)
    said = session.text(plan)
    # Of sessions that reach as much the shortest is the plan: here the standard one reaches more.
    stated = any(line.startswith("The standard session (slow steps along z") for line in said)
    assert stated == (plan.name != "standard")
    written = json.loads((tmp_path / "plan" / "plan.json").read_text())["others"]
    assert [o["name"] for o in written] == [o.name for o in plan.others] and all(o["steps"] for o in written)
    assert said[0].startswith(f"Record {len(plan.pieces)} runs") and any(line.startswith("By hand") for line in said)
