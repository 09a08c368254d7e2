"""What changed on a stand or a bench since its last calibration."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.signal import bessel, sosfilt

from rotorid.errors import InputError
from rotorid.mismatch.changes.compare import Changes, changes_between
from rotorid.mismatch.changes.of_instruments import Wander, between, wandering
from rotorid.mismatch.changes.words import as_json, sentences
from rotorid.mismatch.evidence.gram import Evidence
from rotorid.recordings import RecordingSet, write_set
from rotorid.report.page import make_changes_page
from tests.command_line import invoke
from tests.refusals import refused
from tests.unit.mismatch.instrument.stands import C_F, one_rotor
from tests.unit.mismatch.instrument.test_instrument import RATE_HZ, bench_set, crosstalk
from tests.unit.mismatch.instrument.test_stand import steady_run

TARES_N = (0.05, -0.04, 0.02)


def sluggish(load: np.ndarray) -> np.ndarray:
    """A low-pass of the fourth order; the catalogue has one of the second, and a delay."""
    return sosfilt(bessel(4, 2.0, fs=RATE_HZ, output="sos", norm="mag"), load, axis=0)


def tared(recordings: RecordingSet, offsets_n) -> RecordingSet:
    """The set with a zero along x of its own in each run."""
    runs = []
    for run, offset in zip(recordings.runs, offsets_n, strict=True):
        table = run.table.copy()
        table["force_x_n"] += offset
        runs.append(replace(run, table=table))
    return replace(recordings, runs=tuple(runs))


@cache
def compared(case: str) -> Changes:
    """A bench after its calibration against the same a year later."""
    base = replace(bench_set(runs=3, seed=3), name="calibrated")
    change = {"crosstalk": crosstalk, "gain": lambda load: 1.03 * load, "sluggish": sluggish}.get(
        case, lambda load: load
    )
    new = replace(bench_set(change, runs=3, seed=4), name="today")
    if case == "another zero in each run":
        base, new = tared(base, TARES_N), tared(new, TARES_N[::-1])
    elif case == "another zero":
        new = tared(new, (0.05,) * 3)
    return changes_between(base, new)


def sure(found: Changes) -> list[set[str]]:
    """What surely changed, each with its class."""
    return [{c.id, *c.alternatives} for c in found.changes if c.status in ("established", "ambiguous")]


def test_on_two_days_of_one_bench_nothing_changed_and_limits_say_by_how_much_at_most():
    found = compared("same")
    assert sure(found) == [] and found.kind == "bench"
    assert 0.0 < {x.id: x.at_most for x in found.limits}["reading_gain"] < 0.02
    said = sentences(found)
    assert said[0].startswith("Nothing changed from calibrated to today") and "of the largest load" in said[-1]
    assert not any("alibrate it" in s for s in said)


def test_crosstalk_since_the_calibration_is_named_with_its_number_and_asks_for_another_one():
    found = compared("crosstalk")
    (ids,) = sure(found)
    assert "crosstalk" in ids
    numbers = {p.symbol: p for c in found.changes for p in c.parameters}
    assert numbers["C_Fx,Fz"].low < 0.02 < numbers["C_Fx,Fz"].high
    assert any(s.startswith("Calibrate it again") for s in sentences(found))
    assert "share_of_largest_load" in as_json(found)["unchanged"][0]


def test_a_gain_that_changed_is_stated_in_percent():
    found = compared("gain")
    assert sure(found) == [{"reading_gain"}]
    (size,) = found.changes[0].parameters
    assert size.low < 0.03 < size.high and "+3" in sentences(found)[0]


def test_a_filter_that_no_form_of_the_catalogue_is_is_one_change_and_not_several():
    (ids,) = sure(compared("sluggish"))
    assert ids & {"amplifier_filter", "delay"}


def test_a_zero_of_its_own_in_each_run_is_no_change_but_one_that_none_of_the_good_runs_had_is():
    assert sure(compared("another zero in each run")) == []
    assert sure(compared("another zero")) == [{"tare_offset"}]
    assert any(s.startswith("Zero it again") for s in sentences(compared("another zero")))


def test_of_a_stand_of_one_rotor_more_thrust_may_be_a_gain_of_its_reading():
    def stand(name: str, first: int, factor: float) -> RecordingSet:
        runs = []
        for k in range(3):
            run = steady_run(f"run{k}", 15.0 + 0.3 * k, first + k)
            runs.append(replace(run, table=run.table.assign(force_z_n=factor * run.table["force_z_n"])))
        return replace(one_rotor(runs), name=name)

    same = changes_between(stand("good", 1, 1.0), stand("same", 11, 1.0))
    assert sure(same) == []
    found = changes_between(stand("good", 1, 1.0), stand("stronger", 21, 1.1))
    (ids,) = sure(found)
    assert ids <= {"thrust_coefficient_n_s2", "reading_gain"}
    (size,) = found.changes[0].parameters
    assert size.low < 0.1 < size.high and C_F > 0


def test_sets_that_cannot_be_compared_are_refused_with_the_reason():
    base = replace(bench_set(runs=3, seed=3), name="calibrated")
    slower = replace(base, name="slow", runs=tuple(replace(r, table=r.table.iloc[::3]) for r in base.runs))
    refused("slow: recorded at", changes_between, base, slower)
    fewer = [replace(r, table=r.table.drop(columns=["force_y_n"])) for r in base.runs]
    with pytest.raises(InputError, match="force_y_n is not in every run, expected as in calibrated"):
        changes_between(base, replace(base, name="fewer", runs=tuple(fewer)))
    stand = one_rotor([steady_run("a", 16.0, 1)])
    refused("kind is stand, expected bench as in calibrated", changes_between, base, stand)


def test_a_zero_of_each_environment_is_integrated_out_as_more_noise_of_its_column():
    """The products are those of rows whose noise has the zero's variance in common."""
    rng = np.random.default_rng(0)
    x, y, sd = np.column_stack([np.ones(30), rng.standard_normal((30, 2))]), rng.standard_normal(30), 0.7
    inverse = np.linalg.inv(np.eye(30) + sd**2 * np.ones((30, 30)))
    none = np.zeros(0)
    gram, cross = (x.T @ x)[None, None], (x.T @ y)[None, None]
    evidence = Evidence((), {}, np.array([0]), gram, cross, np.array([[y @ y]]), np.ones(1), none, none, none, none)
    found = wandering(evidence, Wander((([0],),), (np.array([sd**2]),)))
    assert found.gram[0, 0] == pytest.approx(x.T @ inverse @ x)
    assert found.cross[0, 0] == pytest.approx(x.T @ inverse @ y)
    assert found.square[0, 0] == pytest.approx(y @ inverse @ y)


def test_the_variance_between_runs_is_beyond_what_each_run_says_of_itself():
    own, alike = np.random.default_rng(1).normal(0.0, 0.5, (400, 1)), np.full((400, 1), 1.0 / 0.1**2)
    assert between(own, alike)[0] == pytest.approx(own.var() - 0.01, rel=0.02)
    assert between(0.2 * own, alike)[0] < 0.002 and between(own[:1], alike[:1]) == [0.0]


def test_the_command_and_its_page(tmp_path):
    sets = {"calibrated": bench_set(runs=3, seed=3), "today": bench_set(crosstalk, runs=3, seed=4)}
    folders = [str(write_set(replace(s, name=name), tmp_path)) for name, s in sets.items()]
    run = invoke("compare", *folders, "--ci", "-q")
    assert run.exit_code == 1 and "crosstalk" in run.output.lower() and "Calibrate it again" in run.output
    page = make_changes_page(compared("crosstalk"))
    assert "of the largest load" in page and "Reading less load" in page and page.count("<svg") == 2
