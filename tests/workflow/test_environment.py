"""`make environment` where packages come from a mirror that only pip or only uv knows of, and where uv is not there.

The lock is a short one, its packages are made of what is installed here, and no other index can be reached.
"""

import base64
import hashlib
import os
import runpy
import shutil
import subprocess
import threading
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from importlib.metadata import distribution
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROJECT = """[build-system]
requires = ["setuptools"]
build-backend = "setuptools.build_meta"
[project]
name = "short"
version = "1"
[tool.setuptools]
py-modules = []
"""


class Mirror(SimpleHTTPRequestHandler):
    """A folder of packages as an index: notes who asked for what in place of printing it."""

    asked: list[tuple[str, str]]

    def log_message(self, *words: object) -> None:
        self.asked.append((str(self.headers["User-Agent"]).split("/")[0], self.path))


def put_wheel(name: str, packages: Path) -> str:
    """What is installed of a package as a wheel of the mirror; its entry of the lock."""
    known = distribution(name)
    tag = next(line for line in known.read_text("WHEEL").splitlines() if line.startswith("Tag: ")).removeprefix("Tag: ")
    stem = f"{name}-{known.version}"
    wheel = packages / name / f"{stem}-{tag}.whl"
    wheel.parent.mkdir(parents=True)
    record = []
    with zipfile.ZipFile(wheel, "w") as archive:
        for file in known.files or []:
            if file.suffix == ".pyc" or file.name in ("RECORD", "INSTALLER", "REQUESTED", "direct_url.json"):
                continue
            script = ".." in file.parts
            inside = f"{stem}.data/scripts/{file.name}" if script else file.as_posix()
            content = Path(str(file.locate())).read_bytes()
            digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
            record.append(f"{inside},sha256={digest},{len(content)}\n")
            archive.write(str(file.locate()), inside)  # with its permissions: a program stays one
        archive.writestr(f"{stem}.dist-info/RECORD", "".join([*record, f"{stem}.dist-info/RECORD,,\n"]))
    digest = hashlib.sha256(wheel.read_bytes()).hexdigest()
    (wheel.parent / "index.html").write_text(f'<a href="{wheel.name}#sha256={digest}">{wheel.name}</a>')
    return f"{name}=={known.version} \\\n    --hash=sha256:{digest}\n    # via short (pyproject.toml)\n"


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the packages of a short lock, and the lock."""
    folder = tmp_path_factory.mktemp("packages")
    lock = [put_wheel(name, folder / "simple") for name in ("setuptools", "iniconfig", "uv")]
    (folder / "requirements.lock").write_text("".join(lock))
    return folder


@contextmanager
def mirror(folder: Path) -> Iterator[tuple[str, list[tuple[str, str]]]]:
    """Address of an index of the packages in a folder, and what was asked of it: who (`pip`, `uv`) and which path."""
    handler = type("Own", (Mirror,), {"asked": []})
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(handler, directory=str(folder)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}", handler.asked
    finally:
        server.shutdown()
        server.server_close()


def made(folder: Path, packages: Path, **settings: str) -> str:
    """What `make environment` says in a new project with the short lock, every other index out of reach."""
    (folder / ".ci").mkdir(parents=True)
    for path in ("Makefile", ".ci/package_index.py"):
        shutil.copy(ROOT / path, folder / path)
    shutil.copy(packages / "requirements.lock", folder)
    (folder / "pyproject.toml").write_text(PROJECT)
    proxies = {name: "http://127.0.0.1:9" for name in ("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY")}
    own = {k: v for k, v in os.environ.items() if not k.startswith(("PIP_", "UV_", "MAKE")) and "VIRTUAL_ENV" not in k}
    own |= proxies | {"NO_PROXY": "127.0.0.1", "no_proxy": "127.0.0.1", "XDG_CONFIG_HOME": str(folder / "config")}
    own |= {"PIP_CONFIG_FILE": os.devnull, "PIP_RETRIES": "0", "UV_HTTP_RETRIES": "0", "UV_NO_CACHE": "1"}
    how = {"cwd": folder, "env": own | settings, "text": True, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    done = subprocess.run(["make", "--no-print-directory", "environment"], **how)
    assert done.returncode == 0, done.stdout
    subprocess.run([folder / ".venv/bin/python", "-c", "import iniconfig"], check=True)
    return done.stdout


@pytest.mark.slow
def test_uv_takes_packages_from_the_index_that_pip_was_told_of(tmp_path: Path, packages: Path) -> None:
    with mirror(packages / "simple") as (address, asked):
        (tmp_path / "pip.conf").write_text(f"[global]\nindex-url = {address}\n")
        said = made(tmp_path / "new", packages, PIP_CONFIG_FILE=str(tmp_path / "pip.conf"))
    assert "uv did not work" not in said and ("uv", "/iniconfig/") in asked


@pytest.mark.slow
def test_pip_takes_uv_from_the_index_that_uv_was_told_of(tmp_path: Path, packages: Path) -> None:
    with mirror(packages / "simple") as (address, asked):
        (tmp_path / "uv").mkdir()
        (tmp_path / "uv" / "uv.toml").write_text(f'[[index]]\nurl = "{address}"\ndefault = true\n')
        said = made(tmp_path / "new", packages, XDG_CONFIG_HOME=str(tmp_path))
    assert "uv did not work" not in said
    assert ("pip", "/uv/") in asked and ("uv", "/iniconfig/") in asked


@pytest.mark.slow
def test_pip_makes_the_environment_where_the_mirror_has_no_uv(tmp_path: Path, packages: Path) -> None:
    for name in ("setuptools", "iniconfig"):
        (tmp_path / "some").mkdir(exist_ok=True)
        (tmp_path / "some" / name).symlink_to(packages / "simple" / name)
    with mirror(tmp_path / "some") as (address, asked):
        said = made(tmp_path / "new", packages, PIP_INDEX_URL=address)
    assert "uv did not work here; installing with pip" in said
    assert ("pip", "/iniconfig/") in asked


def test_settings_of_pip_and_uv_are_read_and_what_is_set_for_both_stays() -> None:
    package_index = runpy.run_path(str(ROOT / ".ci" / "package_index.py"))
    names = ("pip_settings", "uv_settings", "to_hand_over")
    pip_settings, uv_settings, to_hand_over = (package_index[name] for name in names)
    lines = ":env:.index-url='http://e'\nglobal.extra-index-url='\\nfile:///a\\nhttp://b'\nglobal.index-url='g'"
    pip = pip_settings(lines)
    assert pip == {"index-url": ["http://e"], "extra-index-url": ["file:///a", "http://b"]}
    for variable in ("UV_DEFAULT_INDEX", "UV_INDEX_URL"):
        assert uv_settings({variable: "mine=http://u/?a=http://v"}, {}) == {"index-url": ["http://u/?a=http://v"]}
    assert uv_settings({}, {"index-url": "http://u", "native-tls": True}) == {"index-url": ["http://u"]}
    assert uv_settings({}, {"pip": {"index-url": "http://u"}}) == {"index-url": ["http://u"]}
    uv = uv_settings({"UV_DEFAULT_INDEX": "http://u", "UV_FIND_LINKS": "/a,/b"}, {"index-url": "http://file"})
    assert to_hand_over(pip, uv) == {
        "UV_INDEX": "file:///a http://b",
        "UV_INDEX_STRATEGY": "unsafe-best-match",
        "PIP_FIND_LINKS": "/a /b",
    }
