"""The report's own machinery: numbering, references, and both files from one source."""

import base64
import csv
import html
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from rotorid_lab import typeset
from rotorid_lab.typeset import render
from tests.browser import CHROMIUM, Browser
from tests.refusals import refused

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


def html_of(chapters: list[str], **options) -> str:
    """The report of these chapters as a page."""
    typeset.html(typeset.Document(chapters, "Title", "Subtitle", PARTS, **options), "report.html")
    return Path("report.html").read_text()


def typst_of(chapters: list[str], later=None, **options) -> str:
    """The report of these chapters as typst's source."""
    document = typeset.Document(chapters, "Title", "Subtitle", PARTS, **options)
    typeset.typst_source(document, "report.typ", **({} if later is None else {"later": later}))
    return Path("report.typ").read_text()


def plain(page: str) -> str:
    """Text of an HTML page, spaces made single."""
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", "", page))


def test_html_numbers_by_chapter_and_refers_to_the_numbers(chapters: list[str]) -> None:
    text = plain(html_of(chapters)).replace("\u00a0", " ")
    assert "See Figure 1.1, Table 1.1, Equation 1.1, Chapter 2 and Section 2.1;" in text
    assert "Figure 1.1. A box." in text and "Table 1.1. Cells." in text
    assert "(1.1)" in text and "Back to Figure 2.1." in text
    assert "References" in text and "Jiménez Flores" in text


def test_html_needs_no_other_file(chapters: list[str]) -> None:
    page = html_of(chapters)
    assert "<math" in page
    assert "data:image/svg+xml" in page or "<svg" in page
    assert not re.search(r'(?:src|href)="(?!#|data:|https://doi)[^"]+"', page)


def test_pages_that_do_not_settle_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A heading that asks where it stands and then breaks the page stands elsewhere: every second round differs."""
    monkeypatch.chdir(tmp_path)
    Path("moves.typ").write_text("#v(60%)\n#context { if here().position().y > 300pt { pagebreak() } }\nText.\n")
    refused("moves.typ.*converge", typeset.pdf, "moves.typ", "moves.pdf")
    Path("stays.typ").write_text("Text.\n")
    typeset.pdf("stays.typ", "stays.pdf")


def test_a_chapter_begins_on_the_page_before_only_where_room_is_left(chapters: list[str]) -> None:
    """Twelve chapters of two thirds of a page and of a third: their pages settle."""
    texts = []
    for k in range(12):
        Path(f"chapter{k}.md").write_text(
            f"# Chapter {k} {{#sec:c{k}}}\n\n" + "Words. " * (900 if k % 2 else 300) + "\n"
        )
        texts.append(f"chapter{k}.md")
    typeset.typst_source(typeset.Document(texts, "Title", "Subtitle", PARTS), "report.typ")
    typeset.pdf("report.typ", "report.pdf")


def test_typst_says_the_same_numbers_and_makes_a_pdf(chapters: list[str]) -> None:
    source = typst_of(chapters)
    assert "#link(<fig:first-box>)[Figure~1.1]" in source
    assert "math.equation(numbering: _ => [(1.1)])" in source
    typeset.pdf("report.typ", "report.pdf")
    first = Path("report.pdf").read_bytes()
    assert first.startswith(b"%PDF")
    typeset.pdf("report.typ", "again.pdf")
    assert Path("again.pdf").read_bytes() == first


def test_both_forms_say_on_their_first_page_from_which_commit_they_are(chapters: list[str]) -> None:
    origin = "Made from commit abc of 2026-01-02."
    source, page = typst_of(chapters, origin=origin), html_of(chapters, origin=origin)
    assert "Made from commit abc" in source[: source.index("Contents")]
    assert "Made from commit abc" in page[: page.index('id="contents"')]


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
    refused(message, html_of, ["bad.md"])


def test_a_figure_that_moves_stands_still_in_print(chapters: list[str]) -> None:
    Path("moving.svg").write_text(FIGURE.replace("<rect", "<circle r='4'/><rect"))
    Path("two.md").write_text(TWO.replace("{#fig:second-box}", '{#fig:second-box moving="moving.svg"}'))
    assert "moving.svg" not in typst_of(chapters)
    page = html_of(chapters)
    assert "moving=" not in page
    assert base64.b64encode(Path("moving.svg").read_bytes()).decode() in page or "circle" in page


TALL = FIGURE.replace('height="30"', 'height="60"')
SAID = "Some words of a sentence that goes on for a while and says little of anything. " * 8


def a_chapter(after: list[str], before: int = 4) -> list[str]:
    """One chapter: paragraphs, a figure that does not fit below them, and what follows it."""
    Path("tall.svg").write_text(TALL)
    blocks = ["# Tall {#sec:tall}", *[SAID] * before, "![Tall.](tall.svg){#fig:tall width=100%}", *after]
    Path("tall.md").write_text("\n\n".join(blocks) + "\n")
    return ["tall.md"]


def test_a_figure_that_does_not_fit_lets_the_text_go_on(chapters: list[str]) -> None:
    """Before: a page ended half empty."""
    texts = a_chapter([SAID] * 5)
    typst_of(texts)
    ((identifier, _, height_pt, movable),) = typeset.gaps("report.typ")
    assert identifier == "fig:tall" and movable and height_pt > 3 * typeset.MOST_EMPTY_PT
    typeset.without_gaps(typeset.Document(texts, "Title", "Subtitle", PARTS), "report.typ")
    ((_, _, height_pt, _),) = typeset.gaps("report.typ")
    assert height_pt < typeset.MOST_EMPTY_PT
    source = Path("report.typ").read_text()
    assert source.count("Some words") == 8 * 9 and source.index("#figure(") > source.index("Some words")


def test_a_figure_right_after_another_is_looked_at_too(chapters: list[str]) -> None:
    texts = a_chapter(["![Second.](tall.svg){#fig:tall-second width=100%}", SAID, SAID], before=1)
    typst_of(texts)
    (_, _, first_pt, first_movable), (_, _, second_pt, second_movable) = typeset.gaps("report.typ")
    assert first_pt == 0 and not first_movable
    assert second_pt > 2 * typeset.MOST_EMPTY_PT and second_movable


def test_a_figure_passes_no_heading_and_cuts_no_sentence(chapters: list[str]) -> None:
    law = "The law, which is\n\n[$$ F = C_F\\,\\omega^2 , $$]{#eq:law}\n\nholds at all speeds."
    source = typst_of(a_chapter([law, SAID]), later={"fig:tall": 1})
    assert source.index("holds at all speeds.") < source.index("#figure(") < source.rindex("Some words")
    texts = a_chapter(["## Next {#sec:next}", SAID])
    typeset.without_gaps(typeset.Document(texts, "Title", "Subtitle", PARTS), "report.typ")
    ((_, _, height_pt, movable),) = typeset.gaps("report.typ")
    assert not movable and height_pt > typeset.MOST_EMPTY_PT
    source = Path("report.typ").read_text()
    assert source.index("#figure(") < source.index("<sec:next>")


def test_nothing_is_fetched_and_no_script_runs_in_the_html(chapters: list[str]) -> None:
    page = html_of(chapters)
    policy = html.unescape(re.search(r'http-equiv="Content-Security-Policy" content="([^"]+)"', page)[1])
    assert "default-src 'none'" in policy and "script" not in policy
    assert "<script" not in page


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium")
@pytest.mark.parametrize("width", [360, 900, 1400])
def test_the_html_is_as_wide_as_the_window_and_says_nothing_to_the_console(chapters: list[str], width: int) -> None:
    cells = " | ".join(f"{k}.123456789" for k in range(40))
    wide = (
        f"| {' | '.join(['n'] * 40)} |\n| {' | '.join(['---:'] * 40)} |\n| {cells} |\n\n: Wide. {{#tbl:second-wide}}\n"
    )
    Path("two.md").write_text(TWO + "\n" + wide)
    html_of(chapters)
    with Browser(Path.cwd()) as browser:
        browser.open(Path("report.html"), width)
        assert browser.said == [] and browser.value("document.documentElement.scrollWidth") <= width
        assert browser.value("[...document.images].every((image) => image.naturalWidth > 0)")


NASTY = [
    "<img src=x onerror=document.title='taken'>",
    "<script>document.title='taken'</script>",
    "{x} {{ 7*7 }} {% raw %}",
    "$\\frac{1}{$",
    '#eval("1+1") #text(red)[x] @fig',
    "[a](javascript:alert(1)) ![b](x.png)",
    "*bold* _thin_ `code` ~~gone~~ H~2~O ^up^",
    '&lt;b&gt; &amp; it\'s "so" -- ... a|b',
    "\\textbf{x} \\(y\\) <!-- z -->",
]
"""Names, notes and columns as somebody may call them."""


@pytest.fixture
def named(chapters: list[str]) -> list[str]:
    """A chapter with a table of such names, and one of them in a sentence and in its caption."""
    with open("names.csv", "w", newline="") as file:
        csv.writer(file).writerows([["name", "x"], *([name, 1] for name in NASTY)])
    Path("three.md").write_text(
        "# Third {#sec:third}\n\nRun {{ names[0].name|text }} and {{ names[4].name|text }}.\n\n"
        '{{ table("names", "Names.", [["name", "name", "text"], ["x", "x", "fix0"]], kind="public") }}\n'
    )
    Path("named.md").write_text(render("three.md", {"names": "names.csv"}))
    return ["named.md"]


def test_names_with_markup_are_text_in_the_html(named: list[str]) -> None:
    page = html_of(named)
    seen = re.sub(r"\s+", " ", html.unescape(re.sub(r"<[^>]+>", "", page)))
    assert [name for name in NASTY if name not in seen] == []
    assert not re.search(r"<(img|script|a)[^>]*(taken|javascript|x\.png)", page)


@pytest.mark.skipif(shutil.which("pdftotext") is None, reason="needs pdftotext")
def test_names_with_markup_are_text_in_the_pdf(named: list[str]) -> None:
    """Before: an entity became its sign, quotation marks and dashes others."""
    typst_of(named)
    typeset.pdf("report.typ", "report.pdf")
    seen = subprocess.run(["pdftotext", "-layout", "report.pdf", "-"], capture_output=True, text=True).stdout
    letters = re.sub(r"[\s-]", "", seen.replace("…", "..."))  # lines break inside names; typst sets three dots as one
    assert [name for name in NASTY if re.sub(r"[\s-]", "", name) not in letters] == []


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium")
def test_a_browser_runs_nothing_in_the_html(named: list[str]) -> None:
    page = html_of(named)
    for put in ("<script>document.title = 'taken'</script>", "<img src=x onerror=\"document.title = 'taken'\">"):
        Path("put.html").write_text(page.replace("</main>", put + "</main>").replace("</body>", put + "</body>"))
        with Browser(Path.cwd()) as browser:
            browser.open(Path("put.html"), 800)
            assert browser.value("document.title") == "Title"
            assert any("Content Security Policy" in said for said in browser.said), browser.said


def test_a_place_in_a_table_is_a_number_with_its_page(chapters: list[str]) -> None:
    cells = typeset.table_of([{"w": "fig:first-box"}], "Places.", [("w", "Where", "place")], "tbl:places")
    Path("three.md").write_text(f"# Third {{#sec:third}}\n\n{cells}")
    chapters = [*chapters, "three.md"]
    assert "context counter(page).at(<fig:first-box>)" in typst_of(chapters)
    assert html_of(chapters).count('href="#fig:first-box"') == html_of(chapters[:2]).count('href="#fig:first-box"') + 1
    typeset.pdf("report.typ", "report.pdf")
    Path("three.md").write_text(Path("three.md").read_text().replace("first-box", "nothing"))
    refused("there is nothing called fig:nothing", typst_of, chapters)
