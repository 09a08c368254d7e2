"""Records of ROS 1 bags, MCAP files and ROS 2 databases read one after the other, without index or footer.

What is whole before a file ends is kept: a recorder whose battery goes off writes no index, and rosbags then refuses
the file. Channels of MCAP that hold no ROS message are listed and passed over.

Sources: the bag format 2.0; the MCAP specification; the tables of rosbag2's sqlite3 storage.

Packages that only some logs need.
"""

from __future__ import annotations

import bz2
import sqlite3
import struct
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from pathlib import Path
from types import ModuleType, SimpleNamespace
from unittest.mock import patch

from rotorid.errors import InputError
from rotorid.io.text.files import LEAST_UNPACKED, MOST_UNPACKED

_MCAP, _BAG = b"\x89MCAP0\r\n", b"#ROSBAG V2.0\n"
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 0x02, 0x03, 0x04, 0x05, 0x06
"""Codes of MCAP's records."""
_ROS_ENCODINGS = {("ros1msg", "ros1"), ("ros2msg", "cdr"), ("ros2idl", "cdr"), ("omgidl", "cdr")}
"""Encodings of a schema and of its messages that are ROS's."""


@dataclass(frozen=True)
class _Topic:
    """One topic of a file: its type in ROS 2's spelling, the definition of it, and how its messages are encoded."""

    topic: str
    msgtype: str
    schema: str
    """`ros1msg`, `ros2msg`, `ros2idl`, or what a foreign channel states."""
    definition: str
    encoding: str

    @property
    def of_ros(self) -> bool:
        return (self.schema, self.encoding) in _ROS_ENCODINGS


@dataclass
class Records:
    """Every message that is whole, in the order of the file, the channels by number, and whether the file ends early.

    `messages` is read once; `cut` is known after that.
    """

    path: Path
    channels: dict[int, _Topic] = field(default_factory=dict)
    schemas: dict[int, tuple[str, str, str]] = field(default_factory=dict)
    """Name, encoding and text of each schema of an MCAP file."""
    cut: bool = False
    lost_chunks: int = 0
    """Chunks that cannot be unpacked."""

    def messages(self) -> Iterator[tuple[_Topic, int, bytes]]:
        """(channel, time of recording in ns, bytes) of each message of ROS."""
        with open(self.path, "rb") as file:
            head = file.read(16)
        if head.startswith(_MCAP):
            yield from self._of_mcap(self.path.read_bytes()[len(_MCAP) :], False)
        elif head.startswith(_BAG):
            yield from self._of_bag(self.path.read_bytes()[len(_BAG) :], False)
        else:
            yield from self._of_database()

    def _of_mcap(self, data: bytes, in_chunk: bool) -> Iterator[tuple[_Topic, int, bytes]]:
        at = 0
        while at + 9 <= len(data):
            code, size = data[at], struct.unpack_from("<Q", data, at + 1)[0]
            body = data[at + 9 : at + 9 + size]
            at += 9 + size
            if code == _FOOTER:
                return
            if code == _CHUNK and len(body) >= 40:
                compression, place = _string(body, 28)
                yield from self._of_mcap(self._unpacked(body[place + 8 :], compression), True)
            if len(body) < size:
                self.cut = True
                return
            if code == _SCHEMA:
                name, place = _string(body, 2)
                encoding, place = _string(body, place)
                self.schemas[_u16(body, 0)] = name, encoding, _string(body, place)[0]
            elif code == _CHANNEL and (number := _u16(body, 0)) not in self.channels:
                name, schema, text = self.schemas.get(_u16(body, 2), ("", "", ""))
                topic, place = _string(body, 4)
                self.channels[number] = _Topic(topic, _spelled(name), schema, text, _string(body, place)[0])
            elif code == _MESSAGE and (channel := self.channels.get(_u16(body, 0))) and channel.of_ros:
                yield channel, struct.unpack_from("<Q", body, 6)[0], body[22:]
        self.cut |= not in_chunk or at < len(data)

    def _of_bag(self, data: bytes, in_chunk: bool) -> Iterator[tuple[_Topic, int, bytes]]:
        bag_message, bag_header, bag_chunk, bag_connection = 0x02, 0x03, 0x05, 0x07  # Codes of the records of a bag.
        at, indexed = 0, in_chunk
        while at < len(data):
            fields, at = _fields(data, at)
            size = struct.unpack_from("<I", data, at)[0] if at + 4 <= len(data) else len(data)
            body, at = data[at + 4 : at + 4 + size], at + 4 + size
            code = fields.get("op", b"\0")[0]
            if code == bag_chunk:
                yield from self._of_bag(self._unpacked(body, fields["compression"].decode()), True)
            if len(body) < size:
                self.cut = True
                return
            if code == bag_header:
                indexed = struct.unpack("<Q", fields["index_pos"])[0] > 0
            elif code == bag_connection:
                own, _ = _fields(struct.pack("<I", len(body)) + body, 0)
                kind, text = own["type"].decode(), own["message_definition"].decode(errors="replace")
                self.channels[_u32(fields["conn"])] = _Topic(
                    fields["topic"].decode(), _spelled(kind), "ros1msg", text, "ros1"
                )
            elif code == bag_message and (channel := self.channels.get(_u32(fields["conn"]))):
                seconds, rest = struct.unpack("<II", fields["time"])
                yield channel, seconds * 10**9 + rest, body
        self.cut |= not indexed

    def _unpacked(self, data: bytes, compression: str) -> bytes:
        """Bytes of a chunk, as many as can be unpacked of one that is cut off."""
        if compression not in ("bz2", "lz4", "zstd"):
            return data
        try:
            return Unpacking(self.path).of(compression, data, whole=False)
        except (MemoryError, InputError):
            raise
        except Exception:  # each library raises its own
            self.lost_chunks += 1
            return b""

    def _of_database(self) -> Iterator[tuple[_Topic, int, bytes]]:
        with closing(sqlite3.connect(f"{self.path.resolve().as_uri()}?immutable=1", uri=True)) as base:
            base.execute("PRAGMA writable_schema = ON")  # or a file that is shorter than it says is refused at once
            texts = {}
            if base.execute("SELECT 1 FROM sqlite_master WHERE name = 'message_definitions'").fetchone():
                rows = base.execute("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions")
                texts = {kind: (encoding, text) for kind, encoding, text in rows}
            for number, topic, kind, encoding in base.execute(
                "SELECT id, name, type, serialization_format FROM topics"
            ):
                schema, text = texts.get(kind, ("ros2msg", ""))
                self.channels[number] = _Topic(topic, kind, schema or "ros2msg", text, encoding)
            try:
                for number, at, body in base.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY id"):
                    if (channel := self.channels.get(number)) and channel.of_ros:
                        yield channel, at, body
            except sqlite3.DatabaseError:
                self.cut = True


class Unpacking:
    """Unpacks parts of a bag, none of them, nor all that go to the disk, to more than packed files here may hold.

    InputError once they would. `_by_rosbags` unpacks by it too (`in_rosbags`): that library has no bounds of its own.
    """

    def __init__(self, path: Path) -> None:
        files = [path] if path.is_file() else [p for p in path.iterdir() if p.is_file()]
        self.path = path
        self.most = max(LEAST_UNPACKED, MOST_UNPACKED * sum(p.stat().st_size for p in files))
        self.on_disk = 0
        self.too_large: InputError | None = None

    def check(self, size: int) -> None:
        """InputError where so many bytes are too many; it is kept, since a library may put its own in its place."""
        if size > self.most:
            said = f"{self.path}: unpacks to more than {self.most / 1e6:.0f} MB, far more than a bag does"
            self.too_large = InputError(said)
            raise self.too_large

    def of(self, compression: str, data: bytes, whole: bool = True) -> bytes:
        """What a part packed as `bz2`, `lz4` or `zstd` holds; EOFError where it is cut off and `whole` is wanted."""
        make = {
            "bz2": lambda: bz2.BZ2Decompressor(),
            "lz4": lambda: needs("lz4.frame", self.path).LZ4FrameDecompressor(),
            "zstd": lambda: needs("rosbags.rosbag2.storage_mcap", self.path).zstd.ZstdDecompressor(),
        }[compression]
        out, size, reader = [], 0, make()
        while True:
            out.append(reader.decompress(data, self.most - size + 1))
            size += len(out[-1])
            self.check(size)
            data = b""
            if reader.eof:
                data, reader = reader.unused_data or b"", make()
                if not data:
                    return b"".join(out)
            elif not out[-1]:
                if whole:
                    raise EOFError("a packed part is cut off")
                return b"".join(out)

    @contextmanager
    def in_rosbags(self) -> Iterator[None]:
        """Inside, rosbags unpacks within the bounds."""
        ros1, mcap, ros2 = (
            needs(f"rosbags.{name}", self.path) for name in ("rosbag1.reader", "rosbag2.storage_mcap", "rosbag2.reader")
        )
        bounded = {name: partial(self.of, name) for name in ("bz2", "lz4", "zstd")}
        of_files = SimpleNamespace(decompress=bounded["zstd"], open=partial(_BoundedFile, self, ros2.zstd))
        with (
            patch.dict(ros1.decompressors, {k: v for k, v in bounded.items() if k in ros1.decompressors}),
            patch.dict(mcap.DECOMPRESSORS, {k: lambda x, _, k=k: bounded[k](x) for k in ("lz4", "zstd")}),
            patch.object(ros2, "zstd", of_files),
        ):
            try:
                yield
            except Exception:
                if self.too_large is not None:
                    raise self.too_large from None
                raise


class _BoundedFile:
    """A file packed by zstd whose content counts against what may be unpacked to the disk."""

    def __init__(self, bounds: Unpacking, zstd: ModuleType, *arguments) -> None:
        self._bounds, self._file = bounds, zstd.open(*arguments)

    def __enter__(self) -> _BoundedFile:
        return self

    def __exit__(self, *error) -> None:
        self._file.close()

    def read(self, size: int = -1) -> bytes:
        data = self._file.read(size)
        self._bounds.on_disk += len(data)
        self._bounds.check(self._bounds.on_disk)
        return data


def typestores(channels: list[_Topic], path: Path) -> dict[str, object]:
    """rosbags' stores of types by encoding (`ros1`, `cdr`) with what the channels define; a definition that cannot be
    read leaves its type to those that are known."""
    typesys = needs("rosbags.typesys", path)
    stores = {"ros1": typesys.Stores.ROS1_NOETIC, "cdr": typesys.Stores.LATEST}
    found = {encoding: typesys.get_typestore(store) for encoding, store in stores.items()}
    for channel in channels:
        if not channel.definition:
            continue
        try:
            if channel.schema in ("ros1msg", "ros2msg"):
                types = typesys.get_types_from_msg(channel.definition, channel.msgtype)
            else:
                types = typesys.get_types_from_idl(channel.definition)
            found[channel.encoding].register({k: v for k, v in types.items() if k not in found[channel.encoding].types})
        except Exception:  # rosbags lets whatever a strange definition raises through
            continue
    return found


def _fields(data: bytes, at: int) -> tuple[dict[str, bytes], int]:
    """The fields of a bag's header at a place, none where it is cut off, and the place after it."""
    if at + 4 > len(data):
        return {}, len(data)
    size = struct.unpack_from("<I", data, at)[0]
    header, at = data[at + 4 : at + 4 + size], at + 4 + size
    fields, place = {}, 0
    while len(header) == size and place + 4 <= size:
        length = struct.unpack_from("<I", header, place)[0]
        name, _, value = header[place + 4 : place + 4 + length].partition(b"=")
        fields[name.decode("latin-1")] = value
        place += 4 + length
    return fields, at


def _u32(data: bytes) -> int:
    return struct.unpack("<I", data)[0]


def _u16(data: bytes, at: int) -> int:
    return struct.unpack_from("<H", data, at)[0]


def _string(data: bytes, at: int) -> tuple[str, int]:
    """A string behind its length, and the place after it."""
    size = struct.unpack_from("<I", data, at)[0]
    return data[at + 4 : at + 4 + size].decode(errors="replace"), at + 4 + size


def _spelled(msgtype: str) -> str:
    """A type's name as ROS 2 spells it: `sensor_msgs/Imu` is `sensor_msgs/msg/Imu`."""
    package, _, name = msgtype.rpartition("/")
    return f"{package}/msg/{name}" if package and "/" not in package else msgtype


def needs(module: str, path: object) -> ModuleType:
    """The module, or an InputError that says how it is installed."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        if error.name and error.name.split(".")[0] != module.split(".")[0]:
            raise
        raise InputError(
            f"{path}: reading it needs {module.split('.')[0]}, which is not installed: pip install 'rotorid[ros]'"
        ) from None
