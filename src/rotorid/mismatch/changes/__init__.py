"""What changed between two sets of flights of one vehicle: `changes_between`."""

from rotorid.mismatch.changes.compare import Changes, changes_between

__all__ = ["Changes", "changes_between"]
