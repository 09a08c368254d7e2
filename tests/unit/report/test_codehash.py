"""The code hash reacts to what runs and to nothing else."""

import json
import os
from pathlib import Path

import pytest

from rotorid.report.provenance import Code

FILES = {
    "src/rotorid/__init__.py": "",
    "src/rotorid/fit.py": '"""Fit."""\nfrom rotorid.constants import G\n\ndef fit(x):\n    return x * G\n',
    "src/rotorid/constants.py": "G = 9.81\n",
    "src/rotorid/lazy.py": "def draw():\n    from rotorid.plots import style\n    return style.SIZE\n",
    "src/rotorid/plots/__init__.py": "",
    "src/rotorid/plots/style.py": "SIZE = 3\n",
    "src/rotorid/effects/__init__.py": "import pkgutil\n",
    "src/rotorid/effects/drag.py": "D = 1\n",
    "src/rotorid/effects/lag.py": "from .drag import D\n",
    "src/rotorid/other.py": "X = 1\n",
    "workflow/scripts/fit.py": "from rotorid import fit\n\ndef main(x):\n    return fit.fit(x)\n",
    "workflow/scripts/draw.py": "import rotorid.lazy\n",
    "workflow/scripts/choose.py": "from rotorid.effects import chosen\n",
    "workflow/scripts/late.py": "import importlib\nimportlib.import_module('rotorid.other')\n",
}


@pytest.fixture
def project(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path


def edit(project: Path, name: str, old: str, new: str) -> None:
    path = project / name
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def hashes(project: Path) -> dict[str, str]:
    code = Code(project)
    return {name: code.of(f"workflow/scripts/{name}.py") for name in ("fit", "draw", "choose", "late")}


def changed(project: Path, name: str, old: str, new: str) -> set[str]:
    before = hashes(project)
    edit(project, name, old, new)
    after = hashes(project)
    return {script for script in before if before[script] != after[script]}


EFFECTS = "src/rotorid/effects/__init__.py"
EDITS = {
    "a constant two imports away": ("src/rotorid/constants.py", "9.81", "9.82", {"fit"}),
    "a comment at the end of a line": ("src/rotorid/constants.py", "G = 9.81", "G = 9.81  # gravity", set()),
    "another docstring and layout": ("src/rotorid/fit.py", '"""Fit."""', '"""Fit a line."""\n\n', set()),
    "a comment before a function": ("workflow/scripts/fit.py", "def main", "# here\ndef main", set()),
    "a docstring where there was none": ("src/rotorid/fit.py", "(x):\n", '(x):\n    """Say what."""\n', set()),
    "the modules that others may import": (EFFECTS, "import", 'OPEN = ("drag",)\nROOMS = ("a", "b")\nimport', set()),
    "another constant of a package": (EFFECTS, "import", "CLOSED = ()\nimport", {"choose"}),
    "an import inside a function": ("src/rotorid/plots/style.py", "3", "4", {"draw"}),
    "a module of a package that looks up its modules": ("src/rotorid/effects/drag.py", "1", "2", {"choose"}),
    "a module imported by a constant name": ("src/rotorid/other.py", "1", "2", {"late"}),
}
"""What is edited: file, old and new text, and the scripts for which that counts."""


@pytest.mark.parametrize("what", EDITS)
def test_what_runs_counts_and_nothing_else_does(project: Path, what: str) -> None:
    *edited, counts_for = EDITS[what]
    assert changed(project, *edited) == counts_for


def test_a_second_package_of_the_project_is_followed(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rotorid.report.provenance._PACKAGES", {"rotorid": "src", "second": "beside"})
    texts = {"__init__": "", "one": "from .two import X", "two": "from rotorid.constants import G as X"}
    (project / "beside/second").mkdir(parents=True)
    for name, text in texts.items():
        (project / f"beside/second/{name}.py").write_text(text)
    script = project / "workflow/scripts/second.py"
    script.write_text("from second.one import X\n")
    reached = [str(path.relative_to(project)) for path in Code(project).reached_modules(script)]
    assert [name for name in reached if name.startswith("beside")] == [f"beside/second/{n}.py" for n in texts]
    assert "src/rotorid/constants.py" in reached


def test_a_new_module_of_a_package_that_looks_up_its_modules_counts(project: Path) -> None:
    before = hashes(project)
    (project / "src/rotorid/effects/sag.py").write_text("S = 1\n")
    assert {name for name, value in hashes(project).items() if value != before[name]} == {"choose"}


def test_a_relative_import_is_followed(project: Path) -> None:
    script = project / "workflow/scripts/relative.py"
    script.write_text("import rotorid.effects.lag\n")
    names = [path.name for path in Code(project).reached_modules(script)]
    assert names.count("drag.py") == 1


def test_a_notebooks_code_cells_count_and_its_text_does_not(project: Path) -> None:
    notebook = project / "notebooks/fit.ipynb"
    notebook.parent.mkdir()
    text = {"cell_type": "markdown", "source": ["# TEXT"]}
    code = {"cell_type": "code", "source": ["import rotorid.fit"]}
    notebook.write_text(json.dumps({"cells": [text, code]}))
    before = Code(project).of("notebooks/fit.ipynb")
    edit(project, "notebooks/fit.ipynb", "TEXT", "Other text")
    assert Code(project).of("notebooks/fit.ipynb") == before
    edit(project, "src/rotorid/constants.py", "9.81", "9.82")
    assert Code(project).of("notebooks/fit.ipynb") != before


def test_a_script_that_is_not_there_is_named(project: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"there is no file .*nowhere\.py"):
        Code(project).of("workflow/scripts/nowhere.py")


def test_a_memory_changes_no_answer_and_sees_every_edit(project: Path, tmp_path: Path) -> None:
    memory = tmp_path / "kept" / "code.json"
    code = Code(project, memory)
    first = code.of("workflow/scripts/fit.py")
    code.remember()
    assert first == Code(project).of("workflow/scripts/fit.py")
    assert Code(project, memory).of("workflow/scripts/fit.py") == first
    edit(project, "src/rotorid/constants.py", "9.81", "9.82")
    assert Code(project, memory).of("workflow/scripts/fit.py") == Code(project).of("workflow/scripts/fit.py")
    assert Code(project, memory).of("workflow/scripts/fit.py") != first


def test_a_memory_is_what_answers(project: Path, tmp_path: Path) -> None:
    memory = tmp_path / "code.json"
    code = Code(project, memory)
    first = code.of("workflow/scripts/fit.py")
    code.remember()
    # Same size, same time of change, other content: only a memory can still give the first answer.
    path = project / "src/rotorid/constants.py"
    stat = path.stat()
    path.write_text("G = 9.99\n")
    os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    assert Code(project, memory).of("workflow/scripts/fit.py") == first


def test_a_spoilt_memory_is_made_anew(project: Path, tmp_path: Path) -> None:
    memory = tmp_path / "code.json"
    memory.write_text('{"files": ')
    code = Code(project, memory)
    assert code.of("workflow/scripts/fit.py") == Code(project).of("workflow/scripts/fit.py")
    code.remember()
    assert json.loads(memory.read_text())["files"]


def test_a_file_shipped_beside_a_module_that_reads_such_files_counts(project: Path) -> None:
    reader = project / "src/rotorid/page/__init__.py"
    reader.parent.mkdir()
    reader.write_text("from importlib.resources import files\n")
    style = project / "src/rotorid/page/files/page.css"
    style.parent.mkdir()
    style.write_text("a")
    (project / "workflow/scripts/show.py").write_text("import rotorid.page\n")
    before, other = Code(project).of("workflow/scripts/show.py"), Code(project).of("workflow/scripts/fit.py")
    style.write_text("b")
    assert Code(project).of("workflow/scripts/show.py") != before
    assert Code(project).of("workflow/scripts/fit.py") == other
