"""The next experiment: what to fly so that the causes a verdict left open can be distinguished, and how well it
would."""

OPEN = ("candidates", "plan", "questions", "separation", "session", "simulate", "write")
"""Modules that other rooms may import; all else is this room's own."""
