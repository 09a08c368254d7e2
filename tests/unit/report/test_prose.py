"""A chapter's text: numbers, tables and figures from files, and a stop where one is missing."""

import json
import re
from pathlib import Path

import pytest

from rotorid.errors import InputError
from rotorid_lab.typeset import (
    LETTER_PT,
    LINE_PT,
    fix,
    not_recorded,
    one_line,
    render,
    sci,
    sig,
    symbol,
    table_of,
    unit,
)


@pytest.fixture
def files(tmp_path: Path) -> dict[str, str]:
    fit = tmp_path / "fit.json"
    fit.write_text(json.dumps({"c_f": 1.38771e-6, "a0": -0.07434, "share": 0.0213, "ends": [39.751, 39.762]}))
    cells = tmp_path / "cells.csv"
    cells.write_text("cell,a1,note\n1,39.7564,a_b\n2,37.2655,\n")
    return {"fit": str(fit), "cells": str(cells), "lines": "results/report/x/lines.svg"}


def rendered(tmp_path: Path, text: str, files: dict[str, str]) -> str:
    path = tmp_path / "hover.md"
    path.write_text(text)
    return render(path, files)


def test_numbers_come_from_the_file_with_the_asked_digits(tmp_path: Path, files: dict[str, str]) -> None:
    text = "{{ fit.c_f | sci(4) }}; {{ fit.a0 | fix(3) }}; {{ fit.share | percent(1) }} %"
    assert rendered(tmp_path, text, files) == "1.3877\u00a0×\u00a010^−6^; −0.074; 2.1 %"
    assert rendered(tmp_path, "{{ fit.ends | interval(2) }}", files) == "39.75 to 39.76"


def test_a_zero_after_rounding_has_no_sign_and_nothing_is_a_dash() -> None:
    assert fix(-0.0004, 2) == "0.00"
    assert fix(None, 2) == "–"
    assert sci(float("nan"), 2) == "–"


def test_a_table_has_heading_numbers_caption_and_label(tmp_path: Path, files: dict[str, str]) -> None:
    text = (
        '{{ table("cells", "Cells.", [("cell", "Cell"), ("a1", "$a_1$", "fix2"), ("note", "Note")], kind="public") }}'
    )
    assert rendered(tmp_path, text, files).splitlines() == [
        "| Cell | $a_1$ | Note |",
        "| :---- | -----: | :---- |",
        "| 1 | 39.76 | a\\_b |",
        "| 2 | 37.27 | – |",
        "",
        ": *Real recordings of other laboratories.* Cells. {#tbl:hover-cells}",
    ]


def test_a_figure_has_caption_path_and_label(tmp_path: Path, files: dict[str, str]) -> None:
    text = rendered(tmp_path, '{{ figure("lines", "All lines.", kind="campaign") }}', files)
    assert (
        text == "![*Recorded on the instruments.* All lines.](results/report/x/lines.svg){#fig:hover-lines width=100%}"
    )


def test_a_figure_inside_a_paragraph_stops_the_report(tmp_path: Path, files: dict[str, str]) -> None:
    text = 'Said before.\n{{ figure("lines", "Lines.", kind="public") }}\n'
    with pytest.raises(InputError, match="fig:hover-lines stands inside a paragraph"):
        rendered(tmp_path, text, files)


def test_a_figure_may_move_on_the_page(tmp_path: Path, files: dict[str, str]) -> None:
    text = '{{ figure("lines", "Lines.", kind="public", moving="lines") }}'
    assert 'moving="results/report/x/lines.svg"' in rendered(tmp_path, text, files)
    with pytest.raises(InputError, match="no figure called film"):
        rendered(tmp_path, '{{ figure("lines", "Lines.", kind="public", moving="film") }}', files)


def test_a_caption_says_first_that_instruments_were_emulated(tmp_path: Path, files: dict[str, str]) -> None:
    path = tmp_path / "hover.md"
    path.write_text('{{ figure("lines", "All lines.", kind="campaign") }}{% if emulated %} Emulated.{% endif %}')
    text = render(path, files, emulated=True)
    assert text.startswith("![*Emulated instruments.* All lines.]") and text.endswith(" Emulated.")
    with pytest.raises(InputError, match="not 'guessed'"):
        rendered(tmp_path, '{{ figure("lines", "All lines.", kind="guessed") }}', files)


def test_a_chapter_without_its_recordings_says_which(tmp_path: Path) -> None:
    path = tmp_path / "hover.md"
    path.write_text("# Hover {#sec:hover}\n\n{{ nothing.here }}\n")
    assert not_recorded(path, ["thrust", "torque"], "mine/sessions.tsv") == (
        "# Hover {#sec:hover}\n\nThis chapter needs thrust and torque recordings, "
        "and `mine/sessions.tsv` lists none or too few.\n"
    )


def test_pandocs_identifiers_are_not_comments(tmp_path: Path, files: dict[str, str]) -> None:
    assert rendered(tmp_path, "# Hover {#sec:hover}\n<# unseen #>", files) == "# Hover {#sec:hover}\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("one\n\n{{ fit.c_q | fix(2) }}", r"hover\.md, line 3: .*c_q"),
        ("{{ fat.c_f }}", r"hover\.md, line 1: 'fat' is undefined"),
        ("a\n{{ fit.c_f", r"hover\.md, line 2: "),
        ('{{ figure("cells", "x", kind="public") }}', r"there is no figure called cells"),
        ('{{ table("fit", "x", [("a", "A")], kind="public") }}', r"there is no table called fit"),
        ('{{ table("cells", "x", [("a9", "A")], kind="public") }}', r"the table cells has no column 'a9'"),
        ('{{ table("cells", "x", [("a1", "A", "round2")], kind="public") }}', r"round2 is not a form of a number"),
    ],
)
def test_what_is_missing_stops_the_report(tmp_path: Path, files: dict[str, str], text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        rendered(tmp_path, text, files)


def test_columns_of_long_text_get_more_room(tmp_path: Path) -> None:
    rows = [{"what": "a" * 60, "n": 1.0}, {"what": "b", "n": 22.0}]
    lines = table_of(rows, "All.", [("what", "What"), ("n", "Number of them", "fix0")], "tbl:x")
    assert lines.splitlines()[1] == f"| :{'-' * 40} | {'-' * 6}: |"


def test_no_column_of_a_wide_table_is_narrower_than_its_longest_word() -> None:
    columns = [
        ("study", "Recording"),
        ("found", "What was found there"),
        ("error", "Measured"),
        ("rest", "Unexplained"),
    ]
    rows = [{"study": "appius-ground-effect", "found": "rotor drag; unequal rotors; " * 4, "error": "0.686 / 0.653 N",
             "rest": "14 %"}]  # fmt: skip
    table = table_of(rows, "All.", columns, "tbl:x")
    shares = [float(share) for share in re.search(r"widths=([\d.,]+)", table)[1].split(",")]
    assert sum(shares) == pytest.approx(1, abs=0.01)
    for share, word in zip(shares, ("appius", "unequal", "Measured", "Unexplained"), strict=True):
        assert share * LINE_PT > LETTER_PT * len(word)
    assert "widths" not in table_of([{"a": "1"}], "All.", [("a", "A")], "tbl:x")


def three_digits(value: float | None) -> str:
    return sig(value, 3)


def test_a_symbol_in_a_table_is_set_as_mathematics() -> None:
    row = table_of([{"name": "C_F"}], "Values.", [("name", "Parameter", "symbol")], "tbl:x").splitlines()[2]
    assert row == "| $C_{F}$ |"


@pytest.mark.parametrize(
    ("form", "given", "shown"),
    [
        (
            unit,
            ("kg m2", "N s2/(rad m)", "1e-6 kg/rad"),
            ("kg\u00a0m²", "N\u00a0s²/(rad\u00a0m)", "10⁻⁶\u00a0kg/rad"),
        ),
        (unit, (1.0, "1e-6 1", "N/(N)2"), ("1", "10⁻⁶", "1/N")),
        (one_line, ("imrc-brushless a",), ("imrc\u2011brushless\u00a0a",)),
        (three_digits, (0.20613, -0.00421, 12.0, None), ("0.206", "−0.00421", "12.0", "–")),
        (three_digits, (1.44e-6,), ("1.44\u00a0×\u00a010^−6^",)),
        (symbol, ("tau", "eps_x", "gain_x"), ("$\\tau$", "$\\varepsilon_{x}$", "$\\mathrm{gain}_{x}$")),
        (symbol, ("m", "J_xx", "w_11"), ("$m$", "$J_{xx}$", "$w_{11}$")),
    ],
    ids=["units", "units of a power of ten and of nothing", "names", "numbers", "small numbers", "words", "letters"],
)
def test_units_names_numbers_and_symbols_stay_on_one_line(form, given, shown) -> None:
    assert tuple(form(one) for one in given) == shown


def test_a_caption_of_two_kinds_says_that_instruments_were_emulated(tmp_path: Path, files: dict[str, str]) -> None:
    text = '{{ figure("lines", "All lines.", kind="campaign_simulated") }}\n'
    path = tmp_path / "chapter.md"
    path.write_text(text)
    assert "*Emulated instruments, and simulated.* All lines." in render(path, files, emulated=True)
    assert "*Recorded on the instruments, and simulated.*" in render(path, files)
