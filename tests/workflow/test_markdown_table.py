"""The first table of a benchmark's file."""

import pytest

from tests.refusals import refused
from workflow.scripts.tabulate_speed import first_table

TEXT = "# Speed\n\nWords.\n\n| a, s | b |\n| --- | ---: |\n| x | 1.5 |\n| y | 2 |\n\n| other | table |\n"


def test_the_first_table_with_its_columns_renamed():
    table = first_table(TEXT, ["what", "seconds"], "speed.md")
    assert table.to_dict("list") == {"what": ["x", "y"], "seconds": ["1.5", "2"]}


@pytest.mark.parametrize(
    ("text", "columns", "said"),
    [
        ("words alone", ["a"], "speed.md: no table in it"),
        (TEXT, ["a"], "speed.md: its table has 2 columns, expected 1"),
    ],
)
def test_what_is_no_such_table_is_one_sentence(text, columns, said):
    refused(said, first_table, text, columns, "speed.md")
