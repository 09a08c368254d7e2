"""Rotors that differ and an offset of the centre of mass are one class where they turn the vehicle alike."""

from types import SimpleNamespace

import numpy as np
import pytest

from rotorid.mismatch.analyse import rotors_or_offset
from rotorid.mismatch.decide.findings import Finding

ROWS = 200


def model(thrust: np.ndarray, differing: np.ndarray):
    """A model with rotor 1 stronger at work: its moment is that of the offset, (ROWS,), and one of its own."""
    x = np.zeros((ROWS, 12, 3))
    x[:, 3, 0], x[:, 4, 1] = thrust, -thrust  # r_y and r_x
    x[:, 3, 2] = 0.1 * thrust + differing
    x[:, 4, 2] = -0.1 * thrust + differing
    terms = {
        key: SimpleNamespace(key=key, effect=effect, kind="effect")
        for key, effect in (("com", "com_offset"), ("one", "unequal_rotors"))
    }
    columns = {"com": [0, 1], "one": [2]}
    return SimpleNamespace(
        search=SimpleNamespace(terms=terms),
        selection=SimpleNamespace(active=["one"]),
        regression=SimpleNamespace(columns=lambda keys: np.concatenate([columns[k] for k in keys])),
        contributions=SimpleNamespace(of=lambda cols, beta: [x[:, :, cols] @ beta]),
        rows=[SimpleNamespace(x=x)],
    )


FIT = SimpleNamespace(beta=np.array([0.05]), places=lambda cols: [0])


@pytest.mark.parametrize(
    ("differing", "alternatives"), [(0.001, ("com_offset", "unequal_rotors")), (0.02, ())], ids=["hover", "lively"]
)
def test_one_rotor_is_an_offset_too_in_a_hover_and_not_where_rotors_differ_much(differing, alternatives):
    random = np.random.default_rng(0)
    made = model(10.0 + 0.1 * random.standard_normal(ROWS), 10 * differing * random.standard_normal(ROWS))
    (found,) = rotors_or_offset([Finding("unequal_rotors", "established")], made, FIT)
    assert found.alternatives == alternatives


def test_what_is_not_claimed_stays_as_it_is():
    dropped = Finding("unequal_rotors", "not_established")
    assert rotors_or_offset([dropped], model(np.ones(ROWS), np.zeros(ROWS)), FIT) == [dropped]
