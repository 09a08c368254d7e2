"""The report's own machinery: numbering, references, and both files from one source."""

import base64
import html
import re
from pathlib import Path

import pytest

from rotorid import typeset

ROOT = Path(__file__).parents[2]
PARTS = ROOT / "workflow" / "report"
FIGURE = '<svg xmlns="http://www.w3.org/2000/svg" width="90" height="30"><rect width="90" height="30"/></svg>\n'
ONE = """# First {#sec:first}

See @fig:first-box, @tbl:first-cells, @eq:law, @sec:second and @sec:second-part; also [@jimenez2024].

![A box.](box.svg){#fig:first-box width=100%}

[$$ F = C_F\\,\\omega^2 $$]{#eq:law}

| cell | $a_1$ |
| :--- | ---: |
| 1 | 39.76 |

: Cells. {#tbl:first-cells}
"""
TWO = """# Second {#sec:second}

## Part {#sec:second-part}

![Another.](box.svg){#fig:second-box}

Back to @fig:second-box.
"""


@pytest.fixture
def chapters(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    monkeypatch.chdir(tmp_path)
    Path("box.svg").write_text(FIGURE)
    Path("one.md").write_text(ONE)
    Path("two.md").write_text(TWO)
    return ["one.md", "two.md"]


def plain(page: str) -> str:
    """Text of an HTML page, spaces made single."""
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", "", page))


def test_html_numbers_by_chapter_and_refers_to_the_numbers(chapters: list[str]) -> None:
    typeset.html(chapters, "Title", "Subtitle", PARTS, "report.html")
    page = Path("report.html").read_text()
    text = plain(page).replace("\u00a0", " ")
    assert "See Figure 1.1, Table 1.1, Equation 1.1, Chapter 2 and Section 2.1;" in text
    assert "Figure 1.1. A box." in text
    assert "Table 1.1. Cells." in text
    assert "(1.1)" in text
    assert "Back to Figure 2.1." in text
    assert "References" in text and "Jiménez Flores" in text


def test_html_needs_no_other_file(chapters: list[str]) -> None:
    typeset.html(chapters, "Title", "Subtitle", PARTS, "report.html")
    page = Path("report.html").read_text()
    assert "<math" in page
    assert "data:image/svg+xml" in page or "<svg" in page
    assert not re.search(r'(?:src|href)="(?!#|data:|https://doi)[^"]+"', page)


def test_typst_says_the_same_numbers_and_makes_a_pdf(chapters: list[str]) -> None:
    typeset.typst_source(chapters, "Title", "Subtitle", PARTS, "report.typ")
    source = Path("report.typ").read_text()
    assert "#link(<fig:first-box>)[Figure~1.1]" in source
    assert "math.equation(numbering: _ => [(1.1)])" in source
    typeset.pdf("report.typ", "report.pdf")
    first = Path("report.pdf").read_bytes()
    assert first.startswith(b"%PDF")
    typeset.pdf("report.typ", "again.pdf")
    assert Path("again.pdf").read_bytes() == first


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("# A {#sec:a}\n\nSee @fig:nothing.\n", "there is nothing called fig:nothing to refer to"),
        ("# A {#sec:a}\n\nSee [@nobody1999].\n", "nobody1999"),
        ("# A {#sec:a}\n\n![x](missing.svg){#fig:x}\n", "missing.svg"),
        ("# A {#sec:a}\n\n![x](box.svg){#fig:x}\n\n![y](box.svg){#fig:x}\n", "two things are called fig:x"),
    ],
)
def test_what_leads_nowhere_stops_the_report(chapters: list[str], text: str, message: str) -> None:
    Path("bad.md").write_text(text)
    with pytest.raises(typeset.TypesetError, match=message):
        typeset.html(["bad.md"], "Title", "Subtitle", PARTS, "report.html")


def test_a_figure_that_moves_stands_still_in_print(chapters: list[str]) -> None:
    Path("moving.svg").write_text(FIGURE.replace("<rect", "<circle r='4'/><rect"))
    Path("two.md").write_text(TWO.replace("{#fig:second-box}", '{#fig:second-box moving="moving.svg"}'))
    typeset.typst_source(chapters, "Title", "Subtitle", PARTS, "report.typ")
    assert "moving.svg" not in Path("report.typ").read_text()
    typeset.html(chapters, "Title", "Subtitle", PARTS, "report.html")
    page = Path("report.html").read_text()
    assert "moving=" not in page
    assert base64.b64encode(Path("moving.svg").read_bytes()).decode() in page or "circle" in page


def test_nothing_is_fetched_and_no_script_runs_in_the_html(chapters: list[str]) -> None:
    typeset.html(chapters, "Title", "Subtitle", PARTS, "report.html")
    page = Path("report.html").read_text()
    policy = html.unescape(re.search(r'http-equiv="Content-Security-Policy" content="([^"]+)"', page)[1])
    assert "default-src 'none'" in policy and "script" not in policy
    assert "<script" not in page
