#!/usr/bin/env bash
# One would guess: the "intrinsic distance" of pyquaternion and rowan, and UnitQuaternion.angdist of spatialmath, of
# two attitudes that are 40 degrees apart is 40 degrees; q and -q are one attitude.
#
# What happens: all of them give 20. SO3.angdist of spatialmath, the same name for the same turns, gives 40. With the
# sign of one quaternion turned, as logs have it where w passes zero, pyquaternion's distance and sym_distance and
# rowan's intrinsic_distance give 160: 180 less half the angle.
#
# Why it matters: attitude errors of an estimator, or of a simulation next to a log, are reported at half their size,
# with single ones of 160 degrees among them that are none.
#
# Output seen:
#   pyquaternion 0.9.9 rowan 1.3.2 spatialmath-python 1.1.18 scipy 1.15.3
#   two attitudes 40 degrees apart, in degrees; then with the sign of one quaternion turned:
#     pyquaternion distance                  20.0  160.0
#     pyquaternion sym_distance              20.0  160.0
#     pyquaternion absolute_distance         19.9   19.9
#     rowan intrinsic_distance               20.0  160.0
#     spatialmath UnitQuaternion.angdist     20.0   20.0
#     spatialmath SO3.angdist                40.0   40.0
#     scipy magnitude                        40.0   40.0
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check pyquaternion==0.9.9 rowan==1.3.2 spatialmath-python==1.1.18 numpy==2.2.6 scipy==1.15.3
env/bin/python - <<'END'
from importlib.metadata import version
import numpy as np
import rowan
from pyquaternion import Quaternion
from scipy.spatial.transform import Rotation
from spatialmath import SO3, UnitQuaternion

print(*(f"{n} {version(n)}" for n in ("pyquaternion", "rowan", "spatialmath-python", "scipy")))
a = Rotation.from_euler("ZYX", [1.1, -0.4, 0.3])
b = a * Rotation.from_rotvec(np.radians(40) * np.array([0.6, 0, 0.8]))
p, q = (r.as_quat()[[3, 0, 1, 2]] for r in (a, b))
q = q if p @ q > 0 else -q


def all_of(q):
    one, other = Quaternion(*p), Quaternion(*q)
    return {
        "pyquaternion distance": Quaternion.distance(one, other),
        "pyquaternion sym_distance": Quaternion.sym_distance(one, other),
        "pyquaternion absolute_distance": Quaternion.absolute_distance(one, other),
        "rowan intrinsic_distance": rowan.geometry.intrinsic_distance(p, q),
        "spatialmath UnitQuaternion.angdist": UnitQuaternion(p).angdist(UnitQuaternion(q)),
        "spatialmath SO3.angdist": SO3(a.as_matrix()).angdist(SO3(b.as_matrix())),
        "scipy magnitude": (a.inv() * Rotation.from_quat(q[[1, 2, 3, 0]])).magnitude(),
    }


def degrees(q):
    return {k: round(float(np.degrees(np.squeeze(v))), 1) for k, v in all_of(q).items()}


same, turned = degrees(q), degrees(-q)
print("two attitudes 40 degrees apart, in degrees; then with the sign of one quaternion turned:")
for name in same:
    print(f"  {name:36s} {same[name]:6.1f} {turned[name]:6.1f}")
half = list(same)[:5]
assert same["spatialmath SO3.angdist"] == same["scipy magnitude"] == turned["scipy magnitude"] == 40
assert all(turned[n] == 160 for n in half[:2] + half[3:4]), "the sign of a quaternion does not count now"
assert all(abs(same[n] - 20) < 0.3 for n in half), "the distance is the angle now"
END
