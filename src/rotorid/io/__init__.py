"""Files: models of what is written, texts that people write, and sentences to them."""

OPEN = (
    "models",
    "text.files",
    "text.wording",
    "text.writing",
)
"""Modules that other rooms may import; all else is this room's own."""
