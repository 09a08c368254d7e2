#!/usr/bin/env bash
# One would guess: pymavlink turns GPS week and milliseconds of an ArduPilot log into UTC (_timestamp) with the leap
# seconds of that day.
#
# What happens: 18 s are taken off whatever the day. They were 16 until 30 June 2015 and 17 until the end of 2016:
# flights of then are 2 s and 1 s early.
#
# Why it matters: old public flights that are aligned by UTC with motion capture, video or a bag are shifted by 50 to
# 400 samples.
#
# Output seen:
#   pymavlink 2.4.50
#   flown 2014-10-09 12:00:00 UTC, read as 11:59:58: -2 s
#   flown 2016-05-01 12:00:00 UTC, read as 11:59:59: -1 s
#   flown 2024-05-01 12:00:00 UTC, read as 12:00:00: +0 s
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check pymavlink==2.4.50
env/bin/python - <<'END'
import struct
from datetime import datetime, timedelta, timezone
from importlib.metadata import version
from pymavlink import DFReader

C = {"Q": "Q", "B": "B", "I": "I", "H": "H", "n": "4s", "N": "16s", "Z": "64s"}
KINDS = {128: ("FMT", "BBnNZ", "Type,Length,Name,Format,Columns"), 2: ("GPS", "QBIHB", "TimeUS,Status,GMS,GWk,NSats")}


def code(form):
    return "<" + "".join(C[c] for c in form)


def put(kind, *v):
    return b"\xa3\x95" + bytes([kind]) + struct.pack(code(KINDS[kind][1]), *v)


zero = datetime(1980, 1, 6, tzinfo=timezone.utc)
NOON = {2014: (10, 9, 16), 2016: (5, 1, 17), 2024: (5, 1, 18)}  # month, day, GPS less UTC in seconds
print("pymavlink", version("pymavlink"))
errors = []
for year, (month, day, leap) in NOON.items():
    utc = datetime(year, month, day, 12, tzinfo=timezone.utc)
    gps = utc - zero + timedelta(seconds=leap)
    week, ms = divmod(int(gps / timedelta(milliseconds=1)), 7 * 86_400_000)
    log = b"".join(
        put(128, k, 3 + struct.calcsize(code(f)), n.encode(), f.encode(), c.encode())
        for k, (n, f, c) in KINDS.items()
    )
    log += put(2, 5_000_000, 3, ms, week, 12)
    path = f"{utc.year}.bin"
    with open(path, "wb") as file:
        file.write(log)
    m = DFReader.DFReader_binary(path).recv_match(type="GPS")
    errors.append(round(m._timestamp - utc.timestamp(), 3))
    print(
        f"flown {utc:%Y-%m-%d %H:%M:%S} UTC, read as {datetime.fromtimestamp(m._timestamp, timezone.utc):%H:%M:%S}: {errors[-1]:+g} s"
    )
assert errors[-1] == 0
assert errors == [-2.0, -1.0, 0.0], "leap seconds are those of the day now"
END
