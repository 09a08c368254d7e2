"""One number chooses what is delivered: the plainest within one standard error of the best that flies."""

import numpy as np
import pytest

from rotorid.mismatch.deliver.candidates import Candidate, Ground, choose, compared
from rotorid.mismatch.deliver.derivatives import Learnt

RUNS, PER_RUN = 6, 200
UNIT = np.repeat(np.arange(RUNS), PER_RUN)
GROUND = Ground(UNIT, {"a": (np.arange(len(UNIT)) / 50.0, UNIT)})


def candidate(model: str, size: float, derivatives: bool = False, seed: int = 0) -> Candidate:
    """A candidate that leaves noise of a size in all six channels."""
    left = size * np.random.default_rng(seed).normal(size=(len(UNIT), 6))
    learnt = Learnt((), np.zeros_like(left)) if derivatives else None
    return Candidate(model, {}, (), None, {}, left, learnt)


def chosen(*candidates: Candidate, unfit: tuple[str, ...] = ()) -> tuple[str, bool]:
    """Name of what is chosen; vehicles of the models `unfit` do not fly."""
    return choose(candidates, GROUND, lambda c: "it turns over" if c.model in unfit else "")[0].candidate.name


def test_the_best_is_taken_where_nothing_plainer_comes_near():
    assert chosen(candidate("believed", 1.0), candidate("refitted", 0.7), candidate("named", 0.3)) == ("named", False)
    every = [candidate("believed", 1.0), candidate("named", 0.5), candidate("named", 0.3, derivatives=True)]
    assert chosen(*every) == ("named", True)


def test_the_plainer_is_taken_within_one_standard_error():
    better = candidate("refitted", 0.9995, seed=1)
    assert chosen(candidate("believed", 1.0), better) == ("believed", False)


def test_named_physics_is_plainer_than_derivatives_in_its_place():
    alike = [candidate("named", 0.3, True), candidate("refitted", 0.2999, True, seed=1)]
    assert chosen(candidate("believed", 1.0), *alike) == ("named", True)


def test_no_channel_has_a_veto():
    named = candidate("named", 0.3)
    named.left[:, 4] *= 4.0  # worse by a fifth in one channel, three times better in five
    assert chosen(candidate("believed", 1.0), named) == ("named", False)


def test_what_does_not_fly_is_not_taken_and_the_score_says_so():
    every = [candidate("believed", 1.0), candidate("refitted", 0.6), candidate("named", 0.3)]
    taken, scored = choose(every, GROUND, lambda c: "it turns over" if c.model == "named" else "")
    assert taken.candidate.name == ("refitted", False)
    assert [s.unfit for s in scored] == ["", "", "it turns over"]
    assert chosen(*every, unfit=("named", "refitted")) == ("believed", False)


def test_a_score_is_the_mean_logarithm_over_the_believed_error():
    believed, named = compared([candidate("named", 0.5), candidate("believed", 1.0)], GROUND)
    assert (believed.score, named.score) == pytest.approx((0.0, np.log(0.5)))


def test_windows_that_were_flown_count_like_channels():
    near, far = candidate("refitted", 0.5), candidate("named", 0.5)
    flown = np.ones((1, 2, RUNS))
    near, far = (
        Candidate(c.model, {}, (), None, {}, c.left, None, flown * s)
        for c, s in ((near, [[1], [1]]), (far, [[9], [1]]))
    )
    believed = Candidate("believed", {}, (), None, {}, candidate("believed", 1.0).left, None, flown)
    scores = {s.candidate.model: s.score for s in compared([believed, near, far], GROUND)}
    assert scores["named"] - scores["refitted"] == pytest.approx(np.log(3.0) / 7)
