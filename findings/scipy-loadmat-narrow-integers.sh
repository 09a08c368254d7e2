#!/usr/bin/env bash
# One would guess: an array of class double in a MAT-file is float64 in Python: whosmat calls it double.
#
# What happens: loadmat gives it the type in which it was stored. MATLAB stores doubles that happen to be whole numbers
# in the smallest integer that holds them, and they arrive as uint8, uint16, int16 and so on. Twice 200 is then 144.
# mat_dtype=True gives float64.
#
# Why it matters: throttles, PWM, raw counts, sample numbers and times in ms are whole numbers: differences wrap at 0,
# squares overflow, and the same script is right for the next flight, in which one value has a fraction.
#
# Output seen:
#   scipy 1.17.1 numpy 2.4.6
#   throttle: double in the file, uint8 in Python; twice [0 100 200] is [  0 200 144]
#   pwm: uint16; 1400 less 1500 is 65436
#   mat_dtype=True: float64, -100.0
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check scipy==1.17.1 numpy==2.4.6
env/bin/python - <<'END'
import struct
import warnings
from importlib.metadata import version

from scipy.io import loadmat, whosmat

INT8, UINT8, UINT16, INT32, UINT32, MATRIX = 1, 2, 4, 5, 6, 14
DOUBLE_CLASS = 6


def element(kind, data):
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def saved(name, kind, data, count):
    """A MAT-file of level 5 with one double array (1, count) whose values are stored in a smaller type."""
    parts = element(UINT32, struct.pack("<II", DOUBLE_CLASS, 0)) + element(INT32, struct.pack("<ii", 1, count))
    parts += element(INT8, name) + element(kind, data)
    with open("flight.mat", "wb") as file:
        file.write(b"MATLAB 5.0 MAT-file".ljust(116) + bytes(8) + struct.pack("<H", 0x0100) + b"IM")
        file.write(element(MATRIX, parts))


warnings.simplefilter("ignore")  # numpy says of scalars alone that they wrap
print("scipy", version("scipy"), "numpy", version("numpy"))
saved(b"throttle", UINT8, bytes([0, 100, 200]), 3)
name, shape, said = whosmat("flight.mat")[0]
got = loadmat("flight.mat")["throttle"]
print(f"{name}: {said} in the file, {got.dtype} in Python; twice [0 100 200] is {(2 * got)[0]}")
saved(b"pwm", UINT16, struct.pack("<3H", 1500, 1400, 1600), 3)
pwm = loadmat("flight.mat")["pwm"]
print(f"pwm: {pwm.dtype}; 1400 less 1500 is {pwm[0, 1] - pwm[0, 0]}")
right = loadmat("flight.mat", mat_dtype=True)["pwm"]
print(f"mat_dtype=True: {right.dtype}, {right[0, 1] - right[0, 0]}")
assert said == "double" and right[0, 1] - right[0, 0] == -100
assert (2 * got)[0].tolist() == [0, 200, 144] and pwm.dtype == "uint16", "doubles are float64 by default now"
END
