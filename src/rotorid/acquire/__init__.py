"""Recorders and emulated instruments that write raw serial logs."""

OPEN = ("cli",)
"""Modules that other rooms may import; all else is this room's own."""
