"""Parameters from measurements of known things: bench, stand, rotor, estimates, networks, finite elements."""

OPEN = (
    "autopilot.parameters",
    "autopilot.thrust",
    "bench.loadcell",
    "bench.reconstruct",
    "bench.static",
    "black_box",
    "clocks",
    "excitation",
    "fem.bench",
    "fem.placement",
    "fem.studies",
    "grey_box",
    "networks",
    "rigid_body_residuals",
    "rotor",
    "stand",
)
"""Modules that other rooms may import; all else is this room's own."""
