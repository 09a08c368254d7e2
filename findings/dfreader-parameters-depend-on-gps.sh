#!/usr/bin/env bash
# One would guess: `params` of a freshly opened ArduPilot log in pymavlink is empty, or holds the values at the start,
# or always those at the end.
#
# What happens: opening looks for the first GPS message with a week and takes along every PARM on its way. With GPS
# `params` holds the values of before the fix; without (indoors, motion capture) the search runs to the end, and it
# holds the last values before a message was read. rewind() does not bring back the old ones.
#
# Why it matters: gains, MOT_* and SERVO* scale a flight, and are tuned in flight. The same code takes the value before
# or after the change according to whether the vehicle saw satellites.
#
# Output seen:
#   pymavlink 2.4.50 - ATC_RAT_RLL_P is 0.1, from 60 s on 0.2
#   with GPS: just opened 0.1, read through and rewound 0.2
#   without GPS: just opened 0.2, read through and rewound 0.2
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

C = {"Q": "Q", "B": "B", "I": "I", "H": "H", "f": "f", "L": "i", "n": "4s", "N": "16s", "Z": "64s"}
KINDS = {
    128: ("FMT", "BBnNZ", "Type,Length,Name,Format,Columns"),
    1: ("PARM", "QNff", "TimeUS,Name,Value,Default"),
    2: ("GPS", "QBBIHBLL", "TimeUS,I,Status,GMS,GWk,NSats,Lat,Lng"),
}


def code(form):
    return "<" + "".join(C[c] for c in form)


def put(kind, *v):
    return b"\xa3\x95" + bytes([kind]) + struct.pack(code(KINDS[kind][1]), *v)


def write(path, gps):
    log = b"".join(
        put(128, k, 3 + struct.calcsize(code(f)), n.encode(), f.encode(), c.encode())
        for k, (n, f, c) in KINDS.items()
    )
    log += put(1, 1_000_000, b"ATC_RAT_RLL_P", 0.1, 0.135)
    if gps:
        log += put(2, 2_000_000, 0, 3, 400_000_000, 2300, 12, 470000000, 85000000)
    log += put(1, 60_000_000, b"ATC_RAT_RLL_P", 0.2, 0.135)
    with open(path, "wb") as file:
        file.write(log)
    return path


got = {}
for name, gps in (("with GPS", True), ("without GPS", False)):
    r = DFReader.DFReader_binary(write(f"{gps}.bin", gps))
    opened = dict(r.params)
    while r.recv_match(type="PARM"):
        pass
    r.rewind()
    got[name] = (round(opened["ATC_RAT_RLL_P"], 3), round(r.params["ATC_RAT_RLL_P"], 3))
print("pymavlink", version("pymavlink"), "- ATC_RAT_RLL_P is 0.1, from 60 s on 0.2")
for name, (opened, rewound) in got.items():
    print(f"{name}: just opened {opened}, read through and rewound {rewound}")
assert got == {"with GPS": (0.1, 0.2), "without GPS": (0.2, 0.2)}, "params are those of one moment now"
END
