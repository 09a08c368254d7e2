#!/usr/bin/env bash
# One would guess: getBasePositionAndOrientation of a body loaded at the origin without a turn is the origin without a
# turn, whatever its inertia.
#
# What happens: Bullet's base frame is that of the principal axes at the centre of mass. With products of inertia in
# the URDF the attitude read is tens of degrees off, though all else about the body is right; with an offset centre of
# mass the position is that of the centre. The link's own frame has to be made of getDynamicsInfo.
#
# Why it matters: a controller or a log that takes this attitude flies another vehicle as soon as the products, perhaps
# just identified, are filled into the file.
#
# Output seen:
#   pybullet 3.2.7
#   plain: read [0. 0. 0.] turned by 0.0 degrees; of the link [0. 0. 0.], 0.0
#   offset: read [0.1 0.  0. ] turned by 0.0 degrees; of the link [0. 0. 0.], 0.0
#   products: read [0. 0. 0.] turned by 41.0 degrees; of the link [0. 0. 0.], 0.0
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check pybullet==3.2.7 numpy==2.4.6
env/bin/python - <<'END' | grep -v 'build time'
from importlib.metadata import version

import numpy as np
import pybullet as p


def load(name, place, xy):
    path = f"{name}.urdf"
    with open(path, "w") as file:
        file.write(
            f'<robot name="v"><link name="body"><inertial><origin xyz="{place} 0 0"/><mass value="0.652"/><inertia '
            f'ixx="0.002489" ixy="{xy}" ixz="0" iyy="0.0025743" iyz="0" izz="0.0046838"/></inertial></link></robot>'
        )
    return p.loadURDF(path, flags=p.URDF_USE_INERTIA_FROM_FILE)


print("pybullet", version("pybullet"))
p.connect(p.DIRECT)
for name, place, xy in (("plain", 0, 0), ("offset", 0.1, 0), ("products", 0, 0.0003)):
    body = load(name, place, xy)
    position, turned = p.getBasePositionAndOrientation(body)
    angle = np.degrees(2 * np.arccos(min(abs(turned[3]), 1.0)))
    centre, axes = p.getDynamicsInfo(body, -1)[3:5]
    back = p.multiplyTransforms(position, turned, *p.invertTransform(centre, axes))
    link = np.degrees(2 * np.arccos(min(abs(back[1][3]), 1.0)))
    print(
        f"{name}: read {np.round(position, 3)} turned by {angle:.1f} degrees; of the link {np.round(back[0], 3)}, {link:.1f}"
    )
    assert np.allclose(back[0], 0, atol=1e-6) and link < 0.1
    as_seen = {"plain": angle < 0.1, "offset": abs(position[0] - 0.1) < 1e-6, "products": angle > 20}[name]
    assert as_seen, "the base frame is that of the link now"
END
