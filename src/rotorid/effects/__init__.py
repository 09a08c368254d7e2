"""Omitted physics, one effect a file."""
