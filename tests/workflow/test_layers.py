"""Which package may import which, read from the source."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ACQUIRE = sorted((ROOT / "src" / "rotorid" / "acquire").rglob("*.py"))
LIBRARY = sorted({*(ROOT / "src" / "rotorid").rglob("*.py")} - {*ACQUIRE})


def modules(tree: ast.AST) -> Iterator[str]:
    """Dotted names that a piece of code imports, wherever the import stands."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def imported(tree: ast.AST) -> Iterator[str]:
    """Top-level packages that a piece of code imports; of `rotorid`, its packages, such as `rotorid.io`."""
    for module in modules(tree):
        parts = module.split(".")
        yield ".".join(parts[: 2 if parts[0] == "rotorid" else 1])


def at_import_time(tree: ast.Module) -> Iterator[str]:
    """Packages imported when the module is: at its top, not inside functions or `if TYPE_CHECKING`."""
    for node in tree.body:
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield from imported(ast.Module([node], []))


def test_there_is_a_library_to_look_at() -> None:
    assert len(LIBRARY) > 5


@pytest.mark.parametrize("path", LIBRARY, ids=lambda path: str(path.relative_to(ROOT)))
def test_the_library_knows_neither_workflow_nor_instruments_nor_matplotlib(path: Path) -> None:
    tree = ast.parse(path.read_text())
    names = set(imported(tree))
    assert not names & {"snakemake", "rotorid.acquire", "serial", "papermill", "workflow", "tests"}
    if "plots" in path.relative_to(ROOT / "src" / "rotorid").parts:
        assert "matplotlib" not in set(at_import_time(tree)), "plots imports matplotlib inside functions"
    else:
        assert "matplotlib" not in names


@pytest.mark.parametrize("path", sorted((ROOT / "workflow" / "scripts").glob("*.py")), ids=lambda path: path.stem)
def test_a_script_touches_snakemake_only_when_run_by_it(path: Path) -> None:
    tree = ast.parse(path.read_text())
    outside = [node for node in tree.body if not isinstance(node, ast.If)]
    used = {node.id for part in outside for node in ast.walk(part) if isinstance(node, ast.Name)}
    assert "snakemake" not in used
    assert ast.get_docstring(tree)
    assert not set(imported(tree)) & {"rotorid.acquire", "matplotlib"}


@pytest.mark.parametrize("path", ACQUIRE, ids=lambda path: str(path.relative_to(ROOT)))
def test_acquisition_uses_of_the_library_only_what_it_may(path: Path) -> None:
    used = {name for name in imported(ast.parse(path.read_text())) if name.startswith("rotorid")}
    assert used <= {
        f"rotorid.{part}"
        for part in ("acquire", "io", "vehicle", "errors", "recordings", "names", "text_files", "wording")
    }
