#!/usr/bin/env bash
# One would guess: a body without contacts and without applied forces falls at g t.
#
# What happens: after two seconds it falls at 12.9 in place of 19.6 m/s: Bullet damps every body by default, linearly
# and with the square of its speed, and turning as well. changeDynamics(linearDamping=0, angularDamping=0) ends it.
#
# Why it matters: drag that is identified from, or validated in, such a simulation contains Bullet's own: at 5 m/s a
# deceleration of 1.2 m/s2, of the size of a quadrotor's rotor drag. getDynamicsInfo does not show it.
#
# Note: pybullet 3.2.7 has wheels for some versions of Python alone, 3.11 is one: PYTHON=python3.11 chooses it.
#
# Output seen:
#   pybullet 3.2.7
#   by default: 12.95 m/s after 2 s of fall; 1.18 m/s2 at 5 m/s
#   damping 0:  19.62 m/s after 2 s of fall; 0.00 m/s2 at 5 m/s
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check pybullet==3.2.7 numpy==2.4.6
cat >body.urdf <<'END'
<?xml version="1.0"?>
<robot name="quadrotor"><link name="base">
  <inertial><mass value="0.027"/><inertia ixx="1.4e-5" iyy="1.4e-5" izz="2.17e-5" ixy="0" ixz="0" iyz="0"/></inertial>
</link></robot>
END
env/bin/python - <<'END'
from importlib.metadata import version

import pybullet

pybullet.connect(pybullet.DIRECT)
pybullet.setGravity(0, 0, -9.81)


def slows(damping):
    """Speed after 2 s of fall, and what 0.1 s without gravity takes off 5 m/s, m/s."""
    body = pybullet.loadURDF("body.urdf")
    if damping is not None:
        pybullet.changeDynamics(body, -1, linearDamping=damping, angularDamping=damping)
    for _ in range(480):
        pybullet.stepSimulation()
    fallen = -pybullet.getBaseVelocity(body)[0][2]
    pybullet.resetBaseVelocity(body, [5, 0, 0], [0, 0, 0])
    for _ in range(24):
        pybullet.stepSimulation()
    lost = 5 - pybullet.getBaseVelocity(body)[0][0]
    pybullet.removeBody(body)
    return fallen, lost


print("pybullet", version("pybullet"))
(fallen, lost), (free, kept) = slows(None), slows(0)
print(f"by default: {fallen:.2f} m/s after 2 s of fall; {lost / 0.1:.2f} m/s2 at 5 m/s")
print(f"damping 0:  {free:.2f} m/s after 2 s of fall; {kept / 0.1:.2f} m/s2 at 5 m/s")
assert abs(free - 19.62) < 1e-6 and abs(kept) < 1e-9
assert 12 < fallen < 14 and 1.0 < lost / 0.1 < 1.3, "bodies fall otherwise now"
END
