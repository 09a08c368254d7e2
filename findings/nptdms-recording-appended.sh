#!/usr/bin/env bash
# One would guess: a TDMS file to which a second recording was appended keeps the start and the sample interval of
# each, or time_track() refuses it.
#
# What happens: a property written again replaces the first for the whole channel. time_track() lays all samples, those
# of the first recording too, on the start and the interval of the last one, without the pause between them, and says
# nothing.
#
# Why it matters: a thrust stand may write one file in a session, a segment each time that somebody presses record. The
# first run is then at a time at which it did not take place, at another rate: spin-up times and lags found in it are
# off by the ratio of the intervals, and no other log can be aligned with it.
#
# Output seen:
#   npTDMS 1.13.0 numpy 2.4.6
#   written: 5 samples from 12:00:00 every 0.1 s, 5 from 12:01:00 every 0.01 s
#   read: 10 samples from 12:01:00.000 to 12:01:00.090, the first two 0.010 s apart
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check npTDMS==1.13.0 numpy==2.4.6
env/bin/python - <<'END'
from importlib.metadata import version

import numpy as np
from nptdms import ChannelObject, TdmsFile, TdmsWriter

print("npTDMS", version("npTDMS"), "numpy", version("numpy"))
start = np.datetime64("2026-01-01T12:00:00")
for mode, begins, interval in (("w", start, 0.1), ("a", start + np.timedelta64(60, "s"), 0.01)):
    said = {"wf_start_time": begins, "wf_start_offset": 0.0, "wf_increment": interval}
    with TdmsWriter("bench.tdms", mode=mode) as writer:
        writer.write_segment([ChannelObject("bench", "thrust", np.arange(5.0), properties=said)])
channel = TdmsFile.read("bench.tdms")["bench"]["thrust"]
times = channel.time_track(absolute_time=True, accuracy="ms")
step = np.diff(channel.time_track())
print("written: 5 samples from 12:00:00 every 0.1 s, 5 from 12:01:00 every 0.01 s")
clock = [str(t).split("T")[1][:12] for t in times[[0, -1]]]
print(f"read: {len(times)} samples from {clock[0]} to {clock[1]}, the first two {step[0]:.3f} s apart")
assert len(channel) == 10
assert times[0] == start + np.timedelta64(60, "s") and np.allclose(step, 0.01), "recordings keep their own times now"
END
