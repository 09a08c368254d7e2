"""Which set it is that something is kept of. Light: read at every start."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Label:
    """Which set it is."""

    name: str
    """`drawn/<case>`, `planted/<planting>`, `untouched/<flight>` or `study/<study>`."""
    plant: str
    """`flight`, `stand` or `bench`."""
    laboratory: str
    """Simulator of a drawn set, flight or public set of a real one."""
    family: str
    """Family of the case or planting."""

    @property
    def origin(self) -> str:
        """First part of the name."""
        return self.name.split("/")[0]
