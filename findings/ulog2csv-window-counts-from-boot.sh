#!/usr/bin/env bash
# One would guess: -ts and -te of pyulog's ulog2csv are seconds from the beginning of the log, as ulog_info counts
# them; a topic that ends before the window is empty.
#
# What happens: they count from the boot of the autopilot. A log that begins 112 s after boot, cut with -ts 10 -te 20,
# gives headings alone and success. Where a topic has no sample after -ts the command ends in an IndexError after that
# topic's heading: it looks like a topic without data, and the topics after it are missing.
#
# Why it matters: "seconds 10 to 20 of the flight" are another part of it, none, or the wrong set of files.
#
# Output seen:
#   pyulog 1.3.0
#   60 s from 112 s on, -ts 10 -te 20: ends with 0, 3 files, 3 lines, headings included
#   -ts 122 -te 150: log_aaa_whole_0.csv has 29 lines
#   -ts 122 -te 150: log_bbb_half_0.csv has 1 lines
#   -ts 122 -te 150 ends with 1: IndexError: index 0 is out of bounds for axis 0 with size 0
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check pyulog==1.3.0 numpy==2.4.6
env/bin/python - <<'END'
import struct


def message(kind, body):
    return struct.pack("<HB", len(body), ord(kind)) + body


log = b"\x55\x4c\x6f\x67\x01\x12\x35\x01" + struct.pack("<Q", 112_000_000) + message("B", bytes(40))
names = (b"aaa_whole", b"bbb_half", b"ccc_whole")
for name in names:
    log += message("F", name + b":uint64_t timestamp;float x;")
for i, name in enumerate(names):
    log += message("A", struct.pack("<BH", 0, i) + name)
for k in range(60):
    for i in range(3):
        if i != 1 or k < 30:
            log += message("D", struct.pack("<HQf", i, 112_000_000 + 1_000_000 * k, k))
with open("log.ulg", "wb") as file:
    file.write(log)
END
mkdir first second
env/bin/python -c "from importlib.metadata import version; print('pyulog', version('pyulog'))"
ended=0
env/bin/ulog2csv -ts 10 -te 20 -o first log.ulg >/dev/null || ended=$?
rows=$(cat first/*.csv | wc -l)
echo "60 s from 112 s on, -ts 10 -te 20: ends with $ended, $(ls first | wc -l) files, $rows lines, headings included"
broken=0
env/bin/ulog2csv -ts 122 -te 150 -o second log.ulg >/dev/null 2>error || broken=$?
for file in second/*; do
    echo "-ts 122 -te 150: $(basename "$file") has $(wc -l <"$file") lines"
done
echo "-ts 122 -te 150 ends with $broken: $(tail -1 error)"
[ "$ended $rows" = "0 3" ] || { echo "-ts counts from the beginning now"; exit 1; }
[ "$broken" != 0 ] && [ ! -e second/log_ccc_whole_0.csv ] || { echo "a topic that ends early is left out now"; exit 1; }
