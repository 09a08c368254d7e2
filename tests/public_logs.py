"""Where other laboratories' logs are, and the mark of a test that needs them."""

import os
from pathlib import Path

import pytest

from rotorid.recordings.importers.public_sets import PUBLIC_SETS, build, obtain

_named = os.environ.get("ROTORID_PUBLIC_DATA")
ROOT = Path(__file__).resolve().parents[1]
PUBLIC = (ROOT / _named).resolve() if _named else ROOT.parent / "shared" / "data"
LOGS = PUBLIC / "logs"


def public(path: str | Path) -> Path:
    """A file of the public recordings; where it is not here the test is skipped."""
    if not (PUBLIC / path).is_file():
        pytest.skip(f"{path} of the public recordings is not here")
    return PUBLIC / path


def built(name: str, manifest: dict, vehicles: Path, parent: Path) -> Path:
    """The folder of a public set made below `parent`; where a file of it is not here the test is skipped."""
    recipe = PUBLIC_SETS[name]
    for file in recipe.files:
        public(Path(recipe.source) / file)
    return build(
        name, obtain(recipe.source, manifest[recipe.source], PUBLIC, parent), manifest[recipe.source], vehicles, parent
    )
