#!/usr/bin/env bash
# One would guess: loadURDF takes mass and inertia of the <inertial> element.
#
# What happens: it takes the mass alone. The inertia is computed anew from the collision shape, here 2.7 to 3.3 times
# the file's; without a collision shape it is 1e-3 of it. Only flags=URDF_USE_INERTIA_FROM_FILE reads the file's.
#
# Why it matters: an identified inertia that is written into a URDF has no effect in Bullet, and the vehicle answers a
# moment three times too slowly or a thousand times too fast. Gains that are tuned there do not fly.
#
# Note: pybullet 3.2.7 has wheels for some versions of Python alone, 3.11 is one: PYTHON=python3.11 chooses it.
#
# Output seen:
#   pybullet 3.2.7
#   shape: (3.79e-05, 3.79e-05, 7.14e-05) kg m2, the file's are (1.4e-05, 1.4e-05, 2.17e-05)
#   no shape: (1.8e-08, 1.8e-08, 1.8e-08) kg m2, the file's are (1.4e-05, 1.4e-05, 2.17e-05)
#   flag: (1.4e-05, 1.4e-05, 2.17e-05) kg m2, the file's are (1.4e-05, 1.4e-05, 2.17e-05)
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
  <collision><geometry><cylinder radius="0.06" length="0.025"/></geometry></collision>
</link></robot>
END
grep -v collision body.urdf >bare.urdf
env/bin/python - <<'END'
from importlib.metadata import version

import pybullet

pybullet.connect(pybullet.DIRECT)
print("pybullet", version("pybullet"))
found = {}
for name, file, flags in (("shape", "body.urdf", 0), ("no shape", "bare.urdf", 0),
                          ("flag", "body.urdf", pybullet.URDF_USE_INERTIA_FROM_FILE)):
    found[name] = pybullet.getDynamicsInfo(pybullet.loadURDF(file, flags=flags), -1)[2]
    print(f"{name}: ({', '.join(f'{x:.3g}' for x in found[name])}) kg m2, the file's are (1.4e-05, 1.4e-05, 2.17e-05)")
assert abs(found["flag"][0] / 1.4e-5 - 1) < 1e-6 and abs(found["flag"][2] / 2.17e-5 - 1) < 1e-6
assert found["shape"][0] > 2 * 1.4e-5, "the file's inertia is read without the flag now"
assert found["no shape"][0] < 1e-2 * 1.4e-5, "the file's inertia is read without a shape now"
END
