"""Words for how surely an id is at work, and a fitted number with its interval."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

CLAIMED = ("established", "ambiguous")
"""Statuses of what is held to be at work."""
Status = Literal["established", "ambiguous", "suggested", "absorbed", "not_established"]


@dataclass(frozen=True)
class Estimate:
    """A fitted number with its 95 % interval."""

    symbol: str
    value: float
    unit: str
    low: float
    high: float
