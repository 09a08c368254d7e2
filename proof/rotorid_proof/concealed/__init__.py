"""Recordings whose hidden cause is known, made by code that shares nothing with `rotorid`."""
