#!/usr/bin/env bash
# One would guess: `pitch` means the same in cflib's send_setpoint, send_setpoint_manual and send_zdistance_setpoint.
#
# What happens: the first two put -pitch into the packet, the third +pitch. The firmware takes both as they come, so
# that pitch=5 tilts the vehicle one way where thrust is commanded and the other way where height is.
#
# Why it matters: commanded pitch next to the logged stabilizer.pitch has the other sign in one half of the
# experiments.
#
# Output seen:
#   cflib 0.1.34 - asked for roll 1, pitch 5, yaw rate 10
#   send_setpoint: roll +1, pitch -5, yaw rate +10 in the packet
#   send_setpoint_manual: roll +1, pitch -5, yaw rate +10 in the packet
#   send_zdistance_setpoint: roll +1, pitch +5, yaw rate +10 in the packet
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check cflib==0.1.34
env/bin/python - <<'END'
import struct
from importlib.metadata import version
from cflib.crazyflie.commander import Commander


class Platform:
    def get_protocol_version(self):
        return 10


class Recorder:
    platform = Platform()

    def send_packet(self, packet):
        self.data = bytes(packet.data)


link = Recorder()
command, sent = Commander(link), {}
command.send_setpoint(1, 5, 10, 30000)
sent["send_setpoint"] = struct.unpack("<fffH", link.data)[:3]
command.send_setpoint_manual(1, 5, 10, 50, False)
sent["send_setpoint_manual"] = struct.unpack("<BfffHB", link.data)[1:4]
command.send_zdistance_setpoint(1, 5, 10, 0.4)
sent["send_zdistance_setpoint"] = struct.unpack("<Bffff", link.data)[1:4]
print("cflib", version("cflib"), "- asked for roll 1, pitch 5, yaw rate 10")
for name, v in sent.items():
    print(f"{name}: roll {v[0]:+g}, pitch {v[1]:+g}, yaw rate {v[2]:+g} in the packet")
assert {(v[0], v[2]) for v in sent.values()} == {(1, 10)}
assert [v[1] for v in sent.values()] == [-5, -5, 5], "pitch has one sign in all commands now"
END
