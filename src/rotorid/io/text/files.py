"""Files that people write, read with limits: nothing in one can hang the reader, fill the memory or run code.

How large input may be stands here for every kind of file, so that one limit can be compared with the others. Each is
several times what a sound recording needs; beyond it input is refused in one sentence, before it fills the memory or
takes minutes.
"""

from __future__ import annotations

import math
import os
import re
import stat
from pathlib import Path
from typing import Any

import yaml
from yaml.composer import Composer
from yaml.constructor import SafeConstructor
from yaml.resolver import Resolver

from rotorid.errors import InputError
from rotorid.io.text.wording import neighbour, printable

try:
    from yaml.cyaml import CParser
except ImportError:  # pragma: no cover - depends on the platform
    CParser = None

# Text that people write -----------------------------------------------------------------------------

LARGEST_YAML = 1_000_000
"""Bytes of a YAML file: that of a vehicle has some thousand."""
_DEEPEST_YAML = 50
"""Levels of a YAML file: a vehicle has three, and the reader descends by calling itself."""
MOST_YAML_VALUES = 20_000
"""Values of a YAML file with all its aliases written out: nine lines of aliases can stand for a thousand million."""

# Recording sets -------------------------------------------------------------------------------------

LARGEST_FILE = 2_500_000_000
"""Bytes of a run or a log: an hour at 1 kHz with forty columns has one and a half thousand million as text."""
MOST_ROWS = 5_000_000
"""Samples of a run: 83 minutes at 1 kHz; the analysis of more takes a day."""
MOST_CELLS = 200_000_000
"""Cells of a run, and of all runs of a set: 1.6 GB as floats; an hour at 1 kHz with forty columns has 144 million."""
MOST_RUNS = 1000
"""Runs of a set: a whole campaign on bench and stand has 811 recordings, a vehicle some tens of flights."""
LEAST_UNPACKED = 100_000_000
"""Bytes that any packed file may unpack to: less is no danger."""
MOST_UNPACKED = 60
"""Times its own size that a larger packed file may unpack to: logs have 2 to 10, a bomb a thousand."""
MOST_GZIP_MEMBERS = 20_000
"""Parts of a gzipped file: programs that pack in blocks write one for each 64 kB, and each costs a start."""
LONGEST_JUMP_S = 1800.0
"""Seconds from one sample of a run to the next: pauses are shorter, a clock set to summer time jumps by 3600."""
MOST_GRID, MOST_HOLES = 500_000, 20
"""Steps of the even grid a run is resampled to: that many, or so many times its samples where it has more of them."""

# Logs of autopilots and instruments -----------------------------------------------------------------

LEAST_MEMORY, MEMORY_TIMES_FILE = 1_000_000_000, 100
"""Bytes of memory that reading a log may take: that many, or so many times its own size where that is more."""
LARGEST_RAW_LOG = 256_000_000
"""Bytes of an unpacked raw log: ten hours of the bench at 100 Hz have 110 MB."""
MOST_TRIED_BYTES = 300_000_000
"""Bytes whose checksum is computed in vain behind damaged places of a raw log: about a second."""
LARGEST_INDEX = 100_000_000
"""Bytes of the index of recordings: 811 recordings have 0.2 MB."""
LARGEST_METADATA, MOST_METADATA_VALUES = 10_000_000, 200_000
"""Bytes and values of a recording's metadata: a program writes them, with a line for each step of its plan."""
LARGEST_CHECKPOINT = 100_000_000
"""Bytes of a network's arrays: the largest network here has 0.1 MB."""

# Reading --------------------------------------------------------------------------------------------

_KIND = "tag:yaml.org,2002:"
_DECIMAL = {
    f"{_KIND}int": re.compile(r"[-+]?(0|[1-9][0-9]*)"),
    f"{_KIND}float": re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?|[-+]?\.inf|\.nan", re.IGNORECASE),
}
"""How a number is written. YAML also takes octal, hexadecimal, binary and sexagesimal ones, and underscores."""
_EXPONENT = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)[eE][-+]?[0-9]+")
_FOREIGN = {f"{_KIND}{name}" for name in ("binary", "set", "omap", "pairs")}
"""Kinds of values that no file here holds."""

if CParser is None:  # pragma: no cover - depends on the platform
    _Compiled = yaml.SafeLoader
else:

    class _Compiled(Composer, CParser, SafeConstructor, Resolver):
        """libyaml's parser under the composer written in Python: libyaml's own descends until the stack is full."""

        def __init__(self, stream: str) -> None:
            CParser.__init__(self, stream)
            Composer.__init__(self)
            SafeConstructor.__init__(self)
            Resolver.__init__(self)


def check_file(path: Path) -> int:
    """Size of a regular file, bytes; InputError for anything else that bears its name."""
    try:
        state = os.stat(path)
    except FileNotFoundError:
        if path.is_symlink():
            raise InputError(f"{path}: is a link to {os.readlink(path)}, where no file is") from None
        raise InputError(f"{path}: file is missing{neighbour(path)}") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be opened ({error.strerror or error})") from None
    if stat.S_ISDIR(state.st_mode):
        raise InputError(f"{path}: is a folder, expected a file")
    if not stat.S_ISREG(state.st_mode):
        raise InputError(f"{path}: is a pipe, socket or device, expected a file")
    return state.st_size


def read_bytes(path: Path, most: int) -> bytes:
    """Content of a regular file of at most `most` bytes; InputError in one sentence otherwise."""
    size = check_file(path)
    if size > most:
        raise InputError(f"{path}: has {size / 1e6:.3g} MB, expected at most {most / 1e6:.3g} MB")
    try:
        with open(path, "rb") as file:
            return file.read(size + 1)  # not more: Python makes room for all that is asked for
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None


def check_text(data: bytes, path: Path, first_line: int = 1) -> None:
    """InputError where bytes are no UTF-8 text, with the line and what they look like instead.

    `first_line` is the number of the line that the bytes begin with, where they are a part of the file.
    """
    if first_line == 1 and data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError(f"{path}: is UTF-16 text, expected UTF-8")
    zero = data.find(b"\0")
    if zero >= 0:
        line = data.count(b"\n", 0, zero) + first_line
        share = data[:2000].count(b"\0") / len(data[:2000])
        kind = "UTF-16 text" if 0.3 < share < 0.8 else "binary data"
        raise InputError(f"{path}, line {line}: has a zero byte in it ({kind}?), expected UTF-8 text")
    try:
        data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + first_line
        raise InputError(
            f"{path}, line {line}: byte 0x{data[error.start]:02x} is not UTF-8 text (Latin-1, or not text at all?), "
            "expected UTF-8"
        ) from None


def read_text(path: Path, most: int = LARGEST_YAML) -> str:
    """UTF-8 text of a regular file of at most `most` bytes, without a byte-order mark."""
    data = read_bytes(path, most)
    check_text(data, path)
    return data.decode("utf-8-sig")


def read_yaml(
    path: Path,
    as_written: bool = False,
    most_bytes: int = LARGEST_YAML,
    most_values: int = MOST_YAML_VALUES,
    compiled: bool = False,
) -> dict[str, Any]:
    """A file's YAML mapping; the rest as `parse_yaml`."""
    return parse_yaml(read_text(Path(path), most_bytes), str(path), as_written, most_values, compiled)


def parse_yaml(
    text: str, where: str, as_written: bool = False, most_values: int = MOST_YAML_VALUES, compiled: bool = False
) -> dict[str, Any]:
    """The mapping that a YAML text holds; InputError names `where` and the line of a fault.

    A number stands in decimal digits: `0652`, `0x1A`, `1:30` and `1_000`, which YAML takes for other numbers than most
    people do, are refused. `as_written` keeps every value as the text that stands there (`002` is no number).
    `compiled` reads by libyaml where PyYAML was built with it.
    """
    loader = None
    try:
        loader = (yaml.BaseLoader if as_written else _Compiled if compiled else yaml.SafeLoader)(text)
        node = loader.get_single_node()
        if node is not None:
            _check_node(node, loader, where, most_values)
        content = None if node is None else loader.construct_document(node)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f", line {mark.line + 1}" if mark else ""
        problem = getattr(error, "problem", None) or getattr(error, "reason", None) or "cannot be parsed"
        raise InputError(f"{where}{line}: not valid YAML ({printable(problem)})") from None
    except InputError:
        raise
    except RecursionError:
        raise InputError(f"{where}: is nested too deeply, expected at most {_DEEPEST_YAML} levels") from None
    except (ValueError, OverflowError) as error:  # dates and numbers that cannot be
        raise InputError(f"{where}: not valid YAML ({printable(error)})") from None
    finally:
        if loader is not None:
            loader.dispose()
    if not isinstance(content, dict):
        found = {type(None): "nothing", list: "a list", str: "plain text"}.get(type(content), type(content).__name__)
        raise InputError(f"{where}: expected keys with values, found {found}")
    return content


def with_exponents(value: Any) -> Any:
    """The value, or what a list or mapping holds, with text such as `1e-6` as numbers: YAML 1.1 wants `1.0e-6`."""
    if isinstance(value, dict):
        return {key: with_exponents(v) for key, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [with_exponents(v) for v in value]
    return float(value) if isinstance(value, str) and _EXPONENT.fullmatch(value) else value


def as_yaml(value: str | float) -> str:
    """A value as YAML in one line that is read back as it is.

    Text stands in quotes: without them `0652`, `1:30` and `yes` would be read as something else.
    """
    style = '"' if isinstance(value, str) else None
    return yaml.safe_dump(value, allow_unicode=True, default_style=style, width=math.inf).splitlines()[0]


def _check_node(root: yaml.Node, loader: Any, where: str, most_values: int) -> None:
    """InputError for a key given twice, a value that is no plain one, too many levels, aliases that grow too large."""
    sizes: dict[int, int] = {}
    open_nodes: set[int] = set()

    def size_of(node: yaml.Node, depth: int) -> int:
        line = f"{where}, line {node.start_mark.line + 1}"
        if id(node) in open_nodes:
            raise InputError(f"{line}: an alias refers to itself")
        if depth > _DEEPEST_YAML:
            raise InputError(f"{line}: is nested too deeply, expected at most {_DEEPEST_YAML} levels")
        if id(node) in sizes:
            return sizes[id(node)]
        open_nodes.add(id(node))
        total = 1
        _check_kind(node, loader, line)
        if isinstance(node, yaml.MappingNode):
            _check_keys(node, where)
            total += sum(size_of(key, depth + 1) + size_of(value, depth + 1) for key, value in node.value)
        elif isinstance(node, yaml.SequenceNode):
            total += sum(size_of(value, depth + 1) for value in node.value)
        open_nodes.discard(id(node))
        if total > most_values:
            raise InputError(f"{line}: holds more than {most_values} values (aliases written out)")
        sizes[id(node)] = total
        return total

    size_of(root, 0)


def _check_kind(node: yaml.Node, loader: Any, line: str) -> None:
    """InputError for a number that does not stand in decimal digits, and for `!!binary` and its like."""
    if node.tag in _FOREIGN:
        kind = node.tag.removeprefix(_KIND)
        raise InputError(f"{line}: found !!{kind}, expected text, a number, true or false, a list or keys with values")
    decimal = _DECIMAL.get(node.tag)
    if decimal and isinstance(node, yaml.ScalarNode) and not decimal.fullmatch(node.value):
        taken = printable(loader.construct_object(node))
        raise InputError(
            f"{line}: found {printable(node.value)}, which YAML takes for {taken}; expected a number in decimal digits "
            "(in quotes where text is meant)"
        )


def _check_keys(node: yaml.MappingNode, where: str) -> None:
    seen: dict[str, int] = {}
    for key, _ in node.value:
        line = key.start_mark.line + 1
        if not isinstance(key, yaml.ScalarNode):
            raise InputError(f"{where}, line {line}: a list or mapping stands where a key is expected")
        if key.value in seen:
            raise InputError(
                f"{where}, line {line}: key {printable(key.value)} is there twice (first in line {seen[key.value]})"
            )
        seen[key.value] = line
