#!/usr/bin/env bash
# One would guess: Quaternion.slerp(q0, q1, amount) leaves q0 and q1 as they are, or normalises them, as its
# documentation says.
#
# What happens: where the two have opposite signs, it turns the sign of the caller's q0 for good; intermediates() does
# the same. In a list that is interpolated pair by pair, every pass moves a jump of sign one sample forward.
#
# Why it matters: attitudes of a log are interpolated to the times of the gyroscope. A jump of sign in the log is at
# another place afterwards, so that rates by differences of the same list have their outlier at another sample, and a
# second look at the data is no longer one at the log.
#
# Output seen:
#   pyquaternion 0.9.9 numpy 2.4.6
#   w before: 1.000 0.999 0.995 -0.989; jump of sign at sample [3]
#   w after:  1.000 0.999 -0.995 -0.989; jump of sign at sample [2]
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check pyquaternion==0.9.9 numpy==2.4.6
env/bin/python - <<'END'
from importlib.metadata import version

import numpy as np
from pyquaternion import Quaternion

print("pyquaternion", version("pyquaternion"), "numpy", version("numpy"))
log = [Quaternion(axis=[0, 0, 1], angle=0.1 * k) for k in range(4)]
log[3] = -log[3]  # the same attitude, as a filter that changes its sign writes it
seen = []
for name in ("before:", "after: "):
    w = [q.w for q in log]
    jumps = [k for k in range(1, 4) if np.abs(log[k].q - log[k - 1].q).max() > 1]
    seen.append(jumps)
    print(f"w {name} {' '.join(f'{x:.3f}' for x in w)}; jump of sign at sample {jumps}")
    for first, second in zip(log, log[1:]):
        Quaternion.slerp(first, second, 0.5)
assert seen[0] == [3]
assert seen[1] == [2], "slerp leaves its input alone now"
END
