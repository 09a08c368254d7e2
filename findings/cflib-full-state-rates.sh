#!/usr/bin/env bash
# One would guess: cflib's send_full_state_setpoint takes rates in degrees/s, as its own description says and as all
# other commands of cflib do.
#
# What happens: the number is multiplied by 1000 and packed as an integer of 16 bits; the Crazyflie's firmware reads it
# as milliradians/s. 10 arrives as 10 rad/s, 573 deg/s; 33 cannot be sent at all (struct.error), so that the range fits
# rad/s and not the description.
#
# Why it matters: a feed-forward of body rates in degrees/s is 57 times too large.
#
# Output seen:
#   cflib 0.1.34 - its description: rollrate, pitchrate, yawrate are in degrees/s
#   10 is sent as 10000; read as milliradians/s that is 573 deg/s
#   33 is refused: short format requires -32768 <= number <= 32767
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check cflib==0.1.34
env/bin/python - <<'END'
import math
import struct
from importlib.metadata import version
from cflib.crazyflie.commander import Commander


class Recorder:
    def send_packet(self, packet):
        self.data = bytes(packet.data)


link = Recorder()
command = Commander(link)


def send(rate):
    command.send_full_state_setpoint([0, 0, 1], [0, 0, 0], [0, 0, 0], [0, 0, 0, 1], rate, 0, 0)
    return struct.unpack("<BhhhhhhhhhIhhh", link.data)[-3]


says = next(line.strip() for line in Commander.send_full_state_setpoint.__doc__.splitlines() if "rollrate" in line)
word = send(10)
try:
    send(33)
    refused = ""
except struct.error as error:
    refused = str(error)
print("cflib", version("cflib"), "- its description:", says)
print(f"10 is sent as {word}; read as milliradians/s that is {math.degrees(word / 1000):.0f} deg/s")
print("33 is refused:", refused)
assert word == 10000 and refused
assert "degrees/s" in says, "rates are described as they are sent now"
END
