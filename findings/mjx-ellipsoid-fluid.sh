#!/usr/bin/env bash
# One would guess: a model with fluidshape="ellipsoid" has the same drag in MJX as in MuJoCo itself, or MJX refuses it,
# as it does much else that it lacks.
#
# What happens: MJX takes it without a word and computes the other fluid model, of the box with the same inertia. The
# drag of the body below is more than four times smaller than in MuJoCo, and the side force has the other sign.
#
# Why it matters: a policy, or an identification, that flies in thousands of copies in MJX has a drag that the file
# does not state; the same file looked at in MuJoCo is right.
#
# Output seen:
#   mujoco 4.0.0 mujoco-mjx 3.17.0
#   box model       MuJoCo [-0.202   0.1006 -0.0742 -0.0004  0.0002 -0.0012] 
#                   MJX    [-0.202   0.1006 -0.0742 -0.0004  0.0002 -0.0012]
#   ellipsoid model MuJoCo [-0.8869 -0.0284 -0.1164 -0.0011 -0.019  -0.0733] 
#                   MJX    [-0.202   0.1006 -0.0742 -0.0004  0.0002 -0.0012]
#   drag along x: MuJoCo -0.887 N, MJX -0.202 N, no error and no warning
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check mujoco==4.0.0 mujoco-core==4.0.0 mujoco-mjx==3.17.0 jax==0.10.1 jaxlib==0.10.1 numpy==2.4.6
env/bin/python - <<'END' 2>&1 | grep -v 'Failed to import'
import warnings
from importlib.metadata import version

warnings.simplefilter("error", UserWarning)
import jax

jax.config.update("jax_platform_name", "cpu")
import mujoco
import numpy as np
from mujoco import mjx

print("mujoco", mujoco.__version__, "mujoco-mjx", version("mujoco-mjx"))
FILE = """<mujoco><option density="1.2" viscosity="1e-3" gravity="0 0 0"/><worldbody><body><freejoint/>
<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.012 0.02"/>
<geom type="ellipsoid" size="0.1 0.2 0.15" mass="0" contype="0" conaffinity="0" fluidshape="{}"/></body></worldbody></mujoco>"""


def passive(shape):
    model = mujoco.MjModel.from_xml_string(FILE.format(shape))
    data = mujoco.MjData(model)
    data.qvel[:] = [3, -2, 1, 2, -1, 4]
    mujoco.mj_forward(model, data)
    there = mjx.forward(mjx.put_model(model), mjx.put_data(model, data))
    return data.qfrc_passive.copy(), np.asarray(there.qfrc_passive, float)


box, box_x = passive("none")
ell, ell_x = passive("ellipsoid")
np.set_printoptions(precision=4, suppress=True)
print("box model       MuJoCo", box, "\n                MJX   ", box_x)
print("ellipsoid model MuJoCo", ell, "\n                MJX   ", ell_x)
assert np.allclose(box, box_x, rtol=1e-4, atol=1e-6), "the box model agrees in both"
assert np.allclose(ell_x, box, rtol=1e-4, atol=1e-6), "MJX has the ellipsoid now"
assert ell[0] / ell_x[0] > 4 and ell[1] * ell_x[1] < 0, "and the forces differ by far"
print(f"drag along x: MuJoCo {ell[0]:.3f} N, MJX {ell_x[0]:.3f} N, no error and no warning")
END
