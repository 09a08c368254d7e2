"""The manifest of the public recordings says the same as the recipes that import them."""

import re
from pathlib import Path

import pytest

from rotorid_lab import public_sets
from rotorid_lab.public_list import read_manifest
from tests import public_logs

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


def test_a_file_that_is_missing_or_cut_off_skips_its_test(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = "logs/betaflight/shortLog.BFL"
    public_logs._is_whole.cache_clear()
    monkeypatch.setattr(public_logs, "PUBLIC", tmp_path)
    with pytest.raises(pytest.skip.Exception, match="not here as a whole"):
        public_logs.public(log)
    public_logs._is_whole.cache_clear()
    (tmp_path / log).parent.mkdir(parents=True)
    (tmp_path / log).write_bytes(b"H Product:Blackbox")
    with pytest.raises(pytest.skip.Exception, match="not here as a whole"):
        public_logs.public(log)
    public_logs._is_whole.cache_clear()
