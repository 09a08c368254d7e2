#!/usr/bin/env bash
# One would guess: after mj_step the sensors (gyro, accelerometer) and qvel in the same mjData belong to the same
# instant.
#
# What happens: sensordata is computed at the start of the step, qpos and qvel are those at its end: the gyro is one
# step behind qvel, with every integrator.
#
# Why it matters: a simulated log that writes both in one row has a delay of one step between accelerometer and
# gyroscope on one side and pose and velocity on the other. Identification finds it as a delay of the sensors that the
# vehicle does not have. mj_forward before the row is written, or the row written before the step, has both at one
# instant.
#
# Output seen:
#   mujoco 4.0.0
#   Euler: t = 0.03 s, qvel 0.0300, gyro 0.0200, after mj_forward 0.0300 rad/s
#   RK4: t = 0.03 s, qvel 0.0300, gyro 0.0200, after mj_forward 0.0300 rad/s
#   implicitfast: t = 0.03 s, qvel 0.0300, gyro 0.0200, after mj_forward 0.0300 rad/s
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check mujoco==4.0.0 numpy==2.4.6
env/bin/python - <<'END'
from importlib.metadata import version

import mujoco

TEXT = """<mujoco><option gravity="0 0 0" timestep="0.01" integrator="{}"/><worldbody><body><freejoint/>
  <inertial pos="0 0 0" mass="1" diaginertia="0.002 0.003 0.004"/><site name="imu"/></body></worldbody>
  <actuator><motor site="imu" gear="0 0 0 1 0 0"/></actuator><sensor><gyro site="imu"/></sensor></mujoco>"""
print("mujoco", version("mujoco"))
for integrator in ("Euler", "RK4", "implicitfast"):
    model = mujoco.MjModel.from_xml_string(TEXT.format(integrator))
    data = mujoco.MjData(model)
    data.ctrl[0] = 0.002  # 1 rad/s2
    mujoco.mj_step(model, data, 3)
    late, state = data.sensordata[0], data.qvel[3]
    mujoco.mj_forward(model, data)
    now = data.sensordata[0]
    print(f"{integrator}: t = {data.time:.2f} s, qvel {state:.4f}, gyro {late:.4f}, after mj_forward {now:.4f} rad/s")
    assert abs(state - 0.03) < 1e-9 and abs(now - state) < 1e-12
    assert abs(late - 0.02) < 1e-9, "gyro and state belong to one instant now"
END
