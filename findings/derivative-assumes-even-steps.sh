#!/usr/bin/env bash
# One would guess: dxdt(x, t, kind="finite_difference") of the package derivative uses the times that it is given, as
# numpy.gradient does: a straight line has its slope at every sample.
#
# What happens: every step is taken to be as long as the first, in silence. One lost sample turns a slope of 3 into 4.5
# on both sides of it; stamps that jitter by 5 % of a step make errors of several per cent. "savitzky_golay" of the
# same package uses the times.
#
# Why it matters: an angular acceleration from a logged gyroscope has a spike of 50 % at each dropped sample, and so
# has the moment from it.
#
# Output seen:
#   derivative 0.6.3
#   a line of slope 3, sample 300 lost: [3.  3.  4.5 4.5 3.  3. ]  numpy.gradient: [3. 3. 3. 3. 3. 3.]
#   largest error of the derivative of a sine (true amplitude 1), stamps even or within 5 % of a step:
#     finite_difference, even      0.00002
#     finite_difference, jitter    0.07925
#     savitzky_golay, jitter       0.00000
#     numpy.gradient, jitter       0.00002
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check derivative==0.6.3 numpy==2.2.6 scipy==1.15.3
env/bin/python - <<'END'
from importlib.metadata import version
import numpy as np
from derivative import dxdt

print("derivative", version("derivative"))
t = np.delete(np.arange(600) * 0.01, 300)
slope = dxdt(3 * t, t, kind="finite_difference", k=1)
print(
    "a line of slope 3, sample 300 lost:",
    slope[297:303].round(3),
    " numpy.gradient:",
    np.gradient(3 * t, t)[297:303].round(3),
)
assert np.allclose(np.gradient(3 * t, t), 3)
even = np.arange(600) * 0.01
jitter = even + np.random.default_rng(1).uniform(-0.05, 0.05, 600) * 0.01
inner = slice(20, -20)


def error(t, kind, **options):
    return np.abs(dxdt(np.sin(t), t, kind=kind, **options) - np.cos(t))[inner].max()


found = {
    "finite_difference, even": error(even, "finite_difference", k=1),
    "finite_difference, jitter": error(jitter, "finite_difference", k=1),
    "savitzky_golay, jitter": error(jitter, "savitzky_golay", left=0.05, right=0.05, order=3),
    "numpy.gradient, jitter": np.abs(np.gradient(np.sin(jitter), jitter) - np.cos(jitter))[inner].max(),
}
print("largest error of the derivative of a sine (true amplitude 1), stamps even or within 5 % of a step:")
for name, value in found.items():
    print(f"  {name:28s} {value:.5f}")
assert (
    found["finite_difference, even"] < 1e-4
    and found["finite_difference, jitter"] > 0.03 > 1e-3 > found["numpy.gradient, jitter"]
)
assert found["savitzky_golay, jitter"] < 1e-3
assert np.allclose(slope[[299, 300]], 4.5), "finite differences go by the times now"
END
