"""Raw logs, metadata, indexes, checkpoints, descriptions and plans that are none: one sentence each, soon, and little
memory. What was seen before stands beside those that were not as they should be."""

import gzip
import io
import os
import pickle
import struct
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from rotorid_acquire.io import rawlog
from rotorid_acquire.io.lines import read_description
from rotorid_acquire.io.logs import read_log, read_tables
from rotorid_acquire.io.session import INDEX_COLUMNS, index_with_checksum, read_index, read_session, write_index
from rotorid_acquire.run_plan import read_plan, steps_of
from rotorid_lab.networks import Training, build, train
from tests.refusals import refused

MOST_S = 10.0
SESSION = """\
format: rotorid-session-1
id: run
instrument: bench
started: '2024-03-04T09:00:00-06:00'
host_start_ns: 0
setup:
  kind: static
  load_gf: 100.0
  air: {temperature_c: 23.0, pressure_pa: 95400.0, relative_humidity: 0.5}
log: run.rlog
ended: finished
message: done
"""
ROW = dict.fromkeys(INDEX_COLUMNS, "") | {"id": "run", "file": "a/run.rlog", "metadata": "a/run.yaml"}
DESCRIPTION = "name: x\nseparator: ','\ncolumns: {force_z_n: {field: 1}}\n"
PLAN = "name: p\nout: out\nports: {bench: /dev/b}\nsteps:\n  - {name: a, do: stream, instrument: bench}\n"


@dataclass(frozen=True)
class Wrong:
    """A wrong file: `spoil` writes it, `read` is what takes it; `said` are words of the sentence."""

    name: str
    file: str
    spoil: Callable[[Path], object]
    read: Callable[[Path], object]
    said: tuple[str, ...]


def written(content: str | bytes) -> Callable[[Path], object]:
    data = content if isinstance(content, bytes) else content.encode()
    return lambda path: path.write_bytes(data)


def kinds_of_file(file: str, read: Callable[[Path], object], text: str) -> list[Wrong]:
    """What may bear the name of any text file."""
    return [
        Wrong(f"{file}: {what}", file, spoil, read, said)
        for what, spoil, said in [
            ("folder", lambda path: path.mkdir(), ("is a folder",)),
            ("pipe", lambda path: os.mkfifo(path), ("pipe",)),
            ("loop of links", lambda path: path.symlink_to(path.name), ("cannot be opened",)),
            ("UTF-16", written(text.encode("utf-16")), ("UTF-16",)),
            ("Latin-1", written(text.encode() + "# \xe9\n".encode("latin-1")), ("0xe9",)),
            ("zero bytes", written(text + "\0"), ("zero byte",)),
        ]
    ]


def yaml_faults(file: str, read: Callable[[Path], object], text: str) -> list[Wrong]:
    """What may stand in any YAML file."""
    bomb = "a: &a [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
        f"{chr(98 + i)}: &{chr(98 + i)} [{', '.join([f'*{chr(97 + i)}'] * 10)}]\n" for i in range(9)
    )
    return [
        *kinds_of_file(file, read, text),
        *(
            Wrong(f"{file}: {what}", file, written(content), read, said)
            for what, content, said in [
                ("empty", "", ("found nothing",)),
                ("a list", "- a\n- b\n", ("found a list",)),
                ("plain text", "hello", ("found plain text",)),
                ("open bracket", text + "x: [1, 2\n", ("not valid YAML", "line")),
                ("tab", text + "\tx: 1\n", ("not valid YAML", "line")),
                ("key given twice", text + "name: a\nname: b\n", ("there twice",)),
                ("alias to itself", text + "x: &a [*a]\n", ("refers to itself",)),
                ("alias bomb", text + bomb, ("values (aliases written out)",)),
                ("nested deeply", text + "x: " + "[" * 300 + "]" * 300 + "\n", ("nested too deeply",)),
                ("nested very deeply", text + "x: " + "[" * 200_000, ("nested too deeply",)),
                ("unknown tag", text + "x: !!python/object/apply:os.system [id]\n", ("not valid YAML",)),
                ("key that nobody knows", text + "colour: red\n", ("colour: no such key is known",)),
                ("ten megabytes", text + "# " + "x" * 10_000_001 + "\n", ("MB",)),
            ]
        ),
    ]


def session(what: str, old: str, new: str, *said: str) -> Wrong:
    assert old in SESSION, old
    return Wrong(f"run.yaml: {what}", "run.yaml", written(SESSION.replace(old, new, 1)), read_session, said)


def log(what: str, content: bytes, *said: str) -> Wrong:
    return Wrong(f"run.rlog: {what}", "run.rlog", written(content), read_log, said)


def index(what: str, text: str, *said: str) -> Wrong:
    return Wrong(f"sessions.tsv: {what}", "sessions.tsv", written(text), lambda path: read_index(path.parent), said)


def tsv(*rows: dict) -> str:
    return "\n".join(["\t".join(INDEX_COLUMNS), *("\t".join(row.values()) for row in rows)]) + "\n"


def network(path: Path):
    """Go on with a training from a checkpoint."""
    rng = np.random.default_rng(0)
    return train(
        build((2, 3, 1), ("sigmoid", "linear"), rng), np.zeros((4, 2)), np.zeros((4, 1)), Training(0.1, 5), path
    )


def checkpoint(what: str, change: Callable[[dict], object], *said: str) -> Wrong:
    def spoil(path: Path) -> None:
        network(path)
        with np.load(path) as held:
            arrays = {name: held[name] for name in held.files}
        change(arrays)
        np.savez(path, **arrays)

    return Wrong(f"c.npz: {what}", "c.npz", spoil, network, said)


def _cut_checkpoint(path: Path) -> None:
    network(path)
    path.write_bytes(path.read_bytes()[:300])


def _flipped_checkpoint(path: Path) -> None:
    network(path)
    with np.load(path) as held:
        weights = held["w0"].tobytes()
    data = bytearray(path.read_bytes())
    data[data.index(weights)] ^= 1
    path.write_bytes(data)


def _bomb(path: Path) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as parts, parts.open("w0.npy", "w", force_zip64=True) as part:
        part.write(b"\x93NUMPY")
        for _ in range(300):
            part.write(bytes(1_000_000))


class _Runs:
    def __reduce__(self):
        return (os.system, ("touch it-ran",))


def _pickled(path: Path) -> None:
    held = io.BytesIO()
    np.save(held, np.array([_Runs()], dtype=object), allow_pickle=True)
    with zipfile.ZipFile(path, "w") as parts:
        parts.writestr("w0.npy", held.getvalue())


def gzip_of(size: int) -> bytes:
    """A gzip file that unpacks to a log's head and so many zeros."""
    held = io.BytesIO()
    with gzip.GzipFile(fileobj=held, mode="wb", mtime=0) as file:
        file.write(rawlog.MAGIC)
        for _ in range(size // 1_000_000):
            file.write(bytes(1_000_000))
    return held.getvalue()


def plan(what: str, old: str, new: str, *said: str) -> Wrong:
    assert old in PLAN, old
    return Wrong(f"plan.yaml: {what}", "plan.yaml", written(PLAN.replace(old, new, 1)), _planned, said)


def _planned(path: Path):
    return steps_of(read_plan(path))


def described(what: str, text: str, *said: str) -> Wrong:
    return Wrong(f"d.yaml: {what}", "d.yaml", written(text), read_description, said)


SUMMED = index_with_checksum(tsv(ROW).encode()).decode()
TABLE = [
    *yaml_faults("run.yaml", read_session, SESSION),  # before: UnicodeDecodeError, IsADirectoryError, a crash, no end
    session("no id", "id: run\n", "", "id: is missing"),
    session("another format", "rotorid-session-1", "rotorid-session-9", "format: found 'rotorid-session-9'"),
    session("a misspelled key", "instrument:", "instrumnet:", "did you mean instrument?"),
    session("a misspelled key of the setup", "load_gf", "load_fg", "setup.load_fg", "did you mean load_gf?"),
    session("text as the load", "100.0", "a lot", "setup.load_gf: found 'a lot', expected a number"),
    session("true as the load", "100.0", "true", "setup.load_gf: found true, expected a number"),  # before: 1 gf
    session("no number as the load", "100.0", ".nan", "setup.load_gf: found nan, expected a finite number"),
    session("an infinite load", "100.0", ".inf", "setup.load_gf: found inf, expected a finite number"),
    session("pressure in hPa", "95400.0", "954.0", "setup.air.pressure_pa", "10000 or more"),  # before: density / 100
    session("absolute zero", "23.0", "-273.15", "setup.air.temperature_c"),  # before: ZeroDivisionError, later
    session("humidity in percent", "0.5", "50", "setup.air.relative_humidity", "at most 1"),
    session("a start that is no time", "'2024-03-04T09:00:00-06:00'", "noon", "started: found 'noon'"),
    session(
        "a log elsewhere", "run.rlog", "../run.rlog", "log: found '../run.rlog'"
    ),  # before: ValueError in the index
    session("a log of no name", "run.rlog", "''", "log: found ''"),
    session("a fraction as the cell", "kind: static", "cell: 1.5", "setup.cell", "a whole number"),
    session("two numbers as a place", "kind: static", "sensor_position_m: [0, 1]", "setup.sensor_position_m"),
    session("an ending of no kind", "ended: finished", "ended: well", "ended: found 'well'"),
    *kinds_of_file("run.rlog", read_log, "")[:3],  # before: a pipe was waited for
    log("empty of everything but a table", b"time_s,force_x_n\n0,1\n", "does not begin with"),
    log("a picture", b"\x89PNG\r\n\x1a\n" + bytes(100), "does not begin with"),
    log("its head alone", rawlog.MAGIC, "no start record"),
    log("its head and zeros", rawlog.MAGIC + bytes(2_000_000), "no start record"),
    # before: 21 kB of checksum at each byte, half a minute a megabyte
    log("its head and one letter", rawlog.MAGIC + b"R" * 1_000_000, "no start record"),
    log(
        "heads of chunks without end",
        rawlog.MAGIC + b"".join(struct.pack("<BQH", 82, i, 0xFFFF) for i in range(100_000)),
        "no start record",
    ),
    log("a gzip of something else", gzip.compress(b"hello"), "does not begin with"),
    log("a gzip bomb", gzip_of(300_000_000), "unpacks to more than 256 MB"),  # before: all of it in memory, twice
    log("the head of a gzip", b"\x1f\x8b", "no start record"),
    log("notes that are no notes", rawlog.MAGIC + rawlog.pack_chunk(rawlog.NOTE, 1, b"\xff[") * 3, "no start record"),
    *kinds_of_file("sessions.tsv", lambda path: read_index(path.parent), tsv(ROW)),
    index("empty", "", "line 1: the columns should be"),
    index("another heading", tsv(ROW).replace("instrument", "instrumnet"), "did you mean instrument?"),
    index("a heading too few", tsv().replace("\tmetadata", ""), "metadata is wrong"),
    index("a cell too few", tsv(ROW) + "run\tx\n", "line 3: has 2 cells, expected 22"),  # before: None in the rows
    index("a cell too many", tsv(ROW).rstrip("\n") + "\tx\n", "line 2: has 23 cells, expected 22"),
    index("a recording twice", tsv(ROW, ROW), "line 3: run is there twice (first in line 2)"),
    index("a file elsewhere", tsv(ROW | {"file": "../../x.rlog"}), "line 2: file: found '../../x.rlog'"),
    index("a file of the whole computer", tsv(ROW | {"metadata": "/x.yaml"}), "line 2: metadata"),
    # before: a kind, an order or a load of another recording was taken
    index("a changed name", SUMMED.replace("\nrun\t", "\nrum\t"), "was changed after it was written", "--renew"),
    index("a changed path", SUMMED.replace("a/run.rlog", "a/ran.rlog"), "was changed after it was written"),
    index("a row behind", SUMMED + SUMMED.splitlines()[1].replace("run", "new") + "\n", "was changed after"),
    index("an open quotation", tsv(ROW | {"kind": '"a'}), "not a table"),
    *kinds_of_file("c.npz", network, "")[:2],
    Wrong("c.npz: text", "c.npz", written("hello"), network, ("cannot be read as a checkpoint",)),
    Wrong("c.npz: empty", "c.npz", written(""), network, ("cannot be read as a checkpoint",)),
    Wrong("c.npz: cut", "c.npz", _cut_checkpoint, network, ("cannot be read as a checkpoint",)),
    # before: not noticed, the training went on with wrong weights
    Wrong("c.npz: a bit flipped", "c.npz", _flipped_checkpoint, network, ("cannot be read as a checkpoint",)),
    Wrong("c.npz: a bomb", "c.npz", _bomb, network, ("unpacks to 300 MB",)),
    Wrong("c.npz: a pickled object", "c.npz", _pickled, network, ("cannot be read as a checkpoint",)),
    Wrong("c.npz: a pickle", "c.npz", written(pickle.dumps({"w0": 1})), network, ("cannot be read",)),
    checkpoint("weights of another form", lambda a: a.update(w0=np.zeros((9, 9))), "of another network"),
    checkpoint("a layer too many", lambda a: a.update(w2=np.zeros((1, 1))), "of another network"),
    checkpoint("no weights", lambda a: a.pop("w0"), "of another network"),
    checkpoint("weights not finite", lambda a: a["w0"].fill(np.nan), "weights that are no numbers"),  # before: went on
    checkpoint("weights as text", lambda a: a.update(w0=a["w0"].astype(str)), "no checkpoint of a training"),
    checkpoint("epoch below zero", lambda a: a.update(epoch=-3), "no checkpoint of a training"),  # before: went on
    checkpoint("epoch as a fraction", lambda a: a.update(epoch=2.5), "no checkpoint of a training"),
    checkpoint("history of another form", lambda a: a.update(history=np.zeros(3)), "no checkpoint of a training"),
    *yaml_faults("d.yaml", read_description, DESCRIPTION),
    described("no columns", "name: x\ncolumns: {}\n", "expected at least one"),
    described("baud rate below zero", DESCRIPTION + "baud_rate: -9600\n", "baud_rate: found -9600, expected a number"),
    described("an endless scale", DESCRIPTION.replace("1}", "1, scale: .inf}"), "scale", "a finite number"),
    described("an empty separator", DESCRIPTION.replace("','", "''"), "separator: found '', expected text"),
    described("one sign for two things", DESCRIPTION + "decimal: ','\n", "the same sign"),
    *yaml_faults("plan.yaml", _planned, PLAN),
    plan("repeats below one", "do: stream", "do: stream, repeats: 0", "repeats: found 0, expected a number of 1 or"),
    plan("true as the load", "do: stream", "do: stream, setup: {load_gf: true}", "setup.load_gf: found true"),
    plan("a setting of no use", "do: stream", "do: stream, settings: {sampels: 5}", "did you mean samples?"),
    plan("values that nothing reads", "do: stream", "do: stream, over: {wieght: [1]}", "over.wieght: nothing reads it"),
    plan("a name with an attribute", "name: a", "name: 'a-{repeat.x}'", "is not in `over`"),  # before: AttributeError
]


@pytest.mark.parametrize("wrong", TABLE, ids=lambda wrong: wrong.name)
def test_one_sentence_names_the_file(wrong: Wrong, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / wrong.file
    wrong.spoil(path)
    before = sorted(p.name for p in tmp_path.iterdir())
    start = time.process_time()
    text = refused(None, wrong.read, path)
    assert time.process_time() - start < MOST_S
    assert text.startswith(str(tmp_path)) or wrong.file == "plan.yaml"
    assert text.isprintable() and len(text) < 700 + len(str(path)) and all(words in text for words in wrong.said), text
    foreign = ("Input should be", "Field required", "Extra inputs", "pydantic", "NoneType", "<class")
    assert not any(words in text for words in foreign), text
    assert sorted(p.name for p in tmp_path.iterdir()) == before, "nothing is written, nothing runs"


def test_the_sound_ones_are_taken(tmp_path: Path) -> None:
    for name, text, read in (
        ("run.yaml", SESSION, read_session),
        ("d.yaml", DESCRIPTION, read_description),
        ("plan.yaml", PLAN, _planned),
        ("sessions.tsv", tsv(ROW, ROW | {"id": "other"}), lambda path: read_index(path.parent)),
    ):
        (tmp_path / name).write_text(text)
        assert read(tmp_path / name)


CHECK = """
import re, sys
from rotorid_acquire.cli import app
try:
    app(["check", sys.argv[1]])
finally:
    print(re.search(r"VmHWM:\\s+(\\d+)", open("/proc/self/status").read())[1])
"""


@pytest.mark.parametrize("content", [gzip_of(1_000_000_000), rawlog.MAGIC + b"R" * 2_000_000], ids=["bomb", "letters"])
def test_the_command_takes_little_memory(content: bytes, tmp_path: Path) -> None:
    """Before: a gzip of 1 MB filled 2 GB; a megabyte of one letter took a minute."""
    path = tmp_path / "run.rlog"
    path.write_bytes(content)
    done = subprocess.run([sys.executable, "-c", CHECK, str(path)], capture_output=True, text=True, timeout=120)
    assert done.returncode == 1 and len(done.stderr.strip().splitlines()) == 1, done.stderr
    assert int(done.stdout) * 1024 < 1_000_000_000


def test_the_index_is_whole_or_the_old_one(tmp_path: Path, monkeypatch) -> None:
    """Before: the file was emptied first, so a full disk took the index that was there."""
    (tmp_path / "run.yaml").write_text(SESSION)
    write_index(tmp_path)
    before = (tmp_path / "sessions.tsv").read_bytes()
    (tmp_path / "b.yaml").write_text(SESSION.replace("id: run", "id: b"))

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError):
        write_index(tmp_path)
    assert (tmp_path / "sessions.tsv").read_bytes() == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["b.yaml", "run.yaml", "sessions.tsv"]


def test_a_pipe_or_a_folder_among_the_metadata_is_passed_over(tmp_path: Path) -> None:
    """Before: a pipe whose name ends in .yaml was waited for."""
    (tmp_path / "run.yaml").write_text(SESSION)
    os.mkfifo(tmp_path / "p.yaml")
    (tmp_path / "f.yaml").mkdir()
    assert [row["id"] for row in write_index(tmp_path)] == ["run"]


def test_logs_of_the_campaign_are_still_read_whole() -> None:
    raw = Path(__file__).parents[3] / "raw"
    rows = [row for row in read_index(raw) if row["kind"] == "thrust"][:3]
    samples, recordings = read_tables(raw / row["file"] for row in rows)
    assert recordings["complete"].all() and len(samples) == recordings["samples"].sum() > 100
