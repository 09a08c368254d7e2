"""Fuzzing by coverage. atheris is no dependency of the project: `pip install atheris` beside it, then

.venv/bin/python -m tests.fuzz raw_log -max_total_time=1800 -rss_limit_mb=2000 -timeout=20 NEW_FOLDER tests/fuzz/corpus

and likewise for `foreign`, the logs of other makers.
"""

import sys
import tempfile
from importlib import import_module
from pathlib import Path

import atheris

target = sys.argv.pop(1)
with atheris.instrument_imports(include=["rotorid", "pyulog"]):
    look = import_module(f"tests.fuzz.{target}").look

with tempfile.TemporaryDirectory(dir="/dev/shm") as folder:
    atheris.Setup(sys.argv, lambda data: look(data, Path(folder)))
    atheris.Fuzz()
