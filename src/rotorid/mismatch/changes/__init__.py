"""What changed between two sets of flights of one vehicle: `changes_between`."""

from rotorid.mismatch.changes.compare import Comparison, changes_between

__all__ = ["Comparison", "changes_between"]
