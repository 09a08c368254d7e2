"""Rooms of the library: which may import which, and through which modules (docs/decisions/0009-rooms.md)."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
IN_SRC = ("rotorid", "rotorid_lab", "rotorid_acquire")
HOMES = {**{name: ROOT / "src" for name in IN_SRC}, "rotorid_proof": ROOT / "proof"}
WHOLE = ("rotorid_lab", "rotorid_acquire", "rotorid_proof")
"""Packages that are one room each."""
ORDER = (
    "rotorid.errors", "rotorid.steps", "rotorid.io", "rotorid.recordings", "rotorid.effects", "rotorid.vehicle",
    "rotorid.identify", "rotorid.mismatch", "rotorid.report", "rotorid.plan", "rotorid.api", "rotorid.cli",
    "rotorid_lab", "rotorid_proof",
)  # fmt: skip
"""Lowest first: each imports from those before it alone. `rotorid_acquire` stands aside and uses the lowest two; what
instruments wrote is read by it for the laboratory's chapters."""
ASIDE = {"rotorid_acquire": {"rotorid.errors", "rotorid.io"}}
NEXT_TO = {"rotorid_lab": {"rotorid_acquire"}, "rotorid_proof": {"rotorid_acquire"}}
OUTSIDE = sorted(
    path
    for folder in ("workflow/scripts", "benchmarks", "acquire", "docs/hooks")
    for path in (ROOT / folder).rglob("*.py")
)
"""Code next to the library, held to the façades too. Tests of a room may import what is inside it."""


def dotted(path: Path) -> str:
    """Name of a module of the library or of the proof; empty outside of both."""
    for package, home in HOMES.items():
        if path.is_relative_to(home / package):
            return ".".join(path.relative_to(home).with_suffix("").parts).removesuffix(".__init__")
    return ""


MODULES = {dotted(path): path for package, home in HOMES.items() for path in sorted((home / package).rglob("*.py"))}
IN_ROOMS = {name: path for name, path in MODULES.items() if name not in ("rotorid", "rotorid.__main__")}


def room(name: str) -> str:
    """The room of a module, such as `rotorid.io`; a loose module is a room of its own."""
    return ".".join(name.split(".")[: 1 if name.startswith(WHOLE) else 2])


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def imported(path: Path) -> tuple[str, ...]:
    """Modules of the project that a file imports, wherever the import stands, relative ones made absolute."""
    return tuple(_imported(path))


def _imported(path: Path) -> Iterator[str]:
    name = dotted(path)
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in MODULES)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parts = package.split(".")
                base = ".".join(parts[: len(parts) - node.level + 1] + ([base] if base else []))
            inside = (f"{base}.{alias.name}" for alias in node.names)
            yield from (name if name in MODULES else base for name in inside if name in MODULES or base in MODULES)


@cache
def stated(name: str, what: str) -> tuple[str, ...]:
    """A tuple of names that a package states, `OPEN` or `ROOMS`; empty where it states none."""
    for node in parsed(MODULES[name]).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == what:
            return ast.literal_eval(node.value)
    return ()


def opened(name: str) -> tuple[str, ...]:
    """`OPEN` of a room: the modules that others may import; `plots.*` stands for all of a package."""
    return stated(name, "OPEN")


def past_the_facade(name: str) -> bool:
    """Whether a module is one that only its own room may import."""
    inner = name.removeprefix(room(name)).lstrip(".")
    whole = tuple(door.removesuffix("*") for door in opened(room(name)) if door.endswith(".*"))
    return bool(inner) and inner not in opened(room(name)) and not inner.startswith(whole)


def test_every_package_and_loose_module_has_its_place_in_the_order() -> None:
    assert {room(name) for name in IN_ROOMS} == {*ORDER, *ASIDE}
    rooms = {name for name, path in MODULES.items() if path.name == "__init__.py" and name.count(".") == 1}
    assert len({name for name in rooms if name.startswith("rotorid.")}) <= 10


@pytest.mark.parametrize("name", sorted(IN_ROOMS))
def test_a_room_imports_from_lower_ones_and_by_their_facades_alone(name: str) -> None:
    own = room(name)
    others = {module for module in imported(IN_ROOMS[name]) if room(module) != own and module != "rotorid"}
    below = ASIDE.get(own) or {*ORDER[: ORDER.index(own)], *NEXT_TO.get(own, ())}
    assert {room(module) for module in others} <= below
    assert not {module for module in others if past_the_facade(module)}


MISMATCH = "rotorid.mismatch"
INSIDE = sorted(name for name in MODULES if name.startswith(f"{MISMATCH}."))


def part(name: str) -> str:
    """The sub-room of a module of the mismatch stage."""
    return name.removeprefix(f"{MISMATCH}.").split(".")[0]


def test_every_part_of_the_mismatch_stage_has_its_place_in_the_order() -> None:
    assert sorted(stated(MISMATCH, "ROOMS")) == sorted({part(name) for name in INSIDE})
    packages = {name for name in INSIDE if MODULES[name].name == "__init__.py"}
    assert all(ast.get_docstring(parsed(MODULES[name])) for name in packages)


@pytest.mark.parametrize("name", INSIDE)
def test_a_part_of_the_mismatch_stage_imports_from_lower_ones_alone(name: str) -> None:
    order = stated(MISMATCH, "ROOMS")
    others = {part(module) for module in imported(MODULES[name]) if module in INSIDE} - {part(name)}
    assert others <= set(order[: order.index(part(name))])
    if part(name) in ("flight", "instrument"):
        assert not others & {"flight", "instrument"}, "neither plant knows the other"
    assert MISMATCH not in set(imported(MODULES[name]))


@pytest.mark.parametrize("path", OUTSIDE, ids=lambda path: str(path.relative_to(ROOT)))
def test_code_next_to_the_library_uses_facades_alone(path: Path) -> None:
    assert not {module for module in imported(path) if past_the_facade(module)}


@pytest.mark.parametrize(
    "name", sorted({*ORDER, *ASIDE} & {room for room in MODULES if MODULES[room].name == "__init__.py"})
)
def test_what_a_facade_opens_is_there_and_used_from_outside(name: str) -> None:
    used = {m for other, path in IN_ROOMS.items() if room(other) != name for m in imported(path) if room(m) == name}
    used |= {m for path in OUTSIDE for m in imported(path) if room(m) == name}
    text = "\n".join(
        path.read_text(encoding="utf-8") for kind in ("*.smk", "*.ipynb") for folder in ("workflow", "notebooks")
        for path in (ROOT / folder).rglob(kind)
    )  # fmt: skip
    for door in opened(name):
        full = f"{name}.{door.removesuffix('.*')}"
        assert full in MODULES, f"{name} opens {door}, which is not there"
        parent, _, last = full.rpartition(".")
        elsewhere = full in text or f"from {parent} import" in text and last in text
        assert elsewhere or any(m == full or m.startswith(f"{full}.") for m in used), f"nobody needs {full}"


def at_import_time(tree: ast.Module) -> Iterator[str]:
    """Top-level packages imported when a module is: at its top, not inside functions or `if TYPE_CHECKING`."""
    for node in tree.body:
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module.split(".")[0]


@cache
def anywhere(tree: ast.Module) -> frozenset[str]:
    """Top-level packages that a module imports, wherever the import stands."""
    nodes = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    return frozenset(at_import_time(ast.Module(nodes, [])))


@pytest.mark.parametrize("name", sorted(MODULES))
def test_the_library_knows_neither_workflow_nor_proof_nor_matplotlib(name: str) -> None:
    tree = parsed(MODULES[name])
    names = anywhere(tree)
    if not name.startswith("rotorid_acquire"):
        assert not names & {"snakemake", "serial", "papermill", "workflow", "tests"}
    if not name.startswith("rotorid_proof"):
        assert "rotorid_proof" not in names
    assert "matplotlib" not in set(at_import_time(tree)), "matplotlib is imported inside functions"
    assert "matplotlib" not in names or "plots" in name.split(".")


@pytest.mark.parametrize("path", sorted((ROOT / "workflow" / "scripts").glob("*.py")), ids=lambda path: path.stem)
def test_a_script_touches_snakemake_only_when_run_by_it(path: Path) -> None:
    tree = parsed(path)
    outside = [node for node in tree.body if not isinstance(node, ast.If)]
    used = {node.id for part in outside for node in ast.walk(part) if isinstance(node, ast.Name)}
    assert "snakemake" not in used
    assert ast.get_docstring(tree)
    assert "matplotlib" not in anywhere(tree)
    recorder = {module for module in imported(path) if room(module) == "rotorid_acquire"}
    assert all(module.startswith("rotorid_acquire.io") for module in recorder)
