"""The next experiment: what to fly so that the causes a verdict left open can be distinguished, and how well it
would."""

OPEN = (
    "changed",
    "limits",
    "plan",
    "questions",
    "separation",
    "session",
    "together",
    "write",
    "write_session",
)
"""Modules that other rooms may import; all else is this room's own."""
