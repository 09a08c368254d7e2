"""Metadata of raw logs and their index carry a checksum: a changed bit is reported, an edit can be meant, old ones
read."""

import logging
import random
import shutil
from pathlib import Path

import pytest

from rotorid_acquire.cli import app
from rotorid_acquire.io.logs import read_log
from rotorid_acquire.io.session import INDEX_KEY, read_index, read_session, write_index
from tests.acquire.fault_table import seen
from tests.command_line import invoke
from tests.refusals import refused
from workflow.scripts import ingest

CAMPAIGN = Path(__file__).parents[2] / "raw" / "campaign" / "static"
NAME = "static-al-z-w1-r01"


@pytest.fixture
def log(tmp_path) -> Path:
    """A log of the campaign, its metadata with a checksum beside it, in a folder of its own."""
    for suffix in (".yaml", ".rlog.gz"):
        shutil.copy(CAMPAIGN / (NAME + suffix), tmp_path)
    return tmp_path / f"{NAME}.rlog.gz"


def metadata(log: Path) -> Path:
    return log.with_name(f"{NAME}.yaml")


def without_line(path: Path) -> bytes:
    """What an earlier recorder wrote: the same without its last line."""
    path.write_bytes(path.read_bytes()[: path.read_bytes().rindex(b"metadata_sha256")])
    return path.read_bytes()


def flipped(data: bytes, bit: int) -> bytes:
    return data[: bit // 8] + bytes([data[bit // 8] ^ 1 << bit % 8]) + data[bit // 8 + 1 :]


def command(*words: str) -> tuple[int, str]:
    done = invoke(*words, app=app)
    return done.exit_code, done.output


@seen("a bit of a log's metadata flipped", "36 of 200 changed a load, a mark or a name and nothing was said")
def test_every_flipped_bit_is_noticed(log):
    path, rng = metadata(log), random.Random(42)
    good = path.read_bytes()
    last_line = 8 * good.rindex(b"metadata_sha256")
    anywhere = [rng.randrange(8 * len(good)) for _ in range(200)]
    for bit in anywhere + rng.sample(range(last_line, 8 * len(good)), 50):
        path.write_bytes(flipped(good, bit))
        refused(rf"{NAME}\.yaml", read_session, path)
    path.write_bytes(good)
    assert read_session(path).setup.load_gf == 35.715


@seen("a load of 35.7 gf in the metadata become 135.7", "read as 135.7")
def test_a_changed_load_is_one_sentence_and_an_edit_can_be_meant(log):
    path, bytes_of_log = metadata(log), log.read_bytes()
    edited = path.read_bytes().replace(b"load_gf: 35.715", b"load_gf: 135.715")
    path.write_bytes(edited)
    told = refused("were changed after recording", read_log, log)
    assert f"rotorid-acquire checksum --renew {path}" in told and "\n" not in told
    assert command("check", str(log))[0] == 1
    code, text = command("checksum", str(log))
    assert code == 1 and "were changed after recording" in text and path.read_bytes() == edited
    assert command("checksum", "--renew", str(log)) == (0, f"{log}: 1 checksums written, 0 fitted already\n")
    assert read_session(path).setup.load_gf == 135.715
    before, after = edited.splitlines(), path.read_bytes().splitlines()
    assert before[:-1] == after[:-1] and before[-1] != after[-1] and log.read_bytes() == bytes_of_log


def test_lines_behind_the_checksum_are_noticed_and_kept(log):
    path = metadata(log)
    path.write_bytes(path.read_bytes() + b"group: mine")
    refused("were changed after recording", read_session, path)
    code, text = command("checksum", "--renew", str(path))
    assert code == 1 and "group" in text and "twice" in text  # no metadata: left as it was
    assert path.read_bytes().endswith(b"group: mine")


@seen("metadata of an earlier recorder, without a checksum", "none had one")
def test_metadata_without_a_checksum_are_read_and_that_is_said_once(log, caplog):
    path = metadata(log)
    bare = without_line(path)
    assert read_log(log).session.metadata_sha256 is None
    for words in (("check", str(log)), ("index", str(log.parent))):
        code, text = command(*words)
        assert code == 0 and text.count("no checksum") == 1
    with caplog.at_level(logging.WARNING, "rotorid.ingest"):
        ingest.main([str(log)], str(log.parent / "s.parquet"), str(log.parent / "r.csv"))
    assert [NAME in record.message for record in caplog.records if "no checksum" in record.message] == [True]
    code, text = command("checksum", str(log.parent))
    assert code == 0 and path.read_bytes().startswith(bare)
    assert path.read_bytes() == (CAMPAIGN / path.name).read_bytes()
    assert "no checksum" not in command("check", str(log))[1]


def test_what_holds_no_metadata_is_said(tmp_path):
    (tmp_path / "some.yaml").write_text("mass_kg: 1\n")
    assert command("checksum", str(tmp_path))[0] == 1
    assert "holds no metadata" in command("checksum", str(tmp_path))[1]
    for words in ([], ["--renew"]):
        code, text = command("checksum", *words, str(tmp_path / "none.rlog"))
        assert code == 1 and "none.yaml: no such file" in text


@seen("the first line of a recording's metadata damaged", "the index passed the recording over")
def test_no_recording_falls_out_of_the_index(log):
    path = metadata(log)
    for spoilt in (b"formau: ", b"Format: "):
        path.write_bytes(path.read_bytes().replace(path.read_bytes()[:8], spoilt, 1))
        refused("were changed after recording", write_index, log.parent)


@seen("a bit of the index flipped", "78 of 200 changed a kind, a load or a path and nothing was said")
def test_every_flipped_bit_of_the_index_is_noticed(log):
    write_index(log.parent)
    path, rng = log.parent / "sessions.tsv", random.Random(42)
    good, rows = path.read_bytes(), read_index(log.parent)
    last_row = 8 * good.rindex(INDEX_KEY.encode())
    anywhere = [rng.randrange(last_row) for _ in range(200)]
    for bit in anywhere + rng.sample(range(last_row, 8 * len(good)), 100):
        path.write_bytes(flipped(good, bit))
        refused(r"sessions\.tsv", read_index, log.parent)
    path.write_bytes(good)
    assert [row["id"] for row in rows] == [NAME] and read_index(log.parent) == rows


@seen("a row of the index edited", "taken, whether it was meant or not")
def test_an_edit_of_the_index_can_be_meant(log):
    write_index(log.parent)
    path = log.parent / "sessions.tsv"
    good = path.read_bytes()
    edited = good.replace(b"35.715", b"135.715")
    path.write_bytes(edited)
    told = refused("the index was changed after it was written", read_index, log.parent)
    assert f"rotorid-acquire checksum --renew {path}" in told and "\n" not in told
    code, text = command("checksum", str(path))
    assert code == 1 and "was changed after it was written" in text and path.read_bytes() == edited
    assert command("checksum", "--renew", str(path)) == (0, f"{path}: 1 checksums written, 0 fitted already\n")
    assert [row["load_gf"] for row in read_index(log.parent)] == ["135.715"]
    assert path.read_bytes().splitlines()[:-1] == edited.splitlines()[:-1]
    assert command("index", str(log.parent))[0] == 0 and path.read_bytes() == good


def test_rows_behind_the_checksum_and_a_row_that_is_none_are_told(log):
    write_index(log.parent)
    path = log.parent / "sessions.tsv"
    row = path.read_text().splitlines()[1]
    path.write_text(path.read_text() + row.replace(NAME, "mine", 1) + "\n")
    refused("the index was changed after it was written", read_index, log.parent)
    assert command("checksum", "--renew", str(path))[0] == 0
    assert [row["id"] for row in read_index(log.parent)] == [NAME, "mine"]
    assert path.read_text().splitlines()[-1].startswith(INDEX_KEY)
    path.write_text(path.read_text() + "short\tline\n")
    before = path.read_bytes()
    code, text = command("checksum", "--renew", str(path))
    assert code == 1 and "has 2 cells, expected 22" in text and path.read_bytes() == before


def test_an_index_without_a_checksum_is_read_and_given_one(log):
    write_index(log.parent)
    path = log.parent / "sessions.tsv"
    good, rows = path.read_bytes(), read_index(log.parent)
    path.write_bytes(good[: good.rindex(INDEX_KEY.encode())])
    assert read_index(log.parent) == rows
    assert command("checksum", str(log.parent)) == (0, f"{log.parent}: 1 checksums written, 1 fitted already\n")
    assert path.read_bytes() == good
    assert command("checksum", "--renew", str(path)) == (0, f"{path}: 0 checksums written, 1 fitted already\n")
