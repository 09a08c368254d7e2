"""Filters and derivatives shared by every stage."""
