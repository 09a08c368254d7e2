"""The code of the library as part of a rule's identity.

Snakemake watches a script, not what the script imports. `Code.of` hashes the syntax tree of a script and of
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
from pathlib import Path

PACKAGE = "rotorid"


class Code:
    """The code of a project as it is now; each file is read once, so that many rules can be asked for.

    Parameters
    ----------
    root
        Top of the project: holds `src/rotorid`.
    """

    def __init__(self, root: str | Path) -> None:
        self.root = Path(root).resolve()
        self._source = self.root / "src"
        self._trees: dict[Path, ast.Module] = {}
        self._digests: dict[Path, str] = {}
        self._imports: dict[Path, list[Path]] = {}

    def of(self, script: str | Path) -> str:
        """Sixteen hexadecimal digits that stand for the code that `script` runs.

        Parameters
        ----------
        script
            Path of a Python file or a notebook, relative to the top of the project.

        Raises
        ------
        FileNotFoundError
            The script does not exist.
        SyntaxError
            The script or a module that it reaches is not valid Python.
        """
        path = self.root / script
        if not path.is_file():
            raise FileNotFoundError(f"code_of: there is no file {path}.")
        digests = [self._digest(file) for file in (path, *self.reached_modules(path))]
        return hashlib.sha256("\n".join(digests).encode()).hexdigest()[:16]

    def reached_modules(self, script: Path) -> list[Path]:
        """Files of the library that `script` reaches by imports of any depth, sorted."""
        found: set[Path] = set()
        waiting = [script]
        while waiting:
            new = set(self._imported_files(waiting.pop())) - found
            found |= new
            waiting += new
        return sorted(found)

    def _imported_files(self, path: Path) -> list[Path]:
        """Files of the library that one file imports itself."""
        if path not in self._imports:
            names = set(_imported_names(self._tree(path), _package_of(path, self._source), self._source))
            self._imports[path] = sorted({file for name in names for file in _files_of(name, self._source)})
        return self._imports[path]

    def _digest(self, path: Path) -> str:
        """Hash of a file's syntax tree, with the file's name."""
        if path not in self._digests:
            tree = ast.dump(self._tree(path))
            self._digests[path] = f"{path.name} {hashlib.sha256(tree.encode()).hexdigest()}"
        return self._digests[path]

    def _tree(self, path: Path) -> ast.Module:
        if path not in self._trees:
            self._trees[path] = _parse(path)
        return self._trees[path]


def _imported_names(tree: ast.Module, package: str, source: Path) -> Iterator[str]:
    """Dotted names of the library that a file mentions, found anywhere in it."""
    for node in ast.walk(tree):
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
    return tree
