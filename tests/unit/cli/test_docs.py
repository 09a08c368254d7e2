"""The page for a first verdict: its tables are the code's."""

import re
from pathlib import Path

from rotorid.recordings.importers.known import ORDERS

PAGE = (Path(__file__).parents[3] / "docs" / "first-verdict.md").read_text()


def test_the_table_of_rotor_orders_is_the_codes() -> None:
    rows = re.findall(r"^\| ([^|]+) \|((?: (?:front|rear) (?:left|right), c?cw \|){4})$", PAGE, flags=re.M)
    found = {}
    for names, cells in rows:
        order = tuple(tuple(cell.strip().split(", ")) for cell in cells.strip(" |").split("|"))
        for name in names.split(", "):
            found[name.split(" (")[0].lower()] = order
    assert found == ORDERS


def test_python_md_shows_nothing_that_the_plain_install_lacks() -> None:
    text = (Path(__file__).parents[3] / "docs" / "python.md").read_text()
    blocks = "\n".join(re.findall(r"```python\n(.*?)```", text, flags=re.S))
    assert "rotorid.verdict(" in blocks and "parquet" not in blocks and ".ulg" not in blocks
