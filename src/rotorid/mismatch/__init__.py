"""Locate a mismatch between simulation and recordings, name what was left out, model it, improve."""
