#!/usr/bin/env bash
# One would guess: pandas 3 turns a column of seconds into times of one resolution, so that the integers behind them
# have one unit.
#
# What happens: whole seconds, float or not, become microseconds; as soon as one value has a fraction the column
# becomes nanoseconds. The integers behind a receiver's log at 1 Hz and at 5 Hz differ by 1000; Timestamp.value is
# nanoseconds in both. to_timedelta does the same.
#
# Why it matters: column.astype("int64") / 1e9, right for the one log, makes the other 1000 times too fast; every rate,
# speed and time constant follows.
#
# Output seen:
#   pandas 3.1.1
#   1 Hz: datetime64[us], integer behind the first 1700000000000000, Timestamp.value 1700000000000000000, seconds by / 1e9: 1700000.000
#   5 Hz: datetime64[ns], integer behind the first 1700000000000000000, Timestamp.value 1700000000000000000, seconds by / 1e9: 1700000000.000
#   to_timedelta of whole and of half seconds: timedelta64[us] timedelta64[ns]
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check pandas==3.1.1 numpy==2.4.6
env/bin/python - <<'END'
import pandas as pd

print("pandas", pd.__version__)
slow = pd.to_datetime(pd.Series([1700000000.0, 1700000001.0, 1700000002.0]), unit="s")
fast = pd.to_datetime(pd.Series([1700000000.0, 1700000000.2, 1700000000.4]), unit="s")
for name, times in (("1 Hz", slow), ("5 Hz", fast)):
    print(
        f"{name}: {times.dtype}, integer behind the first {times.astype('int64').iloc[0]}, "
        f"Timestamp.value {times.iloc[0].value}, seconds by / 1e9: {(times.astype('int64') / 1e9).iloc[0]:.3f}"
    )
assert fast.astype("int64").iloc[0] == 1000 * slow.astype("int64").iloc[0]
assert slow.iloc[0].value == fast.iloc[0].value
steps = [str(pd.to_timedelta(column, unit="s").dtype) for column in ([1.0, 2.0], [0.5, 1.5])]
print("to_timedelta of whole and of half seconds:", *steps)
assert steps == ["timedelta64[us]", "timedelta64[ns]"]
assert str(slow.dtype) == "datetime64[us]" and str(fast.dtype) == "datetime64[ns]", (
    "the unit is one of all columns now"
)
END
