#!/usr/bin/env bash
# One would guess: Multirotor(quad_params) starts at rest in a hover of the vehicle that quad_params describes, and
# every key that the bundled parameter files have is read.
#
# What happens: every vehicle starts with rotors at 1788.53 rad/s, a Crazyflie's hover: the bundled Hummingbird, whose
# hover is 469 rad/s, starts above its own rotor_speed_max of 1500. The key rI ("location of the IMU sensor") is read
# by nothing; the sensor takes its place as Imu(p_BS=...).
#
# Why it matters: the first samples of a simulated flight hold thrust that no command asked for and that decays with
# the motors' time constant, which biases an identified lag; and an accelerometer placed by rI is still at the centre
# of mass.
#
# Output seen:
#   rotorpy 3.0.0
#   crazyflie: hover 1788.6, highest 2500, start 1788.53 rad/s; 0.1 s of hover's command later 0.000 m/s; rI read: False
#   hummingbird: hover 469.2, highest 1500, start 1788.53 rad/s; 0.1 s of hover's command later 0.427 m/s; rI read: False
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check rotorpy==3.0.0
env/bin/python - <<'END'
from importlib.metadata import version

import numpy as np
from rotorpy.vehicles.crazyflie_params import quad_params as crazyflie
from rotorpy.vehicles.hummingbird_params import quad_params as hummingbird
from rotorpy.vehicles.multirotor import Multirotor


class Watched(dict):
    """Parameters that remember which keys were read."""

    def __init__(self, own):
        super().__init__(own)
        self.read = set()

    def __getitem__(self, key):
        self.read.add(key)
        return super().__getitem__(key)

    def get(self, key, default=None):
        self.read.add(key)
        return super().get(key, default)


print("rotorpy", version("rotorpy"))
for name, own in (("crazyflie", crazyflie), ("hummingbird", hummingbird)):
    watched = Watched(own)
    vehicle = Multirotor(watched)
    hover = np.sqrt(own["mass"] * 9.81 / (own["num_rotors"] * own["k_eta"]))
    state = vehicle.initial_state
    start = state["rotor_speeds"][0]
    for _ in range(10):
        state = vehicle.step(state, {"cmd_motor_speeds": np.full(4, hover)}, 0.01)
    print(f"{name}: hover {hover:.1f}, highest {own['rotor_speed_max']}, start {start} rad/s; 0.1 s of hover's command "
          f"later {abs(state['v'][2]):.3f} m/s; rI read: {'rI' in watched.read}")
    assert start == 1788.53, "the start is another now"
    assert "rI" in own and "rI" not in watched.read, "rI is read now"
assert start > hummingbird["rotor_speed_max"] and state["v"][2] > 0.1
END
