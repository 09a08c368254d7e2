#!/usr/bin/env bash
# One would guess: rowan's calculus.derivative(q, v) and calculus.integrate(q, v, dt) mean one v, so that the second
# follows the first; both describe it as angular velocities that stand before q, in the world.
#
# What happens: integrate takes v in world axes, derivative in body axes, against its own description. At the attitude
# below the two differ by 41 % of the change. At the identity both agree.
#
# Why it matters: a gyroscope's rate propagated with integrate goes astray as soon as the vehicle is tilted or turned,
# while an observer or a Jacobian made with derivative next to it is right. A test that starts level, heading north,
# does not show it.
#
# Output seen:
#   rowan 1.3.2
#   at the identity both agree
#     rate in body axes (by scipy)     [-0.5385  0.3242 -0.4518  0.6048]
#     rate in world axes (by scipy)    [-5.385e-01  1.000e-04 -2.777e-01  7.732e-01]
#     rowan derivative                 [-0.5385  0.3242 -0.4518  0.6048]
#     rowan integrate                  [-5.385e-01  1.000e-04 -2.777e-01  7.732e-01]
#   the two differ by 41%
#   a gyroscope integrated for 1 s with rowan.calculus.integrate: attitude off by 39 degrees
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check rowan==1.3.2 numpy==2.2.6 scipy==1.15.3
env/bin/python - <<'END'
from importlib.metadata import version
import numpy as np
import rowan
from scipy.spatial.transform import Rotation

print("rowan", version("rowan"))
rate, dt = np.array([0.4, -0.9, 1.7]), 1e-5


def wxyz(turn):
    return turn.as_quat()[[3, 0, 1, 2]]


def step(turn):
    q = wxyz(turn)
    body = (wxyz(turn * Rotation.from_rotvec(rate * dt)) - q) / dt
    world = (wxyz(Rotation.from_rotvec(rate * dt) * turn) - q) / dt
    return body, world, rowan.calculus.derivative(q, rate), (rowan.calculus.integrate(q, rate, dt) - q) / dt


body, world, derivative, integrate = step(Rotation.identity())
assert np.allclose(derivative, integrate, atol=1e-4)
print("at the identity both agree")
start = Rotation.from_euler("ZYX", [1.1, -0.4, 0.3])
body, world, derivative, integrate = step(start)
names = ("rate in body axes (by scipy)", "rate in world axes (by scipy)", "rowan derivative", "rowan integrate")
for what, values in zip(names, (body, world, derivative, integrate)):
    print(f"  {what:32s}", values.round(4))
off = np.linalg.norm(derivative - integrate) / np.linalg.norm(derivative)
print(f"the two differ by {off:.0%}")
turn = start
q = wxyz(start)
for _ in range(100):
    turn, q = turn * Rotation.from_rotvec(rate * 0.01), rowan.calculus.integrate(q, rate, 0.01)
error = np.degrees((turn.inv() * Rotation.from_quat(q[[1, 2, 3, 0]])).magnitude())
print(f"a gyroscope integrated for 1 s with rowan.calculus.integrate: attitude off by {error:.0f} degrees")
assert np.allclose(derivative, body, atol=1e-4) and np.allclose(integrate, world, atol=1e-4)
assert off > 0.3 and error > 30, "derivative and integrate take rates in the same axes now"
END
