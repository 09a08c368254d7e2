"""The table of wrong inputs: each is one sentence with file, line or column, what was found and what was expected."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from rotorid.recordings import read_set
from rotorid.recordings.sufficient import sufficient
from tests.forked import Commands, commands
from tests.refusals import refused
from tests.unit.recordings.wrong_inputs import Wrong, all_wrong, sound

TABLE = all_wrong()
MOST_S = 10.0
MOST_BYTES = 1_000_000_000


def test_the_table_is_large_and_the_sound_set_is_accepted(tmp_path: Path) -> None:
    assert len(TABLE) >= 250
    assert len({wrong.name for wrong in TABLE}) == len(TABLE)
    assert sufficient(read_set(sound(tmp_path / "set"))).left_out == ()


@pytest.mark.parametrize("wrong", TABLE, ids=lambda wrong: wrong.name[:70].encode("unicode_escape").decode())
def test_a_wrong_set_is_one_sentence(wrong: Wrong, tmp_path: Path) -> None:
    folder = sound(tmp_path / "set")
    wrong.spoil(folder)
    before = sorted(p.name for p in folder.iterdir())
    start = time.process_time()
    text = refused(None, lambda: sufficient(read_set(folder)))
    assert time.process_time() - start < MOST_S
    assert text.startswith(str(folder)) and len(text) < 600 + len(str(folder))
    assert text.isprintable(), "one line"
    assert all(words in text for words in wrong.said), text
    assert not any(foreign in text for foreign in ("Input should be", "pydantic", "Traceback", "NoneType", "<class"))
    assert sorted(p.name for p in folder.iterdir()) == before


BY_COMMAND = (
    "gzip bomb of lines", "vehicle # x", "pipe as run.csv", "data with the clock set", "loop of links as vehicle",
    "jump of 1e6 s", *(wrong.name for wrong in TABLE if " large " in wrong.name),
)  # fmt: skip


@pytest.fixture(scope="module")
def command(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Commands]:
    """The command line, ready to check a set."""
    folder = tmp_path_factory.mktemp("command")
    with commands(folder, "check", sound(folder / "set")) as ready:
        yield ready


@pytest.mark.parametrize("name", BY_COMMAND)
def test_the_command_ends_soon_with_one_sentence_and_little_memory(name: str, tmp_path, command: Commands) -> None:
    wrong = next(w for w in TABLE if name in w.name)
    folder = sound(tmp_path / "set")
    wrong.spoil(folder)
    done = command.run("check", folder)
    assert done.user_s < MOST_S and done.code == 1
    assert len(done.said.strip().splitlines()) == 1 and all(words in done.said for words in wrong.said), done.said
    assert done.most_bytes < MOST_BYTES


NAMES = (
    *("{x}", "{{x}}", "<b>bold", "$\\frac{1}{$", "it's", 'a "b"', "-rf", "a b", "#typst[x]", "*", "Ω_ü", "a;b", "%s"),
    "&amp;",
)


@pytest.mark.parametrize("name", NAMES)
def test_odd_names_are_only_names(name: str, tmp_path: Path) -> None:
    folder = sound(tmp_path / name)
    (folder / "run.csv").rename(folder / f"{name}.csv")
    usable = sufficient(read_set(folder))
    assert (usable.name, usable.runs[0].name) == (name, name)
