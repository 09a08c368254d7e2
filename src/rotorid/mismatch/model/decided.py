"""What the fitted runs of a flight decide, before its report runs are opened."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rotorid.mismatch.decision.findings import Finding

if TYPE_CHECKING:
    from rotorid.mismatch.model.fitted import Fitted


@dataclass(frozen=True)
class Decided:
    """The model of a flight, and what is said of it by the fitted runs alone."""

    found: Fitted
    outside: tuple[Finding, ...]
    """Decided before the regression or outside of it of force and moment: mistakes, wind, gusts, the command chain."""
    findings: tuple[Finding, ...]
    """All of them, those that the regression selected or dropped included."""
    values: Mapping[str, tuple[float, float, float, float]]
    """Contract name of a value called wrong to the one believed, the one found and its 95 % interval."""


Watch = Callable[[Decided], None]


def unwatched(decided: Decided) -> None:
    """Nobody watches."""
