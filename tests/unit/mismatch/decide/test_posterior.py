"""The posterior on small made-up flights: against the plain normal distribution, and what it finds and states. Draws
of coefficients that limits are read from.
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from rotorid.mismatch.decide.posterior import Posterior, decide, log_prior, most_probable, ranked, scored
from rotorid.mismatch.decide.problem import Prior, Problem, problem_of
from rotorid.mismatch.decide.statements import drawn, limits_of, statements_of
from rotorid.mismatch.evidence.comparison import environments
from rotorid.mismatch.evidence.gram import Evidence, EvidenceTerm, LinearParameter, spectrum_of

BLOCKS, ROWS = 90, 8
OFFSET = EvidenceTerm("offset", "nuisance", "", 1, (0.5,))
PLAIN = Prior()


def effect(key, low=-np.inf, high=np.inf, negligible=0.0, **more):
    """A form of one linear parameter."""
    parameter = LinearParameter("k", "N s/m", low, high, negligible)
    return EvidenceTerm(key, "effect", key.split("/")[0], 1, (np.inf,), linear=(parameter,), **more)


@dataclass(frozen=True)
class Flight:
    """Rows of a made-up flight."""

    x: np.ndarray
    """(BLOCKS, ROWS, K) whitened columns."""
    y: np.ndarray
    """(BLOCKS, ROWS) whitened residual."""
    terms: tuple[EvidenceTerm, ...]

    def evidence(self, active=()):
        """Its Gram matrices."""
        count = self.x.shape[2]
        environment = environments(np.repeat([0, 1], BLOCKS // 2), 1.0)
        kinds = range(int(environment.max()) + 1)
        x, y = ([rows[environment == e].reshape(-1, *rows.shape[2:]) for e in kinds] for rows in (self.x, self.y))
        return Evidence(
            terms=self.terms, start={t.key: i for i, t in enumerate(self.terms)}, channels=np.array([2]),
            gram=np.array([[own.T @ own for own in x]]),
            cross=np.array([[own.T @ left for own, left in zip(x, y, strict=True)]]),
            square=np.array([[left @ left for left in y]]), blocks=np.bincount(environment),
            bias_gram=np.zeros((1, count, count)), bias_cross=np.zeros((1, count)), apart_columns=np.zeros(0, int),
            apart_channels=np.zeros(0, int), active=tuple(active),
        )  # fmt: skip


def flight(beta, terms=None, seed=0, alike=0.3, noise=1.0):
    """A flight whose residual is `beta` times its columns and white noise; columns are a little alike."""
    rng = np.random.default_rng(seed)
    if terms is None:
        terms = (EvidenceTerm("mass", "value", "", 1, (0.05,)), OFFSET, effect("drag/plain"), effect("lift/plain"))
        terms = (*terms, effect("tilt/plain"))
    x = rng.normal(size=(BLOCKS, ROWS, len(terms))) + alike * rng.normal(size=(BLOCKS, ROWS, 1))
    y = x @ np.asarray(beta, float) + noise * rng.normal(size=(BLOCKS, ROWS))
    return Flight(x, y, tuple(terms))


def asked_of(evidence: Evidence, variance=0.0, prior=PLAIN) -> Problem:
    """The problem that an evidence poses, with a leftover of a given variance."""
    return problem_of(evidence, spectrum_of(evidence), np.full(len(evidence.channels), variance), prior)


def problem(of: Flight, variance=0.0, prior=PLAIN) -> Problem:
    """The problem that a flight poses, with a leftover of a given variance."""
    return asked_of(of.evidence(), variance, prior)


def log_normal(of: Flight, asked: Problem, model):
    """Log density of all rows where the model's coefficients, and the leftover's of each environment, are normal."""
    columns = asked.columns(model)
    x = of.x.reshape(-1, of.x.shape[2]) * asked.unit
    covariance = np.eye(len(x)) + (x[:, columns] * asked.believed(model)[0][columns] ** 2) @ x[:, columns].T
    environment = np.repeat(environments(np.repeat([0, 1], BLOCKS // 2), 1.0), ROWS)
    for e in np.unique(environment):
        own = np.where(environment == e, 1.0, 0.0)[:, None] * x
        covariance += asked.variance[0] * own @ own.T
    return multivariate_normal.logpdf(of.y.ravel(), np.zeros(len(x)), covariance)


@pytest.mark.parametrize("variance", [0.0, 3.0, 50.0])
def test_log_odds_are_those_of_the_normal_distribution(variance):
    of = flight([0.02, 0.1, 0.3, 0.0, 0.1])
    asked = problem(of, variance)
    a, b = ("drag/plain",), ("drag/plain", "tilt/plain")
    ours = Posterior(asked)(b) - Posterior(asked)(a) - log_prior(asked, b) + log_prior(asked, a)
    assert ours == pytest.approx(log_normal(of, asked, b) - log_normal(of, asked, a), abs=1e-6)


def test_a_leftover_that_is_new_in_each_environment_is_no_evidence_of_an_effect():
    of = flight([0.0, 0.0, 0.0, 0.0, 0.0])
    wave = np.repeat([-0.8, 1.2], 5)[np.arange(BLOCKS) % 10, None]
    bent = replace(of, y=of.y + 2.0 * wave * of.x[:, :, 2])
    white, left = (spectrum_of(f.evidence()).variance_of_leftover(np.zeros(5))[0] for f in (of, bent))
    assert white < 0.1 * left
    assert decide(bent.evidence(), Prior()).model == ()
    assert most_probable(problem(bent), [()]).model  # taken for white noise it would be one


def test_noise_that_cancels_between_columns_cancels_beside_a_leftover_too():
    """Columns of one sensor have its noise in common; what does not cancel would be taken for what they have in sum."""
    seen = flight([0.0, 0.0, 0.5, 0.0, 0.0]).evidence()
    both = np.concatenate([seen.gram, 0.01 * seen.gram]), np.concatenate([seen.cross, 0.1 * seen.cross])
    noise = np.zeros((2, 5, 5))
    noise[0, 2:4, 2:4] = 40.0 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    two = replace(
        seen, channels=np.array([2, 3]), gram=both[0], cross=both[1],
        square=np.concatenate([seen.square, seen.square]), bias_gram=noise, bias_cross=np.zeros((2, 5)),
    )  # fmt: skip
    asked = asked_of(two, 30.0)
    own_units = asked.bias / np.maximum(np.outer(asked.unit, asked.unit), 1e-300)
    assert own_units[2, 2] > 0
    assert own_units[2:4, 2:4].sum() == pytest.approx(0.0, abs=1e-9 * own_units[2, 2])


def test_a_value_that_is_plainly_wrong_is_freed_before_an_effect_stands_in():
    terms = (EvidenceTerm("thrust", "value", "", 1, (0.05,)), OFFSET, effect("drag/plain"), effect("lift/plain"))
    assert decide(flight([0.5, 0.0, 0.0, 0.0], terms).evidence(), Prior()).model == ("thrust",)


def test_of_a_ratio_one_side_stays_as_believed_and_its_doubt_is_the_others():
    terms = (EvidenceTerm("mass", "value", "", 1, (0.05,)), EvidenceTerm("thrust", "value", "", 1, (0.1,)))
    asked = problem(flight([0.0, 0.0, 0.5], (*terms, effect("drag/plain"))))
    sd = asked.prior_sd * asked.unit
    assert sd[0] < 1e-3 and sd[1] == pytest.approx(np.hypot(0.05, 0.1))
    assert set(asked.freed) == {"thrust"}


def test_what_is_at_work_is_found_and_nothing_else():
    found = decide(flight([0.01, 0.0, 0.8, 0.0, -0.6]).evidence(), Prior())
    assert found.model == ("drag/plain", "tilt/plain")
    assert decide(flight([0.01, 0.0, 0.0, 0.0, 0.0]).evidence(), Prior()).model == ()


def test_models_ranked_together_are_ranked_as_each_alone():
    """Some beyond their bounds, some with a believed value freed, of different sizes."""
    terms = (EvidenceTerm("mass", "value", "", 1, (0.05,)), OFFSET, effect("drag/plain", low=0.0, high=0.1))
    terms = (*terms, effect("drag/free"), effect("lift/plain", high=0.0), effect("tilt/plain"))
    asked = problem(flight([0.3, 0.1, 0.4, 0.0, 0.3, -0.2], terms))
    keys = ["drag/plain", "drag/free", "lift/plain", "tilt/plain", *asked.freed]
    models = [tuple(sorted(m)) for n in range(4) for m in combinations(keys, n)]
    alone = np.concatenate([ranked(asked, [m]) for m in models])
    assert len(models) > 20 and np.array_equal(ranked(asked, models), alone) and np.isfinite(alone).all()
    best = max(models, key=lambda m: scored(asked, m).log_posterior)
    assert alone[models.index(best)] > np.max(alone) - 1.0


def test_a_start_is_left_where_it_is_wrong():
    asked = problem(flight([0.0, 0.0, 0.8, 0.0, 0.0]))
    assert most_probable(asked, [("lift/plain", "tilt/plain")]).model == ("drag/plain",)


def test_of_the_forms_of_an_id_one_is_taken():
    terms = (OFFSET, effect("drag/plain"), effect("drag/square"), effect("lift/plain"))
    found = decide(flight([0.0, 0.0, 0.9, 0.0], terms, alike=2.0).evidence(), Prior())
    assert found.model == ("drag/square",)


def test_a_coefficient_stays_within_its_bounds():
    terms = (OFFSET, effect("drag/plain", low=0.0), effect("lift/plain"))
    assert scored(problem(flight([0.0, -1.0, 0.5], terms)), ("drag/plain",)).mode.beta[-1] == 0.0


@pytest.mark.parametrize("term", [effect("drag/plain", negligible=2.0), effect("drag/plain", must_show=(0,))])
def test_a_form_that_is_negligible_or_does_not_show_costs_more(term):
    size = 0.5 if not term.must_show else 0.02
    of = flight([0.0, size], (OFFSET, term))
    free = problem(replace(of, terms=(OFFSET, effect("drag/plain"))))
    dear = scored(free, ("drag/plain",)).log_posterior - scored(problem(of), ("drag/plain",)).log_posterior
    assert dear == pytest.approx(PLAIN.small_nats)


def test_a_believed_value_does_not_move_further_than_its_trust_allows():
    asked = problem(flight([1.0, 0.0, 0.0, 0.0, 0.0]))
    beta = scored(asked, ()).mode.beta * asked.unit[asked.columns(())]
    assert beta[0] == pytest.approx(PLAIN.value_reach * 0.05)


def test_the_noise_of_a_regressor_does_not_shrink_its_coefficient():
    rng = np.random.default_rng(3)
    of = flight([0.0, 0.0, 1.0, 0.0, 0.0], noise=0.2)
    error = np.zeros_like(of.x)
    error[:, :, 2] = 0.5 * rng.normal(size=error.shape[:2])
    seen = replace(of, x=of.x + error).evidence()
    bias = np.zeros((5, 5))
    bias[2, 2] = (error**2).sum()

    def size(evidence):
        asked = asked_of(evidence)
        return scored(asked, ("drag/plain",)).mode.beta[-1] * asked.unit[2]

    assert size(seen) < 0.87
    assert size(replace(seen, bias_gram=bias[None])) == pytest.approx(1.0, abs=0.06)


def test_what_could_stand_in_an_ids_place_is_its_class():
    rng = np.random.default_rng(5)
    terms = (OFFSET, effect("drag/plain"), effect("lift/plain"), effect("tilt/plain"))
    of = flight([0.0, 0.9, 0.0, 0.0], terms)
    twin = of.x.copy()
    twin[:, :, 2] = twin[:, :, 1] + 1e-3 * rng.normal(size=twin.shape[:2])
    (said,) = statements_of(decide(replace(of, x=twin).evidence(), Prior()))
    assert said.status == "ambiguous" and said.alternatives == ("drag", "lift")
    (alone,) = statements_of(decide(of.evidence(), Prior()))
    assert alone.status == "established" and not alone.alternatives
    assert min(said.probability, alone.probability) > 0.99
    k = alone.parameters[0]
    assert k.low < 0.9 < k.high and k.value == pytest.approx(0.9, abs=0.15)


def squares_at_one(asked: Problem) -> dict[str, np.ndarray]:
    """What a coefficient of one amounts to in these flights: as much as itself."""
    return {key: np.eye(len(asked.columns_of[key])) for key in asked.effects}


def test_what_was_not_found_is_smaller_than_its_limit_in_nineteen_of_twenty_flights():
    """A lift that is too weak to be named: the limit holds it, and it shrinks where there is no lift at all."""
    held, most = [], []
    for seed in range(60):
        found = decide(flight([0.0, 0.0, 0.3, 0.03, 0.0], seed=seed).evidence(), Prior())
        limits = {x.id: x.at_most for x in limits_of(found, squares_at_one(found.problem))}
        assert "drag" not in limits
        if "lift" in limits:
            held.append(limits["lift"] >= 0.03)
            most.append(limits["lift"])
    assert len(held) >= 30 and np.mean(held) >= 0.9 and np.median(most) < 0.3


FREE = np.full(2, np.inf)


def test_draws_have_the_mean_and_the_covariance_asked_for():
    covariance = np.array([[4.0, -0.003], [-0.003, 1e-5]])
    found = drawn(np.array([1.0, 0.01]), covariance, -FREE, FREE)
    assert found.mean(axis=0) == pytest.approx([1.0, 0.01], abs=0.2)
    unit = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(np.cov(found.T) / np.outer(unit, unit), covariance / np.outer(unit, unit), atol=0.1)


def test_rounding_does_not_move_a_draw():
    """Eigenvectors of nearly equal variances turn anyhow by rounding; the draws do not."""
    covariance = np.array([[1.0, 1e-13], [1e-13, 1.0]])
    away = drawn(np.zeros(2), covariance, -FREE, FREE) - drawn(
        np.zeros(2), covariance.T * [[1, -1], [-1, 1]], -FREE, FREE
    )
    assert np.abs(away).max() < 1e-10


def test_draws_beyond_the_bounds_are_moved_to_them():
    found = drawn(np.zeros(2), np.eye(2), np.array([-0.5, -np.inf]), np.array([np.inf, 0.25]))
    assert found[:, 0].min() == -0.5 and found[:, 1].max() == 0.25
