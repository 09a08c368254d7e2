"""Parameters from measurements of known things: bench, stand, rotor, estimates, networks, finite elements."""

OPEN = (
    "autopilot",
    "bench",
    "bench_tests",
    "black_box",
    "clocks",
    "fem.bench",
    "fem.placement",
    "fem.studies",
    "grey_box",
    "inertias",
    "loadcell",
    "networks",
    "rigid_body_residuals",
    "rotor",
    "stand",
)
"""Modules that other rooms may import; all else is this room's own."""
