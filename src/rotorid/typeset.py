"""From the chapters' markdown to the report's two files: pandoc and typst, both from wheels."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from pathlib import Path

from rotorid.errors import InputError

# Raw TeX and HTML stay out, since only one of the two outputs would show them.
MARKDOWN = "markdown-raw_tex-raw_html+table_attributes"


class TypesetError(InputError):
    """The report could not be typeset; carries what pandoc or typst said."""


def typst_source(
    chapters: Sequence[str | Path],
    title: str,
    subtitle: str,
    parts: str | Path,
    out: str | Path,
    left_out: Sequence[str] = (),
    notice: str = "",
) -> None:
    """Chapters to one typst document.

    Parameters
    ----------
    chapters
        Rendered markdown, in reading order; paths of images relative to the current folder.
    title, subtitle
        Text of the title page.
    parts
        Folder with `report.typ`, `crossref.lua` and `references.bib`.
    out
        Where the typst source goes.
    left_out
        Names of chapters that are not in this report: a reference into one of them says so.
    notice
        What the title page says of the data.
    """
    template = Path(parts) / "report.typ"
    options = ["--to=typst", f"--template={template}", f"--output={out}"]
    _pandoc(chapters, title, subtitle, parts, options, left_out, notice)


def pdf(source: str | Path, out: str | Path) -> None:
    """Typst source to PDF, with typst's own fonts only, and dated nowhere so that it is byte-stable."""
    import typst

    try:
        typst.compile(str(source), output=str(out), root=".", ignore_system_fonts=True, timestamp=0, pdf_standards=[])
    except typst.TypstError as error:
        raise TypesetError(f"{source}: typst says: {error}") from None


def html(
    chapters: Sequence[str | Path],
    title: str,
    subtitle: str,
    parts: str | Path,
    out: str | Path,
    left_out: Sequence[str] = (),
    notice: str = "",
) -> None:
    """Chapters to one HTML file that holds its figures, style and equations (MathML); see `typst_source`."""
    parts = Path(parts)
    options = ["--to=html5", "--standalone", "--embed-resources", "--mathml", "--toc", "--toc-depth=2"]
    options += ["--number-sections", f"--template={parts / 'report.html'}", f"--css={parts / 'report.css'}"]
    _pandoc(chapters, title, subtitle, parts, [*options, f"--output={out}"], left_out, notice)


def _pandoc(
    chapters: Sequence[str | Path],
    title: str,
    subtitle: str,
    parts: str | Path,
    options: Sequence[str],
    left_out: Sequence[str],
    notice: str,
) -> None:
    import pypandoc

    parts = Path(parts)
    command = [
        pypandoc.get_pandoc_path(),
        f"--from={MARKDOWN}",
        *(str(chapter) for chapter in chapters),
        "--fail-if-warnings",
        "--columns=10000",  # or tables with long lines would get columns of equal width
        f"--lua-filter={parts / 'crossref.lua'}",
        "--citeproc",
        f"--bibliography={parts / 'references.bib'}",
        f"--metadata=title:{title}",
        f"--metadata=subtitle:{subtitle}",
        "--metadata=lang:en",
        "--metadata=link-citations:true",
        "--metadata=left-out:" + ",".join(name.replace("_", "-") for name in left_out),
        f"--metadata=notice:{notice}",
        "--metadata=reference-section-title:References",
        *options,
    ]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise TypesetError(f"report: pandoc says: {done.stderr.strip()}")
