"""Logs of other makers: sound ones are read, damaged ones read or refused in one sentence, bombs refused."""

import bz2
import gzip
import os
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rotorid.recordings.importers.guessing import guess
from rotorid.recordings.importers.logfile import read_log
from rotorid.recordings.importers.mapping import read_columns
from tests.forked import Commands, commands
from tests.fuzz.foreign import SOUND, look, sound

NEEDS = {"log.bag": "rosbags", "log.mcap": "rosbags"}
SLOW = ("log.bag", "log.mcap")
DAMAGE = Path(__file__).parent / "damage"
"""What was found to end in a traceback, one file each."""
LONG = os.environ.get("HYPOTHESIS_PROFILE") == "long"


@pytest.mark.parametrize("name", SOUND)
def test_the_sound_ones_are_read(name: str, tmp_path: Path) -> None:
    pytest.importorskip(NEEDS.get(name, "rotorid"))
    path = tmp_path / name
    path.write_bytes(sound(name))
    mapping = guess(read_columns(path)).mapping if name == "other.csv" else None
    assert all(len(table) > 3 for table in read_log(path, mapping).runs.values())


damages = st.lists(
    st.tuples(st.integers(0, 2**24 - 1), st.integers(0, 39), st.binary(max_size=2)), min_size=1, max_size=4
)


@pytest.mark.parametrize("name", [n for n in SOUND if n not in SLOW])
@settings(
    max_examples=2000 if LONG else 20,
    deadline=None,
    derandomize=not LONG,
    database=None,
    suppress_health_check=list(HealthCheck),
)
@given(damages=damages)
def test_damage_ends_in_one_sentence_at_most(name: str, damages, tmp_path_factory) -> None:
    pytest.importorskip(NEEDS.get(name, "rotorid"))
    data = bytes([list(SOUND).index(name)])
    for place, cut, new in damages:
        data += place.to_bytes(3, "little") + bytes([cut, len(new)]) + new.ljust(2, b"\0")
    look(data, tmp_path_factory.getbasetemp())


@pytest.mark.parametrize("path", sorted(DAMAGE.iterdir()), ids=lambda path: path.name)
def test_what_was_found_before(path: Path, tmp_path: Path) -> None:
    name = list(SOUND)[path.read_bytes()[0] % len(SOUND)]
    pytest.importorskip(NEEDS.get(name, "rotorid"))
    look(path.read_bytes(), tmp_path)


def mat_bomb() -> bytes:
    """A MATLAB file whose one matrix unpacks to three thousand million bytes."""
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<HH", 0x0100, 0x4D49)
    size = 3_000_000_000
    inner = struct.pack("<II", 14, size + 56) + struct.pack("<IIII", 6, 8, 6, 0)
    inner += struct.pack("<IIii", 5, 8, 1, size // 8)
    inner += struct.pack("<HH4s", 1, 1, b"m\0\0\0") + struct.pack("<II", 9, size)
    packer = zlib.compressobj()
    body = packer.compress(inner) + packer.flush(zlib.Z_FULL_FLUSH)
    # Without a memory of what came before, the same block again is the same bytes again.
    block = packer.compress(bytes(30_000_000)) + packer.flush(zlib.Z_FULL_FLUSH)
    body += block * 100
    return head + struct.pack("<II", 15, len(body)) + body


def bag_bomb() -> bytes:
    """A bag whose one chunk, by bzip2, unpacks to three thousand million bytes."""

    def record(fields: dict[str, bytes], data: bytes) -> bytes:
        head = b"".join(struct.pack("<I", len(k) + 1 + len(v)) + k.encode() + b"=" + v for k, v in fields.items())
        return struct.pack("<I", len(head)) + head + struct.pack("<I", len(data)) + data

    packed = bz2.compress(bytes(30_000_000), 9) * 100  # streams one after the other are one stream
    number = struct.pack("<I", 0)
    connection = record(
        {"op": b"\7", "conn": number, "topic": b"/imu"},
        b"".join(
            struct.pack("<I", len(x)) + x
            for x in (
                b"topic=/imu",
                b"type=sensor_msgs/Imu",
                b"md5sum=76b81e0561db142e2fc5c30d562dc4be",
                b"message_definition=float64 x\n",
            )
        ),
    )
    chunk = record({"op": b"\5", "compression": b"bz2", "size": struct.pack("<I", 3_000_000_000)}, packed)
    start = 13 + 4096
    info = record(
        {
            "op": b"\6", "ver": struct.pack("<I", 1), "chunk_pos": struct.pack("<Q", start),
            "start_time": bytes(8), "end_time": b"\xff" * 8, "count": struct.pack("<I", 1),
        },
        number + struct.pack("<I", 1),
    )  # fmt: skip
    index = record({"op": b"\4", "ver": struct.pack("<I", 1), "conn": number, "count": struct.pack("<I", 1)}, bytes(12))
    fields = {
        "op": b"\3", "index_pos": struct.pack("<Q", start + len(chunk) + len(index)),
        "conn_count": struct.pack("<I", 1), "chunk_count": struct.pack("<I", 1),
    }  # fmt: skip
    bare = len(record(fields, b""))
    return b"#ROSBAG V2.0\n" + record(fields, b" " * (4096 - bare)) + chunk + index + connection + info


@pytest.fixture(scope="module")
def command(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Commands]:
    """The command line, ready to import a log."""
    folder = tmp_path_factory.mktemp("command")
    (folder / "log.csv").write_text("time_s,x\n0,0\n")
    with commands(folder, "import", folder / "log.csv", "-o", folder / "set", "--like", "five-inch") as ready:
        yield ready


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the system says nothing of a process's memory")
@pytest.mark.parametrize(
    ("name", "make", "said"),
    [
        ("log.mat", mat_bomb, "memory"),
        ("log.bag", bag_bomb, "unpacks"),
        ("log.csv.gz", lambda: gzip.compress(b"time_s,x\n" + b"0,0\n" * 60_000_000, 1), "more than 5000000 samples"),
        ("wide.csv.gz", lambda: gzip.compress(b"time_s,x\n" + b"0,%b\n" % (b"0" * 1000) * 300_000, 1), "unpacks to"),
    ],
)
def test_a_bomb_is_refused_with_little_memory(name: str, make, said: str, tmp_path: Path, command) -> None:
    """Before: a MATLAB file or bag of some megabytes filled three thousand million bytes."""
    pytest.importorskip(NEEDS.get(name, "rotorid"))
    path = tmp_path / name
    path.write_bytes(make())
    assert path.stat().st_size < 10_000_000
    done = command.run("import", path, "-o", tmp_path / "set", "--like", "five-inch")
    assert done.code == 1 and len(done.said.strip().splitlines()) == 1, done.said
    assert str(path) in done.said and said in done.said, done.said
    assert done.most_bytes < 1_600_000_000
    assert not (tmp_path / "set").exists()
