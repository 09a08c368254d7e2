"""Readings of the identification flight; apart from what flies it, so that the configuration is checked at once."""

READING_S = 0.004
"""Time between readings, s."""
