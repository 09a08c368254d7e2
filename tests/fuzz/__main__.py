"""Fuzzing by coverage. atheris is no dependency of the project: `pip install atheris` beside it, then

.venv/bin/python -m tests.fuzz -max_total_time=1800 -rss_limit_mb=2000 -timeout=20 NEW_FOLDER tests/fuzz/corpus
"""

import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["rotorid"]):
    from tests.fuzz.raw_log import look

with tempfile.TemporaryDirectory(dir="/dev/shm") as folder:
    atheris.Setup(sys.argv, lambda data: look(data, Path(folder)))
    atheris.Fuzz()
