"""What `check` finds doubtful in a recording set, for a person to read and for a verdict to decide by."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Doubt:
    """One thing in a set that is probably not as stated."""

    what: str
    """Key of vehicle.yaml (`mass_kg`), column (`angular_velocity_x_rad_s`), file or run that is in doubt."""
    sentence: str
    """What was found, what was expected and, where one is known, what would explain it."""
    stops: bool
    """Whether a verdict would be about this mistake: a unit, an axis, an order, or mass or inertia by more than a
    factor of two."""

    def __str__(self) -> str:
        return self.sentence
