"""The gallery's pages are those of the code, and the shipped one is made anew."""

from pathlib import Path

import numpy as np
import pytest

from tests.hooks import hook

gallery = hook("gallery")
DOCS = Path(__file__).parents[3] / "docs" / "gallery"


def test_every_kind_has_its_page_with_its_commands() -> None:
    assert (DOCS / "README.md").read_text() == gallery.index()
    assert {p.stem for p in DOCS.glob("*.md")} == {k.name for k in gallery.KINDS} | {"README"}
    for kind in gallery.KINDS:
        text = (DOCS / f"{kind.name}.md").read_text()
        assert all(f"```\n{command}\n```" in text for command in kind.commands), kind.name
        assert f"({kind.name}.png)" not in text or (DOCS / f"{kind.name}.png").is_file()
        assert "/tmp/" not in text and "## Next" in text


def test_a_log_that_is_not_there_leaves_its_page(tmp_path: Path) -> None:
    kind = next(k for k in gallery.KINDS if k.name == "px4")
    assert "is not there" in gallery.make(kind, tmp_path, tmp_path) and not list(tmp_path.iterdir())


def test_no_line_is_drawn_across_a_gap() -> None:
    found = gallery.with_gaps(np.array([0.0, 0.1, 0.2, 5.0, 5.1]), np.ones(5))
    assert np.isnan(found).tolist() == [False, False, False, True, False]


@pytest.mark.slow
def test_the_shipped_page_is_made_anew(tmp_path: Path) -> None:
    kind = next(k for k in gallery.KINDS if k.name == "example")
    assert gallery.make(kind, None, tmp_path) == ""
    assert "rotor drag was left out" in (tmp_path / "example.md").read_text()
    assert (tmp_path / "example.png").stat().st_size > 5000
