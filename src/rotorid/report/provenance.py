"""Where a report came from: versions, commit, configuration, hashes of raw files and of code, date.

Snakemake watches a script, not what the script imports. `Code.of` hashes the syntax tree of a script and of
every module of the library that it reaches, so that a changed formula reruns exactly what uses it, while comments,
docstrings and layout change nothing.

What a file reaches: every `import` in it, wherever it stands (also inside functions), and each name given to
`importlib.import_module` as a constant; a module that uses `pkgutil` to find its siblings reaches its whole
package. A module that reads files shipped with the package (`importlib.resources`) has
those in its folder and below as part of its code.
"""

from __future__ import annotations

import ast
import hashlib
import json
import platform
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import rotorid
from rotorid.io.text.writing import write_texts

_PACKAGES = {"rotorid": "src", "rotorid_lab": "src", "rotorid_acquire": "src", "rotorid_proof": "proof"}
"""Each package of the project and the folder, from the top, that holds it."""
_RESOURCES = "importlib.resources"
_READ_BY_TESTS = (["OPEN"], ["ROOMS"])


def gather(raw: Sequence[str | Path], lock: str | Path, config: Mapping[str, Any]) -> dict[str, Any]:
    """Everything needed to make the same report again.

    `raw`: files that instruments wrote. `lock`: the lock file; the installed version of each package in it is recorded.
    `config`: the configuration that the run used.
    """
    lock = Path(lock)
    return {
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "commit": commit(lock.parent),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "packages": installed_versions(lock.read_text(encoding="utf-8")),
        "lock_sha256": sha256(lock),
        "config": dict(config),
        "raw_sha256": {str(path): sha256(path) for path in raw},
    }


def _git(folder: str | Path, *asked: str) -> str | None:
    """What git says of a folder; None where there is no git or it refuses."""
    try:
        done = subprocess.run(["git", "-C", str(folder), *asked], capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()


def commit(folder: str | Path) -> str:
    """The commit of the working tree, with `-dirty` where files differ; says so where there is none."""
    found = _git(folder, "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*")
    return "unknown: not a git checkout" if found is None else found


def own_commit() -> str:
    """The commit that the running library comes from, as `commit` says it; empty where it was not started from a clone.

    A library installed into another project's folder lies in that project's repository, which does not track it.
    """
    folder = Path(rotorid.__file__).parent
    return "" if _git(folder, "ls-files", "--error-unmatch", "__init__.py") is None else commit(folder)


def in_words(folder: str | Path, judging: str) -> str:
    """Commit, its date and the hash of the code that judges recordings, in one sentence for a title page."""
    made, day = commit(folder), _git(folder, "log", "-1", "--format=%cs")
    known = f"Made from commit {made[:10]}" + (" of " + day if day else "")
    known += ", with changes that are not committed" if made.endswith("-dirty") else ""
    source = known if day else "Made outside of a git checkout, so that no commit is known"
    return f"{source}. The code that judges recordings has the hash {judging[:7]} ({judging})."


def installed_versions(lock: str) -> dict[str, str]:
    """Installed version of each package that a lock file's text names."""
    found = {}
    for name in re.findall(r"^([A-Za-z0-9][A-Za-z0-9._-]*)==", lock, flags=re.MULTILINE):
        try:
            found[name] = version(name)
        except PackageNotFoundError:  # locked for another platform or Python
            continue
    return found


def asked_for(project: str) -> list[str]:
    """Packages that the text of a pyproject.toml asks for by name, its extras included, in their order there."""
    table = tomllib.loads(project)["project"]
    groups = [table.get("dependencies", []), *table.get("optional-dependencies", {}).values()]
    names = [re.match(r"[A-Za-z0-9._-]+", entry)[0] for group in groups for entry in group]
    return [name for name in dict.fromkeys(names) if name != table["name"]]


def sha256(path: str | Path) -> str:
    """SHA-256 of a file of any size, in hexadecimal digits."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


class Code:
    """The code of a project as it is now; each file is read once, so that many rules can be asked for.

    `root`: top of the project: holds the folders of `PACKAGES`. `memory`: file that keeps what was found, so that the
    next start need not parse what has not changed since (by size and time of change). None keeps nothing.
    """

    def __init__(self, root: str | Path, memory: str | Path | None = None) -> None:
        self.root = Path(root).resolve()
        self._homes = {package: self.root / folder for package, folder in _PACKAGES.items()}
        # Of each file its size and time of change, the hash of its syntax tree, and the modules that it names.
        self._facts: dict[Path, dict[str, Any]] = {}
        self._files: dict[str, list[Path]] = {}
        self._imports: dict[Path, set[Path]] = {}
        self._codes: dict[Path, str] = {}
        self._memory = Path(memory) if memory else None
        self._remembered = self._recall()

    def of(self, script: str | Path) -> str:
        """Sixteen hexadecimal digits that stand for the code that `script` runs.

        `script`: path of a Python file or a notebook, relative to the top of the project. FileNotFoundError: the script
        does not exist. SyntaxError: the script or a module that it reaches is not valid Python.
        """
        path = self.root / script
        if path not in self._codes:
            if not path.is_file():
                raise FileNotFoundError(f"code_of: there is no file {path}.")
            modules = self.reached_modules(path)
            files = (path, *modules, *self._read_by(modules))
            digests = [f"{file.name} {self._facts_of(file)['digest']}" for file in files]
            self._codes[path] = hashlib.sha256("\n".join(digests).encode()).hexdigest()[:16]
        return self._codes[path]

    def reached_modules(self, script: Path) -> list[Path]:
        """Files of the library that `script` reaches by imports of any depth, sorted."""
        found: set[Path] = set()
        waiting = [script]
        while waiting:
            new = self._imported_by(waiting.pop()) - found
            found |= new
            waiting += new
        return sorted(found)

    def _imported_by(self, path: Path) -> set[Path]:
        """Files that a file imports itself; most are asked for by many scripts."""
        if path not in self._imports:
            self._imports[path] = {file for name in self._facts_of(path)["names"] for file in self._files_of(name)}
        return self._imports[path]

    def _read_by(self, modules: list[Path]) -> list[Path]:
        """Files that are no code but shipped next to a module that reads such files (`importlib.resources`), sorted."""
        folders = {m.parent for m in modules if _RESOURCES in self._facts_of(m)["names"]}
        beside = (p for folder in folders for p in folder.rglob("*") if p.is_file() and "__pycache__" not in p.parts)
        return sorted(p for p in beside if p.suffix not in (".py", ".pyc"))

    def remember(self) -> None:
        """Write the memory, whole or not at all, where it is wanted and something is new."""
        entries = {str(path.relative_to(self.root)): facts for path, facts in self._facts.items()}
        if self._memory is None or entries.items() <= self._remembered.items():
            return
        write_texts({self._memory: json.dumps({"made_by": _made_by(), "files": entries})})

    def _recall(self) -> dict[str, dict[str, Any]]:
        try:
            stored = json.loads(self._memory.read_text(encoding="utf-8")) if self._memory else {}
            return stored["files"] if stored.get("made_by") == _made_by() else {}
        except (OSError, ValueError):
            return {}

    def _facts_of(self, path: Path) -> dict[str, Any]:
        if path not in self._facts:
            stat = path.stat()
            stamp, names = [stat.st_size, stat.st_mtime_ns], []
            known = self._remembered.get(str(path.relative_to(self.root)))
            if not known or known["stamp"] != stamp:
                content = path.read_bytes()
                if path.suffix in (".py", ".ipynb"):
                    tree = _parse(path)
                    names = sorted(set(_imported_names(tree, _package_of(path, self._homes))))
                    content = ast.dump(tree).encode()
                known = {"stamp": stamp, "digest": hashlib.sha256(content).hexdigest(), "names": names}
            self._facts[path] = known
        return self._facts[path]

    def _files_of(self, name: str) -> list[Path]:
        """Files that importing `name` runs: the packages on the way and the module itself, where they exist."""
        above, _, last = name.rpartition(".")
        if name not in self._files:
            package, *inside = name.split(".")
            if package not in self._homes:
                return []
            place = self._homes[package].joinpath(package, *inside)
            if last == "*":
                own = sorted(place.parent.rglob("*.py"))
            else:
                own = [file for file in (place / "__init__.py", place.with_suffix(".py")) if file.is_file()]
            self._files[name] = (self._files_of(above) if above else []) + own
        return self._files[name]


def _made_by() -> list[str]:
    """What a memory depends on in addition to the files: Python's syntax trees and this module."""
    return [sys.version, hashlib.sha256(Path(__file__).read_bytes()).hexdigest()]


def _imported_names(tree: ast.Module, package: str) -> Iterator[str]:
    """Dotted names of the library that a file mentions, found anywhere in it; `package.*` for a whole package."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = _from_names(node, package)
        elif isinstance(node, ast.Call) and "import_module" in (
            getattr(node.func, "attr", ""),
            getattr(node.func, "id", ""),
        ):
            names = [arg.value for arg in node.args if isinstance(arg, ast.Constant)]
        else:
            continue
        if "pkgutil" in names and package:
            yield f"{package}.*"
        yield from (name for name in names if name.split(".")[0] in _PACKAGES or name == _RESOURCES)


def _from_names(node: ast.ImportFrom, package: str) -> list[str]:
    """`from a.b import c` as `a.b` and `a.b.c` (which may be a module), relative forms made absolute."""
    base = node.module or ""
    if node.level:
        parts = package.split(".")
        base = ".".join(parts[: len(parts) - node.level + 1] + ([base] if base else []))
    return [base, *(f"{base}.{alias.name}" for alias in node.names)]


def _package_of(path: Path, homes: Mapping[str, Path]) -> str:
    """Dotted package that a library file belongs to; empty outside of the library."""
    for package, home in homes.items():
        if path.is_relative_to(home / package):
            return ".".join(path.parent.relative_to(home).parts)
    return ""


def _parse(path: Path) -> ast.Module:
    """Syntax tree of a Python file, or of the code cells of a notebook, without docstrings."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".ipynb":
        cells = json.loads(text)["cells"]
        text = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    tree = ast.parse(text, filename=str(path))
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            if ast.get_docstring(node, clean=False) is not None:
                node.body = node.body[1:] or [ast.Pass()]
    # What lists a package's modules that others may import, or their order, only a test reads.
    for node in [n for n in tree.body if isinstance(n, ast.Assign)]:
        if [ast.unparse(target) for target in node.targets] in _READ_BY_TESTS:
            tree.body.remove(node)
    return tree
