"""Omitted physics, one effect a file."""

OPEN = (
    "catalogue",
    "contract",
    "delay",
    "describe",
    "gust",
    "hysteresis",
    "instant",
    "loading",
    "payload",
    "pendulum",
    "scale",
    "steady_wind",
    "throttle_curve",
    "thrust_curve",
)
"""Modules that other rooms may import; all else is this room's own."""
