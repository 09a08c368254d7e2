"""A small recording set shipped with the package: two simulated flights of the thesis's quadrotor.

What its vehicle file leaves out is in the module's constants; `python -m rotorid.cli.examples` makes the files anew.
"""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from rotorid.errors import InputError
from rotorid.io.text.writing import all_or_none

SEED, SECONDS, FLIGHTS, EVERY = 7, 16.0, 2, 4
"""How the flights were made: seed of the sensors' noise, length of each, how many, and every how many steps of 2 ms."""
CONCEALED = ({"id": "rotor_drag", "form": "at the hubs", "parameters": {"k_d": 1.2e-4}},)
"""What the vehicle does and its file does not say."""


def _names() -> tuple[str, ...]:
    """Files of the set, sorted."""
    return tuple(sorted(p.name for p in files(__name__).iterdir() if p.name.endswith((".yaml", ".csv.gz"))))


def write(folder: Path) -> tuple[Path, ...]:
    """Copy the set into `folder`; InputError, and nothing written, where one of its files is there already."""
    paths = tuple(folder / name for name in _names())
    for path in paths:
        if path.exists():
            raise InputError(f"{path} is there already; nothing was written")
    with all_or_none(*paths) as parts:
        for part in parts:
            part.write_bytes(files(__name__).joinpath(part.name).read_bytes())
    return paths
