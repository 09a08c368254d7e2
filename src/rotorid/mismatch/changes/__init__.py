"""What changed between sets of flights of one vehicle: `changes_between`, and against several good ones `as_one`."""

from rotorid.mismatch.changes.compare import Changes, as_one, changes_between, changes_from
from rotorid.mismatch.changes.joint import reference_of

__all__ = ["Changes", "as_one", "changes_between", "changes_from", "reference_of"]
