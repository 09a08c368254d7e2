"""The report: its chapters' text by Jinja2 over pandoc markdown, and its two files by pandoc and typst, from wheels.

Every number is read from a result file. A chapter's files are known in its text by the names that its rule gives them.
A `.json` file is the object in it, a `.csv` file the list of its rows, a figure is placed with
`figure("name", "caption", kind="...")` and a table with `table("name", "caption", columns, kind="...")`; the kind says
what it is made of, one of `_MADE_OF`. A name that no file gives is an error, so no number goes missing quietly.
"""

from __future__ import annotations

import csv
import json
import math
import re
import subprocess
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2

from rotorid.errors import InputError

_FIGURES = {".svg", ".png"}
_MADE_OF = {
    "campaign": "Recorded on the instruments.",
    "emulated": "Emulated instruments.",
    "simulated": "Simulated.",
    "public": "Real recordings of other laboratories.",
    "thesis": "Real, printed in the thesis.",
    "stated": "Stated in the thesis.",
    "mixed": "Real and simulated recordings.",
    "thesis_computed": "Computed, and from tables printed in the thesis.",
    "campaign_simulated": "Recorded on the instruments, and simulated.",
    "emulated_simulated": "Emulated instruments, and simulated.",
    "drawn": "Drawn after the thesis.",
    "scheme": "",
}
"""What a figure or table is made of, as its caption says first."""
_SIGNS = re.compile(r"""[\\`*_{}\[\]<>#|$^~@&'"]|(?<=-)-|(?<=\.)\.""")
"""What markdown reads as its own, with what pandoc would set as dashes, dots, quotation marks and entities."""
_WIDEST = 40
"""A column longer than this many characters gets no more room in a table."""
# Raw TeX and HTML stay out, since only one of the two outputs would show them.
_MARKDOWN = "markdown-raw_tex-raw_html+table_attributes"


@dataclass(frozen=True)
class Document:
    """What a report is made from."""

    chapters: Sequence[str | Path]
    """Rendered markdown, in reading order; paths of images relative to the current folder."""
    title: str
    subtitle: str
    """Text of the title page."""
    parts: str | Path
    """Folder with `report.typ`, `report.html`, `report.css`, `crossref.lua` and `references.bib`."""
    left_out: Sequence[str] = ()
    """Names of chapters that are not in this report: a reference into one of them says so."""
    notice: str = ""
    """What the title page says of the data."""
    origin: str = ""
    """Commit, date and code, for the title page."""
    project: str = ""
    """Project and authors, for the title page."""


def typst_source(document: Document, out: str | Path, later: Mapping[str, int] | None = None) -> None:
    """A document to typst source; `later` says by how many steps a figure or table (by its identifier) stands later
    than in its chapter's text."""
    options = ["--to=typst", f"--template={Path(document.parts) / 'report.typ'}", f"--output={out}"]
    options.append("--metadata=later:" + ",".join(f"{name}={steps}" for name, steps in (later or {}).items()))
    _pandoc(document, options)


MOST_EMPTY_PT = 70.0
"""A tenth of a page's text: a larger gap is filled with the text that follows, where some does."""
_MOST_STEPS = 4
"""A figure stands no further from its place than this many paragraphs."""
_ROUNDS = 12


def without_gaps(document: Document, out: str | Path) -> None:
    """`typst_source` with figures and tables put some paragraphs later where a page would end half empty.

    Each chapter begins a page of its own, so that one figure of each is tried in every round; what fills most stays.
    """
    later: dict[str, int] = {}
    written: dict[str, int] | None = None
    found: list[tuple[str, int, float, bool]] = []
    seen: dict[str, dict[int, float]] = {}
    settled: set[str] = set()
    for _ in range(_ROUNDS):
        moved = {name: steps for name, steps in later.items() if steps}
        if moved != written:
            typst_source(document, out, moved)
            written, found = moved, gaps(out)
        tried: set[int] = set()
        for name, chapter, height_pt, movable in found:
            steps = later.get(name, 0)
            if name in settled or chapter in tried:
                continue
            seen.setdefault(name, {})[steps] = height_pt
            if height_pt <= MOST_EMPTY_PT:
                settled |= {name} if steps else set()
                continue
            tried.add(chapter)
            if movable and steps < _MOST_STEPS:
                later[name] = steps + 1
            else:
                later[name] = min(seen[name], key=lambda k: (seen[name][k], k))
                settled.add(name)
        if not tried:
            return
    typst_source(document, out, later)


def gaps(source: str | Path) -> list[tuple[str, int, float, bool]]:
    """The gap before each figure and table that follows text, in reading order, from a typst source's own marks.

    Its identifier, its chapter (from 1, those without a number included), the height in pt of the empty space at the
    foot of the page since it did not fit there (0 where it follows its text on the same page), and whether whole
    sentences follow that could stand before it.
    """
    import typst

    try:
        found = typst.query(str(source), "<places>", field="value", one=True, root=".", ignore_system_fonts=True)
    except typst.TypstError as error:
        raise InputError(f"{source}: typst says: {error}") from None
    places = json.loads(found)
    page_of = dict(places["shown"])
    return [
        (name, chapter, places["bottom"] - below_pt if page_of[name] > page else 0.0, movable)
        for (name, movable, chapter), page, below_pt in places["text"]
    ]


def pdf(source: str | Path, out: str | Path) -> None:
    """Typst source to PDF, with typst's own fonts only, and dated nowhere so that it is byte-stable.

    Raises InputError where typst refuses it, and where pages do not settle: numbers of pages would be wrong then.
    """
    import typst

    try:
        _, warnings = typst.compile_with_warnings(
            str(source), output=str(out), root=".", ignore_system_fonts=True, timestamp=0, pdf_standards=[]
        )
    except typst.TypstError as error:
        raise InputError(f"{source}: typst says: {error}") from None
    unsettled = [w.message for w in warnings if "did not converge" in w.message]
    if unsettled:
        raise InputError(f"{source}: typst says: {unsettled[0]}")


def html(document: Document, out: str | Path) -> None:
    """A document to one HTML file that holds its figures, style and equations (MathML)."""
    parts = Path(document.parts)
    options = ["--to=html5", "--standalone", "--embed-resources", "--mathml", "--toc", "--toc-depth=2"]
    options += ["--number-sections", f"--template={parts / 'report.html'}", f"--css={parts / 'report.css'}"]
    _pandoc(document, [*options, f"--output={out}"])


def _pandoc(document: Document, options: Sequence[str]) -> None:
    import pypandoc

    parts = Path(document.parts)
    command = [
        pypandoc.get_pandoc_path(),
        f"--from={_MARKDOWN}",
        *(str(chapter) for chapter in document.chapters),
        "--fail-if-warnings",
        "--columns=10000",  # or tables with long lines would get columns of equal width
        f"--lua-filter={parts / 'crossref.lua'}",
        "--citeproc",
        f"--bibliography={parts / 'references.bib'}",
        f"--metadata=title:{document.title}",
        f"--metadata=subtitle:{document.subtitle}",
        "--metadata=lang:en",
        "--metadata=link-citations:true",
        "--metadata=left-out:" + ",".join(name.replace("_", "-") for name in document.left_out),
        f"--metadata=notice:{document.notice}",
        f"--metadata=origin:{document.origin}",
        f"--metadata=project:{document.project}",
        "--metadata=reference-section-title:References",
        *options,
    ]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise InputError(f"report: pandoc says: {done.stderr.strip()}")


def render(path: str | Path, files: Mapping[str, str], emulated: bool = False) -> str:
    """The chapter's markdown with numbers, figures and tables in place.

    `path`: the chapter's text, `notebooks/<chapter>.md`. `files`: paths by the names under which the text knows them.
    `emulated`: whether emulators wrote the instruments' recordings; the text knows it by this name, and captions of
    kind `campaign` say it. Raises InputError: the text names what no file gives, or is not valid Jinja2.
    """
    path = Path(path)
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined,
        # Pandoc writes identifiers as {#name}, which Jinja2 would read as a comment.
        comment_start_string="<#",
        comment_end_string="#>",
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters.update({form.__name__: _defined(form) for form in (fix, sci, interval, text, percent)})
    known: dict[str, Any] = {name: _read(Path(file)) for name, file in files.items()}

    def captioned(caption: str, kind: str) -> str:
        if kind not in _MADE_OF:
            raise InputError(f"{path}: a figure or table is made of {', '.join(_MADE_OF)}, not {kind!r}.")
        made_of = _MADE_OF[kind.replace("campaign", "emulated") if emulated else kind]
        return f"*{made_of}* {caption}" if made_of else caption

    def figure(name: str, caption: str, kind: str, width: str = "100%", moving: str = "") -> str:
        for shown in filter(None, (name, moving)):
            if shown not in files or Path(files[shown]).suffix not in _FIGURES:
                raise InputError(f"{path}: there is no figure called {shown}.")
        label = f"fig:{path.stem}-{name}".replace("_", "-")
        on_page = f' moving="{files[moving]}"' if moving else ""
        return f"![{captioned(caption, kind)}]({files[name]}){{#{label} width={width}{on_page}}}"

    def table(
        name: str, caption: str, columns: Sequence[Sequence[str]], kind: str, rows: Sequence[Mapping] | None = None
    ) -> str:
        whole = known.get(name)
        if not isinstance(whole, list):
            raise InputError(f"{path}: there is no table called {name}.")
        label = f"tbl:{path.stem}-{name}".replace("_", "-")
        try:
            return table_of(whole if rows is None else rows, captioned(caption, kind), columns, label)
        except KeyError as missing:
            raise InputError(f"{path}: the table {name} has no column {missing}.") from None

    try:
        template = environment.from_string(path.read_text(encoding="utf-8"))
        return _standing_alone(template.render(**known, figure=figure, table=table, emulated=emulated), path)
    except jinja2.TemplateSyntaxError as error:
        raise InputError(f"{path}, line {error.lineno}: {error.message}.") from None
    except InputError:
        raise
    except (jinja2.UndefinedError, TypeError, ValueError) as error:
        raise InputError(f"{path}, line {_line_of(error)}: {error}.") from None


def _standing_alone(markdown: str, path: Path) -> str:
    """The markdown, if each figure is a paragraph of its own; inside of another it would have no number."""
    lines = ["", *markdown.splitlines(), ""]
    for before, line, after in zip(lines, lines[1:], lines[2:], strict=False):
        if line.startswith("![") and (before.strip() or after.strip()):
            name = line[line.rfind("{#") + 2 :].split()[0].rstrip("}")
            raise InputError(
                f"{path}: the figure {name} stands inside a paragraph; it needs an empty line on both sides."
            )
    return markdown


def not_recorded(path: str | Path, kinds: Sequence[str], index: str) -> str:
    """A chapter that cannot be made: its heading, and of which kinds of recordings the index lists too few."""
    heading = Path(path).read_text(encoding="utf-8").splitlines()[0]
    named = " and ".join(filter(None, (", ".join(kinds[:-1]), kinds[-1])))
    return f"{heading}\n\nThis chapter needs {named} recordings, and `{index}` lists none or too few.\n"


def _defined(form: Callable[..., str]) -> Callable[..., str]:
    """`form`, but naming the value where it is undefined."""

    def checked(value: Any, *rest: Any) -> str:
        if isinstance(value, jinja2.Undefined):
            str(value)  # raises Jinja2's own error, with the name
        return form(value, *rest)

    return checked


def _line_of(error: BaseException) -> int | str:
    """Line of the text where rendering stopped, from the traceback (Jinja2 keeps the text's own lines)."""
    line: int | str = "?"
    trace = error.__traceback__
    while trace:
        if trace.tb_frame.f_code.co_filename == "<template>":
            line = trace.tb_lineno
        trace = trace.tb_next
    return line


def _read(path: Path) -> Any:
    if path.suffix == ".json":
        return json.loads(path.read_text(encoding="utf-8"))
    if path.suffix == ".csv":
        with path.open(newline="", encoding="utf-8") as lines:
            return [{key: _value(cell) for key, cell in row.items()} for row in csv.DictReader(lines)]
    return str(path)


def _value(cell: str) -> float | str | None:
    """A cell as a number where it is one, nothing where it is empty."""
    if cell == "":
        return None
    try:
        return float(cell)
    except ValueError:
        return cell


def table_of(rows: Sequence[Mapping[str, Any]], caption: str, columns: Sequence[Sequence[str]], label: str) -> str:
    """A pandoc pipe table, with its caption (markdown) and its `label` for references.

    `columns`: `(key, heading)` or `(key, heading, form)`; `form` is `text`, `name` and `unit` (text that stays on one
    line; of a unit with its powers raised), `code` (an identifier), `place` (a label: its number with a link, and in
    print its page), `symbol` (`J_xx` set as mathematics), `fixN`, `sciN` or `percentN` with N decimals, or `sigN` with
    N significant digits.
    """
    headings = [column[1] for column in columns]
    forms = [column[2] if len(column) > 2 else "text" for column in columns]
    cells = [[_formatted(row[column[0]], form) for column, form in zip(columns, forms, strict=True)] for row in rows]
    # Where a table is too wide for one line a cell, pandoc takes the columns' shares from these dashes.
    longest_words = [max(map(len, heading.split())) for heading in headings]
    widths = [
        max(3, word, *(min(len(line[place]), _WIDEST) for line in cells)) for place, word in enumerate(longest_words)
    ]
    # A row that would not fit on a line: the columns need shares of it.
    too_wide = sum(whole for _, whole in _columns_pt(headings, cells)) > LINE_PT
    attributes = f" widths={_shares_of(headings, cells)}" if too_wide else ""
    rules = [
        ":" + "-" * width if form in _WORDS else "-" * width + ":" for width, form in zip(widths, forms, strict=True)
    ]
    lines = [_row(headings), _row(rules), *(_row(line) for line in cells)]
    return "\n".join(lines) + f"\n\n: {caption} {{#{label}{attributes}}}\n"


_WORDS = ("text", "name", "unit", "symbol", "code", "place")
"""Forms of columns that are set from the left."""
LINE_PT = 453.0
"""Width of the page's text, pt."""
LETTER_PT, _BOLD_PT, _GAP_PT = 4.5, 5.0, 12.0
"""Width of a letter in a table, of one in its bold heading, and space between columns, pt; about."""
_MOST_LETTERS = 100
"""Text longer than this many letters gets no larger share of a wide table."""


def _columns_pt(
    headings: Sequence[str], cells: Sequence[Sequence[str]], widest: float = math.inf
) -> list[tuple[float, float]]:
    """Of each column the width of its longest word and of its longest entry (or of `widest` letters), pt."""
    out = []
    for heading, *column in zip(headings, *cells, strict=True):
        heading, column = _seen(heading), [_seen(entry) for entry in column]
        words = [_BOLD_PT * len(word) for word in heading.split()]
        words += [LETTER_PT * len(word) for entry in column for word in re.split("[ -]", entry)]
        entries = [_BOLD_PT * max((len(word) for word in heading.split()), default=0)]
        entries += [LETTER_PT * min(len(entry), widest) for entry in column]
        out.append((max(words, default=0.0) + _GAP_PT, max(*entries, *words, 0.0) + _GAP_PT))
    return out


def _seen(markdown: str) -> str:
    """About what is seen of a cell's markdown: without the signs for mathematics, raised and escaped letters."""
    placed = re.sub(r"@\S+\[\]\{\.page [^}]*\}", "Figure.12.3.(p.45)", markdown.replace("\u00a0[", "["))
    return re.sub(r"[$^{}\\_`]", "", placed)


def _shares_of(headings: Sequence[str], cells: Sequence[Sequence[str]]) -> str:
    """Shares of the line for each column, `0.20,0.80`: never less than its longest word, the rest by what is longer in
    the mean and at most."""
    columns = _columns_pt(headings, cells, _MOST_LETTERS)
    least = [word for word, _ in columns]
    letters = [
        [min(len(_seen(entry)), _MOST_LETTERS) for entry in own] for _, *own in zip(headings, *cells, strict=True)
    ]
    means = [LETTER_PT * sum(own) / max(len(own), 1) + _GAP_PT for own in letters]
    more = [max(mean - word, 0.0) + whole - word for mean, (word, whole) in zip(means, columns, strict=True)]
    room = max(LINE_PT - sum(least), 0.0)
    wanted = [word + room * extra / max(sum(more), 1e-9) for word, extra in zip(least, more, strict=True)]
    return ",".join(f"{width / sum(wanted):.3f}" for width in wanted)


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _formatted(value: Any, form: str) -> str:
    name, decimals = form.rstrip("0123456789"), form[len(form.rstrip("0123456789")) :]
    if name in _WORDS:
        forms = {"text": text, "name": one_line, "unit": unit, "symbol": symbol, "code": code, "place": place}
        return forms[name](value)
    if name not in ("fix", "sci", "sig", "percent") or not decimals:
        raise ValueError(
            f"{form} is not a form of a number; forms are {', '.join(_WORDS)}, fixN, sciN, sigN and percentN"
        )
    return {"fix": fix, "sci": sci, "sig": sig, "percent": percent}[name](value, int(decimals))


def fix(value: float | None, decimals: int) -> str:
    """A number with so many decimals and a true minus sign; a dash where there is none."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "–"
    shown = f"{value:.{decimals}f}"
    if float(shown) == 0:
        shown = shown.lstrip("-")
    return shown.replace("-", "−")


def sci(value: float | None, decimals: int) -> str:
    """A number as mantissa and power of ten, for text: `1.3877 × 10^−6^` in pandoc's markdown."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "–"
    mantissa, exponent = f"{value:.{decimals}e}".split("e")
    # No-break spaces: a number stays in one piece.
    return f"{mantissa.replace('-', '−')}\u00a0×\u00a010^{str(int(exponent)).replace('-', '−')}^"


def sig(value: float | None, digits: int) -> str:
    """A number with so many significant digits, below a thousandth with a power of ten."""
    if value is None or math.isnan(value):
        return "–"
    if value and not 1e-3 <= abs(value) < 1e5:
        return sci(value, digits - 1)
    return fix(value, max(0, digits - 1 - (math.floor(math.log10(abs(value))) if value else 0)))


def percent(value: float | None, decimals: int) -> str:
    """A share in per cent, without the sign: 0.021 is `2.1`."""
    return fix(None if value is None else 100 * value, decimals)


def interval(ends: Sequence[float], decimals: int, form: str = "fix") -> str:
    """Both ends of an interval: `39.75 to 39.76`."""
    shown = {"fix": fix, "sci": sci}[form]
    return f"{shown(ends[0], decimals)} to {shown(ends[1], decimals)}"


_GREEK = {"tau": "tau", "eps": "varepsilon", "alpha": "alpha", "beta": "beta", "zeta": "zeta", "omega": "omega"}


def symbol(value: str) -> str:
    """A symbol with its index as mathematics: `J_xx` is `$J_{xx}$`, `tau` a Greek letter, `gain_x` upright."""
    letter, _, index = (value or "").partition("_")
    if not letter:
        return ""
    if letter in _GREEK:
        letter = "\\" + _GREEK[letter]
    elif len(letter) > 1:
        letter = f"\\mathrm{{{letter}}}"
    index = index.replace("_", ",")
    return f"${letter}_{{{index}}}$" if index else f"${letter}$"


def one_line(value: Any) -> str:
    """A text that is not broken at its spaces and hyphens."""
    return text(value).replace(" ", "\u00a0").replace("-", "\u2011")


def code(value: Any) -> str:
    """An identifier as it is typed."""
    return f"`{value}`"


def place(label: Any) -> str:
    """What carries a label (`fig:bench-dynamic`) by its number, and in print its page."""
    return f'@{label}\u00a0[]{{.page of="{label}"}}'


def unit(value: Any) -> str:
    """A unit on one line with its powers raised: `kg m2` is `kg m²`, `1e-6 N` is `10⁻⁶ N`, `N/(N)2` is `1/N`."""
    raised = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
    plain = re.sub(r"(?<=^1e-\d) 1$", "", re.sub(r"([^\s/]+)/\(\1\)2$", r"1/\1", text(value)))
    shown = re.sub(r"(?<=[A-Za-z])-?[0-9]+", lambda power: power[0].translate(raised), plain)
    return re.sub("^1e(?=[⁻⁰-⁹¹²³])", "10", shown).replace(" ", "\u00a0")


def text(value: Any) -> str:
    """A result's text with markdown's own signs escaped; a whole number without its decimals."""
    if value is None:
        return "–"
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    return _SIGNS.sub(r"\\\g<0>", str(value))
