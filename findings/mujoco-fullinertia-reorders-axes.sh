#!/usr/bin/env bash
# One would guess: fullinertia with zero products is the same as diaginertia: model.body_inertia is Ixx, Iyy, Izz.
#
# What happens: MuJoCo diagonalises it and sorts the moments from the largest: body_inertia is Izz, Iyy, Ixx, and
# body_iquat turns the axes by 90 degrees. The body itself turns as it should.
#
# Why it matters: whoever draws inertias for reinforcement learning, or writes an identified Ixx into body_inertia[:,
# 0], changes the inertia about another axis than the one meant, without an error. A file with products of inertia
# needs fullinertia, so that a vehicle changes its order of axes on the day its products are identified.
#
# Output seen:
#   mujoco 4.0.0
#   fullinertia: body_inertia [0.004, 0.003, 0.002]; roll 1.000 rad/s2, with body_inertia[1, 0] doubled 1.000
#   diaginertia: body_inertia [0.002, 0.003, 0.004]; roll 1.000 rad/s2, with body_inertia[1, 0] doubled 0.500
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check mujoco==4.0.0 numpy==2.4.6
env/bin/python - <<'END'
from importlib.metadata import version

import mujoco

TEXT = """<mujoco><option gravity="0 0 0"/><worldbody><body><freejoint/>
  <inertial pos="0 0 0" mass="1" {}/><site name="centre"/></body></worldbody>
  <actuator><motor site="centre" gear="0 0 0 1 0 0"/></actuator></mujoco>"""


def rolls(model):
    """Roll acceleration of 0.002 N m, rad/s2."""
    data = mujoco.MjData(model)
    data.ctrl[0] = 0.002
    mujoco.mj_forward(model, data)
    return data.qacc[3]


print("mujoco", version("mujoco"))
full, plain = (mujoco.MjModel.from_xml_string(TEXT.format(said)) for said in
               ('fullinertia="0.002 0.003 0.004 0 0 0"', 'diaginertia="0.002 0.003 0.004"'))
for name, model in (("fullinertia", full), ("diaginertia", plain)):
    before = rolls(model)
    shown = model.body_inertia[1].tolist()
    model.body_inertia[1, 0] *= 2
    mujoco.mj_setConst(model, mujoco.MjData(model))
    print(f"{name}: body_inertia {shown}; roll {before:.3f} rad/s2, with body_inertia[1, 0] doubled {rolls(model):.3f}")
assert abs(rolls(plain) - 0.5) < 1e-9
assert abs(rolls(full) - 1.0) < 1e-9, "body_inertia keeps the order of the file now"
END
