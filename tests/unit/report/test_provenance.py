"""The provenance of a run."""

import hashlib
import shutil
import subprocess
from pathlib import Path

import numpy
import pytest

from rotorid.report import provenance


def test_versions_are_those_installed_of_what_is_locked() -> None:
    lock = "numpy==0.0 \\\n    --hash=sha256:00\nno-such-package==1.0 \\\n"
    assert provenance.installed_versions(lock) == {"numpy": numpy.__version__}


def test_raw_files_are_named_with_their_hash(tmp_path: Path) -> None:
    (tmp_path / "requirements.lock").write_text("numpy==0.0\n")
    (tmp_path / "log.csv").write_bytes(b"1,2\n")
    record = provenance.gather([tmp_path / "log.csv"], tmp_path / "requirements.lock", {"a": 1})
    assert record["raw_sha256"] == {str(tmp_path / "log.csv"): hashlib.sha256(b"1,2\n").hexdigest()}
    assert record["config"] == {"a": 1}


def test_outside_of_git_the_commit_is_said_to_be_unknown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    assert provenance.commit(tmp_path) == "unknown: not a git checkout"
    assert "no commit is known" in provenance.in_words(tmp_path, "0123456789ab")


def git(folder: Path, *arguments: str) -> str:
    identity = ["-c", "user.name=t", "-c", "user.email=t@example.org"]
    command = ["git", "-C", str(folder), *identity, *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


@pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")
def test_a_changed_file_marks_the_commit_dirty(tmp_path: Path) -> None:
    git(tmp_path, "init", "-q")
    (tmp_path / "a").write_text("1")
    git(tmp_path, "add", "a")
    git(tmp_path, "commit", "-q", "-m", "one")
    head = git(tmp_path, "rev-parse", "HEAD")
    assert provenance.commit(tmp_path) == head
    (tmp_path / "a").write_text("2")
    assert provenance.commit(tmp_path) == f"{head}-dirty"
    day = git(tmp_path, "log", "-1", "--format=%cs")
    assert provenance.in_words(tmp_path, "0123456789ab") == (
        f"Made from commit {head[:10]} of {day}, with changes that are not committed. "
        "The code that judges recordings has the hash 0123456 (0123456789ab)."
    )


@pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")
def test_the_librarys_commit_is_that_of_its_clone_and_not_of_a_project_that_holds_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "rotorid"
    package.mkdir()
    (package / "__init__.py").write_text("")
    monkeypatch.setattr("rotorid.__file__", str(package / "__init__.py"))
    git = ["git", "-C", str(tmp_path), "-c", "user.name=t", "-c", "user.email=t@example.org"]
    subprocess.run([*git, "init", "-q"], check=True)
    subprocess.run([*git, "commit", "-q", "--allow-empty", "-m", "another project"], check=True)
    assert provenance.own_commit() == ""
    subprocess.run([*git, "add", "rotorid"], check=True)
    subprocess.run([*git, "commit", "-q", "-m", "its clone"], check=True)
    assert provenance.own_commit() == provenance.commit(tmp_path) != ""


def test_the_packages_asked_for_are_named_once_and_without_their_bounds() -> None:
    project = """
[project]
name = "own"
dependencies = ["numpy>=2", "scipy"]
[project.optional-dependencies]
all = ["own[logs]", "ros-bags[x]>=0.1,!=0.2", "numpy"]
"""
    assert provenance.asked_for(project) == ["numpy", "scipy", "ros-bags"]
