#!/usr/bin/env bash
# One would guess: MJX is MuJoCo on a GPU, so a force that mujoco.set_mjcb_passive adds in every step of MuJoCo acts in
# MJX as well, or put_model refuses the model.
#
# What happens: MJX never calls the callback and says nothing: a body that the callback slows to 37 % of its speed in a
# second keeps all of it.
#
# Why it matters: identified drag and derivatives are added to MuJoCo by this callback. A policy that learns in MJX
# then learns on the vehicle without them, and the comparison with MuJoCo is one of two vehicles.
#
# Output seen:
#   mujoco 4.0.0 mujoco-mjx 3.17.0 jax 0.10.2
#   after 1 s of drag: MuJoCo 0.366 m/s, 100 calls; MJX 1.000 m/s, 0 calls
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check mujoco==4.0.0 mujoco-mjx==3.17.0 jax==0.10.2 numpy==2.4.6
env/bin/python - <<'END'
from importlib.metadata import version

import jax
import mujoco
import numpy as np
from mujoco import mjx

TEXT = """<mujoco><option gravity="0 0 0" timestep="0.01"/><worldbody><body><freejoint/>
  <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>"""
calls = 0


def drag(model, data):
    global calls
    calls += 1
    data.qfrc_passive[0] -= data.qvel[0]


model = mujoco.MjModel.from_xml_string(TEXT)
mujoco.set_mjcb_passive(drag)
data = mujoco.MjData(model)
data.qvel[0] = 1.0
there = mjx.put_data(model, data)
for _ in range(100):
    mujoco.mj_step(model, data)
in_mujoco, calls = calls, 0
step, device_model = jax.jit(mjx.step), mjx.put_model(model)
for _ in range(100):
    there = step(device_model, there)
slowed, kept = data.qvel[0], float(np.asarray(there.qvel)[0])
print("mujoco", version("mujoco"), "mujoco-mjx", version("mujoco-mjx"), "jax", version("jax"))
print(f"after 1 s of drag: MuJoCo {slowed:.3f} m/s, {in_mujoco} calls; MJX {kept:.3f} m/s, {calls} calls")
assert in_mujoco == 100 and abs(slowed - 0.366) < 1e-3
assert calls == 0 and kept == 1.0, "MJX calls the passive callback now"
END
