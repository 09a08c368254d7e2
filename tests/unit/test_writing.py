"""Files are written together or not at all; numbers to the digits that are not chance."""

from pathlib import Path

import pytest

from rotorid.writing import all_or_none, rounded


def test_files_take_their_names_together(tmp_path: Path) -> None:
    one, two = tmp_path / "new" / "one", tmp_path / "new" / "two"
    with all_or_none(one, two) as (first, second):
        first.write_text("1")
        second.write_text("2")
        assert not one.exists()
    assert (one.read_text(), two.read_text()) == ("1", "2")
    assert sorted(p.name for p in one.parent.iterdir()) == ["one", "two"]


def test_a_fault_leaves_what_was_there_before(tmp_path: Path) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    one.write_text("old")
    with pytest.raises(OSError, match="full"):
        with all_or_none(one, two) as (first, _):
            first.write_text("half")
            raise OSError("disk full")
    assert one.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["one"]


def test_a_file_that_was_never_written_keeps_the_others_back(tmp_path: Path) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    with pytest.raises(FileNotFoundError):
        with all_or_none(one, two) as (first, _):
            first.write_text("1")
    assert not list(tmp_path.iterdir())


def test_the_twelfth_digit_is_no_difference() -> None:
    one = {"mass_kg": 0.652000000001, "effects": ({"id": "x", "parameters": {"k": 1.23456789e-7}},), "n": 3, "t": True}
    two = {"mass_kg": 0.652000000002, "effects": ({"id": "x", "parameters": {"k": 1.23456788e-7}},), "n": 3, "t": True}
    assert rounded(one) == rounded(two)
    assert rounded(one)["effects"][0]["parameters"]["k"] == 1.23457e-7
    assert rounded(one)["t"] is True
