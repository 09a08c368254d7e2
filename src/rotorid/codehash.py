"""The code of the library as part of a rule's identity.

Snakemake watches a script, not what the script imports. `code_of` hashes the syntax tree of a script and of
every `rotorid` module that it reaches, so that a changed formula reruns exactly what uses it, while comments,
docstrings and layout change nothing.

What a file reaches: every `import` in it, wherever it stands (also inside functions), and each name given to
`importlib.import_module` as a constant; a module that uses `pkgutil` to find its siblings reaches its whole
package.
"""

from __future__ import annotations

import ast
import hashlib
import json
from collections.abc import Iterator
from functools import cache
from pathlib import Path

PACKAGE = "rotorid"


def code_of(script: str | Path, root: str | Path) -> str:
    """Sixteen hexadecimal digits that stand for the code that `script` runs.

    Parameters
    ----------
    script
        Path of a Python file or a notebook, relative to `root`.
    root
        Top of the project: holds `src/rotorid`.

    Raises
    ------
    FileNotFoundError
        The script does not exist.
    SyntaxError
        The script or a module that it reaches is not valid Python.
    """
    root = Path(root).resolve()
    script = root / script
    if not script.is_file():
        raise FileNotFoundError(f"code_of: there is no file {script}.")
    fingerprints = [_fingerprint(script)]
    fingerprints += [_fingerprint(path) for path in reached_modules(script, root)]
    return hashlib.sha256("\n".join(fingerprints).encode()).hexdigest()[:16]


def reached_modules(script: Path, root: Path) -> list[Path]:
    """Files of the library that `script` reaches by imports of any depth, sorted."""
    source = root / "src"
    found: set[Path] = set()
    waiting = [script]
    while waiting:
        path = waiting.pop()
        for name in _imported_names(path, source):
            for module in _files_of(name, source):
                if module not in found:
                    found.add(module)
                    waiting.append(module)
    return sorted(found)


def _imported_names(path: Path, source: Path) -> Iterator[str]:
    """Dotted names of the library that a file mentions, found anywhere in it."""
    package = _package_of(path, source)
    for node in ast.walk(_tree(path)):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = _from_names(node, package)
        elif isinstance(node, ast.Call) and _called(node) == "import_module":
            names = [arg.value for arg in node.args if isinstance(arg, ast.Constant)]
        else:
            continue
        if "pkgutil" in names and package:
            yield from _whole_package(package, source)
        yield from (name for name in names if name.split(".")[0] == PACKAGE)


def _from_names(node: ast.ImportFrom, package: str) -> list[str]:
    """`from a.b import c` as `a.b` and `a.b.c` (which may be a module), relative forms made absolute."""
    base = node.module or ""
    if node.level:
        parts = package.split(".")
        base = ".".join(parts[: len(parts) - node.level + 1] + ([base] if base else []))
    return [base, *(f"{base}.{alias.name}" for alias in node.names)]


def _called(node: ast.Call) -> str:
    return node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")


def _package_of(path: Path, source: Path) -> str:
    """Dotted package that a library file belongs to; empty outside of the library."""
    return ".".join(path.parent.relative_to(source).parts) if path.is_relative_to(source) else ""


def _whole_package(package: str, source: Path) -> Iterator[str]:
    for file in sorted((source / Path(*package.split("."))).rglob("*.py")):
        yield ".".join(file.relative_to(source).with_suffix("").parts).removesuffix(".__init__")


def _files_of(name: str, source: Path) -> Iterator[Path]:
    """Files that importing `name` runs: the packages on the way and the module itself, where they exist."""
    parts = name.split(".")
    for depth in range(1, len(parts) + 1):
        place = source.joinpath(*parts[:depth])
        for file in (place / "__init__.py", place.with_suffix(".py")):
            if file.is_file():
                yield file


def _tree(path: Path) -> ast.Module:
    return _parse(path, path.stat().st_mtime_ns)


@cache
def _parse(path: Path, mtime_ns: int) -> ast.Module:
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
    return tree


def _fingerprint(path: Path) -> str:
    """Hash of a file's syntax tree, with the file's name."""
    return f"{path.name} {_digest(path, path.stat().st_mtime_ns)}"


@cache
def _digest(path: Path, mtime_ns: int) -> str:
    return hashlib.sha256(ast.dump(_parse(path, mtime_ns)).encode()).hexdigest()
