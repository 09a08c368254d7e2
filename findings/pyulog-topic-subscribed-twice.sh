#!/usr/bin/env bash
# One would guess: get_dataset(name) returns all that a log holds of the instance, and data_list in all has every
# sample.
#
# What happens: where a topic is subscribed again within a log under a new id, data_list has two entries of the same
# name and instance, the later one first, and get_dataset gives that one. Under the same id the second subscription
# empties the first's samples: they are nowhere.
#
# Why it matters: half of a flight is missing without a warning, and what is there begins in mid-air: take-off, trim
# and battery at the start come from somewhere else.
#
# Output seen:
#   pyulog 1.3.0
#   a new id: of 20 samples from 0 us on get_dataset has 10 from 10000 us on, data_list 20; file_corruption False
#   the same id: of 20 samples from 0 us on get_dataset has 10 from 10000 us on, data_list 10; file_corruption False
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check pyulog==1.3.0 numpy==2.4.6
env/bin/python - <<'END'
import struct
from importlib.metadata import version

from pyulog import ULog


def message(kind, data):
    return struct.pack("<HB", len(data), ord(kind)) + data


def half(number, first):
    """A subscription and ten samples."""
    rows = [struct.pack("<HQf", number, 1000 * k, 16.0 - 0.01 * k) for k in range(first, first + 10)]
    return message("A", struct.pack("<BH", 0, number) + b"battery_status") + b"".join(message("D", row) for row in rows)


print("pyulog", version("pyulog"))
start = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
start += message("F", b"battery_status:uint64_t timestamp;float voltage_v;")
found = {}
for name, again in (("a new id", 7), ("the same id", 0)):
    with open("log.ulg", "wb") as file:
        file.write(start + half(0, 0) + half(again, 10))
    log = ULog("log.ulg")
    times = log.get_dataset("battery_status").data["timestamp"]
    found[name] = len(times), sum(len(d.data["timestamp"]) for d in log.data_list)
    print(f"{name}: of 20 samples from 0 us on get_dataset has {found[name][0]} from {times[0]} us on, "
          f"data_list {found[name][1]}; file_corruption {log.file_corruption}")
assert found == {"a new id": (10, 20), "the same id": (10, 10)}, "a second subscription is read otherwise now"
END
