"""The page of licences: every locked package, with version and licence; none that binds who installs the plain one."""

import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def licences():
    spec = importlib.util.spec_from_file_location("licences_hook", ROOT / "docs" / "hooks" / "licences.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def rows(text: str) -> dict[str, tuple[str, str]]:
    return {
        name: (version, licence) for name, version, licence in re.findall(r"^\| (\S+) \| (\S+) \| (.+) \|$", text, re.M)
    }


def test_every_locked_package_is_on_the_page(licences) -> None:
    page = rows(licences.PAGE.read_text())
    page.pop("---", None), page.pop("package", None)
    lock = (ROOT / "requirements.lock").read_text()
    assert set(page) == set(licences.locked()), "run: make licences"
    stale = [
        name
        for name, (version, _) in page.items()
        if not re.search(rf"(?im)^{name.replace('-', '[-_.]')}=={re.escape(version)}\b", lock)
    ]
    assert stale == [], "run: make licences"


def test_each_has_a_licence_and_the_plain_install_none_that_binds_its_user(licences) -> None:
    text = licences.PAGE.read_text()
    assert "see its files" not in text
    plain = rows(text[text.index("## The plain install") : text.index("## Everything else")])
    assert {"numpy", "pandas", "pydantic"} <= set(plain)
    assert [name for name, (_, licence) in plain.items() if "GPL" in licence] == []


def test_no_committed_file_names_a_registrys_host() -> None:
    hosts = re.compile(r"https?://(?!localhost)[^\s/'\"]*(pypi|npmjs|pythonhosted|simple/)[^\s'\"]*")
    named = [
        f"{path.name}: {found[0]}"
        for path in (
            ROOT / "requirements.lock",
            ROOT / "pyproject.toml",
            ROOT / "Makefile",
            ROOT / "docs" / "licences.md",
        )
        if (found := hosts.search(path.read_text()))
    ]
    assert named == []
