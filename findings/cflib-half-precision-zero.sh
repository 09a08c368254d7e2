#!/usr/bin/env bash
# One would guess: cflib's fp16_to_float, by which lighthouse sweep angles are decoded, reads minus zero, infinity and
# NaN of 16 bits as numpy's float16 does.
#
# What happens: these three come as the bit pattern of a 32-bit float, an integer: minus zero is 2147483648. All other
# values are right. The decoder takes the number off the first angle, so that a difference of minus zero between two
# sensors makes an angle of -2147483648 rad.
#
# Why it matters: now and then one sample among right angles is off by nine orders of magnitude; it is finite, and
# passes every filter of NaN.
#
# Output seen:
#   cflib 0.1.34
#   0x3c00: numpy      1.0, cflib 1.0
#   0xbc00: numpy     -1.0, cflib -1.0
#   0x0001: numpy    6e-08, cflib 5.960464477539063e-08
#   0x0000: numpy      0.0, cflib 0
#   0x8000: numpy     -0.0, cflib 2147483648
#   0x7c00: numpy      inf, cflib 2139095040
#   0x7e00: numpy      nan, cflib 2143289344
#   sweep angles of four sensors, x: [0.25, 0.25, -2147483647.75, 0.2421875]
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check cflib==0.1.34
env/bin/python - <<'END'
import struct
from importlib.metadata import version
import numpy as np
from cflib.crazyflie.localization import Localization
from cflib.utils.encoding import fp16_to_float

print("cflib", version("cflib"))
halves = np.array([0x3C00, 0xBC00, 0x0001, 0x0000, 0x8000, 0x7C00, 0x7E00], np.uint16)
got = [fp16_to_float(int(h)) for h in halves]
for h, g in zip(halves, got):
    print(f"0x{h:04x}: numpy {h.view(np.float16)!s:>8}, cflib {g!r}")
packet = struct.pack("<BfHHHfHHH", 0, 0.25, 0x0000, 0x8000, 0x2000, 0.5, 0, 0, 0)
decoded = Localization._decode_lh_angle(None, packet)
print("sweep angles of four sensors, x:", decoded["x"])
assert got[:4] == [1.0, -1.0, 2.0**-24, 0]
assert got[4:] == [2147483648, 2139095040, 2143289344] and decoded["x"][2] < -2e9, "minus zero is zero now"
END
