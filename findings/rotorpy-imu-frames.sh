#!/usr/bin/env bash
# One would guess: RotorPy's Imu(R_BS=..., p_BS=...) reads what a sensor that is turned by R_BS and stands at p_BS
# reads.
#
# What happens: R_BS turns the accelerometer alone, the gyroscope still reads body axes. The centripetal part takes
# body rates with a lever arm in world axes: it is right at zero heading alone.
#
# Why it matters: a lever arm or a mounting angle identified from such recordings is wrong, and looks right in the
# first test, which starts with zero heading.
#
# Output seen:
#   rotorpy 3.0.0 rates [5. 0. 0.] arm [0.1 0.2 0.3]
#   heading 0: accelerometer [ 0.   -5.    2.31], right is [ 0.   -5.    2.31]
#   heading 90: accelerometer [-2.5  -0.    2.31], right is [ 0.   -5.    2.31]
#   sensor turned by 90 degrees: gyroscope [5. 0. 0.] right is [ 0. -5.  0.]
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check rotorpy==3.0.0 numpy==2.4.6 scipy==1.17.1
env/bin/python - <<'END'
from importlib.metadata import version

import numpy as np
from rotorpy.sensors.imu import Imu
from scipy.spatial.transform import Rotation

zero = np.zeros(3)


def quiet():
    return {"initial_bias": zero.copy(), "noise_density": zero.copy(), "random_walk": zero.copy()}


rates, arm = np.array([5.0, 0, 0]), np.array([0.1, 0.2, 0.3])
np.set_printoptions(precision=3, suppress=True)
print("rotorpy", version("rotorpy"), "rates", rates, "arm", arm)
for heading in (0, 90):
    attitude = Rotation.from_euler("z", heading, degrees=True)
    state = {"x": zero, "v": zero, "q": attitude.as_quat(), "w": rates}
    still = {"vdot": zero, "wdot": zero}
    right = np.cross(rates, np.cross(rates, arm)) + attitude.inv().apply([0, 0, 9.81])
    read = Imu(quiet(), quiet(), p_BS=arm).measurement(state, still, with_noise=False)["accel"]
    print(f"heading {heading}: accelerometer {read}, right is {right}")
    assert np.allclose(read, right) == (heading == 0), "the lever arm is in body axes now"
mount = Rotation.from_euler("z", 90, degrees=True).as_matrix()
read = Imu(quiet(), quiet(), R_BS=mount).measurement(state, still, with_noise=False)["gyro"]
print("sensor turned by 90 degrees: gyroscope", read, "right is", mount.T @ rates)
assert np.allclose(read, rates), "the gyroscope turns with its sensor now"
END
