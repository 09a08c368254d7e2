"""Every verdict made here, of shared recordings and of examples: no floor is above an error that is reached."""

import json
from pathlib import Path

import pytest

RESULTS = Path(__file__).parents[2] / "results"
VERDICTS = sorted(RESULTS.glob("**/verdict.json")) if RESULTS.is_dir() else []
pytestmark = [pytest.mark.slow, pytest.mark.skipif(not VERDICTS, reason="no verdict was made here")]


@pytest.mark.parametrize("path", VERDICTS, ids=lambda p: str(p.parent.relative_to(RESULTS)))
def test_no_floor_is_above_an_error_that_is_reached(path: Path) -> None:
    for name, channel in json.loads(path.read_text(encoding="utf-8"))["channels"].items():
        errors = [e for e in channel["rmse"]["held_out"].values() if e is not None]
        floor = channel["noise_floor"]
        assert floor is None or not errors or floor <= min(errors) * 1.001, f"{name}: {floor}, reached {min(errors)}"
