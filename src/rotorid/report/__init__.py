"""What is written for a reader: a verdict's files and page, figures of the report (its chapters are in notebooks/)."""

OPEN = ("deliver", "fleet", "next_to_log", "page", "plots.*", "provenance", "series_files")
"""Modules that other rooms may import; all else is this room's own."""
