#!/usr/bin/env bash
# One would guess: @njit(cache=True) compiles anew when a constant that the function uses has changed: numba says that
# globals are frozen for a process, and the cache knows the files.
#
# What happens: the cache looks at the file of the function alone. A constant imported from another file keeps its old
# value in all later processes, while the module and the function's own py_func have the new one.
#
# Why it matters: physical constants and limits (air density, gravity, arm) live in one file and are imported where
# they are used. A corrected value changes the Python half of a simulator and leaves the compiled half; results differ
# between a fresh checkout and the machine on which it was developed.
#
# Output seen:
#   numba 0.68.1: density 1.225, compiled 2.45, in Python 2.45
#   numba 0.68.1: density 1.0, compiled 2.45, in Python 2.0
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check numba==0.68.1 numpy==2.4.6
echo 'DENSITY_KG_M3 = 1.225' >air.py
cat >model.py <<'END'
import numba
from air import DENSITY_KG_M3


@numba.njit(cache=True)
def pressure(speed):
    return 0.5 * DENSITY_KG_M3 * speed**2
END
cat >ask.py <<'END'
import air
import model
import numba

now, plain = model.pressure(2.0), model.pressure.py_func(2.0)
print(f"numba {numba.__version__}: density {air.DENSITY_KG_M3}, compiled {now}, in Python {plain}")
assert now == 2.45, "the cache follows imported constants now"
END
env/bin/python ask.py
echo 'DENSITY_KG_M3 = 1.0' >air.py
env/bin/python ask.py
