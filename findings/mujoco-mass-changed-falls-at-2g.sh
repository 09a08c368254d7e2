#!/usr/bin/env bash
# One would guess: model.body_mass[1] *= 2 makes a vehicle twice as heavy: half the acceleration of the same thrust,
# and the same free fall.
#
# What happens: for a body whose inertia is given in its own axes (diaginertia, model.body_simple is 1) MuJoCo keeps
# the inertia that it had when the model was made, and takes the new mass for the weight: the acceleration of a thrust
# is unchanged, and it falls at 2 g. mj_setConst after the change makes both right. With rotated principal axes, and in
# MJX, the change acts at once.
#
# Why it matters: masses and inertias are drawn anew for every episode in this way, or an identified mass is written
# into a loaded model. Whether that is right depends on the file's form of the inertia: products of inertia switch it
# on.
#
# Output seen:
#   mujoco 4.0.0
#   own axes: mass doubled, free fall -19.62 m/s2, of 1 N 1.00 m/s2; after mj_setConst -9.81 and 0.50 m/s2
#   turned axes: mass doubled, free fall -9.81 m/s2, of 1 N 0.50 m/s2; after mj_setConst -9.81 and 0.50 m/s2
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check mujoco==4.0.0 numpy==2.4.6
env/bin/python - <<'END'
from importlib.metadata import version

import mujoco

TEXT = """<mujoco><worldbody><body><freejoint/>
  <inertial pos="0 0 0" mass="1" {}/><site name="centre"/></body></worldbody><actuator><motor site="centre" gear="0 0 1 0 0 0"/></actuator></mujoco>"""


def upward(model, thrust):
    """Acceleration, m/s2."""
    data = mujoco.MjData(model)
    data.ctrl[0] = thrust
    mujoco.mj_forward(model, data)
    return data.qacc[2]


print("mujoco", version("mujoco"))
seen = {}
for name, said in (("own axes", 'diaginertia="0.002 0.003 0.004"'),
                   ("turned axes", 'fullinertia="0.002 0.003 0.004 1e-4 0 0"')):
    model = mujoco.MjModel.from_xml_string(TEXT.format(said))
    model.body_mass[1] *= 2
    changed = [upward(model, 0), upward(model, 1) - upward(model, 0)]
    mujoco.mj_setConst(model, mujoco.MjData(model))
    set_anew = [upward(model, 0), upward(model, 1) - upward(model, 0)]
    seen[name] = changed
    print(f"{name}: mass doubled, free fall {changed[0]:.2f} m/s2, of 1 N {changed[1]:.2f} m/s2; "
          f"after mj_setConst {set_anew[0]:.2f} and {set_anew[1]:.2f} m/s2")
    assert abs(set_anew[0] + 9.81) < 1e-9 and abs(set_anew[1] - 0.5) < 1e-9
assert abs(seen["turned axes"][0] + 9.81) < 1e-9
fall, climb = seen["own axes"]
assert abs(fall + 19.62) < 1e-9 and abs(climb - 1) < 1e-9, "a changed mass acts at once now"
END
