"""Recorders and emulated instruments that write raw serial logs."""

OPEN = (
    "cli",
    "io.frames",
    "io.logs",
    "io.metadata_checksum",
    "io.session",
    "io.wire",
)
"""Modules that other rooms may import; all else is this room's own."""
