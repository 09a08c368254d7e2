"""The page of licences: every locked package, with version and licence; none that binds who installs the plain one."""

import re
from pathlib import Path

from tests.hooks import hook

ROOT = Path(__file__).parents[2]
PAGE = hook("licences").page()


def rows(text: str) -> dict[str, tuple[str, str]]:
    return {
        name: (version, licence) for name, version, licence in re.findall(r"^\| (\S+) \| (\S+) \| (.+) \|$", text, re.M)
    }


def test_every_locked_package_is_on_the_page() -> None:
    page = rows(PAGE)
    page.pop("---", None), page.pop("package", None)
    lock = (ROOT / "requirements.lock").read_text()
    locked = re.findall(r"(?m)^([\w.-]+)==", lock)
    assert set(page) == {name.lower().replace("_", "-").replace(".", "-") for name in locked}
    stale = [
        name
        for name, (version, _) in page.items()
        if not re.search(rf"(?im)^{name.replace('-', '[-_.]')}=={re.escape(version)}\b", lock)
    ]
    assert stale == []


def test_each_has_a_licence_and_the_plain_install_none_that_binds_its_user() -> None:
    assert "see its files" not in PAGE
    plain = rows(PAGE[PAGE.index("## The plain install") : PAGE.index("## Everything else")])
    assert {"numpy", "pandas", "pydantic"} <= set(plain)
    assert [name for name, (_, licence) in plain.items() if "GPL" in licence] == []


def test_no_committed_file_names_a_registrys_host() -> None:
    hosts = re.compile(r"https?://(?!localhost)[^\s/'\"]*(pypi|npmjs|pythonhosted|simple/)[^\s'\"]*")
    texts = {name: (ROOT / name).read_text() for name in ("requirements.lock", "pyproject.toml", "Makefile")}
    texts["licences.md"] = PAGE
    named = [f"{name}: {found[0]}" for name, text in texts.items() if (found := hosts.search(text))]
    assert named == []
