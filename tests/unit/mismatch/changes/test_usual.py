"""By how much flights differ in which nothing changed."""

import numpy as np
import pytest

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.changes.usual import feigned, form_spread, share_of_form, usual_spread
from rotorid.mismatch.posterior.evidence import EvidenceTerm, LinearParameter
from tests.unit.mismatch.posterior.test_posterior import flight


def form(key: str, unit: str, symbol: str = "b") -> EvidenceTerm:
    """A form of one parameter."""
    parameter = LinearParameter(symbol, unit, -1, 1, 0)
    return EvidenceTerm(key, "effect", key.split("/")[0], 1, (np.inf,), linear=(parameter,))


TERMS = (form("gyro_error/bias", "rad/s"), form("gyro_error/bias and scale", "rad/s"), form("rotor_drag/plain", "N"))
TURNED = form("gyro_error/misalignment", "rad", "theta")


def test_a_zero_that_two_forms_have_differs_no_more_than_one_that_one_form_has():
    """Their columns are the same: what they differ by together is the root of the sum of their squares."""
    made = flight([0.0, 0.0, 0.0, 0.0], (*TERMS, TURNED)).evidence()
    spread = usual_spread(made, made, np.zeros(4), np.ones(1))
    usual = catalogue()["gyro_error"].between_flights
    assert np.hypot(spread[0], spread[1]) == pytest.approx(usual["rad/s"])
    assert spread[2] == 0.0
    assert spread[3] == pytest.approx(usual["rad"])


def test_the_error_of_a_form_is_shared_by_the_forms_that_it_may_look_like():
    made = flight([0.0, 0.0, 0.0], TERMS).evidence()
    assert share_of_form(made) == pytest.approx([0.5**0.5, 0.5**0.5, 1.0])
    one = form_spread(flight([0.0, 0.0], TERMS[1:], seed=3).evidence(), np.array([0.0, 1.0]), 0.02)
    three = flight([0.0, 0.0, 0.0], TERMS, seed=3).evidence()
    shared = form_spread(three, np.array([0.0, 0.0, 1.0]), 0.02)
    assert np.hypot(shared[0], shared[1]) == pytest.approx(one[0], rel=0.1)


def test_a_closed_loop_feigns_a_delay_by_what_the_second_set_leaves_unexplained_more_than_the_first():
    calm, shaken = (flight([0.0, 0.0, 0.0], TERMS, seed=3, noise=noise).evidence() for noise in (1.0, 3.0))
    assert feigned(calm, calm, np.ones(1)) == pytest.approx(np.zeros(3), abs=1e-9)
    # Columns of a variance of 1.09; what moves a heavier vehicle as much is three times as large a force.
    assert feigned(calm, shaken, np.ones(1)) == pytest.approx(np.full(3, 0.5 * (8 / 1.09) ** 0.5), rel=0.1)
    assert feigned(shaken, calm, np.ones(1)) == pytest.approx(np.zeros(3), abs=1e-9)
    assert (feigned(calm, shaken, np.full(1, 3.0)) < 0.2 * feigned(calm, shaken, np.ones(1))).all()
