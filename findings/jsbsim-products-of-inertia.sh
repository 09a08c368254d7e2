#!/usr/bin/env bash
# One would guess: ixy, ixz and iyz of JSBSim's <mass_balance> are the entries of the inertia matrix in body axes, as
# in URDF, SDF and MJCF; or all three have the other sign.
#
# What happens: they belong to axes with x to the rear and z up. By default ixz comes out as the entry, ixy and iyz as
# its negative; with negated_crossproduct_inertia="false" it is the other way round. Neither setting takes the three
# numbers of a matrix.
#
# Why it matters: a payload off the middle gets its coupling of roll and pitch, or of pitch and yaw, with the wrong
# sign.
#
# Output seen:
#   jsbsim 1.3.3 ixy = 0.3, ixz = 0.5, iyz = 0.2; inertia matrix that its accelerations show:
#   default
#    [[ 1.  -0.3  0.5]
#    [-0.3  2.  -0.2]
#    [ 0.5 -0.2  2.5]] 
#   negated_crossproduct_inertia="false"
#    [[ 1.   0.3 -0.5]
#    [ 0.3  2.   0.2]
#    [-0.5  0.2  2.5]]
#   xz has the other sign than xy and yz, either way
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check jsbsim==1.3.3 numpy==2.4.6
env/bin/python - <<'END' | grep -v 'aerodynamic axis system\|^ *JSBSim\|^ *\[JSB\|^$'
import os

import jsbsim
import numpy as np

root = os.getcwd()
for name in ("aircraft/block", "engine", "systems"):
    os.makedirs(name)
LB_FT = 0.737562149


def write(attribute, torque):
    place = "<x>0</x><y>0</y><z>0</z>"
    axes = "".join(
        f'<axis name="{a}"><function name="own/{a}"><value>{t * LB_FT}</value></function></axis>'
        for a, t in zip(("ROLL", "PITCH", "YAW"), torque)
    )
    text = f"""<?xml version="1.0"?><fdm_config name="block" version="2.0" release="BETA">
<fileheader><author>-</author><filecreationdate>2020-01-01</filecreationdate><version>1</version><description>-</description></fileheader>
<metrics><wingarea unit="M2">1</wingarea><wingspan unit="M">1</wingspan><chord unit="M">1</chord>
<location name="AERORP" unit="M">{place}</location><location name="EYEPOINT" unit="M">{place}</location>
<location name="VRP" unit="M">{place}</location></metrics>
<mass_balance {attribute}><ixx unit="KG*M2">1</ixx><iyy unit="KG*M2">2</iyy><izz unit="KG*M2">2.5</izz>
<ixy unit="KG*M2">0.3</ixy><ixz unit="KG*M2">0.5</ixz><iyz unit="KG*M2">0.2</iyz><emptywt unit="KG">10</emptywt>
<location name="CG" unit="M">{place}</location></mass_balance><ground_reactions/><propulsion/><flight_control name="none"/>
<aerodynamics>{axes}</aerodynamics></fdm_config>"""
    with open(f"{root}/aircraft/block/block.xml", "w") as file:
        file.write(text)


def turning(attribute, torque):
    write(attribute, torque)
    fdm = jsbsim.FGFDMExec(root)
    fdm.set_debug_level(0)
    fdm.load_model("block")
    fdm["ic/h-sl-ft"] = 30000
    fdm.run_ic()
    return np.array([fdm[f"accelerations/{w}dot-rad_sec2"] for w in "pqr"])


def matrix(attribute):
    none = turning(attribute, (0, 0, 0))
    return np.linalg.inv(np.array([turning(attribute, row) - none for row in np.eye(3)]).T)


default, other = matrix(""), matrix('negated_crossproduct_inertia="false"')
np.set_printoptions(precision=3, suppress=True)
print("jsbsim", jsbsim.__version__, "ixy = 0.3, ixz = 0.5, iyz = 0.2; inertia matrix that its accelerations show:")
print("default\n", default, '\nnegated_crossproduct_inertia="false"\n', other)
assert np.allclose([default[0, 1], default[0, 2], default[1, 2]], [-0.3, 0.5, -0.2], atol=2e-3), (
    "signs are others now"
)
assert np.allclose([other[0, 1], other[0, 2], other[1, 2]], [0.3, -0.5, 0.2], atol=2e-3)
print("xz has the other sign than xy and yz, either way")
END
