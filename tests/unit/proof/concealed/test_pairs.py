"""Drawn pairs of sets: the same name draws the same pair, and what changed is what its answer says."""

from collections.abc import Iterator

import numpy as np
import pytest

from rotorid_proof.concealed import pairs
from rotorid_proof.concealed.continuous import craft
from rotorid_proof.concealed.continuous.equations import Strayed

CHANGED, UNCHANGED = "continuous/test/004", "continuous/test/011"


@pytest.fixture(scope="module", autouse=True)
def short_runs() -> Iterator[None]:
    """What is asked here hangs on no length of a run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pairs, "RUN_S", 8.0)
        yield


@pytest.fixture(scope="module")
def made(short_runs: None) -> dict[str, pairs.Pair]:
    return {name: pairs.make(name) for name in (CHANGED, UNCHANGED)}


def test_a_pair_is_one_vehicle_flown_twice(made: dict[str, pairs.Pair]) -> None:
    for pair in made.values():
        assert pair.base.vehicle == pair.new.vehicle
        first, second = (own.runs["run01"] for own in (pair.base, pair.new))
        assert list(first.columns) == list(second.columns)
        assert not np.array_equal(first.iloc[:50, 1], second.iloc[:50, 1])


def test_the_answer_names_what_changed_alone(made: dict[str, pairs.Pair]) -> None:
    assert made[UNCHANGED].truth["changes"] == []
    ids = {change["id"] for change in made[CHANGED].truth["changes"]}
    assert ids == {"frame_drag", "accelerometer_error"}


def test_one_name_draws_one_pair(made: dict[str, pairs.Pair]) -> None:
    again = pairs.make(UNCHANGED)
    assert again.truth == made[UNCHANGED].truth
    assert again.new.runs["run01"].equals(made[UNCHANGED].new.runs["run01"])


def test_a_value_changes_by_four_to_fifteen_per_cent_and_no_body_becomes_impossible() -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        changed, name, factor = pairs.other_value(craft.drawn(rng), rng)
        assert name in pairs.VALUES and 0.04 <= abs(factor - 1) <= 0.15
        a, b, c = np.linalg.eigvalsh(changed.inertia)
        assert a + b > c


def test_of_an_effect_that_both_sets_have_the_answer_holds_the_difference() -> None:
    def drag(value: float) -> dict:
        return {"id": "rotor_drag", "parameters": [{"symbol": "k_d", "value": value, "unit": "1"}]}

    (found,) = pairs.beyond([drag(2.0)], [drag(2.0), drag(5.0)])
    assert found["parameters"][0]["value"] == 3.0


def test_a_vehicle_that_no_controller_holds_is_drawn_anew(monkeypatch):
    tried = []

    def maker(seed: int):
        tried.append(seed)
        if len(tried) < 3:
            raise Strayed("not held")
        return seed

    monkeypatch.setitem(pairs.MAKERS, "continuous", maker)
    assert pairs.make("continuous/01234567/000") == tried[-1]
    assert len(set(tried)) == 3


def test_a_vehicle_over_its_flights_changes_once_after_the_good_ones_and_its_file_does_not() -> None:
    own = pairs.flown("test/001", 4, 3)
    assert own.since == 3 and own.truth["changes"]
    assert all(flight.vehicle == own.flights[0].vehicle for flight in own.flights)
    assert pairs.flown("test/000", 1, 1).since is None
