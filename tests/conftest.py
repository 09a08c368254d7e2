"""What every test has."""

import pytest


@pytest.fixture(autouse=True)
def no_record_of_the_user(monkeypatch, tmp_path_factory) -> None:
    """Commands run by a test neither read nor write the user's record of earlier runs."""
    monkeypatch.setattr("rotorid.cli.waiting.record_file", lambda: tmp_path_factory.getbasetemp() / "waiting.json")
