"""Where other laboratories' logs are, and the mark of a test that needs them."""

import os
from pathlib import Path

import pytest

_named = os.environ.get("ROTORID_PUBLIC_DATA")
ROOT = Path(__file__).resolve().parents[1]
PUBLIC = (ROOT / _named).resolve() if _named else ROOT.parent / "shared" / "data"
LOGS = PUBLIC / "logs"
needs_logs = pytest.mark.skipif(not LOGS.is_dir(), reason="the logs of other laboratories are not here")
