"""No number of a result is typed into a chapter's text: each comes from a file, through `{{ ... }}`."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEXTS = sorted((ROOT / "notebooks").glob("*.md"))
PLACE = r"[A-Z]?\.?\d[\w.]*(?:[–-]\d[\w.]*)?"
# What holds digits and is no result: Jinja, code, mathematics, places in the thesis, references, powers in units.
NO_RESULT = (
    r"\{%.*?%\}",
    r"\{\{.*?\}\}",
    r"\$\$.*?\$\$",
    r"\$[^$\n]*\$",
    r"`[^`]*`",
    r"\{#[^}]*\}",
    rf"(?:eqs?\.|[Tt]ables?|[Ff]igures?|[Ss]ections?|sec\.|chs?\.|appendix)\s?{PLACE}(?:(?:,| and| or)\s{PLACE})*",
    r"@[\w:-]+",
    r"10\^−?\d+\^",
)
CAPTION = r'\{\{ (?:figure|table)\("\w+",\s*((?:"[^"]*"\s*)+)'
ALLOWED = {
    "95",  # the level of every interval
    "0.2",  # yield is defined at 0.2 % strain
    "6",  # the index of a cell
}


def typed(text: str) -> list[str]:
    """Numbers that stand in the text and its captions themselves."""
    captions = [" ".join(re.findall(r'"([^"]*)"', call)) for call in re.findall(CAPTION, text)]
    text = "\n".join([re.sub(r"\{\{.*?\}\}", " ", text, flags=re.DOTALL), *captions])
    for pattern in NO_RESULT:
        text = re.sub(pattern, " ", text, flags=re.DOTALL)
    lines = [line for line in text.splitlines() if not line.startswith("|") and not re.match(r"\d\. ", line)]
    found = re.findall(r"(?<![\w.])\d+(?:[.,]\d+)*(?![\w^])", "\n".join(lines))
    return [number for number in found if number not in ALLOWED]


PRINTED_WEIGHTS = set(
    "0.5311 0.1014 1.0462 0.1708 0.4342 0.6602 0.7606 0.1731 5.4669 0.2133 1829 4.688 "
    "0.4279 1.0063 0.8083 0.4139 0.3693 0.5336 0.0600 0.5183 6.3486 20.8333".split()
)
"""Appendix A.1 of the thesis, and the speed and thrust that its scales stand for."""

# Numbers that say how something was made or what the thesis states, and that no file of a result holds.
STATED = {
    "bench": {"1", "3", "5"},  # names of cells
    "fem": {"1.9", "1", "2", "3", "4", "5", "6"},  # names of cells
    "instruments": {"1", "2", "3", "4", "5", "6", "45"},  # names of cells; their inclination
    "loadcell": {"1"},  # the largest correlation coefficient there is
    "stand": {
        "15",
        "30",
        "48",
        "50",
        "20",
        "118",
        "5",
        "0",
    },  # tilts and number of the thesis's experiments; a believed offset of nothing
    "grey_box": {
        "500",
        "5",
        "1",
        "0.5",
        *PRINTED_WEIGHTS,
    },  # what the thesis reads off its figure; a level; 1/e; an axis
    "black_box": {"0.9", "48"},  # the threshold of a sentence; number of the thesis's experiments
    "white_box": {"4", "0.652", "0.125", "0.0884"},  # a rotor; table 4.1 of the thesis
    "rotor_coefficients": {"2"},  # the exponent of the law
    "public_recordings": {"256"},  # of SHA-256
    "real_flights": {"3", "99"},  # the number of a rotor; what "established" means
    "proof": {"90"},  # what was aimed at
    "abstract": {"90", "3"},  # what was aimed at; the number of a rotor
    "thesis": set(),
    "appendix": {"256"},
    "mismatch": set(),
}


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: path.stem)
def test_no_number_of_a_result_is_typed(path: Path) -> None:
    stated = STATED.get(path.stem, set())
    assert [number for number in typed(path.read_text()) if number not in stated] == []


def test_a_typed_number_is_found() -> None:
    assert typed("The slope is 39.75 gf, twice {{ fit.a | fix(2) }} of @fig:a-1 (eq. 4.25).") == ["39.75"]
    assert typed("All 30 of 30 targets hold at 95 %.") == ["30", "30"]
