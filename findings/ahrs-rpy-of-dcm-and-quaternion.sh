#!/usr/bin/env bash
# One would guess: DCM(rpy=angles) and Quaternion(rpy=angles) of ahrs are the same attitude, as the documentation of the
# latter has it, and to_rpy() gives back the angles that went in.
#
# What happens: the quaternion takes roll, pitch, yaw; the matrix takes yaw, pitch, roll under the same name. to_rpy()
# reads the matrix as its transpose: neither the one order nor the other comes back, not even in size.
#
# Why it matters: a rotation from the sensor to the vehicle, or logged angles, go through whichever class is at hand. A
# yaw alone becomes a roll, and gravity lands in another axis of the accelerometer; a roll alone comes back from
# to_rpy() with the other sign.
#
# Output seen:
#   AHRS 0.4.0 scipy 1.17.1 numpy 2.4.6
#   rpy 10 20 30 deg: quaternion 10.0 20.0 30.0, matrix 30.0 20.0 10.0
#   to_rpy() of the quaternion's matrix: 1.1 -22.2 -28.5
#   to_rpy() of the matrix: -28.5 -22.2 1.1
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check AHRS==0.4.0 scipy==1.17.1 numpy==2.4.6
env/bin/python - <<'END'
from importlib.metadata import version

import numpy as np
from ahrs import DCM, Quaternion
from scipy.spatial.transform import Rotation


def angles(matrix):
    """Roll, pitch, yaw by scipy, degrees."""
    return Rotation.from_matrix(np.array(matrix)).as_euler("ZYX", degrees=True)[::-1]


def shown(values):
    return " ".join(f"{x:.1f}" for x in values)


print("AHRS", version("AHRS"), "scipy", version("scipy"), "numpy", version("numpy"))
said = np.radians([10.0, 20.0, 30.0])
turned = Quaternion(rpy=said)
own, other = angles(turned.to_DCM()), angles(DCM(rpy=said))
back = np.degrees(DCM(turned.to_DCM()).to_rpy()), np.degrees(DCM(rpy=said).to_rpy())
print(f"rpy 10 20 30 deg: quaternion {shown(own)}, matrix {shown(other)}")
print(f"to_rpy() of the quaternion's matrix: {shown(back[0])}")
print(f"to_rpy() of the matrix: {shown(back[1])}")
assert np.allclose(own, [10, 20, 30])
assert np.allclose(other, [30, 20, 10]), "both classes take rpy in one order now"
assert not np.allclose(back[0], own) and not np.allclose(back[1], other), "to_rpy() gives back what went in now"
END
