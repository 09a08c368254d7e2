"""The posterior on small made-up flights: against the plain normal distribution, and what it finds and states."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from rotorid.mismatch.comparison import environments
from rotorid.mismatch.posterior.evidence import Evidence, EvidenceTerm, LinearParameter
from rotorid.mismatch.posterior.prior import Prior
from rotorid.mismatch.posterior.problem import Problem, problem_of
from rotorid.mismatch.posterior.score import Posterior, contributions, log_prior, power_of_leftover, scored
from rotorid.mismatch.posterior.search import decide, most_probable
from rotorid.mismatch.posterior.statements import statements_of

BLOCKS, ROWS = 36, 12
OFFSET = EvidenceTerm("offset", "nuisance", "", 1, (0.5,))
PLAIN = Prior(form_error=0.0)


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
        return Evidence(
            terms=self.terms,
            start={t.key: i for i, t in enumerate(self.terms)},
            gram=np.einsum("bni,bnj->bij", self.x, self.x),
            cross=np.einsum("bni,bn->bi", self.x, self.y),
            square=(self.y**2).sum(axis=1),
            run=np.repeat([0, 1], BLOCKS // 2),
            training=np.ones(BLOCKS, bool),
            precision=np.zeros(count),
            bias_gram=np.zeros((count, count)),
            bias_cross=np.zeros(count),
            limit=np.full(count, np.inf),
            block_s=1.0,
            apart=None,
            active=tuple(active),
            trail=(),
            not_established={},
            values={},
        )


def flight(beta, terms=None, seed=0, alike=0.3, noise=1.0):
    """A flight whose residual is `beta` times its columns and white noise; columns are a little alike."""
    rng = np.random.default_rng(seed)
    if terms is None:
        terms = (EvidenceTerm("mass", "value", "", 1, (0.05,)), OFFSET, effect("drag/plain"), effect("lift/plain"))
        terms = (*terms, effect("tilt/plain"))
    x = rng.normal(size=(BLOCKS, ROWS, len(terms))) + alike * rng.normal(size=(BLOCKS, ROWS, 1))
    y = x @ np.asarray(beta, float) + noise * rng.normal(size=(BLOCKS, ROWS))
    return Flight(x, y, tuple(terms))


def problem(of: Flight, prior=PLAIN, power=1.0) -> Problem:
    """The problem that a flight poses."""
    return problem_of(of.evidence(), power, prior)


def log_normal(of: Flight, asked: Problem, model, parts=None):
    """Log density of all rows where the model's coefficients, and the errors of its contributions, are normal."""
    columns = asked.columns(model)
    x = of.x.reshape(-1, of.x.shape[2]) * asked.unit
    covariance = asked.power * np.eye(len(x)) + (x[:, columns] * asked.prior_sd[columns] ** 2) @ x[:, columns].T
    if parts is not None:
        environment = np.repeat(environments(np.repeat([0, 1], BLOCKS // 2), 1.0), ROWS)
        for e in np.unique(environment):
            own = np.where(environment == e, 1.0, 0.0)[:, None] * (x @ parts)
            covariance += asked.prior.form_error**2 * own @ own.T
    return multivariate_normal.logpdf(of.y.ravel(), np.zeros(len(x)), covariance)


def test_log_odds_are_those_of_the_normal_distribution():
    of = flight([0.02, 0.1, 0.3, 0.0, 0.1])
    asked = problem(of, power=1.7)
    a, b = ("drag/plain",), ("drag/plain", "tilt/plain")
    ours = Posterior(asked)(b) - Posterior(asked)(a) - log_prior(asked, b) + log_prior(asked, a)
    assert ours == pytest.approx(log_normal(of, asked, b) - log_normal(of, asked, a), abs=1e-8)


def test_errors_of_the_forms_are_integrated_out():
    of = flight([0.0, 0.0, 3.0, 0.0, 2.0])
    asked = problem(of, Prior(form_error=0.1))
    values = {}
    for model in (("drag/plain",), ("drag/plain", "tilt/plain")):
        at = scored(asked, model)
        # The mode moves by next to nothing after two rounds: the parts are taken there.
        parts = contributions(asked, model, at.columns, at.mode.beta)
        values[model] = at.log_posterior - log_prior(asked, model), log_normal(of, asked, model, parts)
    (ours_a, theirs_a), (ours_b, theirs_b) = values.values()
    assert ours_b - ours_a == pytest.approx(theirs_b - theirs_a, rel=1e-3)


def test_what_is_at_work_is_found_and_nothing_else():
    found = decide(flight([0.01, 0.0, 0.8, 0.0, -0.6]).evidence(), Prior())
    assert found.model == ("drag/plain", "tilt/plain")
    assert decide(flight([0.01, 0.0, 0.0, 0.0, 0.0]).evidence(), Prior()).model == ()


def test_a_start_is_left_where_it_is_wrong():
    asked = problem(flight([0.0, 0.0, 0.8, 0.0, 0.0]))
    assert most_probable(asked, [("lift/plain", "tilt/plain")]).model == ("drag/plain",)


def test_of_the_forms_of_an_id_one_is_taken():
    terms = (OFFSET, effect("drag/plain"), effect("drag/square"), effect("lift/plain"))
    found = decide(flight([0.0, 0.0, 0.9, 0.0], terms, alike=2.0).evidence(), Prior())
    assert found.model == ("drag/square",)


def test_a_coefficient_stays_within_its_bounds():
    terms = (OFFSET, effect("drag/plain", low=0.0), effect("lift/plain"))
    at = scored(problem(flight([0.0, -1.0, 0.5], terms)), ("drag/plain",))
    assert at.mode.beta[-1] == 0.0


@pytest.mark.parametrize("term", [effect("drag/plain", negligible=2.0), effect("drag/plain", must_show=(0,))])
def test_a_form_that_is_negligible_or_does_not_show_costs_more(term):
    size = 0.5 if not term.must_show else 0.02
    of = flight([0.0, size], (OFFSET, term))
    free = problem(replace(of, terms=(OFFSET, effect("drag/plain"))))
    dear = scored(free, ("drag/plain",)).log_posterior - scored(problem(of), ("drag/plain",)).log_posterior
    assert dear == pytest.approx(PLAIN.small_nats)


def test_a_believed_value_does_not_move_further_than_its_trust_allows():
    of = flight([1.0, 0.0, 0.0, 0.0, 0.0])
    asked = problem(of)
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
        asked = problem_of(evidence, 1.0, PLAIN)
        return scored(asked, ("drag/plain",)).mode.beta[-1] * asked.unit[2]

    assert size(seen) < 0.87
    assert size(replace(seen, bias_gram=bias)) == pytest.approx(1.0, abs=0.06)


def test_power_is_one_of_white_noise_and_more_of_a_leftover_that_differs_between_environments():
    of = flight([0.0, 0.0, 1.0, 0.0, 0.0])
    wave = np.repeat([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0], BLOCKS // 6)[:, None]
    bent = replace(of, y=of.y + 0.8 * wave * of.x[:, :, 2])
    powers = [power_of_leftover(problem(f, Prior(), 8.0), ("drag/plain",)) for f in (of, bent)]
    assert powers[0] == pytest.approx(1.0, abs=0.5)
    assert powers[1] > 5.0


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
