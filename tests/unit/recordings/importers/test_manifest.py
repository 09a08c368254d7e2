"""The manifest of the public recordings says the same as the recipes that import them."""

import re
from pathlib import Path

from rotorid.io.public_list import read_manifest
from rotorid.recordings.importers import public_sets

MANIFEST = Path(__file__).parents[4] / "workflow" / "public_data.yaml"


def test_the_manifest_names_the_sets_that_the_recipes_make() -> None:
    listed = {source: entry["sets"] for source, entry in read_manifest(MANIFEST).items()}
    assert listed == {source: public_sets.sets_of(source) for source in listed}
    assert sum(map(len, listed.values())) == len(public_sets.PUBLIC_SETS)


def test_every_file_has_a_hash_and_every_source_its_origin() -> None:
    for entry in read_manifest(MANIFEST).values():
        assert re.fullmatch(r"[0-9a-f]{40}", entry["commit"])
        assert entry["licence"] and entry["citation"]
        assert all(re.fullmatch(r"[0-9a-f]{64}", file["sha256"]) for file in entry["files"])
