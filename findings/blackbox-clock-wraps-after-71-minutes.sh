#!/usr/bin/env bash
# One would guess: two readers of Betaflight's blackbox, orangebox and betaflight-chirp-core, go on where the 32-bit
# clock of microseconds begins anew, 71 min 35 s after power-up; or they agree.
#
# What happens: orangebox goes on beyond 2^32 until the next full frame, then falls back by 4295 s.
# betaflight-chirp-core ends there: all that follows the first full frame after the wrap is missing. Neither says so.
#
# Why it matters: a quadrotor that waited on the bench under power has such logs. A duration, a rate by last less
# first, and every spectrum by it are wrong; or half of the flight is gone and the rest looks whole.
#
# Output seen:
#   orangebox 0.4.0 betaflight-chirp-core 0.4.1 - written: 3200 frames, 3.199 s
#   orangebox: 3200 frames, last - first = -4291.768 s, highest time 1.000005 of 2^32
#   betaflight-chirp-core: 1632 frames, last - first = 1.631 s
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check --no-deps orangebox==0.4.0 betaflight-chirp-core==0.4.1
env/bin/python - <<'END'
import logging
from importlib.metadata import version
import orangebox
from betaflight_chirp_core import decoder

logging.disable(logging.CRITICAL)


def unsigned(n):
    n, out = n & 0xFFFFFFFF, b""
    while n > 127:
        out, n = out + bytes([n & 127 | 128]), n >> 7
    return out + bytes([n])


def signed(n):
    return unsigned(n << 1 ^ n >> 31)


names = (
    "loopIteration,time,"
    + ",".join(f"gyroADC[{i}]" for i in range(3))
    + ","
    + ",".join(f"motor[{i}]" for i in range(4))
)
head = [
    "Product:Blackbox flight data recorder by Nicholas Sherlock",
    "Data version:2",
    "I interval:32",
    f"Field I name:{names}",
    "Field I signed:0,0,1,1,1,0,0,0,0",
    "Field I predictor:0,0,0,0,0,11,5,5,5",
    "Field I encoding:1,1,0,0,0,1,0,0,0",
    "Field P predictor:6,2,1,1,1,1,1,1,1",
    "Field P encoding:9,0,0,0,0,0,0,0,0",
    "Firmware type:Cleanflight",
    "Firmware revision:Betaflight 4.5.1 (77d01ba3b) STM32F405",
    "P interval:1",
    "P ratio:32",
    "minthrottle:1070",
    "maxthrottle:2000",
    "gyro_scale:0x3f800000",
    "motorOutput:48,2047",
    "acc_1G:2048",
    "vbatref:1600",
    "looptime:1000",
    "rollPID:45,80,40",
]
log = "".join(f"H {line}\n" for line in head).encode()
N, STEP, WRAP = 3200, 1000, 1610
for k in range(N):
    t = 2**32 - WRAP * STEP + STEP * k
    if k % 32 == 0:
        log += (
            b"I" + unsigned(k) + unsigned(t) + signed(k % 50) + signed(0) + signed(0) + unsigned(900) + signed(0) * 3
        )
    else:
        log += b"P" + signed(STEP if k % 32 == 1 else 0) + signed(k % 50 - (k - 1) % 50) + signed(0) * 6
log += b"E\xffEnd of log\x00"
with open("log.bbl", "wb") as file:
    file.write(log)
a = [f.data[1] for f in orangebox.Parser.load("log.bbl").frames()]
((start, end),) = decoder.split_sessions(log)
other = decoder.FlightLogParser(log, start, end)
other.parse_header()
other.parse_data()
b = [row[other.main_field_names.index("time")] for row in other.main_frames]
print(
    "orangebox",
    version("orangebox"),
    "betaflight-chirp-core",
    version("betaflight-chirp-core"),
    f"- written: {N} frames, {(N - 1) * STEP * 1e-6:.3f} s",
)
print(
    f"orangebox: {len(a)} frames, last - first = {(a[-1] - a[0]) * 1e-6:.3f} s, highest time {max(a) / 2**32:.6f} of 2^32"
)
print(f"betaflight-chirp-core: {len(b)} frames, last - first = {(b[-1] - b[0]) * 1e-6:.3f} s")
assert len(a) == N
assert a[-1] < a[0] and max(a) >= 2**32 and len(b) < 0.6 * N, "the clock goes on, or both readers agree, now"
END
