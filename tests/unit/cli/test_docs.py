"""The page for a first verdict: its commands run in the order in which they stand, its tables are the code's."""

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rotorid.cli import app
from rotorid.importers.known import ORDERS

PAGE = (Path(__file__).parents[3] / "docs" / "first-verdict.md").read_text()


def test_the_table_of_rotor_orders_is_the_codes() -> None:
    rows = re.findall(r"^\| ([^|]+) \|((?: (?:front|rear) (?:left|right), c?cw \|){4})$", PAGE, flags=re.M)
    found = {}
    for names, cells in rows:
        order = tuple(tuple(cell.strip().split(", ")) for cell in cells.strip(" |").split("|"))
        for name in names.split(", "):
            found[name.split(" (")[0].lower()] = order
    assert found == ORDERS


def test_every_command_named_is_one() -> None:
    known = {command.name for command in app.registered_commands}
    used = set(re.findall(r"^rotorid (\w+)", PAGE, flags=re.M))
    assert used and used <= known


@pytest.mark.slow
def test_the_commands_run_as_they_stand(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    for block in re.findall(r"```bash\n(.*?)```", PAGE, flags=re.S):
        for line in block.strip().splitlines():
            done = CliRunner().invoke(app, shlex.split(line)[1:])
            assert done.exit_code == 0, f"{line}: {done.output}"
    assert (tmp_path / "answer" / "report.html").is_file()
