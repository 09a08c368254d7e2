#!/usr/bin/env bash
# One would guess: Serial(timeout=2, inter_byte_timeout=0.05).read(10) returns what has come 50 ms after the last byte.
#
# What happens: on Linux it waits for the whole timeout of 2 s and, when bytes come after a silence of half a second,
# reads on: inter_byte_timeout changes nothing, at any length, without a warning.
#
# Why it matters: instruments that end a reading with silence (scales, load cells, ESC telemetry) are read frame by
# frame with it. Two readings run into one, or each one arrives two seconds late, with the time of its arrival.
#
# Output seen:
#   pyserial 3.5
#   inter_byte_timeout=None: b'abcdef' after 2.0 s
#   inter_byte_timeout=0.05: b'abcdef' after 2.0 s
#   inter_byte_timeout=0.3: b'abcdef' after 2.0 s
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check pyserial==3.5
env/bin/python - <<'END'
import os
import pty
import threading
import time

import serial

print("pyserial", serial.__version__)


def reading(inter_byte_timeout):
    """What read(10) returns of `abc`, 0.5 s of silence, `def`, and how long it took, s."""
    device, port = pty.openpty()
    with serial.Serial(os.ttyname(port), timeout=2, inter_byte_timeout=inter_byte_timeout) as own:
        os.write(device, b"abc")
        later = threading.Timer(0.5, os.write, (device, b"def"))
        later.start()
        start = time.monotonic()
        got = own.read(10)
        took = time.monotonic() - start
        later.join()
    os.close(device)
    os.close(port)
    return got, took


for pause in (None, 0.05, 0.3):
    got, took = reading(pause)
    print(f"inter_byte_timeout={pause}: {got} after {took:.1f} s")
    assert got == b"abcdef" and took > 1.9, "inter_byte_timeout ends a reading now"
END
