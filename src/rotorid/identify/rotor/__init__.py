"""Rotors on a thrust stand."""
