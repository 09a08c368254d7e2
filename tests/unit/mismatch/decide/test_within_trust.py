"""Believed values move within their trust, without a word, where environments not used for fitting confirm it."""

from types import SimpleNamespace

import numpy as np
import pytest

from rotorid.mismatch.decide import ways
from rotorid.mismatch.decide.selected import coefficient_of, relative_change
from rotorid.mismatch.decide.ways import beyond_trust, in_words, settled
from rotorid.mismatch.evidence.regression import Fit

TRUST = {"thrust": 0.05, "mass": 0.005}


def model_of(monkeypatch, thrust: float, helps: bool = True):
    """A model whose only value to move is the thrust, by `thrust`; moving it halves the force's error if it `helps`."""
    terms = [SimpleNamespace(key=k, kind="value", prior_sd=(sd,)) for k, sd in TRUST.items()]

    def columns(keys):
        return np.array([list(TRUST).index(k) for k in keys], int)

    def fit(keys):
        own = columns(keys)
        return Fit(own, np.where(own == 0, thrust, 0.0), 0.0, 1e-8 * np.eye(len(own)), np.zeros(1))

    made = SimpleNamespace(
        terms=terms, columns=columns, fit=fit, keys_of=lambda *kinds: list(TRUST) if kinds == ("value",) else []
    )
    made.given = lambda cols, beta: made
    model = SimpleNamespace(
        regression=made,
        rows_per_block=40,
        delivered_with=lambda keys, loose: list(keys),
        values_beside=lambda active: list(TRUST),
        change=relative_change,
        coefficient=coefficient_of,
    )
    noise = np.random.default_rng(0).standard_normal((4000, 12))

    def residuals(_, keys, values):
        better = len(keys) == len(TRUST)
        return [noise * (0.5 if better and helps else 1.0)]

    monkeypatch.setattr(ways, "left_out_residuals", residuals)
    monkeypatch.setattr(ways, "judged_rows", lambda *_: [np.ones(4000, bool)])
    return model


def test_a_thrust_within_its_trust_is_corrected(monkeypatch):
    """By −3 % of a trust of 5 %: both values move together, and one of them is worth a word."""
    fit, moved = settled(model_of(monkeypatch, -0.03), {}, ())
    assert len(fit.columns) == 2 and moved["thrust"][0] == pytest.approx(-0.03) and moved["mass"][0] == 0.0
    assert in_words(moved) == ("thrust coefficient −3.0 ± 0.0 %",)


def test_a_value_called_wrong_is_not_told_twice(monkeypatch):
    _, moved = settled(model_of(monkeypatch, -0.03), {"thrust": (-0.03, 0.001)}, ())
    assert list(moved) == ["mass"]


def test_values_called_wrong_are_delivered_at_their_told_numbers(monkeypatch):
    fit, _ = settled(model_of(monkeypatch, -0.2), {"mass": (0.25, 0.01)}, ())
    # A mass of 1.25 of the believed: the coefficient of the acceleration's column is 1 − 1/1.25.
    assert fit.beta[fit.places(np.array([1]))] == pytest.approx([0.2])


def test_beyond_trust_something_else_is_missing(monkeypatch):
    """By 11 % of a trust of 5 %: more than two standard deviations, and nothing is moved."""
    model = model_of(monkeypatch, 0.11)
    assert beyond_trust(model, {}, ()) and not beyond_trust(model, {"thrust": (0.11, 0.001)}, ())
    fit, moved = settled(model, {}, ())
    assert moved == {} and len(fit.columns) == 0


def test_values_that_help_no_held_out_channel_stay(monkeypatch):
    fit, moved = settled(model_of(monkeypatch, -0.03, helps=False), {}, ())
    assert moved == {} and len(fit.columns) == 0
