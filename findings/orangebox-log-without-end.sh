#!/usr/bin/env bash
# One would guess: a blackbox log whose end event is missing (battery unplugged, crash, flash full) is read as far as
# it goes: every frame is there.
#
# What happens: the iterator raises IndexError at the end of the data. list(parser.frames()) loses all frames; who
# collects them one by one loses the last. orangebox 0.5.0 does the same.
#
# Why it matters: the flight that ends in a crash or with the battery pulled is the one that is to be explained, and it
# has no end event.
#
# Output seen:
#   orangebox 0.4.0
#   with its end event: 1000 frames written, 1000 read, no error
#   without: 1000 frames written, 999 read, IndexError('index out of range')
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check orangebox==0.4.0
env/bin/python - <<'END'
from importlib.metadata import version

from orangebox import Parser

HEADER = b"""H Product:Blackbox flight data recorder by Nicholas Sherlock
H Data version:2
H I interval:32
H P interval:1/1
H minthrottle:1070
H motorOutput:48,2047
H vbatref:1600
H Field I name:loopIteration,time,gyroADC[0]
H Field I signed:0,0,1
H Field I predictor:0,0,0
H Field I encoding:1,1,0
H Field P predictor:6,2,1
H Field P encoding:9,0,0
"""
END = b"E\xffEnd of log\x00"


def unsigned(value):
    """Seven bits a byte, the lowest first."""
    out = b""
    while value > 127:
        out, value = out + bytes([value & 127 | 128]), value >> 7
    return out + bytes([value])


def frames(first, count):
    """Loops `first` on, every 500 us: each 32nd in full, the others as predicted."""
    out = b""
    for k in range(count):
        if k % 32 == 0:
            out += b"I" + unsigned(first + k) + unsigned(10_000_000 + 500 * (first + k)) + unsigned(6)
        else:  # time goes on straight: only the first frame after a full one is 500 us (zigzag 1000) off its prediction
            out += b"P" + unsigned(1000 if k % 32 == 1 else 0) + unsigned(0)
    return out


def read(data):
    """Loops and times that orangebox yields, and the error that ends it."""
    with open("log.bbl", "wb") as file:
        file.write(HEADER + data)
    found = []
    try:
        for frame in Parser.load("log.bbl").frames():
            found.append(frame.data[:2])
    except Exception as error:
        return found, repr(error)
    return found, "no error"



print("orangebox", version("orangebox"))
for name, data in (("with its end event", frames(0, 1000) + END), ("without", frames(0, 1000))):
    found, error = read(data)
    print(f"{name}: 1000 frames written, {len(found)} read, {error}")
assert len(found) == 999 and error.startswith("IndexError"), "a log without its end event is read to its end now"
END
