"""What to fly next: a predicted separation is zero for a copy and large for another law."""

import numpy as np
import pytest

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.findings import Finding
from rotorid.mismatch.next_flight import next_flight, rotations, separation
from rotorid.mismatch.prepare import prepare
from tests.unit.mismatch.flights import quad, recorded


@pytest.fixture(scope="module")
def prepared():
    return prepare(recorded(1))


NOISE = np.concatenate([np.full(3, 0.1), np.full(3, 0.005), np.full(6, 0.1)])


def drag(status="ambiguous"):
    form = next(f for f in catalogue()["rotor_drag"].forms(quad()) if f.name == "at the centre of mass")
    return Finding("rotor_drag", status, form, (5e-5,), alternatives=("frame_drag", "rotor_drag"))


def test_rotations_turn_forward_to_the_right_by_a_quarter_yaw():
    turned = rotations(np.array([[0.0, 0.0, np.pi / 2]]))[0]
    np.testing.assert_allclose(turned @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-12)
    general = rotations(np.array([[0.3, -0.2, 1.1]]))[0]
    np.testing.assert_allclose(general @ general.T, np.eye(3), atol=1e-12)


def test_an_effect_cannot_be_told_from_itself_but_from_another_law(prepared):
    itself = separation(drag(), "rotor_drag", prepared, NOISE)
    other = separation(drag(), "inertia_products", prepared, NOISE)
    assert itself < 0.01
    assert other > 10.0


def test_separation_grows_as_the_noise_falls(prepared):
    loud = separation(drag(), "frame_drag", prepared, 2 * NOISE)
    quiet = separation(drag(), "frame_drag", prepared, NOISE)
    # Values within their trust take up a little more where the data say more.
    assert loud < quiet <= 2.01 * loud


def test_only_an_open_question_is_worth_a_flight(prepared):
    assert next_flight([drag("established")], prepared, NOISE).manoeuvre == ""
    plan = next_flight([drag()], prepared, NOISE)
    assert plan.separates == ("frame_drag", "rotor_drag")
    assert plan.manoeuvre and plan.sigma > 0
