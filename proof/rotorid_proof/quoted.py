"""What the report quotes of a verdict: what it says, as its page does, and the error of every channel."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

CHANNEL_COLUMNS = ["example", "channel", "split", "unit", "before", "refitted", "after", "noise_floor"]


def said(verdict: Mapping[str, Any]) -> dict[str, Any]:
    """The verdict in words: in one word, in one sentence, what it rests on and what is doubted, and its warnings."""
    return {
        "verdict": verdict["verdict"].replace("_", " "),
        "sentence": verdict["sentence"],
        "said_before": [verdict["basis"]["sentence"], *(doubt["sentence"] for doubt in verdict["doubts"])],
        "said_with_it": list(verdict["warnings"]),
    }


def channels(example: str, verdict: Mapping[str, Any]) -> list[dict[str, Any]]:
    """RMS error of each channel by split (`training`, `held_out`): `CHANNEL_COLUMNS`, in the channel's unit."""
    return [
        {"example": example, "channel": name, "split": split, "unit": channel["unit"], **(errors or {})}
        | {"noise_floor": channel["noise_floor"]}
        for name, channel in verdict["channels"].items()
        for split, errors in channel["rmse"].items()
    ]
