"""Pages of the site that are not written by hand: results by the rules, commands, effects, the decision, licences.

MkDocs calls the functions named `on_*`. Nothing here is part of an analysis.
"""

from __future__ import annotations

import ast
import html
import re
import sys
import tempfile
import textwrap
from pathlib import Path

import yaml
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
RULE = re.compile(r"^( *)(?:rule|checkpoint) ?(\w*):\n", flags=re.MULTILINE)
RESULT = re.compile(r"\"(results/[^\"]+)\"")


def on_files(files: Files, config) -> Files:
    """Add the pages and pictures that are made of the code, and the measurements kept next to the benchmarks."""
    for name, text in (pages() | signatures()).items():
        files.append(File.generated(config, name, content=text))
    return files


def pages() -> dict[str, str]:
    """To the path of each page that is not in `docs/` its markdown."""
    from rotorid.effects.describe import markdown as effects_page

    sys.path.insert(0, str(Path(__file__).parent))
    from licences import page as licences_page

    made = {
        "results.md": results_page(),
        "commands.md": commands_page(),
        "effects.md": effects_page(),
        "decision-reference.md": decision_page(),
        "licences.md": licences_page(),
    }
    return made | {
        f"benchmarks/{p.name}": p.read_text(encoding="utf-8") for p in sorted((ROOT / "benchmarks").glob("*.md"))
    }


def on_page_markdown(markdown: str, page, config, files) -> str:
    """Links to the benchmarks' pages as the site has them; equations and pictures in the catalogue of effects; the
    formats of logs where `<!-- formats -->` stands."""
    markdown = markdown.replace("](../benchmarks/", "](benchmarks/").replace("<!-- formats -->", formats_table())
    return with_signatures(markdown) if page.file.src_uri == "effects.md" else markdown


# Result files -------------------------------------------------------------------------------------


def rules_of(path: Path) -> list[tuple[str, str, list[str]]]:
    """Rules of a rules file with a script: name, first line of the docstring, and the results they make."""
    text, found = path.read_text(encoding="utf-8"), []
    for match in RULE.finditer(text):
        body = re.match(rf"(?:{match[1]} +.*\n|\n)*", text[match.end() :])[0]
        body = textwrap.indent(textwrap.dedent(body), "    ")
        output = re.search(r"^    output:\n((?:        .*\n)+)", body, flags=re.MULTILINE)
        docstring = re.search(r'"""(.+?)"""', body, flags=re.DOTALL)
        if "script:" in body and output:
            name = match[2] or re.search(r"name:\s+f?\"(\w+)", body)[1]
            found.append((name, " ".join(docstring[1].split()), RESULT.findall(output[1])))
    return found


def results() -> dict[str, list[tuple[str, str, list[str]]]]:
    """To each rules file's name its rules."""
    paths = sorted((ROOT / "workflow" / "rules").glob("*.smk"))
    return {p.stem: rules for p in paths if (rules := rules_of(p))}


def described() -> dict[str, dict[str, str]]:
    """What each result is and holds, by its path with <places>."""
    return yaml.safe_load((ROOT / "workflow" / "results.yaml").read_text(encoding="utf-8"))


def pattern_of(entry: str) -> re.Pattern[str]:
    """The expression that the paths of an entry of `results.yaml` match; wildcards of rules stand as x."""
    parts = re.split(r"(<\w+>|\*)", entry.rstrip("/"))
    return re.compile("".join("[^/]+" if p.startswith("<") or p == "*" else re.escape(p) for p in parts))


def entry_of(output: str, known: dict[str, dict[str, str]]) -> str | None:
    """The entry that describes an output of a rule: the one that spells out most of its path."""
    flat = re.sub(r"\{\w+(?:,[^}]*)?\}", "x", output)
    fitting = [e for e in known if pattern_of(e).fullmatch(flat)]
    return max(fitting, key=lambda e: len(re.sub(r"<\w+>|\*", "", e)), default=None)


def results_page() -> str:
    """The page of result files: a table a stage, from the rules and their descriptions."""
    known, listed = described(), set()
    lines = [
        "# Result files",
        "",
        "Made from the rules. Columns and keys carry their unit in their name or next to it.",
        "",
    ]
    for stage, rules in results().items():
        rows = {}
        for name, _, outputs in rules:
            for output in outputs:
                entry = entry_of(output, known)
                if entry is not None:
                    rows.setdefault(entry, name)
        if not rows:
            continue
        lines += [
            f"## {stage.replace('_', ' ').capitalize()}",
            "",
            "| file | what | columns or keys | rule |",
            "| --- | --- | --- | --- |",
        ]
        for entry, rule in rows.items():
            own = known[entry]
            lines.append(f"| `{entry}` | {own['what']} | {own.get('holds', '')} | `{rule}` |")
        lines.append("")
        listed |= set(rows)
    lines += [
        "## Made under names that the index and the public recordings give",
        "",
        "| file | what | columns or keys |",
        "| --- | --- | --- |",
    ]
    lines += [f"| `{e}` | {own['what']} | {own.get('holds', '')} |" for e, own in known.items() if e not in listed]
    lines += [
        "",
        "`results/logs/<rule>/` holds the log of each job with its traceback, `results/notebooks/` the executed",
        "notebooks with their figures and tables.",
        "",
    ]
    return "\n".join(lines)


# Commands -----------------------------------------------------------------------------------------


def commands_page() -> str:
    """The page of commands: what `--help` says of each."""
    import typer

    from rotorid.cli import app

    group = typer.main.get_command(app)
    completion = "`rotorid --install-completion` completes names in your shell."
    lines = ["# Commands", "", f"What `rotorid COMMAND --help` says. {completion}", ""]
    for name, command in group.commands.items():
        text = textwrap.dedent(command.help or "")
        lines += [f"## rotorid {name}", "", text, "", "| option | what |", "| --- | --- |"]
        for parameter in (p for p in command.params if p.name != "help"):
            option = parameter.param_type_name == "option"
            bare = parameter.metavar or parameter.name.upper()
            shown = ", ".join(f"`{o}`" for o in parameter.opts) if option else f"`{bare}`"
            meaning = " ".join((getattr(parameter, "help", "") or "").split()).replace("|", "\\|")
            lines.append(f"| {shown} | {meaning} |")
        lines.append("")
    return "\n".join(lines)


# Formats of logs ----------------------------------------------------------------------------------


def formats_table() -> str:
    """A line for each importer: what it reads, and how a log is recognised."""
    from rotorid.recordings.importers.logfile import importers

    lines = ["| log | how it is recognised | what is read |", "| --- | --- | --- |"]
    return "\n".join([*lines, *(f"| {i.title} | {i.known_by} | {i.holds} |" for i in importers().values())])


# The decision -------------------------------------------------------------------------------------

DECISION = """# Reference of the decision

This page is made of the code of `rotorid.mismatch` and lists what [how it decides](mismatch.md) leaves out; terms are
explained there. A number that one formula alone uses stands next to it in the code, with its reason.

## Rules

A rule decides where the comparison of two models by their fit cannot. It can be switched off
(`snakemake --config 'rules={"off": ["cancels"]}'`); `ledger.json` counts how often each one decided something.
"""


def decision_page() -> str:
    """The page of the decision: its rules with their limits, its modules and its constants."""
    from rotorid.mismatch import ROOMS
    from rotorid.mismatch.decide.rules import markdown

    lines = [DECISION, markdown(), "## Modules and constants", ""]
    lines += ["Rooms in their order: each uses those above it.", ""]
    for room in ROOMS:
        lines += [f"### {room}", "", "| module | what it does |", "| --- | --- |"]
        found = modules_of(room)
        for name, source in found.items():
            first = ast.get_docstring(ast.parse(source)).split("\n\n")[0]
            lines.append(f"| `{name}` | {cell(first)} |")
        constants = [(name, *one) for name, source in found.items() for one in constants_of(source)]
        if constants:
            lines += ["", "| constant | value | meaning |", "| --- | --- | --- |"]
            lines += [f"| `{name}.{constant}` | {value:g} | {cell(why)} |" for name, constant, value, why in constants]
        lines.append("")
    return "\n".join(lines)


def modules_of(room: str) -> dict[str, str]:
    """To the name of each module of a room of the mismatch stage, as below `rotorid.mismatch`, its source."""
    home = ROOT / "src" / "rotorid" / "mismatch"
    paths = [home / f"{room}.py"] if (home / f"{room}.py").is_file() else sorted((home / room).rglob("*.py"))
    names = {p: ".".join(p.relative_to(home).with_suffix("").parts).removesuffix(".__init__") for p in paths}
    return {name: path.read_text(encoding="utf-8") for path, name in names.items()}


def constants_of(source: str) -> list[tuple[str, float, str]]:
    """Numbers of a module that say what they are: name, value, meaning.

    At the top of the module by a docstring; in a function, `function.name`, by a comment behind or above them.
    """
    tree, lines, found = ast.parse(source), source.splitlines(), []
    for line, after in zip(tree.body, tree.body[1:], strict=False):
        name, value = number_of(line)
        why = getattr(getattr(after, "value", None), "value", None)
        if name.isupper() and isinstance(after, ast.Expr) and isinstance(why, str):
            found.append((name, value, why))
    owners = [tree, *(n for n in tree.body if isinstance(n, ast.ClassDef))]
    for function in (n for owner in owners for n in owner.body if isinstance(n, ast.FunctionDef)):
        for line in ast.walk(function):
            name, value = number_of(line)
            why = comment_of(lines, line) if name else ""
            if why:
                found.append((f"{function.name}.{name}", value, why))
    return found


def number_of(line: ast.AST) -> tuple[str, float]:
    """Name and value of a number that a line of code gives a name to; no name for any other line."""
    value = getattr(getattr(line, "value", None), "value", None)
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if isinstance(line, ast.Assign) and len(line.targets) == 1 and isinstance(line.targets[0], ast.Name) and number:
        return line.targets[0].id, value
    return "", 0.0


def comment_of(lines: list[str], line: ast.AST) -> str:
    """The comment behind a line of code, or the lines of comment above it."""
    _, sign, behind = lines[line.end_lineno - 1][line.end_col_offset :].partition("#")
    first = line.lineno - 1
    while not sign and lines[first - 1].lstrip().startswith("#"):
        first -= 1
    return behind.strip() or " ".join(part.strip().lstrip("# ") for part in lines[first : line.lineno - 1])


def cell(text: str) -> str:
    """A text as a cell of a table."""
    return " ".join(text.split()).replace("|", "\\|")


# Effects ------------------------------------------------------------------------------------------


def signatures() -> dict[str, str]:
    """To the path of each effect's picture its SVG, drawn from the effect's own equations."""
    from rotorid.effects.catalogue import catalogue
    from rotorid.report.plots import style
    from rotorid_lab.plots.signature import signature, signature_figure

    found = {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.svg"
        for name, effect in catalogue().items():
            shown = signature(effect)
            if shown is not None:
                style.save(signature_figure(shown), path)
                found[f"effects/{name}.svg"] = path.read_text(encoding="utf-8")
                CAPTIONS[name] = caption(shown)
    return found


CAPTIONS: dict[str, str] = {}


def caption(shown) -> str:
    """What is in the picture: the form and its values."""
    values = ", ".join(f"{subscripts(s)} = {v:.3g} {html.escape(u)}".strip() for s, v, u in shown.values)
    return f"Form “{html.escape(shown.form)}”: {equation(shown.equation)}{' with ' + values if values else ''}."


def subscripts(text: str) -> str:
    """`k_d,x` with what follows the underscore set low."""
    return re.sub(r"_([A-Za-z0-9⊥∥,]+)(?<!,)", r"<sub>\1</sub>", html.escape(text, quote=False))


def equation(text: str) -> str:
    """An equation of the catalogue, typeset."""
    raised = re.sub(r"\^(\(.+?\)|[\w.+−-]+)", r"<sup>\1</sup>", subscripts(text))
    return f'<span class="equation">{raised}</span>'


def with_signatures(markdown: str) -> str:
    """The catalogue's page with equations typeset and a picture below each heading."""
    out = []
    for line in markdown.splitlines():
        heading = re.match(r"### `(\w+)`", line)
        row = re.match(r"\| (?!form |---)([^|]+) \| ([^|]+) \|(.*)$", line)
        if row:
            # Stars in names of columns are no emphasis.
            line = f"| {row[1]} | {equation(row[2])} |{row[3]}".replace("*", r"\*")
        out.append(line)
        if heading and heading[1] in CAPTIONS:
            name = heading[1]
            out += ["", f"![How {name.replace('_', ' ')} shows](effects/{name}.svg)", "", f"*{CAPTIONS[name]}*"]
    return "\n".join(out) + "\n"
