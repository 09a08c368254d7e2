"""From the chapters' markdown to the report's two files: pandoc and typst, both from wheels."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rotorid.errors import InputError

# Raw TeX and HTML stay out, since only one of the two outputs would show them.
_MARKDOWN = "markdown-raw_tex-raw_html+table_attributes"


class TypesetError(InputError):
    """The report could not be typeset; carries what pandoc or typst said."""


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
    origin: str = ""
    """Commit, date and code, for the title page."""
    """What the title page says of the data."""


def typst_source(document: Document, out: str | Path, later: Mapping[str, int] | None = None) -> None:
    """A document to typst source; `later` says by how many steps a figure or table (by its identifier) stands later
    than in its chapter's text."""
    options = ["--to=typst", f"--template={Path(document.parts) / 'report.typ'}", f"--output={out}"]
    options.append("--metadata=later:" + ",".join(f"{name}={steps}" for name, steps in (later or {}).items()))
    _pandoc(document, options)


@dataclass(frozen=True)
class _EmptySpace:
    """Empty space at the foot of a page since a figure or table did not fit there."""

    identifier: str
    chapter: int
    """From 1, those without a number included."""
    height_pt: float
    """0 where it follows its text on the same page."""
    movable: bool
    """Whether whole sentences follow that could stand before it."""


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
    found: list[_EmptySpace] = []
    seen: dict[str, dict[int, float]] = {}
    settled: set[str] = set()
    for _ in range(_ROUNDS):
        moved = {name: steps for name, steps in later.items() if steps}
        if moved != written:
            typst_source(document, out, moved)
            written, found = moved, gaps(out)
        tried: set[int] = set()
        for gap in found:
            name, steps = gap.identifier, later.get(gap.identifier, 0)
            if name in settled or gap.chapter in tried:
                continue
            seen.setdefault(name, {})[steps] = gap.height_pt
            if gap.height_pt <= MOST_EMPTY_PT:
                settled |= {name} if steps else set()
                continue
            tried.add(gap.chapter)
            if gap.movable and steps < _MOST_STEPS:
                later[name] = steps + 1
            else:
                later[name] = min(seen[name], key=lambda k: (seen[name][k], k))
                settled.add(name)
        if not tried:
            return
    typst_source(document, out, later)


def gaps(source: str | Path) -> list[_EmptySpace]:
    """The gap before each figure and table that follows text, in reading order, from a typst source's own marks."""
    import typst

    try:
        found = typst.query(str(source), "<places>", field="value", one=True, root=".", ignore_system_fonts=True)
    except typst.TypstError as error:
        raise TypesetError(f"{source}: typst says: {error}") from None
    places = json.loads(found)
    page_of = dict(places["shown"])
    return [
        _EmptySpace(name, chapter, places["bottom"] - below_pt if page_of[name] > page else 0.0, movable)
        for (name, movable, chapter), page, below_pt in places["text"]
    ]


def pdf(source: str | Path, out: str | Path) -> None:
    """Typst source to PDF, with typst's own fonts only, and dated nowhere so that it is byte-stable."""
    import typst

    try:
        typst.compile(str(source), output=str(out), root=".", ignore_system_fonts=True, timestamp=0, pdf_standards=[])
    except typst.TypstError as error:
        raise TypesetError(f"{source}: typst says: {error}") from None


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
        "--metadata=reference-section-title:References",
        *options,
    ]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise TypesetError(f"report: pandoc says: {done.stderr.strip()}")
