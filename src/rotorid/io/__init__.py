"""Files: raw logs of instruments and their tables; texts that people write, and sentences to them."""

OPEN = (
    "frames",
    "lines",
    "logs",
    "metadata_checksum",
    "models",
    "public_list",
    "rawlog",
    "session",
    "text.files",
    "text.wording",
    "text.writing",
    "wire",
)
"""Modules that other rooms may import; all else is this room's own."""
