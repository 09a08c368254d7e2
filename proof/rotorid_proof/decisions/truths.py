"""What is true of a planted set, as JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from rotorid_proof.plantings.kinds import Ratio, Size, Truth

SETS = ("names", "fair", "shown_by", "hidden_by", "first_only")


def as_json(truth: Truth) -> dict[str, Any]:
    """A truth as JSON."""
    return asdict(truth) | {name: sorted(getattr(truth, name)) for name in SETS}


def from_json(facts: Mapping[str, Any]) -> Truth:
    """The truth that `as_json` wrote."""
    return Truth(
        **{
            **facts,
            **{name: frozenset(facts[name]) for name in SETS},
            "sizes": tuple(tuple(Size(**size) for size in form) for form in facts["sizes"]),
            "ratio": None if facts["ratio"] is None else Ratio(**facts["ratio"]),
        }
    )
