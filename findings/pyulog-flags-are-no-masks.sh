#!/usr/bin/env bash
# One would guess: a field of type bool of a ULog, such as vehicle_land_detected.landed, is an array of bool in pyulog:
# z[landed] are the samples on the ground, z[~landed] those in the air.
#
# What happens: it is int8 with 0 and 1. z[landed] is as long as z and repeats samples 0 and 1; ~landed is -1 and -2,
# so that z[~landed] repeats the last two. No error, and plausible values. With astype(bool) it is right.
#
# Why it matters: statistics "in the air only" are those of two samples.
#
# Output seen:
#   pyulog 1.3.0 - landed has dtype int8
#   mean height in the air is 69.5 m; height[~landed]: 100 values, mean 0 m; with astype(bool): 69.5 m
#   height[landed]: 100 values (20 samples are on the ground)
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check pyulog==1.3.0
env/bin/python - <<'END'
import io
import struct
from importlib.metadata import version
import numpy as np
from pyulog import ULog


def message(kind, body):
    return struct.pack("<HB", len(body), ord(kind)) + body


log = b"\x55\x4c\x6f\x67\x01\x12\x35\x01" + struct.pack("<Q", 0) + message("B", bytes(40))
log += message("F", b"demo:uint64_t timestamp;float height;bool landed;") + message(
    "A", struct.pack("<BH", 0, 0) + b"demo"
)
truth = [(k, 0.0 if k < 10 or k >= 90 else 20.0 + k, k < 10 or k >= 90) for k in range(100)]
for k, height, landed in truth:
    log += message("D", struct.pack("<HQf?", 0, 1000 * (k + 1), height, landed))
data = ULog(io.BytesIO(log)).get_dataset("demo").data
height, landed = data["height"], data["landed"]
right = float(np.mean([h for _, h, down in truth if not down]))
masked, ground = height[~landed], height[landed]
print("pyulog", version("pyulog"), "- landed has dtype", landed.dtype)
print(
    f"mean height in the air is {right:g} m; height[~landed]: {len(masked)} values, mean {masked.mean():g} m; with astype(bool): {height[~landed.astype(bool)].mean():g} m"
)
print(f"height[landed]: {len(ground)} values (20 samples are on the ground)")
assert height[~landed.astype(bool)].mean() == right
assert landed.dtype == np.int8 and len(masked) == len(ground) == 100 and masked.mean() == 0, "flags are masks now"
END
