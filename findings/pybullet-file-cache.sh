#!/usr/bin/env bash
# One would guess: a URDF file that was written anew is read anew by the next loadURDF of PyBullet, at the latest after
# resetSimulation.
#
# What happens: Bullet keeps the text of a file by its path as long as the connection lives, resetSimulation included:
# the second vehicle has the mass of the first. A new connection, a new name, or
# setPhysicsEngineParameter(enableFileCaching=0) helps.
#
# Why it matters: a sweep over mass or inertia that writes one file each time flies the first vehicle every time, and
# finds that nothing matters.
#
# Output seen:
#   pybullet 3.2.7
#   file says 1.5: read 1.5; file says 3.0: read 1.5, after resetSimulation 1.5, with caching off 3.0
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check pybullet==3.2.7 numpy==2.4.6
env/bin/python - <<'END' | grep -v 'build time'
from importlib.metadata import version

import pybullet

path = "vehicle.urdf"


def write(mass):
    with open(path, "w") as file:
        file.write(
            f'<robot name="v"><link name="body"><inertial><mass value="{mass}"/><inertia ixx="0.01" ixy="0" '
            'ixz="0" iyy="0.02" iyz="0" izz="0.025"/></inertial></link></robot>'
        )


def read():
    return pybullet.getDynamicsInfo(pybullet.loadURDF(path), -1)[0]


print("pybullet", version("pybullet"))
pybullet.connect(pybullet.DIRECT)
write(1.5)
first = read()
write(3.0)
second = read()
pybullet.resetSimulation()
third = read()
pybullet.setPhysicsEngineParameter(enableFileCaching=0)
fourth = read()
print(
    f"file says 1.5: read {first}; file says 3.0: read {second}, after resetSimulation {third}, with caching off {fourth}"
)
assert (first, fourth) == (1.5, 3.0)
assert (second, third) == (1.5, 1.5), "a file that was written anew is read anew now"
END
