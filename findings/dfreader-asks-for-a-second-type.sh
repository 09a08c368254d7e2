#!/usr/bin/env bash
# One would guess: on an open ArduPilot log pymavlink's recv_match(type="ATT") gives the next ATT after the place where
# the reader stands, whatever was asked for before, as on a serial link.
#
# What happens: the first call fixes the kinds that are looked for. Asked for another kind the reader goes on looking
# for the first and returns None, "end of log": no ATT at all, no error, until rewind() is called.
#
# Why it matters: "read the first MODE (or GPS, or VER), then loop over ATT" is an empty or a shortened flight.
#
# Output seen:
#   pymavlink 2.4.50
#   MODE 5 read, then ATT asked for: 0 of 100 messages; after rewind(): 100; in a fresh reader: 100
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check pymavlink==2.4.50
env/bin/python - <<'END'
import struct
from importlib.metadata import version
from pymavlink import DFReader

C = {"Q": "Q", "B": "B", "c": "h", "n": "4s", "N": "16s", "Z": "64s"}
KINDS = {
    128: ("FMT", "BBnNZ", "Type,Length,Name,Format,Columns"),
    1: ("MODE", "QBB", "TimeUS,ModeNum,Rsn"),
    2: ("ATT", "Qccc", "TimeUS,Roll,Pitch,Yaw"),
}


def code(form):
    return "<" + "".join(C[c] for c in form)


def put(kind, *v):
    return b"\xa3\x95" + bytes([kind]) + struct.pack(code(KINDS[kind][1]), *v)


log = b"".join(
    put(128, k, 3 + struct.calcsize(code(f)), n.encode(), f.encode(), c.encode()) for k, (n, f, c) in KINDS.items()
)
log += put(1, 1_000_000, 5, 1)
log += b"".join(put(2, 2_000_000 + 40_000 * i, 10 * i, 0, 0) for i in range(100))
path = "log.bin"
with open(path, "wb") as file:
    file.write(log)


def count(reader, kind):
    n = 0
    while reader.recv_match(type=kind) is not None:
        n += 1
    return n


r = DFReader.DFReader_binary(path)
first = r.recv_match(type="MODE").ModeNum
after = count(r, "ATT")
r.rewind()
again = count(r, "ATT")
fresh = count(DFReader.DFReader_binary(path), "ATT")
print("pymavlink", version("pymavlink"))
print(
    f"MODE {first} read, then ATT asked for: {after} of 100 messages; after rewind(): {again}; in a fresh reader: {fresh}"
)
assert (again, fresh) == (100, 100)
assert after == 0, "a second kind is found without rewind() now"
END
