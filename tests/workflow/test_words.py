"""Words that grew in this project, and say less than those of the field, are in no text of it."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
FOLDERS = ("src", "proof", "docs", "notebooks", "workflow", "benchmarks")
TEXTS = {".py", ".md", ".smk", ".yaml", ".json", ".html", ".js", ".rst", ".ipynb"}
GROWN = re.compile(
    r"\b(told|louder|carried|harmless|strained|laden|borne out|bears? (it|them) out|puts? right|stands? in for"
    r"|takes? up)\b",
    flags=re.IGNORECASE,
)


def test_no_word_that_a_reader_of_the_field_does_not_know():
    inside = [p for folder in FOLDERS for p in sorted((ROOT / folder).rglob("*")) if p.suffix in TEXTS]
    found = []
    for path in [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", *inside]:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
        found += [f"{path.relative_to(ROOT)}:{n}: {x.strip()}" for n, x in enumerate(lines, 1) if GROWN.search(x)]
    assert len(inside) > 400 and not found
