"""The thesis's four sentences on its simulations (2.5.2), each held to a table of benches of different sizes."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

EVEN = 0.9
"""A plate moves evenly where its least displacement is at least this share of its largest."""
MIDDLE = 0.99
"""Its largest displacement is in its middle where the middle has at least this share of it."""
NEARLY = 0.1
"""Two stresses are nearly the same where they differ by at most this share."""


@dataclass(frozen=True)
class Judged:
    """A sentence and on how many benches it holds."""

    statement: str
    on_assumed: bool
    """Whether it holds with all sizes as assumed."""
    holds: int
    benches: int

    @property
    def word(self) -> str:
        """What follows from that."""
        if self.holds == self.benches:
            return "follows"
        return "does not follow" if self.holds == 0 else "depends on the assumed sizes"


def judge(table: pd.DataFrame) -> list[Judged]:
    """Each sentence on each bench.

    Parameters
    ----------
    table
        A bench a row, the first with all sizes as assumed; columns `ratio_deformation`, `ratio_narrow_upper`,
        `ratio_narrow_lower`; `plate_evenness`, `plate_middle` and `stressed_most` with `_aluminium` and with `_pla`.
    """
    even = table["plate_evenness_aluminium"] >= EVEN
    middle = (table["plate_middle_pla"] >= MIDDLE) & (table["plate_evenness_pla"] < table["plate_evenness_aluminium"])
    held = {
        "PLA deforms more than aluminium": table["ratio_deformation"] > 1,
        "aluminium's piece D deforms evenly": even,
        "PLA's piece D deforms most in its middle, and less evenly": middle,
        "the largest stresses lie in different pieces": table["stressed_most_aluminium"] != table["stressed_most_pla"],
        "the stress in an upper cell's narrow section is nearly the same": _nearly(table["ratio_narrow_upper"]),
        "the stress in a lower cell's narrow section is nearly the same": _nearly(table["ratio_narrow_lower"]),
    }
    return [Judged(name, bool(holds.iloc[0]), int(holds.sum()), len(holds)) for name, holds in held.items()]


def _nearly(ratio: pd.Series) -> pd.Series:
    return (ratio - 1).abs() <= NEARLY
