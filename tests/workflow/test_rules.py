"""What every rule must have, read from the rule files; and what every chapter must."""

import ast
import json
import re
import textwrap
from pathlib import Path

import nbformat
import papermill
import pytest
import yaml

from tests.hooks import hook

ROOT = Path(__file__).parents[2]
FILES = [ROOT / "Snakefile", *sorted((ROOT / "workflow" / "rules").glob("*.smk"))]


def rules() -> dict[str, str]:
    """Text of each rule by its name; a rule made in a loop goes by the start of its name."""
    found = {}
    for path in FILES:
        opening = re.compile(r"^( *)(?:rule|checkpoint) ?(\w*):\n", flags=re.MULTILINE)
        text = path.read_text()
        for match in opening.finditer(text):
            body = re.match(rf"(?:{match[1]} +.*\n|\n)*", text[match.end() :])[0]
            body = textwrap.indent(textwrap.dedent(body), "    ")
            name = match[2] or re.search(r"name:\s+f?\"(\w+)", body)[1]
            found[name] = body
    return found


SITE = hook("site")
DESCRIBED = SITE.described()
RULES = rules()
WORKING = {name: text for name, text in RULES.items() if "script:" in text}
CHAPTERS = yaml.safe_load((ROOT / "config.yaml").read_text())["report"]["chapters"]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))


def test_the_rules_are_found() -> None:
    assert {"render_chapter", "typeset_pdf", "report", "all"} <= set(RULES)


@pytest.mark.parametrize("name", RULES)
def test_a_rule_only_runs_scripts(name: str) -> None:
    """The code hash sees scripts and the library; code inside a rule it could not see."""
    text = RULES[name]
    assert not re.search(r"^\s+(run|shell|notebook):", text, flags=re.MULTILINE)
    assert "lambda" not in text
    assert '"""' in text, "a rule opens with a docstring"


@pytest.mark.parametrize("name", WORKING)
def test_a_rule_with_a_script_has_log_message_and_the_code_of_that_script(name: str) -> None:
    text = WORKING[name]
    assert "log:" in text and "message:" in text
    script = re.search(r'script:\s+"\.\./scripts/(\w+)\.py"', text)
    assert script, "scripts live in workflow/scripts"
    assert (ROOT / "workflow" / "scripts" / f"{script[1]}.py").is_file()
    if script[1] == "run_notebook":
        chapter = name.removeprefix("chapter_")
        assert f'code=code_of_chapter("{chapter}")' in text
        assert f'notebook="notebooks/{chapter}.ipynb"' in text
    else:
        assert f'code=code_of("{script[1]}")' in text


@pytest.mark.parametrize("name", WORKING)
def test_only_provenance_takes_the_whole_configuration(name: str) -> None:
    assert bool(re.search(r"=\s*(config|CONFIG)\s*,", WORKING[name])) == (name == "record_provenance")


@pytest.mark.parametrize("name", WORKING)
def test_every_result_is_described(name: str) -> None:
    block = re.search(r"^    output:\n((?:        .*\n)+)", WORKING[name], flags=re.MULTILINE)
    assert block, "every rule makes something"
    for output in re.findall(r'"(results/[^"]+)"', block[1]):
        assert SITE.entry_of(output, DESCRIBED), f"workflow/results.yaml does not describe {output}"


def test_nothing_is_described_that_no_rule_makes_and_the_page_lists_all() -> None:
    made = {
        SITE.entry_of(o, DESCRIBED) for rules in SITE.results().values() for _, _, outputs in rules for o in outputs
    }
    page = SITE.results_page()
    assert [entry for entry in DESCRIBED if entry not in made and f"`{entry}`" not in page] == []


def test_every_page_of_the_site_is_kept_or_made_and_none_is_both() -> None:
    listed = set(re.findall(r"[\w/-]+\.md", (ROOT / "mkdocs.yml").read_text().split("\nnav:")[1]))
    kept = {str(p.relative_to(ROOT / "docs")) for p in (ROOT / "docs").rglob("*.md")}
    made = SITE.pages()
    assert {"commands.md", "effects.md", "decision-reference.md", "licences.md", "results.md"} <= set(made)
    assert not kept & set(made) and kept <= listed <= kept | set(made)


def test_every_script_belongs_to_a_rule() -> None:
    used = set(re.findall(r"\.\./scripts/(\w+)\.py", "".join(RULES.values())))
    assert {path.stem for path in (ROOT / "workflow" / "scripts").glob("*.py")} == used


@pytest.mark.parametrize("name", CHAPTERS)
def test_a_chapter_has_its_text_and_a_heading_to_refer_to(name: str) -> None:
    first = (ROOT / "notebooks" / f"{name}.md").read_text().splitlines()[0]
    assert re.fullmatch(r"# .+ \{#sec:[\w-]+( \.unnumbered)?\}", first)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_stripped_has_parameters_and_computes_nothing(path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert all(not cell.outputs and cell.execution_count is None for cell in code)
    assert papermill.inspect_notebook(str(path)), "a cell tagged parameters sets what the rule passes"
    text = "\n".join(cell.source for cell in code)
    assert not re.search(r"^\s*(import|from) (scipy|sklearn|matplotlib)", text, flags=re.MULTILINE)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_what_a_notebook_takes_from_the_library_is_there(path: Path) -> None:
    """A module that moved was missed only when the whole report was made."""
    code = (cell.source for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "code")
    tree = ast.parse("\n".join(code))
    known = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module.startswith("rotorid"):
            for name in node.names:
                exec(f"from {node.module} import {name.name} as {name.asname or name.name}", known)
    used = [node for node in ast.walk(tree) if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)]
    taken = [(known[n.value.id], n) for n in used if n.value.id in known]
    assert taken and [f"{n.value.id}.{n.attr}" for module, n in taken if not hasattr(module, n.attr)] == []


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebooks_kernel_is_the_environments_own(path: Path) -> None:
    assert json.loads(path.read_text())["metadata"]["kernelspec"]["name"] == "python3"


def test_a_chapter_that_shows_something_has_a_notebook_whose_cells_show_it() -> None:
    shown = r"\{\{ (?:figure|table)\("
    showing = {name for name in CHAPTERS if re.search(shown, (ROOT / "notebooks" / f"{name}.md").read_text())}
    assert showing - {"abstract"} == {path.stem for path in NOTEBOOKS}
    for path in NOTEBOOKS:
        cells = nbformat.read(path, as_version=4).cells
        assert "style.save(" not in path.read_text() and ".to_csv(" not in path.read_text()
        for before, cell in zip(cells, cells[1:], strict=False):
            if "style.show(" in cell.source:
                sentences = re.findall(r"[.:?](?:\s|$)", re.sub(r"^#.*$", "", before.source, flags=re.MULTILINE))
                assert before.cell_type == "markdown" and len(sentences) >= 2, (path.stem, cell.source)
