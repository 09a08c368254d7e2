"""What is made of a motion is made again only where something changed that it is made of."""

from dataclasses import replace

import numpy as np
import pytest

import rotorid.mismatch.model.prepare as module
from rotorid.effects.contract import Motion
from rotorid.mismatch.model.prepare import LastMade


def flown(size: int = 50) -> Motion:
    """A motion that has what the maker reads."""
    rng = np.random.default_rng(1)
    return Motion(
        time_s=np.arange(size) / 50,
        rotor_speed=np.full((size, 4), 500.0),
        velocity=rng.standard_normal((size, 3)),
        rotation=np.tile(np.eye(3), (size, 1, 1)),
    )


@pytest.fixture
def counted():
    """A maker that counts how often it is asked: the force of the air on a plate, and its half."""
    asked = []

    def make(motion):
        asked.append(motion)
        return [{"force": motion.air_velocity**2}]

    return make, asked


def test_only_what_was_read_counts(counted):
    make, asked = counted
    motion, memory = flown(), LastMade()
    first = memory.made(("plate",), (1.0,), motion, make)
    again = memory.made(("plate",), (1.0,), replace(motion, angular_acceleration=np.ones((motion.size, 3))), make)
    assert again is first and len(asked) == 1
    blown = memory.made(("plate",), (1.0,), replace(motion, wind=np.array([3.0, 0.0, 0.0])), make)
    assert len(asked) == 2 and not np.allclose(blown[0]["force"], first[0]["force"])


def test_other_values_are_made_anew_and_take_the_place_of_the_first(counted):
    make, asked = counted
    motion, memory = flown(), LastMade()
    for value in (1.0, 2.0, 2.0, 1.0):
        memory.made(("plate",), (value,), motion, make)
    assert len(asked) == 3 and len(memory.kept) == 1
    assert memory.size == asked[0].air_velocity.nbytes


def test_what_was_made_first_is_forgotten_first(counted, monkeypatch):
    make, asked = counted
    motion, memory = flown(), LastMade()
    monkeypatch.setattr(module, "MOST_BYTES", 2.5 * motion.velocity.nbytes)
    for key in ("a", "b", "c", "c", "b", "a"):
        memory.made((key,), (), motion, make)
    assert len(asked) == 4 and memory.size <= module.MOST_BYTES
