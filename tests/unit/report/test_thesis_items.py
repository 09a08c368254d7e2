"""The table of the thesis item by item has a row for every part of the thesis, and each points into the document."""

import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
NOTEBOOK = json.loads((ROOT / "notebooks/thesis.ipynb").read_text(encoding="utf-8"))
CODE = "\n".join("".join(cell["source"]) for cell in NOTEBOOK["cells"] if cell["cell_type"] == "code")
ROWS = re.findall(r"""add\(\s*"([^"]+)",\s*f?"([^"]+)",(.*?)\n?\)\n""", CODE + "\n", re.DOTALL)

# Sections of the thesis that describe a system, a method or a result (its chapters 2 to 5 and appendix A.1).
PARTS = (
    "2.1", "2.2", "2.3", "2.4", "2.5", "2.6", "2.6.4", "2.7.1", "2.7.2", "2.7.3", "2.8", "3.1", "3.2", "3.3", "3.4",
    "3.5.1", "3.5.2", "3.5.3", "3.5.4", "4.1.1", "4.1.2", "4.1.3", "4.2", "4.3.1", "4.3.2", "4.3.3", "4.4", "5", "A.1",
)  # fmt: skip


def covered(part: str) -> set[str]:
    """Sections that a row's part names: `2.1–2.3, 2.6` is four of them."""
    out = set()
    for piece in part.split(", "):
        first, _, last = piece.partition("–")
        head, _, low = first.rpartition(".")
        numbers = range(int(low), int(last.rpartition(".")[2]) + 1) if last else [low]
        out |= {f"{head}.{n}" if head else n for n in map(str, numbers)}
    return out


def test_every_part_of_the_thesis_has_a_row():
    found = set().union(*(covered(part) for part, _, _ in ROWS))
    assert len(ROWS) > 30 and set(PARTS) - found == set()


@pytest.mark.parametrize("figure", ["2.9", "2.34", "2.35", "4.8", "4.9", "4.17", "4.21", "4.24", "4.22", "4.23"])
def test_figures_that_are_repeated_say_of_which_they_are(figure):
    """Eq. 2.9 and these figures: in a caption, a sentence or the table."""
    texts = CODE + "".join(p.read_text(encoding="utf-8") for p in (ROOT / "notebooks").glob("*.md"))
    assert re.search(rf"(?<![\d.]){re.escape(figure)}(?!\d)", texts)


def test_every_place_is_one_of_the_document():
    """Labels are written out, or made of a chapter and the name of its figure or table."""
    labels = set()
    for page in (ROOT / "notebooks").glob("*.md"):
        text, chapter = page.read_text(encoding="utf-8"), page.stem.replace("_", "-")
        labels |= set(re.findall(r"\{#([a-z]+:[\w-]+)", text))
        for kind, call in (("fig", "figure"), ("tbl", "table")):
            labels |= {f"{kind}:{chapter}-{name.replace('_', '-')}" for name in re.findall(rf'{call}\("(\w+)"', text)}
    places = {place for _, _, rest in ROWS for place in re.findall(r'"((?:fig|tbl|eq|sec):[\w-]+)"', rest)}
    assert len(places) > 20 and places - labels == set()
