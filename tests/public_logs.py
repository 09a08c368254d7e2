"""Where other laboratories' logs are, and the mark of a test that needs them."""

import os
from functools import cache
from pathlib import Path

import pytest

from rotorid_lab.public_list import read_manifest
from rotorid_lab.public_sets import PUBLIC_SETS, build, obtain, sha256

_named = os.environ.get("ROTORID_PUBLIC_DATA")
ROOT = Path(__file__).resolve().parents[1]
PUBLIC = (ROOT / _named).resolve() if _named else ROOT.parent / "shared" / "data"
_SHA256 = {
    "logs/ardupilot/copter-3.3-dev_31.BIN": "e8ca56c1549931a1596b22770a306e7f0ca838290d7f61b5590889d9ecbd9855",
    "logs/ardupilot/copter-3.4_22.BIN": "80cfe60d472634a74fb44898598985bc5d31b0f321138752a1f25a91ca7f916a",
    "logs/betaflight/shortLog.BFL": "6a5bd5fbb1745d7c3d49e8528bcbe69405ae1034c9dda35a0eea530b307870bf",
    "logs/csv-ddd/quadrotor_model.csv": "9bb6fd1012ac645b209b4535aaf4142102ffb829df3125aefafeb8b564f0619c",
    "logs/ros2-plotjuggler/metadata.yaml": "ced139a8c29c77677a643825c6765f83d8bf7f75cb041d156c131d8962023d9a",
    "logs/ros2-plotjuggler/rosbag2_test_0.db3": "9dfe6f35027f0ac47f3647578dbf112c300c5920ca7733fb8ccfbf5d1b4464a9",
}
"""Logs that no set of the manifest is made of."""


@cache
def _sums() -> dict[str, str]:
    manifest = read_manifest(ROOT / "workflow" / "public_data.yaml")
    return _SHA256 | {f"{s}/{file['path']}": file["sha256"] for s in manifest for file in manifest[s]["files"]}


@cache
def _is_whole(path: str) -> bool:
    """Whether a file is there as it was published: a folder may be half copied, and the last file cut off."""
    file, wanted = PUBLIC / path, _sums().get(path)
    return file.is_file() and (wanted is None or sha256(file) == wanted)


def public(path: str | Path) -> Path:
    """A file of the public recordings; where it is not here, or not whole, the test is skipped."""
    if not _is_whole(Path(path).as_posix()):
        pytest.skip(f"{path} of the public recordings is not here as a whole")
    return PUBLIC / path


def built(name: str, manifest: dict, vehicles: Path, parent: Path) -> Path:
    """The folder of a public set made below `parent`; where a file of it is not here as a whole the test is skipped."""
    recipe = PUBLIC_SETS[name]
    for file in recipe.files:
        public(Path(recipe.source) / file)
    return build(
        name, obtain(recipe.source, manifest[recipe.source], PUBLIC, parent), manifest[recipe.source], vehicles, parent
    )
