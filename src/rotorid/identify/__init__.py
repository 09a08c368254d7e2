"""What flights determine of an autopilot's parameters."""

OPEN = ("autopilot",)
"""Modules that other rooms may import; all else is this room's own."""
