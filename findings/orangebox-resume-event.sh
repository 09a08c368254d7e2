#!/usr/bin/env bash
# One would guess: an event "logging resume" (written when a switch pauses and resumes the blackbox) is skipped, and
# the frames after it have the clock that it states.
#
# What happens: orangebox 0.4.0 does not step over the event's own bytes, the loop count and the time. Where one of
# them reads as a frame's letter (here the 0x49, I, of loop 9344), it is decoded as a frame, the full frame behind it
# is lost, and the 30 frames up to the next full one go on with the clock of before the pause. 0.5.0 reads the event.
#
# Why it matters: the first readings after the pause carry the times right after its start, minutes early, without an
# error. They continue the stretch before it, and a rate or an attitude jumps within what looks like one run. It
# depends on the loop count, so that most logs show nothing.
#
# Output seen:
#   orangebox 0.4.0
#   resumed at loop 5000: 0 of 1064 frames lost, 0 read that nobody wrote; after it (5000, 12500000)
#   resumed at loop 9344: 32 of 1064 frames lost, 30 read that nobody wrote; after it (64, 10032000)
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
wrong = {}
for loop in (5000, 9344):
    data = frames(0, 64) + b"E\x0e" + unsigned(loop) + unsigned(10_000_000 + 500 * loop) + frames(loop, 1000) + END
    found, error = read(data)
    written = {(k, 10_000_000 + 500 * k) for k in (*range(64), *range(loop, loop + 1000))}
    wrong[loop] = len([row for row in found if row not in written])
    lost = len(written - set(found))
    print(f"resumed at loop {loop}: {lost} of {len(written)} frames lost, {wrong[loop]} read that nobody wrote; "
          f"after it {found[64]}")
assert wrong[5000] == 0
assert wrong[9344] == 30, "frames after a resume event are read otherwise now"
END
