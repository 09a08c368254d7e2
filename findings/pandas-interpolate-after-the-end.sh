#!/usr/bin/env bash
# One would guess: two sensors joined on their times and filled with interpolate() are linear in time, and empty where
# a sensor has no readings before or after.
#
# What happens: the default counts rows, not the index: a position of 0 m at 0 s and 10 m at 10 s is 3.3 m at 1 s where
# rows are unevenly spaced. With method="index" it is 1 m; but both fill on after a sensor's last reading and hold it
# to the end of the table. limit_area="inside" ends that.
#
# Why it matters: a motion capture that loses the vehicle at 2 s yields a vehicle that stands still in the air until
# the end of the log, at full rate and with all columns present; a residual there is taken for an effect.
#
# Output seen:
#   pandas 3.1.1
#   interpolate(): at 1 s 3.33 m, at 12 s 10.0 m
#   method='index': at 1 s 1.00 m, at 12 s 10.0 m
#   and limit_area='inside': at 1 s 1.00 m, at 12 s nan m
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check pandas==3.1.1 numpy==2.4.6
env/bin/python - <<'END'
from importlib.metadata import version

import numpy as np
import pandas as pd

print("pandas", version("pandas"))
times = [0.0, 1.0, 2.0, 10.0, 11.0, 12.0]
position = pd.Series([0.0, np.nan, np.nan, 10.0, np.nan, np.nan], index=times)
found = {}
for name, how in (("interpolate()", {}), ("method='index'", {"method": "index"}),
                  ("and limit_area='inside'", {"method": "index", "limit_area": "inside"})):
    found[name] = position.interpolate(**how)
    print(f"{name}: at 1 s {found[name][1.0]:.2f} m, at 12 s {found[name][12.0]} m")
assert found["and limit_area='inside'"].isna().sum() == 2
assert abs(found["interpolate()"][1.0] - 10 / 3) < 1e-9, "interpolate() goes by the index now"
assert found["method='index'"][12.0] == 10.0, "nothing is filled after the last value now"
END
