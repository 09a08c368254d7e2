"""Benches and stands: loads through springs that creep, plays that turn, walls that warm, amplifiers and ageing cables.

A load cell is a state-space model integrated at ten times the recording's rate. Shares nothing with the others.
"""
