"""Copies of the project for tests that run it."""

from pathlib import Path

import pytest
from copied_project import Project


@pytest.fixture
def project(tmp_path: Path) -> Project:
    """A fresh copy without results."""
    return Project(tmp_path / "project")


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """A copy that was built once; a test that edits it puts back what it found."""
    project = Project(tmp_path_factory.mktemp("built") / "project")
    project.build()
    return project
