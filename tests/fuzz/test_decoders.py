"""The fuzzing's own check, by hypothesis for some seconds, and on all that its corpus holds."""

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.fuzz.raw_log import look

CORPUS = sorted((Path(__file__).parent / "corpus").iterdir())
some = settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.mark.parametrize("path", CORPUS, ids=lambda path: path.name)
def test_what_was_found_before(path: Path, tmp_path: Path) -> None:
    look(path.read_bytes(), tmp_path)


@some
@given(way=st.integers(0, 4), rest=st.binary(max_size=400))
def test_any_bytes_are_read_or_refused_in_one_sentence(way: int, rest: bytes, tmp_path: Path) -> None:
    look(bytes([way]) + rest, tmp_path)


head = st.tuples(st.integers(0, 5), st.integers(0, 39), st.integers(0, 40), st.just(0), st.integers(0, 255))


@some
@given(frames=st.lists(st.tuples(head, st.binary(min_size=39, max_size=39)), max_size=25), way=st.sampled_from([3, 4]))
def test_frames_in_any_order_have_one_place_each(frames, way: int, tmp_path: Path) -> None:
    rest = b"".join(bytes([*h, 0, 0, 0]) + payload[: h[1]] for h, payload in frames)
    look(bytes([way]) + rest, tmp_path)
